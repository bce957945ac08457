// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/export/splat_refine.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "bake_scene.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/export/bake.hpp"
#include "compmark/splat/export/sh_fit.hpp"
#include "support/full_rasterizer.hpp"

using namespace compmark;
using testing::BakeRecipe;

namespace {

std::vector<std::vector<float>> columns_of(SplatTable& table) {
  std::vector<std::vector<float>> columns;
  table.for_each_column([&](std::vector<float>& column) { columns.push_back(column); });
  return columns;
}

/// Everything beyond the left half of the ring.
constexpr bool right_of_origin(const Camera<float>& camera) { return camera.center_world[0] > 0; }

struct FullViewRecipe : BakeRecipe {
  using Rasterizer = testing::FullRasterizer<BakeRecipe::Rasterizer, right_of_origin>;
};

}  // namespace

TEST_CASE(
    "export/splat_refine: where opacity depends on the view, refining gains at cameras it has not seen; means keep "
    "their bits") {
  const Model<BakeRecipe> model = testing::bake_model(150, 1.5, 1.5);
  const std::vector<Camera<double>> cameras = testing::orbit_cameras(40);
  std::vector<Camera<double>> held_out;
  for (std::size_t i = 3; i < 37; i += 6) held_out.push_back(testing::orbit_camera(i, 37));
  ThreadExecutor executor(2);
  ShFitReport fitted;
  SplatTable table = *fit_splats(model, std::span<const Camera<double>>(cameras), {}, fitted, executor);
  const std::vector<float> x = table.mean[0];
  const auto quality = [&] {
    const auto report = compare_bake(model, table, std::span<const Camera<double>>(held_out), {}, 0, executor);
    return report.ok() ? report->mean_bake_to_model : 0;
  };
  const double before = quality();
  SplatRefineSettings settings;
  settings.iterations = 200;
  const Result<SplatRefineReport> refined =
      refine_splats(model, table, std::span<const Camera<double>>(cameras), settings, executor);
  REQUIRE(refined.ok());
  const SplatRefineReport& report = *refined;
  const double after = quality();
  MESSAGE("fitted " << before << " dB, refined " << after << " dB");
  CHECK(after > before + 1);
  CHECK(report.last_mse < report.first_mse);
  CHECK(report.skipped_blocks == 0);
  CHECK(table.mean[0] == x);
}

TEST_CASE("export/splat_refine: the bits do not depend on the threads, and zero iterations change nothing") {
  const Model<BakeRecipe> model = testing::bake_model(60, 2, 1);
  const std::vector<Camera<double>> cameras = testing::orbit_cameras(8, 48);
  ShFitReport fitted;
  ThreadExecutor one(1), three(3);
  SplatTable start = *fit_splats(model, std::span<const Camera<double>>(cameras), {}, fitted, one);
  SplatTable a = start, b = start, c = start;
  SplatRefineSettings settings;
  settings.iterations = 10;
  REQUIRE(refine_splats(model, a, std::span<const Camera<double>>(cameras), settings, one).ok());
  REQUIRE(refine_splats(model, b, std::span<const Camera<double>>(cameras), settings, three).ok());
  CHECK(columns_of(a) == columns_of(b));
  CHECK(columns_of(a) != columns_of(start));
  settings.iterations = 0;
  REQUIRE(refine_splats(model, c, std::span<const Camera<double>>(cameras), settings, one).ok());
  CHECK(columns_of(c) == columns_of(start));
}

TEST_CASE("export/splat_refine: a view that the rasterizer has no memory for ends fit and refinement with its error") {
  const Model<BakeRecipe> plain = testing::bake_model(60, 2, 1);
  Model<FullViewRecipe> model;
  model.create(60, 1);
  const auto from = plain.arena.all_values();
  std::copy(from.begin(), from.end(), model.arena.all_values().begin());
  model.render = plain.render;
  std::vector<Camera<double>> all = testing::orbit_cameras(8, 48), left;
  for (const Camera<double>& camera : all) {
    if (camera.center_world[0] < 0) left.push_back(camera);
  }
  ThreadExecutor executor(2);
  ShFitReport fitted;
  Result<SplatTable> table = fit_splats(model, std::span<const Camera<double>>(left), {}, fitted, executor);
  REQUIRE(table.ok());
  const auto refused = fit_splats(model, std::span<const Camera<double>>(all), {}, fitted, executor);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().kind == ErrorKind::exhausted);
  SplatRefineSettings settings;
  settings.iterations = 8;
  CHECK(refine_splats(model, *table, std::span<const Camera<double>>(left), settings, executor).ok());
  const auto ended = refine_splats(model, *table, std::span<const Camera<double>>(all), settings, executor);
  REQUIRE_FALSE(ended.ok());
  CHECK(ended.error().kind == ErrorKind::exhausted);
}
