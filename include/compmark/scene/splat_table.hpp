// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Explicit Gaussians as the 3DGS file format stores them: log scales, opacity as a logit, quaternion w x y z (any
// norm), colour as spherical harmonics. A table of named columns; nothing here trains. to_gaussians evaluates it for
// one camera: what a viewer does.
//   colour = max(0, 1/2 + sum_i f_i Y_i(d)),  d = (mean - camera centre) normalised
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/math/spherical_harmonics.hpp"

namespace compmark {

/// Structure of arrays, every column `count` floats. Cost: 4 (11 + 3 (degree + 1)^2) bytes a Gaussian.
struct SplatTable {
  int degree = 0;  ///< of the spherical harmonics, 0 … 3
  std::size_t count = 0;
  std::array<std::vector<float>, 3> mean;  ///< world units
  std::array<std::vector<float>, 3>
      log_scale;  ///< natural logarithm of the standard deviation; -infinity is legal (flat)
  std::array<std::vector<float>, 4> rotation;  ///< w x y z
  std::vector<float> opacity;                  ///< logit; +infinity is legal (opaque)
  std::vector<std::vector<float>> sh;          ///< [3 (degree + 1)^2] columns: channel * (degree + 1)^2 + coefficient

  [[nodiscard]] std::size_t coefficients() const { return sh_count(degree); }
  [[nodiscard]] std::vector<float>& color(std::size_t channel, std::size_t i) {
    return sh[channel * coefficients() + i];
  }
  [[nodiscard]] const std::vector<float>& color(std::size_t channel, std::size_t i) const {
    return sh[channel * coefficients() + i];
  }

  /// Sets shape; new values are zero, kept ones stay.
  void resize(std::size_t rows, int sh_degree) {
    degree = sh_degree;
    count = rows;
    sh.resize(3 * sh_count(sh_degree));
    for_each_column([rows](std::vector<float>& column) { column.resize(rows); });
  }
  /// Drops the harmonics above a degree.
  void limit_degree(int most) {
    if (most >= degree) return;
    std::vector<std::vector<float>> kept;
    for (std::size_t channel = 0; channel < 3; ++channel)
      for (std::size_t i = 0; i < sh_count(most); ++i) kept.push_back(std::move(color(channel, i)));
    sh = std::move(kept);
    degree = most;
  }
  /// Calls f(std::vector<float>&) for every column.
  template <class F>
  void for_each_column(const F& f) {
    for (std::vector<float>& column : mean) f(column);
    for (std::vector<float>& column : log_scale) f(column);
    for (std::vector<float>& column : rotation) f(column);
    f(opacity);
    for (std::vector<float>& column : sh) f(column);
  }
};

/// The table seen from a camera centre, row i of the table is row i of the batch. A rotation of norm zero becomes the
/// identity.
template <class T, Executor E>
void to_gaussians(const SplatTable& table, const std::array<double, 3>& camera_center, GaussianBatch<T>& batch,
                  E& executor) {
  batch.resize(table.count);
  const GaussianColumns<T> out = batch.columns();
  executor.for_chunks(table.count, 1024, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) {
      std::array<T, 3> direction{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        out.mean[axis][i] = static_cast<T>(table.mean[axis][i]);
        out.scale[axis][i] = std::exp(static_cast<T>(table.log_scale[axis][i]));
        direction[axis] = static_cast<T>(static_cast<double>(table.mean[axis][i]) - camera_center[axis]);
      }
      T norm = T(0);
      for (std::size_t k = 0; k < 4; ++k)
        norm += static_cast<T>(table.rotation[k][i]) * static_cast<T>(table.rotation[k][i]);
      norm = std::sqrt(norm);
      for (std::size_t k = 0; k < 4; ++k) {
        out.rotation[k][i] = norm > T(0) ? static_cast<T>(table.rotation[k][i]) / norm : T(k == 0 ? 1 : 0);
      }
      out.opacity[i] = T(1) / (T(1) + std::exp(-static_cast<T>(table.opacity[i])));
      const T length =
          std::sqrt(direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]);
      for (T& component : direction) component = length > T(0) ? component / length : T(0);
      const std::array<T, 16> basis = sh_basis(direction);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        T value = T(0.5);
        for (std::size_t k = 0; k < table.coefficients(); ++k)
          value += basis[k] * static_cast<T>(table.color(channel, k)[i]);
        out.color[channel][i] = value > T(0) ? value : T(0);
      }
    }
  });
}

