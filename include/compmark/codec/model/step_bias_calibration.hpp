// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Step-bias calibration for a model whose context reads ancestors (ContextGS), while a message is hidden in their
// features. The network that chooses an anchor's steps was not trained with marked ancestors and takes the mark for
// detail. On the cup its steps shrink by half an octave at level 1 and a quarter at level 0, which makes five of the
// seven percent that a marked file is larger (docs/notebook/watermark_experiments.md). The biases of these outputs are
// therefore moved from time to time, until the mean (of the logarithms) of each level's steps is what it is without a
// mark. Cost: a pass of the context over all anchors, 3 us an anchor and core, every
// PosthocSettings::calibrate_steps_every-th iteration: half a percent of a run at every 50th
// (pipeline_coded_iteration.bench).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/codec/rate/rate.hpp"
#include "compmark/codec/rate/stages/rate.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/step_calibration.hpp"

namespace compmark {

/// For recipes whose entropy model reads ancestors, beside an Embedder.
template <class R>
inline constexpr bool reads_marked_ancestors = [] {
  if constexpr (present<typename R::EntropyModel> && present<typename R::Embedder>) {
    return requires(typename R::EntropyModel::Context context) { context.all_features; };
  } else {
    return false;
  }
}();

class StepBiasCalibration {
 public:
  static constexpr std::size_t levels = 3, groups = 3, count = levels * groups;
  static constexpr double not_looked = 1e9;  ///< for a checkpoint, of every mean; larger than the logarithm of anything
  /// Means of ln q: of group g at level l the (3 l + g)-th. Empty before the first look. State of a run.
  std::vector<double> wanted;

  /// Whether there are steps in these phases.
  template <class Phases>
  [[nodiscard]] static bool applies(const Phases& phases) {
    return phases.template of<RateStage>().context;
  }
  /// Moves the biases by the difference between the mean steps of `model` in phases `marked` and the wanted ones. The
  /// first call measures the wanted ones, in phases `unmarked`, instead. `context` is for scratch.
  template <Recipe R, Executor E>
  void calibrate(const Pipeline<R>& pipeline, const typename Pipeline<R>::Phases& marked,
                 const typename Pipeline<R>::Phases& unmarked, const RateNumbers& rate, Model<R>& model,
                 typename Pipeline<R>::Context& context, E& executor) requires(reads_marked_ancestors<R>) {
    using Scalar = typename R::Scalar;
    const std::array<double, 3> base_step{rate.feature_step, rate.scaling_step, rate.offset_step};
    if (wanted.empty()) {
      const Means means = look(pipeline, unmarked, base_step, model, context, executor);
      wanted.assign(means.log_step.begin(), means.log_step.end());
      return;
    }
    const Means means = look(pipeline, marked, base_step, model, context, executor);
    for (std::size_t level = 0; level < levels; ++level) {
      const MatrixView<Scalar> bias = model.arena.values(model.template blocks<RateStage>().network[level].bias2);
      for (std::size_t group = 0; group < groups; ++group) {
        const std::size_t at = groups * level + group;
        if (!(means.slope[at] > 0) || !std::isfinite(means.log_step[at])) continue;
        // In units that a bias of the file holds, unless its shift is beyond four to the left: training uses the coded
        // value.
        const double most = 0.125, move = std::clamp((wanted[at] - means.log_step[at]) / means.slope[at], -most, most);
        bias.data[bias.size() - groups + group] += static_cast<Scalar>(std::nearbyint(move * 0x1p12) * 0x1p-12);
      }
    }
  }

 private:
  struct Means {
    std::array<double, levels * groups> log_step{}, slope{};  ///< of ln q by the network's output r
  };
  template <Recipe R, Executor E>
  [[nodiscard]] static Means look(const Pipeline<R>& pipeline, typename Pipeline<R>::Phases phases,
                                  const std::array<double, 3>& base_step, const Model<R>& model,
                                  typename Pipeline<R>::Context& context, E& executor) {
    phases.template of<RateStage>().counts = false;
    context.visible.resize(model.anchor_count());
    for (std::size_t i = 0; i < context.visible.size(); ++i) context.visible[i] = static_cast<std::uint32_t>(i);
    static_cast<void>(pipeline.read_attributes(model, context, executor, phases));
    const auto& rate = context.template of<RateStage>().rate;
    const auto& plan = rate.plan;
    Means means;
    for (std::size_t level = 0; level < levels; ++level) {
      const auto& section = plan.light[level];
      if (section.count == 0) continue;
      for (std::size_t group = 0; group < groups; ++group) {
        double log_step = 0, slope = 0;
        for (std::size_t e = section.first; e < section.first + section.count; ++e) {
          const double q = static_cast<double>(rate.step[groups * e + group]) / base_step[group];
          log_step += std::log(q);
          slope += 2 - q;  // d ln q / d r = 2 sigmoid(-2 r)
        }
        means.log_step[groups * level + group] = log_step / static_cast<double>(section.count);
        means.slope[groups * level + group] = slope / static_cast<double>(section.count);
      }
    }
    return means;
  }
};

template <class R>
  requires(reads_marked_ancestors<R>)
struct StepCalibrationOf<R> {
  using type = StepBiasCalibration;
};

}  // namespace compmark
