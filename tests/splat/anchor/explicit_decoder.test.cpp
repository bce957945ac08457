// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/anchor/explicit_decoder.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/anchor/table.hpp"

namespace {

using namespace compmark;

template <class T>
std::array<T*, 14> columns_of(const GaussianColumns<T>& c) {
  return {c.mean[0],     c.mean[1],     c.mean[2],     c.scale[0], c.scale[1], c.scale[2], c.rotation[0],
          c.rotation[1], c.rotation[2], c.rotation[3], c.opacity,  c.color[0], c.color[1], c.color[2]};
}

/// Random Gaussians, a camera near them, and a loss that is linear in what the decoder gives.
template <class T, int degree>
struct ExplicitScene {
  using Decoder = ExplicitDecoder<T, degree>;
  ParameterArena<T> arena;
  AnchorHandles anchors;
  std::vector<std::uint32_t> visible;
  std::array<double, 3> center{0.4, -0.3, 2.5};
  Decoder decoder;
  typename Decoder::Context context;
  GaussianBatch<T> out;

  explicit ExplicitScene(std::size_t rows) {
    anchors = add_anchor_blocks(arena, rows, Decoder::shape);
    const auto fill = [&](BlockHandle block, double mean, double deviation) {
      std::size_t i = 0;
      for (T& value : arena.values(block).flat())
        value = static_cast<T>(mean + deviation * Random(3, 1, block.index).normal(i++));
    };
    fill(anchors.position, 0, 1);
    fill(anchors.offset, 0, 0.5);
    fill(anchors.scaling, -1, 0.3);
    fill(anchors.feature, 0, 0.5);
    for (std::size_t row = 0; row < rows; row += 2) visible.push_back(static_cast<std::uint32_t>(row));
  }
  AnchorColumns<const T> table() const { return anchor_values(arena, anchors); }
  template <class E>
  std::size_t forward(E& executor) {
    return decoder.forward(table(), visible, center, 0, arena, {}, out, context, executor);
  }
  static T weight(std::size_t row, std::size_t column) {
    return static_cast<T>(Random(5, 0, 0).normal(row * 14 + column));
  }
  double loss() {
    SerialExecutor executor;
    const std::size_t count = forward(executor);
    double sum = 0;
    for (std::size_t c = 0; c < 14; ++c) {
      for (std::size_t i = 0; i < count; ++i)
        sum += static_cast<double>(weight(context.slot[i], c)) *
               static_cast<double>(columns_of(std::as_const(out).columns())[c][i]);
    }
    return sum;
  }
  template <class E>
  void backward(E& executor) {
    const std::size_t count = forward(executor);
    GaussianBatch<T> d;
    d.resize(count);
    for (std::size_t c = 0; c < 14; ++c) {
      for (std::size_t i = 0; i < count; ++i) columns_of(d.columns())[c][i] = weight(context.slot[i], c);
    }
    decoder.backward(table(), visible, center, 0, arena, {}, std::as_const(d).columns(),
                     anchor_gradients(arena, anchors), context, executor);
  }
};

}  // namespace

TEST_CASE_TEMPLATE("anchor/explicit_decoder: gradients are those of central differences, the view's direction included",
                   Degree, std::integral_constant<int, 0>, std::integral_constant<int, 1>,
                   std::integral_constant<int, 2>, std::integral_constant<int, 3>) {
  ExplicitScene<double, Degree::value> scene(12);
  SerialExecutor executor;
  scene.backward(executor);
  const double h = 1e-6;
  double worst = 0, without_direction = 0;
  for (const BlockHandle block :
       {scene.anchors.position, scene.anchors.offset, scene.anchors.scaling, scene.anchors.feature}) {
    const MatrixView<double> values = scene.arena.values(block);
    const MatrixView<double> gradients = scene.arena.gradients(block);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::size_t column = i % values.columns;
      if (block.index == scene.anchors.scaling.index && column < 3) continue;  // the unit of moves is not trained
      const double kept = values.data[i];
      values.data[i] = kept + h;
      const double more = scene.loss();
      values.data[i] = kept - h;
      const double less = scene.loss();
      values.data[i] = kept;
      const double difference = (more - less) / (2 * h);
      worst = std::max(worst, std::abs(difference - gradients.data[i]) / std::max(1.0, std::abs(difference)));
      if (block.index == scene.anchors.position.index && i / values.columns % 2 == 0) {
        // What the mean alone gives: the weight itself.
        const double mean_alone = scene.weight(i / values.columns, column);
        without_direction = std::max(without_direction, std::abs(difference - mean_alone));
      }
    }
  }
  CHECK(worst < 1e-7);                                     // measured 4e-9
  if (Degree::value > 0) CHECK(without_direction > 1e-3);  // negative control, SH1: the plain path is not enough
  if (Degree::value == 0) CHECK(without_direction < 1e-7);
}

