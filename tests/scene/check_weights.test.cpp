// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/check_weights.hpp"

#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>

#include <functional>
#include <string>

#include "scene/cube_dialects.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

using Pixel = std::function<std::array<int, 4>(std::size_t image, int x, int y)>;

/// What is said of a capture of twelve photographs with these pixels; "" is nothing.
std::string checked(const Pixel& pixel, const std::string& lens = "",
                    LensTreatment treatment = LensTreatment::undistort) {
  const CubeCapture capture = cube_capture();
  const TemporaryFolder folder;
  for (std::size_t i = 0; i < capture.cameras.size(); ++i) {
    ImageBytes image{16, 12, 4, {}};
    for (int k = 0; k < 16 * 12; ++k) {
      for (const int v : pixel(i, k % 16, k / 16)) image.pixels.push_back(static_cast<std::uint8_t>(v));
    }
    std::filesystem::create_directories(folder.path() / "images");
    REQUIRE(write_png(folder.path() / "images" / cube_image(i), image).ok());
  }
  put(folder.path() / "transforms.json", cube_transforms(capture, R"("fl_x": 20, "w": 16, "h": 12)" + lens,
                                                         [](std::size_t i) { return "images/" + cube_image(i); }));
  DatasetSettings settings;
  settings.lens = treatment;
  const Result<Dataset> dataset = open_dataset(folder.path(), settings);
  REQUIRE(dataset.ok());
  ImageStore store(*dataset, settings);
  const Result<Done> result = check_weights(*dataset, store);
  return result.ok() ? std::string() : result.error().line();
}

}  // namespace

TEST_CASE(
    "scene/check_weights: photographs of one colour teach nothing; a single pixel, or a second colour, is something") {
  const auto flat = [](int level, int alpha) {
    return [=](std::size_t, int, int) { return std::array<int, 4>{level, level, level, alpha}; };
  };
  CHECK(checked(flat(0, 255)).find("are the colour 0 0 0 everywhere, all 10 that are trained on") != std::string::npos);
  CHECK(checked(flat(255, 255)).find("255 255 255") != std::string::npos);
  CHECK(checked([](std::size_t i, int x, int y) {
          return std::array<int, 4>{x, y, static_cast<int>(i), 0};
        }).find("transparent") != std::string::npos);
  CHECK(checked([](std::size_t i, int x, int y) {
          return std::array<int, 4>{0, 0, i == 5 && x == 3 && y == 3 ? 9 : 0, 255};
        }).empty());
  CHECK(checked([](std::size_t i, int, int) { return std::array<int, 4>{i == 5 ? 9 : 0, 0, 0, 255}; }).empty());
  // Test views are no help.
  CHECK(!checked([](std::size_t i, int x, int) { return std::array<int, 4>{i % 8 == 0 ? x : 0, 0, 0, 255}; }).empty());
}

TEST_CASE("scene/check_weights: a lens that leaves no pixel of a photograph is named before the training") {
  const auto ramp = [](std::size_t i, int x, int y) {
    return std::array<int, 4>{9 * x, 9 * y, static_cast<int>(i), 255};
  };
  CHECK(checked(ramp).empty());
  CHECK(checked(ramp, R"(, "k1": -0.05)").empty());
  const std::string line = checked(ramp, R"(, "k1": 900000.0)");
  CHECK(line.find("lens") != std::string::npos);
  CHECK(line.find("--lens ignore") != std::string::npos);
  CHECK(checked(ramp, R"(, "k1": 900000.0)", LensTreatment::ignore).empty());
}
