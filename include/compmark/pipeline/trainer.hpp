// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The training loop: owns the model, the optimiser's moments, the growth statistics and the workspace. One iteration is, in the published
// order (method sheet, sections 3.2 and 4): learning rates, view, render, losses, backward, statistics, growing and pruning, Adam.
// Deterministic: the state after iteration t is a function of the settings, the data and t, whatever the executor's thread count.
// Longer than 300 lines: one class, and the order of one iteration with every optional stage is to be read in one place.
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

#include "compmark/anchor/growth.hpp"
#include "compmark/anchor/initialise.hpp"
#include "compmark/core/result.hpp"
#include "compmark/math/robust_ball.hpp"
#include "compmark/optim/concept.hpp"
#include "compmark/optim/phases.hpp"
#include "compmark/pipeline/drawn_reading.hpp"
#include "compmark/pipeline/learning_rates.hpp"
#include "compmark/pipeline/mark_phases.hpp"
#include "compmark/pipeline/model.hpp"
#include "compmark/pipeline/observer.hpp"
#include "compmark/pipeline/pipeline.hpp"
#include "compmark/pipeline/rate_phases.hpp"
#include "compmark/pipeline/run_policies.hpp"
#include "compmark/pipeline/settings.hpp"
#include "compmark/pipeline/training_memory.hpp"
#include "compmark/pipeline/training_target.hpp"
#include "compmark/pipeline/training_views.hpp"
#include "compmark/scene/image_point.hpp"

namespace compmark {

template <Recipe R, Executor E>
class Trainer {
 public:
  using RecipeType = R;
  using Scalar = typename R::Scalar;
  using Growth = typename R::DensityControl;
  using Optimizer = typename R::Optimizer;
  using MarkedPipeline = Pipeline<R>;

  /// Everything that must be saved for a resumed run to continue bit for bit, beside the settings.
  struct State {
    Model<R> model;
    typename Optimizer::State optimizer;
    typename Growth::State growth;
    std::int64_t iteration = 0;  ///< finished iterations
  };

  /// `scene_extent` is 1.1 times the largest distance of a training camera to their mean (method sheet, section 3.2).
  Trainer(TrainSettings settings, std::size_t view_count, double scene_extent, E& executor)
      : settings_(std::move(settings)),
        scene_extent_(scene_extent),
        executor_(&executor),
        order_(settings_.seed, view_count),
        view_count_(view_count),
        phases_(density_phases(settings_)),
        growth_(density_control<R>(settings_)) {
    if constexpr (present<typename R::MessageDecoder>) {
      COMPMARK_ASSERT(settings_.mark.fidelity == 0,
                      "Trainer: a mark that is held to a finished model's renders is learned by PosthocEmbedding");
    }
    if constexpr (!MarkedPipeline::Road::is_absent || !MarkedPipeline::Marks::is_absent) {
      mark_phases_ = MarkPhases(settings_.mark, settings_.iterations);
    }
    if constexpr (present<typename R::HsvLoss>) pipeline_.marks().hsv = hsv_loss<R>(settings_.mark);
    if constexpr (present<typename R::DistortionLayer>) {
      pipeline_.road() = typename MarkedPipeline::Road(distortion_layer<R>(settings_.mark));
    }
    if constexpr (present<typename R::EntropyModel>) {
      rate_phases_ = RatePhases(settings_.rate, settings_.iterations, settings_.grow_until);
      pipeline_.road() = typename MarkedPipeline::Road(entropy_model<R>(settings_.rate));
    }
  }

  /// Starts from a point cloud: anchors at its occupied voxels, networks at their random initial values. Points beyond the reach of the others
  /// are left out (far_points()). Where the anchors would take more than `memory` says that there is, an Error of kind `exhausted`, before they are taken.
  [[nodiscard]] Result<Done> initialise(std::span<const std::array<float, 3>> points, const MemoryBudget& memory = {}) {
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
    if constexpr (present<typename R::Exposure>) R::Exposure::initialise(state_.model.arena, state_.model.exposure);
    if constexpr (!MarkedPipeline::Road::is_absent) {
      MarkedPipeline::Road::initialise(state_.model.arena, state_.model.road, settings_.seed);
    }
    start(rows);
    return Done{};
  }
  /// Starts from a finished model (see with_room_for_stages): its parameters, fresh moments and statistics. Background, blur and voxel size
  /// are the model's, not the settings'.
  void start_from(Model<R> model) {
    COMPMARK_ASSERT(model.train_views == view_count_, "Trainer: the model was trained with another number of views");
    state_.model = std::move(model);
    start(state_.model.anchor_count());
  }

