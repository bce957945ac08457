// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of a DistortionLayer (splat/quantizer/concept.hpp): while training, what is decoded carries the noise of
// the quantizer. Cost: that of the layer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "compmark/core/parameters.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/training/anchor_overlay.hpp"
#include "compmark/splat/training/network_schedule.hpp"
#include "compmark/splat/training/run_policies.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/distortion.hpp"
#include "compmark/watermark/embed/mark_phases.hpp"
#include "compmark/watermark/embed/residual.hpp"

namespace compmark {

template <class Layer>
class DistortionStage : public Stage<DistortionStage<Layer>> {
 public:
  using Arena = ParameterArena<typename Layer::Scalar>;
  using Own = StageOf<DistortionStage>;
  using Handles = typename Layer::Handles;
  using Phase = DistortionPhase;  ///< the default, nothing, is that of every render
  struct Context {
    DistortionReport report;  ///< of the last forward pass
    typename Layer::Context layer;
  };
  static constexpr bool changes_attributes = true;

  DistortionStage() = default;
  explicit DistortionStage(Layer layer) : layer_(std::move(layer)) {}

  [[nodiscard]] static Handles add_parameters(Arena& arena, const AnchorHandles& /*anchors*/, std::size_t /*views*/) {
    return Layer::add_parameters(arena);
  }
  static void initialise(Arena& arena, const Handles& blocks, std::uint64_t seed) {
    Layer::initialise(arena, blocks, seed);
  }
  static void set_schedules(Arena& arena, const Handles& blocks, const TrainSettings& settings) {
    if constexpr (requires { blocks.weight1; }) {
      detail::set_network_schedule(arena, blocks, LearningSchedule::constant(settings.mark.distortion.learning_rate));
    }
  }
  template <class R>
  void configure(const TrainSettings& settings) {
    layer_ = distortion_layer<R>(settings.mark);
    phases_ = MarkPhases(settings.mark, settings.iterations);
  }
  void set_phase(const StageIteration& iteration, Phase& phase) const {
    phase = phases_.distortion(iteration.t, iteration.seed);
  }

  template <class Pass, class Columns>
  void attributes(const Pass& pass, const Own& own, Columns& columns) const {
    own.context.report = {};
    if (!own.phase.active()) return;
    auto& overlay = pass.context.overlay;
    const auto visible = std::as_const(pass.context.visible).span();
    const auto [feature, scaling, offset] = overlay.change_coded(visible, columns, pass.executor);
    own.context.report = layer_.forward(pass.model.arena, own.blocks, visible, own.phase, feature, scaling, offset,
                                        own.context.layer, pass.executor);
  }
  template <class Pass, class Report>
  static void loss(const Pass& /*pass*/, const StageOfLoss<DistortionStage>& own, Report& report) {
    report.total += own.context.report.rate_loss;
  }
  template <class Pass>
  void attributes_backward(const Pass& pass, const Own& own) const {
    if (!own.phase.active()) return;
    auto& arena = pass.model.arena;
    [[maybe_unused]] const auto [d_feature, d_scaling, d_offset] =
        pass.context.overlay.coded_gradients(arena, pass.model.anchors);
    layer_.backward(arena, own.blocks, std::as_const(pass.context.visible).span(), d_feature, d_scaling,
                    own.context.layer, pass.executor);
  }

  /// The steps of the last pass, of a layer that tells them and that was adaptive.
  [[nodiscard]] std::optional<StepSummary> step_summary(const Context& context) const {
    if constexpr (requires { layer_.step_summary(context.layer); }) {
      if (context.report.mean_step != 0) return layer_.step_summary(context.layer);
    }
    return std::nullopt;
  }

 private:
  [[no_unique_address]] Layer layer_;
  MarkPhases phases_;
};

}  // namespace compmark
