// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Makes a trained model use the networks of its compressed file, to train on after a first compression (a message in a
// file, docs/notebook/watermark_experiments.md). Training then rounds exactly as the file does (rate.hpp). It needs the
// file's own networks for that: their weights have few bits, and a step that is a sixteenth of an octave longer changes
// the symbol of every value near the border of two. Cost: a copy of the networks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/context_gs/context_gs_context.hpp"
#include "compmark/codec/integer/integer_quantize.hpp"
#include "compmark/codec/model/coded_context.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/codec/rate/stages/rate.hpp"
#include "compmark/core/result.hpp"
#include "compmark/splat/training/model.hpp"

namespace compmark {

namespace detail {

template <class T>
[[nodiscard]] bool fill_block(ParameterArena<T>& arena, BlockHandle handle, std::span<const float> values) {
  const MatrixView<T> block = arena.values(handle);
  if (block.size() != values.size()) return false;
  std::copy(values.begin(), values.end(), block.data);
  return true;
}
template <class T, class Handles>
[[nodiscard]] bool fill_network(ParameterArena<T>& arena, const Handles& to, const FloatNetwork& from) {
  return fill_block(arena, to.weight1, from.weight1) && fill_block(arena, to.bias1, from.bias1) &&
         fill_block(arena, to.weight2, from.weight2) && fill_block(arena, to.bias2, from.bias2);
}

}  // namespace detail

/// Replaces the networks of a trained model, those that render and those of its context, by those of its file: `file`
/// is the model of CodecEncoded or CodecDecoded. If the file belongs to another model this is an Error, and the model
/// is unchanged or replaced in part.
template <Recipe R>
  requires present<typename R::EntropyModel>
[[nodiscard]] Result<Done> adopt_networks(const CodecModel& file, Model<R>& model) {
  const Result<LoadedModel<R>> read = model_from<R>(file);
  if (!read) return read.error();
  const ParameterArena<typename R::Scalar>& from = read->model.arena;
  const auto other = [] {
    return detail::coded_error("context", "is that of another model", "give the file that was made of this one");
  };
  for (const ArenaLayout::Block& part : model.arena.layout().blocks()) {
    if (part.kind != RowKind::fixed || part.role == BlockRole::context) continue;
    const auto& blocks = from.layout().blocks();
    const auto same = std::find_if(blocks.begin(), blocks.end(),
                                   [&](const ArenaLayout::Block& block) { return block.name == part.name; });
    if (same == blocks.end() || same->size() != part.size()) return other();
    std::copy_n(from.all_values().begin() + static_cast<std::ptrdiff_t>(same->offset), part.size(),
                model.arena.all_values().begin() + static_cast<std::ptrdiff_t>(part.offset));
  }
  auto& rate = model.template blocks<RateStage>();
  const std::vector<float> statistics = detail::coded_floats(std::as_const(model.arena).values(rate.statistics));
  if (statistics.size() != 2 * file.heads().channels()) return other();
  if constexpr (requires { R::EntropyModel::shape.volume_levels; }) {
    if (!file.context) return other();
    IntegerNetworkSettings settings;
    settings.base_step = file.base_step;
    if (!detail::fill_network(model.arena, rate,
                              float_network(file.context->network, file.context->heads, statistics, settings)))
      return other();
  } else {
    if (!file.context_gs) return other();
    const IntegerNetworkSettings settings = detail::context_gs_network_settings(file);
    for (std::size_t level = 0; level < IntegerContextGs::levels; ++level) {
      if (!detail::fill_network(
              model.arena, rate.network[level],
              float_network(file.context_gs->network[level], file.context_gs->heads, statistics, settings)))
        return other();
    }
  }
  return Done{};
}

/// Halves the weights of the outputs that choose the steps of a ContextGS file, wherever their sums could exceed half
/// of what 32 bits hold, so that training has room to move their biases (codec/model/step_bias_calibration.hpp). Call
/// it before adopt_networks. The weights lose their last bit: the steps of some anchors differ by a sixteenth of an
/// octave from the file's, and the mean of a level by less than .02 (step_bias_calibration.test).
inline void leave_room_for_steps(CodecModel& file) {
  if (!file.context_gs) return;
  for (IntegerNetwork& network : file.context_gs->network) {
    IntegerLayer& layer = network.output;
    const std::vector<std::int64_t> most = network.most_hidden(IntegerContextGs::most_input);
    for (int group = 0; group < 3; ++group) {
      const std::size_t row = file.context_gs->heads.r_row(group);
      if (IntegerNetwork::most_sum(layer, row, most) <= std::int64_t{1} << 30) continue;
      const auto halved = [](auto value) { return static_cast<decltype(value)>(std::nearbyint(0.5 * value)); };
      for (std::size_t i = row * layer.inputs; i < (row + 1) * layer.inputs; ++i)
        layer.weight[i] = halved(layer.weight[i]);
      layer.bias[row] = halved(layer.bias[row]);
      layer.shift[row] = static_cast<std::int8_t>(layer.shift[row] - 1);
    }
  }
}

/// Codes a trained model with the very context of `file`, whose networks it adopted, except for the biases of the steps
/// where training has moved them.
inline void keep_context(const CodecModel& file, CodecModel& coded) {
  coded.context = file.context;
  coded.context_gs = file.context_gs;
  coded.first_level = file.first_level;
  if (file.intra) coded.intra.emplace();  // its weights are found anew: they are those of the attributes
  const std::optional<TrainedContextGs>& trained = coded.trained_gs;
  if (!trained || !coded.context_gs) return;
  for (std::size_t level = 0; level < IntegerContextGs::levels; ++level) {
    IntegerNetwork& network = coded.context_gs->network[level];
    IntegerLayer& layer = network.output;
    const std::vector<std::int64_t> most = network.most_hidden(IntegerContextGs::most_input);
    for (int group = 0; group < 3; ++group) {
      const std::size_t row = coded.context_gs->heads.r_row(group);
      const int exponent = layer.shift[row] + IntegerNetwork::r_bits;
      const float now = trained->network[level].bias2[row];
      // A float does not hold the last bits of a bias above 2^24: biases that did not move keep the file's value.
      if (now == static_cast<float>(std::ldexp(static_cast<double>(layer.bias[row]), -exponent))) continue;
      // Beyond the room that leave_room_for_steps made, a step is clipped rather than the file refused.
      layer.bias[row] = 0;
      const std::int64_t weights = IntegerNetwork::most_sum(layer, row, most);
      const double room = weights < 0 ? 0 : static_cast<double>(std::numeric_limits<std::int32_t>::max() - weights);
      layer.bias[row] = static_cast<std::int32_t>(
          std::llround(std::clamp(std::ldexp(static_cast<double>(now), exponent), -room, room)));
    }
  }
}

}  // namespace compmark
