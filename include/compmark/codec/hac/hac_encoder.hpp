// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model with a trained context to the bytes of a HAC file (ECCV 2024; docs/spec/compression.md, 1.9 and 3.2), which
// decode without anything else. Besides the bytes it returns the model as every decoder will have it, to the last bit,
// and a report of what took how many bytes. Chunks are encoded in parallel and joined in order: same bytes at any
// thread count. Cost: ~5 us an anchor and core, and 0.25 s for finding how many bits the context's weights need (none
// when they are given, or when the context is that of a file).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "compmark/codec/container/encoding.hpp"
#include "compmark/codec/hac/hac_context.hpp"
#include "compmark/codec/hac/hac_format.hpp"

namespace compmark {

template <Executor E>
[[nodiscard]] Result<CodecEncoded> encode_hac(const CodecModel& model, const CodecEncodeSettings& settings,
                                              E& executor) {
  const Result<Done> checked = detail::check_codec_model(model);
  if (!checked) return checked.error();
  CodecEncoded result;
  VoxelRange range;
  const std::vector<std::uint32_t> rows = detail::coded_rows(model, range, result.report);
  result.model = detail::take_rows(model, rows);
  CodecModel& coded = result.model;
  coded.hyperprior.clear();
  const GaussianTables tables;
  Result<IntegerContext> context = detail::choose_context(model, coded, tables, settings.weight_bits, executor);
  if (!context) return context.error();
  const std::array<detail::LevelRange, 1> levels{{{0, coded.anchors()}}};
  const std::vector<detail::ChunkPlace> places =
      detail::chunk_places(levels, static_cast<std::size_t>(coded.chunk_anchors));
  detail::FileWriter writer(HacFormat::sections, coded, places);
  const Result<Done> fits = writer.check();
  if (!fits) return fits.error();
  writer.begin(tables, coded.voxels, range);
  const std::vector<std::uint8_t> seen = detail::seen_entries(context->grid, coded.voxels, executor);
  writer.add_context(HacFormat::hash, detail::encode_hash_grid(context->grid, seen),
                     static_cast<std::uint64_t>(std::count(seen.begin(), seen.end(), 1)));
  writer.add_network(context->network);
  Result<std::vector<CodecTensor>> renderers = writer.add_renderers();
  if (!renderers) return renderers.error();
  coded.networks = std::move(*renderers);

  const IntegerNetwork::Packed packed = context->network.pack();
  const detail::ChunkCoder coder{context->heads, tables, coded.base_step, coded.offset_count};
  std::vector<detail::EncodedChunk> chunks(places.size());
  detail::for_part(places, 0, executor, [&](const detail::ChunkPlace& place, std::size_t c) {
    const detail::ChunkRows chunk = detail::chunk_rows(coded, place.begin, place.end);
    detail::HacPredictor predictor(*context, packed, chunk.voxels);
    chunks[c] = detail::encode_chunk(coder, chunk, predictor);
  });
  Result<std::vector<std::byte>> bytes = writer.finish(std::move(chunks), 0, result.report);
  if (!bytes) return bytes.error();
  result.bytes = std::move(*bytes);
  coded.context = std::move(*context);
  return result;
}

}  // namespace compmark
