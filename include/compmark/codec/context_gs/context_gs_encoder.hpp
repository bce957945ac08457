// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model with a trained ContextGS context to the bytes of its file (NeurIPS 2024; docs/spec/compression.md, 2.5 and
// 3.2), which decode without anything else. Besides the bytes it returns the model as every decoder will have it, to
// the last bit: anchors of level 2 first, then 1, then 0. Levels follow one another, because children read what their
// parents were rounded to; the chunks of a level are encoded in parallel and joined in order: same bytes at any thread
// count. Cost: ~6 us an anchor and core, and 0.5 s for the bits of the networks' weights.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/codec/container/encoding.hpp"
#include "compmark/codec/context_gs/context_gs_context.hpp"
#include "compmark/codec/context_gs/context_gs_format.hpp"

namespace compmark {

template <Executor E>
[[nodiscard]] Result<CodecEncoded> encode_context_gs(const CodecModel& model, const CodecEncodeSettings& settings,
                                                     E& executor) {
  const Result<Done> checked = detail::check_codec_model(model);
  if (!checked) return checked.error();
  Result<IntegerContextGs> context = detail::context_gs_of(model, settings.weight_bits.value_or(WeightBits::all(16)));
  if (!context) return context.error();
  CodecEncoded result;
  CodecReport& report = result.report;
  VoxelRange range;
  std::vector<std::uint32_t> rows = detail::coded_rows(model, range, report);
  std::vector<Voxel> voxels;
  for (const std::uint32_t row : rows) voxels.push_back(model.voxels[row]);
  detail::ContextGsOrder order = detail::context_gs_order(voxels, context->cells);
  report.level_anchors = order.counts;
  std::vector<std::uint32_t> coding_order(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) coding_order[i] = rows[order.row[i]];
  result.model = detail::take_rows(model, coding_order);
  CodecModel& coded = result.model;
  const GaussianTables tables;
  if (!model.context_gs && !settings.weight_bits) {
    const Result<Done> chosen = detail::choose_networks(model, coded, order, tables, *context, executor);
    if (!chosen) return chosen.error();
  }

  const std::vector<detail::ChunkPlace> places =
      detail::chunk_places(order.ranges(), static_cast<std::size_t>(coded.chunk_anchors));
  detail::FileWriter writer(ContextGsFormat::sections, coded, places);
  const Result<Done> fits = writer.check();
  if (!fits) return fits.error();
  writer.begin(tables, voxels, range);
  writer.add_context(ContextGsFormat::levels, detail::encode_levels(*context, order.counts), 3);
  writer.add_context(ContextGsFormat::prior, detail::encode_prior(*context), context->prior.size());
  for (std::uint32_t level = 3; level-- > 0;) writer.add_network(context->network[level], level);
  Result<std::vector<CodecTensor>> renderers = writer.add_renderers();
  if (!renderers) return renderers.error();
  coded.networks = std::move(*renderers);

  const ContextGsEvaluator::Packed packed = detail::pack_networks(*context);
  const HyperpriorTables hyperprior(context->prior);
  std::vector<std::int16_t> seen(static_cast<std::size_t>(order.counts[2] + order.counts[1]) * context->geometry());
  const ContextGsRows all = detail::context_gs_rows(coded, order, seen);
  const detail::ChunkCoder coder{context->heads, tables, coded.base_step, coded.offset_count};
  std::vector<detail::EncodedChunk> chunks(places.size());
  for (std::uint32_t level = 3; level-- > 0;) {
    detail::for_part(places, level, executor, [&](const detail::ChunkPlace& place, std::size_t c) {
      const detail::ChunkRows chunk = detail::chunk_rows(coded, place.begin, place.end);
      ContextGsEvaluator predictor(*context, packed, all, level, place.begin);
      chunks[c] = detail::encode_chunk(coder, chunk, predictor);
      chunks[c].hyperprior_bits = detail::encode_hyperprior(hyperprior, chunk.hyperprior, chunks[c].hyperprior);
    });
  }
  Result<std::vector<std::byte>> bytes =
      writer.finish(std::move(chunks), coded.anchors() == 0 ? 0 : ContextGsFormat::hyperprior, report);
  if (!bytes) return bytes.error();
  result.bytes = std::move(*bytes);
  coded.context_gs = std::move(*context);
  return result;
}

}  // namespace compmark
