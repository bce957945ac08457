// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/lattice_kernel.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace {

/// 40 features of 1,600 positions; of each run of 64 the last 32 are closed, and two gates among the open ones.
template <class T>
struct Positions {
  static constexpr std::size_t features = 40, stride = 1600;
  explicit Positions(std::size_t of_dimensions) : dimensions(of_dimensions) {
    const Random random(of_dimensions, 0, random_stage("test/lattice kernel"));
    std::uint64_t n = 0;
    for (std::vector<T>* values : {&frequency, &phase, &u, &gate, &e}) {
      const std::size_t sizes[] = {features * dimensions, features, dimensions * stride, stride, features};
      values->resize(sizes[n]);
      const Random own(of_dimensions, ++n, random_stage("test/lattice kernel"));
      for (std::size_t i = 0; i < values->size(); ++i) (*values)[i] = static_cast<T>(own.uniform(i));
    }
    for (std::size_t i = 0; i < stride; ++i) {
      if (closed(i) || i % 64 == 3 || i % 64 == 17) gate[i] = 0;
    }
  }
  [[nodiscard]] static bool closed(std::size_t i) { return i % 64 >= 32; }
  [[nodiscard]] detail::FourierFeatures<T> fourier() const {
    return {frequency.data(), phase.data(), u.data(), gate.data(), features, dimensions, stride};
  }
  [[nodiscard]] long double turns(std::size_t k, std::size_t i) const {
    long double t = phase[k];
    for (std::size_t j = 0; j < dimensions; ++j)
      t += static_cast<long double>(frequency[k * dimensions + j]) * static_cast<long double>(u[j * stride + i]);
    return 2 * std::numbers::pi_v<long double> * t;
  }
  std::size_t dimensions;
  std::vector<T> frequency, phase, u, gate, e;
};

/// Largest distance from the formula, of sums and of gradients.
template <class T>
std::pair<double, double> distance(const Positions<T>& at) {
  using P = Positions<T>;
  // Parts that begin within a pack of the widest registers are not asked for: chunks are whole packs.
  const std::size_t begin = 64, end = P::stride;
  std::vector<T> sums(P::features, T(7)), d_u(at.dimensions * P::stride, T(7)), d_gate(P::stride, T(7));
  at.fourier().sum(begin, end, sums.data());
  at.fourier().input_gradient(begin, end, at.e.data(), d_u.data(), d_gate.data());
  double sum_error = 0, gradient_error = 0;
  const auto worse = [](double& worst, long double expected, T found) {
    const double error = static_cast<double>(std::abs(expected - static_cast<long double>(found)));
    if (!(error <= worst) && !std::isnan(worst)) worst = error;  // a NaN stays
  };
  for (std::size_t k = 0; k < P::features; ++k) {
    long double sum = 0;
    for (std::size_t i = begin; i < end; ++i) {
      if (at.gate[i] > 0 && !P::closed(i)) sum += static_cast<long double>(at.gate[i]) * std::cos(at.turns(k, i));
    }
    worse(sum_error, sum, sums[k]);
  }
  for (std::size_t i = begin; i < end; ++i) {
    long double share = 0;
    std::vector<long double> slope(at.dimensions, 0);
    for (std::size_t k = 0; k < P::features && !P::closed(i); ++k) {
      share += static_cast<long double>(at.e[k]) * std::cos(at.turns(k, i));
      for (std::size_t j = 0; j < at.dimensions; ++j)
        slope[j] -= 2 * std::numbers::pi_v<long double> * static_cast<long double>(at.gate[i] * at.e[k]) *
                    static_cast<long double>(at.frequency[k * at.dimensions + j]) * std::sin(at.turns(k, i));
    }
    worse(gradient_error, share, d_gate[i]);
    for (std::size_t j = 0; j < at.dimensions; ++j) worse(gradient_error, slope[j], d_u[j * P::stride + i]);
  }
  return {sum_error, gradient_error};
}

}  // namespace

TEST_CASE_TEMPLATE("decoder/lattice_kernel: sums and gradients are those of the formula, of one colour and of more", T,
                   float, double) {
  // A cosine is off by 6e-7 in float; 1,100 open gates, 40 features, slopes of up to 2 pi.
  const double tolerance = std::is_same_v<T, float> ? 2e-4 : 1e-11;
  for (const std::size_t dimensions : {3u, 6u, 24u}) {
    CAPTURE(dimensions);
    const auto [sum_error, gradient_error] = distance(Positions<T>(dimensions));
    CHECK(sum_error < tolerance);
    CHECK(gradient_error < tolerance);
  }
}

TEST_CASE_TEMPLATE("decoder/lattice_kernel: what lies behind closed gates is not looked at", T, float, double) {
  for (const std::size_t dimensions : {3u, 6u}) {
    Positions<T> at(dimensions);
    for (std::size_t i = 0; i < at.stride; ++i) {
      for (std::size_t j = 0; j < dimensions && at.closed(i); ++j)
        at.u[j * at.stride + i] = std::numeric_limits<T>::quiet_NaN();
    }
    const auto [sum_error, gradient_error] = distance(at);
    CHECK(sum_error < 2e-4);
    CHECK(gradient_error < 2e-4);
    at.gate[64 + 40] = T(1);  // opened: now it is
    const auto [opened_sum, opened_gradient] = distance(at);
    CHECK_FALSE(opened_sum < 2e-4);
    CHECK_FALSE(opened_gradient < 2e-4);
  }
}
