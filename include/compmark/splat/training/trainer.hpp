// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The training loop: owns the model, the optimiser's moments, the growth statistics and the workspace. One iteration
// is, in the published order (docs/spec/method.md, 3.2 and 4): learning rates, view, render, losses, backward,
// statistics, growing and pruning, Adam. Deterministic: the state after iteration t is a function of the settings, the
// data and t, whatever the executor's thread count.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/math/robust_ball.hpp"
#include "compmark/scene/image_point.hpp"
#include "compmark/splat/anchor/growth.hpp"
#include "compmark/splat/anchor/initialise.hpp"
#include "compmark/splat/optim/concept.hpp"
#include "compmark/splat/optim/phases.hpp"
#include "compmark/splat/training/coarse_to_fine.hpp"
#include "compmark/splat/training/learning_rates.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/observer.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/splat/training/revival.hpp"
#include "compmark/splat/training/run_policies.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/splat/training/training_loop.hpp"
#include "compmark/splat/training/training_memory.hpp"
#include "compmark/splat/training/training_target.hpp"
#include "compmark/splat/training/training_views.hpp"

namespace compmark {

template <Recipe R, Executor E>
class Trainer : public TrainingLoop<Trainer<R, E>, R, E> {
  using Loop = TrainingLoop<Trainer<R, E>, R, E>;
  using Loop::context_;
  using Loop::executor_;
  using Loop::optimizer_;
  using Loop::phases_;
  using Loop::pipeline_;
  using Loop::rates_;
  using Loop::settings_;

 public:
  using typename Loop::Scalar;
  using typename Loop::Stages;
  using Growth = typename R::DensityControl;
  using Optimizer = typename R::Optimizer;

  /// Everything that must be saved for a resumed run to continue bit for bit, beside the settings.
  struct State {
    Model<R> model;
    typename Optimizer::State optimizer;
    typename Growth::State growth;
    std::int64_t iteration = 0;  ///< finished iterations
    Revival revival;
  };

  /// `scene_extent` is 1.1 times the largest distance of a training camera to their mean (docs/spec/method.md, 3.2).
  Trainer(TrainSettings settings, std::size_t view_count, double scene_extent, E& executor)
      : Loop(std::move(settings), executor),
        scene_extent_(scene_extent),
        order_(settings_.seed, view_count),
        view_count_(view_count),
        density_phases_(density_phases(settings_)),
        growth_(density_control<R>(settings_)) {
    pipeline_.volume() = typename Pipeline<R>::Volume(space());
  }

  /// Starts from a point cloud: anchors at its occupied voxels, networks at their random initial values. Points beyond
  /// the reach of the others are left out (far_points()). Where the anchors would take more than `memory` says that
  /// there is, an Error of kind `exhausted`, before they are taken.
  [[nodiscard]] COMPMARK_ONCE Result<Done> initialise(std::span<const std::array<float, 3>> points,
                                                      const MemoryBudget& memory = {}) {
    if (Result<Done> fits = check_coarse_to_fine<R>(settings_); !fits) return fits.error();
    if (Result<Done> room = check_cloud_memory(points.size(), memory); !room) return room.error();
    InitialiseSettings initial;
    initial.voxel_size = settings_.voxel_size;
    const RobustBall ball = robust_ball(
        points.size(), [&](std::size_t i) -> const auto& { return points[i]; });
    initial.greatest_scale = ball.core(scene_extent_);
    std::vector<std::array<float, 3>> near;
    far_points_ = leave_out_far(points, ball, ball.reach(scene_extent_), near);
    if (far_points_ != 0) points = near;
    auto anchors = initial_anchors<Scalar>(points, initial, space());
    if (!anchors) return anchors.error();
    const std::size_t rows = anchors->position.size() / 3;
    if (settings_.max_anchors != 0 && rows > settings_.max_anchors) {
      return Error{ErrorKind::exhausted,
                   {},
                   "max_anchors",
                   "the point cloud gives " + std::to_string(rows) + " anchors, more than the limit of " +
                       std::to_string(settings_.max_anchors),
                   "raise the limit or the voxel size"};
    }
    if (Result<Done> room = check_training_memory<R>(rows, memory); !room) return room.error();
    state_.model.create(rows, view_count_);
    state_.model.voxel_size = anchors->voxel_size;
    state_.model.render.near_plane = settings_.near_plane;
    state_.model.render.blur_variance = settings_.blur_variance;
    for (std::size_t c = 0; c < 3; ++c)
      state_.model.render.background[c] = static_cast<double>(settings_.background[c]);
    const AnchorColumns<Scalar> columns = anchor_values(state_.model.arena, state_.model.anchors);
    std::copy_n(anchors->position.begin(), rows * 3, columns.position.data);
    std::copy_n(anchors->scaling.begin(), rows * 6, columns.scaling.data);
    R::GaussianDecoder::initialise(state_.model.arena, state_.model.decoder, settings_.seed);
    state_.model.initialise_stages(settings_.seed);
    start(rows);
    return Done{};
  }
  /// Starts from a finished model (see with_room_for_stages): its parameters, fresh moments and statistics. Background,
  /// blur and voxel size are the model's, not the settings'.
  void start_from(Model<R> model) {
    COMPMARK_ASSERT(model.train_views == view_count_, "Trainer: the model was trained with another number of views");
    state_.model = std::move(model);
    start(state_.model.anchor_count());
  }

