// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/anchor/split_and_clone.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;
using Control = SplitAndClone<float>;
using FileUnits = ExplicitLayout<0>;

/// Gaussians in a row along x, every one judged, of gradient 0 and opacity 1/2 unless a test says otherwise.
struct SplitScene {
  ParameterArena<float> arena;
  AnchorHandles anchors;
  BlockHandle residual;
  Control::State state;
  Control control;
  AdjustmentInputs context;

  explicit SplitScene(std::size_t rows, const Control::Settings& settings = {}) : control(settings) {
    anchors = add_anchor_blocks(arena, rows, ExplicitDecoder<float, 0>::shape);
    residual =
        arena.add("anchor.residual", rows, 8, RowKind::anchor, BlockRole::rendering, LearningSchedule::constant(0.001));
    arena.add("other", 3, 2, RowKind::fixed, BlockRole::rendering, LearningSchedule::constant(0.001));
    for (std::size_t i = 0; i < rows; ++i) {
      arena.values(anchors.position)(i, 0) = static_cast<float>(i);
      for (std::size_t axis = 0; axis < 3; ++axis) arena.values(anchors.scaling)(i, 3 + axis) = std::log(0.1f);
      arena.values(residual)(i, 5) = 0.01f * static_cast<float>(i);
    }
    context.ball = {{0, 0, 0}, 10, 20};
    control.prepare(rows, state);
    for (std::size_t i = 0; i < rows; ++i) {
      state.statistics.visits[i] = 100;
      state.statistics.opacity_sum[i] = 50;
      state.statistics.gradient_count[i] = 100;
    }
  }
  void heat(std::size_t row, float gradient = 0.001f) { state.statistics.gradient_sum[row] = 100 * gradient; }
  void set_scale(std::size_t row, float scale) {
    for (std::size_t axis = 0; axis < 3; ++axis) arena.values(anchors.scaling)(row, 3 + axis) = std::log(scale);
  }
  GrowthReport adapt() { return control.adapt(arena, anchors, state, context, detail::AnyRowEditReceiver{}); }
  std::size_t rows() const { return arena.layout().block(anchors.position).rows; }
  double opacity(std::size_t row) const {
    return 1 / (1 + std::exp(-(FileUnits::opacity_unit * static_cast<double>(arena.values(anchors.feature)(row, 0)) +
                               FileUnits::opacity_zero)));
  }
};

}  // namespace

TEST_CASE("anchor/split_and_clone: a small hot Gaussian is doubled, and both cover together what it did") {
  for (const float stored : {-3.0f, -1.0f, 0.0f, 0.3f, 0.9f, 3.0f, 8.0f}) {
    SplitScene scene(4);
    scene.arena.values(scene.anchors.feature)(2, 0) = stored;
    const double before = scene.opacity(2);
    scene.heat(2);
    const GrowthReport report = scene.adapt();
    CHECK(report.grown == 1);
    CHECK(report.pruned == 0);
    REQUIRE(scene.rows() == 5);
    for (const BlockHandle block :
         {scene.anchors.position, scene.anchors.scaling, scene.anchors.feature, scene.residual}) {
      const MatrixView<float> values = scene.arena.values(block);
      CHECK(std::equal(values.row(2), values.row(2) + values.columns, values.row(4)));
    }
    // Light that passes both, to 1e-4 of it or of what they take away: a stored opacity is a float.
    const double after = scene.opacity(2), passes = (1 - after) * (1 - scene.opacity(4));
    CHECK(passes == doctest::Approx(1 - before).epsilon(1e-4));
    CHECK(2 * after - after * after == doctest::Approx(before).epsilon(1e-4));
    if (before < 0.99) CHECK(1 - (1 - before) * (1 - before) > before * 1.005);  // negative control: as published
  }
}

TEST_CASE("anchor/split_and_clone: nearly transparent Gaussians keep their digits") {
  SplitScene scene(1);
  scene.arena.values(scene.anchors.feature)(0, 0) = -3.5f;
  const double before = scene.opacity(0);
  REQUIRE(before < 1e-8);
  scene.heat(0);
  static_cast<void>(scene.adapt());
  CHECK(scene.opacity(0) == doctest::Approx(before / 2).epsilon(1e-4));
  // Negative control: the formula as it is written, in float.
  const float plain = 1.0f - std::sqrt(1.0f - static_cast<float>(before));
  CHECK(plain == 0.0f);
}

