// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Anchors' voxels, lossless, as an octree coded bit by bit, level by level from the root (docs/spec/compression.md,
// 4.2; HAC stores 48 raw bits an anchor and is lossy). A node says whether it holds one anchor; if so the rest of that
// anchor's digits follow at once, else which of its eight children hold anything. Contexts: the level, which of the
// neighbours of the node exist (all of a level are known before the next) and which of the child's, what the node has
// said so far, and how many digits just above are zero on all axes: growing places anchors on grids of 4 and 16 voxels,
// and those digits give them away. Voxels that hold several anchors say how many. Measured on trained scenes: 9.5
// (lego, 51,263 anchors) to 13.7 bits an anchor (11,306). Cost: ~0.5 us an anchor.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/coder/adaptive_binary.hpp"
#include "compmark/codec/coder/bits.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/bytes.hpp"
#include "compmark/math/morton.hpp"

namespace compmark {

namespace detail {

struct OctreeNode {
  std::array<std::uint32_t, 3> cell{};  ///< the digits so far
  std::size_t begin = 0, end = 0;       ///< its anchors; known to the encoder only
  unsigned children = 0;                ///< bit c: child c holds something, as far as has been said
};

/// Which cells of a level exist.
class CellSet {
 public:
  void build(const std::vector<OctreeNode>& nodes) {
    slots_.assign(std::bit_ceil(2 * nodes.size() + 1), 0);
    nodes_ = &nodes;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      std::size_t slot = first_slot(nodes[i].cell);
      while (slots_[slot] != 0) slot = (slot + 1) & (slots_.size() - 1);
      slots_[slot] = static_cast<std::uint32_t>(i + 1);
    }
  }
  [[nodiscard]] const OctreeNode* find(const std::array<std::uint32_t, 3>& cell) const {
    for (std::size_t slot = first_slot(cell); slots_[slot] != 0; slot = (slot + 1) & (slots_.size() - 1)) {
      const OctreeNode& node = (*nodes_)[slots_[slot] - 1];
      if (node.cell == cell) return &node;
    }
    return nullptr;
  }

 private:
  [[nodiscard]] std::size_t first_slot(const std::array<std::uint32_t, 3>& cell) const {
    std::uint64_t h =
        cell[0] * 0x9E3779B97F4A7C15ull + cell[1] * 0xC2B2AE3D27D4EB4Full + cell[2] * 0x165667B19E3779F9ull;
    h ^= h >> 32;
    return static_cast<std::size_t>(h * 0xD6E8FEB86659FD93ull >> 32) & (slots_.size() - 1);
  }
  std::vector<std::uint32_t> slots_;
  const std::vector<OctreeNode>* nodes_ = nullptr;
};

/// What is known around a node: which of its six neighbours exist, and the children of the three that were visited
/// before it.
struct Surroundings {
  unsigned exist = 0;  ///< bit 2 axis + side: the neighbour below (side 0) or above
  std::array<unsigned, 3> children_below{};

  Surroundings(const CellSet& cells, const std::array<std::uint32_t, 3>& cell) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::array<std::uint32_t, 3> other = cell;
      other[axis] = cell[axis] - 1;  // wraps to a cell that no level has
      if (const OctreeNode* below = cells.find(other); below != nullptr) {
        exist |= 1u << (2 * axis);
        children_below[axis] = below->children;
      }
      other[axis] = cell[axis] + 1;
      if (cells.find(other) != nullptr) exist |= 2u << (2 * axis);
    }
  }
};

/// One pass over the tree, writing or reading. `voxels` are relative to the origin: sorted input of the encoder, output
/// of the decoder.
template <class Bits>
class Octree {
 public:
  using Cell = std::array<std::uint32_t, 3>;

  explicit Octree(Bits& bits) : bits_(bits) {}

