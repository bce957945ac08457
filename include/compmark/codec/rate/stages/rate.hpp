// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of an EntropyModel (codec/rate/concept.hpp). While training for compression, decoded attributes carry the
// noise of the model's own steps, the bits of the anchors are a loss, and Gaussians are masked by the masks of their
// offsets. Cost: that of the model.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "compmark/codec/rate/rate_phases.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/training/anchor_overlay.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

template <class Rate>
class RateStage : public Stage<RateStage<Rate>> {
 public:
  using Arena = ParameterArena<typename Rate::Scalar>;
  using Own = StageOf<RateStage>;
  using Handles = typename Rate::Handles;
  using Phase = typename Rate::Phase;  ///< the default, nothing, is that of every render
  struct Context {
    typename Rate::Report report;  ///< of the last forward pass
    typename Rate::Context rate;
  };
  static constexpr bool changes_attributes = true;
  static constexpr bool masks_gaussians = true;

  RateStage() = default;
  explicit RateStage(Rate rate) : rate_(std::move(rate)) {}

  [[nodiscard]] static Handles add_parameters(Arena& arena, const AnchorHandles& anchors, std::size_t /*views*/) {
    return Rate::add_parameters(arena, anchor_count(arena.layout(), anchors));
  }
  static void initialise(Arena& arena, const Handles& blocks, std::uint64_t seed) {
    Rate::initialise(arena, blocks, seed);
  }
  static void set_schedules(Arena& arena, const Handles& blocks, const TrainSettings& settings) {
    set_rate_schedules(arena, blocks, settings.rate);
  }
  template <class R>
  void configure(const TrainSettings& settings) {
    rate_ = entropy_model<R>(settings.rate);
    phases_ = RatePhases(settings.rate, settings.iterations, settings.grow_until);
  }
  void set_phase(const StageIteration& iteration, Phase& phase) const {
    phase = phases_.template at<Phase>(iteration.t, iteration.seed);
  }
  /// The rate was counted in the photographed view; without one it is no loss (docs/notebook/watermark_experiments.md).
  static void leave_photograph(Phase& phase) { phase.counts = false; }
  /// The target of a mark is the model before rounding: a change that takes back some of the rounding error is as good
  /// as one that carries the message.
  static void leave_mark(Phase& phase) {
    if (phase.round) phase = {};
  }
  template <class Model>
  void prepare_model(const StageIteration& iteration, Model& model, const Handles& blocks) const {
    prepare_context<Rate>(model, blocks, phases_, iteration.t);
  }

  /// Whether the model reads anchors that are not visible, ancestors: it does while it is active, if it can.
  [[nodiscard]] static bool reads_all_features([[maybe_unused]] const Phase& phase) {
    if constexpr (reads_ancestors) return phase.active();
    return false;
  }
  template <class Pass, class Columns>
  void attributes(const Pass& pass, const Own& own, Columns& columns) const {
    auto& overlay = pass.context.overlay;
    if constexpr (reads_ancestors)
      own.context.rate.all_features = overlay.overlaid(AnchorAttribute::feature) == OverlaidRows::all;
    own.context.report = {};
    if (!own.phase.active()) return;
    const auto visible = std::as_const(pass.context.visible).span();
    const auto [feature, scaling, offset] = overlay.change_coded(visible, columns, pass.executor);
    own.context.report = rate_.forward(pass.model.arena, own.blocks, visible, own.phase, columns.position, feature,
                                       scaling, offset, own.context.rate, pass.executor);
  }
  template <class Pass>
  static void gaussians(const Pass& pass, const Own& own) {
    Rate::mask_opacity(pass.model.arena, own.blocks, pass.decoder.statistics(pass.context.decoder).gaussian_slot,
                       pass.context.gaussians.columns().opacity, pass.executor);
  }
  template <class Pass, class Report>
  static void loss(const Pass& /*pass*/, const StageOfLoss<RateStage>& own, Report& report) {
    report.total += own.context.report.loss;
  }
  template <class Pass>
  static void gaussians_backward(const Pass& pass, const Own& own) {
    Rate::mask_opacity_backward(pass.model.arena, own.blocks,
                                pass.decoder.statistics(pass.context.decoder).gaussian_slot,
                                std::as_const(pass.context.gaussians).columns().opacity,
                                std::as_const(pass.context.d_gaussians).columns().opacity, pass.executor);
  }
  template <class Pass>
  void attributes_backward(const Pass& pass, const Own& own) const {
    if (!own.phase.active()) return;
    auto& arena = pass.model.arena;
    const auto [d_feature, d_scaling, d_offset] = pass.context.overlay.coded_gradients(arena, pass.model.anchors);
    rate_.backward(arena, own.blocks, std::as_const(pass.context.visible).span(), d_feature, d_scaling, d_offset,
                   own.context.rate, pass.executor);
  }

 private:
  static constexpr bool reads_ancestors = requires(typename Rate::Context context) { context.all_features; };

  [[no_unique_address]] Rate rate_;
  RatePhases phases_;
};

}  // namespace compmark
