// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The context of a file from that of training, and how many bits its weights get. Every bit a weight is 3 KB of a file; too few bits cost rate.
// How many is different for the parts of the network, so each part is tried with 5 to 14 bits, the others kept fine, on a sample of a
// thousand anchors, and gets those that make the file smallest; the parts hardly meet. On a trained lego of 600 KB this takes 1 %
// off what the best common number gives. Cost: 0.2 s of one core, in parallel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "compmark/codec/codec_model.hpp"
#include "compmark/codec/hac_chunk.hpp"
#include "compmark/codec/network_coding.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"

namespace compmark::inline v0::detail {

/// The integer context of a model: the one it has, or its trained one in integers of these bits.
[[nodiscard]] inline Result<IntegerContext> context_of(const CodecModel& model, const WeightBits& bits) {
  const auto fail = [](std::string problem) {
    return Error{ErrorKind::invalid, "", "context", std::move(problem), "train it with a codec's recipe"};
  };
  IntegerContext context;
  if (model.context) {
    context = *model.context;
  } else if (model.trained) {
    const TrainedContext& trained = *model.trained;
    if (!trained.shape.valid()) return fail("the hash grid's shape is not valid");
    if (trained.signs.size() != trained.shape.entries())
      return fail("the hash grid does not have the entries of its shape");
    const VoxelBox box = make_voxel_box(trained.box, model.voxel_size);
    if (!box.valid()) return fail("its box is not finite, inverted or too far away");
    context.heads = model.heads();
    context.grid = IntegerHashGrid(trained.shape, box);
    for (std::size_t i = 0; i < trained.signs.size(); ++i) context.grid.entries()[i] = trained.signs[i] & 15u;
    IntegerNetworkSettings network;
    network.bits = bits;
    network.base_step = model.base_step;
    const FloatContext floats{static_cast<std::size_t>(trained.shape.channels()),
                              trained.hidden,
                              trained.weight1,
                              trained.bias1,
                              trained.weight2,
                              trained.bias2,
                              trained.statistics};
    Result<IntegerNetwork> integers = quantize_network(floats, context.heads, network);
    if (!integers) return integers.error();
    context.network = std::move(*integers);
  } else {
    return fail("the model has none");
  }
  if (context.heads.outputs() != model.heads().outputs() || context.heads.feature != model.feature_dim) {
    return fail("it is that of other attributes");
  }
  const Result<Done> checked = context.check();
  if (!checked) return checked.error();
  return context;
}

/// Rows of every so-many-th panel, about a thousand anchors.
[[nodiscard]] inline CodecModel sampled_anchors(const CodecModel& model) {
  CodecModel sample;
  sample.feature_dim = model.feature_dim;
  sample.offset_count = model.offset_count;
  const std::size_t n = model.anchors(), stride = std::max<std::size_t>(1, n / 1024) * integer_panel;
  const auto d = static_cast<std::size_t>(model.feature_dim), k3 = 3 * static_cast<std::size_t>(model.offset_count);
  for (std::size_t first = 0; first < n; first += stride) {
    for (std::size_t i = first; i < std::min<std::size_t>(first + integer_panel, n); ++i) {
      const auto copy = [&](const std::vector<float>& from, std::vector<float>& to, std::size_t width) {
        to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(i * width),
                  from.begin() + static_cast<std::ptrdiff_t>((i + 1) * width));
      };
      sample.voxels.push_back(model.voxels[i]);
      sample.mask.push_back(model.mask[i]);
      copy(model.feature, sample.feature, d);
      copy(model.extent, sample.extent, 6);
      copy(model.offset, sample.offset, k3);
    }
  }
  return sample;
}

/// What the symbols of a sample cost, at the given steps (one entry a panel) instead of the context's own: with these, a context that makes
/// steps a little larger would look like one that predicts better. Without any, `steps` receives those of this context.
[[nodiscard]] inline double sample_bits(const ChunkCoder& coder, CodecModel& sample,
                                        std::vector<ContextEvaluator::Steps>& steps) {
  const ChunkRows rows = chunk_rows(sample, 0, sample.anchors());
  ContextEvaluator evaluator(coder.context, coder.packed);
  std::vector<SymbolModel> models;
  double bits = 0;
  const bool given = !steps.empty();
  for (std::size_t first = 0; first < rows.voxels.size(); first += integer_panel) {
    const std::size_t count = std::min<std::size_t>(integer_panel, rows.voxels.size() - first);
    evaluator.evaluate(rows.voxels.subspan(first, count));
    if (given) {
      evaluator.set_steps(steps[first / integer_panel]);
    } else {
      steps.push_back(evaluator.steps());
    }
    for (std::size_t lane = 0; lane < count; ++lane) {
      models.clear();
      append_models(evaluator, coder.context.heads, rows.mask[first + lane], lane, models);
      const SymbolModel* model = models.data();
      visit_scalars(rows, first + lane, coder.offset_count, evaluator, lane, [&](int group, int index, float value) {
        const double base_step = coder.base_step[static_cast<std::size_t>(group)];
        bits += ideal_bits(coder.tables, *model++, symbol_of(value, index, base_step).first);
      });
    }
  }
  return bits;
}

