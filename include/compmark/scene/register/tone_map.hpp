// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What happened to the colours of a picture since it was rendered, as one linear model: each channel of the picture is
// a sum of 1, the three channels of the render, and the square and cube of its own. So a 3 x 3 matrix (saturation, hue,
// grey), gain, offset and a monotone curve such as a gamma, all found in closed form by weighted least squares. A ridge
// draws what the picture does not determine towards the identity. Cost of a fit: 85 multiply-adds a pixel.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/symmetric.hpp"

namespace compmark {

/// Channel c of the picture is term[c] . (1, r, g, b, x^2, x^3), x the render's channel c.
struct ToneMap {
  std::array<std::array<double, 6>, 3> term{{{0, 1, 0, 0, 0, 0}, {0, 0, 1, 0, 0, 0}, {0, 0, 0, 1, 0, 0}}};

  [[nodiscard]] double operator()(std::size_t c, const std::array<double, 3>& color) const {
    const std::array<double, 6>& t = term[c];
    const double x = color[c];
    return t[0] + t[1] * color[0] + t[2] * color[1] + t[3] * color[2] + x * x * (t[4] + t[5] * x);
  }
};

namespace detail {

inline constexpr std::size_t tone_basis = 10;  // 1, r, g, b, their squares, their cubes
inline constexpr std::size_t tone_sums = tone_basis * (tone_basis + 1) / 2 + 3 * tone_basis;

/// Rows of an image that are summed together, then added in order: same bits at any thread count.
inline constexpr std::size_t register_rows = 8;

/// Sums over rows [begin, end): the Gram matrix of the basis, packed, then its products with the picture's channels.
inline void tone_rows(ImageView<const float> render, ImageView<const float> picture, const float* weight, int begin,
                      int end, std::array<double, tone_sums>& sums) {
  using P = Pack<float, native_width<float>>;
  for (int y = begin; y < end; ++y) {
    std::array<P, tone_sums> sum;
    sum.fill(P(0.0f));
    const std::size_t start = static_cast<std::size_t>(y) * static_cast<std::size_t>(render.width);
    for (int x = 0; x < render.width; x += P::width) {
      const auto inside = P::MaskType::first(render.width - x);
      const P w = P::load(weight + start + static_cast<std::size_t>(x), inside);
      std::array<P, tone_basis> basis;
      basis[0] = P(1.0f);
      for (int c = 0; c < 3; ++c) {
        const auto k = static_cast<std::size_t>(c);
        const P value = P::load(render.row(c, y) + x, inside);
        basis[1 + k] = value;
        basis[4 + k] = value * value;
        basis[7 + k] = value * value * value;
      }
      std::size_t at = 0;
      for (std::size_t i = 0; i < tone_basis; ++i) {
        const P weighted = w * basis[i];
        for (std::size_t j = 0; j <= i; ++j, ++at) sum[at] = fma(weighted, basis[j], sum[at]);
      }
      for (int c = 0; c < 3; ++c) {
        const P weighted = w * P::load(picture.row(c, y) + x, inside);
        for (std::size_t i = 0; i < tone_basis; ++i, ++at) sum[at] = fma(weighted, basis[i], sum[at]);
      }
    }
    for (std::size_t k = 0; k < tone_sums; ++k) {
      for (int lane = 0; lane < P::width; ++lane) sums[k] += static_cast<double>(sum[k].lane(lane));
    }
  }
}

}  // namespace detail

/// The tone map that takes `render` to `picture`, both [3, height, width], by least squares with a weight a pixel
/// [height, width]. `ridge` is the weight of the identity, as a share of all weights. Same bits at any thread count.
template <Executor E>
[[nodiscard]] ToneMap fit_tone(ImageView<const float> render, ImageView<const float> picture, const float* weight,
                               double ridge, E& executor) {
  COMPMARK_ASSERT(render.width == picture.width && render.height == picture.height, "fit_tone: shapes");
  const auto rows = static_cast<std::size_t>(render.height);
  std::vector<std::array<double, detail::tone_sums>> part(chunk_count(rows, detail::register_rows));
  executor.for_chunks(rows, detail::register_rows, [&](std::size_t begin, std::size_t end, std::size_t) {
    part[begin / detail::register_rows] = {};
    detail::tone_rows(render, picture, weight, static_cast<int>(begin), static_cast<int>(end),
                      part[begin / detail::register_rows]);
  });
  std::array<double, detail::tone_sums> sums{};
  for (const auto& one : part) {
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += one[k];
  }
  ToneMap tone;
  constexpr std::size_t products = packed_index(detail::tone_basis, 0);
  for (std::size_t c = 0; c < 3; ++c) {
    const std::array<std::size_t, 6> used{0, 1, 2, 3, 4 + c, 7 + c};
    std::array<double, 21> gram{};
    std::array<double, 6> right{};
    const double pull = ridge * sums[0] + 1e-9;
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = 0; j <= i; ++j) gram[packed_index(i, j)] = sums[packed_index(used[i], used[j])];
      gram[packed_index(i, i)] += pull;
      right[i] = sums[products + c * detail::tone_basis + used[i]] + pull * tone.term[c][i];
    }
    if (solve_positive(gram, 6, right, 1)) tone.term[c] = right;
  }
  return tone;
}

/// `image` [3, height, width] in the colours of the picture, kept in [0, 1], in place.
inline void apply_tone(const ToneMap& tone, ImageView<float> image) {
  const std::size_t plane = image.plane_size();
  for (std::size_t i = 0; i < plane; ++i) {
    std::array<double, 3> color{};
    for (std::size_t c = 0; c < 3; ++c) color[c] = static_cast<double>(image.data[c * plane + i]);
    for (std::size_t c = 0; c < 3; ++c)
      image.data[c * plane + i] = static_cast<float>(std::clamp(tone(c, color), 0.0, 1.0));
  }
}

}  // namespace compmark
