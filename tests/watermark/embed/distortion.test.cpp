// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/embed/distortion.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <type_traits>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/quantizer/int8_quantizer.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;

constexpr int dim = 13;  // not a multiple of a pack
constexpr std::size_t table_rows = 150;
template <class T, DistortionOptions options = DistortionOptions{}, class Quantizer = AdaptiveQuantizer<T>>
struct Layer {
  using Noise = QuantizationNoise<T, dim, options, Quantizer>;
  Noise noise;
  ParameterArena<T> arena;
  typename Noise::Handles handles;
  typename Noise::Context context;
  std::vector<T> feature, scaling, offset;              // before
  std::vector<T> out_feature, out_scaling, out_offset;  // after
  std::vector<T> slope_feature, slope_scaling;
  std::vector<std::uint32_t> rows;
  DistortionPhase phase;

  explicit Layer(typename Noise::Settings settings = {}) : noise(settings), handles(Noise::add_parameters(arena)) {
    Noise::initialise(arena, handles, 9);
    const Random random(4, 0, random_stage("distortion test"));
    const auto fill = [&](std::vector<T>& values, std::size_t count, std::uint64_t key, double scale, double shift) {
      for (std::size_t i = 0; i < count; ++i) {
        values.push_back(static_cast<T>(shift + scale * random.normal((key << 20) + i)));
      }
    };
    fill(feature, table_rows * dim, 1, 2.0, 0.0);
    fill(scaling, table_rows * 6, 2, 1.0, -3.0);
    fill(offset, table_rows * 6, 3, 1.0, 0.0);
    fill(slope_feature, table_rows * dim, 4, 1.0, 0.0);
    fill(slope_scaling, table_rows * 6, 5, 1.0, 0.0);
    const MatrixView<T> last =
        arena.values(handles.weight2);  // zero at the start of training: give the gradient something
    for (std::size_t i = 0; i < last.size(); ++i) last.data[i] = static_cast<T>(0.3 * random.normal((6u << 20) + i));
    for (std::uint32_t row = 0; row < table_rows; row += row % 3 == 0 ? 1 : 2) rows.push_back(row);
    phase.adaptive = true;
    phase.seed = 1;
    phase.iteration = 7;
  }
  static MatrixView<T> view(std::vector<T>& values, std::size_t columns) {
    return {values.data(), values.size() / columns, columns};
  }
  template <Executor E>
  DistortionReport forward(E& executor) {
    out_feature = feature;
    out_scaling = scaling;
    out_offset = offset;
    return noise.forward(arena, handles, rows, phase, view(out_feature, dim), view(out_scaling, 6), view(out_offset, 6),
                         context, executor);
  }
  /// sum over the listed rows of slope * table, plus the rate term
  double loss() {
    SerialExecutor serial;
    const DistortionReport report = forward(serial);
    double sum = report.rate_loss;
    for (const std::uint32_t row : rows) {
      for (std::size_t c = 0; c < dim; ++c) {
        sum += static_cast<double>(slope_feature[row * dim + c]) * static_cast<double>(out_feature[row * dim + c]);
      }
      for (std::size_t c = 0; c < 6; ++c) {
        sum += static_cast<double>(slope_scaling[row * 6 + c]) * static_cast<double>(out_scaling[row * 6 + c]);
      }
    }
    return sum;
  }
};
template <DistortionOptions options>
void check_gradients() {
  Layer<double, options> layer({.rate_weight = 0.3});
  layer.phase.scaling = 0.01;
  layer.phase.offset = 0.2;
  const auto loss = [&] { return layer.loss(); };
  static_cast<void>(loss());
  SerialExecutor serial;
  std::vector<double> d_feature(layer.feature.size(), 0.0), d_scaling(layer.scaling.size(), 0.0);
  for (const std::uint32_t row : layer.rows) {
    for (std::size_t c = 0; c < dim; ++c) d_feature[row * dim + c] = layer.slope_feature[row * dim + c];
    for (std::size_t c = 0; c < 6; ++c) d_scaling[row * 6 + c] = layer.slope_scaling[row * 6 + c];
  }
  layer.noise.backward(layer.arena, layer.handles, layer.rows, layer.view(d_feature, dim), layer.view(d_scaling, 6),
                       layer.context, serial);
  CHECK(testing::gradient_law(loss, layer.feature, d_feature) == "");
  CHECK(testing::gradient_law(loss, layer.scaling, d_scaling) == "");
  for (const BlockHandle block :
       {layer.handles.weight1, layer.handles.bias1, layer.handles.weight2, layer.handles.bias2}) {
    const std::vector<double> gradient(layer.arena.gradients(block).data,
                                       layer.arena.gradients(block).data + layer.arena.gradients(block).size());
    CAPTURE(layer.arena.layout().block(block).name);
    CHECK(testing::gradient_law(loss, layer.arena.values(block).flat(), gradient) == "");
  }
}

}  // namespace

