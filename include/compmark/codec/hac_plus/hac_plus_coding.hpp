// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One chunk of anchors, to bytes and back, with the context inside the anchor. What chunk_coding.hpp does for the other
// codecs, with the same bytes of masks and the same order and coder of symbols; but the model of a symbol is known only
// when the symbols before it are. Cost: ~4 us an anchor each way.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/codec/coder/symbol_coder.hpp"
#include "compmark/codec/coder/symbol_reader.hpp"
#include "compmark/codec/container/chunk_coding.hpp"
#include "compmark/codec/container/mask_coding.hpp"
#include "compmark/codec/integer/intra_context.hpp"
#include "compmark/codec/integer/near_anchors.hpp"
#include "compmark/core/result.hpp"

namespace compmark::detail {

/// use(group, channel, index in the group, step index, HashPrediction, value) for the scalars of an anchor, in order.
template <class Use>
void visit_predicted(const ChunkRows& rows, std::size_t anchor, int offset_count, const PanelModels& panel,
                     std::size_t lane, const Use& use) {
  const ContextHeads& heads = panel.heads();
  std::array<std::size_t, 3> first{}, last{};
  std::array<std::int64_t, 3> reciprocal{};
  std::size_t channel = 0;
  for (std::size_t g = 0; g < 3; ++g) {
    first[g] = channel;
    channel += heads.width(static_cast<int>(g));
    last[g] = channel;
    reciprocal[g] = step_reciprocal(panel.step(static_cast<int>(g), lane));
  }
  const std::span<const std::int32_t> outputs = panel.outputs();
  visit_scalars(rows, anchor, offset_count, panel, lane, [&](int group, std::size_t c, int index, float& value) {
    const std::size_t within = c - first[static_cast<std::size_t>(group)];
    const HashPrediction predicted =
        HashPrediction::of(outputs[(heads.mean_row(group) + within) * integer_panel + lane],
                           outputs[(heads.sigma_row(group) + within) * integer_panel + lane], index,
                           reciprocal[static_cast<std::size_t>(group)]);
    use(group, c, index, predicted, value);
  });
}

/// As encode_chunk().
template <class Predictor>
[[nodiscard]] EncodedChunk encode_chunk_within(const ChunkCoder& coder, const IntraContext& intra,
                                               const ChunkRows& rows, Predictor& predictor) {
  EncodedChunk chunk;
  std::vector<SymbolModel> models;
  std::vector<std::int32_t> symbols;
  IntraState state(intra);
  NearAnchors near(intra.channels);
  const std::size_t n = rows.voxels.size(), k = static_cast<std::size_t>(coder.offset_count);
  for_predicted(predictor, n, [&](std::size_t anchor, std::size_t lane) {
    for (std::size_t o = 0; o < k; ++o) {
      if ((rows.mask[anchor] >> o & 1u) == 0) std::fill_n(rows.offset.data() + (anchor * k + o) * 3, 3, 0.0f);
    }
    near.begin(rows.voxels[anchor]);
    state.begin(near.near());
    visit_predicted(rows, anchor, coder.offset_count, predictor, lane,
                    [&](int group, std::size_t channel, int index, const HashPrediction& predicted, float& value) {
                      const auto g = static_cast<std::size_t>(group);
                      const std::pair<std::int32_t, bool> rounded = symbol_of(value, index, coder.base_step[g]);
                      const std::int32_t symbol = rounded.first;
                      models.push_back(state.model(channel, predicted));
                      chunk.clamped[g] += rounded.second ? 1 : 0;
                      ++chunk.symbols[g];
                      chunk.bits[g] += ideal_bits(coder.tables, models.back(), symbol);
                      symbols.push_back(symbol);
                      value = symbol_value(symbol, index, coder.base_step[g]);
                      near.keep(channel, state.tell(channel, predicted, symbol));
                    });
  });
  write_chunk(coder, models, symbols, rows, chunk);
  return chunk;
}

/// As decode_chunk().
template <class Predictor>
[[nodiscard]] Result<DecodedChunk> decode_chunk_within(const ChunkCoder& coder, const IntraContext& intra,
                                                       std::span<const std::byte> mask,
                                                       std::span<const std::byte> stream, const ChunkRows& rows,
                                                       Predictor& predictor) {
  const Result<Done> masks = decode_masks(mask, coder.offset_count, rows.mask);
  if (!masks) return masks.error();
  const std::size_t n = rows.voxels.size();
  std::size_t count = n * (coder.heads.width(0) + 6);
  for (const std::uint32_t bits : rows.mask) count += 3 * static_cast<std::size_t>(std::popcount(bits));
  SymbolReader reader(coder.tables, octets(stream));
  if (const Result<Done> begun = reader.check(count); !begun) return begun.error();
  std::vector<std::int32_t> symbols;
  symbols.reserve(count);
  IntraState state(intra);
  NearAnchors near(intra.channels);
  bool whole = true;
  for_predicted(predictor, n, [&](std::size_t anchor, std::size_t lane) {
    near.begin(rows.voxels[anchor]);
    state.begin(near.near());
    visit_predicted(rows, anchor, coder.offset_count, predictor, lane,
                    [&](int group, std::size_t channel, int index, const HashPrediction& predicted, float& value) {
                      const std::int32_t symbol = reader.next(state.model(channel, predicted));
                      symbols.push_back(symbol);
                      whole = whole && symbol <= greatest_symbol && symbol >= (group == 1 ? 0 : -greatest_symbol);
                      value = symbol_value(symbol, index, coder.base_step[static_cast<std::size_t>(group)]);
                      near.keep(channel, state.tell(channel, predicted, symbol));
                    });
  });
  if (const Result<Done> finished = reader.finish(symbols); !finished) return finished.error();
  if (!whole) return bad_section("STRM", "a scale is negative, or a value beyond the largest symbol");
  return DecodedChunk{symbols.size(), chunk_symbol_hash(symbols, rows), chunk_value_hash(rows)};
}

}  // namespace compmark::detail
