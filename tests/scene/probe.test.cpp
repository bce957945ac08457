// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>
#include <compmark/scene/probe.hpp>

#include <cmath>
#include <functional>

#include "scene/cube_dialects.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

/// A capture that calls for nothing: twelve cameras around a cube of 64 points, grey photographs with a border of many colours, a feature
/// for every point in every view. What is planted is changed before it is written.
struct Plant {
  CubeCapture capture = cube_capture();
  ColmapModel model;
  std::vector<ImageBytes> images;

  Plant() {
    capture.points.clear();
    for (int i = 0; i < 64; ++i)
      capture.points.push_back({0.3 * (i % 4) - 0.45, 0.3 * (i / 4 % 4) - 0.45, 0.3 * (i / 16) - 0.45});
    for (std::size_t k = 0; k < capture.cameras.size(); ++k) images.push_back(photograph(120, 3, 255));
  }
  static ImageBytes photograph(int level, int channels, int alpha) {
    ImageBytes image{16, 12, channels, {}};
    for (int i = 0; i < 16 * 12; ++i) {
      const int x = i % 16, y = i / 16;
      const bool border = x == 0 || y == 0 || x == 15 || y == 11;
      for (int c = 0; c < channels; ++c)
        image.pixels.push_back(static_cast<std::uint8_t>(c == 3 ? alpha : border ? 8 * x + 9 * y : level));
    }
    return image;
  }
  /// Cameras and points may have been changed: the model is made from them.
  void make_model() {
    model = cube_colmap(capture);
    for (std::size_t k = 0; k < capture.cameras.size(); ++k) {
      ColmapImage& image = model.images[static_cast<std::uint32_t>(3 * k + 2)];
      const std::uint32_t id = static_cast<std::uint32_t>(k + 1);
      const Camera<double>& camera = capture.cameras[k];
      model.cameras[id] = {1, 16, 12, {camera.fx, camera.fy, camera.cx, camera.cy}};
      image.camera_id = id;
      for (std::size_t i = 0; i < capture.points.size(); ++i) {
        const std::array<double, 3> p = detail::to_camera(camera, capture.points[i]);
        const double x = camera.fx * p[0] / p[2] + camera.cx, y = camera.fy * p[1] / p[2] + camera.cy;
        if (p[2] > 0 && x > 1 && y > 1 && x < 15 && y < 11) image.observations.push_back({x, y, 10 + i});
      }
    }
  }
  [[nodiscard]] std::string write_and_probe(const std::filesystem::path& folder) const {
    put_colmap_binary(folder / "sparse/0", model);
    std::filesystem::create_directories(folder / "images");
    for (std::size_t k = 0; k < images.size(); ++k)
      REQUIRE(write_png(folder / "images" / cube_image(k), images[k]).ok());
    const Result<Dataset> dataset = open_dataset(folder, {});
    REQUIRE(dataset.ok());
    const Result<std::vector<ProbedEffect>> effects = probe_scene(*dataset);
    REQUIRE(effects.ok());
    std::string names;
    for (const ProbedEffect& e : *effects) {
      CHECK(!e.evidence.empty());
      CHECK((e.effect == SceneEffect::forward_facing        ? e.value < e.limit
             : e.effect == SceneEffect::constant_background ? e.value < e.limit
                                                            : e.value > e.limit));
      names += (names.empty() ? "" : " ") + std::string(effect_name(e.effect));
    }
    return names;
  }
};

std::string probe_with(const std::function<void(Plant&)>& cameras,
                       const std::function<void(Plant&, const TemporaryFolder&)>& rest = {}) {
  const TemporaryFolder folder;
  Plant plant;
  if (cameras) cameras(plant);
  plant.make_model();
  if (rest) rest(plant, folder);
  return plant.write_and_probe(folder.path());
}

/// Moves a camera along its own axis, towards the cube where positive.
void approach(Camera<double>& camera, double distance) {
  for (std::size_t c = 0; c < 3; ++c) camera.center_world[c] += distance * camera.rotation_camera_world[6 + c];
}

}  // namespace

TEST_CASE("scene/probe: a plain capture calls for nothing") { CHECK(probe_with({}) == ""); }

