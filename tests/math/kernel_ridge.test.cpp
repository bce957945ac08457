// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/kernel_ridge.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

using namespace compmark;

namespace {

std::vector<double> normals(std::size_t count, std::uint64_t seed, double scale) {
  const Random random(seed, count, random_stage("test/kernel ridge"));
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = scale * random.normal(i);
  return values;
}
double kernel(const std::vector<double>& points, std::size_t i, std::size_t j, std::size_t dimensions) {
  double square = 0;
  for (std::size_t d = 0; d < dimensions; ++d)
    square += std::pow(points[i * dimensions + d] - points[j * dimensions + d], 2);
  return std::exp(-square / 2);
}

}  // namespace

TEST_CASE("math/kernel_ridge: the coefficients solve their equations, at any thread count") {
  for (const std::size_t n : {1u, 17u, 64u, 65u, 150u, 331u}) {
    CAPTURE(n);
    const std::size_t dimensions = 3, count = 19;
    const std::vector<double> points = normals(n * dimensions, 1, 1), targets = normals(n * count, 2, 1);
    SerialExecutor serial;
    ThreadExecutor threads(3);
    const std::optional<KernelRidge> fit = kernel_ridge(points, targets, n, 0.1, serial),
                                     same = kernel_ridge(points, targets, n, 0.1, threads);
    REQUIRE(fit);
    REQUIRE(same);
    CHECK(fit->coefficient == same->coefficient);
    CHECK(fit->left_out_error == same->left_out_error);
    double worst = 0;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t t = 0; t < count; ++t) {
        double sum = 0.1 * fit->coefficient[i * count + t];
        for (std::size_t j = 0; j < n; ++j) sum += kernel(points, i, j, dimensions) * fit->coefficient[j * count + t];
        worst = std::fmax(worst, std::abs(sum - targets[i * count + t]));
      }
    }
    CHECK(worst < 1e-10);  // condition of at most n / ridge = 3310, times rounding
  }
}

TEST_CASE("math/kernel_ridge: the error of a point is that of the fit without it") {
  const std::size_t n = 40, dimensions = 2;
  const std::vector<double> points = normals(n * dimensions, 3, 1.5), targets = normals(n, 4, 1);
  SerialExecutor serial;
  const std::optional<KernelRidge> all = kernel_ridge(points, targets, n, 0.2, serial);
  REQUIRE(all);
  double off = 0;
  for (const std::size_t out : {0u, 7u, 39u}) {
    std::vector<double> others, values;
    for (std::size_t i = 0; i < n; ++i) {
      if (i == out) continue;
      others.insert(others.end(), points.begin() + static_cast<std::ptrdiff_t>(i * dimensions),
                    points.begin() + static_cast<std::ptrdiff_t>((i + 1) * dimensions));
      values.push_back(targets[i]);
    }
    const std::optional<KernelRidge> fit = kernel_ridge(others, values, n - 1, 0.2, serial);
    REQUIRE(fit);
    double said = 0, within = 0;
    for (std::size_t i = 0, j = 0; i < n; ++i) {
      within += all->coefficient[i] * kernel(points, out, i, dimensions);
      if (i != out) said += fit->coefficient[j++] * kernel(points, out, i, dimensions);
    }
    CHECK(all->left_out_error[out] == doctest::Approx(targets[out] - said).epsilon(1e-9));
    off = std::fmax(off, std::abs(targets[out] - within - all->left_out_error[out]));
  }
  CHECK(off > 0.01);  // the control: what the point's own fit leaves of it is another number, and a flattering one
}

