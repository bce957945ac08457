// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The context of a trained model in the form that a codec compresses: that of HacModel with the signs of its hash grid,
// or that of ContextGsModel with the symbols of z and the probabilities of its prior. Cost: a copy of the networks, 31
// probabilities a channel of z.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/context_gs/context_gs_parameters.hpp"
#include "compmark/codec/model/coded_views.hpp"
#include "compmark/codec/rate/stages/rate.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/training/model.hpp"

namespace compmark::detail {

template <class T>
[[nodiscard]] std::vector<float> coded_floats(MatrixView<const T> values) {
  std::vector<float> copy(values.size());
  for (std::size_t i = 0; i < copy.size(); ++i) copy[i] = static_cast<float>(values.data[i]);
  return copy;
}
/// Statistics of a context that has begun.
[[nodiscard]] inline Result<Done> check_statistics(const std::vector<float>& statistics) {
  for (std::size_t c = statistics.size() / 2; c < statistics.size(); ++c) {
    if (statistics[c] > 0) continue;
    return coded_error("context.statistics",
                       "are empty: the model was decompressed, or stopped before its context began",
                       "copy the compressed file, or train on");
  }
  return Done{};
}

/// The second layer of a context's network as a file holds it: of a codec whose steps are the base steps alone, r is
/// zero in its last three outputs.
template <Recipe R>
void clear_fixed_steps([[maybe_unused]] std::vector<float>& weight, [[maybe_unused]] std::vector<float>& bias) {
  if constexpr (RecipeEntropyModel<R>::base_steps_alone) {
    std::fill(weight.end() - static_cast<std::ptrdiff_t>(3 * (weight.size() / bias.size())), weight.end(), 0.0f);
    std::fill(bias.end() - 3, bias.end(), 0.0f);
  }
}

/// The context of HacModel.
template <Recipe R>
  requires requires { R::EntropyModel::shape.volume_levels; }
[[nodiscard]] Result<Done> store_context(const Model<R>& model, CodecModel& coded) {
  const auto& rate = model.template blocks<RateStage>();
  const auto block = [&](BlockHandle handle) { return coded_floats(model.arena.values(handle)); };
  TrainedContext context;
  context.shape = R::EntropyModel::shape;
  const std::vector<float> box = block(rate.box), grid = block(rate.grid);
  std::copy_n(box.begin(), 6, context.box.begin());
  context.signs.resize(grid.size() / 4);
  for (std::size_t e = 0; e < context.signs.size(); ++e) {
    for (std::size_t f = 0; f < 4; ++f) {
      if (grid[4 * e + f] >= 0) context.signs[e] = static_cast<std::uint8_t>(context.signs[e] | 1u << f);
    }
  }
  context.hidden = static_cast<std::size_t>(R::EntropyModel::hidden);
  context.weight1 = block(rate.weight1);
  context.bias1 = block(rate.bias1);
  context.weight2 = block(rate.weight2);
  context.bias2 = block(rate.bias2);
  clear_fixed_steps<R>(context.weight2, context.bias2);
  context.statistics = block(rate.statistics);
  coded.trained = std::move(context);
  return check_statistics(coded.trained->statistics);
}
/// The context of ContextGsModel, with the symbols of z and the probabilities of its prior that coding needs.
template <Recipe R>
  requires requires { R::EntropyModel::Prior::channels; }
[[nodiscard]] Result<Done> store_context(const Model<R>& model, CodecModel& coded) {
  using Scalar = typename R::Scalar;
  using Prior = typename R::EntropyModel::Prior;
  const auto& rate = model.template blocks<RateStage>();
  const auto block = [&](BlockHandle handle) { return coded_floats(model.arena.values(handle)); };
  TrainedContextGs context;
  context.statistics = block(rate.statistics);
  if (const Result<Done> begun = check_statistics(context.statistics); !begun) return begun.error();
  const MatrixView<const Scalar> cells = model.arena.values(rate.cells);
  for (std::size_t i = 0; i < 2; ++i) {
    if (!(cells(0, i) >= 1 && cells(0, i) < Scalar(0x1p31))) {
      return coded_error("context_gs.cells", "are not edges of cells", "train its context again");
    }
  }
  context.cells = anchor_cells<Scalar>(cells);
  const std::vector<float> box = block(rate.box);
  std::copy_n(box.begin(), 6, context.box.begin());
  context.hidden = static_cast<std::size_t>(R::EntropyModel::hidden);
  for (std::size_t level = 0; level < 3; ++level) {
    const auto& network = rate.network[level];
    context.network[level] = {block(network.weight1), block(network.bias1), block(network.weight2),
                              block(network.bias2)};
    clear_fixed_steps<R>(context.network[level].weight2, context.network[level].bias2);
  }
  std::vector<Scalar> ready(Prior::count);
  Prior::prepare(model.arena.values(rate.prior), ready.data());
  for (int channel = 0; channel < Prior::channels; ++channel) {
    for (int k = -hyperprior_window; k <= hyperprior_window; ++k) {
      context.prior.push_back(
          static_cast<double>(Prior::probability(ready.data() + channel * Prior::parameters, static_cast<Scalar>(k))));
    }
  }
  coded.trained_gs = std::move(context);
  const MatrixView<const Scalar> z = model.arena.values(rate.hyperprior);
  coded.hyperprior.resize(z.size());
  for (std::size_t i = 0; i < z.size(); ++i) {
    const Scalar value = z.data[i];
    coded.hyperprior[i] = std::abs(value) < Scalar(1e6) ? static_cast<std::int32_t>(std::nearbyint(value)) : 0;
  }
  return Done{};
}

}  // namespace compmark::detail
