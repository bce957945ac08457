// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The bytes of a ContextGS file to a model (decoding.hpp says what is refused). Levels follow one another, the chunks
// of a level decode in parallel, and the result does not depend on the number of threads. A chunk is one stream of
// symbols, which cannot be read without the models of all symbols before. With salvage, a damaged chunk therefore loses
// its own anchors and every chunk in which an anchor has a lost parent: damage at level 0 costs one chunk, damage at
// level 2 may cost most of the file. A truncated file gives its complete levels (partial). Cost: ~2.5 us an anchor and
// core.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/container/decoding.hpp"
#include "compmark/codec/container/geometry.hpp"
#include "compmark/codec/context_gs/context_gs_context.hpp"
#include "compmark/codec/context_gs/context_gs_format.hpp"

namespace compmark {

/// `path` is for messages.
template <Executor E>
[[nodiscard]] Result<CodecDecoded> decode_context_gs(std::span<const std::byte> bytes, const std::string& path,
                                                     const CodecDecodeSettings& settings, E& executor) {
  const Result<Container> parsed = parse_container(bytes, path, settings.partial);
  if (!parsed) return parsed.error();
  CodecDecoded result;
  CodecModel& model = result.model;
  detail::FileReader reader(*parsed, ContextGsFormat::sections, settings);
  const Result<Done> begun = reader.begin(result);
  if (!begun) return begun.error();

  IntegerContextGs context;
  context.heads = model.heads();
  const auto cells = reader.context(ContextGsFormat::levels);
  if (!cells) return cells.error();
  const Result<detail::LevelCounts> counts = detail::decode_levels(*cells, reader.anchors(), context);
  if (!counts) return reader.located(counts.error());
  const auto prior = reader.context(ContextGsFormat::prior);
  if (!prior) return prior.error();
  const Result<Done> frequencies = detail::decode_prior(*prior, context);
  if (!frequencies) return reader.located(frequencies.error());
  detail::ContextGsOrder order;
  order.counts = *counts;
  const Result<Done> expected = reader.expect(model, order.ranges(), executor.concurrency(), context.channels);
  if (!expected) return expected.error();

  const auto geometry = reader.section(ContextGsFormat::geometry);
  if (!geometry) return geometry.error();
  const Result<std::vector<Voxel>> voxels = decode_geometry(*geometry, reader.anchors());
  if (!voxels) return reader.located(voxels.error());
  order = detail::context_gs_order(*voxels, context.cells);
  if (order.counts != *counts) return reader.malformed("LVLS", "its levels are not those of the anchors");
  for (std::size_t i = 0; i < reader.arrived_anchors(); ++i) model.voxels.push_back((*voxels)[order.row[i]]);
  for (std::uint32_t level = 3; level-- > 0;) {
    Result<IntegerNetwork> network = reader.network(context.inputs(level), context.heads.outputs(), level);
    if (!network) return network.error();
    context.network[level] = std::move(*network);
  }
  const Result<Done> safe = context.check();
  if (!safe) return reader.located(safe.error());
  const Result<Done> prepared = reader.prepare(model);
  if (!prepared) return prepared.error();
  model.hyperprior.resize(model.anchors() * context.channels);

  const ContextGsEvaluator::Packed packed = detail::pack_networks(context);
  const HyperpriorTables hyperprior(context.prior);
  std::vector<std::int16_t> seen(static_cast<std::size_t>(order.counts[2] + order.counts[1]) * context.geometry());
  const ContextGsRows all = detail::context_gs_rows(model, order, seen);
  const detail::ChunkCoder coder{context.heads, reader.tables(), model.base_step, model.offset_count};
  std::vector<std::uint8_t> unknown(seen.size() / context.geometry(), 0);  // rows that are lost
  for (std::uint32_t level = 3; level-- > 0;) {
    detail::for_part(reader.places(), level, executor, [&](const detail::ChunkPlace& place, std::size_t c) {
      const detail::ChunkRows rows = detail::chunk_rows(model, place.begin, place.end);
      reader.chunk(c, [&](const auto& payload) -> Result<detail::DecodedChunk> {
        for (std::size_t i = place.begin; level < 2 && i < place.end; ++i) {
          if (unknown[order.parent[i]] != 0) {
            return Error{ErrorKind::malformed, "", "STRM",
                         "is whole, but anchors of level " + std::to_string(level + 1) +
                             " or above that predict some of its own are lost",
                         "copy the file again"};
          }
        }
        if (reader.entry(ContextGsFormat::hyperprior, c).items != rows.hyperprior.size())
          return detail::bad_section("HYPR", "does not have a symbol for each channel of each anchor");
        const Result<Done> known =
            detail::decode_hyperprior(hyperprior, payload(ContextGsFormat::hyperprior), rows.hyperprior);
        if (!known) return known.error();
        ContextGsEvaluator predictor(context, packed, all, level, place.begin);
        return detail::decode_chunk(coder, payload(ContextGsFormat::mask), payload(ContextGsFormat::stream), rows,
                                    predictor);
      });
      for (std::size_t i = place.begin; reader.lost(c) && level > 0 && i < place.end; ++i) unknown[i] = 1;
    });
  }
  const Result<Done> finished = reader.finish(result);
  if (!finished) return finished.error();
  model.context_gs = std::move(context);
  return result;
}

}  // namespace compmark
