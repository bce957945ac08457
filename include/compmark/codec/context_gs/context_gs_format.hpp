// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The sections of a ContextGS file (docs/container.md), and those that are its own: LVLS, the cells that make the
// levels and what scales the inputs of the networks; PRIO, the frequencies of the hyperprior; HYPR, its symbols, a
// chunk each. Also the order of coding, which follows from the voxels: level 2, then 1, then 0, along the Morton curve
// within each. Each reader checks every count before it believes it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/coder/bits.hpp"
#include "compmark/codec/coder/symbol_coder.hpp"
#include "compmark/codec/container/encoding.hpp"
#include "compmark/codec/container/file_format.hpp"
#include "compmark/codec/context_gs/anchor_levels.hpp"
#include "compmark/codec/context_gs/context_gs_integers.hpp"
#include "compmark/codec/context_gs/context_gs_prior.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/bytes.hpp"

namespace compmark {

struct ContextGsFormat : CodecFormat {
  static constexpr std::uint32_t levels = four_characters("LVLS"), prior = four_characters("PRIO"),
                                 hyperprior = four_characters("HYPR");
  static constexpr std::array<std::uint32_t, 11> known{meta,     tables,     geometry, levels, prior,  context,
                                                       networks, hyperprior, mask,     stream, digests};
  static constexpr std::array<std::uint32_t, 3> chunked{hyperprior, mask, stream};
  static constexpr std::array<std::uint32_t, 1> parted{context};
  static constexpr CodecSections sections{ContainerProfile::context_gs, "ContextGS", known, chunked, parted, 3};
};

namespace detail {

using LevelCounts = std::array<std::uint64_t, 3>;  ///< anchors of levels 0, 1, 2

/// LVLS: i32 edges of fine and coarse cells; of each axis i32 scale, u8 fraction bits, i64 offset; u64 anchors of
/// levels 2, 1, 0; of each feature and scale i32 mean, u16 factor, u8 shift.
template <class Context>
[[nodiscard]] std::vector<std::byte> encode_levels(const Context& context, const LevelCounts& counts) {
  ByteWriter writer;
  writer.put(context.cells.fine).put(context.cells.coarse);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    writer.put(context.box.scale[axis])
        .put(static_cast<std::uint8_t>(context.box.fraction[axis]))
        .put(context.box.offset[axis]);
  }
  for (std::size_t level = 3; level-- > 0;) writer.put(counts[level]);
  for (const SeenScale& scale : context.seen) writer.put(scale.mean).put(scale.factor).put(scale.shift);
  return writer.take();
}
/// `anchors` are all levels' together.
template <class Context>
[[nodiscard]] Result<LevelCounts> decode_levels(std::span<const std::byte> payload, std::uint64_t anchors,
                                                Context& context) {
  ByteReader reader(payload);
  context.cells.fine = reader.get<std::int32_t>();
  context.cells.coarse = reader.get<std::int32_t>();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    context.box.scale[axis] = reader.get<std::int32_t>();
    context.box.fraction[axis] = reader.get<std::uint8_t>();
    context.box.offset[axis] = reader.get<std::int64_t>();
  }
  LevelCounts counts{};
  for (std::size_t level = 3; level-- > 0;) counts[level] = reader.get<std::uint64_t>();
  if (reader.failed() || reader.left() != 7 * context.geometry())
    return bad_section("LVLS", "does not have a factor for each feature and scale");
  for (std::size_t c = 0; c < context.geometry(); ++c) {
    SeenScale scale;
    scale.mean = reader.get<std::int32_t>();
    scale.factor = reader.get<std::uint16_t>();
    scale.shift = reader.get<std::uint8_t>();
    context.seen.push_back(scale);
  }
  if (context.cells.fine < 1 || context.cells.coarse < 1)
    return bad_section("LVLS", "an edge of the cells is not positive");
  if (counts[0] > anchors || counts[1] > anchors || counts[2] > anchors ||
      counts[0] + counts[1] + counts[2] != anchors) {
    return bad_section("LVLS", "its levels do not add up to " + std::to_string(anchors) + " anchors");
  }
  return counts;
}

