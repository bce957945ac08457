// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The sections of a HAC file (docs/container.md), and the one that is its own: HASH, the binary hash grid, of which
// only the entries are written that some anchor looks at (the decoder has the voxels by then and knows which).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/codec/coder/bits.hpp"
#include "compmark/codec/container/file_format.hpp"
#include "compmark/codec/integer/integer_hash_grid.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/bytes.hpp"

namespace compmark {

struct HacFormat : CodecFormat {
  static constexpr std::uint32_t hash = four_characters("HASH");
  static constexpr std::array<std::uint32_t, 9> known{meta,     tables, geometry, hash,   context,
                                                      networks, mask,   stream,   digests};
  static constexpr std::array<std::uint32_t, 2> chunked{mask, stream};
  static constexpr CodecSections sections{ContainerProfile::hac, "HAC", known, chunked, {}, 1};
};

namespace detail {

/// Signs of the entries that are looked at, in the order of the table; contexts: the features of the entry before this
/// one, whether all of the entry before it are +1; each level learns anew, from where the one before it left.
template <class Bits>
void code_signs(Bits& bits, IntegerHashGrid& grid, std::span<const std::uint8_t> seen) {
  constexpr std::uint32_t remembered = 16;  // bits that what the level before has taught counts as
  std::array<std::array<BinaryContext, 15>, 2> contexts{};
  for (const HashGridLevel& level : grid.levels()) {
    for (auto& tree : contexts) {
      for (BinaryContext& context : tree) context.count = std::min(context.count, remembered);
    }
    std::size_t before = 0;
    for (std::uint32_t e = level.first; e < level.first + level.entries; ++e) {
      std::uint8_t& entry = grid.entries()[e];
      entry = seen[e] == 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(bits.tree(contexts[before], entry, 4));
      if (seen[e] != 0) before = entry == 15 ? 1 : 0;
    }
  }
}

/// Which entries of the grid some voxel looks at. Levels in parallel.
template <Executor E>
[[nodiscard]] std::vector<std::uint8_t> seen_entries(const IntegerHashGrid& grid, std::span<const Voxel> voxels,
                                                     E& executor) {
  std::vector<std::uint8_t> seen(grid.entries().size(), 0);
  executor.for_chunks(grid.levels().size(), 1,
                      [&](std::size_t level, std::size_t, std::size_t) { grid.mark_seen(level, voxels, seen); });
  return seen;
}

/// HASH: u8 levels of the volume and of a plane, u8 log2 of their caps, u32 resolutions (volume, plane), of each axis
/// i32 scale, u8 fraction bits, i64 offset; the signs. Sets entries that no anchor looks at to zero in `grid`, as the
/// decoder will have them.
[[nodiscard]] inline std::vector<std::byte> encode_hash_grid(IntegerHashGrid& grid,
                                                             std::span<const std::uint8_t> seen) {
  const HashGridShape& shape = grid.shape();
  ByteWriter writer;
  writer.put(static_cast<std::uint8_t>(shape.volume_levels)).put(static_cast<std::uint8_t>(shape.plane_levels));
  writer.put(static_cast<std::uint8_t>(shape.volume_cap_log2)).put(static_cast<std::uint8_t>(shape.plane_cap_log2));
  for (int i = 0; i < shape.volume_levels; ++i)
    writer.put(static_cast<std::uint32_t>(shape.volume_resolution[static_cast<std::size_t>(i)]));
  for (int i = 0; i < shape.plane_levels; ++i)
    writer.put(static_cast<std::uint32_t>(shape.plane_resolution[static_cast<std::size_t>(i)]));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    writer.put(grid.box().scale[axis])
        .put(static_cast<std::uint8_t>(grid.box().fraction[axis]))
        .put(grid.box().offset[axis]);
  }
  BitsOut bits;
  code_signs(bits, grid, seen);
  writer.put(bits.finish());
  return writer.take();
}

template <Executor E>
[[nodiscard]] Result<IntegerHashGrid> decode_hash_grid(std::span<const std::byte> payload,
                                                       std::span<const Voxel> voxels, E& executor) {
  ByteReader reader(payload);
  HashGridShape shape;
  const auto volume = reader.get<std::uint8_t>(), plane = reader.get<std::uint8_t>();
  if (volume > shape.volume_resolution.size() || plane > shape.plane_resolution.size())
    return bad_section("HASH", "more levels than exist");
  shape.volume_levels = volume;
  shape.plane_levels = plane;
  shape.volume_cap_log2 = reader.get<std::uint8_t>();
  shape.plane_cap_log2 = reader.get<std::uint8_t>();
  const auto resolution = [&] { return static_cast<int>(std::min(reader.get<std::uint32_t>(), 1u << 30)); };
  for (std::size_t i = 0; i < volume; ++i) shape.volume_resolution[i] = resolution();
  for (std::size_t i = 0; i < plane; ++i) shape.plane_resolution[i] = resolution();
  VoxelBox box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.scale[axis] = reader.get<std::int32_t>();
    box.fraction[axis] = reader.get<std::uint8_t>();
    box.offset[axis] = reader.get<std::int64_t>();
  }
  if (reader.failed()) return bad_section("HASH", "ends in its fixed part");
  if (!shape.valid()) return bad_section("HASH", "levels, caps or resolutions are out of range");
  if (!box.valid()) return bad_section("HASH", "the context's box is out of range");
  IntegerHashGrid grid(shape, box);
  BitsIn bits(reader.take(reader.left()));
  code_signs(bits, grid, seen_entries(grid, voxels, executor));
  if (!bits.complete()) return bad_section("HASH", "the signs do not end where their bytes do");
  return grid;
}

}  // namespace detail

}  // namespace compmark