TEST_CASE("anchor/split_and_clone: a large hot Gaussian becomes two smaller ones that are drawn from it") {
  const std::size_t rows = 4000;
  SplitScene scene(rows);
  const MatrixView<float> scaling = scene.arena.values(scene.anchors.scaling);
  for (std::size_t i = 0; i < rows; ++i) {
    scene.arena.values(scene.anchors.position)(i, 0) = 3;
    // Turned a quarter about z: its long axis, x, points along y.
    scene.arena.values(scene.anchors.feature)(i, 1) =
        static_cast<float>((std::sqrt(0.5) - 1) / FileUnits::rotation_unit);
    scene.arena.values(scene.anchors.feature)(i, 4) = static_cast<float>(std::sqrt(0.5) / FileUnits::rotation_unit);
    scaling(i, 3) = std::log(0.8f), scaling(i, 4) = std::log(0.4f), scaling(i, 5) = std::log(0.2f);
    scene.heat(i);
  }
  const GrowthReport report = scene.adapt();
  CHECK(report.grown == rows);  // two for each that leaves
  REQUIRE(scene.rows() == 2 * rows);
  const MatrixView<float> position = scene.arena.values(scene.anchors.position);
  std::array<double, 3> mean{}, square{};
  for (std::size_t i = 0; i < 2 * rows; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double away = static_cast<double>(position(i, axis)) - (axis == 0 ? 3 : 0);
      mean[axis] += away / (2.0 * rows);
      square[axis] += away * away / (2.0 * rows);
    }
  }
  // 8,000 draws: deviations are known to 1 / sqrt(16,000) = 0.8 %; five of them are allowed.
  CHECK(std::sqrt(square[0]) == doctest::Approx(0.4).epsilon(0.04));
  CHECK(std::sqrt(square[1]) == doctest::Approx(0.8).epsilon(0.04));
  CHECK(std::sqrt(square[2]) == doctest::Approx(0.2).epsilon(0.04));
  for (const double axis : mean) CHECK(std::abs(axis) < 0.05);
  CHECK(scene.arena.values(scene.anchors.scaling)(7, 3) == doctest::Approx(std::log(0.8 / 1.6)));
}

TEST_CASE("anchor/split_and_clone: transparent ones go, the last stays, and the limit keeps the highest gradients") {
  {
    SplitScene scene(5);
    scene.state.statistics.opacity_sum[1] = 0.1f;
    scene.heat(1);  // a Gaussian that goes has no children
    const GrowthReport report = scene.adapt();
    CHECK(report.pruned == 1);
    CHECK(report.grown == 0);
    CHECK(scene.rows() == 4);
    CHECK(scene.arena.values(scene.anchors.position)(1, 0) == 2);
    CHECK(scene.arena.values(scene.residual)(1, 5) == 0.02f);
  }
  {
    SplitScene scene(3);
    for (std::size_t i = 0; i < 3; ++i) scene.state.statistics.opacity_sum[i] = i == 1 ? 0.2f : 0.1f;
    const GrowthReport report = scene.adapt();
    CHECK(report.kept_last);
    CHECK(report.pruned == 2);
    REQUIRE(scene.rows() == 1);
    CHECK(scene.arena.values(scene.anchors.position)(0, 0) == 1);
  }
  {
    SplitScene scene(6, {.max_anchors = 8});
    for (std::size_t i = 0; i < 6; ++i) scene.heat(i, 0.001f * static_cast<float>(i + 1));
    scene.set_scale(5, 0.5f);  // split: one more, too
    const GrowthReport report = scene.adapt();
    CHECK(report.candidates == 6);
    CHECK(report.dropped_by_budget == 4);
    CHECK(scene.rows() == 8);
    CHECK(report.grown == 2);
  }
}

TEST_CASE(
    "anchor/split_and_clone: statistics that are no number change nothing and start again; far ones give no birth") {
  SplitScene scene(4);
  scene.state.statistics.gradient_sum[0] = std::numeric_limits<float>::quiet_NaN();
  scene.heat(3);
  scene.context.reach = 2.5;
  const GrowthReport report = scene.adapt();
  CHECK(report.non_finite == 1);
  CHECK(report.out_of_range == 1);
  CHECK(report.grown == 0);
  CHECK(scene.rows() == 4);
  CHECK(scene.state.statistics.gradient_sum[0] == 0);
  CHECK(scene.state.statistics.gradient_count[3] == 0);  // judged: the count begins again
}
