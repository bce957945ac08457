// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Whitening of features or logits on unmarked images: z = L^-1 (y - mean) with the covariance C = E (y - mean)(y -
// mean)^T = L L^T, divided by the number of samples, so that every z has variance one and no two are correlated. (The
// published files divide by nothing and scale by sqrt(k), so that their spread depends on how many images were used:
// docs/spec/watermark.md, 1.3.) Cholesky: z_i is y_i less what z_1 ... z_(i-1) say about it, so that logits keep their
// bit. Cost: n k^2 + k^3 / 3, in double.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/random.hpp"

namespace compmark {

/// z = weight (y - mean), weight lower triangular [size, size].
struct TriangularWhitening {
  std::size_t size = 0;
  std::vector<double> mean;
  std::vector<double> weight;
  std::vector<double> deviation;  ///< of y, for reports
};

/// From samples [count, size]. `ridge` is added to the variances as a share of their mean: without it, fewer samples
/// than features divide by zero, and with few more the smallest directions are noise.
[[nodiscard]] inline TriangularWhitening triangular_whitening(std::span<const double> samples, std::size_t size,
                                                              double ridge) {
  COMPMARK_ASSERT(size > 0 && samples.size() >= size && samples.size() % size == 0, "triangular_whitening: samples");
  const std::size_t count = samples.size() / size;
  TriangularWhitening result;
  result.size = size;
  result.mean.assign(size, 0);
  for (std::size_t n = 0; n < count; ++n) {
    for (std::size_t i = 0; i < size; ++i) result.mean[i] += samples[n * size + i] / static_cast<double>(count);
  }
  std::vector<double> factor(size * size, 0);  // the covariance, then L
  for (std::size_t n = 0; n < count; ++n) {
    const double* y = samples.data() + n * size;
    for (std::size_t i = 0; i < size; ++i) {
      const double yi = (y[i] - result.mean[i]) / static_cast<double>(count);
      for (std::size_t j = 0; j <= i; ++j) factor[i * size + j] += yi * (y[j] - result.mean[j]);
    }
  }
  double trace = 0;
  for (std::size_t i = 0; i < size; ++i) {
    trace += factor[i * size + i];
    result.deviation.push_back(std::sqrt(factor[i * size + i]));
  }
  const double add = ridge * trace / static_cast<double>(size);
  for (std::size_t i = 0; i < size; ++i) {
    factor[i * size + i] += add;
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = factor[i * size + j];
      for (std::size_t k = 0; k < j; ++k) sum -= factor[i * size + k] * factor[j * size + k];
      factor[i * size + j] = i == j ? std::sqrt(std::fmax(sum, 1e-12 * trace)) : sum / factor[j * size + j];
    }
  }
  result.weight.assign(size * size, 0);  // L^-1 by forward substitution, a column at a time
  for (std::size_t j = 0; j < size; ++j) {
    result.weight[j * size + j] = 1 / factor[j * size + j];
    for (std::size_t i = j + 1; i < size; ++i) {
      double sum = 0;
      for (std::size_t k = j; k < i; ++k) sum -= factor[i * size + k] * result.weight[k * size + j];
      result.weight[i * size + j] = sum / factor[i * size + i];
    }
  }
  return result;
}

/// The first `rows` rows of a random orthogonal matrix of `size` (Gram and Schmidt on normal vectors, twice).
[[nodiscard]] inline std::vector<double> orthonormal_rows(std::size_t rows, std::size_t size, const Random& random) {
  COMPMARK_ASSERT(rows <= size, "orthonormal_rows: more rows than dimensions");
  std::vector<double> result(rows * size);
  for (std::size_t r = 0; r < rows; ++r) {
    double* const row = result.data() + r * size;
    for (std::size_t i = 0; i < size; ++i) row[i] = random.normal(r * size + i);
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t q = 0; q < r; ++q) {
        const double* const other = result.data() + q * size;
        double dot = 0;
        for (std::size_t i = 0; i < size; ++i) dot += row[i] * other[i];
        for (std::size_t i = 0; i < size; ++i) row[i] -= dot * other[i];
      }
    }
    double square = 0;
    for (std::size_t i = 0; i < size; ++i) square += row[i] * row[i];
    for (std::size_t i = 0; i < size; ++i) row[i] /= std::sqrt(square);
  }
  return result;
}

/// logits = head y + bias becomes head (whitened y): head = directions W, bias = -head mean. directions [rows, size].
template <class T>
void whitened_head(std::span<const double> directions, const TriangularWhitening& whitening, std::span<T> head,
                   std::span<T> bias) {
  const std::size_t size = whitening.size;
  for (std::size_t r = 0; r < bias.size(); ++r) {
    double offset = 0;
    for (std::size_t j = 0; j < size; ++j) {
      double sum = 0;
      for (std::size_t i = j; i < size; ++i) sum += directions[r * size + i] * whitening.weight[i * size + j];
      head[r * size + j] = static_cast<T>(sum);
      offset -= sum * whitening.mean[j];
    }
    bias[r] = static_cast<T>(offset);
  }
}

/// Whitens the logits of a linear head [rows, columns] in place: head = W head, bias = W (bias - mean), with a
/// whitening of its logits.
template <class T>
void whiten_head(const TriangularWhitening& whitening, std::span<T> head, std::span<T> bias) {
  const std::size_t rows = bias.size(), columns = head.size() / rows;
  for (std::size_t r = rows; r-- > 0;) {  // lower triangular: from below, in place
    const double* const w = whitening.weight.data() + r * rows;
    for (std::size_t k = 0; k < columns; ++k) {
      double sum = 0;
      for (std::size_t i = 0; i <= r; ++i) sum += w[i] * static_cast<double>(head[i * columns + k]);
      head[r * columns + k] = static_cast<T>(sum);
    }
    double offset = 0;
    for (std::size_t i = 0; i <= r; ++i) offset += w[i] * (static_cast<double>(bias[i]) - whitening.mean[i]);
    bias[r] = static_cast<T>(offset);
  }
}

}  // namespace compmark
