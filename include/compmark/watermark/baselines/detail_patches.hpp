// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The patches of a picture with the most detail, as 3D-GSW (Jang et al., CVPR 2025) finds where to split: patches of
// 16 x 16 pixels, whole ones alone, by
//   mean over channels and frequencies of |DFT(patch)| u^2 v^2,
// u and v from -1 to 1 over the frequencies -8 .. 7 of an axis. Cost: 25,000 multiplications a patch and channel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <vector>

#include "compmark/core/views.hpp"

namespace compmark {

/// The patches of a picture, row by row: whether each has much detail.
class DetailPatches {
 public:
  static constexpr int side = 16;

  /// The `share` with the highest scores, above 0 and at most 1: rounded to the nearest, and at least one patch; of
  /// equals the first.
  template <class T>
  DetailPatches(ImageView<const T> image, double share) : across_(image.width / side),
                                                          down_(image.height / side) {
    std::vector<double> scores;
    for (int y = 0; y < down_; ++y) {
      for (int x = 0; x < across_; ++x) scores.push_back(score(image, x * side, y * side));
    }
    std::vector<std::size_t> order(scores.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return scores[a] > scores[b]; });
    const auto wanted = static_cast<std::size_t>(std::llround(share * static_cast<double>(order.size())));
    order.resize(std::min(order.size(), std::max<std::size_t>(1, wanted)));
    marked_.assign(scores.size(), 0);
    for (const std::size_t patch : order) marked_[patch] = 1;
  }

  /// Whether the point `at` {u, v}, pixels, lies in one of them.
  [[nodiscard]] bool holds(const std::array<double, 2>& at) const {
    if (!(at[0] >= 0 && at[0] < across_ * side && at[1] >= 0 && at[1] < down_ * side)) return false;
    const auto x = static_cast<std::size_t>(at[0]) / side, y = static_cast<std::size_t>(at[1]) / side;
    return marked_[y * static_cast<std::size_t>(across_) + x] != 0;
  }
  [[nodiscard]] std::size_t count() const {
    return static_cast<std::size_t>(std::count(marked_.begin(), marked_.end(), 1));
  }

  /// The score of the patch whose first pixel is (x, y).
  template <class T>
  [[nodiscard]] static double score(ImageView<const T> image, int x, int y) {
    constexpr std::size_t n = side;
    struct Complex {
      double re = 0, im = 0;
    };
    static const std::array<Complex, n> root = [] {
      std::array<Complex, n> roots;
      for (std::size_t k = 0; k < n; ++k) {
        const double angle = -2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(n);
        roots[k] = {std::cos(angle), std::sin(angle)};
      }
      return roots;
    }();
    // Of frequency f: -8 .. 7 in the order of a shifted transform become -1 .. 1.
    const auto weight = [](std::size_t f) {
      const double u = -1 + 2 * static_cast<double>((f + n / 2) % n) / static_cast<double>(n - 1);
      return u * u;
    };
    double sum = 0;
    for (int channel = 0; channel < image.channels; ++channel) {
      std::array<std::array<Complex, n>, n> rows{};
      for (std::size_t j = 0; j < n; ++j) {
        const T* const line = image.row(channel, y + static_cast<int>(j)) + x;
        for (std::size_t f = 0; f < n; ++f) {
          Complex& to = rows[j][f];
          for (std::size_t i = 0; i < n; ++i) {
            to.re += static_cast<double>(line[i]) * root[i * f % n].re;
            to.im += static_cast<double>(line[i]) * root[i * f % n].im;
          }
        }
      }
      for (std::size_t f = 0; f < n; ++f) {
        for (std::size_t g = 0; g < n; ++g) {
          Complex value;
          for (std::size_t j = 0; j < n; ++j) {
            const Complex& from = rows[j][f];
            const Complex& turn = root[j * g % n];
            value.re += from.re * turn.re - from.im * turn.im;
            value.im += from.re * turn.im + from.im * turn.re;
          }
          sum += std::hypot(value.re, value.im) * weight(f) * weight(g);
        }
      }
    }
    return sum / static_cast<double>(static_cast<std::size_t>(image.channels) * n * n);
  }

 private:
  int across_ = 0, down_ = 0;
  std::vector<std::uint8_t> marked_;
};

}  // namespace compmark
