// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// New anchors before they have rows in the table: a place and a size each, and the component-wise maximum of their
// parents' features (docs/spec/method.md, 4.4, g). Their position is the centre of a cell, their log scaling the log of
// its size.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/table.hpp"

namespace compmark {

template <class T>
class NewAnchors {
 public:
  /// Nobody yet. Rows of `feature` and of the blocks `pooled` will be maxima over parents; other anchor blocks start at
  /// zero.
  void clear(const ParameterArena<T>& arena, BlockHandle feature, std::span<const BlockHandle> pooled) {
    anchors_.clear();
    rows_.clear();
    blocks_.assign(1, feature);
    blocks_.insert(blocks_.end(), pooled.begin(), pooled.end());
    width_ = 0;
    for (const BlockHandle block : blocks_) width_ += arena.values(block).columns;
  }
  /// Number of the new anchor.
  std::uint32_t add(const std::array<double, 3>& center, double size) {
    anchors_.push_back({center, size, false});
    rows_.resize(anchors_.size() * width_);
    return static_cast<std::uint32_t>(anchors_.size() - 1);
  }
  /// Takes one more parent into account.
  void pool(const ParameterArena<T>& arena, std::uint32_t number, std::size_t parent) {
    const bool first = !std::exchange(anchors_[number].has_parent, true);
    T* target = rows_.data() + number * width_;
    for (const BlockHandle block : blocks_) {
      const MatrixView<const T> values = arena.values(block);
      for (std::size_t column = 0; column < values.columns; ++column, ++target) {
        const T value = values(parent, column);
        *target = first || value > *target ? value : *target;
      }
    }
  }

  [[nodiscard]] std::size_t size() const { return anchors_.size(); }
  [[nodiscard]] std::array<T, 3> position(std::size_t number) const {
    const std::array<double, 3>& center = anchors_[number].center;
    return {static_cast<T>(center[0]), static_cast<T>(center[1]), static_cast<T>(center[2])};
  }

  /// Writes them into rows first, first + 1, … of the table, which are zero before.
  void write(ParameterArena<T>& arena, const AnchorHandles& handles, std::size_t first) const {
    const AnchorColumns<T> columns = anchor_values(arena, handles);
    const T* source = rows_.data();
    for (std::size_t i = 0; i < anchors_.size(); ++i) {
      const std::array<T, 3> center = position(i);
      std::copy(center.begin(), center.end(), columns.position.row(first + i));
      std::fill_n(columns.scaling.row(first + i), 6, static_cast<T>(std::log(anchors_[i].size)));
      for (const BlockHandle block : blocks_) {
        const MatrixView<T> values = arena.values(block);
        std::copy_n(source, values.columns, values.row(first + i));
        source += values.columns;
      }
    }
  }

 private:
  struct Anchor {
    std::array<double, 3> center;
    double size;
    bool has_parent;
  };
  std::vector<Anchor> anchors_;
  std::vector<T> rows_;  // of all pooled blocks side by side
  std::vector<BlockHandle> blocks_;
  std::size_t width_ = 0;
};

}  // namespace compmark
