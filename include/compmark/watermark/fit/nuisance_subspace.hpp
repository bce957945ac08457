// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Separates the nuisance subspace of the Fourier features from its complement. The features' means change with the
// view. The principal directions of that change span the nuisance subspace; a mark changes these coordinates little, so
// they determine the view. The cover interference along the other directions is a smooth function of them, which is
// fitted by kernel ridge regression over all readings. Its error in a reading that was left out is the noise against
// which a message is read. Cost: 6 n^3 flops a sweep for n features, and kernel_ridge.hpp's for the readings.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/math/eigen_pairs.hpp"
#include "compmark/math/kernel_ridge.hpp"
#include "compmark/watermark/decoder/cover_prediction.hpp"
#include "compmark/watermark/fit/decoder_fit_settings.hpp"
#include "compmark/watermark/fit/fourier_statistics.hpp"

namespace compmark {

namespace detail {

/// The complement of the nuisance subspace: `direction` [count, features], orthonormal rows, and `noise` [count,
/// count], the covariance of the prediction error in views that the prediction was not fitted to.
struct NuisanceComplement {
  std::size_t count = 0;
  std::vector<double> direction, noise;
  std::vector<double> coefficient;                    ///< [readings, count] of the prediction; empty without one
  std::vector<double> centre;                         ///< [readings, coordinates]
  std::vector<double> coordinate, coordinate_offset;  ///< [coordinates, features], [coordinates]

  /// Adds the prediction of cover interference for a bit that reads `row` [count] of the directions.
  template <class T>
  void add_prediction(std::size_t bit, std::size_t bits, const std::vector<double>& row,
                      CoverPrediction<T>& cover) const {
    if (coefficient.empty()) return;
    if (cover.empty()) {
      cover.direction.assign(coordinate.begin(), coordinate.end());
      cover.offset.assign(coordinate_offset.begin(), coordinate_offset.end());
      cover.centre.assign(centre.begin(), centre.end());
      cover.coefficient.resize(cover.centres() * bits);
    }
    for (std::size_t i = 0; i < cover.centres(); ++i) {
      double sum = 0;
      for (std::size_t k = 0; k < count; ++k) sum += coefficient[i * count + k] * row[k];
      cover.coefficient[i * bits + bit] = static_cast<T>(sum);
    }
  }
};

/// D M D^T for the rows D [m, n] and a symmetric M [n, n].
[[nodiscard]] inline std::vector<double> seen_along(const std::vector<double>& matrix, const std::vector<double>& rows,
                                                    std::size_t n) {
  const std::size_t m = rows.size() / n;
  std::vector<double> half(m * n, 0.0), result(m * m, 0.0);
  for (std::size_t i = 0; i < m; ++i) {
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t j = 0; j < n; ++j) half[i * n + j] += rows[i * n + k] * matrix[k * n + j];
    }
  }
  for (std::size_t i = 0; i < m; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = 0;
      for (std::size_t k = 0; k < n; ++k) sum += half[i * n + k] * rows[j * n + k];
      result[i * m + j] = result[j * m + i] = sum;
    }
  }
  return result;
}

template <Executor E>
[[nodiscard]] std::optional<NuisanceComplement> nuisance_complement(const FourierStatistics& found,
                                                                    const DecoderFitSettings& settings, E& executor) {
  const std::size_t features = found.mean.size(), readings = found.deviation.size() / features;
  const std::size_t nuisance = static_cast<std::size_t>(settings.coordinates);
  NuisanceComplement complement;
  complement.count = features - nuisance;
  if (nuisance == 0) {
    complement.direction.assign(features * features, 0.0);
    for (std::size_t k = 0; k < features; ++k) complement.direction[k * (features + 1)] = 1;
    complement.noise = found.noise;
    return complement;
  }
  std::vector<double> covariance = found.noise, variance, direction;
  symmetric_eigen(covariance, features, variance, direction);
  complement.direction.assign(direction.begin() + static_cast<std::ptrdiff_t>(nuisance * features), direction.end());
  // A compromise between coordinates of equal noise and those of equal length: directions of large change determine the
  // view better, but not alone.
  double length = 0;
  for (std::size_t d = 0; d < nuisance; ++d) length += std::sqrt(std::max(variance[d], 1e-12 * variance[0]));
  complement.coordinate.assign(direction.begin(), direction.begin() + static_cast<std::ptrdiff_t>(nuisance * features));
  for (std::size_t d = 0; d < nuisance; ++d) {
    const double scale =
        1 / (std::sqrt(std::sqrt(std::max(variance[d], 1e-12 * variance[0])) * length) * settings.width);
    double offset = 0;
    for (std::size_t k = 0; k < features; ++k) {
      complement.coordinate[d * features + k] *= scale;
      offset += complement.coordinate[d * features + k] * found.mean[k];
    }
    complement.coordinate_offset.push_back(offset);
  }
  const auto along = [&](const std::vector<double>& rows) {  // [readings, rows]
    const std::size_t count = rows.size() / features;
    std::vector<double> values(readings * count, 0.0);
    executor.for_chunks(count, 1, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::vector<double> line(readings);
      for (std::size_t d = begin; d < end; ++d) {
        std::fill(line.begin(), line.end(), 0.0);
        for (std::size_t k = 0; k < features; ++k) {
          for (std::size_t n = 0; n < readings; ++n)
            line[n] += rows[d * features + k] * found.deviation[k * readings + n];
        }
        for (std::size_t n = 0; n < readings; ++n) values[n * count + d] = line[n];
      }
    });
    return values;
  };
  complement.centre = along(complement.coordinate);
  std::optional<KernelRidge> fit = kernel_ridge(complement.centre, along(complement.direction), readings,
                                                settings.prediction_ridge, executor, found.per_view);
  if (!fit) return std::nullopt;
  complement.coefficient = std::move(fit->coefficient);
  std::vector<double> missed(complement.count * readings);
  for (std::size_t k = 0; k < complement.count; ++k) {
    for (std::size_t n = 0; n < readings; ++n) missed[k * readings + n] = fit->left_out_error[n * complement.count + k];
  }
  complement.noise =
      weighted_products(std::move(missed), complement.count, found.per_view, settings.edit_weight, executor);
  return complement;
}

}  // namespace detail

}  // namespace compmark
