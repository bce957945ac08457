// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Structural similarity as a figure of merit: 11 x 11 Gaussian window, sigma 1.5, zeros outside the image, data range
// 1, mean over all channels and pixels (the splatting family's convention, docs/spec/watermark.md, 7). Everything in
// double; its own code, independent of the training loss. Evaluated as 1 - (A1 e2 + e1 B2) / (B1 B2) with e1 = B1 - A1
// = (mean difference)^2 and e2 = B2 - A2 = variance of the difference: the published S = A1 A2 / (B1 B2) without its
// cancellation, so identical images give exactly 1. Cost: 88 multiply-adds in double a sample.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/gaussian_window.hpp"

namespace compmark {

/// SSIM of two images in [0, 1] of one shape, any size. 1 for identical images.
[[nodiscard]] inline double ssim(ImageView<const float> image, ImageView<const float> reference) {
  COMPMARK_ASSERT(
      image.channels == reference.channels && image.height == reference.height && image.width == reference.width,
      "ssim: two shapes");
  if (image.size() == 0) return 1;
  const std::array<double, ssim_radius + 1> window = ssim_window<double>();
  const int height = image.height;
  const int width = image.width;
  const std::size_t padded = static_cast<std::size_t>(width) + 2 * ssim_radius;
  // Four moments of one row, blurred vertically; the margins stay zero.
  std::array<std::vector<double>, 4> blurred;
  for (std::vector<double>& row : blurred) row.resize(padded);
  double sum = 0;
  for (int c = 0; c < image.channels; ++c) {
    for (int y = 0; y < height; ++y) {
      for (std::vector<double>& row : blurred) std::fill(row.begin() + ssim_radius, row.end() - ssim_radius, 0.0);
      for (int k = std::max(-ssim_radius, -y); k <= std::min(ssim_radius, height - 1 - y); ++k) {
        const double w = window[static_cast<std::size_t>(k < 0 ? -k : k)];
        const float* a_row = image.row(c, y + k);
        const float* b_row = reference.row(c, y + k);
        double* const mean_a = blurred[0].data() + ssim_radius;
        double* const mean_b = blurred[1].data() + ssim_radius;
        double* const product = blurred[2].data() + ssim_radius;
        double* const square_d = blurred[3].data() + ssim_radius;
        for (int x = 0; x < width; ++x) {
          const double a = static_cast<double>(a_row[x]);
          const double b = static_cast<double>(b_row[x]);
          mean_a[x] += w * a;
          mean_b[x] += w * b;
          product[x] += w * (a * b);
          square_d[x] += w * ((a - b) * (a - b));
        }
      }
      double row_sum = 0;
      for (int x = 0; x < width; ++x) {
        std::array<double, 4> m{};
        for (std::size_t map = 0; map < m.size(); ++map) {
          const double* center = blurred[map].data() + ssim_radius + x;
          double value = window[0] * center[0];
          for (int k = 1; k <= ssim_radius; ++k)
            value += window[static_cast<std::size_t>(k)] * (center[-k] + center[k]);
          m[map] = value;
        }
        const double mean_d = m[0] - m[1];
        const double e1 = mean_d * mean_d;
        const double e2 = m[3] - e1;
        const double a1 = 2 * m[0] * m[1] + ssim_c1;
        const double a2 = 2 * (m[2] - m[0] * m[1]) + ssim_c2;
        const double b1 = a1 + e1;
        const double b2 = a2 + e2;
        row_sum += (a1 * e2 + e1 * b2) / (b1 * b2);
      }
      sum += row_sum;
    }
  }
  return 1 - sum / static_cast<double>(image.size());
}

}  // namespace compmark