  /// Continues from a saved state (see pipeline/checkpoint.hpp).
  void restore(State state) {
    state_ = std::move(state);
    set_schedules(state_.model, settings_);
  }

  /// One iteration. An Error comes from the views alone and leaves the state as it was.
  template <class Views>
    requires TrainingViews<Views, Scalar>
  [[nodiscard]] Result<IterationReport> step(Views& views) {
    const std::int64_t t = state_.iteration + 1;
    IterationReport report;
    report.iteration = t;
    report.total = settings_.iterations;
    report.view = order_.at(t);

    static_assert(std::is_same_v<ViewCamera<R>, Camera<double>> ||
                      std::is_same_v<std::remove_cvref_t<decltype(views.camera(report.view))>, ViewCamera<R>>,
                  "Trainer: this recipe projects through a lens, so views.camera(i) must return LensCamera (see "
                  "scene/lens_camera.hpp)");
    learning_rates(t);
    Model<R>& model = state_.model;
    const ViewCamera<R> camera = views.camera(report.view);
    if constexpr (present<typename R::Space>) context_.volume.space = space();
    if constexpr (present<typename R::Background>) {
      context_.background.color = R::Background::color(settings_.seed, static_cast<std::uint64_t>(t));
      context_.background.drawn = true;
    }
    const auto behind = Pipeline<R>::background(model.render, context_);
    if (Result<Done> loaded = target_.load(views, report.view, camera, behind); !loaded) return loaded.error();

    noise(t);
    if constexpr (!MarkedPipeline::Marks::is_absent) context_.marks.weights = mark_phases_.weights(t);
    report.forward = pipeline_.forward(model, camera, report.view, context_, *executor_);
    LossWeights weights{settings_.lambda_dssim, settings_.lambda_volume};
    if constexpr (present<typename R::AlphaLoss>) weights.lambda_alpha = settings_.effects.lambda_alpha;
    report.loss = pipeline_.loss(target_.view(), weights, context_, *executor_);
    pipeline_.backward(model, camera, report.view, context_, *executor_);

    if constexpr (present<Growth>) {
      if (phases_.observes(t)) {
        observe(t, camera);
        if (phases_.adjusts(t)) adjust(t, report);
      }
    }
    if constexpr (present<typename R::MessageDecoder>) {
      if (!report.adjusted && mark_phases_.reads_between(t)) {
        static_cast<void>(
            drawn_.read(pipeline_, model, views, report.view, settings_.seed, t, mark_phases_, context_, *executor_));
      }
    }
    if (t < settings_
                .iterations) {  // the published loop saves before the last step: an N-iteration run makes N - 1 updates
      // On an adjustment the anchors' tensors were rebuilt and their gradients of this iteration are gone, as in the published loop.
      const StepOptions options{.skip_anchor_blocks = report.adjusted, .zero_gradients_after = true};
      report.skipped_blocks =
          optimizer_.step(model.arena, rates_, state_.optimizer, *executor_, options).skipped_blocks;
      if constexpr (present<typename R::Exposure>) {  // exposures that do not train keep their bits
        if (rates_[model.exposure.affine.index] != 0) R::Exposure::fix_gauge(model.arena, model.exposure);
      }
    }
    report.anchors = model.anchor_count();
    state_.iteration = t;
    return report;
  }

