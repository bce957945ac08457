// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The small sections of a HAC file (docs/container.md): META, what a decoder must know first and what the owner wants to find again; HASH, the
// binary hash grid, of which only the entries are written that some anchor looks at (the decoder has the voxels by then and knows which);
// TABL, which names the numbers of the tables. Each reader checks every count before it believes it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "compmark/codec/bits.hpp"
#include "compmark/codec/codec_model.hpp"
#include "compmark/codec/container.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/entropy/gaussian_tables.hpp"
#include "compmark/entropy/integer_functions.hpp"
#include "compmark/entropy/integer_hash_grid.hpp"
#include "compmark/io/bytes.hpp"

namespace compmark::inline v0 {

struct HacFormat {
  static constexpr std::uint32_t numeric_spec = 1;  ///< of everything that decides a symbol
  static constexpr std::uint32_t meta = four_characters("META"), geometry = four_characters("GEOM"),
                                 mask = four_characters("MASK"), hash = four_characters("HASH"),
                                 context = four_characters("NETC"), networks = four_characters("NETR"),
                                 tables = four_characters("TABL"), stream = four_characters("STRM"),
                                 digests = four_characters("DIGS");
  static constexpr std::array<std::uint32_t, 9> known{meta,     tables, geometry, hash,   context,
                                                      networks, mask,   stream,   digests};
};

namespace detail {

[[nodiscard]] inline Error bad_section(const char* section, std::string problem) {
  return {ErrorKind::malformed, "", section, std::move(problem), "copy the file again"};
}

/// META: u64 anchors, u32 K, u32 D, u32 anchors a chunk, f64 voxel size, 3 x f64 base steps, u32 number of values; of each, keys
/// ascending: u8 length of the key, key, u8 type (1 i64, 2 f64, 3 text), value (a text with u32 length).
[[nodiscard]] inline std::vector<std::byte> encode_meta(const CodecModel& model, std::uint64_t anchors) {
  ByteWriter writer;
  writer.put(anchors)
      .put(static_cast<std::uint32_t>(model.offset_count))
      .put(static_cast<std::uint32_t>(model.feature_dim));
  writer.put(static_cast<std::uint32_t>(model.chunk_anchors)).put(model.voxel_size);
  for (const double step : model.base_step) writer.put(step);
  writer.put(static_cast<std::uint32_t>(model.metadata.size()));
  for (const auto& [key, value] : model.metadata) {
    writer.put(static_cast<std::uint8_t>(key.size())).put(std::string_view(key));
    writer.put(static_cast<std::uint8_t>(value.index() + 1));
    if (const auto* integer = std::get_if<std::int64_t>(&value)) writer.put(*integer);
    if (const auto* real = std::get_if<double>(&value)) writer.put(*real);
    if (const auto* text = std::get_if<std::string>(&value)) {
      writer.put(static_cast<std::uint32_t>(text->size())).put(std::string_view(*text));
    }
  }
  return writer.take();
}

/// Fills the model's numbers and metadata; returns the number of anchors.
[[nodiscard]] inline Result<std::uint64_t> decode_meta(std::span<const std::byte> payload, CodecModel& model) {
  ByteReader reader(payload);
  const auto anchors = reader.get<std::uint64_t>();
  const auto k = reader.get<std::uint32_t>(), d = reader.get<std::uint32_t>(), chunk = reader.get<std::uint32_t>();
  model.voxel_size = reader.get<double>();
  for (double& step : model.base_step) step = reader.get<double>();
  constexpr std::uint32_t limit = 1u << 30;
  model.offset_count = static_cast<int>(std::min(k, limit));
  model.feature_dim = static_cast<int>(std::min(d, limit));
  model.chunk_anchors = static_cast<int>(std::min(chunk, limit));
  const std::size_t count = reader.count(3);
  std::string before;
  for (std::size_t i = 0; i < count && !reader.failed(); ++i) {
    std::string key = reader.text(reader.get<std::uint8_t>());
    const auto type = reader.get<std::uint8_t>();
    CodecValue value;
    if (type == 1) {
      value = reader.get<std::int64_t>();
    } else if (type == 2) {
      value = reader.get<double>();
    } else if (type == 3) {
      value = reader.text(reader.get<std::uint32_t>());
    } else {
      return bad_section("META", "a value has the unknown type " + std::to_string(type));
    }
    if (key <= before) return bad_section("META", "keys are empty or not in ascending order");
    before = key;
    model.metadata.emplace(std::move(key), std::move(value));
  }
  if (!reader.complete()) return bad_section("META", "its values do not end where it does");
  const Result<Done> checked = check_codec_numbers(model);
  if (!checked) {
    Error error = checked.error();
    error.field = "META: " + error.field;
    error.remedy = "copy the file again";
    return error;
  }
  if (anchors > CodecLimits::anchors) {
    return Error{ErrorKind::exhausted, "", "META", std::to_string(anchors) + " anchors are more than 2^28",
                 "check the file"};
  }
  return anchors;
}

/// Signs of the entries that are looked at, in the order of the table; contexts: the features of the entry before this one, whether all of the
/// entry before it are +1; each level learns anew, from where the one before it left.
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

/// HASH: u8 levels of the volume and of a plane, u8 log2 of their caps, u32 resolutions (volume, plane), of each axis i32 scale, u8
/// fraction bits, i64 offset; the signs. Sets entries that no anchor looks at to zero in `grid`, as the decoder will have them.
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

/// TABL: u64 fingerprint of the Gaussian tables, u64 hash of the step tables.
[[nodiscard]] inline std::vector<std::byte> encode_tables(const GaussianTables& tables) {
  return ByteWriter().put(tables.fingerprint()).put(step_table_hash()).take();
}
[[nodiscard]] inline Result<Done> check_tables(std::span<const std::byte> payload, const GaussianTables& tables) {
  ByteReader reader(payload);
  const auto gaussian = reader.get<std::uint64_t>(), step = reader.get<std::uint64_t>();
  if (!reader.complete()) return bad_section("TABL", "has " + std::to_string(payload.size()) + " bytes, not 16");
  if (gaussian != tables.fingerprint() || step != step_table_hash()) {
    return Error{ErrorKind::unsupported, "", "TABL", "its coding tables are not those of this program",
                 "decode it with the version that wrote it"};
  }
  return Done{};
}

}  // namespace detail

}  // namespace compmark::inline v0