  /// False when the stream says more anchors than `count`, or ends early.
  [[nodiscard]] bool run(std::vector<Cell>& voxels, std::uint64_t count, int depth) {
    if (count == 0) return true;
    std::vector<OctreeNode> level{{Cell{}, 0, voxels.size(), 0}}, next;
    CellSet cells;
    std::uint64_t placed = 0;
    const auto place = [&](const Cell& cell) {
      if constexpr (!Bits::writes) voxels.push_back(cell);
      ++placed;
    };
    for (int digit = depth - 1; digit >= -1 && !level.empty(); --digit) {
      cells.build(level);
      next.clear();
      for (OctreeNode& node : level) {
        if (bits_.overrun() || placed + next.size() > count) return false;
        const Surroundings around(cells, node.cell);
        const bool single = bits_(single_[kind(digit)][static_cast<std::size_t>(std::popcount(around.exist))],
                                  node.end - node.begin == 1);
        if (single) {
          const Cell voxel = tail(node.cell, digit, Bits::writes ? voxels[node.begin] : Cell{});
          if (digit >= 0) node.children = 1u << child_of(voxel, digit);
          place(voxel);
        } else if (digit < 0) {
          const auto more = Bits::writes ? static_cast<std::uint32_t>(node.end - node.begin - 2) : 0u;
          const std::uint64_t copies = std::uint64_t{adaptive_count(bits_, copies_, more)} + 2;
          if (copies > count - placed) return false;
          for (std::uint64_t i = 0; i < copies; ++i) place(node.cell);
        } else {
          children(node, digit, around, voxels, next);
        }
      }
      std::swap(level, next);
    }
    return placed == count && !bits_.overrun();
  }

 private:
  [[nodiscard]] static std::size_t kind(int digit) { return static_cast<std::size_t>(std::clamp(digit + 1, 0, 7)); }
  /// How many of the last digits are zero on all axes, at most 3.
  [[nodiscard]] static std::size_t zeros(const Cell& cell) {
    return static_cast<std::size_t>(std::min(std::countr_zero(cell[0] | cell[1] | cell[2]), 3));
  }
  [[nodiscard]] static std::size_t child_of(const Cell& voxel, int digit) {
    return (voxel[0] >> digit & 1u) | (voxel[1] >> digit & 1u) << 1 | (voxel[2] >> digit & 1u) << 2;
  }
  [[nodiscard]] static Cell child_cell(const Cell& cell, std::size_t child) {
    const auto c = static_cast<std::uint32_t>(child);
    return {cell[0] << 1 | (c & 1u), cell[1] << 1 | (c >> 1 & 1u), cell[2] << 1 | (c >> 2)};
  }

  /// The digits that a lone anchor has left.
  [[nodiscard]] Cell tail(Cell cell, int digit, const Cell& voxel) {
    for (; digit >= 0; --digit) {
      auto& contexts = tail_[kind(digit)][zeros(cell)];
      const std::size_t wanted = Bits::writes ? child_of(voxel, digit) : 0;
      std::size_t node = 0, child = 0;
      for (int axis = 2; axis >= 0; --axis) {
        const bool bit = bits_(contexts[node], (wanted >> axis & 1u) != 0);
        child = child << 1 | (bit ? 1u : 0u);
        node = 2 * node + (bit ? 2 : 1);
      }
      cell = child_cell(cell, child);
    }
    return cell;
  }

