// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Post-hoc embedding: hides a message in a finished model, which stays as it is. One iteration samples a view near a
// training view, renders it with the mark and without, reads the message, and moves the embedder's residual alone:
// towards the message, by MessageSettings::lambda, and towards the unmarked render, by PosthocSettings::fidelity. A
// share of the iterations (PosthocSettings::photograph_share) reads a training view instead and is held to its
// photograph; without one no photograph is looked at, only cameras are. In place of the published loss, which trains the
// model with the message (Trainer). Deterministic: the state after iteration t is a function of the settings, the model,
// the views and t. Cost an iteration: two renders (one with a photograph), a reading, one backward pass.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include "compmark/core/absent.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/export/explicit_splats.hpp"
#include "compmark/splat/optim/concept.hpp"
#include "compmark/splat/training/learning_rates.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/observer.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/step_calibration.hpp"
#include "compmark/splat/training/training_loop.hpp"
#include "compmark/splat/training/training_target.hpp"
#include "compmark/splat/training/training_views.hpp"
#include "compmark/watermark/embed/mark_phases.hpp"
#include "compmark/watermark/embed/novel_view_reading.hpp"
#include "compmark/watermark/embed/stages/embedder.hpp"
#include "compmark/watermark/embed/stages/lost_anchors.hpp"
#include "compmark/watermark/embed/view_costs.hpp"

namespace compmark {

/// `settings.mark` and `settings.rate` say all; the other learning rates have no meaning here. Views need camera(i) and
/// size() alone, and with a photograph_share what TrainingViews asks for.
template <Recipe R, Executor E>
class PosthocEmbedding : public TrainingLoop<PosthocEmbedding<R, E>, R, E> {
  using Loop = TrainingLoop<PosthocEmbedding<R, E>, R, E>;
  using Loop::context_;
  using Loop::executor_;
  using Loop::phases_;
  using Loop::pipeline_;
  using Loop::settings_;

 public:
  using typename Loop::Scalar;
  static_assert(
      NovelViewReading<R>::can_be_held,
      "PosthocEmbedding: the recipe needs an Embedder, which holds the mark, and a MessageDecoder, which reads it");

  /// Everything that must be saved for a resumed run to continue bit for bit, beside the settings.
  struct State {
    Model<R> model;
    typename R::Optimizer::State optimizer;
    std::int64_t iteration = 0;  ///< finished iterations
    ViewCosts costs;             ///< of the readings, if cameras are drawn by them
    [[no_unique_address]] StepCalibration<R> steps;

    /// What a checkpoint has beside model and moments: f(name, numbers, their count, the number that says "none yet").
    template <class Self, class F>
    static void for_each_column(Self& state, const TrainSettings& settings, std::size_t views, F&& f) {
      if (settings.mark.posthoc.draw_by_cost > 0) f("mark.view_costs", state.costs.mean, views, ViewCosts::unread);
      if constexpr (present<StepCalibration<R>>) {
        if (settings.mark.posthoc.calibrate_steps_every > 0)
          f("mark.held_steps", state.steps.wanted, StepCalibration<R>::count, StepCalibration<R>::not_looked);
      }
    }
  };

  PosthocEmbedding(TrainSettings settings, E& executor)
      : Loop(std::move(settings), executor),
        schedule_(settings_.mark, settings_.iterations) {
    COMPMARK_ASSERT(settings_.mark.posthoc.fidelity > 0,
                    "PosthocEmbedding: the fidelity to the unmarked renders is above 0");
  }

  /// Starts from a finished model with room for a mark (with_room_for_stages).
  void start_from(Model<R> model) {
    state_ = {};
    state_.model = std::move(model);
    set_schedules(state_.model, settings_);
    this->optimizer_.prepare(state_.model.arena.layout(), state_.optimizer);
  }
  /// Continues from a saved state (see splat/training/checkpoint.hpp).
  void restore(State state) {
    state_ = std::move(state);
    set_schedules(state_.model, settings_);
  }

  /// One iteration. An iteration that does not read (MessageSettings::novel_view_every) changes nothing. An Error comes
  /// from a view that shows more than the rasterizer has memory for (RasterReport::error), or whose photograph cannot be
  /// read, and leaves the state where it was.
  template <class Views>
  [[nodiscard]] Result<IterationReport> step(Views& views) {
    static_assert(Loop::template has_cameras_of_recipe<Views>,
                  "PosthocEmbedding: this recipe projects through a lens, so views.camera(i) must return LensCamera "
                  "(see scene/lens_camera.hpp)");
    IterationReport report;
    report.iteration = state_.iteration + 1;
    report.total = settings_.iterations;
    report.anchors = state_.model.anchor_count();
    this->set_phases(report.iteration);
    this->prepare_model(report.iteration, state_.model);
    report.rendered = schedule_.reads_between(report.iteration);
    if (report.rendered) {
      if (Result<Done> done = read(views, report); !done) return done.error();
    }
    state_.iteration = report.iteration;
    return report;
  }