TEST_CASE("scene/probe: exactly the effect that was planted is called for") {
  using Folder = const TemporaryFolder&;
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (ImageBytes& image : p.images) image = Plant::photograph(120, 4, 128);
        }) == "alpha");
  CHECK(probe_with({}, [](Plant& p, Folder) {  // an opaque alpha channel is none
          for (ImageBytes& image : p.images) image = Plant::photograph(120, 4, 255);
        }) == "");
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (ImageBytes& image : p.images) {
            for (int i = 0; i < 16 * 12; ++i) {
              const bool border = i % 16 == 0 || i % 16 == 15 || i < 16 || i >= 11 * 16;
              for (std::size_t c = 0; border && c < 3; ++c) image.pixels[3 * static_cast<std::size_t>(i) + c] = 250;
            }
          }
        }) == "constant_background");
  CHECK(probe_with([](Plant& p) {
          for (Camera<double>& camera : p.capture.cameras) camera.cx += 0.4;
        }) == "principal_point");
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (auto& [id, camera] : p.model.cameras) camera = {4, 16, 12, {20, 20, 8, 6, 0.2, 0, 0, 0}};
        }) == "lens_distortion");
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (auto& [id, camera] : p.model.cameras) camera = {5, 16, 12, {20, 20, 8, 6, 0, 0, 0, 0}};
        }) == "fisheye");
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (std::size_t k = 0; k < p.images.size(); ++k)
            p.images[k] = Plant::photograph(k % 2 == 0 ? 110 : 130, 3, 255);
        }) == "exposure");  // half the photographs brighter by 18 %: a deviation of 0.083
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (std::size_t k = 0; k < p.images.size(); ++k)
            p.images[k] = Plant::photograph(k % 2 == 0 ? 118 : 122, 3, 255);
        }) == "");  // 3 %: below the limit
  // One camera at two fifths of the distance: the ratio of distances is 2.5, the quantiles of the scale do not move.
  CHECK(probe_with([](Plant& p) {
          for (int i = 0; i < 30; ++i) p.capture.cameras.push_back(p.capture.cameras[static_cast<std::size_t>(i % 12)]);
          approach(p.capture.cameras[5], 2.56);
          p.images.assign(p.capture.cameras.size(), Plant::photograph(120, 3, 255));
        }) == "distance_input");
  // Half the cameras with a lens three times as long, from the same distance.
  CHECK(probe_with([](Plant& p) {
          for (std::size_t k = 0; k < 12; k += 2) p.capture.cameras[k].fx = p.capture.cameras[k].fy = 60;
        }) == "anti_aliasing");
  CHECK(probe_with([](Plant& p) {  // a few points fifty times as far away, seen by all cameras that look that way
          for (std::size_t k = 0; k < 12; ++k) {
            const Camera<double>& c = p.capture.cameras[k];
            for (const double d : {100.0, 200.0}) {
              std::array<double, 3> point = c.center_world;
              for (std::size_t i = 0; i < 3; ++i) point[i] += d * c.rotation_camera_world[6 + i];
              p.capture.points.push_back(point);
            }
          }
          for (std::size_t k = 0; k < 12;
               ++k) {  // pairs of cameras at nearly one place, so that these points are seen twice
            Camera<double> twin = p.capture.cameras[k];
            twin.center_world[2] += 0.01;
            p.capture.cameras.push_back(twin);
          }
          p.images.assign(p.capture.cameras.size(), Plant::photograph(120, 3, 255));
        }) == "far_field");
  CHECK(probe_with([](Plant& p) {
          const Camera<double> first = p.capture.cameras[0];
          for (std::size_t k = 0; k < 12; ++k) {
            p.capture.cameras[k] = first;
            for (std::size_t c = 0; c < 3; ++c)
              p.capture.cameras[k].center_world[c] += 0.1 * static_cast<double>(k) * first.rotation_camera_world[c] / 2;
          }
        }) == "forward_facing");
  CHECK(probe_with({}, [](Plant&, Folder folder) { put_image(folder.path() / "masks/03.png", 16, 12, 1); }) == "masks");
}

TEST_CASE("scene/probe: gains of photographs are found through points that disagree") {
  // Eight views with known gains; a fifth of the points change their brightness at random (highlights). Medians do not care.
  std::vector<detail::PointBrightness> brightness;
  double mean = 0, square = 0;
  for (std::size_t v = 0; v < 8; ++v) {
    const double gain = 0.02 * static_cast<double>(v * v % 7);
    mean += gain / 8;
    square += gain * gain / 8;
  }
  for (std::size_t p = 0; p < 200; ++p) {
    for (std::size_t v = 0; v < 8; ++v) {
      const double outlier = p % 5 == 0 ? std::sin(static_cast<double>(p * 31 + v * 17)) : 0;
      brightness.push_back(
          {v, p, 4 + 0.01 * static_cast<double>(p % 13) + 0.02 * static_cast<double>(v * v % 7) + outlier});
    }
  }
  CHECK(detail::gain_deviation(brightness, 8) == doctest::Approx(std::sqrt(square - mean * mean)).epsilon(0.05));
  for (detail::PointBrightness& b : brightness) b.log_value -= 0.02 * static_cast<double>(b.view * b.view % 7);
  CHECK(detail::gain_deviation(brightness, 8) < 0.005);
}