  /// Runs until the end, or until the observer says stop (checked after each iteration).
  template <class Views, class O = NoObserver>
  [[nodiscard]] Result<Done> run(Views& views, O&& observer = {}) {
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
  /// Points that initialise() left out because they lie beyond RobustBall::reach(scene extent).
  [[nodiscard]] std::size_t far_points() const { return far_points_; }
  [[nodiscard]] const Pipeline<R>& pipeline() const { return pipeline_; }
  /// What the watermark cost and what was read in the last iteration; recipes with a watermark alone.
  [[nodiscard]] const MarkReport& mark_report() const requires(!Pipeline<R>::Marks::is_absent) {
    return context_.marks.report;
  }
  /// What was read in the last sampled view between training views.
  [[nodiscard]] const MarkReport& between_report() const requires(present<typename R::MessageDecoder>) {
    return drawn_.report();
  }
  /// Mean step and rate of the distortion layer in the last iteration.
  [[nodiscard]] const DistortionReport& distortion_report() const requires(present<typename R::DistortionLayer>) {
    return context_.road.distortion;
  }
  /// Bits a scalar and steps of the entropy model in the last iteration.
  [[nodiscard]] const auto& rate_report() const requires(present<typename R::EntropyModel>) {
    return context_.road.rate.report;
  }
  /// Tells the decoder and the bits that every render shall carry; call before the first step.
  void set_watermark(typename R::MessageDecoder decoder,
                     std::span<const std::uint8_t> message) requires(present<typename R::MessageDecoder>) {
    set_message(pipeline_.marks(), settings_.mark, std::move(decoder), message);
  }
  /// Render of the last iteration, and its ground truth.
  [[nodiscard]] ImageView<const Scalar> image() const { return context_.image; }
  [[nodiscard]] ImageView<const Scalar> target() const { return target_.image(); }
  /// How much each of its pixels counts, [height, width]; empty if the recipe does not look.
  [[nodiscard]] std::span<const Scalar> weight() const { return target_.weight(); }

 private:
  using Drawn = DrawnReading<R>;

  /// The noise of iteration t in what is decoded, and what the entropy model does in it.
  void noise(std::int64_t t) {
    if constexpr (present<typename R::DistortionLayer>) {
      context_.road.phase = mark_phases_.distortion(t, settings_.seed);
    }
    if constexpr (present<typename R::EntropyModel>) {
      prepare_context(state_.model, rate_phases_, t);
      context_.road.rate.phase = rate_phases_.template at<typename R::EntropyModel::Phase>(t, settings_.seed);
    }
  }

  void start(std::size_t rows) {
    set_schedules(state_.model, settings_);
    state_.iteration = 0;
    optimizer_.prepare(state_.model.arena.layout(), state_.optimizer);
    growth_.prepare(rows, state_.growth);
  }

  [[nodiscard]] typename R::Space space() const {
    if constexpr (present<typename R::Space>) {
      return {settings_.effects.space_origin, settings_.effects.space_radius};
    } else {
      return {};
    }
  }

  /// What growing learns from a photographed view: in the window of frequency-aware growing with the error map of this iteration's loss.
  void observe(std::int64_t t, const ViewCamera<R>& camera) requires(present<Growth>) {
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
            .observe(decoded, screen.visible, screen.gradient_norm, context_.marks.frequency.error_map(), camera.height,
                     camera.width, mean, state_.growth, *executor_);
        return;
      }
    }
    growth_.observe(decoded, screen.visible, screen.gradient_norm, state_.growth, *executor_);
  }

  /// Whether growing is frequency-aware in this iteration: in its window, and with a loss to look at.
  [[nodiscard]] bool looks_at_frequency(std::int64_t t) const {
    if constexpr (grows_by_frequency<Growth>) {
      return frequency_window(settings_).contains(t) && context_.marks.weights.frequency != 0;
    } else {
      static_cast<void>(t);
      return false;
    }
  }

  /// Grows and prunes; the optimiser's moments follow every edit.
  void adjust(std::int64_t t, IterationReport& report) {
    Model<R>& model = state_.model;
    const Growth growth = looks_at_frequency(t) ? density_control<R>(settings_, true) : growth_;
    SpaceAdaptContext<typename R::Space> context{{settings_.seed, static_cast<std::uint64_t>(t), model.voxel_size},
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

  void learning_rates(std::int64_t t) {
    const ArenaLayout& layout = state_.model.arena.layout();
    rates_.assign(layout.blocks().size(), 0.0);
    for (std::size_t b = 0; b < rates_.size(); ++b) {
      rates_[b] = learning_rate(layout.blocks()[b].schedule, settings_.iterations, scene_extent_, t);
    }
  }

  TrainSettings settings_;
  double scene_extent_ = 1;
  std::size_t far_points_ = 0;
  E* executor_;
  ViewOrder order_;
  std::size_t view_count_ = 0;
  DensityPhases phases_;
  [[no_unique_address]] Growth growth_;
  State state_;
  Pipeline<R> pipeline_;
  [[no_unique_address]] Optimizer optimizer_;
  typename Pipeline<R>::Context context_;
  TrainingTarget<R> target_;
  std::vector<double> rates_;
  [[no_unique_address]] std::conditional_t<MarkedPipeline::Road::is_absent && MarkedPipeline::Marks::is_absent,
                                           detail::Nothing<MarkPhases>, MarkPhases>
      mark_phases_;
  [[no_unique_address]] std::conditional_t<present<typename R::EntropyModel>, RatePhases, detail::Nothing<RatePhases>>
      rate_phases_;
  [[no_unique_address]] std::conditional_t<present<typename R::MessageDecoder>, Drawn, detail::Nothing<Drawn>> drawn_;
};

}  // namespace compmark
