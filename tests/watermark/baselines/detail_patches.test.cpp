// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/detail_patches.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <vector>

#include "watermark/baselines/random_picture.hpp"

using namespace compmark;

TEST_CASE("baselines/detail_patches: a score is the weighted spectrum of its patch") {
  const std::vector<double> picture = testing::random_picture(20, 22, 4);
  const ImageView<const double> image{picture.data(), 3, 20, 22};
  double expected = 0;
  for (int c = 0; c < 3; ++c) {
    for (int f = -8; f < 8; ++f) {
      for (int g = -8; g < 8; ++g) {
        std::complex<double> sum = 0;
        for (int y = 0; y < 16; ++y) {
          for (int x = 0; x < 16; ++x)
            sum += image(c, y + 3, x + 5) * std::polar(1.0, -2 * std::numbers::pi * (f * x + g * y) / 16);
        }
        const double u = 2.0 * (f + 8) / 15 - 1, v = 2.0 * (g + 8) / 15 - 1;
        expected += std::abs(sum) * u * u * v * v / (3 * 256);
      }
    }
  }
  CHECK(DetailPatches::score(image, 5, 3) == doctest::Approx(expected).epsilon(1e-12));
  const std::vector<double> flat(picture.size(), 0.5);
  const double even = DetailPatches::score(ImageView<const double>{flat.data(), 3, 20, 22}, 5, 3);
  CHECK(even == doctest::Approx(128 * std::pow(1.0 / 15, 4) / 256).epsilon(1e-9));  // its mean alone
  CHECK(even < 0.001 * expected);
}

TEST_CASE("baselines/detail_patches: the patch with the detail is found, and what no patch covers is in none") {
  // 3 x 2 patches of 53 x 40 pixels, noise in the second of the lower row.
  std::vector<double> picture(3 * 40 * 53, 0.5);
  const std::vector<double> noise = testing::random_picture(40, 53, 7);
  const ImageView<double> image{picture.data(), 3, 40, 53};
  for (int c = 0; c < 3; ++c) {
    for (int y = 16; y < 32; ++y) {
      for (int x = 16; x < 32; ++x) image(c, y, x) = noise[static_cast<std::size_t>((c * 40 + y) * 53 + x)];
    }
  }
  const DetailPatches patches(ImageView<const double>(image), 1.0 / 6);
  CHECK(patches.count() == 1);
  CHECK(patches.holds({16.0, 31.9}));
  CHECK_FALSE(patches.holds({15.9, 31.9}));
  CHECK_FALSE(patches.holds({16.0, 32.0}));
  CHECK(DetailPatches(ImageView<const double>(image), 1e-3).holds({16.0, 31.9}));  // at least one
  const ImageView<const double> small{picture.data(), 3, 15, 30};
  CHECK(DetailPatches(small, 1).count() == 0);
  const DetailPatches all(ImageView<const double>(image), 1);
  CHECK(all.count() == 6);
  CHECK(all.holds({47.9, 0.0}));
  for (const std::array<double, 2>& outside :
       {std::array{48.0, 0.0}, std::array{-0.1, 3.0}, std::array{3.0, 32.0}, std::array{std::nan(""), 3.0}})
    CHECK_FALSE(all.holds(outside));
}