TEST_CASE(
    "embed/distortion: gradients of features, scaling and network, a step a channel (central differences in double)") {
  check_gradients<DistortionOptions{.per_channel = true}>();
}
TEST_CASE(
    "embed/distortion: gradients of features, scaling and network, a step an anchor (central differences in double)") {
  check_gradients<DistortionOptions{.per_channel = false}>();
}

TEST_CASE("embed/distortion: the step keeps its digits where the published form is zero (QD1)") {
  double worst = 0;
  bool naive_is_zero = false;
  for (float r = -40.0f; r <= 40.0f; r += 0.03125f) {
    const long double exact = 2 / (1 + std::exp(-2 * static_cast<long double>(r)));
    const float q = adaptive_step(r, 1.0f, 0.0f);
    CHECK(q > 0);
    worst = std::max(worst, static_cast<double>(std::abs((static_cast<long double>(q) - exact) / exact)));
    const volatile float t = std::tanh(r);
    naive_is_zero = naive_is_zero || 1.0f + t == 0.0f;
    // ... and its slope is that of the exact function.
    const long double slope =
        4 / (1 + std::exp(-2 * static_cast<long double>(r))) / (1 + std::exp(2 * static_cast<long double>(r)));
    if (slope > 1e-36L)
      CHECK(std::abs(static_cast<double>(adaptive_step_slope(r, 1.0f, 0.0f)) / static_cast<double>(slope) - 1) < 5e-7);
  }
  CHECK(worst < 2.4e-7);                                            // 2 ulp
  CHECK(naive_is_zero);                                             // negative control
  CHECK(AdaptiveQuantizer<float>::step(-40.0f, 1.0f) == 0x1p-10f);  // a quantizer divides by it
}

TEST_CASE("embed/distortion: u q has the mean and variance of uniform noise and never reaches a half (QD3)") {
  Layer<float> layer;
  SerialExecutor serial;
  double sum = 0, square = 0;
  std::size_t n = 0;
  for (std::uint64_t iteration = 0; iteration < 60; ++iteration) {
    layer.phase.iteration = iteration;
    layer.forward(serial);
    for (std::size_t i = 0; i < layer.rows.size() * dim; ++i) {
      const double u = static_cast<double>(layer.context.noise[i]);
      CHECK(std::abs(u) < 0.5);
      sum += u;
      square += u * u;
      ++n;
    }
  }
  const double count = static_cast<double>(n);
  CHECK(std::abs(sum / count) < 4 / std::sqrt(12 * count));
  CHECK(square / count == doctest::Approx(1.0 / 12).epsilon(0.01));
  // Negative control: one bit more, and the largest number rounds to the bound.
  CHECK((static_cast<float>((1u << 24) - 1) + 0.5f) * 0x1p-24f - 0.5f == 0.5f);
}

