// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/quantizer/uniform_quantizer.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/watermark/embed/distortion.hpp"

namespace {

using namespace compmark;

static_assert(Quantizer<UniformQuantizer<float>> && Quantizer<UniformQuantizer<double>>);
static_assert(!UniformQuantizer<float>::is_absent);

/// Zeros, denormals, numbers around halves, both ends, and all exponents.
template <class T>
std::vector<T> hard_values() {
  using L = std::numeric_limits<T>;
  std::vector<T> x{0,      -T(0),  L::denorm_min(), -L::denorm_min(), L::min(), L::min() / 2, L::epsilon(),
                   T(0.5), T(1.5), T(2.5),          T(-0.5)};
  for (const T edge : {T(1), T(0.5), L::max(), T(1 << 21), T(1 << 22), T(1 << 23)}) {
    for (const T sign : {T(1), T(-1)}) {
      x.push_back(sign * edge);
      x.push_back(sign * std::nextafter(edge, T(0)));
      if (edge < L::max()) x.push_back(sign * std::nextafter(edge, L::max()));
    }
  }
  const Random random(3, 0, random_stage("hard values"));
  const double octaves = L::max_exponent - L::min_exponent;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const double size = std::exp2(L::min_exponent + octaves * random.uniform(2 * i) - 1);
    x.push_back(static_cast<T>(size * (random.uniform(2 * i + 1) < 0.5 ? 1 : -1)));
    x.push_back(static_cast<T>(20 * random.normal((1u << 20) + i)));
  }
  return x;
}
template <class T>
std::vector<double> steps() {
  return {1,
          0.1,
          0.001,
          0.2,
          3,
          0x1p-20,
          1e6,
          1e30,
          static_cast<double>(std::numeric_limits<T>::min()),
          0.6 * static_cast<double>(std::numeric_limits<T>::max())};
}

/// Values whose error is above q / 2 + eps (|x| + q): a rounding of the quotient, one of the product. NaN is one.
template <class T, class Rounding>
std::size_t beyond_half_a_step(const std::vector<T>& x, T q, const Rounding& rounding) {
  std::size_t count = 0;
  for (const T value : x) {
    const long double error = std::abs(static_cast<long double>(rounding(value, q)) - static_cast<long double>(value));
    int exponent = 0;
    const bool power = std::frexp(q, &exponent) == T(0.5);
    const long double slack = static_cast<long double>(power ? T(0) : std::numeric_limits<T>::epsilon()) *
                              (std::abs(static_cast<long double>(value)) + static_cast<long double>(q));
    count += error <= static_cast<long double>(q) / 2 + slack ? 0 : 1;
  }
  return count;
}

TEST_CASE_TEMPLATE("quantizer/uniform: no value moves by more than half a step", T, float, double) {
  const std::vector<T> x = hard_values<T>();
  std::size_t naive_failures = 0;
  for (const double step : steps<T>()) {
    CAPTURE(step);
    const T q = static_cast<T>(step);
    CHECK(beyond_half_a_step(x, q, [](T v, T s) { return UniformQuantizer<T>::value(v, s); }) == 0);
    // The formula as it is written: overflows at both ends, and rounds what is finer than it.
    naive_failures += beyond_half_a_step(x, q, [](T v, T s) { return s * std::nearbyint(v / s); });
  }
  CHECK(naive_failures > 100);
}

TEST_CASE_TEMPLATE("quantizer/uniform: packs give what one value gives, whatever the length; in place", T, float,
                   double) {
  const std::vector<T> all = hard_values<T>();
  for (const double step : steps<T>()) {
    const auto quantizer = UniformQuantizer<T>::create({step});
    REQUIRE(quantizer);
    for (std::size_t n = 0; n < 70; ++n) {
      const std::vector<T> x(all.end() - static_cast<std::ptrdiff_t>(n), all.end());
      std::vector<T> out(n, T(-7)), plain(n);
      REQUIRE(quantizer->forward(x, out));
      for (std::size_t i = 0; i < n; ++i) plain[i] = UniformQuantizer<T>::value(x[i], quantizer->step());
      CHECK((n == 0 || std::memcmp(out.data(), plain.data(), n * sizeof(T)) == 0));
    }
    std::vector<T> out = all, again(all.size());
    REQUIRE(quantizer->forward(out, out));
    for (std::size_t i = 0; i < all.size(); ++i) again[i] = UniformQuantizer<T>::value(all[i], quantizer->step());
    CHECK(std::memcmp(out.data(), again.data(), all.size() * sizeof(T)) == 0);
    REQUIRE(quantizer->forward(out, again));  // what is quantized stays
    CHECK(out == again);
  }
}

