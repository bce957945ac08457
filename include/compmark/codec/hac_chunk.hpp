// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One chunk of anchors, to bytes and back: masks, then one stream of symbols, of each anchor in Morton order its D features, 6 extents and the
// three coordinates of each live offset. Both directions ask the same integer context for the same models; the encoder rounds with the
// step that the context says, value / q to the nearest, ties to even, so that only whole numbers travel. Cost: ~2 us an anchor each way.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/bits.hpp"
#include "compmark/codec/codec_model.hpp"
#include "compmark/codec/hac_digest.hpp"
#include "compmark/codec/hac_format.hpp"
#include "compmark/codec/mask_coding.hpp"
#include "compmark/core/result.hpp"
#include "compmark/entropy/integer_context.hpp"
#include "compmark/entropy/symbol_coder.hpp"

namespace compmark::inline v0 {

namespace detail {

/// The rows of a model that a chunk covers, all in coding order.
struct ChunkRows {
  std::span<const Voxel> voxels;
  std::span<std::uint32_t> mask;
  std::span<float> feature, extent, offset;
};

[[nodiscard]] inline ChunkRows chunk_rows(CodecModel& model, std::size_t begin, std::size_t end) {
  const auto d = static_cast<std::size_t>(model.feature_dim), k3 = 3 * static_cast<std::size_t>(model.offset_count);
  const std::size_t n = end - begin;
  return {std::span<const Voxel>(model.voxels).subspan(begin, n), std::span(model.mask).subspan(begin, n),
          std::span(model.feature).subspan(begin * d, n * d), std::span(model.extent).subspan(begin * 6, n * 6),
          std::span(model.offset).subspan(begin * k3, n * k3)};
}

/// Everything that all chunks share.
struct ChunkCoder {
  const IntegerContext& context;
  const IntegerNetwork::Packed& packed;
  const GaussianTables& tables;
  std::array<double, 3> base_step;
  int offset_count;
};

/// visit(group, step index, value) for the scalars of an anchor in the order of coding.
template <class Visit>
void visit_scalars(const ChunkRows& rows, std::size_t anchor, int offset_count, const ContextEvaluator& evaluator,
                   std::size_t lane, const Visit& visit) {
  const std::size_t d = rows.feature.size() / rows.voxels.size(), k = static_cast<std::size_t>(offset_count);
  for (std::size_t c = 0; c < d; ++c) visit(0, evaluator.step(0, lane), rows.feature[anchor * d + c]);
  for (std::size_t c = 0; c < 6; ++c) visit(1, evaluator.step(1, lane), rows.extent[anchor * 6 + c]);
  for (std::size_t o = 0; o < k; ++o) {
    if ((rows.mask[anchor] >> o & 1u) == 0) continue;
    for (std::size_t axis = 0; axis < 3; ++axis)
      visit(2, evaluator.step(2, lane), rows.offset[anchor * 3 * k + 3 * o + axis]);
  }
}

/// Models of an anchor's scalars, appended in the order of coding.
inline void append_models(const ContextEvaluator& evaluator, const ContextHeads& heads, std::uint32_t mask,
                          std::size_t lane, std::vector<SymbolModel>& models) {
  const std::size_t live = 3 * static_cast<std::size_t>(std::popcount(mask)), d = heads.width(0), first = models.size();
  models.resize(first + d + 6 + live);
  SymbolModel* out = models.data() + first;
  evaluator.models(0, lane, 0, d, out);
  evaluator.models(1, lane, 0, 6, out + d);
  out += d + 6;
  for (; mask != 0; mask &= mask - 1, out += 3) {
    evaluator.models(2, lane, 3 * static_cast<std::size_t>(std::countr_zero(mask)), 3, out);
  }
}

/// Names what a chunk decoded to.
[[nodiscard]] inline std::uint64_t chunk_symbol_hash(std::span<const std::int32_t> symbols,
                                                     std::span<const std::uint32_t> masks) {
  std::uint64_t hash = digest_symbols(symbols).low;
  for (const std::uint32_t mask : masks) hash = mix_bits(hash ^ mask);
  return hash;
}
/// … and its arrays, bit by bit.
[[nodiscard]] inline ChunkDigest chunk_value_hash(const ChunkRows& rows) {
  static_assert(std::endian::native == std::endian::little, "values are hashed as they lie in memory");
  const std::array<std::span<const std::byte>, 5> arrays{std::as_bytes(rows.voxels), std::as_bytes(rows.mask),
                                                         std::as_bytes(rows.feature), std::as_bytes(rows.extent),
                                                         std::as_bytes(rows.offset)};
  ChunkDigest digest{};
  for (std::size_t i = 0; i < arrays.size(); ++i) {
    const std::array<std::uint64_t, 2> hash = digest_words(arrays[i]);
    digest[2 * i] = hash[0];
    digest[2 * i + 1] = hash[1];
  }
  return digest;
}

/// The nearest symbol, ties to even, and whether it had to be held at the greatest.
[[nodiscard]] inline std::pair<std::int32_t, bool> symbol_of(float value, int index, double base_step) {
  const double q = static_cast<double>(step_ratio(index)) * (base_step * 0x1p-24);
  constexpr double limit = greatest_symbol;
  const double rounded = std::nearbyint(static_cast<double>(value) / q), held = std::clamp(rounded, -limit, limit);
  return {static_cast<std::int32_t>(held), held != rounded};
}

struct EncodedChunk {
  std::vector<std::byte> mask, stream;
  std::uint64_t symbol_count = 0, symbol_hash = 0;
  ChunkDigest value_hash{};
  std::array<std::uint64_t, 3> symbols{}, clamped{};  ///< by attribute group
  std::array<double, 3> bits{};                       ///< ideal, of the tables
};

/// Replaces the rows' values by those that decoding will give, and returns the bytes.
[[nodiscard]] inline EncodedChunk encode_chunk(const ChunkCoder& coder, const ChunkRows& rows) {
  EncodedChunk chunk;
  ContextEvaluator evaluator(coder.context, coder.packed);
  std::vector<SymbolModel> models;
  std::vector<std::int32_t> symbols;
  const std::size_t n = rows.voxels.size(), k = static_cast<std::size_t>(coder.offset_count);
  for (std::size_t first = 0; first < n; first += integer_panel) {
    const std::size_t count = std::min<std::size_t>(integer_panel, n - first);
    evaluator.evaluate(rows.voxels.subspan(first, count));
    for (std::size_t lane = 0; lane < count; ++lane) {
      const std::size_t anchor = first + lane;
      append_models(evaluator, coder.context.heads, rows.mask[anchor], lane, models);
      for (std::size_t o = 0; o < k; ++o) {
        if ((rows.mask[anchor] >> o & 1u) == 0) std::fill_n(rows.offset.data() + (anchor * k + o) * 3, 3, 0.0f);
      }
      visit_scalars(rows, anchor, coder.offset_count, evaluator, lane, [&](int group, int index, float& value) {
        const auto g = static_cast<std::size_t>(group);
        const std::pair<std::int32_t, bool> rounded = symbol_of(value, index, coder.base_step[g]);
        const std::int32_t symbol = rounded.first;
        chunk.clamped[g] += rounded.second ? 1 : 0;
        ++chunk.symbols[g];
        chunk.bits[g] += ideal_bits(coder.tables, models[symbols.size()], symbol);
        symbols.push_back(symbol);
        value = symbol_value(symbol, index, coder.base_step[g]);
      });
    }
  }
  chunk.mask = encode_masks(rows.mask, coder.offset_count);
  std::vector<std::uint8_t> stream;
  encode_symbols(coder.tables, models, symbols, stream);
  const std::span<const std::byte> bytes = std::as_bytes(std::span<const std::uint8_t>(stream));
  chunk.stream.assign(bytes.begin(), bytes.end());
  chunk.symbol_count = symbols.size();
  chunk.symbol_hash = chunk_symbol_hash(symbols, rows.mask);
  chunk.value_hash = chunk_value_hash(rows);
  return chunk;
}

/// Hashes of what was decoded.
struct DecodedChunk {
  std::uint64_t symbol_count = 0, symbol_hash = 0;
  ChunkDigest value_hash{};
};

/// Fills the rows from the two payloads, whose checksums are right. Any bytes may be given. Offsets that are not live are zero already.
[[nodiscard]] inline Result<DecodedChunk> decode_chunk(const ChunkCoder& coder, std::span<const std::byte> mask,
                                                       std::span<const std::byte> stream, const ChunkRows& rows) {
  const Result<Done> masks = decode_masks(mask, coder.offset_count, rows.mask);
  if (!masks) return masks.error();
  ContextEvaluator evaluator(coder.context, coder.packed);
  std::vector<SymbolModel> models;
  const std::size_t n = rows.voxels.size(), panels = (n + integer_panel - 1) / integer_panel;
  std::vector<ContextEvaluator::Steps> steps(panels);
  models.reserve(n * (coder.context.heads.width(0) + 6 + coder.context.heads.width(2) / 2));
  for (std::size_t panel = 0; panel < panels; ++panel) {
    const std::size_t first = panel * integer_panel, count = std::min<std::size_t>(integer_panel, n - first);
    evaluator.evaluate(rows.voxels.subspan(first, count));
    steps[panel] = evaluator.steps();
    for (std::size_t lane = 0; lane < count; ++lane) {
      append_models(evaluator, coder.context.heads, rows.mask[first + lane], lane, models);
    }
  }
  std::vector<std::int32_t> symbols(models.size());
  const Result<Done> decoded = decode_symbols(coder.tables, models, octets(stream), symbols);
  if (!decoded) return decoded.error();
  for (std::size_t panel = 0, next = 0; panel < panels; ++panel) {
    evaluator.set_steps(steps[panel]);
    const std::size_t first = panel * integer_panel, count = std::min<std::size_t>(integer_panel, n - first);
    bool whole = true;
    for (std::size_t lane = 0; lane < count; ++lane) {
      visit_scalars(rows, first + lane, coder.offset_count, evaluator, lane, [&](int group, int index, float& value) {
        const std::int32_t symbol = symbols[next++];
        whole = whole && symbol <= greatest_symbol && symbol >= (group == 1 ? 0 : -greatest_symbol);
        value = symbol_value(symbol, index, coder.base_step[static_cast<std::size_t>(group)]);
      });
    }
    if (!whole) return bad_section("STRM", "an extent is negative, or a value beyond the largest symbol");
  }
  return DecodedChunk{symbols.size(), chunk_symbol_hash(symbols, rows.mask), chunk_value_hash(rows)};
}

}  // namespace detail

}  // namespace compmark::inline v0