TEST_CASE("math/kernel_ridge: points of a group are left out together: a twin knows too much") {
  const std::size_t n = 42, dimensions = 2, group = 3;
  std::vector<double> points = normals(n * dimensions, 8, 1.5), targets = normals(2 * n, 9, 1);
  for (std::size_t i = 0; i < n; ++i) {  // those of a group are nearly the same
    for (std::size_t d = 0; d < dimensions; ++d)
      points[i * dimensions + d] = points[i / group * group * dimensions + d] + 0.01 * static_cast<double>(i % group);
    for (std::size_t t = 0; t < 2; ++t) targets[i * 2 + t] = targets[i / group * group * 2 + t];
  }
  ThreadExecutor executor(2);
  const std::optional<KernelRidge> together = kernel_ridge(points, targets, n, 0.05, executor, group),
                                   alone = kernel_ridge(points, targets, n, 0.05, executor);
  REQUIRE(together);
  REQUIRE(alone);
  CHECK(together->coefficient == alone->coefficient);
  double missed = 0, flattered = 0;
  for (std::size_t i = 0; i < 2 * n; ++i) {
    missed += together->left_out_error[i] * together->left_out_error[i];
    flattered += alone->left_out_error[i] * alone->left_out_error[i];
  }
  CHECK(missed > 5 * flattered);                 // the control
  for (const std::size_t out : {0u, 5u, 13u}) {  // groups
    std::vector<double> others, values;
    for (std::size_t i = 0; i < n; ++i) {
      if (i / group == out) continue;
      for (std::size_t d = 0; d < dimensions; ++d) others.push_back(points[i * dimensions + d]);
      for (std::size_t t = 0; t < 2; ++t) values.push_back(targets[i * 2 + t]);
    }
    const std::optional<KernelRidge> fit = kernel_ridge(others, values, n - group, 0.05, executor);
    REQUIRE(fit);
    for (std::size_t i = out * group; i < (out + 1) * group; ++i) {
      for (std::size_t t = 0; t < 2; ++t) {
        double said = 0;
        for (std::size_t j = 0, at = 0; j < n; ++j) {
          if (j / group != out) said += fit->coefficient[2 * at++ + t] * kernel(points, i, j, dimensions);
        }
        CHECK(together->left_out_error[i * 2 + t] == doctest::Approx(targets[i * 2 + t] - said).epsilon(1e-8));
      }
    }
  }
}

TEST_CASE("math/kernel_ridge: a smooth function is known between its points, noise is not") {
  const std::size_t n = 600, dimensions = 2;
  const std::vector<double> points = normals(n * dimensions, 5, 1), noise = normals(n, 6, 1);
  std::vector<double> targets(2 * n);
  for (std::size_t i = 0; i < n; ++i) {
    targets[2 * i] = std::sin(2 * points[2 * i]) * std::cos(points[2 * i + 1]);
    targets[2 * i + 1] = noise[i];
  }
  SerialExecutor serial;
  const std::optional<KernelRidge> fit = kernel_ridge(points, targets, n, 0.05, serial);
  REQUIRE(fit);
  double smooth = 0, chance = 0;
  for (std::size_t i = 0; i < n; ++i) {
    smooth += fit->left_out_error[2 * i] * fit->left_out_error[2 * i] / static_cast<double>(n);
    chance += fit->left_out_error[2 * i + 1] * fit->left_out_error[2 * i + 1] / static_cast<double>(n);
  }
  MESSAGE("mean square missed: smooth ", smooth, ", noise ", chance);
  CHECK(smooth < 0.01);  // of a mean square of .24
  CHECK(chance > 0.9);   // of 1
}

TEST_CASE("math/kernel_ridge: points that coincide are no trouble, numbers that are none are refused") {
  const std::size_t n = 70;
  const std::vector<double> points(n, 0.5), targets = normals(n, 7, 1);
  SerialExecutor serial;
  const std::optional<KernelRidge> fit = kernel_ridge(points, targets, n, 1e-3, serial);
  REQUIRE(fit);
  double mean = 0, said = 0;
  for (std::size_t i = 0; i < n; ++i) {
    mean += targets[i] / static_cast<double>(n);
    said += fit->coefficient[i];
  }
  CHECK(said == doctest::Approx(mean).epsilon(1e-3));  // the mean, shrunk by ridge / n
  std::vector<double> broken = targets;
  broken[3] = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(kernel_ridge(points, broken, n, 1e-3, serial));
  broken[3] = std::numeric_limits<double>::infinity();
  CHECK_FALSE(kernel_ridge(broken, targets, n, 1e-3, serial));
}
