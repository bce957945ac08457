// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Everything that trains lives in one arena: named blocks [rows, columns] of values and, in the same layout, their
// gradients. Anchor blocks share one row count and are edited together (keep some rows, append others); network blocks
// keep their shape. Handles survive row edits. Optimiser moments use the same ArenaLayout and the same move_rows, so
// they cannot fall out of step.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// Whether a block's rows are anchors (edited by growing and pruning) or fixed (a network's weights).
enum class RowKind : std::uint8_t { anchor, fixed };

/// The purpose of a block. It is part of the declaration; nothing is decided by a name.
enum class BlockRole : std::uint8_t {
  rendering,  ///< numbers that a render reads
  mask,       ///< logits; a render reads their signs alone
  training,   ///< read while training alone
  context,    ///< read by an entropy model, to train and to code
};

/// What a learning rate is multiplied by.
enum class RateUnit : std::uint8_t { one, scene_extent };

/// How fast a block trains: log-linear from `initial` to `final` over the run; equal ends are a constant rate. Both are
/// positive, or both zero. Iterations are those of a run of 30,000 and scale with the run (splat/optim/phases.hpp).
/// splat/optim/schedule.hpp gives the rate of an iteration.
struct LearningSchedule {
  double initial = 0;
  double final = 0;
  RateUnit unit = RateUnit::one;
  std::int64_t starts_after = 0;  ///< the rate is zero up to and with this iteration
  std::int64_t decays_from = 0;   ///< the decay begins here

  [[nodiscard]] static constexpr LearningSchedule constant(double rate) { return {rate, rate}; }
  /// Of a block that the optimiser leaves alone.
  [[nodiscard]] static constexpr LearningSchedule fixed() { return {}; }
  friend bool operator==(const LearningSchedule&, const LearningSchedule&) = default;
};

/// Stable name of a block inside its arena.
struct BlockHandle {
  std::size_t index = static_cast<std::size_t>(-1);
  [[nodiscard]] bool valid() const { return index != static_cast<std::size_t>(-1); }
};

/// Keep rows kept[0] < kept[1] < … of the old table, in that order, then append `appended` rows (zero until somebody
/// writes them).
struct RowEdit {
  std::span<const std::uint32_t> kept;
  std::size_t appended = 0;
  [[nodiscard]] std::size_t rows() const { return kept.size() + appended; }
};

/// Shapes and offsets of the blocks, without memory: shared by values, gradients and moments.
class ArenaLayout {
 public:
  struct Block {
    std::string name;
    std::size_t rows = 0;
    std::size_t columns = 0;
    RowKind kind = RowKind::fixed;
    BlockRole role = BlockRole::rendering;
    LearningSchedule schedule;
    std::size_t offset = 0;  ///< in scalars, a multiple of 16 (64 bytes of float)
    [[nodiscard]] std::size_t size() const { return rows * columns; }
  };

  BlockHandle add(std::string_view name, std::size_t rows, std::size_t columns, RowKind kind, BlockRole role,
                  const LearningSchedule& schedule) {
    COMPMARK_ASSERT(!find(name).valid(), "ArenaLayout: two blocks of one name");
    blocks_.push_back({std::string(name), rows, columns, kind, role, schedule, 0});
    place();
    return {blocks_.size() - 1};
  }
  void set_schedule(BlockHandle handle, const LearningSchedule& schedule) { blocks_[handle.index].schedule = schedule; }
  void set_anchor_rows(std::size_t rows) {
    for (Block& block : blocks_) {
      if (block.kind == RowKind::anchor) block.rows = rows;
    }
    place();
  }

  [[nodiscard]] const Block& block(BlockHandle handle) const { return blocks_[handle.index]; }
  [[nodiscard]] std::span<const Block> blocks() const { return blocks_; }
  [[nodiscard]] std::size_t size() const { return size_; }  ///< scalars, padding between blocks included
  [[nodiscard]] BlockHandle find(std::string_view name) const {
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      if (blocks_[i].name == name) return {i};
    }
    return {};
  }

 private:
  void place() {
    size_ = 0;
    for (Block& block : blocks_) {
      block.offset = size_;
      size_ += (block.size() + 15) / 16 * 16;
    }
  }
  std::vector<Block> blocks_;
  std::size_t size_ = 0;
};

