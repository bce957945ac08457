// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/loss/scale_volume.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;

template <class T>
struct Columns {
  std::array<std::vector<T>, 3> scale, gradient;
  explicit Columns(std::size_t n) {
    const Random random(2, 0, random_stage("test"));
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t i = 0; i < n; ++i) scale[a].push_back(static_cast<T>(random.uniform(i + a * 1000000)));
      gradient[a].resize(n, T(1));
    }
  }
  [[nodiscard]] std::array<const T*, 3> values() const { return {scale[0].data(), scale[1].data(), scale[2].data()}; }
  [[nodiscard]] std::array<T*, 3> gradients() { return {gradient[0].data(), gradient[1].data(), gradient[2].data()}; }
};

TEST_CASE("loss/scale_volume: mean of products, gradient of the other two, added (counts around the pack width)") {
  for (const std::size_t n : {1u, 7u, 8u, 16u, 17u, 1000u}) {
    Columns<double> c(n);
    ScaleVolumeLoss<double> loss;
    ScaleVolumeLoss<double>::Context context;
    SerialExecutor executor;
    const double value = loss.forward_backward(c.values(), n, 3.0, c.gradients(), context, executor).loss;
    long double sum = 0;
    double gap = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double a = c.scale[0][i], b = c.scale[1][i], d = c.scale[2][i];
      sum += static_cast<long double>(a) * static_cast<long double>(b) * static_cast<long double>(d);
      const double k = 3.0 / static_cast<double>(n);
      gap = std::max({gap, std::abs(c.gradient[0][i] - 1 - k * b * d), std::abs(c.gradient[1][i] - 1 - k * a * d),
                      std::abs(c.gradient[2][i] - 1 - k * a * b)});
    }
    CHECK(value == doctest::Approx(static_cast<double>(sum / static_cast<long double>(n))).epsilon(1e-14));
    CHECK(gap < 1e-15);
    CHECK(loss.forward(c.values(), n, context, executor).loss == value);
  }
}

TEST_CASE("loss/scale_volume: a factor counts a Gaussian so many times, and factors of one leave every bit") {
  for (const std::size_t n : {1u, 17u, 9000u}) {
    Columns<double> plain(n), ones(n), counted(n);
    std::vector<double> one(n, 1.0), factor(n);
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) {
      factor[i] = static_cast<double>(i % 5) / 2;
      sum += factor[i] * plain.scale[0][i] * plain.scale[1][i] * plain.scale[2][i] / static_cast<double>(n);
    }
    ScaleVolumeLoss<double> loss;
    ScaleVolumeLoss<double>::Context context;
    SerialExecutor executor;
    const double value = loss.forward_backward(plain.values(), n, 3.0, plain.gradients(), context, executor).loss;
    CHECK(loss.forward_backward(ones.values(), one.data(), n, 3.0, ones.gradients(), context, executor).loss == value);
    CHECK(ones.gradient == plain.gradient);
    CHECK(loss.forward_backward(counted.values(), factor.data(), n, 3.0, counted.gradients(), context, executor).loss ==
          doctest::Approx(sum).epsilon(1e-13));
    CHECK(loss.forward(counted.values(), factor.data(), n, context, executor).loss ==
          doctest::Approx(sum).epsilon(1e-13));
    double gap = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t i = 0; i < n; ++i)
        gap = std::max(gap, std::abs(counted.gradient[a][i] - 1 - factor[i] * (plain.gradient[a][i] - 1)) *
                                static_cast<double>(n));
    }
    CHECK(gap < 1e-11);  // gradients of about 1 / n beside the 1 that they are added to
  }
}

TEST_CASE("loss/scale_volume: no Gaussians cost nothing; a zero scale keeps its gradient") {
  ScaleVolumeLoss<float> loss;
  ScaleVolumeLoss<float>::Context context;
  SerialExecutor executor;
  Columns<float> none(0);
  CHECK(loss.forward_backward(none.values(), 0, 1.0f, none.gradients(), context, executor).loss == 0);
  Columns<float> one(1);
  one.scale = {std::vector<float>{0.0f}, {2.0f}, {3.0f}};
  CHECK(loss.forward_backward(one.values(), 1, 1.0f, one.gradients(), context, executor).loss == 0);
  CHECK(one.gradient[0][0] == 7);
  CHECK(one.gradient[1][0] == 1);
}

TEST_CASE("loss/scale_volume: same bits at any thread count") {
  const std::size_t n = 50001;
  Columns<float> first(n);
  ScaleVolumeLoss<float> loss;
  ScaleVolumeLoss<float>::Context context;
  SerialExecutor serial;
  const double value = loss.forward_backward(first.values(), n, 1.0f, first.gradients(), context, serial).loss;
  for (const std::size_t threads : {2u, 4u}) {
    Columns<float> c(n);
    ThreadExecutor executor(threads);
    CHECK(loss.forward_backward(c.values(), n, 1.0f, c.gradients(), context, executor).loss == value);
    CHECK(c.gradient == first.gradient);
  }
}

}  // namespace
