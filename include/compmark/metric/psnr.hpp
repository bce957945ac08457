// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Peak signal-to-noise ratio for a peak of 1: -10 log10(MSE) over all channels and pixels, squares added in double
// (docs/spec/numerics.md, ME1: a float sum is off by decibels). A data set's figure is the mean of its views' PSNRs,
// not the PSNR of their mean error (case ME2).
#pragma once

#include <cmath>
#include <cstddef>

#include "compmark/core/config.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// What identical images report instead of infinity, so that means over views stay finite; also the largest value
/// reported. (One 8-bit level in a single sample of 3 x 800 x 800 would be 111 dB: differences that small read as
/// identical.)
inline constexpr double psnr_of_identical_images = 99.99;

/// Mean squared error over all channels and pixels.
template <class T>
[[nodiscard]] double mean_squared_error(ImageView<const T> a, ImageView<const T> b) {
  COMPMARK_ASSERT(a.channels == b.channels && a.height == b.height && a.width == b.width,
                  "mean_squared_error: two shapes");
  double sum = 0;
  for (int c = 0; c < a.channels; ++c) {
    for (int y = 0; y < a.height; ++y) {
      double row_sum = 0;  // by rows: short sums lose less, and one image gives one figure whatever the vector width
      for (int x = 0; x < a.width; ++x) {
        const double d = static_cast<double>(a(c, y, x)) - static_cast<double>(b(c, y, x));
        row_sum += d * d;
      }
      sum += row_sum;
    }
  }
  return sum / static_cast<double>(a.size());
}

/// Decibels of an MSE, at most psnr_of_identical_images; NaN stays NaN.
[[nodiscard]] inline double psnr_from_mse(double mse) {
  if (mse == 0) return psnr_of_identical_images;
  const double decibels = -10 * std::log10(mse);
  return decibels > psnr_of_identical_images ? psnr_of_identical_images : decibels;
}

/// PSNR of two images in [0, 1]; round them first (rounding.hpp) where they stand for 8-bit files.
[[nodiscard]] inline double psnr(ImageView<const float> image, ImageView<const float> reference) {
  return psnr_from_mse(mean_squared_error(image, reference));
}

}  // namespace compmark