TEST_CASE("anchor/explicit_decoder: zeros are what 3DGS begins with, and the file's formulas hold") {
  ExplicitScene<double, 3> scene(4);
  for (const BlockHandle block : {scene.anchors.offset, scene.anchors.feature})
    for (double& value : scene.arena.values(block).flat()) value = 0;
  SerialExecutor executor;
  REQUIRE(scene.forward(executor) == 2);
  const auto g = std::as_const(scene.out).columns();
  CHECK(g.opacity[0] == doctest::Approx(0.1).epsilon(1e-12));
  CHECK(g.rotation[0][0] == 1);
  CHECK(g.color[1][0] == 0.5);
  CHECK(g.mean[2][1] == scene.table().position(2, 2));
  CHECK(g.scale[1][1] == std::exp(scene.table().scaling(2, 4)));
  // A constant colour: f_0 Y_0.
  scene.arena.values(scene.anchors.feature)(0, ExplicitLayout<3>::color) = 3;
  static_cast<void>(scene.forward(executor));
  CHECK(std::as_const(scene.out).columns().color[0][0] == doctest::Approx(0.5 + sh_constant).epsilon(1e-12));
}

TEST_CASE("anchor/explicit_decoder: harmonics above a degree are cleared, in every channel, and nothing else") {
  using Layout = ExplicitLayout<3>;
  for (int degree = 0; degree <= 3; ++degree) {
    CAPTURE(degree);
    std::vector<double> rows(2 * Layout::width);
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = 1 + static_cast<double>(i);
    Layout::clear_harmonics_above(degree, MatrixView<double>{rows.data(), 2, Layout::width});
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::size_t column = i % Layout::width;
      const bool above = column >= Layout::color && (column - Layout::color) % Layout::coefficients >= sh_count(degree);
      CHECK(rows[i] == (above ? 0.0 : 1 + static_cast<double>(i)));
    }
  }
}

TEST_CASE("anchor/explicit_decoder: same bits at any number of threads; rows that are not visible are not touched") {
  ExplicitScene<float, 3> one(5000), many(5000);
  SerialExecutor serial;
  ThreadExecutor threads(4);
  one.backward(serial);
  many.backward(threads);
  const auto a = columns_of(std::as_const(one.out).columns()), b = columns_of(std::as_const(many.out).columns());
  bool same = one.context.gaussians == many.context.gaussians;
  for (std::size_t c = 0; c < 14; ++c) same = same && std::equal(a[c], a[c] + one.context.gaussians, b[c]);
  CHECK(same);
  const auto ga = one.arena.all_gradients(), gb = many.arena.all_gradients();
  CHECK(std::equal(ga.begin(), ga.end(), gb.begin()));
  const MatrixView<const float> d = std::as_const(one.arena).gradients(one.anchors.feature);
  CHECK(std::all_of(d.row(1), d.row(1) + d.columns, [](float value) { return value == 0; }));
  CHECK(std::any_of(d.row(2), d.row(2) + d.columns, [](float value) { return value != 0; }));
  // Backward adds.
  const std::vector<float> before(ga.begin(), ga.end());
  one.backward(serial);
  bool twice = true;
  for (std::size_t i = 0; i < before.size(); ++i) twice = twice && one.arena.all_gradients()[i] == 2 * before[i];
  CHECK(twice);
}

TEST_CASE("anchor/explicit_decoder: an anchor that is not finite gives no Gaussian and is counted, the others stay") {
  ExplicitScene<float, 1> scene(1200);
  SerialExecutor executor;
  const std::size_t all = scene.forward(executor);
  scene.arena.values(scene.anchors.feature)(4, 7) = std::numeric_limits<float>::quiet_NaN();
  scene.arena.values(scene.anchors.scaling)(1100, 5) = std::numeric_limits<float>::infinity();
  CHECK(scene.forward(executor) == all - 2);
  CHECK(scene.context.non_finite_anchors == 2);
  CHECK(scene.context.opacity_sum[2] == 0);
  CHECK(scene.context.slot[2] == 6);  // row 4 is left out
  const auto g = std::as_const(scene.out).columns();
  CHECK(std::all_of(g.opacity, g.opacity + all - 2, [](float value) { return value > 0 && value < 1; }));
  scene.backward(executor);
  const auto d = scene.arena.all_gradients();
  CHECK(std::all_of(d.begin(), d.end(), [](float value) { return std::isfinite(value); }));
}

TEST_CASE("anchor/explicit_decoder: a camera in a Gaussian's centre has no direction, and nothing is NaN (PR9)") {
  ExplicitScene<double, 3> scene(2);
  const auto table = scene.table();
  for (std::size_t axis = 0; axis < 3; ++axis)
    scene.center[axis] = table.position(0, axis) + table.offset(0, axis) * std::exp(table.scaling(0, axis));
  SerialExecutor executor;
  scene.backward(executor);
  const auto d = scene.arena.all_gradients();
  CHECK(std::all_of(d.begin(), d.end(), [](double value) { return std::isfinite(value); }));
  CHECK(std::isnan(0.0 / std::hypot(0.0, 0.0, 0.0)));  // negative control: the plain direction
}
