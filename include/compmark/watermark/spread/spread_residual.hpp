// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a picture says beyond the unmarked render at its camera: their difference, after the render was made as soft as
// the picture, over its local variance, so that edges and covered parts do not speak louder than the plain areas where
// a mark is heard. Nothing here knows a key, so that nothing here can make evidence. Serial; 400 x 400 takes 0.2 s.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/separable_map.hpp"
#include "compmark/math/symmetric.hpp"

namespace compmark {

namespace detail {

/// Gaussian blur of planes [..., height, width].
inline void blur_planes(std::vector<float>& planes, int width, int height, double sigma) {
  const SeparableMap<float> map{RunTable<float>::gaussian(height, sigma), RunTable<float>::gaussian(width, sigma)};
  const auto channels =
      static_cast<int>(planes.size() / (static_cast<std::size_t>(width) * static_cast<std::size_t>(height)));
  std::vector<float> soft(planes.size());
  PerWorkerRows<float> scratch;
  SerialExecutor serial;
  map.apply(ImageView<const float>{planes.data(), channels, height, width},
            ImageView<float>{soft.data(), channels, height, width}, scratch, serial);
  planes.swap(soft);
}

}  // namespace detail

/// How soft a picture may be, standard deviations of a Gaussian in pixels: the one that leaves the least is taken.
inline constexpr std::array<double, 8> spread_blurs{0, 0.5, 0.7, 1, 1.4, 2, 2.8, 4};
inline constexpr double spread_window = 4;             ///< deviation of the window of the local variance, pixels
inline constexpr float spread_least_variance = 1e-5f;  ///< (0.8 of a level of 255)^2: rounding to 8 bits is no signal

namespace detail {

/// What a render and a picture differ by where neither is marked, to first order: a shift, a scale, a turn and a shear
/// of the picture, its softness, and per channel a tone 1, v, v^2. [16] planes of [3, height, width] in one block.
inline constexpr std::size_t spread_nuisances = 16;
inline std::vector<float> nuisance_planes(const std::vector<float>& render, int width, int height) {
  const std::size_t w = static_cast<std::size_t>(width), plane = w * static_cast<std::size_t>(height), all = 3 * plane;
  std::vector<float> softer = render, planes(spread_nuisances * all, 0.0f);
  blur_planes(softer, width, height, 0.8);
  for (std::size_t c = 0; c < 3; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto at = [&](int row, int column) {
          return render[c * plane + static_cast<std::size_t>(std::clamp(row, 0, height - 1)) * w +
                        static_cast<std::size_t>(std::clamp(column, 0, width - 1))];
        };
        const std::size_t i = c * plane + static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x);
        const float dx = 0.5f * (at(y, x + 1) - at(y, x - 1)), dy = 0.5f * (at(y + 1, x) - at(y - 1, x));
        const float u = 2 * static_cast<float>(x) / static_cast<float>(width) - 1,
                    v = 2 * static_cast<float>(y) / static_cast<float>(height) - 1;
        const float value = render[i];
        const std::array<float, 7> shared{dx, dy, u * dx, v * dx, u * dy, v * dy, softer[i] - value};
        for (std::size_t k = 0; k < shared.size(); ++k) planes[k * all + i] = shared[k];
        const std::array<float, 3> tone{1, value, value * value};
        for (std::size_t k = 0; k < 3; ++k) planes[(7 + 3 * c + k) * all + i] = tone[k];
      }
    }
  }
  return planes;
}

/// Takes out of `values` what the planes say, by least squares with weights. Planes that say nothing are left out.
inline void take_out(std::vector<float>& values, const std::vector<float>& planes, const std::vector<float>& weight) {
  constexpr std::size_t n = spread_nuisances;
  std::array<double, n*(n + 1) / 2> gram{};
  std::array<double, n> right{};
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!(weight[i] > 0)) continue;
    const double w = static_cast<double>(weight[i]);
    std::array<double, n> at{};
    for (std::size_t k = 0; k < n; ++k) at[k] = static_cast<double>(planes[k * values.size() + i]);
    for (std::size_t a = 0, p = 0; a < n; ++a) {
      right[a] += w * at[a] * static_cast<double>(values[i]);
      for (std::size_t b = 0; b <= a; ++b, ++p) gram[p] += w * at[a] * at[b];
    }
  }
  // A ridge of 1e-9 of each diagonal, and of the largest, keeps what is dependent or absent out of the solution.
  double largest = 0;
  for (std::size_t a = 0; a < n; ++a) largest = std::fmax(largest, gram[packed_index(a, a)]);
  if (!(largest > 0)) return;
  for (std::size_t a = 0; a < n; ++a) gram[packed_index(a, a)] += 1e-9 * (gram[packed_index(a, a)] + largest);
  if (!solve_positive(gram, n, right, 1)) return;
  for (std::size_t i = 0; i < values.size(); ++i) {
    double sum = 0;
    for (std::size_t k = 0; k < n; ++k) sum += right[k] * static_cast<double>(planes[k * values.size() + i]);
    values[i] -= static_cast<float>(sum);
  }
}

}  // namespace detail

/// residual [3, height, width] of a picture and the unmarked render of its camera, whose colours were made those of the
/// picture; `weight` [height, width], 0 ... 1, is how far a pixel shows the scene. Returns the blur that was taken.
inline double spread_residual(ImageView<const float> picture, ImageView<const float> render,
                              std::span<const float> weight, ImageView<float> residual) {
  const int width = picture.width, height = picture.height;
  const std::size_t plane = picture.plane_size(), count = picture.size();
  std::vector<float> best(render.data, render.data + count);  // stays, if nothing can be compared
  double least = std::numeric_limits<double>::infinity(), blur = 0;
  for (const double sigma : spread_blurs) {
    std::vector<float> soft(render.data, render.data + count);
    if (sigma > 0) detail::blur_planes(soft, width, height, sigma);
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double d = static_cast<double>(picture.data[i] - soft[i]);
      sum += static_cast<double>(weight[i % plane]) * d * d;
    }
    if (!(sum < least)) continue;
    least = sum;
    blur = sigma;
    best.swap(soft);
  }
  std::vector<float> left(count), inverse(count);
  for (std::size_t i = 0; i < count; ++i) left[i] = picture.data[i] - best[i];
  const auto look = [&] {
    for (std::size_t i = 0; i < count; ++i) inverse[i] = left[i] * left[i];
    detail::blur_planes(inverse, width, height, spread_window);
    for (std::size_t i = 0; i < count; ++i) inverse[i] = weight[i % plane] / (inverse[i] + spread_least_variance);
  };
  // Misfits of camera, softness and tone are larger than a mark: twice, as weights follow from what is left.
  const std::vector<float> nuisances = detail::nuisance_planes(best, width, height);
  for (int round = 0; round < 2; ++round) {
    look();
    detail::take_out(left, nuisances, inverse);
  }
  look();
  for (std::size_t i = 0; i < count; ++i) residual.data[i] = left[i] * inverse[i];
  return blur;
}

}  // namespace compmark
