// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
// Widths beyond this build's registers are tested too; their calling convention does not matter, everything is inlined.
#pragma GCC diagnostic ignored "-Wpsabi"

#include "compmark/math/functions.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

// Exhaustive tests walk over all floats; under a sanitizer over every 101st.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr std::uint32_t scan_stride = 101;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
constexpr std::uint32_t scan_stride = 101;
#else
constexpr std::uint32_t scan_stride = 1;
#endif
#else
constexpr std::uint32_t scan_stride = 1;
#endif

#if defined(__FMA__)
constexpr bool has_fma = true;
#else
constexpr bool has_fma = false;  // the reduction then rounds twice, and the stated errors are larger
#endif

struct ExpErrors {
  std::array<double, 7> worst{};  ///< relative, by degree
  float largest = 0;              ///< value, any degree
};

/// Every float from -largest to -smallest.
ExpErrors scan_exp(float smallest, float largest, std::uint32_t every) {
  using P = Pack<float>;
  ExpErrors errors;
  const std::uint32_t first = std::bit_cast<std::uint32_t>(smallest);
  const std::uint32_t last = std::bit_cast<std::uint32_t>(largest);
  for (std::uint64_t at = first; at <= last; at += std::uint64_t{P::width} * every) {
    std::array<float, P::width> x;
    std::array<double, P::width> exact;
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] = -std::bit_cast<float>(static_cast<std::uint32_t>(std::min<std::uint64_t>(at + i * every, last)));
      exact[i] = std::exp(static_cast<double>(x[i]));
    }
    const auto compare = [&](std::size_t degree, P value) {
      for (std::size_t i = 0; i < x.size(); ++i) {
        const float v = value.lane(static_cast<int>(i));
        errors.worst[degree] = std::max(errors.worst[degree], std::abs(static_cast<double>(v) - exact[i]) / exact[i]);
        errors.largest = std::max(errors.largest, v);
      }
    };
    const P pack = P::load(x.data());
    compare(2, exp_negative<2>(pack));
    compare(3, exp_negative<3>(pack));
    compare(4, exp_negative<4>(pack));
    compare(5, exp_negative<5>(pack));
    compare(6, exp_negative<6>(pack));
  }
  return errors;
}

TEST_CASE(
    "math/functions: exp_negative on all floats of the splat range, every degree: stated error, never above 1 (BF5)") {
  const ExpErrors errors = scan_exp(1e-6f, 5.5413f, scan_stride);
  CHECK(errors.worst[2] < 2.0e-3);
  CHECK(errors.worst[3] < 1.02e-4);
  CHECK(errors.worst[4] < (has_fma ? 3.0e-6 : 3.2e-6));
  CHECK(errors.worst[5] < (has_fma ? 2.4e-7 : 4.0e-7));
  CHECK(errors.worst[6] < (has_fma ? 1.6e-7 : 3.3e-7));
  CHECK(errors.largest <= 1.0f);
  // The figures are the polynomials' own, not slack.
  CHECK(errors.worst[2] > 1.9e-3);
  CHECK(errors.worst[3] > 1.0e-4);
  CHECK(errors.worst[4] > 2.7e-6);
}

