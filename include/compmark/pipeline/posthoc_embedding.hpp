// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Post-hoc embedding: hides a message in a finished model, which stays as it is. One iteration samples a view near a training view, renders it with
// the mark and without, reads the message, and moves the embedder's residual alone: towards the message, by MarkNumbers::lambda_message, and towards
// the unmarked render, by MarkNumbers::fidelity. No photograph is looked at; cameras are. In place of the published loss, which trains the model with
// the message (Trainer). Deterministic: the state after iteration t is a function of the settings, the model, the cameras and t.
// Cost an iteration: two renders, a reading, one backward pass.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/absent.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/optim/concept.hpp"
#include "compmark/pipeline/drawn_reading.hpp"
#include "compmark/pipeline/held_steps.hpp"
#include "compmark/pipeline/learning_rates.hpp"
#include "compmark/pipeline/mark_phases.hpp"
#include "compmark/pipeline/model.hpp"
#include "compmark/pipeline/observer.hpp"
#include "compmark/pipeline/pipeline.hpp"
#include "compmark/pipeline/rate_phases.hpp"
#include "compmark/pipeline/run_policies.hpp"
#include "compmark/pipeline/settings.hpp"
#include "compmark/pipeline/view_costs.hpp"

namespace compmark {

/// `settings.mark` and `settings.rate` say all; the other learning rates have no meaning here. Views need camera(i) and size() alone.
template <Recipe R, Executor E>
class PosthocEmbedding {
 public:
  using RecipeType = R;
  using Scalar = typename R::Scalar;
  static_assert(
      DrawnReading<R>::can_be_held,
      "PosthocEmbedding: the recipe needs an Embedder, which holds the mark, and a MessageDecoder, which reads it");

  /// Everything that must be saved for a resumed run to continue bit for bit, beside the settings.
  struct State {
    Model<R> model;
    typename R::Optimizer::State optimizer;
    std::int64_t iteration = 0;  ///< finished iterations
    ViewCosts costs;             ///< of the readings, if cameras are drawn by them
    [[no_unique_address]] std::conditional_t<reads_marked_ancestors<R>, HeldSteps, detail::Nothing<HeldSteps>> steps;
  };

  PosthocEmbedding(TrainSettings settings, E& executor)
      : settings_(std::move(settings)),
        executor_(&executor),
        phases_(settings_.mark, settings_.iterations) {
    COMPMARK_ASSERT(settings_.mark.fidelity > 0, "PosthocEmbedding: the fidelity to the unmarked renders is above 0");
    if constexpr (present<typename R::DistortionLayer>) {
      pipeline_.road() = typename Pipeline<R>::Road(distortion_layer<R>(settings_.mark));
    }
    if constexpr (present<typename R::EntropyModel>) {
      rate_phases_ = RatePhases(settings_.rate, settings_.iterations, settings_.grow_until);
      pipeline_.road() = typename Pipeline<R>::Road(entropy_model<R>(settings_.rate));
    }
  }

  /// Tells the decoder and the bits that every render shall carry; call before the first step.
  void set_watermark(typename R::MessageDecoder decoder, std::span<const std::uint8_t> message) {
    set_message(pipeline_.marks(), settings_.mark, std::move(decoder), message);
  }
  /// Starts from a finished model with room for a mark (with_room_for_stages).
  void start_from(Model<R> model) {
    state_ = {};
    state_.model = std::move(model);
    set_schedules(state_.model, settings_);
    optimizer_.prepare(state_.model.arena.layout(), state_.optimizer);
  }
  /// Continues from a saved state (see pipeline/checkpoint.hpp).
  void restore(State state) {
    state_ = std::move(state);
    set_schedules(state_.model, settings_);
  }

  /// One iteration. An iteration that does not read (MarkNumbers::between_every) changes nothing.
  template <class Views>
  [[nodiscard]] Result<IterationReport> step(const Views& views) {
    static_assert(std::is_same_v<ViewCamera<R>, Camera<double>> ||
                      std::is_same_v<std::remove_cvref_t<decltype(views.camera(0))>, ViewCamera<R>>,
                  "PosthocEmbedding: this recipe projects through a lens, so views.camera(i) must return LensCamera "
                  "(see scene/lens_camera.hpp)");
    IterationReport report;
    report.iteration = state_.iteration + 1;
    report.total = settings_.iterations;
    report.anchors = state_.model.anchor_count();
    set_noise(report.iteration);
    report.rendered = phases_.reads_between(report.iteration);
    if (report.rendered) read(views, report);
    state_.iteration = report.iteration;
    return report;
  }

