// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Figures of one row of accuracy_vs_time: differences of images and gradients from the references, medians of times.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "median.hpp"

namespace accuracy_bench {

inline double psnr_of(double squares, std::size_t count) {
  return squares > 0 ? -10 * std::log10(squares / static_cast<double>(count)) : 999;
}

struct Difference {
  double squares = 0, largest = 0;
  std::size_t count = 0;
  void add(const std::vector<double>& a, const std::vector<double>& b) {
    for (std::size_t i = 0; i < a.size(); ++i) {
      const double d = std::abs(a[i] - b[i]);
      squares += d * d;
      largest = std::max(largest, d);
    }
    count += a.size();
  }
  [[nodiscard]] double psnr() const { return psnr_of(squares, count); }
};

/// Sums that give relative L2 distance, cosine and signed bias of a gradient g against the reference r.
struct GradientDifference {
  double gg = 0, rr = 0, gr = 0, dd = 0;
  void add(const std::vector<double>& g, const std::vector<double>& r) {
    for (std::size_t i = 0; i < g.size(); ++i)
      gg += g[i] * g[i], rr += r[i] * r[i], gr += g[i] * r[i], dd += (g[i] - r[i]) * (g[i] - r[i]);
  }
  [[nodiscard]] double relative() const { return std::sqrt(dd / rr); }
  [[nodiscard]] double cosine() const { return gr / std::sqrt(gg * rr); }
  [[nodiscard]] double bias() const { return gr / rr - 1; }  // > 0: too long along the true direction
};

struct Row {
  std::vector<double> forward_ms, backward_ms;  // a repetition each, mean over views
  Difference to_exact, to_spec;
  std::array<GradientDifference, 5> gradient;
  std::ptrdiff_t bytes = 0;
  double pairs = 0;
  [[nodiscard]] double forward() const { return compmark::benchmarks::median(forward_ms); }
  [[nodiscard]] double backward() const { return compmark::benchmarks::median(backward_ms); }
  [[nodiscard]] double total() const { return forward() + backward(); }
  template <class F>
  [[nodiscard]] double mean_of_groups(const F& f) const {
    double sum = 0;
    for (const GradientDifference& group : gradient) sum += f(group);
    return sum / static_cast<double>(gradient.size());
  }
  [[nodiscard]] double relative() const {
    return mean_of_groups([](const GradientDifference& g) { return g.relative(); });
  }
  [[nodiscard]] double cosine() const {
    return mean_of_groups([](const GradientDifference& g) { return g.cosine(); });
  }
  [[nodiscard]] double bias() const {
    return mean_of_groups([](const GradientDifference& g) { return g.bias(); });
  }
};

}  // namespace accuracy_bench
