// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The geometry of the pixel loop: blocks of 4 x 4 pixels, whose pixels are the lanes, and cells of 4 x 4 blocks (16 x
// 16 pixels). Why 4 x 4 and not 16 x 1: an ellipse of 30 x 30 pixels touches 22 % fewer blocks, one of 15 x 15 30 %
// fewer.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "compmark/core/config.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/scene/camera.hpp"

namespace compmark::detail {

inline constexpr int cell_side = 16;     ///< pixels
inline constexpr int block_side = 4;     ///< pixels
inline constexpr int cell_blocks = 16;   ///< row-major in the cell
inline constexpr int block_pixels = 16;  ///< row-major in the block

/// Widest pack a block can be cut into.
template <class T>
inline constexpr int block_width = native_width<T> < block_pixels ? native_width<T> : block_pixels;

/// Pixel centres of a cell relative to its corner: at[axis][block][lane], axis 0 is x; and per block its first pixel
/// and its middle.
template <class T>
struct CellTable {
  alignas(64) T at[2][cell_blocks][block_pixels];
  alignas(64) T first[2][cell_blocks];
  alignas(64) T middle[2][cell_blocks];
  alignas(64) T lane[2][block_pixels];  ///< pixel centre relative to the block's middle
};

template <class T>
inline constexpr CellTable<T> cell_table = [] {
  CellTable<T> table{};
  for (int b = 0; b < cell_blocks; ++b) {
    const int origin[2] = {b % 4 * block_side, b / 4 * block_side};
    for (int axis = 0; axis < 2; ++axis) {
      table.first[axis][b] = static_cast<T>(origin[axis]) + pixel_center<T>;
      table.middle[axis][b] = static_cast<T>(origin[axis]) + T(2);
    }
    for (int lane = 0; lane < block_pixels; ++lane) {
      const int inside[2] = {lane % 4, lane / 4};
      for (int axis = 0; axis < 2; ++axis) {
        table.at[axis][b][lane] = static_cast<T>(origin[axis] + inside[axis]) + pixel_center<T>;
        table.lane[axis][lane] = static_cast<T>(inside[axis]) + pixel_center<T> - T(2);
      }
    }
  }
  return table;
}();

/// Where a cell lies in the image.
struct CellPlace {
  int x, y;           // pixels
  int width, height;  // of the image
  /// Bit b is set where block b has a pixel in the image.
  [[nodiscard]] unsigned blocks() const {
    if (x + cell_side <= width && y + cell_side <= height) return 0xFFFFu;
    unsigned mask = 0;
    for (int b = 0; b < cell_blocks; ++b) {
      if (x + b % 4 * block_side < width && y + b / 4 * block_side < height) mask |= 1u << b;
    }
    return mask;
  }
};

/// Calls row(block, lane, offset, count) for each row of four pixels of a cell: block and lane of its first pixel, the
/// offset of that pixel in a plane, and how many of the four are in the image (0 to 4; the offset is valid if there are
/// any).
template <class Row>
COMPMARK_INLINE void each_block_row(const CellPlace& place, const Row& row) {
  const bool whole = place.x + cell_side <= place.width && place.y + cell_side <= place.height;
  const auto stride = static_cast<std::size_t>(place.width);
  for (int y = 0; y < cell_side; ++y) {
    const bool in_rows = whole || place.y + y < place.height;
    const std::size_t start = static_cast<std::size_t>(place.y + y) * stride + static_cast<std::size_t>(place.x);
    for (int x = 0; x < cell_side; x += block_side) {
      const int block = y / block_side * 4 + x / block_side, lane = y % block_side * block_side;
      if (whole) {
        row(block, lane, start + static_cast<std::size_t>(x), block_side);
      } else {
        row(block, lane, start + static_cast<std::size_t>(x),
            in_rows ? std::clamp(place.width - place.x - x, 0, block_side) : 0);
      }
    }
  }
}

/// Asks for the cache lines of a cell in one plane, long before load_cell or store_cell needs them.
template <bool write, class T>
COMPMARK_INLINE void prefetch_cell(const T* plane, const CellPlace& place) {
  const int rows = std::min(cell_side, place.height - place.y), columns = std::min(cell_side, place.width - place.x);
  for (int y = 0; y < rows; ++y) {
    const T* row = plane + static_cast<std::size_t>(place.y + y) * static_cast<std::size_t>(place.width) +
                   static_cast<std::size_t>(place.x);
    __builtin_prefetch(row, write ? 1 : 0);
    if (reinterpret_cast<std::uintptr_t>(row) % 64 != 0 || sizeof(T) > 4)
      __builtin_prefetch(row + columns - 1, write ? 1 : 0);
  }
}

/// Copies a plane's pixels of one cell into blocks: to[block][lane]; pixels outside the image become 0.
template <class T>
inline void load_cell(const T* plane, const CellPlace& place, T (&to)[cell_blocks][block_pixels]) {
  each_block_row(
      place, [&](int block, int lane, std::size_t offset, int count) __attribute__((always_inline)) {
        T* const target = to[block] + lane;
        if (count == block_side) {
          std::memcpy(target, plane + offset, block_side * sizeof(T));
        } else {
          for (int i = 0; i < block_side; ++i)
            target[i] = i < count ? plane[offset + static_cast<std::size_t>(i)] : T(0);
        }
      });
}

/// The inverse of load_cell; pixels outside the image are dropped.
template <class T>
inline void store_cell(const T (&from)[cell_blocks][block_pixels], const CellPlace& place, T* plane) {
  each_block_row(
      place, [&](int block, int lane, std::size_t offset, int count) __attribute__((always_inline)) {
        const T* const source = from[block] + lane;
        if (count == block_side) {
          std::memcpy(plane + offset, source, block_side * sizeof(T));
        } else {
          for (int i = 0; i < count; ++i) plane[offset + static_cast<std::size_t>(i)] = source[i];
        }
      });
}

}  // namespace compmark::detail
