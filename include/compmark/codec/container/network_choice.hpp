// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// How many bits the weights of a context network get. Every bit a weight is 3 KB of a file; too few bits cost rate. The
// best number differs between the parts of the network. So each part is tried with 5 (ContextGS: 2) to 14 bits on a
// sample of a thousand anchors, while the others are kept fine, and gets the number that makes the file smallest; the
// choice for one part hardly depends on the others. On a trained lego of 600 KB this takes 1 % off what the best common
// number gives. Cost: 0.2 s of one core, in parallel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "compmark/codec/container/chunk_coding.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/container/network_coding.hpp"
#include "compmark/codec/integer/integer_quantize.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"

namespace compmark::detail {

/// Anchors and what the network reads of them, panel by panel.
struct NetworkSample {
  CodecModel rows;
  std::vector<std::int16_t> inputs;
  double anchors = 0;  ///< that the sample stands for
};

/// Adds rows [first, first + count) of `model`, all that coding looks at.
template <class Model>
void add_rows(const Model& model, std::size_t first, std::size_t count, Model& rows) {
  const auto d = static_cast<std::size_t>(model.feature_dim), k3 = 3 * static_cast<std::size_t>(model.offset_count);
  rows.feature_dim = model.feature_dim;
  rows.offset_count = model.offset_count;
  const auto copy = [&](const auto& from, auto& to, std::size_t width) {
    to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(first * width),
              from.begin() + static_cast<std::ptrdiff_t>((first + count) * width));
  };
  copy(model.voxels, rows.voxels, 1);
  copy(model.mask, rows.mask, 1);
  copy(model.feature, rows.feature, d);
  copy(model.scale, rows.scale, 6);
  copy(model.offset, rows.offset, k3);
}

/// Every so-many-th panel of rows [begin, end), about a thousand anchors. `predictor` counts anchors from `begin` on.
template <class Predictor>
[[nodiscard]] NetworkSample sample_network(const CodecModel& model, std::size_t begin, std::size_t end,
                                           Predictor& predictor) {
  NetworkSample sample;
  const std::size_t n = end - begin, stride = std::max<std::size_t>(1, n / 1024) * integer_panel;
  for (std::size_t first = 0; first < n; first += stride) {
    const std::size_t count = std::min<std::size_t>(integer_panel, n - first);
    add_rows(model, begin + first, count, sample.rows);
    predictor.look(first, count);
    sample.inputs.insert(sample.inputs.end(), predictor.inputs().begin(), predictor.inputs().end());
  }
  sample.anchors = static_cast<double>(n);
  return sample;
}

/// The network of a sample, on the sample's inputs.
class SamplePredictor : public PanelModels {
 public:
  SamplePredictor(const IntegerNetwork& network, const IntegerNetwork::Packed& packed, const ContextHeads& heads,
                  const NetworkSample& sample)
      : PanelModels(heads),
        network_(&network),
        packed_(&packed),
        sample_(&sample) {
    const std::size_t panels = (sample.rows.anchors() + integer_panel - 1) / integer_panel;
    panel_.input.resize(panels == 0 ? 0 : sample.inputs.size() / panels);
  }
  void look(std::size_t first, std::size_t count) {
    std::copy_n(sample_->inputs.begin() + static_cast<std::ptrdiff_t>(first / integer_panel * panel_.input.size()),
                panel_.input.size(), panel_.input.begin());
    run(*network_, *packed_, count);
  }

 private:
  const IntegerNetwork* network_;
  const IntegerNetwork::Packed* packed_;
  const NetworkSample* sample_;
};

/// What the symbols of a sample cost, at the given steps (one entry a panel) instead of the predictor's own: with
/// these, a network that makes steps a little larger would look like one that predicts better. Without any, `steps`
/// receives those of this predictor.
template <class Predictor, class Steps>
[[nodiscard]] double sample_bits(const ChunkCoder& coder, const ChunkRows& rows, Predictor& predictor, Steps& steps) {
  std::vector<SymbolModel> models;
  double bits = 0;
  const bool given = !steps.empty();
  for_predicted(predictor, rows.voxels.size(), [&](std::size_t anchor, std::size_t lane) {
    if (lane == 0) {
      if (given) predictor.set_steps(steps[anchor / integer_panel]);
      if (!given) steps.push_back(predictor.steps());
    }
    models.clear();
    append_models(predictor, coder.heads, rows.mask[anchor], lane, models);
    const SymbolModel* model = models.data();
    visit_scalars(rows, anchor, coder.offset_count, predictor, lane,
                  [&](int group, std::size_t, int index, float value) {
                    const double base_step = coder.base_step[static_cast<std::size_t>(group)];
                    bits += ideal_bits(coder.tables, *model++, symbol_of(value, index, base_step).first);
                  });
  });
  return bits;
}

