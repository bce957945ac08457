// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The bytes of a HAC-plus file to a model; what is refused, and what salvage leaves out: decoding.hpp. Chunks decode in
// parallel; the result does not depend on the number of threads. Cost: ~4 us an anchor and core.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/container/decoding.hpp"
#include "compmark/codec/container/geometry.hpp"
#include "compmark/codec/hac/hac_context.hpp"
#include "compmark/codec/hac_plus/coarse_coding.hpp"
#include "compmark/codec/hac_plus/hac_plus_coding.hpp"
#include "compmark/codec/hac_plus/hac_plus_format.hpp"

namespace compmark {

/// `path` is for messages.
template <Executor E>
[[nodiscard]] Result<CodecDecoded> decode_hac_plus(std::span<const std::byte> bytes, const std::string& path,
                                                   const CodecDecodeSettings& settings, E& executor) {
  const Result<Container> parsed = parse_container(bytes, path, settings.partial);
  if (!parsed) return parsed.error();
  CodecDecoded result;
  CodecModel& model = result.model;
  const bool coarse = parsed->find(HacPlusFormat::step) != nullptr;
  const CodecSections& format = coarse ? HacPlusFormat::sections : HacPlusFormat::one_level;
  detail::FileReader reader(*parsed, format, settings);
  const Result<Done> begun = reader.begin(result);
  if (!begun) return begun.error();
  const Result<Done> expected =
      reader.expect(model, {{0, static_cast<std::size_t>(reader.anchors())}}, executor.concurrency());
  if (!expected) return expected.error();
  const auto geometry = reader.section(HacPlusFormat::geometry);
  if (!geometry) return geometry.error();
  Result<std::vector<Voxel>> voxels = decode_geometry(*geometry, reader.anchors());
  if (!voxels) return reader.located(voxels.error());
  model.voxels = std::move(*voxels);

  IntegerContext context;
  context.heads = model.heads();
  const auto hash = reader.context(HacPlusFormat::hash);
  if (!hash) return hash.error();
  Result<IntegerHashGrid> grid = detail::decode_hash_grid(*hash, model.voxels, executor);
  if (!grid) return reader.located(grid.error());
  context.grid = std::move(*grid);
  Result<IntegerNetwork> network =
      reader.network(static_cast<std::size_t>(context.grid.shape().channels()), context.heads.outputs());
  if (!network) return network.error();
  context.network = std::move(*network);
  const Result<Done> safe = context.check();
  if (!safe) return reader.located(safe.error());
  const auto within = reader.context(HacPlusFormat::intra);
  if (!within) return within.error();
  Result<IntraContext> intra = detail::decode_intra(*within, context.heads.channels());
  if (!intra) return reader.located(intra.error());
  std::optional<CoarseSteps> first_level;  // of a rescued model too, whose rows were taken out of this one
  if (coarse) {
    const auto step = reader.context(HacPlusFormat::step);
    if (!step) return step.error();
    const Result<CoarseSteps> steps = detail::decode_coarse_steps(*step);
    if (!steps) return reader.located(steps.error());
    model.first_level = first_level = *steps;
  }
  const Result<Done> prepared = reader.prepare(model);
  if (!prepared) return prepared.error();

  const IntegerNetwork::Packed packed = context.network.pack();
  const detail::ChunkCoder coder{context.heads, reader.tables(), model.base_step, model.offset_count};
  const IntraContext rough = intra->without_spread();
  detail::for_part(reader.places(), 0, executor, [&](const detail::ChunkPlace& place, std::size_t c) {
    const detail::ChunkRows rows = detail::chunk_rows(model, place.begin, place.end);
    reader.chunk(c, [&](const auto& payload) {
      detail::HacPredictor predictor(context, packed, rows.voxels);
      if (!model.first_level)
        return detail::decode_chunk_within(coder, *intra, payload(HacPlusFormat::mask), payload(HacPlusFormat::stream),
                                           rows, predictor);
      const detail::CoarseChunk chunk{
          payload(HacPlusFormat::mask), payload(HacPlusFormat::coarse),
          reader.refined(c) ? std::optional<std::span<const std::byte>>(payload(HacPlusFormat::stream)) : std::nullopt};
      return detail::decode_chunk_coarse(coder, *intra, rough, *model.first_level, chunk, rows, predictor);
    });
  });
  const Result<Done> finished = reader.finish(result);
  if (!finished) return finished.error();
  model.context = std::move(context);
  model.intra = std::move(*intra);
  model.first_level = first_level;
  return result;
}

}  // namespace compmark
