// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A spread-spectrum mark (Cox, Kilian, Leighton, Shamoon, IEEE Trans. Image Processing 6, 1997) in the features of the
// anchors, for readers who have the unmarked model. Space is cut into cubes; the anchors of a cube become a little
// brighter or a little darker together, as a sign says that follows from the key and the place of the cube. A feature
// is moved along the gradient of the brightness of its anchor, so that nothing of a message is needed and nothing is
// learned. Thousands of signs are in one picture: who knows camera and unmarked model reads them out of a picture whose
// every single one is lost in noise (proof/spread_evidence.hpp). Against the source: the host is known and subtracted,
// signs are binary, and the signal lives in a model, not in coefficients of a picture.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string_view>
#include <vector>

#include "compmark/core/views.hpp"
#include "compmark/io/hmac_sha256.hpp"
#include "compmark/watermark/proof/key.hpp"

namespace compmark {

inline constexpr std::string_view spread_label = "compmark/spread/v1";

/// What marking and reading must agree on.
struct SpreadForm {
  double cell_pixels = 8;        ///< side of a cube, in pixels of a training view, in the median
  std::size_t views = 30;        ///< training views that the gradients of brightness are summed over
  std::size_t least_cells = 64;  ///< with fewer, no evidence is strong
};

/// The cubes that hold anchors, in the order of their first anchor.
struct SpreadCells {
  std::vector<std::array<std::int64_t, 3>> place;  ///< floor(position / side)
  std::vector<std::uint32_t> of_anchor;            ///< [anchors] index into place
};

/// Cubes of `side` for positions [anchors, 3].
[[nodiscard]] inline SpreadCells spread_cells(MatrixView<const float> position, double side) {
  SpreadCells cells;
  std::map<std::array<std::int64_t, 3>, std::uint32_t> known;
  for (std::size_t a = 0; a < position.rows; ++a) {
    std::array<std::int64_t, 3> place{};
    for (std::size_t k = 0; k < 3; ++k) {
      // Beyond 2^40 cells everything is one: no file of a model says where that is.
      const double at = std::floor(static_cast<double>(position(a, k)) / side);
      place[k] = static_cast<std::int64_t>(std::clamp(at, -0x1p40, 0x1p40));
    }
    const auto [cell, is_new] = known.emplace(place, static_cast<std::uint32_t>(cells.place.size()));
    if (is_new) cells.place.push_back(place);
    cells.of_anchor.push_back(cell->second);
  }
  return cells;
}

/// The side of a cube that covers `pixels` pixels, in the median over anchors and cameras (a sample of both).
/// `camera(i)` gives camera i of `count`. 0 if there is no anchor.
template <class Cameras>
[[nodiscard]] double spread_side(MatrixView<const float> position, const Cameras& camera, std::size_t count,
                                 double pixels) {
  std::vector<double> footprint;
  const std::size_t anchor_step = 1 + position.rows / 2000, camera_step = 1 + count / 20;
  for (std::size_t i = 0; i < count; i += camera_step) {
    const auto& at = camera(i);
    for (std::size_t a = 0; a < position.rows; a += anchor_step) {
      double square = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const double d = static_cast<double>(position(a, k)) - static_cast<double>(at.center_world[k]);
        square += d * d;
      }
      footprint.push_back(std::sqrt(square) / static_cast<double>(at.fx));
    }
  }
  if (footprint.empty()) return 0;
  const auto middle = footprint.begin() + static_cast<std::ptrdiff_t>(footprint.size() / 2);
  std::nth_element(footprint.begin(), middle, footprint.end());
  return pixels * *middle;
}

/// +1 or -1 of each cell: a bit of HMAC-SHA-256 of its place under a secret of its own.
template <SecretKey K>
[[nodiscard]] std::vector<std::int8_t> spread_signs(const K& key, const SpreadCells& cells) {
  Digest256 secret{};
  key.derive(spread_label, secret);
  std::vector<std::int8_t> signs;
  signs.reserve(cells.place.size());
  for (const std::array<std::int64_t, 3>& place : cells.place) {
    std::array<std::byte, 24> bytes{};
    for (std::size_t i = 0; i < bytes.size(); ++i)
      bytes[i] = static_cast<std::byte>(static_cast<std::uint64_t>(place[i / 8]) >> (8 * (i % 8)) & 0xFFu);
    signs.push_back(std::to_integer<unsigned>(hmac_sha256(secret, {bytes})[0]) & 1u ? 1 : -1);
  }
  return signs;
}

/// Rows of length 1; a row of zeros, of an anchor that no view saw, stays.
inline void normalise_rows(MatrixView<float> rows) {
  for (std::size_t a = 0; a < rows.rows; ++a) {
    double square = 0;
    for (std::size_t f = 0; f < rows.columns; ++f)
      square += static_cast<double>(rows(a, f)) * static_cast<double>(rows(a, f));
    if (!(square > 0)) continue;
    const double scale = 1 / std::sqrt(square);
    for (std::size_t f = 0; f < rows.columns; ++f)
      rows(a, f) = static_cast<float>(scale * static_cast<double>(rows(a, f)));
  }
}

/// feature += strength * sign of the anchor's cell * direction, all [anchors, features].
inline void add_spread(MatrixView<float> feature, MatrixView<const float> direction, const SpreadCells& cells,
                       std::span<const std::int8_t> signs, double strength) {
  for (std::size_t a = 0; a < feature.rows; ++a) {
    const float step = static_cast<float>(strength) * static_cast<float>(signs[cells.of_anchor[a]]);
    for (std::size_t f = 0; f < feature.columns; ++f) feature(a, f) += step * direction(a, f);
  }
}

/// How far each cell's brightness agrees with a picture: ADDS direction . gradient of its anchors to sums [cells].
/// `gradient` [anchors, features] is that of the product of a render and a picture's residual (spread_residual.hpp).
inline void add_spread_sums(MatrixView<const float> gradient, MatrixView<const float> direction,
                            const SpreadCells& cells, std::span<double> sums) {
  for (std::size_t a = 0; a < gradient.rows; ++a) {
    double sum = 0;
    for (std::size_t f = 0; f < gradient.columns; ++f)
      sum += static_cast<double>(gradient(a, f)) * static_cast<double>(direction(a, f));
    sums[cells.of_anchor[a]] += sum;
  }
}

}  // namespace compmark
