// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/area_resize.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "support/random_values.hpp"

namespace {

using namespace compmark;
using testing::normals;

constexpr std::array<std::array<int, 4>, 6> resize_sizes{
    {{12, 8, 6, 4}, {13, 7, 5, 7}, {9, 100, 9, 33}, {5, 5, 1, 1}, {7, 3, 7, 3}, {31, 17, 30, 16}}};

}  // namespace

TEST_CASE("math/area_resize: whole boxes are means, thirds are split, a constant stays") {
  SerialExecutor serial;
  AreaResize<double> area;
  const std::vector<double> image{1, 2, 3, 4, 5, 6, 7, 8};
  std::vector<double> out(2);
  area.forward({image.data(), 1, 2, 4}, {out.data(), 1, 1, 2}, serial);
  CHECK(std::abs(out[0] - 3.5) < 1e-15);
  CHECK(std::abs(out[1] - 5.5) < 1e-15);
  const std::vector<double> three{3, 6, 9};  // 3 to 2: [1, 1/2] and [1/2, 1], divided by 3/2
  area.forward({three.data(), 1, 1, 3}, {out.data(), 1, 1, 2}, serial);
  CHECK(std::abs(out[0] - 4) < 1e-15);
  CHECK(std::abs(out[1] - 8) < 1e-15);
  for (const auto& [h, w, th, tw] : resize_sizes) {
    const std::vector<double> flat(static_cast<std::size_t>(h * w), 0.3);
    std::vector<double> small(static_cast<std::size_t>(th * tw));
    area.forward({flat.data(), 1, h, w}, {small.data(), 1, th, tw}, serial);
    for (const double v : small) CHECK(std::abs(v - 0.3) < 1e-15);
  }
}

TEST_CASE("math/area_resize: the backward pass is the adjoint and adds; the same bits at any thread count") {
  for (const auto& [h, w, th, tw] : resize_sizes) {
    const auto image = normals<double>(static_cast<std::size_t>(3 * h * w), 1, "area test");
    const auto d = normals<double>(static_cast<std::size_t>(3 * th * tw), 2, "area test");
    std::vector<double> expected;
    for (const std::size_t threads : {1u, 2u, 3u}) {
      ThreadExecutor executor(threads);
      AreaResize<double> area;
      std::vector<double> small(d.size()), d_image(image.size(), 0.5);
      area.forward({image.data(), 3, h, w}, {small.data(), 3, th, tw}, executor);
      area.adjoint({d.data(), 3, th, tw}, {d_image.data(), 3, h, w}, executor);
      double left = 0, right = 0;
      for (std::size_t i = 0; i < d.size(); ++i) left += small[i] * d[i];
      for (std::size_t i = 0; i < image.size(); ++i) right += image[i] * (d_image[i] - 0.5);
      CHECK(std::abs(left - right) < 1e-12);
      if (expected.empty()) expected = d_image;
      CHECK(d_image == expected);
    }
  }
}