/// Moves every block of `from` (old layout) into `to` (new layout) under one edit; appended rows and padding become
/// zero.
template <class T>
void move_rows(const ArenaLayout& old_layout, const ArenaLayout& new_layout, const RowEdit& edit,
               std::span<const T> from, std::span<T> to) {
  std::fill(to.begin(), to.end(), T{});
  for (std::size_t b = 0; b < old_layout.blocks().size(); ++b) {
    const ArenaLayout::Block& old_block = old_layout.blocks()[b];
    const ArenaLayout::Block& new_block = new_layout.blocks()[b];
    const T* source = from.data() + old_block.offset;
    T* target = to.data() + new_block.offset;
    if (old_block.kind == RowKind::fixed) {
      std::copy_n(source, old_block.size(), target);
      continue;
    }
    for (std::size_t row = 0; row < edit.kept.size(); ++row) {
      std::copy_n(source + edit.kept[row] * old_block.columns, old_block.columns, target + row * old_block.columns);
    }
  }
}

/// Values and gradients of all blocks. Add all blocks first; spans stay valid until the next add or edit_rows. Gradients
/// take memory from the first time that one is asked for to be written, all of them zero: who renders has none. That
/// first time is one thread's (Pipeline::backward begins with it).
template <class T>
class ParameterArena {
 public:
  using Scalar = T;

  /// A block behind the others, which stay where they are; its values are zero. `name` is what files call it.
  BlockHandle add(std::string_view name, std::size_t rows, std::size_t columns, RowKind kind, BlockRole role,
                  const LearningSchedule& schedule) {
    const BlockHandle handle = layout_.add(name, rows, columns, kind, role, schedule);
    values_.extend(layout_.size(), T{});
    return handle;
  }

  /// A block without a role and a schedule would train at a rate that nobody chose, or not at all.
  template <class Kind>
  BlockHandle add(std::string_view, std::size_t, std::size_t, Kind) {
    static_assert(sizeof(Kind) == 0,
                  "ParameterArena: a block is declared with its BlockRole and its LearningSchedule (see "
                  "core/parameters.hpp)");
    return {};
  }
  /// Another schedule than the declared one, before a run begins.
  void set_schedule(BlockHandle handle, const LearningSchedule& schedule) { layout_.set_schedule(handle, schedule); }

  [[nodiscard]] const ArenaLayout& layout() const { return layout_; }
  [[nodiscard]] MatrixView<T> values(BlockHandle handle) { return view(values_.data(), handle); }
  [[nodiscard]] MatrixView<const T> values(BlockHandle handle) const { return view(values_.data(), handle); }
  [[nodiscard]] MatrixView<T> gradients(BlockHandle handle) { return view(all_gradients().data(), handle); }
  [[nodiscard]] MatrixView<const T> gradients(BlockHandle handle) const {
    COMPMARK_ASSERT(has_gradients(), "ParameterArena: gradients that were never written");
    return view(gradients_.data(), handle);
  }
  [[nodiscard]] std::span<T> all_values() { return values_.span(); }
  [[nodiscard]] std::span<const T> all_values() const { return values_.span(); }
  [[nodiscard]] std::span<T> all_gradients() {
    if (!has_gradients()) gradients_.extend(layout_.size(), T{});
    return gradients_.span();
  }
  /// Empty before the first one was asked for to be written.
  [[nodiscard]] std::span<const T> all_gradients() const { return gradients_.span(); }
  [[nodiscard]] bool has_gradients() const { return gradients_.size() == layout_.size(); }
  [[nodiscard]] std::size_t memory_bytes() const {
    return values_.capacity_bytes() + gradients_.capacity_bytes() + spare_.capacity_bytes();
  }

  /// Row edit of all anchor blocks; gradients become zero (as in the published training loop). Cost: one copy of the
  /// arena.
  void edit_rows(const RowEdit& edit) {
    const ArenaLayout old_layout = layout_;
    layout_.set_anchor_rows(edit.rows());
    spare_.resize(layout_.size());
    move_rows<T>(old_layout, layout_, edit, values_.span(), spare_.span());
    std::swap(values_, spare_);
    if (!gradients_.empty()) gradients_.resize(layout_.size(), T{});
  }

 private:
  template <class U>
  [[nodiscard]] MatrixView<U> view(U* base, BlockHandle handle) const {
    const ArenaLayout::Block& block = layout_.block(handle);
    return {base + block.offset, block.rows, block.columns};
  }
  ArenaLayout layout_;
  Buffer<T> values_;
  Buffer<T> gradients_;
  Buffer<T> spare_;
};

}  // namespace compmark
