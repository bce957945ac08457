// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/gelu.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace {

using namespace compmark;

struct Worst {
  double value = 0, slope = 0;
};

/// Largest errors over [-20, 20] and powers of ten; value relative to 1 + |x|.
template <int W>
Worst worst() {
  Worst result;
  const auto look = [&](float x) {
    const auto got = gelu_with_slope(Pack<float, W>(x));
    const double exact = static_cast<double>(x);
    result.value = std::max(result.value,
                            std::abs(static_cast<double>(got.value.lane(W - 1)) - gelu(exact)) / (1 + std::abs(exact)));
    result.slope = std::max(result.slope, std::abs(static_cast<double>(got.slope.lane(W - 1)) - gelu_slope(exact)));
  };
  for (int i = -40000; i <= 40000; ++i) look(static_cast<float>(i) * 5e-4f);
  for (int e = -37; e < 15; ++e) {
    look(std::pow(10.0f, static_cast<float>(e)));
    look(-std::pow(10.0f, static_cast<float>(e)));
  }
  return result;
}

}  // namespace

TEST_CASE("math/gelu: known values") {
  CHECK(gelu(0.0) == 0.0);
  CHECK(std::abs(gelu(1.0) - 0.84134474606854293) < 1e-15);   // Phi(1)
  CHECK(std::abs(gelu(-1.0) + 0.15865525393145705) < 1e-15);  // -Phi(-1)
  CHECK(std::abs(gelu_slope(0.0) - 0.5) < 1e-16);
  // the tanh formula that the same name often hides is not within the bound below
  double distance = 0;
  for (double x = -5; x < 5; x += 0.01) {
    const double tanh_form = 0.5 * x * (1 + std::tanh(std::sqrt(2 / std::numbers::pi) * (x + 0.044715 * x * x * x)));
    distance = std::max(distance, std::abs(tanh_form - gelu(x)));
  }
  CHECK(distance > 4.7e-4);
  CHECK(distance < 4.8e-4);
}

TEST_CASE("math/gelu: errors in float are within the documented bounds at every width") {
  for (const Worst& w : {worst<1>(), worst<4>(), worst<native_width<float>>()}) {
    MESSAGE("gelu: value " << w.value << " (1 + |x|), slope " << w.slope);
    CHECK(w.value < 1e-7);
    CHECK(w.slope < 3e-7);
  }
}

TEST_CASE("math/gelu: the slope is the derivative, in double") {
  for (double x = -8; x < 8; x += 0.037) {
    const double h = 6e-6;
    CHECK(std::abs((gelu(x + h) - gelu(x - h)) / (2 * h) - gelu_slope(x)) < 1e-9);
  }
  const auto packed = gelu_with_slope(Pack<double, native_width<double>>(-1.25));
  CHECK(packed.value.lane(0) == gelu(-1.25));
  CHECK(packed.slope.lane(0) == gelu_slope(-1.25));
}

TEST_CASE("math/gelu: a NaN passes through, infinities have their limits") {
  using P = Pack<float, native_width<float>>;
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  CHECK(std::isnan(gelu_with_slope(P(nan)).value.lane(0)));
  CHECK(std::isnan(gelu_with_slope(P(nan)).slope.lane(0)));
  CHECK(std::isnan(gelu_with_slope(Pack<float, 1>(nan)).value.lane(0)));
  CHECK(gelu_with_slope(P(infinity)).value.lane(0) == infinity);
  CHECK(gelu_with_slope(P(infinity)).slope.lane(0) == 1.0f);
  CHECK(std::abs(gelu_with_slope(P(-infinity)).value.lane(0)) < 1e-30f);
  CHECK(std::abs(gelu_with_slope(P(-infinity)).slope.lane(0)) < 1e-30f);
}