TEST_CASE("quantizer/uniform: ties go to even, nothing is drawn to zero") {
  using Q = UniformQuantizer<float>;
  CHECK(Q::value(0.5f, 1) == 0);
  CHECK(Q::value(1.5f, 1) == 2);
  CHECK(Q::value(2.5f, 1) == 2);
  CHECK(Q::value(-0.5000001f, 1) == -1);
  CHECK(Q::value(0.5000001f, 1) == 1);  // a dead zone would keep 0
  CHECK(Q::symbol(-3.2f, 0.5f) == -6);
  CHECK(Q::error(-3.2f, 0.5f) == doctest::Approx(0.4));
}

TEST_CASE_TEMPLATE("quantizer/uniform: symbols decode to what forward gives", T, float, double) {
  const auto quantizer = UniformQuantizer<T>::create({0.37});
  REQUIRE(quantizer);
  const Random random(5, 0, 1);
  std::vector<T> x(1000), out(1000), decoded(1000);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = static_cast<T>(1000 * random.normal(i));
  std::vector<std::int32_t> symbols(1000);
  REQUIRE(quantizer->encode(x, symbols));
  REQUIRE(quantizer->forward(x, out));
  quantizer->decode(symbols, decoded);
  CHECK(decoded == out);
  for (const T bad : {T(1e30), std::numeric_limits<T>::infinity(), std::numeric_limits<T>::quiet_NaN()}) {
    x[17] = bad;
    const Result<Done> refused = quantizer->encode(x, symbols);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().field == "value 17");
  }
}

TEST_CASE("quantizer/uniform: what is not finite is refused, and so are steps that divide by nothing") {
  const auto quantizer = UniformQuantizer<float>::create({0.1});
  std::vector<float> x(37, 1.0f);
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity()}) {
    for (const std::size_t at : {std::size_t{0}, std::size_t{20}, std::size_t{36}}) {
      std::vector<float> y = x;
      y[at] = bad;
      const Result<Done> refused = quantizer->forward(y, y);
      REQUIRE_FALSE(refused);
      CHECK(refused.error().field == "value " + std::to_string(at));
    }
  }
  for (const double step : {0.0, -1.0, 1e-39, 1e39, std::nan(""), HUGE_VAL})
    CHECK_FALSE(UniformQuantizer<float>::create({step}));
  CHECK(UniformQuantizer<double>::create({1e-39}));
}

TEST_CASE("quantizer/uniform: gradients pass straight through, and are added") {
  // The surrogate that is differentiated: x plus the residual of the rounding, held. The rounding itself has derivative
  // 0 almost everywhere.
  const auto quantizer = UniformQuantizer<double>::create({0.25});
  const Random random(6, 0, 1);
  std::vector<double> x(50), out(50), residual(50), d_out(50), d_x(50, 0.0);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = 2 * random.normal(i);
  REQUIRE(quantizer->forward(x, out));
  for (std::size_t i = 0; i < x.size(); ++i) {
    residual[i] = out[i] - x[i];
    d_out[i] = std::cos(out[i]);
  }
  UniformQuantizer<double>::backward(d_out, d_x);
  const auto loss = [&] {
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += std::sin(x[i] + residual[i]);
    return sum;
  };
  CHECK(testing::gradient_law(loss, x, d_x) == "");
  const std::vector<double> zero(50, 0.0);
  CHECK(testing::gradient_law(loss, x, zero) != "");  // the true derivative of rounding
  UniformQuantizer<double>::backward(d_out, d_x);
  CHECK(d_x[7] == 2 * d_out[7]);
}

TEST_CASE("quantizer/uniform: a distortion layer rounds with it as with the adaptive one") {
  // A layer with zero weights has the base step everywhere: then the two quantizers are one.
  const auto run = [](auto layer) {
    using Layer = decltype(layer);
    ParameterArena<float> arena;
    const auto handles = Layer::add_parameters(arena);
    Layer::initialise(arena, handles, 9);
    const Random random(4, 0, 1);
    std::vector<float> feature(20 * 13), scaling(20 * 6), offset(20 * 6);
    for (std::size_t i = 0; i < feature.size(); ++i) feature[i] = static_cast<float>(3 * random.normal(i));
    const std::vector<std::uint32_t> rows{0, 3, 4, 19};
    typename Layer::Context context;
    SerialExecutor serial;
    DistortionPhase phase;
    phase.adaptive = phase.round = true;
    (void)layer.forward(arena, handles, rows, phase, {feature.data(), 20, 13}, {scaling.data(), 20, 6},
                        {offset.data(), 20, 6}, context, serial);
    return feature;
  };
  const std::vector<float> uniform = run(QuantizationNoise<float, 13, DistortionOptions{}, UniformQuantizer<float>>{});
  CHECK(uniform == run(QuantizationNoise<float, 13>{}));
  CHECK(uniform[0] == std::nearbyint(uniform[0]));
}

}  // namespace