  [[nodiscard]] const State& state() const { return state_; }
  /// What the message cost and what was read of it in the last reading, and its views.
  [[nodiscard]] const NovelViewReading<R>& reading() const { return reading_; }
  /// The marked render of the last reading, and what it was held to: the unmarked one of the same view, or a photograph.
  [[nodiscard]] ImageView<const Scalar> image() const { return reading_.image(); }
  [[nodiscard]] ImageView<const Scalar> target() const {
    return photographed_ ? photograph_.image() : reading_.unmarked();
  }
  /// How much each pixel of it counts; empty: every pixel does.
  [[nodiscard]] std::span<const Scalar> weight() const {
    return photographed_ ? photograph_.weight() : std::span<const Scalar>();
  }

 private:
  /// Whether iteration t is held to a photograph. Where anchors are left out it is not: no photograph lacks them, and the
  /// mark would be taught to put them back.
  [[nodiscard]] bool looks_at_photograph(std::int64_t t) const {
    const double share = schedule_.photograph_share();
    return share > 0 && !lacks_anchors() &&
           Random(settings_.seed, static_cast<std::uint64_t>(t), random_stage("photographed")).uniform(0) < share;
  }

  [[nodiscard]] bool lacks_anchors() const {
    bool lacks = false;
    const auto& phases = phases_;  // g++ 12 does not find the base class's member in the lambda
    Pipeline<R>::Stages::forward([&]<class S>() {
      if constexpr (std::is_same_v<S, LostAnchorsStage>) lacks = phases.template of<S>().share > 0;
    });
    return lacks;
  }

  template <class Views>
  [[nodiscard]] Result<Done> read(Views& views, IterationReport& report) {
    Model<R>& model = state_.model;
    const std::int64_t t = report.iteration;
    const double share = settings_.mark.posthoc.draw_by_cost;
    report.view = reading_.view_by_clearance(views, settings_.seed, t, state_.costs, share);
    if constexpr (present<StepCalibration<R>>) calibrate_steps(t);
    photographed_ = looks_at_photograph(t);
    if (photographed_) {
      if constexpr (TrainingViews<Views, Scalar>) {
        Result<ForwardReport> done = reading_.read_photographed(pipeline_, model, views, report.view, t, schedule_,
                                                                phases_, photograph_, *executor_);
        if (!done) return done.error();
        report.forward = std::move(*done);
      } else {
        COMPMARK_ASSERT(false, "PosthocEmbedding: a photograph_share needs views that load photographs");
      }
    } else {
      report.forward =
          reading_.read_held(pipeline_, model, views, report.view, settings_.seed, t, schedule_, phases_, *executor_);
    }
    if (report.forward.raster.error) return std::move(*report.forward.raster.error);
    const BlockHandle residual = model.template blocks<EmbedderStage>().residual;
    if constexpr (ExplicitModelRecipe<R>) {  // what the file that is written will not have carries nothing
      if constexpr (R::Embedder::target == AnchorAttribute::feature)
        R::GaussianDecoder::Layout::clear_harmonics_above(settings_.mark.residual.harmonics,
                                                          model.arena.gradients(residual));
    }
    this->rates_.assign(model.arena.layout().blocks().size(), 0.0);
    // Unlike the published training loop this one steps in its last iteration too.
    this->rates_[residual.index] =
        learning_rate(model.arena.layout().block(residual).schedule, settings_.iterations, 1, t);
    report.skipped_blocks =
        this->optimizer_
            .step(model.arena, this->rates_, state_.optimizer, *executor_, StepOptions{.zero_gradients_after = true})
            .skipped_blocks;
    if (share > 0) state_.costs.add(report.view, views.size(), reading_.report().message);
    report.loss.total = reading_.report().total;
    return Done{};
  }

  /// In the first reading, and in the first of every so many iterations.
  void calibrate_steps(std::int64_t t) requires(present<StepCalibration<R>>) {
    const std::int64_t every = settings_.mark.posthoc.calibrate_steps_every;
    if (every <= 0 || !StepCalibration<R>::applies(phases_)) return;
    const std::int64_t before =
        t - std::max<std::int64_t>(1, settings_.mark.message.novel_view_every);  // the reading before
    if (!state_.steps.wanted.empty() && (t - 1) / every == (before - 1) / every) return;
    typename Pipeline<R>::Phases marked = phases_, unmarked = phases_;
    marked.template of<EmbedderStage>().embeds = true;
    unmarked.template of<EmbedderStage>().embeds = false;
    state_.steps.calibrate(pipeline_, marked, unmarked, settings_.rate, state_.model, context_, *executor_);
  }

  MarkPhases schedule_;
  State state_;
  NovelViewReading<R> reading_;
  TrainingTarget<R> photograph_;
  bool photographed_ = false;
};

}  // namespace compmark
