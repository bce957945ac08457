// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Whitening: z = W (f - mean) has mean 0 and the identity as covariance over the samples, W = diag(e^-1/2) V^T from the
// eigenvectors of the covariance, largest first. The covariance is divided by n - 1: the published decoders use the sum
// instead and a factor sqrt(bits), which leaves outputs of 0.07 and needs a logit scale of 10 (docs/spec/watermark.md,
// 1.3). Directions whose variance is below 1e-9 of the largest are left out: they would amplify rounding. Eigenvectors
// by cyclic Jacobi rotations, whose small eigenvalues are accurate. Cost: ~50 n^3 flop, once.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/math/eigen_pairs.hpp"

namespace compmark {

/// Mean and covariance of rows of features, in one pass and in double (Welford, with the row as given order).
class FeatureStatistics {
 public:
  void add(std::span<const double> row) {
    if (count_ == 0) {
      mean_.assign(row.size(), 0.0);
      scatter_.assign(row.size() * row.size(), 0.0);
    }
    COMPMARK_ASSERT(row.size() == mean_.size(), "FeatureStatistics: rows of one length");
    ++count_;
    before_.resize(row.size());
    for (std::size_t i = 0; i < row.size(); ++i) {
      before_[i] = row[i] - mean_[i];
      mean_[i] += before_[i] / static_cast<double>(count_);
    }
    for (std::size_t i = 0; i < row.size(); ++i) {
      const double after = row[i] - mean_[i];
      for (std::size_t j = 0; j <= i; ++j) scatter_[i * row.size() + j] += after * before_[j];
    }
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] std::span<const double> mean() const { return mean_; }
  [[nodiscard]] double covariance(std::size_t i, std::size_t j) const {
    return scatter_[std::max(i, j) * mean_.size() + std::min(i, j)] / static_cast<double>(count_ < 2 ? 1 : count_ - 1);
  }

 private:
  std::size_t count_ = 0;
  std::vector<double> mean_, scatter_, before_;
};

struct Whitening {
  int dimension = 0;          ///< directions kept, at most those asked for
  std::vector<float> weight;  ///< [dimension, features]
  std::vector<float> bias;    ///< [dimension], -weight mean
};

/// The `dimension` directions of largest variance.
[[nodiscard]] inline Whitening make_whitening(const FeatureStatistics& statistics, int dimension) {
  const std::size_t n = statistics.mean().size();
  std::vector<double> covariance(n * n), values, vectors;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) covariance[i * n + j] = statistics.covariance(i, j);
  }
  symmetric_eigen(covariance, n, values, vectors);
  Whitening result;
  for (std::size_t d = 0; d < std::min(n, static_cast<std::size_t>(dimension)); ++d) {
    if (!(values[d] > 1e-9 * values[0])) break;
    const double scale = 1 / std::sqrt(values[d]);
    double bias = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double weight = scale * vectors[d * n + i];
      result.weight.push_back(static_cast<float>(weight));
      bias -= weight * statistics.mean()[i];
    }
    result.bias.push_back(static_cast<float>(bias));
    ++result.dimension;
  }
  return result;
}

}  // namespace compmark
