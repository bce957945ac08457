// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/codec/model/coded_model.hpp>
#include <compmark/codec/model/grid_anchors.hpp>
#include <compmark/core/random.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/anchor/contracted_space.hpp>
#include <compmark/splat/training/pipeline.hpp>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "support/small_scene.hpp"

namespace grid_anchors_test {
namespace {

using namespace compmark;
using GridRecipe = recipes::Scaffold;

constexpr double voxel = 0.03;
constexpr std::size_t near_anchors = 200, anchors = 600;

AnchorColumns<float> columns_of(Model<GridRecipe>& model) { return anchor_values(model.arena, model.anchors); }

/// Anchors of an unbounded scene, as wide as their cells: the first ones in the ball, on the grid, the others at up to
/// fifty radii.
Model<GridRecipe> unbounded(std::uint64_t seed) {
  const ContractedSpace space{{0.1, -0.2, 0.05}, 1.5};
  const Random random(seed, 0, random_stage("grid anchors"));
  Model<GridRecipe> model;
  model.create(anchors, 1);
  model.voxel_size = voxel;
  model.render.background = {0.2, 0.4, 0.6};
  GridRecipe::GaussianDecoder::initialise(model.arena, model.decoder, seed);
  const AnchorColumns<float> columns = columns_of(model);
  for (std::size_t i = 0; i < anchors; ++i) {
    std::array<double, 3> direction{random.normal(8 * i), random.normal(8 * i + 1), random.normal(8 * i + 2)};
    const double norm = std::hypot(direction[0], direction[1], direction[2]);
    const double radii = i < near_anchors ? 0.9 * random.uniform(8 * i + 3) : std::pow(50.0, random.uniform(8 * i + 3));
    std::array<double, 3> point{};
    for (std::size_t axis = 0; axis < 3; ++axis)
      point[axis] = space.origin[axis] + space.radius * radii * direction[axis] / norm;
    Cell cell{};
    REQUIRE(space.cell_of(point.data(), voxel, cell));
    const std::array<double, 3> center = space.center(cell, voxel);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      columns.position(i, axis) = static_cast<float>(center[axis]);
      for (const std::size_t part : {axis, axis + 3})
        columns.scaling(i, part) = static_cast<float>(std::log(voxel * space.stretch(center.data())));
    }
  }
  for (std::size_t i = 0; i < columns.feature.size(); ++i)
    columns.feature.data[i] = static_cast<float>(random.normal(100000 + i));
  for (std::size_t i = 0; i < columns.offset.size(); ++i)
    columns.offset.data[i] = static_cast<float>(random.normal(200000 + i));
  return model;
}

/// Where the k-th Gaussian of an anchor is, along an axis.
double place(const Model<GridRecipe>& model, std::size_t i, std::size_t k, std::size_t axis) {
  const auto columns = model.columns();
  return static_cast<double>(columns.position(i, axis)) +
         static_cast<double>(columns.offset(i, 3 * k + axis)) * std::exp(static_cast<double>(columns.scaling(i, axis)));
}

std::vector<float> rendered(Model<GridRecipe>& model, std::size_t view) {
  ThreadExecutor executor(1);
  Pipeline<GridRecipe> pipeline;
  typename Pipeline<GridRecipe>::Context context;
  const Camera<double> camera = testing::ring_camera(view, 4, 96, 80);
  REQUIRE_FALSE(pipeline.forward(model, camera, unseen_view, context, executor).raster.error);
  return {context.image.data, context.image.data + context.image.size()};
}
double psnr(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sum += difference * difference;
  }
  return -10 * std::log10(sum / static_cast<double>(a.size()));
}

