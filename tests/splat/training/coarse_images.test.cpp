// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/training/coarse_images.hpp"

#include <doctest/doctest.h>

#include <compmark/core/random.hpp>
#include <cstddef>
#include <vector>

namespace {

using namespace compmark;

std::vector<double> coarse_noise(std::size_t count, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("coarse images test"));
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = random.uniform(i);
  return values;
}

/// The weighted mean of a box, from the definition.
double mean_of_box(const std::vector<double>& plane, const std::vector<double>& weight, int width, int factor, int y,
                   int x, std::size_t first = 0) {
  double sum = 0, total = 0, plain = 0;
  for (int j = 0; j < factor; ++j) {
    for (int i = 0; i < factor; ++i) {
      const auto pixel = static_cast<std::size_t>((factor * y + j) * width + factor * x + i);
      sum += weight[pixel] * plane[first + pixel];
      total += weight[pixel];
      plain += plane[first + pixel] / (factor * factor);
    }
  }
  return total > 0 ? sum / total : plain;
}

}  // namespace

TEST_CASE(
    "training/coarse_images: colours are means of boxes, in place, and what is left over at the edges is dropped") {
  for (const int factor : {1, 2, 3, 4, 5}) {
    CAPTURE(factor);
    constexpr int width = 23, height = 17;
    const std::vector<double> whole = coarse_noise(3 * width * height, 1), same(width * height, 1.0);
    std::vector<double> values = whole;
    const ImageView<double> coarse =
        make_coarse(TargetPlanes<double>{ImageView<double>{values.data(), 3, height, width}}, factor);
    CHECK(coarse.data == values.data());
    REQUIRE(coarse.width == width / factor);
    REQUIRE(coarse.height == height / factor);
    REQUIRE(coarse.channels == 3);
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < coarse.height; ++y) {
        for (int x = 0; x < coarse.width; ++x) {
          const auto first = static_cast<std::size_t>(c) * width * height;
          CHECK(coarse(c, y, x) ==
                doctest::Approx(mean_of_box(whole, same, width, factor, y, x, first)).epsilon(1e-14));
        }
      }
    }
  }
}

TEST_CASE("training/coarse_images: pixels that do not count leave no trace in the colours beside them") {
  constexpr int width = 12, height = 8, factor = 2, pixels = width * height;
  std::vector<double> colors = coarse_noise(3 * pixels, 2), alpha = coarse_noise(pixels, 3), weight(pixels);
  for (std::size_t i = 0; i < pixels; ++i) weight[i] = i % 5 == 0 ? 0.0 : i % 3 == 0 ? 0.25 : 1.0;
  for (const std::size_t i : {0u, 1u, 12u, 13u}) weight[i] = 0;  // a whole box
  const std::vector<double> before = colors, covered = alpha, counts = weight, same(pixels, 1.0);
  std::vector<double> other = colors;
  for (std::size_t i = 0; i < pixels; ++i) {
    if (weight[i] == 0 && i > 13) other[i] = other[pixels + i] = 1e9;  // garbage behind the mask
  }
  const auto coarse = make_coarse(
      TargetPlanes<double>{ImageView<double>{colors.data(), 3, height, width}, alpha.data(), weight.data()}, factor);
  std::vector<double> other_alpha = covered, other_weight = counts;
  const auto hidden = make_coarse(
      TargetPlanes<double>{ImageView<double>{other.data(), 3, height, width}, other_alpha.data(), other_weight.data()},
      factor);
  for (int y = 0; y < coarse.height; ++y) {
    for (int x = 0; x < coarse.width; ++x) {
      CAPTURE(y);
      CAPTURE(x);
      const auto pixel = static_cast<std::size_t>(y * coarse.width + x);
      for (int c = 0; c < 3; ++c) {
        const auto first = static_cast<std::size_t>(c) * pixels;
        CHECK(coarse(c, y, x) == doctest::Approx(mean_of_box(before, counts, width, factor, y, x, first)));
        CHECK(coarse(c, y, x) == hidden(c, y, x));
      }
      CHECK(alpha[pixel] == doctest::Approx(mean_of_box(covered, counts, width, factor, y, x)));
      CHECK(weight[pixel] == doctest::Approx(mean_of_box(counts, same, width, factor, y, x)));
    }
  }
  CHECK(weight[0] == 0);
}