/// Sums of the network's outputs over a sample, by row.
template <class Network>
[[nodiscard]] std::vector<double> output_sums(const Network& network, const ContextHeads& heads,
                                              const NetworkSample& sample) {
  const IntegerNetwork::Packed packed = network.pack();
  SamplePredictor predictor(network, packed, heads, sample);
  std::vector<double> sums(heads.outputs(), 0);
  for (std::size_t first = 0; first < sample.rows.anchors(); first += integer_panel) {
    const std::size_t count = std::min<std::size_t>(integer_panel, sample.rows.anchors() - first);
    predictor.look(first, count);
    for (std::size_t row = 0; row < sums.size(); ++row) {
      for (std::size_t lane = 0; lane < count; ++lane) sums[row] += predictor.outputs()[row * integer_panel + lane];
    }
  }
  return sums;
}

/// Moves the biases of the coarse network's second layer so that each output has the fine network's mean on the sample.
/// Rounding a few thousand weights shifts an output by the same amount for all anchors, which would make all steps a
/// little larger or smaller.
template <class Network>
void match_means(const Network& fine, const ContextHeads& heads, const NetworkSample& sample, std::int64_t most_input,
                 Network& coarse) {
  const std::vector<double> wanted = output_sums(fine, heads, sample), found = output_sums(coarse, heads, sample);
  const std::vector<std::int32_t> before = coarse.output.bias;
  for (std::size_t row = 0; row < wanted.size(); ++row) {
    const double shift = (wanted[row] - found[row]) / static_cast<double>(sample.rows.anchors());
    const double bias = before[row] + std::nearbyint(std::ldexp(shift, coarse.output.shift[row]));
    if (std::abs(bias) < 0x1p30) coarse.output.bias[row] = static_cast<std::int32_t>(bias);
  }
  if (!coarse.check(coarse.hidden.inputs, heads, most_input)) coarse.output.bias = before;
}

/// The network in the bits that make the smallest file, at least `least` a weight. `settings` says all but the bits.
/// The sample is not empty.
template <Executor E>
[[nodiscard]] Result<IntegerNetwork> choose_network(const FloatContext& floats, const IntegerNetworkSettings& settings,
                                                    const ChunkCoder& coder, NetworkSample& sample, int least,
                                                    E& executor) {
  constexpr int fine = 16, greatest = 14;
  constexpr std::size_t parts = 7;
  const auto tried = static_cast<std::size_t>(greatest - least + 1);
  const auto part = [](WeightBits& bits, std::size_t i) -> int& {
    return i == 0 ? bits.hidden : i < 4 ? bits.mean[i - 1] : bits.deviation[i - 4];
  };
  const auto network_of = [&](const WeightBits& bits) {
    IntegerNetworkSettings with = settings;
    with.bits = bits;
    return quantize_network(floats, coder.heads, with);
  };
  const double scale = sample.anchors / static_cast<double>(sample.rows.anchors());
  const ChunkRows rows = chunk_rows(sample.rows, 0, sample.rows.anchors());
  std::vector<PanelModels::Steps> steps;
  const auto cost = [&](const WeightBits& bits) {
    const Result<IntegerNetwork> network = network_of(bits);
    if (!network) return std::numeric_limits<double>::infinity();
    const IntegerNetwork::Packed packed = network->pack();
    SamplePredictor predictor(*network, packed, coder.heads, sample);
    return static_cast<double>(encode_context_network(*network).size()) +
           scale * sample_bits(coder, rows, predictor, steps) / 8;
  };
  (void)cost(WeightBits::all(fine));
  std::vector<double> bytes(parts * tried);
  executor.for_chunks(bytes.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    WeightBits bits = WeightBits::all(fine);
    part(bits, i / tried) = least + static_cast<int>(i % tried);
    bytes[i] = cost(bits);
  });
  WeightBits best;
  for (std::size_t p = 0; p < parts; ++p) {
    const auto* first = bytes.data() + p * tried;
    part(best, p) = least + static_cast<int>(std::min_element(first, first + tried) - first);
  }
  Result<IntegerNetwork> chosen = network_of(best);
  const Result<IntegerNetwork> finest = network_of(WeightBits::all(fine));
  if (!chosen) return chosen.error();
  if (finest) match_means(*finest, coder.heads, sample, settings.most_input, *chosen);
  return chosen;
}

}  // namespace compmark::detail