/// Sums of the network's outputs over a sample, by row.
[[nodiscard]] inline std::vector<double> output_sums(const IntegerContext& context, const CodecModel& sample) {
  const IntegerNetwork::Packed packed = context.network.pack();
  ContextEvaluator evaluator(context, packed);
  std::vector<double> sums(context.heads.outputs(), 0);
  const std::span<const Voxel> voxels = sample.voxels;
  for (std::size_t first = 0; first < voxels.size(); first += integer_panel) {
    const std::size_t count = std::min<std::size_t>(integer_panel, voxels.size() - first);
    evaluator.evaluate(voxels.subspan(first, count));
    for (std::size_t row = 0; row < sums.size(); ++row) {
      for (std::size_t lane = 0; lane < count; ++lane) sums[row] += evaluator.outputs()[row * integer_panel + lane];
    }
  }
  return sums;
}

/// Moves the biases of the coarse network's second layer so that on the sample each output is what the fine network's is in the mean: what
/// rounding a few thousand weights shifts is the same for all anchors, and would make all steps a little larger or smaller.
inline void match_means(const IntegerContext& fine, const CodecModel& sample, IntegerContext& coarse) {
  const std::vector<double> wanted = output_sums(fine, sample), found = output_sums(coarse, sample);
  const std::vector<std::int32_t> before = coarse.network.output.bias;
  for (std::size_t row = 0; row < wanted.size(); ++row) {
    const double shift = (wanted[row] - found[row]) / static_cast<double>(sample.anchors());
    const double bias = before[row] + std::nearbyint(std::ldexp(shift, coarse.network.output.shift[row]));
    if (std::abs(bias) < 0x1p30) coarse.network.output.bias[row] = static_cast<std::int32_t>(bias);
  }
  if (!coarse.check()) coarse.network.output.bias = before;
}

/// The context for the coded anchors, with the bits asked for or with those that make the smallest file.
template <Executor E>
[[nodiscard]] Result<IntegerContext> choose_context(const CodecModel& model, const CodecModel& coded,
                                                    const GaussianTables& tables,
                                                    const std::optional<WeightBits>& asked, E& executor) {
  constexpr int fine = 16, least = 5, greatest = 14, tried = greatest - least + 1, parts = 7;
  if (model.context || asked || coded.anchors() == 0) return context_of(model, asked.value_or(WeightBits::all(10)));
  const auto part = [](WeightBits& bits, std::size_t i) -> int& {
    return i == 0 ? bits.hidden : i < 4 ? bits.mean[i - 1] : bits.deviation[i - 4];
  };
  CodecModel sample = sampled_anchors(coded);
  const double scale = static_cast<double>(coded.anchors()) / static_cast<double>(sample.anchors());
  std::vector<ContextEvaluator::Steps> steps;
  const auto cost = [&](const WeightBits& bits, std::vector<ContextEvaluator::Steps>& at) {
    const Result<IntegerContext> context = context_of(model, bits);
    if (!context) return std::numeric_limits<double>::infinity();
    const IntegerNetwork::Packed packed = context->network.pack();
    const ChunkCoder coder{*context, packed, tables, model.base_step, model.offset_count};
    return static_cast<double>(encode_context_network(context->network).size()) +
           scale * sample_bits(coder, sample, at) / 8;
  };
  (void)cost(WeightBits::all(fine), steps);
  std::vector<double> bytes(parts * tried);
  executor.for_chunks(bytes.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
    WeightBits bits = WeightBits::all(fine);
    part(bits, i / tried) = least + static_cast<int>(i % tried);
    bytes[i] = cost(bits, steps);
  });
  WeightBits best;
  for (std::size_t p = 0; p < parts; ++p) {
    const auto* first = bytes.data() + p * tried;
    part(best, p) = least + static_cast<int>(std::min_element(first, first + tried) - first);
  }
  Result<IntegerContext> chosen = context_of(model, best);
  const Result<IntegerContext> finest = context_of(model, WeightBits::all(fine));
  if (!chosen) return chosen.error();
  if (finest) match_means(*finest, sample, *chosen);
  return chosen;
}

}  // namespace compmark::inline v0::detail
