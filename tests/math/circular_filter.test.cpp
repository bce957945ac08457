// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/circular_filter.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "math/random_plane.hpp"

namespace {

using namespace compmark;
using testing::random_plane;

/// A gain without symmetry between the axes.
double skew_gain(int ky, int kx) { return 1 / (1 + 0.3 * ky + 0.05 * kx * kx) - 0.1; }

template <class T, class Gain>
std::vector<T> filtered(int height, int width, const Gain& gain, const std::vector<T>& x, std::size_t threads = 1) {
  const CircularFilter<T> filter(height, width, gain);
  typename CircularFilter<T>::Context context;
  ThreadExecutor executor(threads);
  std::vector<T> y(x.size(), T(-7));
  filter.apply(x.data(), y.data(), context, executor);
  return y;
}

/// The filter as four nested sums over pixels and signed frequencies. Also tells the largest imaginary part.
std::pair<std::vector<long double>, long double> plain_filter(int height, int width, const std::vector<double>& x,
                                                              int centre_shift = 0) {
  using C = std::complex<long double>;
  const auto turn = [](long k, long n) {
    return std::polar(
        1.0L, -2 * std::numbers::pi_v<long double> * static_cast<long double>(k % n) / static_cast<long double>(n));
  };
  const auto at = [&](int y, int x_) { return static_cast<std::size_t>(y * width + x_); };
  std::vector<C> spectrum(x.size()), result(x.size());
  for (int ky = 0; ky < height; ++ky) {
    for (int kx = 0; kx < width; ++kx) {
      C sum{};
      for (int i = 0; i < height; ++i) {
        for (int j = 0; j < width; ++j)
          sum += static_cast<long double>(x[at(i, j)]) * turn(long{ky} * i, height) * turn(long{kx} * j, width);
      }
      const int sy = (ky + centre_shift) % height;  // the control puts the centre one bin off
      spectrum[at(ky, kx)] =
          sum * static_cast<long double>(skew_gain(std::min(sy, height - sy), std::min(kx, width - kx)));
    }
  }
  long double imaginary = 0;
  std::vector<long double> real;
  for (int i = 0; i < height; ++i) {
    for (int j = 0; j < width; ++j) {
      C sum{};
      for (int ky = 0; ky < height; ++ky) {
        for (int kx = 0; kx < width; ++kx)
          sum += spectrum[at(ky, kx)] * std::conj(turn(long{ky} * i, height) * turn(long{kx} * j, width));
      }
      sum /= static_cast<long double>(height * width);
      imaginary = std::max(imaginary, std::abs(sum.imag()));
      real.push_back(sum.real());
    }
  }
  return {real, imaginary};
}

TEST_CASE(
    "math/circular_filter: all small sizes, odd and even, against the plain sums (FR2); a centre one bin off is not "
    "real") {
  for (const auto& size : std::vector<std::pair<int, int>>{
           {1, 1}, {1, 2}, {2, 1}, {2, 3}, {3, 3}, {4, 5}, {5, 4}, {1, 17}, {17, 1}, {7, 12}, {9, 37}, {19, 20}}) {
    const int height = size.first, width = size.second;
    const std::vector<double> x = random_plane<double>(height, width);
    const auto [expected, imaginary] = plain_filter(height, width, x);
    const std::vector<double> y = filtered<double>(height, width, skew_gain, x);
    double error = 0;
    for (std::size_t i = 0; i < y.size(); ++i)
      error = std::max(error, std::abs(y[i] - static_cast<double>(expected[i])));
    CAPTURE(height);
    CAPTURE(width);
    CHECK(error < 1e-15);
    CHECK(static_cast<double>(imaginary) < 1e-17);
    if (height > 3) CHECK(static_cast<double>(plain_filter(height, width, x, 1).second) > 1e-3);
  }
}

template <class T>
double adjoint_gap(int height, int width) {
  const std::vector<T> x = random_plane<T>(height, width, 1), y = random_plane<T>(height, width, 2);
  const std::vector<T> kx = filtered<T>(height, width, skew_gain, x), ky = filtered<T>(height, width, skew_gain, y);
  long double forward = 0, back = 0, norm_kx = 0, norm_y = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    forward += static_cast<long double>(kx[i]) * static_cast<long double>(y[i]);
    back += static_cast<long double>(x[i]) * static_cast<long double>(ky[i]);
    norm_kx += static_cast<long double>(kx[i]) * static_cast<long double>(kx[i]);
    norm_y += static_cast<long double>(y[i]) * static_cast<long double>(y[i]);
  }
  return static_cast<double>(std::abs(forward - back) / std::sqrt(norm_kx * norm_y));
}