  /// Continues from a saved state (see splat/training/checkpoint.hpp).
  void restore(State state) {
    state_ = std::move(state);
    set_schedules(state_.model, settings_);
  }

  /// One iteration. An Error comes from the views, or from one that shows more than the rasterizer has memory for
  /// (RasterReport::error), and leaves the state where it was. If that view is a sampled one, between photographs, the
  /// photograph of the iteration is in gradients and growth statistics, and anchors may have grown and been pruned by
  /// these: another step would count it twice, so go on from an earlier state (restore).
  template <class Views>
    requires TrainingViews<Views, Scalar>
  [[nodiscard]] Result<IterationReport> step(Views& views) {
    const std::int64_t t = state_.iteration + 1;
    IterationReport report;
    report.iteration = t;
    report.total = settings_.iterations;
    report.view = order_.at(t);

    static_assert(Loop::template has_cameras_of_recipe<Views>,
                  "Trainer: this recipe projects through a lens, so views.camera(i) must return LensCamera (see "
                  "scene/lens_camera.hpp)");
    Model<R>& model = state_.model;
    learning_rates(model.arena.layout(), settings_.iterations, scene_extent_, t, rates_);
    ViewCamera<R> camera = views.camera(report.view);
    const int factor = settings_.coarse_to_fine.factor(t, settings_.iterations);
    this->set_phases(t);
    const auto behind = Pipeline<R>::background(model.render, phases_);
    if (Result<Done> loaded = target_.load(views, report.view, camera, behind, factor); !loaded) return loaded.error();
    make_coarse(camera, factor);

    this->prepare_model(t, model);
    report.forward = pipeline_.forward(model, camera, report.view, context_, *executor_, phases_);
    if (report.forward.raster.error) return *report.forward.raster.error;
    LossWeights weights{settings_.lambda_dssim, settings_.lambda_volume};
    Stages::forward([&]<class S>() { pipeline_.template stage<S>().weigh_losses(this->iteration(t), weights.image); });
    report.loss = pipeline_.loss(target_.view(), weights, context_, *executor_);
    pipeline_.backward(model, camera, report.view, context_, *executor_);
    control_density(t, camera, report);
    std::optional<Error> failed;
    const TrainingPass<Pipeline<R>, Model<R>, Views, E> pass{
        pipeline_, model, views, report.view, settings_.seed, t, phases_, *executor_, report.adjusted, failed};
    Stages::forward(
        [&]<class S>() { pipeline_.template stage<S>().after_backward(pass, stage_states_.template of<S>()); });
    if (failed) return std::move(*failed);
    if (t < settings_
                .iterations) {  // the published loop saves before the last step: an N-iteration run makes N - 1 updates
      // An adjustment rebuilt the anchors' tensors: their gradients are gone, as in the published loop.
      const StepOptions options{.skip_anchor_blocks = report.adjusted, .zero_gradients_after = true};
      report.skipped_blocks =
          optimizer_.step(model.arena, rates_, state_.optimizer, *executor_, options).skipped_blocks;
      Stages::forward([&]<class S>() { S::after_step(model.arena, model.template blocks<S>(), rates_); });
      report.revived = revive(t, report.forward);
    }
    report.anchors = model.anchor_count();
    state_.iteration = t;
    return report;
  }

  [[nodiscard]] const State& state() const { return state_; }
  /// Points that initialise() left out because they lie beyond RobustBall::reach(scene extent).
  [[nodiscard]] std::size_t far_points() const { return far_points_; }
  /// The workspace of the last iteration, of the stages too: context().of<RateStage>().report.
  [[nodiscard]] const typename Pipeline<R>::Context& context() const { return context_; }
  /// What a stage keeps from one iteration to the next.
  template <template <class...> class S>
  [[nodiscard]] const auto& training_state() const {
    return stage_states_.template of<FindStage<Stages, S>>();
  }
  /// Render of the last iteration, and its ground truth.
  [[nodiscard]] ImageView<const Scalar> image() const { return context_.image; }
  [[nodiscard]] ImageView<const Scalar> target() const { return target_.image(); }
  /// How much each of its pixels counts, [height, width]; empty if the recipe does not look.
  [[nodiscard]] std::span<const Scalar> weight() const { return target_.weight(); }

