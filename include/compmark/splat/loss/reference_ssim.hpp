// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The structural similarity and its gradient in the plainest form, for any scalar: the published formulas
// (docs/spec/method.md, 3.1) with the two-dimensional window, variances as central moments about the local mean. Kept
// for ever as the reference of the fast kernels. Cost: 121 taps a pixel, about 2 us; not for training.
#pragma once

#include <array>
#include <cstddef>
#include <cstdlib>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/gaussian_window.hpp"

namespace compmark {

/// Result of reference_ssim: the mean over all channels and pixels, and the map in the layout of the images.
template <class T>
struct ReferenceSsim {
  T mean{};
  std::vector<T> map;
};

/// Similarity of two images of one shape; outside the image both are 0, as published ("zero padding 5"). With `d_x` the
/// gradient of the mean times `weight` is added to it: dL/dx = G*(u) + 2 x G*(r) + y G*(p) (docs/spec/method.md, 3.1).
template <class T>
[[nodiscard]] ReferenceSsim<T> reference_ssim(ImageView<const T> x, ImageView<const T> y, T weight = T(0),
                                              ImageView<T> d_x = {}) {
  COMPMARK_ASSERT(x.channels == y.channels && x.height == y.height && x.width == y.width, "reference_ssim: two shapes");
  const std::array<T, ssim_radius + 1> window = ssim_window<T>();
  const T c1 = static_cast<T>(0.0001L);
  const T c2 = static_cast<T>(0.0009L);
  const auto tap = [&](int i) { return window[static_cast<std::size_t>(std::abs(i))]; };
  const auto inside = [&](int row, int column) {
    return row >= 0 && row < x.height && column >= 0 && column < x.width;
  };

  ReferenceSsim<T> result;
  result.map.resize(x.size());
  std::vector<T> u(x.size()), r(x.size()), p(x.size());
  std::size_t index = 0;
  for (int c = 0; c < x.channels; ++c) {
    for (int row = 0; row < x.height; ++row) {
      for (int column = 0; column < x.width; ++column, ++index) {
        T mean_x{}, mean_y{}, variance_x{}, variance_y{}, covariance{};
        const auto for_window = [&](const auto& use) {
          for (int i = -ssim_radius; i <= ssim_radius; ++i) {
            for (int j = -ssim_radius; j <= ssim_radius; ++j) {
              const bool in = inside(row + i, column + j);
              use(tap(i) * tap(j), in ? x(c, row + i, column + j) : T{}, in ? y(c, row + i, column + j) : T{});
            }
          }
        };
        for_window([&](T w, T a, T b) {
          mean_x += w * a;
          mean_y += w * b;
        });
        for_window([&](T w, T a, T b) {
          variance_x += w * (a - mean_x) * (a - mean_x);
          variance_y += w * (b - mean_y) * (b - mean_y);
          covariance += w * (a - mean_x) * (b - mean_y);
        });
        const T a1 = 2 * mean_x * mean_y + c1;
        const T a2 = 2 * covariance + c2;
        const T b1 = mean_x * mean_x + mean_y * mean_y + c1;
        const T b2 = variance_x + variance_y + c2;
        const T s = a1 * a2 / (b1 * b2);
        result.map[index] = s;
        result.mean += s;
        p[index] = 2 * a1 / (b1 * b2);
        r[index] = -s / b2;
        u[index] = 2 * mean_y * a2 / (b1 * b2) - 2 * mean_x * s / b1 - 2 * mean_x * r[index] - mean_y * p[index];
      }
    }
  }
  const T count = static_cast<T>(x.size());
  result.mean /= count;
  if (d_x.data == nullptr) return result;

  index = 0;
  for (int c = 0; c < x.channels; ++c) {
    const std::size_t plane = x.plane_size() * static_cast<std::size_t>(c);
    for (int row = 0; row < x.height; ++row) {
      for (int column = 0; column < x.width; ++column, ++index) {
        T sum{};
        for (int i = -ssim_radius; i <= ssim_radius; ++i) {
          for (int j = -ssim_radius; j <= ssim_radius; ++j) {
            if (!inside(row + i, column + j)) continue;
            const std::size_t at = plane + static_cast<std::size_t>(row + i) * static_cast<std::size_t>(x.width) +
                                   static_cast<std::size_t>(column + j);
            sum += tap(i) * tap(j) * (u[at] + 2 * x(c, row, column) * r[at] + y(c, row, column) * p[at]);
          }
        }
        d_x(c, row, column) += weight / count * sum;
      }
    }
  }
  return result;
}

}  // namespace compmark