/// Where to_gaussians_backward adds: one pointer a column of the table, in the order of SplatTable's members. Means are
/// not among them: they are exact already, and their path through the view direction (docs/spec/numerics.md, SH1) is
/// then not needed.
template <class T>
struct SplatTableGradient {
  std::array<T*, 3> log_scale{};
  std::array<T*, 4> rotation{};
  T* opacity = nullptr;
  std::vector<T*> sh;
};

/// Gradient of to_gaussians: ADDS into `d_table`. `gaussians` is what to_gaussians gave for the same table and camera.
/// A colour held at zero passes no gradient.
template <class T, Executor E>
void to_gaussians_backward(const SplatTable& table, const std::array<double, 3>& camera_center,
                           const GaussianColumns<const T>& gaussians, const GaussianColumns<const T>& d_gaussians,
                           const SplatTableGradient<T>& d_table, E& executor) {
  const std::size_t coefficients = table.coefficients();
  executor.for_chunks(table.count, 1024, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) {
      std::array<T, 3> direction{};
      T length = T(0);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        d_table.log_scale[axis][i] += d_gaussians.scale[axis][i] * gaussians.scale[axis][i];
        direction[axis] = static_cast<T>(static_cast<double>(table.mean[axis][i]) - camera_center[axis]);
        length += direction[axis] * direction[axis];
      }
      length = std::sqrt(length);
      for (T& component : direction) component = length > T(0) ? component / length : T(0);
      T norm = T(0), along = T(0);
      for (std::size_t k = 0; k < 4; ++k) {
        norm += static_cast<T>(table.rotation[k][i]) * static_cast<T>(table.rotation[k][i]);
        along += gaussians.rotation[k][i] * d_gaussians.rotation[k][i];
      }
      norm = std::sqrt(norm);
      for (std::size_t k = 0; k < 4 && norm > T(0); ++k) {
        d_table.rotation[k][i] += (d_gaussians.rotation[k][i] - gaussians.rotation[k][i] * along) / norm;
      }
      const T opacity = gaussians.opacity[i];
      d_table.opacity[i] += d_gaussians.opacity[i] * opacity * (T(1) - opacity);
      const std::array<T, 16> basis = sh_basis(direction);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        if (!(gaussians.color[channel][i] > T(0))) continue;
        for (std::size_t k = 0; k < coefficients; ++k) {
          d_table.sh[channel * coefficients + k][i] += basis[k] * d_gaussians.color[channel][i];
        }
      }
    }
  });
}

/// Explicit Gaussians of one view (colours as they are) as a table of degree 0: exact for that view, whatever the
/// camera. Those without opacity are left out. Opacities are held between 1e-6 and 1 - 1e-6 and scales above 1e-20, so
/// that every stored number is finite.
template <class T>
[[nodiscard]] SplatTable to_splat_table(const GaussianColumns<const T>& gaussians) {
  std::vector<std::size_t> seen;
  for (std::size_t i = 0; i < gaussians.count; ++i) {
    if (gaussians.opacity[i] > T(0)) seen.push_back(i);
  }
  SplatTable table;
  table.resize(seen.size(), 0);
  for (std::size_t row = 0; row < seen.size(); ++row) {
    const std::size_t i = seen[row];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      table.mean[axis][row] = static_cast<float>(gaussians.mean[axis][i]);
      table.log_scale[axis][row] =
          static_cast<float>(std::log(std::fmax(static_cast<double>(gaussians.scale[axis][i]), 1e-20)));
      table.color(axis, 0)[row] =
          static_cast<float>((static_cast<double>(gaussians.color[axis][i]) - 0.5) / sh_constant);
    }
    for (std::size_t k = 0; k < 4; ++k) table.rotation[k][row] = static_cast<float>(gaussians.rotation[k][i]);
    const double opacity = std::fmin(std::fmax(static_cast<double>(gaussians.opacity[i]), 1e-6), 1 - 1e-6);
    table.opacity[row] = static_cast<float>(std::log(opacity / (1 - opacity)));
  }
  return table;
}

}  // namespace compmark
