// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The whole context of an anchor in whole numbers, from its voxel to the step and the Gaussian of each scalar, as the
// symbol coder takes them (docs/spec/compression.md, 3.2, points 1 to 5): voxel -> hash grid -> network -> step index
// of each attribute group, deviation in eighths of an octave of bins, mean in 1/32 bins. Encoder and decoder both ask
// this and nothing else. Cost: ~1.2 us an anchor.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/codec/coder/gaussian_tables.hpp"
#include "compmark/codec/integer/integer_functions.hpp"
#include "compmark/codec/integer/integer_hash_grid.hpp"
#include "compmark/codec/integer/integer_network.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

/// What a file stores of its context.
struct IntegerContext {
  ContextHeads heads;
  IntegerHashGrid grid;
  IntegerNetwork network;

  [[nodiscard]] Result<Done> check() const {
    if (!grid.box().valid()) {
      return Error{ErrorKind::invalid, "", "HASH", "the context's box is not finite, inverted or too far away",
                   "encode the model again"};
    }
    return network.check(static_cast<std::size_t>(grid.shape().channels()), heads);
  }
};

/// The outputs of a network for the anchors of a panel: steps and models of their scalars.
class PanelModels {
 public:
  explicit PanelModels(const ContextHeads& heads) : heads_(heads) {}

  /// Step index of a group: q = Q0 2^(index / 16).
  [[nodiscard]] int step(int group, std::size_t lane) const { return step_[static_cast<std::size_t>(group)][lane]; }
  using Steps = std::array<std::array<std::int8_t, integer_panel>, 3>;
  /// All of the panel's, to be put back later.
  [[nodiscard]] const Steps& steps() const { return step_; }
  void set_steps(const Steps& steps) { step_ = steps; }

  /// The inputs of the network, [channel / 2][lane][2], and its outputs, [row][lane].
  [[nodiscard]] std::span<const std::int16_t> inputs() const { return panel_.input; }
  [[nodiscard]] std::span<const std::int32_t> outputs() const { return panel_.output; }
  [[nodiscard]] const ContextHeads& heads() const { return heads_; }

  /// Models of `count` channels of a group from `first` on.
  void models(int group, std::size_t lane, std::size_t first, std::size_t count, SymbolModel* out) const {
    const int index = step(group, lane);
    const std::int64_t reciprocal = step_reciprocal(index);
    const std::int32_t* mean = panel_.output.data() + (heads_.mean_row(group) + first) * integer_panel + lane;
    const std::int32_t* sigma = panel_.output.data() + (heads_.sigma_row(group) + first) * integer_panel + lane;
    for (std::size_t c = 0; c < count; ++c)
      out[c] = model(mean[c * integer_panel], sigma[c * integer_panel], index, reciprocal);
  }

  /// A mean in units of Q0 (Q12) and 8 log2(sigma / Q0) (Q8), at a step: the model in bins.
  [[nodiscard]] static SymbolModel model(std::int32_t mean, std::int32_t sigma, int index, std::int64_t reciprocal) {
    constexpr int to_32nds = IntegerNetwork::mean_bits + StepGrid::fraction_bits - 5;
    constexpr std::int64_t half = std::int64_t{1} << (to_32nds - 1), mean_limit = 1 << 29;
    const std::int64_t phase = (mean * reciprocal + half) >> to_32nds;
    // 8 log2(sigma / q) = 8 log2(sigma / Q0) - index / 2
    const std::int64_t level = ((std::int64_t{sigma} - index * (1 << (IntegerNetwork::sigma_bits - 1)) +
                                 (1 << (IntegerNetwork::sigma_bits - 1))) >>
                                IntegerNetwork::sigma_bits) -
                               GaussianTables::least_level;
    return {static_cast<std::uint16_t>(std::clamp<std::int64_t>(level, 0, GaussianTables::levels - 1)),
            static_cast<std::int32_t>(std::clamp(phase, -mean_limit, mean_limit))};
  }

 protected:
  /// From panel_.input to outputs and steps of the first `lanes` anchors.
  void run(const IntegerNetwork& network, const IntegerNetwork::Packed& packed, std::size_t lanes) {
    network.evaluate(packed, panel_);
    for (int group = 0; group < 3; ++group) {
      const std::int32_t* const r = panel_.output.data() + heads_.r_row(group) * integer_panel;
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        step_[static_cast<std::size_t>(group)][lane] = static_cast<std::int8_t>(step_index(r[lane]));
      }
    }
  }
  IntegerNetwork::Panel panel_;

 private:
  ContextHeads heads_;
  Steps step_{};
};

/// Evaluates panels of `integer_panel` anchors; one object a worker.
class ContextEvaluator : public PanelModels {
 public:
  /// `packed` is context.network.pack(), shared; both must outlive this.
  ContextEvaluator(const IntegerContext& context, const IntegerNetwork::Packed& packed)
      : PanelModels(context.heads),
        context_(&context),
        packed_(&packed) {
    panel_.input.resize(static_cast<std::size_t>(context.grid.shape().channels()) * integer_panel);
  }

  /// Up to `integer_panel` voxels.
  void evaluate(std::span<const std::array<std::int32_t, 3>> voxels) {
    context_->grid.evaluate(voxels, panel_.input.data());
    run(context_->network, *packed_, voxels.size());
  }

 private:
  const IntegerContext* context_;
  const IntegerNetwork::Packed* packed_;
};

}  // namespace compmark