  void children(OctreeNode& node, int digit, const Surroundings& around, const std::vector<Cell>& voxels,
                std::vector<OctreeNode>& next) {
    std::size_t begin = node.begin, occupied = 0;
    const std::size_t aligned = digit < 4 ? zeros(node.cell) : 0;
    for (unsigned child = 0; child < 8; ++child) {
      std::size_t end = begin;
      if constexpr (Bits::writes) {
        while (end < node.end && child_of(voxels[end], digit) == child) ++end;
      }
      // Neighbours on the child's own side exist; neighbours of the child itself, below it, exist.
      std::size_t beside = 0, below = 0;
      for (unsigned axis = 0; axis < 3; ++axis) {
        const unsigned side = child >> axis & 1u;
        beside += around.exist >> (2 * axis + side) & 1u;
        below += (side != 0 ? node.children : around.children_below[axis]) >> (child ^ 1u << axis) & 1u;
      }
      std::size_t context = kind(digit) * 4 + aligned;
      context = ((context * 4 + beside) * 4 + below) * 4 + std::min<std::size_t>(occupied, 3);
      const bool implied = child == 7 && occupied == 0;
      if (implied || bits_(child_[context * 8 + child], end > begin)) {
        next.push_back({child_cell(node.cell, child), begin, end, 0});
        node.children |= 1u << child;
        ++occupied;
      }
      begin = end;
    }
  }

  Bits& bits_;
  std::array<std::array<BinaryContext, 7>, 8> single_;
  std::array<std::array<std::array<BinaryContext, 7>, 4>, 8> tail_;
  std::vector<BinaryContext> child_ = std::vector<BinaryContext>(8 * 4 * 4 * 4 * 4 * 8);
  std::array<BinaryContext, 64> copies_;
};

}  // namespace detail

/// The payload of GEOM: origin (3 x i32), bits an axis (u8), the tree. `voxels` in the order of coding.
[[nodiscard]] inline std::vector<std::byte> encode_geometry(std::span<const Voxel> voxels, const VoxelRange& range) {
  std::vector<std::array<std::uint32_t, 3>> cells(voxels.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    cells[i] = {range.relative(voxels[i], 0), range.relative(voxels[i], 1), range.relative(voxels[i], 2)};
  }
  ByteWriter writer;
  for (const std::int32_t coordinate : range.origin) writer.put(coordinate);
  writer.put(static_cast<std::uint8_t>(range.bits));
  detail::BitsOut bits;
  detail::Octree<detail::BitsOut> tree(bits);
  (void)tree.run(cells, cells.size(), range.bits);
  writer.put(bits.finish());
  return writer.take();
}

/// The voxels again, sorted. Any bytes may be given; memory grows with what has been decoded and never beyond `count`
/// anchors.
[[nodiscard]] inline Result<std::vector<Voxel>> decode_geometry(std::span<const std::byte> payload,
                                                                std::uint64_t count) {
  const auto fail = [](std::string problem) {
    return Error{ErrorKind::malformed, "", "GEOM", std::move(problem), "copy the file again"};
  };
  ByteReader reader(payload);
  VoxelRange range;
  for (std::int32_t& coordinate : range.origin) coordinate = reader.get<std::int32_t>();
  range.bits = reader.get<std::uint8_t>();
  if (reader.failed()) return fail("is shorter than its 13 fixed bytes");
  if (range.bits > 32) return fail(std::to_string(range.bits) + " bits an axis, at most 32 exist");
  detail::BitsIn bits(reader.take(reader.left()));
  detail::Octree<detail::BitsIn> tree(bits);
  std::vector<std::array<std::uint32_t, 3>> cells;
  if (!tree.run(cells, count, range.bits))
    return fail("does not hold the " + std::to_string(count) + " anchors announced");
  if (!bits.complete()) return fail("the tree does not end where its bytes do");
  std::vector<std::pair<MortonCode, std::size_t>> codes(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (cells[i][axis] > static_cast<std::uint32_t>(std::numeric_limits<std::int32_t>::max()) -
                               static_cast<std::uint32_t>(range.origin[axis])) {
        return fail("a coordinate leaves the range of 32 bits");
      }
    }
    codes[i] = {morton_code(cells[i][0], cells[i][1], cells[i][2]), i};
  }
  std::sort(codes.begin(), codes.end());
  std::vector<Voxel> voxels(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      voxels[i][axis] =
          static_cast<std::int32_t>(static_cast<std::uint32_t>(range.origin[axis]) + cells[codes[i].second][axis]);
    }
  }
  return voxels;
}

}  // namespace compmark
