// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The levels of the anchors in training: AnchorLevels of their voxels, kept from one iteration to the next. Anchors do
// not move. They are sorted again only after growing and pruning, and their levels are assigned again only when an
// anchor was masked or unmasked (docs/spec/compression.md, 5.12: the published code sorts in every iteration). The
// result depends on positions, masks and cells alone, not on earlier iterations. Cost of an iteration in which nothing
// changed: a comparison of the positions and one look at each anchor's masks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>

#include "compmark/codec/context_gs/anchor_levels.hpp"
#include "compmark/codec/rate/offset_mask.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// The voxel of a position, round(x / size) in double; what is not finite or does not fit ends at the border.
template <class T>
[[nodiscard]] inline Voxel nearest_voxel(const T* position, double voxel_size) {
  Voxel voxel{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double v = std::nearbyint(static_cast<double>(position[axis]) / voxel_size);
    voxel[axis] = v >= 2147483647.0 ? INT32_MAX : (v > -2147483648.0 ? static_cast<std::int32_t>(v) : INT32_MIN);
  }
  return voxel;
}

template <class T>
class ContextGsLevels {
 public:
  /// Returns what was done: 0 nothing, 1 assigned, 2 sorted.
  template <Executor E>
  int update(MatrixView<const T> position, MatrixView<const T> mask, AnchorCells cells, double voxel_size,
             E& executor) {
    const std::size_t n = position.rows;
    const bool same = n == voxels_.size() && cells == cells_ && voxel_size == voxel_size_ &&
                      (n == 0 || std::memcmp(position.data, position_.data(), 3 * n * sizeof(T)) == 0);
    if (!same) {
      position_.resize(3 * n);
      voxels_.resize(n);
      unmasked_.resize(n, std::uint8_t{2});
      std::copy_n(position.data, 3 * n, position_.data());
      executor.for_chunks(n, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i) voxels_[i] = nearest_voxel(position_.data() + 3 * i, voxel_size);
      });
      cells_ = cells;
      voxel_size_ = voxel_size;
      levels_.sort(std::as_const(voxels_).span(), cells);
    }
    changed_.resize(chunk_count(n, grain));
    executor.for_chunks(n, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      bool changed = false;
      for (std::size_t i = begin; i < end; ++i) {
        const std::uint8_t unmasked = any_unmasked(mask.row(i), mask.columns) ? 1 : 0;
        changed = changed || unmasked != unmasked_[i];
        unmasked_[i] = unmasked;
      }
      changed_[begin / grain] = changed;
    });
    const bool masks = std::any_of(changed_.begin(), changed_.end(), [](bool c) { return c; });
    if (!same || masks) levels_.assign(std::as_const(unmasked_).span());
    return same ? (masks ? 1 : 0) : 2;
  }

  [[nodiscard]] const AnchorLevels& levels() const { return levels_; }
  [[nodiscard]] std::span<const Voxel> voxels() const { return voxels_.span(); }
  [[nodiscard]] AnchorCells cells() const { return cells_; }

 private:
  static constexpr std::size_t grain = 4096;
  Buffer<T> position_;
  Buffer<Voxel> voxels_;
  Buffer<std::uint8_t> unmasked_;
  Buffer<bool> changed_;
  AnchorCells cells_{};
  double voxel_size_ = 0;
  AnchorLevels levels_;
};

}  // namespace compmark
