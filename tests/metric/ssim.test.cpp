// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/metric/ssim.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/splat/loss/reference_ssim.hpp"

namespace {

using namespace compmark;

double reference(const std::vector<float>& a, const std::vector<float>& b, int channels, int height, int width) {
  const std::vector<long double> x(a.begin(), a.end());
  const std::vector<long double> y(b.begin(), b.end());
  return static_cast<double>(
      reference_ssim<long double>({x.data(), channels, height, width}, {y.data(), channels, height, width}).mean);
}

TEST_CASE("metric/ssim: equals the reference on noise, on bright flat images and on images smaller than the window") {
  struct Case {
    int height, width;
    double base, noise;
  };
  for (const Case& c : {Case{24, 31, 0, 1}, Case{16, 16, 0.999, 0.001}, Case{5, 7, 0.1, 0.8}, Case{1, 1, 0.5, 0.1},
                        Case{40, 3, 0, 0.01}}) {
    const Random random(7, 0, random_stage("test"));
    std::vector<float> a(3 * static_cast<std::size_t>(c.height * c.width));
    std::vector<float> b(a.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      a[i] = static_cast<float>(c.base + c.noise * random.uniform(i));
      b[i] = static_cast<float>(c.base + c.noise * random.uniform(i + 100000));
    }
    const double value = ssim({a.data(), 3, c.height, c.width}, {b.data(), 3, c.height, c.width});
    CHECK(std::abs(value - reference(a, b, 3, c.height, c.width)) < 1e-12);
    CHECK(value == ssim({b.data(), 3, c.height, c.width}, {a.data(), 3, c.height, c.width}));  // symmetric to the bit
    CHECK(ssim({a.data(), 3, c.height, c.width}, {a.data(), 3, c.height, c.width}) == 1);
  }
}

TEST_CASE("metric/ssim: closed form for constant images, away from the border") {
  // sigma = 0, so S = (2 a b + C1) / (a^2 + b^2 + C1) inside; the border sees zeros on both sides and is larger or
  // smaller.
  const int size = 401;
  const std::vector<float> a(static_cast<std::size_t>(size * size), 0.5f);
  const std::vector<float> b(static_cast<std::size_t>(size * size), 0.25f);
  const double inside = (2 * 0.5 * 0.25 + 1e-4) / (0.25 + 0.0625 + 1e-4);
  const double value = ssim({a.data(), 1, size, size}, {b.data(), 1, size, size});
  CHECK(std::abs(value - inside) < 0.01);  // 5 % of the pixels feel the border
  CHECK(std::abs(value - inside) > 1e-6);  // and they do: "same" zero padding, not "valid" (LS4)
}

TEST_CASE("metric/ssim: an inverted image is finite and negative in structure (LS3)") {
  const int size = 32;
  const Random random(1, 0, random_stage("test"));
  std::vector<float> a(static_cast<std::size_t>(size * size));
  for (std::size_t i = 0; i < a.size(); ++i) a[i] = static_cast<float>(random.uniform(i));
  std::vector<float> b = a;
  for (float& value : b) value = 1 - value;
  const double value = ssim({a.data(), 1, size, size}, {b.data(), 1, size, size});
  CHECK(std::isfinite(value));
  CHECK(value < -0.5);
  CHECK(value >= -1);
}

}  // namespace
