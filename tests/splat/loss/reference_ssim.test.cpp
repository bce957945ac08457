// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/loss/reference_ssim.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

TEST_CASE("math/gaussian_window: the published weights, a sum of one") {
  const std::array<double, 6> published{0.26601172, 0.21300554, 0.10936069, 0.03600077, 0.00759876, 0.00102838};
  const auto weights = ssim_window<double>();
  const auto narrow = ssim_window<float>();
  double sum = 0, narrow_sum = 0;
  for (std::size_t k = 0; k < 6; ++k) {
    CHECK(std::abs(weights[k] - published[k]) < 6e-9);
    CHECK(std::abs(static_cast<double>(narrow[k]) - weights[k]) < 1e-8);
    sum += (k == 0 ? 1 : 2) * weights[k];
    narrow_sum += (k == 0 ? 1 : 2) * static_cast<double>(narrow[k]);
  }
  CHECK(std::abs(sum - 1) < 1e-16);
  CHECK(std::abs(narrow_sum - 1) <= 0x1p-26);  // half an ulp of the centre weight
}

TEST_CASE("loss/reference_ssim: one white pixel against black, by hand") {
  // The window of a pixel at distance (i, j) sees one sample of weight w = g_i g_j: mean w, variance w - w^2, y = 0.
  const int n = 15;
  std::vector<double> x(static_cast<std::size_t>(n * n)), y(x.size());
  x[static_cast<std::size_t>(7 * n + 7)] = 1;
  const auto result = reference_ssim<double>({x.data(), 1, n, n}, {y.data(), 1, n, n});
  const auto g = ssim_window<double>();
  for (int i = 0; i <= 7; ++i) {
    for (int j = 0; j <= 7; ++j) {
      const double w = i <= 5 && j <= 5 ? g[static_cast<std::size_t>(i)] * g[static_cast<std::size_t>(j)] : 0;
      const double expected = 1e-4 * 9e-4 / ((w * w + 1e-4) * (w - w * w + 9e-4));
      CHECK(result.map[static_cast<std::size_t>((7 + i) * n + 7 + j)] == doctest::Approx(expected).epsilon(1e-12));
    }
  }
}

TEST_CASE("loss/reference_ssim: the gradient is the slope of the mean (central differences in long double)") {
  const int h = 9, w = 14;
  const Random random(5, 0, random_stage("test"));
  std::vector<long double> x(static_cast<std::size_t>(2 * h * w)), y(x.size()), d(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = static_cast<long double>(random.uniform(i));
    y[i] = static_cast<long double>(random.uniform(i + 10000));
  }
  const auto mean = [&] { return reference_ssim<long double>({x.data(), 2, h, w}, {y.data(), 2, h, w}).mean; };
  (void)reference_ssim<long double>({x.data(), 2, h, w}, {y.data(), 2, h, w}, 1,
                                    ImageView<long double>{d.data(), 2, h, w});
  const long double step = 1e-5L;
  long double gap = 0;
  for (std::size_t i = 0; i < x.size(); i += 31) {
    const long double old = x[i];
    x[i] = old + step;
    const long double above = mean();
    x[i] = old - step;
    const long double below = mean();
    x[i] = old;
    gap = std::max(gap, std::abs((above - below) / (2 * step) - d[i]));
  }
  CHECK(gap < 1e-10L);
}

}  // namespace
