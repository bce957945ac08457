// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The training loop of the ablations. It is Trainer's (splat/training/trainer.hpp), made of the same parts in the same order, with two switches at run time
// that a Trainer, whose recipe decides them, has no door for: frequency-aware growing, and an entropy model without its noise. No checkpoints, no
// views between photographs.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "ablations/training.hpp"
#include "compmark/codec/rate/rate_phases.hpp"
#include "compmark/recipes/marked.hpp"
#include "compmark/scene/image_point.hpp"
#include "compmark/splat/anchor/initialise.hpp"
#include "compmark/splat/optim/phases.hpp"
#include "compmark/splat/training/learning_rates.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/splat/training/run_policies.hpp"
#include "compmark/splat/training/training_target.hpp"
#include "compmark/splat/training/training_views.hpp"
#include "compmark/watermark/embed/mark_phases.hpp"

namespace ablation {

template <class R>
class Loop {
 public:
  using Executor = compmark::ThreadExecutor;

  Loop(const Row& row, Scene& scene, const compmark::TrainSettings& settings, const Decoder& decoder,
       const std::vector<std::uint8_t>& bits, Executor& executor)
      : row_(row),
        scene_(scene),
        settings_(settings),
        executor_(executor),
        order_(settings.seed, scene.train.size()),
        density_(compmark::density_phases(settings)),
        frequency_window_(compmark::closed_window(10000, 15000, settings.iterations)),
        mark_phases_(settings.mark, settings.iterations),
        rate_phases_(settings.rate, settings.iterations, settings.grow_until) {
    typename R::EntropyModel::Settings rate;
    static_cast<typename Base::EntropyModel::Settings&>(rate) = compmark::entropy_model<R>(settings.rate).settings();
    rate.noise = row.noise;
    pipeline_.template stage<compmark::RateStage>() = compmark::RateStage(typename R::EntropyModel(rate));
    auto& message = pipeline_.template stage<compmark::MessageStage>();
    message.decoder = decoder;
    message.message = bits;
    message.message_loss.settings.logit_scale = static_cast<float>(settings.mark.message.logit_scale);
  }

  [[nodiscard]] compmark::Result<compmark::Model<R>> run() {
    if (auto ready = initialise(); !ready) return ready.error();
    for (std::int64_t t = 1; t <= settings_.iterations; ++t) {
      if (auto stepped = step(t); !stepped) return stepped.error();
    }
    return std::move(model_);
  }

 private:
  [[nodiscard]] compmark::Result<compmark::Done> initialise() {
    compmark::InitialiseSettings initial;
    initial.voxel_size = settings_.voxel_size;
    const auto anchors =
        compmark::initial_anchors<float>(scene_.dataset.points.position, initial, compmark::EuclideanSpace{});
    if (!anchors) return anchors.error();
    const std::size_t rows = anchors->position.size() / 3;
    model_.create(rows, scene_.train.size());
    model_.voxel_size = anchors->voxel_size;
    model_.render.near_plane = settings_.near_plane;
    model_.render.blur_variance = settings_.blur_variance;
    const auto columns = anchor_values(model_.arena, model_.anchors);
    std::copy_n(anchors->position.begin(), rows * 3, columns.position.data);
    std::copy_n(anchors->scaling.begin(), rows * 6, columns.scaling.data);
    R::GaussianDecoder::initialise(model_.arena, model_.decoder, settings_.seed);
    model_.initialise_stages(settings_.seed);
    optimizer_.prepare(model_.arena.layout(), moments_);
    growth(1).prepare(rows, statistics_);
    return compmark::Done{};
  }

