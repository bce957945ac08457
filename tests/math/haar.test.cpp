// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/haar.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "support/random_values.hpp"

namespace {

using namespace compmark;
using testing::normals;

std::size_t area(int height, int width) { return static_cast<std::size_t>(height) * static_cast<std::size_t>(width); }

}  // namespace

TEST_CASE("math/haar: a constant c becomes 2 c, a 3 x 3 of ones a 2 x 2 of twos, exactly") {
  SerialExecutor serial;
  for (const auto& [height, width] : {std::pair{3, 3}, {1, 1}, {1, 4}, {8, 5}, {6, 2}}) {
    const std::vector<float> image(3 * area(height, width), 0.7f);
    std::vector<float> low(3 * area(haar_size(height), haar_size(width)), -1.0f);
    haar_low<float>({image.data(), 3, height, width}, {low.data(), 3, haar_size(height), haar_size(width)}, serial);
    for (const float value : low) CHECK(value == 2 * 0.7f);
  }
  const std::vector<double> ones(9, 1.0);
  std::vector<double> low(4);
  haar_low<double>({ones.data(), 1, 3, 3}, {low.data(), 1, 2, 2}, serial);
  CHECK(low == std::vector<double>(4, 2.0));
}

TEST_CASE("math/haar: an even image loses no energy to scale: the basis is orthonormal, a mean is not") {
  SerialExecutor serial;
  const auto low = normals<double>(4 * 6, 1, "haar test");
  std::vector<double> image(8 * 12, 0.0);
  haar_low_adjoint<double>({low.data(), 1, 4, 6}, {image.data(), 1, 8, 12}, serial);  // a synthesis from LL alone
  double energy_low = 0, energy_image = 0;
  for (const double v : low) energy_low += v * v;
  for (const double v : image) energy_image += v * v;
  CHECK(std::abs(energy_image / energy_low - 1) < 1e-14);
  std::vector<double> back(4 * 6);
  haar_low<double>({image.data(), 1, 8, 12}, {back.data(), 1, 4, 6}, serial);
  for (std::size_t i = 0; i < back.size(); ++i) CHECK(std::abs(back[i] - low[i]) < 1e-15);
}

TEST_CASE("math/haar: the backward pass is the adjoint and adds, for odd and even sizes") {
  SerialExecutor serial;
  for (const auto& [height, width] : {std::pair{8, 12}, {7, 12}, {8, 11}, {7, 11}, {1, 1}, {1, 9}, {2, 1}}) {
    const int h = haar_size(height), w = haar_size(width);
    const auto image = normals<double>(2 * area(height, width), 2, "haar test"),
               d_low = normals<double>(2 * area(h, w), 3, "haar test");
    std::vector<double> low(d_low.size()), d_image(image.size(), 1.0);
    haar_low<double>({image.data(), 2, height, width}, {low.data(), 2, h, w}, serial);
    haar_low_adjoint<double>({d_low.data(), 2, h, w}, {d_image.data(), 2, height, width}, serial);
    double left = 0, right = 0, size = 0;
    for (std::size_t i = 0; i < low.size(); ++i) left += low[i] * d_low[i];
    for (std::size_t i = 0; i < image.size(); ++i) {
      right += image[i] * (d_image[i] - 1);
      size += std::abs(image[i] * d_image[i]);
    }
    CHECK(std::abs(left - right) < 1e-14 * (1 + size));
  }
}

TEST_CASE("math/haar: the same bits at any thread count") {
  const auto image = normals<float>(3 * area(101, 67), 4, "haar test");
  std::vector<float> expected;
  for (const std::size_t threads : {1u, 2u, 3u}) {
    ThreadExecutor executor(threads);
    std::vector<float> low(3 * area(51, 34)), d(image.size(), 0.0f);
    haar_low<float>({image.data(), 3, 101, 67}, {low.data(), 3, 51, 34}, executor);
    haar_low_adjoint<float>({low.data(), 3, 51, 34}, {d.data(), 3, 101, 67}, executor);
    low.insert(low.end(), d.begin(), d.end());
    if (expected.empty()) expected = low;
    CHECK(low == expected);
  }
}
