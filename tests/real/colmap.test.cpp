// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/image_store.hpp>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "support/data.hpp"

using namespace compmark;

namespace {

struct ExpectedCapture {
  const char* name;
  std::size_t views, test, points;
  std::size_t warnings;
};
constexpr ExpectedCapture scenes[] = {{"colmap_king", 23, 3, 1443, 0},
                                      {"colmap_cup", 77, 10, 9262, 0},
                                      {"colmap_gerrard_hall", 100, 13, 11726, 0},
                                      {"llff_fern", 20, 3, 10091, 4}};

/// Distances in pixels between the features COLMAP found and its points through our camera, sorted. `quaternion_last`
/// reads the rotation in the wrong order: the negative control.
std::vector<double> reprojection_errors(const Dataset& dataset, const ColmapModel& model,
                                        bool quaternion_last = false) {
  std::vector<double> errors;
  for (const auto& [id, image] : model.images) {
    const auto view = std::find_if(dataset.views.begin(), dataset.views.end(),
                                   [&, name = image.name](const View& v) { return v.name == name; });
    REQUIRE(view != dataset.views.end());
    Camera<double> camera = view->camera;
    if (quaternion_last) {
      const auto& q = image.rotation_wxyz;
      camera.rotation_camera_world =
          pose_from_quaternion({q[3], q[0], q[1], q[2]}, image.translation)->rotation_camera_world;
    }
    const ColmapCamera& original = model.cameras.at(image.camera_id);
    const double sx = static_cast<double>(camera.width) / static_cast<double>(original.width);
    const double sy = static_cast<double>(camera.height) / static_cast<double>(original.height);
    for (const ColmapObservation& observation : image.observations) {
      const auto point = model.points.find(observation.point_id);
      if (point == model.points.end()) continue;
      std::array<double, 3> p{};
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j)
          p[i] += camera.rotation_camera_world[3 * i + j] * (point->second.position[j] - camera.center_world[j]);
      }
      errors.push_back(std::hypot(camera.fx * p[0] / p[2] + camera.cx - observation.x * sx,
                                  camera.fy * p[1] / p[2] + camera.cy - observation.y * sy));
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

}  // namespace

TEST_CASE("real/colmap: the scenes open with their counts, every image decodes at its camera's size") {
  const auto data = testing::data_dir();
  if (!data) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  for (const ExpectedCapture& scene : scenes) {
    CAPTURE(scene.name);
    const Result<Dataset> dataset = open_dataset(*data / scene.name, {});
    REQUIRE(dataset.ok());
    CHECK(dataset->kind == "colmap");
    CHECK(dataset->views.size() == scene.views);
    CHECK(dataset->indices(Split::test).size() == scene.test);
    CHECK(dataset->points.size() == scene.points);
    CHECK(dataset->warnings.size() == scene.warnings);
    CHECK(!dataset->points_are_random);
    ImageStore store(*dataset, {});
    for (std::size_t i = 0; i < dataset->views.size(); i += 7) {
      const Result<const StoredImage*> image = store.get(i);
      REQUIRE(image.ok());
      CHECK((*image)->width == dataset->views[i].camera.width);
      CHECK((*image)->height == dataset->views[i].camera.height);
    }
  }
}

TEST_CASE("real/colmap: points land on the features COLMAP found, at full size and downscaled (cases CA1, CA2)") {
  const auto data = testing::data_dir();
  if (!data) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  for (const ExpectedCapture& scene : scenes) {
    CAPTURE(scene.name);
    const Result<ColmapModel> model = read_colmap_model(*data / scene.name / "sparse" / "0", {true});
    REQUIRE(model.ok());
    double full = 0;
    for (const double downscale : {1.0, 2.0, 4.0, 8.0}) {
      CAPTURE(downscale);
      DatasetSettings settings;
      settings.downscale = downscale;
      const Result<Dataset> dataset = open_dataset(*data / scene.name, settings);
      REQUIRE(dataset.ok());
      const std::vector<double> errors = reprojection_errors(*dataset, *model);
      REQUIRE(errors.size() > 1000);
      const double median = errors[errors.size() / 2];
      if (downscale == 1) {
        full = median;
        MESSAGE(std::string(scene.name) << ": median reprojection error " << median << " px");
        CHECK(median < 1.5);
        CHECK(reprojection_errors(*dataset, *model, true)[errors.size() / 2] > 20);
      }
      CHECK(std::abs(median * downscale - full) < 0.05);  // scaled error stays the same: the true ratio is used
    }
  }
}

TEST_CASE("real/colmap: fern's files are paired by order and its lens is reported") {
  const auto data = testing::data_dir();
  if (!data) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  const Result<Dataset> dataset = open_dataset(*data / "llff_fern", {});
  REQUIRE(dataset.ok());
  for (std::size_t i = 0; i < 20; ++i) {
    char name[32];
    std::snprintf(name, sizeof name, "image%03zu.png", i);
    CHECK(dataset->views[i].image_path.filename() == name);
    CHECK(dataset->views[i].camera.width == 504);
    CHECK(dataset->views[i].camera.fx == doctest::Approx(3260.5263328805895 / 8).epsilon(1e-12));
  }
  // 0.01975 f r^3 with r = 0.7729 at the corner: 3.72 of 504 pixels.
  const bool reported = std::any_of(dataset->warnings.begin(), dataset->warnings.end(),
                                    [](const std::string& w) { return w.find("3.72") != std::string::npos; });
  CHECK(reported);
}
