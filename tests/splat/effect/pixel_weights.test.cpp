// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/effect/pixel_weights.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/loss/photometric.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;
static_assert(PixelWeights<MaskedPixels<float>> && PixelWeights<NoPixelWeights> && !present<NoPixelWeights>);

struct Problem {
  static constexpr int height = 23, width = 41;
  static constexpr std::size_t pixels = height * width;
  std::vector<double> x, y, weight;
  Problem() : weight(pixels) {
    const Random random(9, 0, random_stage("mask test"));
    for (std::size_t i = 0; i < 3 * pixels; ++i) {
      x.push_back(random.uniform(i));
      y.push_back(random.uniform(i + 50000));
    }
    for (std::size_t i = 0; i < pixels; ++i) weight[i] = i % 5 == 0 ? 0.0 : (i % 5 == 1 ? 0.4 : 1.0);
  }
  [[nodiscard]] ImageView<const double> view(const std::vector<double>& v) const {
    return {v.data(), 3, height, width};
  }
  MaskedPixels<double>::Context context;
  PhotometricLoss<double>::Context photometric;
  SerialExecutor serial;
  /// The masked loss and, if asked for, its gradient, as Pipeline puts it together.
  double loss(std::vector<double>* d = nullptr) {
    const PhotometricLoss<double> loss;
    MaskedPixels<double>::mix(view(x), view(y), weight.data(), context, serial);
    const ImageView<const double> mixed{context.mixed.data(), 3, height, width};
    if (d == nullptr) return loss.forward(mixed, view(y), photometric, serial).loss * context.factor;
    d->assign(3 * pixels, 0);
    const ImageView<double> d_view{d->data(), 3, height, width};
    const double value = loss.forward_backward(mixed, view(y), 1.0, d_view, photometric, serial).loss;
    MaskedPixels<double>::apply(d_view, weight.data(), context, serial);
    return value * context.factor;
  }
};

}  // namespace

TEST_CASE("effect/pixel_weights: the gradient is the slope of the value, and exactly 0 where the weight is 0") {
  Problem p;
  std::vector<double> d;
  static_cast<void>(p.loss(&d));
  CHECK(testing::gradient_law([&] { return p.loss(); }, p.x, d) == "");
  for (std::size_t i = 0; i < 3 * Problem::pixels; ++i) {
    if (p.weight[i % Problem::pixels] == 0) CHECK(d[i] == 0);
  }
}

TEST_CASE("effect/pixel_weights: what is behind the mask changes nothing, not even a NaN") {
  Problem p;
  std::vector<double> d, again;
  const double value = p.loss(&d);
  for (std::size_t i = 0; i < 3 * Problem::pixels; ++i) {
    if (p.weight[i % Problem::pixels] == 0) p.x[i] = i % 2 == 0 ? std::numeric_limits<double>::quiet_NaN() : 1e30;
  }
  CHECK(p.loss(&again) == value);
  CHECK(again == d);
}

TEST_CASE(
    "effect/pixel_weights: the loss is divided by the mean weight, so a mask of half the image does not halve it") {
  Problem p;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < Problem::pixels; ++i) p.y[c * Problem::pixels + i] = p.x[c * Problem::pixels + i] + 0.1;
  }
  PhotometricLoss<double> l1({0.0});
  const auto value = [&](std::size_t every) {
    for (std::size_t i = 0; i < Problem::pixels; ++i) p.weight[i] = i % every == 0 ? 1.0 : 0.0;
    MaskedPixels<double>::mix(p.view(p.x), p.view(p.y), p.weight.data(), p.context, p.serial);
    const ImageView<const double> mixed{p.context.mixed.data(), 3, Problem::height, Problem::width};
    return l1.forward(mixed, p.view(p.y), p.photometric, p.serial).loss * p.context.factor;
  };
  CHECK(value(1) == doctest::Approx(0.1).epsilon(1e-12));
  CHECK(value(2) == doctest::Approx(0.1).epsilon(1e-12));
  CHECK(value(7) == doctest::Approx(0.1).epsilon(1e-12));
}

TEST_CASE("effect/pixel_weights: no pixel that counts gives the loss 0 and no gradient; no weights mean all of them") {
  Problem p;
  std::vector<double> d;
  p.weight.assign(Problem::pixels, 0.0);
  CHECK(p.loss(&d) == 0);
  for (const double value : d) CHECK(value == 0);
  p.weight.assign(Problem::pixels, 1.0);
  const PhotometricLoss<double> plain;
  CHECK(p.loss() == plain.forward(p.view(p.x), p.view(p.y), p.photometric, p.serial).loss);
}
