// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Makes the integer context of a ContextGS file from the trained one. Cells, scales and prior stay; the three networks
// get the bits that make the smallest file (network_choice.hpp). The inputs of the networks of levels 1 and 0 depend on
// the rounded levels above them, so those levels are coded once with fine networks first, to have the sample's inputs.
// Cost: 0.5 s of one core, in parallel.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/container/chunk_coding.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/container/network_choice.hpp"
#include "compmark/codec/context_gs/context_gs_format.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"

namespace compmark::detail {

[[nodiscard]] inline Error no_context_gs(std::string problem) {
  return {ErrorKind::invalid, "", "context", std::move(problem), "train it with recipe context_gs"};
}

/// The trained context in whole numbers, but for its networks.
template <class Model>
[[nodiscard]] Result<IntegerContextGs> trained_levels(const Model& model) {
  if (!model.trained_gs) return no_context_gs("the model has none");
  const TrainedContextGs& trained = *model.trained_gs;
  IntegerContextGs context;
  context.heads = model.heads();
  context.cells = trained.cells;
  context.box = make_voxel_box(trained.box, model.voxel_size);
  if (!context.box.valid()) return no_context_gs("its box is not finite, inverted or too far away");
  if (context.cells.fine < 1 || context.cells.coarse < 1) return no_context_gs("an edge of its cells is not positive");
  const std::size_t scalars = context.heads.channels();
  if (trained.statistics.size() != 2 * scalars) return no_context_gs("its statistics are those of other attributes");
  for (std::size_t c = 0; c < context.geometry(); ++c) {
    const double mean = trained.statistics[c], deviation = trained.statistics[scalars + c];
    if (!std::isfinite(mean) || !(deviation > 0 && std::isfinite(deviation)))
      return no_context_gs("its statistics are not finite, or a deviation is not positive");
    context.seen.push_back(seen_scale(mean, deviation, model.base_step[c < context.heads.width(0) ? 0 : 1]));
  }
  context.channels = trained.prior.size() / HyperpriorFormat::slots;
  if (context.channels < 1 || context.channels > HyperpriorFormat::most_channels ||
      trained.prior.size() % HyperpriorFormat::slots != 0) {
    return no_context_gs("its prior does not have 31 probabilities for each of 1 to 64 channels");
  }
  for (std::size_t c = 0; c < context.channels; ++c) {
    const Result<std::vector<std::uint16_t>> frequencies = hyperprior_frequencies(
        std::span<const double>(trained.prior).subspan(c * HyperpriorFormat::slots, HyperpriorFormat::slots));
    if (!frequencies) return frequencies.error();
    context.prior.insert(context.prior.end(), frequencies->begin(), frequencies->end());
  }
  return context;
}
[[nodiscard]] inline FloatContext float_context(const TrainedContextGs& trained, std::size_t level,
                                                std::size_t inputs) {
  const TrainedContextGs::Network& n = trained.network[level];
  return {inputs, trained.hidden, n.weight1, n.bias1, n.weight2, n.bias2, trained.statistics};
}
template <class Model>
[[nodiscard]] IntegerNetworkSettings context_gs_network_settings(const Model& model) {
  IntegerNetworkSettings settings;
  settings.base_step = model.base_step;
  settings.input_bits = IntegerContextGs::input_bits;
  settings.most_input = IntegerContextGs::most_input;
  settings.usual_input = 4 << IntegerContextGs::input_bits;
  return settings;
}
/// All networks in integers of these bits.
template <class Model>
[[nodiscard]] Result<Done> quantize_levels(const Model& model, const WeightBits& bits, IntegerContextGs& context) {
  IntegerNetworkSettings settings = context_gs_network_settings(model);
  settings.bits = bits;
  for (std::size_t level = 0; level < IntegerContextGs::levels; ++level) {
    Result<IntegerNetwork> network =
        quantize_network(float_context(*model.trained_gs, level, context.inputs(level)), context.heads, settings);
    if (!network) return network.error();
    context.network[level] = std::move(*network);
  }
  return Done{};
}
template <class Model>
[[nodiscard]] Result<Done> check_context(const IntegerContextGs& context, const Model& model) {
  if (context.heads.outputs() != model.heads().outputs() || context.heads.feature != model.feature_dim)
    return no_context_gs("it is that of other attributes");
  if (model.hyperprior.size() != model.anchors() * context.channels)
    return no_context_gs("the anchors do not have a symbol for each channel of its prior");
  return context.check();
}

/// The context of a model: the one it has, or its trained one with networks of `bits`.
template <class Model>
[[nodiscard]] Result<IntegerContextGs> context_gs_of(const Model& model, const WeightBits& bits) {
  Result<IntegerContextGs> context =
      model.context_gs ? Result<IntegerContextGs>(*model.context_gs) : trained_levels(model);
  if (!context) return context;
  if (!model.context_gs) {
    const Result<Done> quantized = quantize_levels(model, bits, *context);
    if (!quantized) return quantized.error();
  }
  const Result<Done> checked = check_context(*context, model);
  if (!checked) return checked.error();
  return context;
}
template <class Context>
[[nodiscard]] ContextGsEvaluator::Packed pack_networks(const Context& context) {
  return {context.network[0].pack(), context.network[1].pack(), context.network[2].pack()};
}

/// The anchors, as all chunks read them; `seen` has room for those of levels 2 and 1.
[[nodiscard]] inline ContextGsRows context_gs_rows(const CodecModel& coded, const ContextGsOrder& order,
                                                   std::span<std::int16_t> seen) {
  return {coded.voxels, order.parent, coded.hyperprior, seen};
}

/// Replaces networks of 16 bits by those that make the smallest file. `coded` is in the order of coding.
template <Executor E>
[[nodiscard]] Result<Done> choose_networks(const CodecModel& model, const CodecModel& coded,
                                           const ContextGsOrder& order, const GaussianTables& tables,
                                           IntegerContextGs& context, E& executor) {
  constexpr int least = 2;  // three networks: 4 cost a trained file of 390 KB 1.6 %
  const IntegerContextGs fine = context;
  const ContextGsEvaluator::Packed packed = pack_networks(fine);
  std::vector<std::int16_t> seen(static_cast<std::size_t>(order.counts[2] + order.counts[1]) * fine.geometry());
  const ContextGsRows rows = context_gs_rows(coded, order, seen);
  const ChunkCoder coder{fine.heads, tables, coded.base_step, coded.offset_count};
  const IntegerNetworkSettings settings = context_gs_network_settings(model);
  std::size_t begin = 0;
  for (const LevelRange& range : order.ranges()) {
    const std::size_t level = range.part, end = begin + range.count;
    const FloatContext floats = float_context(*model.trained_gs, level, fine.inputs(level));
    if (range.count == 0) {  // the network is never used
      IntegerNetworkSettings small = settings;
      small.bits = WeightBits::all(least);
      Result<IntegerNetwork> network = quantize_network(floats, fine.heads, small);
      if (!network) return network.error();
      context.network[level] = std::move(*network);
      continue;
    }
    ContextGsEvaluator evaluator(fine, packed, rows, level, begin);
    NetworkSample sample = sample_network(coded, begin, end, evaluator);
    Result<IntegerNetwork> network = choose_network(floats, settings, coder, sample, least, executor);
    if (!network) return network.error();
    context.network[level] = std::move(*network);
    if (level > 0) {  // what its children will read
      executor.for_chunks(range.count, 1024, [&](std::size_t first, std::size_t last, std::size_t) {
        CodecModel part;
        add_rows(coded, begin + first, last - first, part);
        const ChunkRows values = chunk_rows(part, 0, last - first);
        ContextGsEvaluator teller(fine, packed, rows, level, begin + first);
        for_predicted(teller, last - first, [&](std::size_t anchor, std::size_t lane) {
          visit_scalars(values, anchor, coder.offset_count, teller, lane,
                        [&](int group, std::size_t channel, int index, float value) {
                          if (group == 2) return;
                          const double base_step = coder.base_step[static_cast<std::size_t>(group)];
                          teller.tell(anchor, channel, symbol_of(value, index, base_step).first, index);
                        });
        });
      });
    }
    begin = end;
  }
  return Done{};
}

}  // namespace compmark::detail
