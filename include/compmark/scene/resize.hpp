// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Downscaling of 8-bit planes with antialiasing: separable, support widened by the scale, rows first and rounded to 8
// bits between the passes. The bicubic (Keys, a = -1/2) repeats the published data preparation, which uses Pillow:
// coefficients are rounded to 22 bits and summed in integers, so every machine gets the same pixels. Cost: O(pixels x
// support), ~10 ns a pixel and pass.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"

namespace compmark {

enum class ResizeFilter { bicubic, area };

struct ImageSize {
  int width = 0;
  int height = 0;
  friend bool operator==(const ImageSize&, const ImageSize&) = default;
};

/// Size after the published rules (docs/spec/method.md, 3.4): a given factor divides with rounding (halves to even);
/// without one, images wider than max_width are brought to it, both sides truncated. Never below 1 x 1, and no side
/// above 65536, which is what image files have.
[[nodiscard]] inline ImageSize scaled_size(int width, int height, double downscale, int max_width) {
  ImageSize size{width, height};
  if (downscale != 1) {
    const auto side = [&](int of) { return static_cast<int>(std::fmin(std::nearbyint(of / downscale), 65536.0)); };
    size = {side(width), side(height)};
  } else if (max_width > 0 && width > max_width) {
    const double scale = static_cast<double>(width) / max_width;
    size = {static_cast<int>(width / scale), static_cast<int>(height / scale)};
  }
  return {std::max(1, size.width), std::max(1, size.height)};
}

namespace detail {

/// Contribution of input samples [first, first + count) to one output sample; integer weights that nominally sum to
/// 2^22.
struct ResizeTap {
  int first = 0;
  int count = 0;
  std::size_t weights = 0;  // offset into the weight table
};

struct ResizeTable {
  static constexpr int precision = 22;  // 8 bits of sample and 2 of overshoot leave 22 of 32
  std::vector<ResizeTap> taps;
  std::vector<std::int32_t> weights;

  ResizeTable(int input, int output, ResizeFilter filter) {
    const double scale = static_cast<double>(input) / output;
    const double filter_scale = std::max(scale, 1.0);
    const double support = (filter == ResizeFilter::bicubic ? 2.0 : 0.5) * filter_scale;
    std::vector<double> w;
    for (int i = 0; i < output; ++i) {
      const double center = (i + 0.5) * scale;
      const int first = std::max(0, static_cast<int>(center - support + 0.5));
      const int last = std::min(input, static_cast<int>(center + support + 0.5));
      w.assign(static_cast<std::size_t>(std::max(1, last - first)), 1.0);
      double sum = 0;
      for (std::size_t k = 0; k < w.size(); ++k) {
        w[k] = weight((first + static_cast<double>(k) - center + 0.5) / filter_scale, filter);
        sum += w[k];
      }
      taps.push_back({first, static_cast<int>(w.size()), weights.size()});
      for (const double value : w)
        weights.push_back(static_cast<std::int32_t>(std::lround(value / sum * (1 << precision))));
    }
  }

 private:
  static double weight(double x, ResizeFilter filter) {
    if (filter == ResizeFilter::area) return x > -0.5 && x <= 0.5 ? 1.0 : 0.0;
    constexpr double a = -0.5;
    x = std::abs(x);
    if (x < 1) return ((a + 2) * x - (a + 3)) * x * x + 1;
    if (x < 2) return (((x - 5) * x + 8) * x - 4) * a;
    return 0;
  }
};

[[nodiscard]] inline std::uint8_t round_tap_sum(std::int64_t sum) {
  const std::int64_t value = (sum + (std::int64_t{1} << (ResizeTable::precision - 1))) >> ResizeTable::precision;
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>(value, 0, 255));
}

}  // namespace detail

/// Resizes one plane of 8-bit samples. A pass whose size does not change is the identity.
inline void resize_plane(std::span<const std::uint8_t> input, ImageSize from, std::span<std::uint8_t> output,
                         ImageSize to, ResizeFilter filter = ResizeFilter::bicubic) {
  const auto area = [](int width, int height) {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  };
  COMPMARK_ASSERT(input.size() == area(from.width, from.height) && output.size() == area(to.width, to.height),
                  "resize_plane: shapes");
  std::vector<std::uint8_t> rows(input.begin(), input.end());
  if (to.width != from.width) {
    const detail::ResizeTable table(from.width, to.width, filter);
    rows.resize(area(to.width, from.height));
    for (int y = 0; y < from.height; ++y) {
      const std::uint8_t* source = input.data() + area(y, from.width);
      std::uint8_t* target = rows.data() + area(y, to.width);
      for (int x = 0; x < to.width; ++x) {
        const detail::ResizeTap& tap = table.taps[static_cast<std::size_t>(x)];
        std::int64_t sum = 0;
        for (int k = 0; k < tap.count; ++k) {
          sum += std::int64_t{table.weights[tap.weights + static_cast<std::size_t>(k)]} * source[tap.first + k];
        }
        target[x] = detail::round_tap_sum(sum);
      }
    }
  }
  if (to.height == from.height) {
    std::copy(rows.begin(), rows.end(), output.begin());
    return;
  }
  const detail::ResizeTable table(from.height, to.height, filter);
  std::vector<std::int64_t> sums(static_cast<std::size_t>(to.width));
  for (int y = 0; y < to.height; ++y) {
    const detail::ResizeTap& tap = table.taps[static_cast<std::size_t>(y)];
    std::fill(sums.begin(), sums.end(), 0);
    for (int k = 0; k < tap.count; ++k) {
      const std::int64_t weight = table.weights[tap.weights + static_cast<std::size_t>(k)];
      const std::uint8_t* source = rows.data() + area(tap.first + k, to.width);
      for (std::size_t x = 0; x < sums.size(); ++x) sums[x] += weight * source[x];
    }
    std::transform(sums.begin(), sums.end(), output.data() + area(y, to.width), detail::round_tap_sum);
  }
}

}  // namespace compmark