TEST_CASE("codec/grid_anchors: a far field's anchors go onto the grid, and their Gaussians stay where they are") {
  const Model<GridRecipe> before = unbounded(7);
  CHECK_FALSE(anchor_voxels(before).ok());
  Model<GridRecipe> after = before;
  const Result<GridMoves> moves = move_onto_grid(after);
  REQUIRE(moves.ok());
  CHECK(anchor_voxels(after).ok());
  CHECK(moves->anchors > 350);  // of 400 outside the ball; some lie on the grid by chance
  CHECK(moves->anchors <= anchors - near_anchors);
  double worst = 0, longest = 0;
  for (std::size_t i = 0; i < anchors; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double scale = std::exp(static_cast<double>(before.columns().scaling(i, axis)));
      const double way = std::abs(static_cast<double>(before.columns().position(i, axis)) -
                                  static_cast<double>(after.columns().position(i, axis)));
      longest = std::max(longest, way);
      CHECK(way <= std::max(0.125 * scale, 0.5 * voxel) * (1 + 1e-6));
      for (std::size_t k = 0; k < 10; ++k) {
        // Rounding of a place (2^-24 of it), of an offset and of a logarithm, each once or twice.
        const double size = std::abs(place(before, i, k, axis)) + 5 * scale;
        worst = std::max(worst, std::abs(place(before, i, k, axis) - place(after, i, k, axis)) / size);
      }
    }
  }
  CHECK(worst < 4 * 0x1p-24);
  CHECK(moves->farthest == doctest::Approx(longest));
  // In the ball nothing changes, to the bit.
  for (std::size_t i = 0; i < near_anchors; ++i) {
    CHECK(
        std::equal(before.columns().offset.row(i), before.columns().offset.row(i) + 30, after.columns().offset.row(i)));
    CHECK(std::equal(before.columns().position.row(i), before.columns().position.row(i) + 3,
                     after.columns().position.row(i)));
  }
  Model<GridRecipe> twice = after;
  REQUIRE(move_onto_grid(twice).ok());
  CHECK(std::equal(after.arena.all_values().begin(), after.arena.all_values().end(), twice.arena.all_values().begin()));
}

TEST_CASE("codec/grid_anchors: renders stay; without the offsets they would not") {
  Model<GridRecipe> before = unbounded(8), after = before;
  REQUIRE(move_onto_grid(after).ok());
  Model<GridRecipe> naive = before;
  for (std::size_t i = 0; i < before.columns().position.size(); ++i)
    columns_of(naive).position.data[i] = after.columns().position.data[i];
  for (std::size_t view = 0; view < 4; ++view) {
    const std::vector<float> as_it_was = rendered(before, view);
    const double moved = psnr(as_it_was, rendered(after, view)), by_place = psnr(as_it_was, rendered(naive, view));
    CAPTURE(view);
    CAPTURE(moved);
    CAPTURE(by_place);
    CHECK(moved > 50);
    CHECK(by_place < moved - 6);
  }
}

TEST_CASE("codec/grid_anchors: an anchor whose base scale is smaller than its way gets a larger one") {
  Model<GridRecipe> before = unbounded(9);
  columns_of(before).position(0, 0) += static_cast<float>(0.4 * voxel);
  columns_of(before).scaling(0, 0) = static_cast<float>(std::log(1e-7));
  columns_of(before).position(1, 1) += static_cast<float>(0.4 * voxel);
  for (std::size_t k = 0; k < 10; ++k) columns_of(before).offset(1, 3 * k + 1) = 3;
  Model<GridRecipe> after = before;
  REQUIRE(move_onto_grid(after).ok());
  REQUIRE(anchor_voxels(after).ok());
  for (std::size_t k = 0; k < 10; ++k) {
    CHECK(std::abs(place(before, 0, k, 0) - place(after, 0, k, 0)) < 1e-7);
    CHECK(std::abs(after.columns().offset(0, 3 * k)) < 1.01);  // where it is not raised it would be about 10^5
    CHECK(std::abs(place(before, 1, k, 1) - place(after, 1, k, 1)) < 1e-6);
  }
}

TEST_CASE("codec/grid_anchors: a place beyond all cells is refused, and the model stays as it is") {
  for (const float place : {1e9f, std::numeric_limits<float>::quiet_NaN()}) {
    Model<GridRecipe> model = unbounded(10);
    columns_of(model).position(anchors - 1, 2) = place;
    const std::vector<float> before(model.arena.all_values().begin(), model.arena.all_values().end());
    const Result<GridMoves> moves = move_onto_grid(model);
    REQUIRE_FALSE(moves.ok());
    CHECK(moves.error().field == "anchor.position[599]");
    for (std::size_t i = 0; i < before.size(); ++i)
      CHECK((before[i] == model.arena.all_values()[i] || std::isnan(before[i])));
  }
}

}  // namespace
}  // namespace grid_anchors_test
