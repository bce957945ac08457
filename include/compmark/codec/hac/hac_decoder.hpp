// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The bytes of a HAC file to a model; what is refused, and what salvage leaves out: decoding.hpp. Chunks decode in
// parallel; the result does not depend on the number of threads. Cost: ~2 us an anchor and core.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/container/decoding.hpp"
#include "compmark/codec/container/geometry.hpp"
#include "compmark/codec/hac/hac_context.hpp"
#include "compmark/codec/hac/hac_format.hpp"

namespace compmark {

/// `path` is for messages.
template <Executor E>
[[nodiscard]] Result<CodecDecoded> decode_hac(std::span<const std::byte> bytes, const std::string& path,
                                              const CodecDecodeSettings& settings, E& executor) {
  const Result<Container> parsed = parse_container(bytes, path, settings.partial);
  if (!parsed) return parsed.error();
  CodecDecoded result;
  CodecModel& model = result.model;
  detail::FileReader reader(*parsed, HacFormat::sections, settings);
  const Result<Done> begun = reader.begin(result);
  if (!begun) return begun.error();
  const Result<Done> expected =
      reader.expect(model, {{0, static_cast<std::size_t>(reader.anchors())}}, executor.concurrency());
  if (!expected) return expected.error();
  const auto geometry = reader.section(HacFormat::geometry);
  if (!geometry) return geometry.error();
  Result<std::vector<Voxel>> voxels = decode_geometry(*geometry, reader.anchors());
  if (!voxels) return reader.located(voxels.error());
  model.voxels = std::move(*voxels);

  IntegerContext context;
  context.heads = model.heads();
  const auto hash = reader.context(HacFormat::hash);
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
  const Result<Done> prepared = reader.prepare(model);
  if (!prepared) return prepared.error();

  const IntegerNetwork::Packed packed = context.network.pack();
  const detail::ChunkCoder coder{context.heads, reader.tables(), model.base_step, model.offset_count};
  detail::for_part(reader.places(), 0, executor, [&](const detail::ChunkPlace& place, std::size_t c) {
    const detail::ChunkRows rows = detail::chunk_rows(model, place.begin, place.end);
    reader.chunk(c, [&](const auto& payload) {
      detail::HacPredictor predictor(context, packed, rows.voxels);
      return detail::decode_chunk(coder, payload(HacFormat::mask), payload(HacFormat::stream), rows, predictor);
    });
  });
  const Result<Done> finished = reader.finish(result);
  if (!finished) return finished.error();
  model.context = std::move(context);
  return result;
}

}  // namespace compmark
