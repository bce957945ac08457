// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/fft.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

/// All lanes of one batch, each another random signal.
template <class T>
struct Batch {
  std::size_t lanes = Fft<T>::lanes, n;
  std::vector<T> memory;
  ComplexLanes<T> data, spare;
  explicit Batch(const Fft<T>& fft) : n(static_cast<std::size_t>(fft.length())), memory(4 * fft.room() * lanes) {
    const std::size_t size = fft.room() * lanes;
    T* const m = memory.data();
    data = {m, m + size};
    spare = {m + 2 * size, m + 3 * size};
    const Random random(4, n, random_stage("test"));
    for (std::size_t i = 0; i < n * lanes; ++i) {
      data.re[i] = static_cast<T>(random.centered(2 * i));
      data.im[i] = static_cast<T>(random.centered(2 * i + 1));
    }
  }
  [[nodiscard]] std::vector<std::complex<long double>> signal(ComplexLanes<T> x, std::size_t lane) const {
    std::vector<std::complex<long double>> result;
    for (std::size_t k = 0; k < n; ++k) result.emplace_back(x.re[k * lanes + lane], x.im[k * lanes + lane]);
    return result;
  }
};

std::vector<std::complex<long double>> plain_transform(const std::vector<std::complex<long double>>& x) {
  const std::size_t n = x.size();
  std::vector<std::complex<long double>> root, y(n);
  for (std::size_t k = 0; k < n; ++k)
    root.push_back(std::polar(
        1.0L, -2 * std::numbers::pi_v<long double> * static_cast<long double>(k) / static_cast<long double>(n)));
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t k = 0; k < n; ++k) y[j] += root[j * k % n] * x[k];
  }
  return y;
}

long double gap(const std::vector<std::complex<long double>>& a, const std::vector<std::complex<long double>>& b) {
  long double error = 0, size = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    error += std::norm(a[k] - b[k]);
    size += std::norm(b[k]);
  }
  return std::sqrt(error / size);
}

template <class T>
void check_lengths(const std::vector<int>& lengths, long double bound, long double bluestein_bound) {
  for (const int length : lengths) {
    const Fft<T> fft(length);
    const bool bluestein = fft.room() != static_cast<std::size_t>(length);
    Batch<T> batch(fft);
    const std::size_t lane = batch.lanes - 1;
    const auto x = batch.signal(batch.data, lane), first = batch.signal(batch.data, 0);
    ComplexLanes<T> result = fft.forward(batch.data, batch.spare);
    const long double error = gap(batch.signal(result, lane), plain_transform(x));
    CAPTURE(length);
    CHECK(static_cast<double>(error) <= static_cast<double>(bluestein ? bluestein_bound : bound));
    // there and back, and Parseval
    long double power = 0, spectrum_power = 0;
    for (const auto& v : batch.signal(result, 0)) spectrum_power += std::norm(v) / length;
    for (const auto& v : first) power += std::norm(v);
    CHECK(static_cast<double>(std::abs(spectrum_power / power - 1)) <=
          static_cast<double>(4 * (bluestein ? bluestein_bound : bound)));
    result = fft.backward(result, result.re == batch.data.re || result.re == batch.data.im ? batch.spare : batch.data);
    auto back = batch.signal(result, 0);
    for (auto& v : back) v /= length;
    CHECK(static_cast<double>(gap(back, first)) <= static_cast<double>(2 * (bluestein ? bluestein_bound : bound)));
  }
}

TEST_CASE("math/fft: every length from 1 to 64 and native image sizes, against the plain sum in long double (FR5)") {
  std::vector<int> lengths;
  for (int n = 1; n <= 64; ++n) lengths.push_back(n);
  for (const int n : {400, 532, 797, 801}) lengths.push_back(n);
  check_lengths<float>(lengths, 4e-7L, 6e-7L);
  check_lengths<double>(lengths, 8e-16L, 1.2e-15L);
  check_lengths<float>({800, 1008, 1024, 1063, 1600}, 4e-7L, 6e-7L);
}

TEST_CASE("math/fft: negative control, a signal that is padded to a smooth length has another spectrum (FR5)") {
  // A wave of three turns in 37 samples is one line; with zeros up to 40 samples it is spread over all.
  const auto lines = [](int padded) {
    const Fft<double> fft(padded);
    Batch<double> batch(fft);
    for (std::size_t i = 0; i < static_cast<std::size_t>(padded) * batch.lanes; ++i) {
      const auto sample = static_cast<double>(i / batch.lanes);
      batch.data.re[i] = sample < 37 ? std::cos(2 * std::numbers::pi * 3 * sample / 37) : 0;
      batch.data.im[i] = 0;
    }
    std::size_t count = 0;
    for (const auto& v : batch.signal(fft.forward(batch.data, batch.spare), 0)) count += std::abs(v) > 0.1L ? 1 : 0;
    return count;
  };
  CHECK(lines(37) == 2);  // itself and its conjugate
  CHECK(lines(40) > 20);
}

TEST_CASE("math/fft: Bluestein is for large prime factors only; the convolution has a smooth length") {
  CHECK(Fft<float>(400).room() == 400);
  CHECK(Fft<float>(31 * 29).room() == 31 * 29);
  CHECK(Fft<float>(37).room() == 75);
  CHECK(Fft<float>(1063).room() == 2160);
}

TEST_CASE("math/fft: twiddles from a table keep the digits that a recurrence loses (FR4)") {
  constexpr int n = 4096;
  float re = 1, im = 0;
  double worst = 0;
  const float c = static_cast<float>(std::cos(2 * std::numbers::pi / n));
  const float s = static_cast<float>(-std::sin(2 * std::numbers::pi / n));
  for (int k = 0; k < n; ++k) {
    worst = std::max({worst, std::abs(static_cast<double>(re) - std::cos(2 * std::numbers::pi * k / n)),
                      std::abs(static_cast<double>(im) + std::sin(2 * std::numbers::pi * k / n))});
    const float next = re * c - im * s;
    im = re * s + im * c;
    re = next;
  }
  CHECK(worst > 1e-5);  // the recurrence: an error the bound below could not hide
  const Fft<float> fft(n);
  Batch<float> batch(fft);
  for (std::size_t i = 0; i < static_cast<std::size_t>(n) * batch.lanes; ++i) {
    batch.data.re[i] = i / batch.lanes == 1 ? 1.0f : 0.0f;
    batch.data.im[i] = 0;
  }
  const auto spectrum = batch.signal(fft.forward(batch.data, batch.spare), 0);
  double error = 0;
  for (int k = 0; k < n; ++k) {
    error = std::max({error,
                      std::abs(static_cast<double>(spectrum[static_cast<std::size_t>(k)].real()) -
                               std::cos(2 * std::numbers::pi * k / n)),
                      std::abs(static_cast<double>(spectrum[static_cast<std::size_t>(k)].imag()) +
                               std::sin(2 * std::numbers::pi * k / n))});
  }
  CHECK(error < 4e-7);
}

}  // namespace
