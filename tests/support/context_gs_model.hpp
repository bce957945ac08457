// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A ContextGS model as a codec gets it, for tests and benchmarks: the anchors of codec_model.hpp with a hyperprior,
// networks from a counter, and values drawn level by level from what the model's own context predicts, so that files
// have a real rate.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/codec/context_gs/anchor_cells.hpp"
#include "compmark/codec/context_gs/context_gs_encoder.hpp"
#include "compmark/core/random.hpp"
#include "support/codec_model.hpp"
#include "support/context.hpp"

namespace compmark::testing {

/// One network of so many inputs, as make_float_context has them.
[[nodiscard]] inline TrainedContextGs::Network make_context_gs_network(std::uint64_t seed, std::size_t inputs,
                                                                       std::size_t hidden, const ContextHeads& heads) {
  const Random random(seed, 0, random_stage("context gs network"));
  std::uint64_t next = 0;
  TrainedContextGs::Network network;
  const auto fill = [&](std::vector<float>& values, std::size_t count, double scale) {
    values.resize(count);
    for (float& value : values) value = static_cast<float>(scale * random.normal(next++));
  };
  fill(network.weight1, hidden * inputs, 1.0 / std::sqrt(static_cast<double>(inputs)));
  fill(network.bias1, hidden, 0.2);
  fill(network.weight2, heads.outputs() * hidden, 1.0 / std::sqrt(static_cast<double>(hidden)));
  fill(network.bias2, heads.outputs(), 0.2);
  for (int group = 0; group < 3; ++group) {
    for (std::size_t c = 0; c < heads.width(group); ++c) network.bias2[heads.sigma_row(group) + c] -= 1.5f;
    for (std::size_t j = 0; j < hidden; ++j) network.weight2[heads.r_row(group) * hidden + j] *= 0.5f;
  }
  return network;
}

/// `shape.grid` has no meaning here.
[[nodiscard]] inline CodecModel make_context_gs_model(std::uint64_t seed, const CodecModelShape& shape = {},
                                                      std::size_t channels = 12) {
  CodecModelShape flat = shape;
  flat.grid = {.volume_levels = 0, .plane_levels = 1, .plane_cap_log2 = 6};
  flat.hidden = 4;
  CodecModel model = make_codec_model(seed, flat);  // its values are replaced
  const ContextHeads heads = model.heads();
  TrainedContextGs trained;
  trained.statistics = model.trained->statistics;
  trained.box = model.trained->box;
  model.trained.reset();
  std::vector<Voxel> unmasked;
  for (std::size_t i = 0; i < model.anchors(); ++i) {
    if (model.mask[i] != 0) unmasked.push_back(model.voxels[i]);
  }
  trained.cells = choose_anchor_cells(unmasked);
  trained.hidden = shape.hidden;
  for (std::size_t level = 0; level < 3; ++level) {
    trained.network[level] = make_context_gs_network(
        seed + 100 * level, IntegerContextGs::inputs(level, heads, channels), shape.hidden, heads);
  }
  // z: Gaussians of several widths, some beyond the window.
  const Random random(seed, 2, random_stage("context gs model"));
  std::uint64_t draw = 0;
  model.hyperprior.resize(model.anchors() * channels);
  for (std::size_t i = 0; i < model.hyperprior.size(); ++i) {
    const double width = 0.3 * static_cast<double>(1 + i % channels);
    model.hyperprior[i] = static_cast<std::int32_t>(std::lround(width * random.normal(draw++)));
    if (i % 997 == 5) model.hyperprior[i] *= 40;
  }
  for (std::size_t c = 0; c < channels; ++c) {
    const double width = 0.3 * static_cast<double>(1 + c);
    const auto below = [&](double x) { return 0.5 * std::erfc(-x / width / std::sqrt(2.0)); };
    for (int k = -HyperpriorFormat::window; k <= HyperpriorFormat::window; ++k)
      trained.prior.push_back(below(k + 0.5) - below(k - 0.5));
  }
  model.trained_gs = std::move(trained);

  const Result<IntegerContextGs> context = detail::context_gs_of(model, WeightBits::all(14));
  if (!context) return {};
  VoxelRange range;
  CodecReport report;
  const std::vector<std::uint32_t> rows = detail::coded_rows(model, range, report);
  std::vector<Voxel> voxels;
  for (const std::uint32_t row : rows) voxels.push_back(model.voxels[row]);
  const detail::ContextGsOrder order = detail::context_gs_order(voxels, context->cells);
  std::vector<std::uint32_t> coding(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) coding[i] = rows[order.row[i]];
  const CodecModel coded = detail::take_rows(model, coding);
  std::vector<std::int16_t> seen(static_cast<std::size_t>(order.counts[2] + order.counts[1]) * context->geometry());
  const ContextGsRows all = detail::context_gs_rows(coded, order, seen);
  const ContextGsEvaluator::Packed packed = detail::pack_networks(*context);
  const std::size_t d = heads.width(0), k3 = heads.width(2);
  std::vector<SymbolModel> models(std::max({d, k3, std::size_t{6}}));
  std::size_t begin = 0;
  for (const detail::LevelRange& level : order.ranges()) {
    ContextGsEvaluator evaluator(*context, packed, all, level.part, begin);
    detail::for_predicted(evaluator, level.count, [&](std::size_t anchor, std::size_t lane) {
      const std::size_t row = coding[begin + anchor];
      for (int group = 0; group < 3; ++group) {
        const std::size_t width = heads.width(group);
        evaluator.models(group, lane, 0, width, models.data());
        const int index = evaluator.step(group, lane);
        const double base = model.base_step[static_cast<std::size_t>(group)], q = base * std::exp2(index / 16.0);
        float* const out = group == 0   ? model.feature.data() + row * d
                           : group == 1 ? model.scale.data() + row * 6
                                        : model.offset.data() + row * k3;
        for (std::size_t c = 0; c < width; ++c) {
          const double sigma = std::exp2((models[c].sigma_index + GaussianTables::least_level) / 8.0);
          const double value = q * (models[c].mean / 32.0 + sigma * random.normal(draw++));
          out[c] = static_cast<float>(group == 1 ? std::max(value, 0.0) : value);
          if (group < 2) {
            evaluator.tell(anchor, (group == 1 ? d : 0) + c, detail::symbol_of(out[c], index, base).first, index);
          }
        }
      }
    });
    begin += level.count;
  }
  return model;
}

}  // namespace compmark::testing