TEST_CASE("embed/distortion: hard rounding lands on multiples of the step; both faces have the same step (QD4)") {
  Layer<double> layer;
  layer.phase.round = true;
  SerialExecutor serial;
  layer.forward(serial);
  double worst = 0;
  for (std::size_t i = 0; i < layer.rows.size(); ++i) {
    for (std::size_t c = 0; c < dim; ++c) {
      const double q = AdaptiveQuantizer<double>::step(layer.context.raw_step[i * dim + c], 1.0);
      const double symbols = layer.out_feature[layer.rows[i] * dim + c] / q;
      worst = std::max(worst, std::abs(symbols - std::nearbyint(symbols)));
    }
  }
  CHECK(worst < 1e-9);  // the quotient of two doubles of size at most 1e3
  // Negative control: noise in place of rounding, for values of a tenth of a step: 1/12 of a squared step, where
  // rounding to 0 costs 1/300.
  const Random random(3, 0, random_stage("test/gap"));
  double noise = 0, rounding = 0;
  for (std::uint64_t i = 0; i < 10000; ++i) {
    const double x = 0.2 * (random.uniform(i) - 0.5), u = static_cast<double>(random.centered(i));
    noise += u * u / 10000;
    rounding += std::pow(AdaptiveQuantizer<double>::error(x, 1.0), 2) / 10000;
  }
  CHECK(noise > 20 * rounding);
}

TEST_CASE_TEMPLATE("embed/distortion: in 8 bits the steps come from the extremes of what is listed", Options,
                   std::integral_constant<bool, true>, std::integral_constant<bool, false>) {
  constexpr bool per_channel = Options::value;
  Layer<double, DistortionOptions{.per_channel = per_channel}, Int8Quantizer<double>> layer;
  layer.phase.round = true;
  layer.feature[2 * dim] = 1e3;  // of row 2, which is not listed
  SerialExecutor serial;
  const DistortionReport report = layer.forward(serial);
  double largest[dim] = {}, all = 0, mean = 0;
  for (const std::uint32_t row : layer.rows) {
    REQUIRE(row != 2);
    for (std::size_t c = 0; c < dim; ++c) largest[c] = std::max(largest[c], std::abs(layer.feature[row * dim + c]));
  }
  for (const double value : largest) all = std::max(all, value);
  for (std::size_t c = 0; c < dim; ++c) {
    const double q = (per_channel ? largest[c] : all) / 127.5;
    mean += q / dim;
    double worst = 0, moved = 0;
    for (const std::uint32_t row : layer.rows) {
      const double symbol = layer.out_feature[row * dim + c] / q;
      worst = std::max(worst, std::abs(symbol - std::nearbyint(symbol)));
      moved = std::max(moved, std::abs(layer.out_feature[row * dim + c] - layer.feature[row * dim + c]) / q);
      CHECK(std::abs(symbol) < 127.5);
    }
    CHECK(worst < 1e-9);
    CHECK(moved <= 0.5 + 1e-9);
    CHECK(moved > 0.3);  // the control: it did round
  }
  CHECK(report.mean_step == doctest::Approx(mean).epsilon(1e-12));
}

TEST_CASE("embed/distortion: an untrained layer has the base step exactly, and rows that are not listed stay") {
  using Noise = QuantizationNoise<float, dim>;
  Layer<float> layer;
  const MatrixView<float> last = layer.arena.values(layer.handles.weight2);
  std::fill_n(last.data, last.size(), 0.0f);
  Noise::initialise(layer.arena, layer.handles, 1);
  SerialExecutor serial;
  CHECK(layer.forward(serial).mean_step == 1.0);
  std::vector<bool> listed(table_rows, false);
  for (const std::uint32_t row : layer.rows) listed[row] = true;
  for (std::size_t row = 0; row < table_rows; ++row) {
    for (std::size_t c = 0; c < dim; ++c) {
      const std::size_t i = row * dim + c;
      if (!listed[row]) CHECK(layer.out_feature[i] == layer.feature[i]);
    }
  }
}