TEST_CASE(
    "math/circular_filter: its own adjoint, native sizes included (FR6); a 0/1 gain is idempotent, gain 1 the "
    "identity") {
  CHECK(adjoint_gap<double>(48, 53) < 1e-15);
  CHECK(adjoint_gap<float>(100, 75) < 1e-7);
  CHECK(adjoint_gap<float>(133, 159) < 1e-7);
  CHECK(adjoint_gap<float>(96, 1063) < 1e-7);  // 1063 is prime
  const auto low = [](int ky, int kx) { return ky * ky + kx * kx < 90 ? 1.0 : 0.0; };
  const std::vector<double> x = random_plane<double>(45, 64);
  const std::vector<double> once = filtered<double>(45, 64, low, x), twice = filtered<double>(45, 64, low, once);
  const std::vector<double> same = filtered<double>(
      45, 64, [](int, int) { return 1.0; }, x);
  double error = 0, identity = 0, change = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    error = std::max(error, std::abs(once[i] - twice[i]));
    identity = std::max(identity, std::abs(same[i] - x[i]));
    change = std::max(change, std::abs(once[i] - x[i]));
  }
  CHECK(error < 1e-15);
  CHECK(identity < 1e-15);
  CHECK(change > 0.1);
  // Negative control: with 1 / n left to the backward pass alone, <A x, y> and <x, A^T y> differ by the factor n.
  double forward = 0, back = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    forward += once[i] * once[i];
    back += x[i] * twice[i] * static_cast<double>(x.size());
  }
  CHECK(std::abs(back / forward) > 1000);
}

TEST_CASE(
    "math/circular_filter: a large mean does not cost the detail its digits in float (FR3); without care it does") {
  const int height = 40, width = 48;
  const auto high = [](int ky, int kx) { return 1 - std::exp(-(ky * ky + kx * kx) / 18.0); };
  const std::vector<double> detail = random_plane<double>(height, width);
  std::vector<double> exact_input;
  std::vector<float> x;
  for (const double v : detail) {
    x.push_back(static_cast<float>(100 + 1e-3 * v));
    exact_input.push_back(static_cast<double>(x.back()));
  }
  const std::vector<double> exact = filtered<double>(height, width, high, exact_input);
  const std::vector<float> y = filtered<float>(height, width, high, x);
  double error = 0, naive = 0, size = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    error = std::max(error, std::abs(static_cast<double>(y[i]) - exact[i]));
    size = std::max(size, std::abs(exact[i]));
  }
  // control: one row goes through the transform with its mean
  const Fft<float> fft(width);
  constexpr std::size_t lanes = Fft<float>::lanes;
  std::vector<float> memory(4 * lanes * static_cast<std::size_t>(width), 0.0f);
  const std::size_t part = memory.size() / 4;
  const ComplexLanes<float> data{memory.data(), memory.data() + part};
  const ComplexLanes<float> spare{memory.data() + 2 * part, memory.data() + 3 * part};
  std::vector<double> row;
  for (std::size_t k = 0; k < static_cast<std::size_t>(width); ++k) {
    data.re[k * lanes] = x[k];
    row.push_back(static_cast<double>(x[k]));
  }
  ComplexLanes<float> z = fft.forward(data, spare);
  for (int k = 0; k < width; ++k) {
    const float gain = static_cast<float>(high(0, std::min(k, width - k)) / width);
    z.re[static_cast<std::size_t>(k) * lanes] *= gain;
    z.im[static_cast<std::size_t>(k) * lanes] *= gain;
  }
  z = fft.backward(z, z.re == data.re ? spare : data);
  const std::vector<double> exact_row = filtered<double>(1, width, high, row);
  for (std::size_t k = 0; k < exact_row.size(); ++k)
    naive = std::max(naive, std::abs(static_cast<double>(z.re[k * lanes]) - exact_row[k]));
  CHECK(error / size < 2e-6);
  CHECK(naive / size > 1e-3);
}

TEST_CASE("math/circular_filter: same bits at any thread count, in place, and after other sizes used the context") {
  const std::vector<float> x = random_plane<float>(61, 45);
  const std::vector<float> first = filtered<float>(61, 45, skew_gain, x, 1);
  CHECK(filtered<float>(61, 45, skew_gain, x, 3) == first);
  const CircularFilter<float> filter(61, 45, skew_gain), larger(80, 97, skew_gain);
  CircularFilter<float>::Context context;
  ThreadExecutor executor(2);
  std::vector<float> other = random_plane<float>(80, 97), in_place = x;
  larger.apply(other.data(), other.data(), context, executor);
  filter.apply(in_place.data(), in_place.data(), context, executor);
  CHECK(in_place == first);
}

}  // namespace