/// Frequencies less one, as numbers by how far from 0 the symbol is.
template <class Bits>
void code_prior(Bits& bits, std::span<std::uint16_t> prior) {
  std::array<std::array<BinaryContext, 64>, 5> contexts{};
  for (std::size_t i = 0; i < prior.size() && !bits.overrun(); ++i) {
    const int symbol = static_cast<int>(i % HyperpriorFormat::slots) - HyperpriorFormat::window;
    auto& context = contexts[static_cast<std::size_t>(std::min(symbol < 0 ? -symbol : symbol, 4))];
    const std::uint32_t more = adaptive_count(bits, context, prior[i] - 1u);
    if constexpr (!Bits::writes) prior[i] = static_cast<std::uint16_t>(std::min(more, 0xFFFEu) + 1);
  }
}
/// PRIO: u8 channels; the frequencies of -15 … 15 of each.
template <class Context>
[[nodiscard]] std::vector<std::byte> encode_prior(const Context& context) {
  std::vector<std::uint16_t> prior = context.prior;
  BitsOut bits;
  code_prior(bits, std::span<std::uint16_t>(prior));
  return ByteWriter().put(static_cast<std::uint8_t>(context.channels)).put(bits.finish()).take();
}
template <class Context>
[[nodiscard]] Result<Done> decode_prior(std::span<const std::byte> payload, Context& context) {
  ByteReader reader(payload);
  context.channels = reader.get<std::uint8_t>();
  if (context.channels < 1 || context.channels > HyperpriorFormat::most_channels)
    return bad_section("PRIO", std::to_string(context.channels) + " channels are not 1 to 64");
  context.prior.assign(context.channels * HyperpriorFormat::slots, 1);
  BitsIn bits(reader.take(reader.left()));
  code_prior(bits, std::span<std::uint16_t>(context.prior));
  if (!bits.complete()) return bad_section("PRIO", "the frequencies do not end where their bytes do");
  return Done{};
}

/// A model a symbol of z, anchor by anchor.
[[nodiscard]] inline std::vector<SymbolModel> hyperprior_models(std::size_t channels, std::size_t symbols) {
  std::vector<SymbolModel> models(symbols);
  for (std::size_t i = 0; i < symbols; ++i) models[i].sigma_index = static_cast<std::uint16_t>(i % channels);
  return models;
}
/// HYPR: one stream of symbols. Returns what the tables say they cost.
template <class Tables>
[[nodiscard]] double encode_hyperprior(const Tables& tables, std::span<const std::int32_t> symbols,
                                       std::vector<std::byte>& bytes) {
  const std::vector<SymbolModel> models = hyperprior_models(tables.channels(), symbols.size());
  std::vector<std::uint8_t> stream;
  encode_symbols(tables, models, symbols, stream);
  const std::span<const std::byte> written = std::as_bytes(std::span<const std::uint8_t>(stream));
  bytes.assign(written.begin(), written.end());
  double bits = 0;
  for (std::size_t i = 0; i < symbols.size(); ++i) bits += ideal_bits(tables, models[i], symbols[i]);
  return bits;
}
template <class Tables>
[[nodiscard]] Result<Done> decode_hyperprior(const Tables& tables, std::span<const std::byte> payload,
                                             std::span<std::int32_t> symbols) {
  Result<Done> decoded =
      decode_symbols(tables, hyperprior_models(tables.channels(), symbols.size()), octets(payload), symbols);
  if (!decoded) {
    Error error = decoded.error();
    error.field = "HYPR: " + error.field;
    return error;
  }
  for (const std::int32_t z : symbols) {
    if (z < -HyperpriorFormat::greatest || z > HyperpriorFormat::greatest)
      return bad_section("HYPR", "a symbol is beyond the greatest");
  }
  return Done{};
}

/// The order of coding, from voxels along the Morton curve.
struct ContextGsOrder {
  LevelCounts counts{};
  std::vector<std::uint32_t> row;     ///< of the i-th anchor to be coded, in the order that was given
  std::vector<std::uint32_t> parent;  ///< of the i-th, in the order of coding; AnchorLevels::none at level 2
  [[nodiscard]] std::vector<LevelRange> ranges() const {
    return {{2, static_cast<std::size_t>(counts[2])},
            {1, static_cast<std::size_t>(counts[1])},
            {0, static_cast<std::size_t>(counts[0])}};
  }
};
template <class Cells>
[[nodiscard]] ContextGsOrder context_gs_order(std::span<const Voxel> voxels, const Cells& cells) {
  AnchorLevels levels;
  levels.sort(voxels, cells);
  levels.assign();
  ContextGsOrder order;
  const std::size_t n = voxels.size();
  order.row.resize(n);
  order.parent.assign(n, AnchorLevels::none);
  std::vector<std::uint32_t> place(n);
  std::array<std::size_t, 3> next{levels.counts()[2] + levels.counts()[1], levels.counts()[2], 0};
  for (std::size_t level = 0; level < 3; ++level) order.counts[level] = levels.counts()[level];
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t at = next[levels.level()[i]]++;
    order.row[at] = static_cast<std::uint32_t>(i);
    place[i] = static_cast<std::uint32_t>(at);
  }
  for (std::size_t at = 0; at < n; ++at) {
    const std::uint32_t parent = levels.parent()[order.row[at]];
    if (parent != AnchorLevels::none) order.parent[at] = place[parent];
  }
  return order;
}

}  // namespace detail

}  // namespace compmark