TEST_CASE("math/functions: exp_negative near zero and on the wide range") {
  const ExpErrors near_zero = scan_exp(1e-30f, 1e-6f, 997);
  CHECK(near_zero.largest <= 1.0f);
  CHECK(near_zero.worst[3] < 6e-8);
  CHECK(scan_exp(5.5413f, 16.0f, 7).worst[6] < (has_fma ? 3.0e-7 : 9.7e-7));
  CHECK(scan_exp(16.0f, 87.0f, 7).worst[6] < (has_fma ? 1.3e-6 : 3.9e-6));
  const auto at_zero = [](auto degree) { return exp_negative<decltype(degree)::value>(Pack<float>(0.0f)).lane(0); };
  CHECK(at_zero(std::integral_constant<int, 0>{}) == 1.0f);
  CHECK(at_zero(std::integral_constant<int, 2>{}) == 1.0f);
  CHECK(at_zero(std::integral_constant<int, 3>{}) == 1.0f);
  CHECK(at_zero(std::integral_constant<int, 4>{}) == 1.0f);
  CHECK(at_zero(std::integral_constant<int, 5>{}) == 1.0f);
  CHECK(at_zero(std::integral_constant<int, 6>{}) == 1.0f);
  // Negative control: without p(0) = 1, the best polynomial of degree 5 is near the Chebyshev series of 2^f = exp(a t),
  // f = t / 2, whose coefficients are Bessel functions I_k(a), twice for k > 0: at 0 its T_k are 1, 0, -1, 0, 1, 0.
  const double a = std::log(2.0) / 2;
  const auto bessel = [a](int k) {
    double term = std::pow(a / 2, k) / std::tgamma(k + 1), sum = 0;
    for (int m = 1; m < 12; ++m) {
      sum += term;
      term *= a * a / 4 / (m * (m + k));
    }
    return sum;
  };
  CHECK(static_cast<float>(bessel(0) - 2 * bessel(2) + 2 * bessel(4)) > 1.0f);
}

template <class Value, class Exact>
double worst_relative(double low, double high, int count, const Value& value, const Exact& exact) {
  long double worst = 0;
  for (int i = 0; i <= count; ++i) {
    const float x = static_cast<float>(low + (high - low) * i / count);
    const long double e = exact(static_cast<long double>(x));
    if (e == 0) continue;
    worst = std::max(worst, std::abs(static_cast<long double>(value(Pack<float>(x)).lane(0)) - e) / std::abs(e));
  }
  return static_cast<double>(worst);
}

TEST_CASE("math/functions: exp, sigmoid and tanh against long double over their range") {
  const int n = scan_stride == 1 ? 1000000 : 50000;
  CHECK(worst_relative(
            -87, 88, n, [](auto x) { return exp(x); }, [](long double x) { return std::exp(x); }) < 1.2e-7);
  CHECK(worst_relative(
            -80, 80, n, [](auto x) { return sigmoid(x); }, [](long double x) { return 1 / (1 + std::exp(-x)); }) <
        2.4e-7);
  CHECK(worst_relative(
            -1e-3, 1e-3, n, [](auto x) { return tanh(x); }, [](long double x) { return std::tanh(x); }) < 2.1e-7);
  CHECK(worst_relative(
            -0.5, 0.5, n, [](auto x) { return tanh(x); }, [](long double x) { return std::tanh(x); }) < 2.1e-7);
  CHECK(worst_relative(
            -20, 20, n, [](auto x) { return tanh(x); }, [](long double x) { return std::tanh(x); }) < 2.1e-7);
  CHECK(worst_relative(
            -43, 43, n, [](auto x) { return tanh_slope(x); },
            [](long double x) { return 1 / (std::cosh(x) * std::cosh(x)); }) < 6e-7);
}

TEST_CASE("math/functions: the slope of a sigmoid is that of two sigmoids, to where one minus it is nothing (ML1)") {
  double worst = 0, worst_naive = 0;
  for (int i = -80; i <= 80; ++i) {
    const auto x = static_cast<float>(i);
    const float up = sigmoid(Pack<float, 1>(x)).lane(0), down = sigmoid(Pack<float, 1>(-x)).lane(0);
    const long double e = std::exp(-std::abs(static_cast<long double>(x))), exact = e / ((1 + e) * (1 + e));
    worst = std::max(worst, static_cast<double>(std::abs(up * down - exact) / exact));
    worst_naive = std::max(worst_naive, static_cast<double>(std::abs(up * (1 - up) - exact) / exact));
  }
  CHECK(worst < 5e-7);
  CHECK(worst_naive ==
        1);  // negative controls: 1 - sigmoid is 0 from 17 on, its logarithm is not finite, and exp(89) is not
  CHECK_FALSE(std::isfinite(std::log(1 - sigmoid(Pack<float, 1>(17.5f)).lane(0))));
  CHECK_FALSE(std::isfinite(std::exp(89.0f)));
}