 private:
  void start(std::size_t rows) {
    set_schedules(state_.model, settings_);
    state_.iteration = 0;
    state_.revival = {};
    optimizer_.prepare(state_.model.arena.layout(), state_.optimizer);
    growth_.prepare(rows, state_.growth);
  }

  [[nodiscard]] typename R::Space space() const { return space_of_run<R>(settings_); }

  /// Statistics of the photographed view, growing and pruning, in the iterations that have them.
  void control_density(std::int64_t t, const ViewCamera<R>& camera, IterationReport& report) requires(present<Growth>) {
    if (!density_phases_.observes(t)) return;
    observe(t, camera);
    if (density_phases_.adjusts(t)) adjust(t, report);
  }
  void control_density(std::int64_t, const ViewCamera<R>&, IterationReport&) requires(!present<Growth>) {}

  /// Adds the statistics of a photographed view for growing; in the window of frequency-aware growing with the error
  /// map of this iteration's loss.
  void observe(std::int64_t t, const ViewCamera<R>& camera) {
    const ScreenStatistics<Scalar> screen = pipeline_.rasterizer(state_.model.render).screen(context_.raster);
    const auto decoded = pipeline_.decoder().statistics(context_.decoder);
    if constexpr (grows_by_frequency<Growth>) {
      if (looks_at_frequency(t)) {
        const auto world = std::as_const(context_.gaussians).columns();
        const auto mean = [&](std::size_t i) {
          return image_point<Scalar>(camera,
                                     {static_cast<double>(world.mean[0][i]), static_cast<double>(world.mean[1][i]),
                                      static_cast<double>(world.mean[2][i])});
        };
        density_control<R>(settings_, true)
            .observe(decoded, screen.visible, screen.gradient_norm,
                     context_.stages.template of<ErrorMapStage<Stages>>().error_map(), camera.height, camera.width,
                     mean, state_.growth, *executor_);
        return;
      }
    }
    growth_.observe(decoded, screen.visible, screen.gradient_norm, state_.growth, *executor_);
  }

  /// Whether growing is frequency-aware in this iteration: in its window, and with a loss to look at.
  [[nodiscard]] bool looks_at_frequency(std::int64_t t) const {
    if constexpr (grows_by_frequency<Growth>) {
      return frequency_window(settings_).contains(t) && phases_.template of<ErrorMapStage<Stages>>().weight != 0;
    } else {
      static_cast<void>(t);
      return false;
    }
  }

  /// Grows and prunes; the optimiser's moments follow every edit.
  void adjust(std::int64_t t, IterationReport& report) {
    Model<R>& model = state_.model;
    const Growth growth = looks_at_frequency(t) ? density_control<R>(settings_, true) : growth_;
    SpaceAdjustmentInputs<typename R::Space> context{{settings_.seed, static_cast<std::uint64_t>(t), model.voxel_size},
                                                     space()};
    const auto position = std::as_const(model).columns().position;
    context.ball = robust_ball(position.rows, [&](std::size_t i) { return position.row(i); });
    context.reach = context.ball.reach(scene_extent_);
    const auto grown = growth.adapt(model.arena, model.anchors, state_.growth, context,
                                    [&](const RowEdit& edit, const ArenaLayout& old_layout) {
                                      optimizer_.edit_rows(edit, old_layout, model.arena.layout(), state_.optimizer);
                                    });
    report.grown = grown.grown;
    report.pruned = grown.pruned;
    report.adjusted = true;
  }

  /// Brings back a training that has died, if not too often. By the old statistics every anchor would be pruned.
  bool revive(std::int64_t t, const ForwardReport& seen) {
    Revival& revival = state_.revival;
    [[maybe_unused]] const bool dead = revival.count(seen.visible_anchors, seen.gaussians);
    if constexpr (has_opacity_head<decltype(state_.model.decoder)>) {
      if (!dead || revival.revivals >= settings_.most_revivals) return false;
      renew_opacities(state_.model.arena, state_.model.decoder, state_.optimizer, settings_.seed, t);
      growth_.prepare(state_.model.anchor_count(), state_.growth);
      revival = {0, revival.revivals + 1};
      return true;
    }
    return false;
  }

  double scene_extent_ = 1;
  std::size_t far_points_ = 0;
  ViewOrder order_;
  std::size_t view_count_ = 0;
  DensityPhases density_phases_;
  [[no_unique_address]] Growth growth_;
  State state_;
  TrainingTarget<R> target_;
  [[no_unique_address]] TrainingStates<Stages, R> stage_states_;
};

}  // namespace compmark
