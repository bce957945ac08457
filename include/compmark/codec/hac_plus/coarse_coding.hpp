// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One chunk of anchors in two levels, to bytes and back. The first has of every scalar the coarse bin (coarse_bins.hpp)
// and is a model by itself: each value lies where it is to be expected within its bin. The second says which bin of the
// coarse one it is, and then the chunk is what hac_plus_coding.hpp makes of it, to the last bit. The context of the
// first level knows coarse values alone and is the same but for the spreads, which they would mislead; that of the
// second is the context of a file of one level. Cost: ~8 us an anchor each way.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "compmark/codec/coder/bits.hpp"
#include "compmark/codec/hac_plus/hac_plus_coding.hpp"
#include "compmark/codec/integer/coarse_bins.hpp"
#include "compmark/core/result.hpp"

namespace compmark::detail {

/// The least symbol of a group: scales are not negative.
[[nodiscard]] constexpr std::int32_t least_symbol(std::size_t group) { return group == 1 ? 0 : -greatest_symbol; }

/// What is known of an anchor and of those near it while the first level is coded.
class CoarseState {
 public:
  /// All must outlive this. `rough`: IntraContext::without_spread().
  CoarseState(const GaussianTables& tables, const IntraContext& rough, const CoarseSteps& steps)
      : tables_(tables),
        steps_(steps),
        state_(rough),
        near_(rough.channels) {}

  void begin(const Voxel& voxel) {
    near_.begin(voxel);
    state_.begin(near_.near());
  }
  /// The model of the coarse bin of a scalar after all before it were told.
  [[nodiscard]] SymbolModel model(std::size_t group, std::size_t channel, const HashPrediction& predicted) {
    fine_ = state_.model(channel, predicted);
    return coarse_model(fine_.mean, predicted.level, steps_.thirds[group]);
  }
  /// Tells the coarse bin of the scalar that model() was asked for; returns where its symbol is to be expected, in 1/32
  /// bin.
  std::int64_t tell(std::size_t group, std::size_t channel, const HashPrediction& predicted, std::int32_t coarse) {
    const std::int32_t width = steps_.width(group);
    const std::int64_t place =
        width == 1 ? 32 * std::int64_t{coarse} : CoarseBin(tables_, fine_, coarse, width, least_symbol(group)).middle();
    near_.keep(channel, state_.tell(channel, place_deviation(predicted, place)));
    return place;
  }

