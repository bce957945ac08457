// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/transforms_lens.hpp"

#include <doctest/doctest.h>

#include <string>

using namespace compmark;

namespace {

Result<Lens> lens_of(const std::string& file, const std::string& frame = "{}") {
  const nlohmann::json whole = nlohmann::json::parse(file), one = nlohmann::json::parse(frame);
  return detail::transforms_lens(detail::TransformsFields<nlohmann::json>(whole, one, "t.json", "frames[0]"));
}

void refused(const std::string& file, const std::string& field, const std::string& remedy,
             const std::string& frame = "{}") {
  CAPTURE(file);
  const Result<Lens> lens = lens_of(file, frame);
  REQUIRE(!lens.ok());
  CHECK(lens.error().file == "t.json");
  CHECK(lens.error().field == field);
  CHECK(lens.error().remedy.find(remedy) != std::string::npos);
}

}  // namespace

TEST_CASE("scene/transforms_lens: coefficients count under every perspective name, as nerfstudio takes them") {
  const Lens bent{LensModel::opencv, {0.1, -0.2, 0.01, 0.02}};
  for (const char* name : {"PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "PERSPECTIVE"}) {
    const std::string model = std::string(R"("camera_model": ")") + name + "\"";
    CAPTURE(name);
    CHECK(*lens_of("{" + model + R"(, "k1": 0.1, "k2": -0.2, "p1": 0.01, "p2": 0.02})") == bent);
    CHECK(*lens_of("{" + model + R"(, "distortion_params": [0.1, -0.2, 0, 0, 0.01, 0.02]})") == bent);
    CHECK(*lens_of("{" + model + "}", R"({"k1": 0.1, "k2": -0.2, "p1": 0.01, "p2": 0.02})") == bent);
    CHECK(*lens_of("{" + model + R"(, "k3": 0.3})") == Lens{LensModel::full_opencv, {0, 0, 0, 0, 0.3}});
    // Zeros, as nerfstudio writes them, are a pinhole.
    CHECK(*lens_of("{" + model + R"(, "k1": 0, "k2": 0.0, "k3": 0, "k4": 0, "p1": 0, "p2": -0.0})") == Lens{});
    refused("{" + model + R"(, "k4": 0.1})", "k4", "OPENCV_FISHEYE");
    refused("{" + model + R"(, "k6": 0.1})", "k6", "FULL_OPENCV");
    refused("{" + model + R"(, "distortion_params": [0, 0, 0, 0.1]})", "distortion_params", "FULL_OPENCV");
    CHECK(lens_of("{" + model + R"(, "is_fisheye": true, "k4": 0.1})")->model == LensModel::opencv_fisheye);
  }
  CHECK(*lens_of(R"({"k1": 1, "k2": -0.2, "p1": 0.01, "p2": 0.02})", R"({"k1": 0.1})") == bent);  // the frame's own
}

TEST_CASE("scene/transforms_lens: a fisheye has no tangential part and no k5") {
  CHECK(*lens_of(R"({"camera_model": "OPENCV_FISHEYE", "distortion_params": [0.1, 0.2, 0.3, 0.4, 0, 0]})") ==
        Lens{LensModel::opencv_fisheye, {0.1, 0.2, 0.3, 0.4}});
  CHECK(*lens_of(R"({"camera_model": "OPENCV_FISHEYE", "is_fisheye": false})") == Lens{LensModel::opencv_fisheye, {}});
  refused(R"({"is_fisheye": true, "p1": 0.1})", "p1", "undistort");
  refused(R"({"is_fisheye": true})", "frames[0].k5", "undistort", R"({"k5": 0.1})");
  refused(R"({"camera_model": "OPENCV_FISHEYE", "distortion_params": [0.1, 0, 0, 0, 0, 0.2]})", "distortion_params",
          "undistort");
  refused(R"({"camera_model": "FULL_OPENCV", "is_fisheye": true})", "is_fisheye", "correct one");
}

TEST_CASE("scene/transforms_lens: what only other programs read is refused and not taken for a pinhole") {
  for (const char* value : {"\"yes\"", "1", "0", "null", "[]"})
    refused(std::string(R"({"is_fisheye": )") + value + "}", "is_fisheye", "true or false");
  refused(R"({"ftheta_p0": 0, "ftheta_p1": 0.01})", "ftheta_p1", "OPENCV_FISHEYE");
  refused("{}", "frames[0].ftheta_p4", "undistort", R"({"ftheta_p4": 1e-12})");
  refused(R"({"ftheta_p0": "x"})", "ftheta_p0", "undistort");
  CHECK(*lens_of(R"({"ftheta_p0": 0, "ftheta_p1": 0.0, "latlong": false, "equirectangular": null})") == Lens{});
  for (const char* key : {"latlong", "equirectangular", "orthographic"})
    refused(std::string("{\"") + key + "\": true}", key, "perspective views");
  refused(R"({"camera_model": "EQUIRECTANGULAR", "is_fisheye": true})", "camera_model", "perspective views");
  for (const char* name : {"FISHEYE624", "ORTHOPHOTO", "VR180_L", "OMNIDIRECTIONALSTEREO_R", "FOV", "opencv"})
    refused(std::string(R"({"camera_model": ")") + name + "\"}", "camera_model", "export");
}