  /// Runs until the end, or until the observer says stop (checked after each iteration).
  template <class Views, class O = NoObserver>
  [[nodiscard]] Result<Done> run(const Views& views, O&& observer = {}) {
    while (!finished()) {
      Result<IterationReport> report = step(views);
      if (!report) return report.error();
      if (!observer.on_iteration(std::as_const(*this), *report)) break;
    }
    return Done{};
  }

  [[nodiscard]] bool finished() const { return state_.iteration >= settings_.iterations; }
  [[nodiscard]] const State& state() const { return state_; }
  [[nodiscard]] const Model<R>& model() const { return state_.model; }
  [[nodiscard]] const TrainSettings& settings() const { return settings_; }
  [[nodiscard]] const Pipeline<R>& pipeline() const { return pipeline_; }
  /// What the message cost and what was read of it in the last reading.
  [[nodiscard]] const MarkReport& mark_report() const { return reading_.report(); }
  /// The marked render of the last reading, and the unmarked one of the same view.
  [[nodiscard]] ImageView<const Scalar> image() const { return reading_.image(); }
  [[nodiscard]] ImageView<const Scalar> target() const { return reading_.host(); }
  /// Empty: every pixel counts.
  [[nodiscard]] std::span<const Scalar> weight() const { return {}; }

 private:
  /// The noise of iteration t in what is decoded, and what the entropy model does in it.
  void set_noise([[maybe_unused]] std::int64_t t) {
    if constexpr (present<typename R::DistortionLayer>) {
      context_.road.phase = phases_.distortion(t, settings_.seed);
    }
    if constexpr (present<typename R::EntropyModel>) {
      prepare_context(state_.model, rate_phases_, t);
      context_.road.rate.phase = rate_phases_.template at<typename R::EntropyModel::Phase>(t, settings_.seed);
    }
  }

  template <class Views>
  void read(const Views& views, IterationReport& report) {
    Model<R>& model = state_.model;
    const std::int64_t t = report.iteration;
    const double share = settings_.mark.draw_by_cost;
    report.view = reading_.roomy_view(views, settings_.seed, t, state_.costs, share);
    if constexpr (reads_marked_ancestors<R>) hold_steps(t);
    report.forward =
        reading_.read_held(pipeline_, model, views, report.view, settings_.seed, t, phases_, context_, *executor_);
    const BlockHandle residual = model.road.embedder.residual;
    rates_.assign(model.arena.layout().blocks().size(), 0.0);
    // Unlike the published training loop this one steps in its last iteration too.
    rates_[residual.index] = learning_rate(model.arena.layout().block(residual).schedule, settings_.iterations, 1, t);
    report.skipped_blocks =
        optimizer_.step(model.arena, rates_, state_.optimizer, *executor_, StepOptions{.zero_gradients_after = true})
            .skipped_blocks;
    if (share > 0) state_.costs.add(report.view, views.size(), reading_.report().message);
    report.loss.total = reading_.report().total;
  }

  /// In the first reading, and in the first of every so many iterations.
  void hold_steps(std::int64_t t) requires(reads_marked_ancestors<R>) {
    const std::int64_t every = settings_.mark.hold_steps_every;
    if (every <= 0 || !context_.road.rate.phase.context) return;
    const std::int64_t before = t - std::max<std::int64_t>(1, settings_.mark.between_every);  // the reading before
    if (!state_.steps.wanted.empty() && (t - 1) / every == (before - 1) / every) return;
    const RateNumbers& rate = settings_.rate;
    state_.steps.hold(pipeline_, context_.road.rate.phase, {rate.feature_step, rate.scaling_step, rate.offset_step},
                      state_.model, context_, *executor_);
  }

  TrainSettings settings_;
  E* executor_;
  MarkPhases phases_;
  [[no_unique_address]] std::conditional_t<present<typename R::EntropyModel>, RatePhases, detail::Nothing<RatePhases>>
      rate_phases_;
  typename R::Optimizer optimizer_;
  Pipeline<R> pipeline_;
  State state_;
  typename Pipeline<R>::Context context_;  ///< the noise of the iteration, and scratch of the held steps
  DrawnReading<R> reading_;
  std::vector<double> rates_;
};

}  // namespace compmark