TEST_CASE("math/functions: limits and symmetry") {
  const float infinity = std::numeric_limits<float>::infinity();
  const auto value = [](auto pack) { return pack.lane(0); };
  CHECK(value(sigmoid(Pack<float>(1e4f))) == 1.0f);
  CHECK(value(sigmoid(Pack<float>(-1e4f))) >= 0.0f);
  CHECK(value(sigmoid(Pack<float>(-1e4f))) < 1e-37f);
  CHECK(value(sigmoid(Pack<float>(0.0f))) == 0.5f);
  CHECK(value(tanh(Pack<float>(infinity))) == 1.0f);
  CHECK(value(tanh(Pack<float>(-infinity))) == -1.0f);
  CHECK(value(tanh(Pack<float>(0.0f))) == 0.0f);
  CHECK(value(exp(Pack<float>(1e30f))) == value(exp(Pack<float>(88.0f))));
  CHECK(value(exp(Pack<float>(0.0f))) == 1.0f);
  CHECK(std::isfinite(value(exp(Pack<float>(infinity)))));
  for (int i = 0; i < 20000; ++i) {
    const float x = static_cast<float>(i) * 1e-3f;
    const float t = value(tanh(Pack<float>(x)));
    if (t > 1.0f || value(tanh(Pack<float>(-x))) != -t) FAIL_CHECK("tanh is not odd or leaves [-1, 1] at " << x);
  }
  CHECK(value(exp(Pack<double>(1.0))) == std::exp(1.0));
  CHECK(value(tanh(Pack<double>(0.3))) == std::tanh(0.3));
  CHECK(value(exp(Pack<long double, 1>(1.0L))) == std::exp(1.0L));
}

template <int W, class F>
std::array<float, 16> apply(const std::array<float, 16>& x, const F& f) {
  std::array<float, 16> result;
  for (std::size_t i = 0; i < 16; i += W) f(Pack<float, W>::load(x.data() + i)).store(result.data() + i);
  return result;
}

template <int W>
void check_that_nan_stays() {
  using P = Pack<float, W>;
  for (const float nan : {std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::quiet_NaN()}) {
    P x(1.0f);
    x.set(W - 1, nan);
    const P results[] = {exp(x), sigmoid(x), tanh(x)};
    const float expected[] = {std::exp(1.0f), 1 / (1 + std::exp(-1.0f)), std::tanh(1.0f)};
    for (std::size_t i = 0; i < 3; ++i) {
      CHECK(std::isnan(results[i].lane(W - 1)));
      if (W > 1) CHECK(results[i].lane(0) == doctest::Approx(static_cast<double>(expected[i])).epsilon(1e-6));
    }
    // Negative control: clamped with the operands the other way round, the NaN is a number.
    CHECK(min(max(x, P(-87.0f)), P(88.0f)).lane(W - 1) == -87.0f);
  }
}

TEST_CASE("math/functions: a NaN goes through exp, sigmoid and tanh and is not absorbed, at every width (ML4)") {
  check_that_nan_stays<1>();
  check_that_nan_stays<4>();
  check_that_nan_stays<8>();
  check_that_nan_stays<16>();
}

TEST_CASE("math/functions: widths 1, 4, 8 and 16 give the same bits") {
  const Random random(4, 0, random_stage("test"));
  for (std::uint64_t round = 0; round < 2000; ++round) {
    std::array<float, 16> x, negative;
    for (std::size_t i = 0; i < 16; ++i) {
      x[i] = static_cast<float>((random.uniform(round * 16 + i) - 0.5) * (round % 2 == 0 ? 170.0 : 2.0));
      negative[i] = -std::abs(x[i]);
    }
    const auto agree = [](const std::array<float, 16>& in, const auto& f) {
      const auto wide = apply<16>(in, f);
      return wide == apply<8>(in, f) && wide == apply<4>(in, f) && wide == apply<1>(in, f);
    };
    const bool same = agree(x, [](auto p) { return exp(p); }) && agree(x, [](auto p) { return sigmoid(p); }) &&
                      agree(x, [](auto p) { return tanh(p); }) &&
                      agree(negative, [](auto p) { return exp_negative<5>(p); }) &&
                      agree(negative, [](auto p) { return exp_negative<3>(p); });
    if (!same) FAIL_CHECK("widths disagree in round " << round);
  }
}

}  // namespace
