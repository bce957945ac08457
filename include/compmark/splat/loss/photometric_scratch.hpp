// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The rows a band of the photometric loss works on: Step rows of each forward blur, Step rows of each backward blur,
// and a ring of the maps in between. Every row has a margin of 16 scalars on either side that holds what lies outside
// the image, so that no kernel tests a border.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "compmark/splat/loss/ssim.hpp"

namespace compmark::detail {

template <class T, int Step>
struct PhotometricScratch {
  static constexpr std::size_t margin = 16;
  /// A gradient step needs Step + 10 rows of maps, which arrive Step at a time.
  static constexpr int ring_rows = 2 * Step + 2 * ssim_radius;
  static constexpr int rows = 1 + (ssim_blurs + ssim_maps) * Step + ssim_maps * ring_rows;

  T* base = nullptr;       ///< of this worker
  std::size_t stride = 0;  ///< scalars a row, margins included

  [[nodiscard]] T* zeros() const { return at(0); }
  /// Row `row` of the vertical blur of forward map `map`.
  [[nodiscard]] T* blurred(int map, int row) const { return at(1 + map * Step + row); }
  /// Row `row` of the vertical blur of backward map `map`.
  [[nodiscard]] T* blurred_back(int map, int row) const { return at(1 + (ssim_blurs + map) * Step + row); }
  /// Map `map` at image row y >= 0.
  [[nodiscard]] T* ring(int map, int y) const {
    return at(1 + (ssim_blurs + ssim_maps) * Step + map * ring_rows + y % ring_rows);
  }

  /// Outside the image x = y = 0: blurs of it are constants, the maps of the backward pass are zero.
  void clear_margins() const {
    std::fill_n(base, stride, T(0));
    const std::array<T, ssim_blurs> outside{T(-0.5), T(0), T(0.25), T(0)};
    const auto set_margins = [&](T* row, T value) {
      std::fill_n(row - margin, margin, value);
      std::fill_n(row + stride - 2 * margin, margin, value);
    };
    for (int row = 0; row < Step; ++row) {
      for (int map = 0; map < ssim_blurs; ++map) set_margins(blurred(map, row), outside[static_cast<std::size_t>(map)]);
      for (int map = 0; map < ssim_maps; ++map) set_margins(blurred_back(map, row), T(0));
    }
    for (int map = 0; map < ssim_maps; ++map) {
      for (int row = 0; row < ring_rows; ++row) set_margins(ring(map, row), T(0));
    }
  }

 private:
  [[nodiscard]] T* at(int row) const { return base + margin + static_cast<std::size_t>(row) * stride; }
};

}  // namespace compmark::detail
