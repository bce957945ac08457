// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One chunk of anchors, to bytes and back, for any codec: masks, then one stream of symbols. It holds for each anchor
// in order its D features, 6 scales and the three coordinates of each unmasked offset. Both directions ask
// the same integer context for the same models. The encoder rounds with the step of the context, value / q to the
// nearest, ties to even, so that only whole numbers are coded. Cost: ~2 us an anchor each way.
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

#include "compmark/codec/coder/bits.hpp"
#include "compmark/codec/coder/symbol_coder.hpp"
#include "compmark/codec/coder/symbol_reader.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/container/digest.hpp"
#include "compmark/codec/container/file_format.hpp"
#include "compmark/codec/container/mask_coding.hpp"
#include "compmark/codec/integer/integer_context.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

namespace detail {

/// The rows of a model that a chunk covers, all in coding order.
struct ChunkRows {
  std::span<const Voxel> voxels;
  std::span<std::uint32_t> mask;
  std::span<float> feature, scale, offset;
  std::span<std::int32_t> hyperprior;  ///< empty in HAC files
};

[[nodiscard]] inline ChunkRows chunk_rows(CodecModel& model, std::size_t begin, std::size_t end) {
  const auto d = static_cast<std::size_t>(model.feature_dim), k3 = 3 * static_cast<std::size_t>(model.offset_count);
  const std::size_t n = end - begin, z = model.voxels.empty() ? 0 : model.hyperprior.size() / model.voxels.size();
  return {
      std::span<const Voxel>(model.voxels).subspan(begin, n), std::span(model.mask).subspan(begin, n),
      std::span(model.feature).subspan(begin * d, n * d),     std::span(model.scale).subspan(begin * 6, n * 6),
      std::span(model.offset).subspan(begin * k3, n * k3),    std::span(model.hyperprior).subspan(begin * z, n * z)};
}

/// Everything that all chunks share.
struct ChunkCoder {
  ContextHeads heads;
  const GaussianTables& tables;
  std::array<double, 3> base_step;
  int offset_count;
};

/// visit(group, channel, step index, value) for the scalars of an anchor in the order of coding; channels count over
/// all groups.
template <class Visit>
void visit_scalars(const ChunkRows& rows, std::size_t anchor, int offset_count, const PanelModels& evaluator,
                   std::size_t lane, const Visit& visit) {
  const std::size_t d = rows.feature.size() / rows.voxels.size(), k = static_cast<std::size_t>(offset_count);
  for (std::size_t c = 0; c < d; ++c) visit(0, c, evaluator.step(0, lane), rows.feature[anchor * d + c]);
  for (std::size_t c = 0; c < 6; ++c) visit(1, d + c, evaluator.step(1, lane), rows.scale[anchor * 6 + c]);
  for (std::size_t o = 0; o < k; ++o) {
    if ((rows.mask[anchor] >> o & 1u) == 0) continue;
    for (std::size_t c = 3 * o; c < 3 * o + 3; ++c)
      visit(2, d + 6 + c, evaluator.step(2, lane), rows.offset[anchor * 3 * k + c]);
  }
}

/// Models of an anchor's scalars, appended in the order of coding.
inline void append_models(const PanelModels& evaluator, const ContextHeads& heads, std::uint32_t mask, std::size_t lane,
                          std::vector<SymbolModel>& models) {
  const std::size_t unmasked = 3 * static_cast<std::size_t>(std::popcount(mask)), d = heads.width(0),
                    first = models.size();
  models.resize(first + d + 6 + unmasked);
  SymbolModel* out = models.data() + first;
  evaluator.models(0, lane, 0, d, out);
  evaluator.models(1, lane, 0, 6, out + d);
  out += d + 6;
  for (; mask != 0; mask &= mask - 1, out += 3) {
    evaluator.models(2, lane, 3 * static_cast<std::size_t>(std::countr_zero(mask)), 3, out);
  }
}

/// Names what a chunk decoded to.
[[nodiscard]] inline std::uint64_t chunk_symbol_hash(std::span<const std::int32_t> symbols, const ChunkRows& rows) {
  std::uint64_t hash = digest_symbols(symbols).low;
  for (const std::uint32_t mask : rows.mask) hash = mix_bits(hash ^ mask);
  if (!rows.hyperprior.empty()) hash = mix_bits(hash ^ digest_symbols(rows.hyperprior).low);
  return hash;
}
/// … and its arrays, bit by bit.
[[nodiscard]] inline ChunkDigest chunk_value_hash(const ChunkRows& rows) {
  static_assert(std::endian::native == std::endian::little, "values are hashed as they lie in memory");
  ChunkDigest digest;
  const auto add = [&](std::span<const std::byte> array) {
    const std::array<std::uint64_t, 2> hash = digest_words(array);
    digest.push_back(hash[0]);
    digest.push_back(hash[1]);
  };
  add(std::as_bytes(rows.voxels));
  add(std::as_bytes(rows.mask));
  add(std::as_bytes(rows.feature));
  add(std::as_bytes(rows.scale));
  add(std::as_bytes(rows.offset));
  if (!rows.hyperprior.empty()) add(std::as_bytes(rows.hyperprior));
  return digest;
}

/// The nearest symbol, ties to even, and whether it was clipped to the greatest one.
[[nodiscard]] inline std::pair<std::int32_t, bool> symbol_of(float value, int index, double base_step) {
  const double q = static_cast<double>(step_ratio(index)) * (base_step * 0x1p-24);
  constexpr double limit = greatest_symbol;
  const double rounded = std::nearbyint(static_cast<double>(value) / q), held = std::clamp(rounded, -limit, limit);
  return {static_cast<std::int32_t>(held), held != rounded};
}

struct EncodedChunk {
  std::vector<std::byte> mask, stream, hyperprior;
  std::vector<std::byte> coarse;  ///< of a file that begins with a coarse level
  std::uint64_t refined = 0;      ///< … symbols that `stream` refines
  std::uint64_t symbol_count = 0, symbol_hash = 0;
  ChunkDigest value_hash;
  std::array<std::uint64_t, 3> symbols{}, clamped{};  ///< by attribute group
  std::array<double, 3> bits{};                       ///< ideal, of the tables
  double hyperprior_bits = 0;
};

/// Anchors of a panel with the outputs of the predictor: body(anchor, lane).
template <class Predictor, class Body>
void for_predicted(Predictor& predictor, std::size_t anchors, const Body& body) {
  for (std::size_t first = 0; first < anchors; first += integer_panel) {
    const std::size_t count = std::min<std::size_t>(integer_panel, anchors - first);
    predictor.look(first, count);
    for (std::size_t lane = 0; lane < count; ++lane) body(first + lane, lane);
  }
}

/// The bytes and hashes of a chunk of which every symbol and its model are known.
inline void write_chunk(const ChunkCoder& coder, std::span<const SymbolModel> models,
                        std::span<const std::int32_t> symbols, const ChunkRows& rows, EncodedChunk& chunk) {
  chunk.mask = encode_masks(rows.mask, coder.offset_count);
  std::vector<std::uint8_t> stream;
  encode_symbols(coder.tables, models, symbols, stream);
  const std::span<const std::byte> bytes = std::as_bytes(std::span<const std::uint8_t>(stream));
  chunk.stream.assign(bytes.begin(), bytes.end());
  chunk.symbol_count = symbols.size();
  chunk.symbol_hash = chunk_symbol_hash(symbols, rows);
  chunk.value_hash = chunk_value_hash(rows);
}

/// Replaces the rows' values by the decoded ones and returns the bytes. `predictor` is PanelModels with two methods:
/// look(first, count) evaluates the context for anchors of the chunk, and tell(anchor, channel, symbol, step index)
/// gives it a coded feature or scale.
template <class Predictor>
[[nodiscard]] EncodedChunk encode_chunk(const ChunkCoder& coder, const ChunkRows& rows, Predictor& predictor) {
  EncodedChunk chunk;
  std::vector<SymbolModel> models;
  std::vector<std::int32_t> symbols;
  const std::size_t n = rows.voxels.size(), k = static_cast<std::size_t>(coder.offset_count);
  for_predicted(predictor, n, [&](std::size_t anchor, std::size_t lane) {
    append_models(predictor, coder.heads, rows.mask[anchor], lane, models);
    for (std::size_t o = 0; o < k; ++o) {
      if ((rows.mask[anchor] >> o & 1u) == 0) std::fill_n(rows.offset.data() + (anchor * k + o) * 3, 3, 0.0f);
    }
    visit_scalars(rows, anchor, coder.offset_count, predictor, lane,
                  [&](int group, std::size_t channel, int index, float& value) {
                    const auto g = static_cast<std::size_t>(group);
                    const std::pair<std::int32_t, bool> rounded = symbol_of(value, index, coder.base_step[g]);
                    const std::int32_t symbol = rounded.first;
                    chunk.clamped[g] += rounded.second ? 1 : 0;
                    ++chunk.symbols[g];
                    chunk.bits[g] += ideal_bits(coder.tables, models[symbols.size()], symbol);
                    symbols.push_back(symbol);
                    value = symbol_value(symbol, index, coder.base_step[g]);
                    if (group < 2) predictor.tell(anchor, channel, symbol, index);
                  });
  });
  write_chunk(coder, models, symbols, rows, chunk);
  return chunk;
}

/// Hashes of what was decoded.
struct DecodedChunk {
  std::uint64_t symbol_count = 0, symbol_hash = 0;
  ChunkDigest value_hash;
  std::uint64_t refined = 0;  ///< symbols that STRM refines, in a file that begins with a coarse level
  bool is_coarse = false;     ///< they are not refined: STRM has not arrived, and the hashes mean nothing
};

/// Fills the rows from the two payloads, whose checksums are right. Any bytes may be given. Masked offsets are zero
/// already.
template <class Predictor>
[[nodiscard]] Result<DecodedChunk> decode_chunk(const ChunkCoder& coder, std::span<const std::byte> mask,
                                                std::span<const std::byte> stream, const ChunkRows& rows,
                                                Predictor& predictor) {
  const Result<Done> masks = decode_masks(mask, coder.offset_count, rows.mask);
  if (!masks) return masks.error();
  const std::size_t n = rows.voxels.size();
  std::size_t count = n * (coder.heads.width(0) + 6);
  for (const std::uint32_t bits : rows.mask) count += 3 * static_cast<std::size_t>(std::popcount(bits));
  // Before any model is made: what a stream does not hold takes no memory and no time.
  if (const Result<Done> held = SymbolReader(coder.tables, octets(stream)).check(count); !held) return held.error();
  std::vector<SymbolModel> models;
  std::vector<PanelModels::Steps> steps;
  models.reserve(count);
  for_predicted(predictor, n, [&](std::size_t anchor, std::size_t lane) {
    if (lane == 0) steps.push_back(predictor.steps());
    append_models(predictor, coder.heads, rows.mask[anchor], lane, models);
  });
  std::vector<std::int32_t> symbols(models.size());
  const Result<Done> decoded = decode_symbols(coder.tables, models, octets(stream), symbols);
  if (!decoded) return decoded.error();
  bool whole = true;
  std::size_t next = 0;
  for (std::size_t anchor = 0; anchor < n; ++anchor) {
    const std::size_t lane = anchor % integer_panel;
    if (lane == 0) predictor.set_steps(steps[anchor / integer_panel]);
    visit_scalars(rows, anchor, coder.offset_count, predictor, lane,
                  [&](int group, std::size_t channel, int index, float& value) {
                    const std::int32_t symbol = symbols[next++];
                    whole = whole && symbol <= greatest_symbol && symbol >= (group == 1 ? 0 : -greatest_symbol);
                    value = symbol_value(symbol, index, coder.base_step[static_cast<std::size_t>(group)]);
                    if (group < 2) predictor.tell(anchor, channel, symbol, index);
                  });
  }
  if (!whole) return bad_section("STRM", "a scale is negative, or a value beyond the largest symbol");
  return DecodedChunk{symbols.size(), chunk_symbol_hash(symbols, rows), chunk_value_hash(rows)};
}

}  // namespace detail

}  // namespace compmark
