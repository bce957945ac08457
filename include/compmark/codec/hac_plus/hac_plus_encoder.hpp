// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model with HAC's context to the bytes of a HAC-plus file: the same decoded model as in a HAC file, to the last bit,
// in fewer bytes. What HAC++ (TPAMI 2025) trains, a context inside the anchor, is found here after training
// (intra_fit.hpp) and left out where it does not pay for its own bytes. Cost: that of encode_hac(), ~2 us an anchor
// more, and ~3 s for the weights, on one core (none where the model is that of a file).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "compmark/codec/container/encoding.hpp"
#include "compmark/codec/hac/hac_context.hpp"
#include "compmark/codec/hac_plus/coarse_coding.hpp"
#include "compmark/codec/hac_plus/hac_plus_coding.hpp"
#include "compmark/codec/hac_plus/hac_plus_format.hpp"
#include "compmark/codec/hac_plus/intra_fit.hpp"

namespace compmark {

namespace detail {

/// The symbols of every so-many-th panel of a model's anchors, at most about `most` anchors. The chunks are those of
/// the file, for the anchors beside an anchor.
template <class Predictor>
[[nodiscard]] IntraSample sample_intra(CodecModel& coded, Predictor& predictor, std::size_t most) {
  IntraSample sample;
  sample.channels = coded.heads().channels();
  const std::size_t n = coded.anchors(), stride = n / most + 1;
  const ChunkRows rows = chunk_rows(coded, 0, n);
  NearAnchors near(sample.channels);
  std::vector<std::int32_t> symbol(sample.channels);
  std::vector<HashPrediction> prediction(sample.channels);
  std::vector<std::uint8_t> is_coded(sample.channels);
  for_predicted(predictor, n, [&](std::size_t anchor, std::size_t lane) {
    if (anchor % static_cast<std::size_t>(coded.chunk_anchors) == 0) near = NearAnchors(sample.channels);
    near.begin(rows.voxels[anchor]);
    std::fill(is_coded.begin(), is_coded.end(), std::uint8_t{0});
    visit_predicted(rows, anchor, coded.offset_count, predictor, lane,
                    [&](int group, std::size_t c, int index, const HashPrediction& predicted, float value) {
                      const double base_step = coded.base_step[static_cast<std::size_t>(group)];
                      prediction[c] = predicted;
                      symbol[c] = symbol_of(value, index, base_step).first;
                      is_coded[c] = 1;
                      near.keep(c, symbol_deviation(predicted, symbol[c]));
                    });
    if (anchor / integer_panel % stride != 0) return;
    sample.symbol.insert(sample.symbol.end(), symbol.begin(), symbol.end());
    sample.predicted.insert(sample.predicted.end(), prediction.begin(), prediction.end());
    sample.coded.insert(sample.coded.end(), is_coded.begin(), is_coded.end());
    const std::span<const std::int16_t> around = near.near();
    sample.near.insert(sample.near.end(), around.begin(), around.end());
    sample.near.resize(sample.symbol.size(), std::int16_t{0});
    sample.has_near.push_back(around.empty() ? 0 : 1);
  });
  return sample;
}

/// The weights for a model, or none of them where they cost more bytes than they save.
template <class Predictor>
[[nodiscard]] IntraContext choose_intra(CodecModel& coded, const GaussianTables& tables, Predictor& predictor) {
  constexpr std::size_t most_anchors = 32'768;
  const IntraContext none = IntraContext::none(coded.heads().channels());
  const IntraSample sample = sample_intra(coded, predictor, most_anchors);
  if (sample.anchors() == 0) return none;
  IntraContext fitted = fit_intra(sample);
  const double scale = static_cast<double>(coded.anchors()) / static_cast<double>(sample.anchors());
  const auto bytes = [&](const IntraContext& context) {
    return scale * intra_bits(tables, context, sample) / 8 + static_cast<double>(encode_intra(context).size());
  };
  return bytes(fitted) < bytes(none) ? fitted : none;
}

}  // namespace detail

template <Executor E>
[[nodiscard]] Result<CodecEncoded> encode_hac_plus(const CodecModel& model, const CodecEncodeSettings& settings,
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
  coded.first_level = model.first_level;
  if (coded.first_level && !coded.first_level->valid()) {
    return Error{ErrorKind::invalid, "", "first_level", "is none of 1, 3, 9 and 27 steps, or of one step alone",
                 "leave it out, or make one of the three groups coarser"};
  }
  const CodecSections& format = coded.first_level ? HacPlusFormat::sections : HacPlusFormat::one_level;
  detail::FileWriter writer(format, coded, places);
  const Result<Done> fits = writer.check();
  if (!fits) return fits.error();
  writer.begin(tables, coded.voxels, range);
  const std::vector<std::uint8_t> seen = detail::seen_entries(context->grid, coded.voxels, executor);
  writer.add_context(HacPlusFormat::hash, detail::encode_hash_grid(context->grid, seen),
                     static_cast<std::uint64_t>(std::count(seen.begin(), seen.end(), 1)));
  writer.add_network(context->network);

  const IntegerNetwork::Packed packed = context->network.pack();
  const std::size_t channels = context->heads.channels();
  IntraContext intra;
  if (model.intra && model.intra->channels != 0) {
    if (model.intra->channels != channels)
      return detail::no_context("the one inside the anchor is of other attributes");
    intra = *model.intra;
  } else {
    detail::HacPredictor predictor(*context, packed, coded.voxels);
    intra = detail::choose_intra(coded, tables, predictor);
  }
  writer.add_context(HacPlusFormat::intra, detail::encode_intra(intra),
                     2 * IntraContext::weights(channels) + 4 * channels);
  if (coded.first_level) writer.add_context(HacPlusFormat::step, detail::encode_coarse_steps(*coded.first_level), 3);
  Result<std::vector<CodecTensor>> renderers = writer.add_renderers();
  if (!renderers) return renderers.error();
  coded.networks = std::move(*renderers);

  const detail::ChunkCoder coder{context->heads, tables, coded.base_step, coded.offset_count};
  const IntraContext rough = intra.without_spread();
  std::vector<detail::EncodedChunk> chunks(places.size());
  detail::for_part(places, 0, executor, [&](const detail::ChunkPlace& place, std::size_t c) {
    const detail::ChunkRows chunk = detail::chunk_rows(coded, place.begin, place.end);
    detail::HacPredictor predictor(*context, packed, chunk.voxels);
    chunks[c] = coded.first_level
                    ? detail::encode_chunk_coarse(coder, intra, rough, *coded.first_level, chunk, predictor)
                    : detail::encode_chunk_within(coder, intra, chunk, predictor);
  });
  Result<std::vector<std::byte>> bytes = writer.finish(std::move(chunks), 0, result.report);
  if (!bytes) return bytes.error();
  result.bytes = std::move(*bytes);
  coded.context = std::move(*context);
  coded.intra = std::move(intra);
  return result;
}

}  // namespace compmark