 private:
  const GaussianTables& tables_;
  const CoarseSteps& steps_;
  IntraState state_;
  NearAnchors near_;
  SymbolModel fine_;
};

/// The value of a place in 1/32 bin: an exact integer product below 2^53, one product of doubles, one rounding.
[[nodiscard]] inline float place_value(std::int64_t place, int index, double base_step) {
  return static_cast<float>(static_cast<double>(place * step_ratio(index)) * (base_step * 0x1p-29));
}

/// As encode_chunk_within(), with the first level beside the stream.
template <class Predictor>
[[nodiscard]] EncodedChunk encode_chunk_coarse(const ChunkCoder& coder, const IntraContext& intra,
                                               const IntraContext& rough, const CoarseSteps& steps,
                                               const ChunkRows& rows, Predictor& predictor) {
  EncodedChunk chunk;
  std::vector<SymbolModel> models;
  std::vector<std::int32_t> coarse_symbols, symbols;
  BitsOut refining;
  IntraState state(intra);
  NearAnchors near(intra.channels);
  CoarseState coarse(coder.tables, rough, steps);
  const std::size_t n = rows.voxels.size(), k = static_cast<std::size_t>(coder.offset_count);
  for_predicted(predictor, n, [&](std::size_t anchor, std::size_t lane) {
    for (std::size_t o = 0; o < k; ++o) {
      if ((rows.mask[anchor] >> o & 1u) == 0) std::fill_n(rows.offset.data() + (anchor * k + o) * 3, 3, 0.0f);
    }
    near.begin(rows.voxels[anchor]);
    state.begin(near.near());
    coarse.begin(rows.voxels[anchor]);
    visit_predicted(
        rows, anchor, coder.offset_count, predictor, lane,
        [&](int group, std::size_t channel, int index, const HashPrediction& predicted, float& value) {
          const auto g = static_cast<std::size_t>(group);
          const std::pair<std::int32_t, bool> rounded = symbol_of(value, index, coder.base_step[g]);
          const std::int32_t symbol = rounded.first, width = steps.width(g), whole = coarse_symbol(symbol, width);
          models.push_back(coarse.model(g, channel, predicted));
          coarse_symbols.push_back(whole);
          chunk.clamped[g] += rounded.second ? 1 : 0;
          ++chunk.symbols[g];
          chunk.bits[g] += ideal_bits(coder.tables, models.back(), whole);
          coarse.tell(g, channel, predicted, whole);
          if (width > 1) {
            const CoarseBin bin(coder.tables, state.model(channel, predicted), whole, width, least_symbol(g));
            (void)bin.code(refining, symbol);
            chunk.bits[g] -= std::log2(bin.probability(symbol));
            ++chunk.refined;
          }
          symbols.push_back(symbol);
          value = symbol_value(symbol, index, coder.base_step[g]);
          near.keep(channel, state.tell(channel, predicted, symbol));
        });
  });
  write_chunk(coder, models, coarse_symbols, rows, chunk);
  chunk.coarse = std::move(chunk.stream);
  chunk.stream = refining.finish();
  chunk.symbol_hash = chunk_symbol_hash(symbols, rows);
  return chunk;
}

/// The payloads of a chunk; the stream may not have arrived.
struct CoarseChunk {
  std::span<const std::byte> mask, coarse;
  std::optional<std::span<const std::byte>> stream;
};

/// As decode_chunk_within(). Without the stream the rows are those of the first level.
template <class Predictor>
[[nodiscard]] Result<DecodedChunk> decode_chunk_coarse(const ChunkCoder& coder, const IntraContext& intra,
                                                       const IntraContext& rough, const CoarseSteps& steps,
                                                       const CoarseChunk& chunk, const ChunkRows& rows,
                                                       Predictor& predictor) {
  const Result<Done> masks = decode_masks(chunk.mask, coder.offset_count, rows.mask);
  if (!masks) return masks.error();
  const std::size_t n = rows.voxels.size();
  std::size_t offsets = 0;
  for (const std::uint32_t bits : rows.mask) offsets += 3 * static_cast<std::size_t>(std::popcount(bits));
  const std::size_t count = n * (coder.heads.width(0) + 6) + offsets;
  SymbolReader reader(coder.tables, octets(chunk.coarse));
  if (const Result<Done> begun = reader.check(count); !begun) return begun.error();
  std::vector<std::int32_t> coarse_symbols;
  coarse_symbols.reserve(count);
  CoarseState coarse(coder.tables, rough, steps);
  bool whole = true;
  for_predicted(predictor, n, [&](std::size_t anchor, std::size_t lane) {
    coarse.begin(rows.voxels[anchor]);
    visit_predicted(rows, anchor, coder.offset_count, predictor, lane,
                    [&](int group, std::size_t channel, int index, const HashPrediction& predicted, float& value) {
                      const auto g = static_cast<std::size_t>(group);
                      const std::int32_t width = steps.width(g), most = coarse_symbol(greatest_symbol, width);
                      const std::int32_t symbol = reader.next(coarse.model(g, channel, predicted));
                      coarse_symbols.push_back(symbol);
                      const bool fits = symbol <= most && symbol >= (g == 1 ? 0 : -most);
                      whole = whole && fits;
                      const std::int64_t place = coarse.tell(g, channel, predicted, fits ? symbol : 0);
                      value = place_value(place, index, coder.base_step[g]);
                    });
  });
  if (const Result<Done> finished = reader.finish(coarse_symbols); !finished) return finished.error();
  if (!whole) return bad_section("COAR", "a scale is negative, or a value beyond the largest symbol");
  DecodedChunk decoded;
  decoded.symbol_count = count;
  for (std::size_t g = 0; g < 3; ++g) {
    const std::size_t of_group = g == 2 ? offsets : n * coder.heads.width(static_cast<int>(g));
    decoded.refined += steps.width(g) > 1 ? of_group : 0;
  }
  decoded.is_coarse = !chunk.stream.has_value();
  if (decoded.is_coarse) return decoded;

  BitsIn bits(*chunk.stream);
  IntraState state(intra);
  NearAnchors near(intra.channels);
  std::vector<std::int32_t> symbols;
  symbols.reserve(count);
  for_predicted(predictor, n, [&](std::size_t anchor, std::size_t lane) {
    near.begin(rows.voxels[anchor]);
    state.begin(near.near());
    visit_predicted(rows, anchor, coder.offset_count, predictor, lane,
                    [&](int group, std::size_t channel, int index, const HashPrediction& predicted, float& value) {
                      const auto g = static_cast<std::size_t>(group);
                      const std::int32_t width = steps.width(g);
                      std::int32_t symbol = coarse_symbols[symbols.size()];
                      if (width > 1) {
                        const SymbolModel model = state.model(channel, predicted);
                        symbol = CoarseBin(coder.tables, model, symbol, width, least_symbol(g)).code(bits, 0);
                      }
                      symbols.push_back(symbol);
                      whole = whole && symbol <= greatest_symbol && symbol >= least_symbol(g);
                      value = symbol_value(symbol, index, coder.base_step[g]);
                      near.keep(channel, state.tell(channel, predicted, symbol));
                    });
  });
  if (!bits.complete()) return bad_section("STRM", "its symbols do not end where its bytes do");
  if (!whole) return bad_section("STRM", "a value is beyond the largest symbol");
  decoded.symbol_hash = chunk_symbol_hash(symbols, rows);
  decoded.value_hash = chunk_value_hash(rows);
  return decoded;
}

}  // namespace compmark::detail