TEST_CASE("embed/distortion: same bits at any thread count") {
  Layer<float> one, four;
  one.phase.scaling = four.phase.scaling = 0.001;
  one.phase.offset = four.phase.offset = 0.2;
  SerialExecutor serial;
  ThreadExecutor threads(4);
  one.forward(serial);
  four.forward(threads);
  CHECK(one.out_feature == four.out_feature);
  CHECK(one.out_scaling == four.out_scaling);
  CHECK(one.out_offset == four.out_offset);
  std::vector<float> d1 = one.slope_feature, d4 = d1, s1 = one.slope_scaling, s4 = s1;
  one.noise.backward(one.arena, one.handles, one.rows, one.view(d1, dim), one.view(s1, 6), one.context, serial);
  four.noise.backward(four.arena, four.handles, four.rows, four.view(d4, dim), four.view(s4, 6), four.context, threads);
  CHECK(d1 == d4);
  CHECK(s1 == s4);
  CHECK(std::memcmp(one.arena.all_gradients().data(), four.arena.all_gradients().data(),
                    one.arena.all_gradients().size_bytes()) == 0);
}

TEST_CASE(
    "embed/distortion: noise on a scale smaller than itself keeps it positive, where the naive logarithm is NaN") {
  Layer<float> layer;
  layer.phase.adaptive = false;
  layer.phase.scaling = 0.001;
  for (float& s : layer.scaling) s = std::log(2e-4f);
  SerialExecutor serial;
  layer.forward(serial);
  bool naive_fails = false;
  const Random random(layer.phase.seed, layer.phase.iteration, random_stage("distortion of scaling"));
  for (const std::uint32_t row : layer.rows) {
    for (std::size_t c = 0; c < 6; ++c) {
      CHECK(std::exp(layer.out_scaling[row * 6 + c]) >= 0.999e-6f);
      const float noisy = 2e-4f + 0.001f * random.centered(static_cast<std::uint64_t>(row) << 8 | c);
      naive_fails = naive_fails || std::isnan(std::log(noisy));
    }
  }
  CHECK(naive_fails);  // negative control
}

namespace {

/// 500 steps of descent on a loss that only noise raises: mean((f~ - f)^2), so to second order q^2 / 12 (QD2).
template <DistortionOptions options>
double mean_step_after_training(typename QuantizationNoise<double, dim, options>::Settings settings) {
  Layer<double, options> layer(settings);
  SerialExecutor serial;
  double mean = 0;
  for (std::uint64_t t = 0; t < 500; ++t) {
    layer.phase.iteration = t;
    mean = layer.forward(serial).mean_step;
    std::vector<double> d(layer.feature.size(), 0.0), s(layer.scaling.size(), 0.0);
    const double n = static_cast<double>(layer.rows.size() * dim);
    for (const std::uint32_t row : layer.rows) {
      for (std::size_t c = 0; c < dim; ++c) {
        const std::size_t i = row * dim + c;
        d[i] = 2 * (layer.out_feature[i] - layer.feature[i]) / n;
      }
    }
    std::fill(layer.arena.all_gradients().begin(), layer.arena.all_gradients().end(), 0.0);
    layer.noise.backward(layer.arena, layer.handles, layer.rows, layer.view(d, dim), layer.view(s, 6), layer.context,
                         serial);
    for (std::size_t i = 0; i < layer.arena.all_values().size(); ++i) {
      layer.arena.all_values()[i] -= 2.0 * layer.arena.all_gradients()[i];
    }
  }
  return mean;
}

}  // namespace

TEST_CASE("embed/distortion: a free step collapses; rate term, least step and detachment each hold it (QD2)") {
  constexpr DistortionOptions free_step{};
  constexpr DistortionOptions detached{.detach = true};
  const double collapsed = mean_step_after_training<free_step>({});
  const double rated = mean_step_after_training<free_step>({.rate_weight = 0.2});
  const double held = mean_step_after_training<free_step>({.least_step = 0.5});
  const double still = mean_step_after_training<detached>({});
  CAPTURE(collapsed);
  CAPTURE(rated);
  CHECK(collapsed < 0.25);  // negative control
  CHECK(rated > 0.5);
  CHECK(held >= 0.5);
  CHECK(still > 0.5);
}
