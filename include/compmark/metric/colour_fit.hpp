// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The affine map of colours that takes one image nearest to another in the mean square. A model that was trained with
// an exposure of each photograph renders unseen views in its own gauge: the error that is left after the best map is
// that of the scene, the rest is that of an exposure which nobody could know. Reported beside the plain figure, never
// in place of it.
// Not part of compmark.hpp, of which Eigen would be a sixth of the time to parse: include it by itself.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "compmark/core/config.hpp"
#include "compmark/core/views.hpp"
#include "compmark/metric/psnr.hpp"

namespace compmark {

/// out = matrix in + offset on RGB in [0, 1]; row-major.
struct ColourMap {
  std::array<double, 9> matrix{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> offset{0, 0, 0};
};

/// Least squares over the pixels that count at least by half (`weight` [h w]; empty: all). The sums are taken about the
/// means, in double, and a ridge of the variance of rounding to 8 bits, 1 / (12 255^2), pulls the matrix towards the
/// identity: an image of one colour, or of grey alone, has a map like any other, where the plain normal equations have
/// none. The identity if no pixel counts. Cost: two passes. `Sum` is the type of the sums; being a parameter, it also
/// leaves Eigen's products to the programs that fit colours.
template <class Sum = double>
[[nodiscard]] ColourMap fit_colours(ImageView<const float> image, ImageView<const float> reference,
                                    std::span<const float> weight = {}) {
  COMPMARK_ASSERT(image.channels == 3 && reference.channels == 3 && image.height == reference.height &&
                      image.width == reference.width && (weight.empty() || weight.size() == image.plane_size()),
                  "fit_colours: two images of three channels and one size");
  const std::size_t plane = image.plane_size();
  const auto counts = [&](std::size_t i) { return weight.empty() || weight[i] >= 0.5f; };
  using ColourVector = Eigen::Matrix<Sum, 3, 1>;
  using ColourMatrix = Eigen::Matrix<Sum, 3, 3>;
  const auto colour = [plane](ImageView<const float> of, std::size_t i) {
    return ColourVector(static_cast<Sum>(of.data[i]), static_cast<Sum>(of.data[plane + i]),
                        static_cast<Sum>(of.data[2 * plane + i]));
  };
  ColourVector mean_in = ColourVector::Zero(), mean_out = mean_in;
  std::size_t n = 0;
  for (std::size_t i = 0; i < plane; ++i) {
    if (!counts(i)) continue;
    mean_in += colour(image, i);
    mean_out += colour(reference, i);
    ++n;
  }
  if (n == 0) return {};
  mean_in /= static_cast<Sum>(n);
  mean_out /= static_cast<Sum>(n);
  ColourMatrix in_in = ColourMatrix::Zero(), out_in = in_in;
  for (std::size_t i = 0; i < plane; ++i) {
    if (!counts(i)) continue;
    const ColourVector in = colour(image, i) - mean_in, out = colour(reference, i) - mean_out;
    in_in += in * in.transpose();
    out_in += out * in.transpose();
  }
  const ColourMatrix ridge = ColourMatrix::Identity() * (static_cast<Sum>(n) / Sum(12.0 * 255 * 255));
  const ColourMatrix matrix = (out_in + ridge) * (in_in + ridge).inverse();  // 3 x 3 and positive definite
  const ColourVector offset = mean_out - matrix * mean_in;
  ColourMap map;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      map.matrix[static_cast<std::size_t>(3 * row + column)] = static_cast<double>(matrix(row, column));
    map.offset[static_cast<std::size_t>(row)] = static_cast<double>(offset(row));
  }
  return map;
}

/// PSNR, dB, over the pixels that count, of `image` after the best map and clamping to [0, 1].
template <class Sum = double>
[[nodiscard]] double psnr_colour_fitted(ImageView<const float> image, ImageView<const float> reference,
                                        std::span<const float> weight = {}) {
  const ColourMap map = fit_colours<Sum>(image, reference, weight);
  const std::size_t plane = image.plane_size();
  double squares = 0;
  std::size_t n = 0;
  for (std::size_t i = 0; i < plane; ++i) {
    if (!weight.empty() && weight[i] < 0.5f) continue;
    ++n;
    for (std::size_t row = 0; row < 3; ++row) {
      double value = map.offset[row];
      for (std::size_t c = 0; c < 3; ++c)
        value += map.matrix[3 * row + c] * static_cast<double>(image.data[c * plane + i]);
      value = value > 0 ? (value < 1 ? value : 1) : 0;
      const double d = value - static_cast<double>(reference.data[row * plane + i]);
      squares += d * d;
    }
  }
  return n == 0 ? std::nan("") : psnr_from_mse(squares / (3 * static_cast<double>(n)));
}

}  // namespace compmark