  [[nodiscard]] compmark::Result<compmark::Done> step(std::int64_t t) {
    const std::size_t view = order_.at(t);
    const compmark::Camera<double> camera = scene_.train.camera(view);
    if (auto loaded = target_.load(scene_.train, view, camera, pipeline_.background(model_.render)); !loaded)
      return loaded;
    compmark::prepare_context<typename R::EntropyModel>(model_, model_.template blocks<compmark::RateStage>(),
                                                        rate_phases_, t);
    typename compmark::Pipeline<R>::Phases phases;
    phases.template of<compmark::RateStage>() =
        rate_phases_.template at<typename R::EntropyModel::Phase>(t, settings_.seed);
    const compmark::MarkWeights weights = mark_phases_.weights(t);
    phases.template of<compmark::MessageStage>().weight = weights.message;
    if constexpr (compmark::present<typename R::HsvLoss>) phases.template of<compmark::HsvStage>().weight = weights.hsv;
    if constexpr (compmark::present<typename R::FrequencyLoss>)
      phases.template of<compmark::FrequencyStage>().weight = weights.frequency;
    static_cast<void>(pipeline_.forward(model_, camera, view, context_, executor_, phases));
    static_cast<void>(pipeline_.loss(target_.view(), {settings_.lambda_dssim, settings_.lambda_volume, weights.image},
                                     context_, executor_));
    pipeline_.backward(model_, camera, view, context_, executor_);
    bool adjusted = false;
    if (density_.observes(t)) {
      observe(t, camera);
      if (density_.adjusts(t)) {
        adjust(t);
        adjusted = true;
      }
    }
    if (t < settings_.iterations) {
      rates_.clear();
      for (const auto& block : model_.arena.layout().blocks())
        rates_.push_back(compmark::learning_rate(block.schedule, settings_.iterations, scene_.extent, t));
      static_cast<void>(optimizer_.step(model_.arena, rates_, moments_, executor_,
                                        {.skip_anchor_blocks = adjusted, .zero_gradients_after = true}));
    }
    return compmark::Done{};
  }

  [[nodiscard]] typename R::DensityControl growth(std::int64_t t) const {
    typename R::DensityControl::Settings settings = compmark::density_control<R>(settings_).settings();
    settings.in_window = row_.growing && frequency_window_.contains(t);
    return typename R::DensityControl(settings);
  }

  void observe(std::int64_t t, const compmark::Camera<double>& camera) {
    const auto screen = pipeline_.rasterizer(model_.render).screen(context_.raster);
    const auto decoded = pipeline_.decoder().statistics(context_.decoder);
    const auto density = growth(t);
    if (!density.settings().in_window) {
      density.observe(decoded, screen.visible, screen.gradient_norm, statistics_, executor_);
      return;
    }
    const auto gaussians = std::as_const(context_.gaussians).columns();
    const auto mean = [&](std::size_t i) {
      return compmark::image_point<float>(camera, {gaussians.mean[0][i], gaussians.mean[1][i], gaussians.mean[2][i]});
    };
    density.observe(decoded, screen.visible, screen.gradient_norm,
                    context_.template of<compmark::FrequencyStage>().scratch.error_map(), camera.height, camera.width,
                    mean, statistics_, executor_);
  }

  void adjust(std::int64_t t) {
    const auto edited = [&](const compmark::RowEdit& edit, const compmark::ArenaLayout& old_layout) {
      optimizer_.edit_rows(edit, old_layout, model_.arena.layout(), moments_);
    };
    const compmark::AdjustmentInputs context{settings_.seed, static_cast<std::uint64_t>(t), model_.voxel_size, {}};
    static_cast<void>(growth(t).adapt(model_.arena, model_.anchors, statistics_, context, edited));
  }

  const Row& row_;
  Scene& scene_;
  compmark::TrainSettings settings_;
  Executor& executor_;
  compmark::ViewOrder order_;
  compmark::DensityPhases density_;
  compmark::Window frequency_window_;
  compmark::MarkPhases mark_phases_;
  compmark::RatePhases rate_phases_;
  compmark::Model<R> model_;
  typename R::Optimizer optimizer_;
  typename R::Optimizer::State moments_;
  typename R::DensityControl::State statistics_;
  compmark::Pipeline<R> pipeline_;
  typename compmark::Pipeline<R>::Context context_;
  compmark::TrainingTarget<R> target_;
  std::vector<double> rates_;
};

}  // namespace ablation
