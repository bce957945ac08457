// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Measurements of an unmarked model in sampled novel views, between its training views and beyond them: the Fourier
// features of its renders, their gradients to the anchors' features, and the loudest region of an image.
// fourier_statistics.hpp makes statistics of them. Cost: a render and a reading for each view, a backward pass for each
// gradient.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/scene/novel_view.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/decoder/tone.hpp"
#include "compmark/watermark/fit/decoder_fit_settings.hpp"
#include "compmark/watermark/pretrain/augmentation.hpp"

namespace compmark {

namespace detail {

inline constexpr std::size_t metric_draws = 6;  ///< of signs, a gradient view
/// Regions of the smallest view; 1: nothing to limit.
template <class Views>
[[nodiscard]] int region_count(const Views& views, const DecoderFitSettings& settings) {
  double pixels = std::numeric_limits<double>::max();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto camera = views.camera(i);
    pixels = std::min(pixels, static_cast<double>(camera.width) * static_cast<double>(camera.height));
  }
  const double positions = pixels / (static_cast<double>(settings.stride) * settings.stride);
  return std::clamp(static_cast<int>(std::min(positions / settings.region_positions, 4096.0)), 1, settings.regions);
}
/// What a fit ends with where its observer says stop.
[[nodiscard]] inline Error fit_stopped() {
  return {ErrorKind::cancelled, {}, {}, "the fit was stopped by its observer", {}};
}
/// Views from which the limit of a region is measured.
[[nodiscard]] inline std::size_t limit_views(const DecoderFitSettings& settings) {
  return settings.region_limit > 0 && settings.regions > 1
             ? static_cast<std::size_t>(std::min(settings.limit_views, settings.statistics_views))
             : 0;
}
/// Parts of the work of a fit, for its observer.
[[nodiscard]] inline std::size_t fit_parts(const DecoderFitSettings& settings) {
  return static_cast<std::size_t>(settings.statistics_views) +
         static_cast<std::size_t>(settings.gradient_views) *
             (metric_draws + static_cast<std::size_t>(settings.features)) +
         limit_views(settings);
}

/// Renders an unmarked model in sampled novel views and measures its Fourier features and their gradients.
template <Recipe R, class Views, Executor E>
class FourierProbe {
 public:
  using T = typename R::Scalar;
  FourierProbe(Model<R>& unmarked, const Views& views, const LatticeSettings& shape, const LatticeWeights<T>& weights,
               const DecoderFitSettings& settings, E& executor)
      : unmarked_(&unmarked),
        views_(&views),
        shape_(shape),
        weights_(&weights),
        settings_(settings),
        executor_(&executor),
        decoder_(shape, weights),
        feature_(unmarked.anchors.feature) {
    const MatrixView<T> gradients = unmarked.arena.gradients(feature_);
    const std::size_t rows = std::min(settings.anchors, gradients.rows);
    for (std::size_t i = 0; i < rows; ++i) anchors_.push_back(i * gradients.rows / rows);
    columns_ = gradients.columns;
    clearance_ = ViewClearance([&](std::size_t i) -> ViewCamera<R> { return views_->camera(i); }, views_->size());
  }

  /// Number n of the views of a stage. An Error where it shows more than the rasterizer has memory for
  /// (RasterReport::error); then there is nothing to read.
  [[nodiscard]] Result<Done> render(const char* stage, std::size_t n, double reach = 1) {
    const Random random(settings_.seed, n, random_stage(stage));
    const auto camera_of = [&](std::size_t i) -> ViewCamera<R> { return views_->camera(i); };
    view_ = clearance_.view(random.uniform(std::uint64_t{1} << 20));
    camera_ = novel_view_camera(camera_of, views_->size(), view_, random, reach);
    ForwardReport rendered = pipeline_.forward(*unmarked_, camera_, view_, context_, *executor_);
    if (rendered.raster.error) return std::move(*rendered.raster.error);
    seen_ = context_.image;
    return Done{};
  }
  /// Number n of the views of the statistics, in a light of its own (DecoderFitSettings::tone): what is read of it,
  /// edited or not. Errors are those of render.
  [[nodiscard]] Result<Done> render_statistics_view(std::size_t n) {
    if (Result<Done> rendered = render("decoder fit", n, settings_.reach); !rendered) return rendered;
    if (!(settings_.tone > 0)) return Done{};
    toned_.resize(context_.image.size());
    const ImageView<T> toned{toned_.data(), 3, context_.image.height, context_.image.width};
    const Random random(settings_.seed, n, random_stage("decoder fit tone"));
    apply_tone<T>(drawn_tone<T>(settings_.tone, random), context_.image, toned);
    seen_ = toned;
    return Done{};
  }
  /// The features' means in the view, read from its pixels in 8 bits.
  [[nodiscard]] const std::vector<T>& means() { return read(seen_); }
  /// The same after an edit, number n of the settings' stream.
  template <class Jpeg>
  [[nodiscard]] const std::vector<T>& edited_means(std::size_t n, const Jpeg& jpeg) {
    const Random random(settings_.seed, n, random_stage("decoder fit edit"));
    const AugmentationDraw draw = draw_augmentation(settings_.edits, random);
    return read(augmenter_.forward(round(seen_), draw, jpeg, *executor_));  // an edit is one of 8 bits
  }
  /// The render of the view, as it is.
  [[nodiscard]] ImageView<const T> image() const { return context_.image; }
  [[nodiscard]] const ViewCamera<R>& camera() const { return camera_; }
  [[nodiscard]] std::size_t parameters() const { return anchors_.size() * columns_; }
  /// Gradient of Fourier feature k to the features of the chosen anchors, a row an anchor. Call render() before.
  void feature_gradient(std::size_t k, std::span<T> gradient) {
    LatticeSettings shape = shape_;
    shape.features = shape.bits = 1;
    LatticeWeights<T> one(shape);
    const std::size_t dimensions = shape.dimensions();
    std::copy_n(weights_->frequency.data() + k * dimensions, dimensions, one.frequency.data());
    one.phase[0] = weights_->phase[k];
    one.head[0] = T(1);
    backward_pass(LatticeDecoder<T>(shape, std::move(one)), gradient);
  }
  /// The same for the sum of the Fourier features with random signs: for the metric.
  void signed_gradient(std::size_t n, std::span<T> gradient) {
    LatticeSettings shape = shape_;
    shape.bits = 1;
    LatticeWeights<T> weights = *weights_;
    const Random random(settings_.seed, n, random_stage("decoder fit signs"));
    weights.head.resize(weights.phase.size());
    weights.bias.assign(1, T(0));
    for (std::size_t k = 0; k < weights.head.size(); ++k) weights.head[k] = random.uniform(k) < 0.5 ? T(-1) : T(1);
    backward_pass(LatticeDecoder<T>(shape, std::move(weights)), gradient);
  }

  /// Norms of the logits of the loudest region in each view of the limit, in growing order. An Error is that of render,
  /// or of kind cancelled where the observer said stop.
  template <class O>
  [[nodiscard]] Result<std::vector<double>> loudest_regions(LatticeSettings shape, const LatticeWeights<T>& weights,
                                                            O&& observer) {
    shape.region_limit = static_cast<double>(std::numeric_limits<T>::max());
    const LatticeDecoder<T> decoder(shape, weights);
    typename LatticeDecoder<T>::Context reading;
    const std::size_t views = limit_views(settings_), total = fit_parts(settings_);
    std::vector<double> loudest(views, 0.0);
    for (std::size_t n = 0; n < views; ++n) {
      if (Result<Done> rendered = render_statistics_view(n); !rendered) return rendered.error();
      decoder.pool(round(seen_), reading, *executor_);
      for (const T norm : reading.region_norm) loudest[n] = std::max(loudest[n], static_cast<double>(norm));
      if (!observer.on_progress(total - views + n + 1, total)) return fit_stopped();
    }
    std::sort(loudest.begin(), loudest.end());
    return loudest;
  }

 private:
  ImageView<const T> round(ImageView<const T> image) {
    rounded_.resize(image.size());
    const ImageView<T> rounded{rounded_.data(), 3, image.height, image.width};
    round_to_8bit<T>(image, rounded);
    return rounded;
  }
  const std::vector<T>& read(ImageView<const T> image) {
    decoder_.pool(round(image), reading_, *executor_);
    return reading_.pooled;
  }
  void backward_pass(const LatticeDecoder<T>& decoder, std::span<T> gradient) {
    T logit = 0;
    const T one = 1;
    pipeline_.begin_loss(context_);
    std::fill(context_.d_image_storage.begin(), context_.d_image_storage.end(), T(0));
    decoder.forward(context_.image, std::span<T>(&logit, 1), one_reading_, *executor_);
    decoder.backward(std::span<const T>(&one, 1), context_.d_image, one_reading_, *executor_);
    std::fill(unmarked_->arena.all_gradients().begin(), unmarked_->arena.all_gradients().end(), T(0));
    pipeline_.backward(*unmarked_, camera_, view_, context_, *executor_);
    const MatrixView<const T> all = std::as_const(unmarked_->arena).gradients(feature_);
    for (std::size_t i = 0; i < anchors_.size(); ++i) {
      std::copy_n(all.data + anchors_[i] * columns_, columns_, gradient.data() + i * columns_);
    }
  }

  Model<R>* unmarked_;
  const Views* views_;
  LatticeSettings shape_;
  const LatticeWeights<T>* weights_;
  DecoderFitSettings settings_;
  E* executor_;
  Pipeline<R> pipeline_;
  typename Pipeline<R>::Context context_;
  LatticeDecoder<T> decoder_;
  typename LatticeDecoder<T>::Context reading_, one_reading_;
  Buffer<T> rounded_, toned_;
  ImageView<const T> seen_;  ///< the render, or the same in another light
  Augmenter<T> augmenter_;
  BlockHandle feature_;
  std::vector<std::size_t> anchors_;
  ViewClearance clearance_;
  std::size_t columns_ = 0, view_ = 0;
  ViewCamera<R> camera_;
};

}  // namespace detail

}  // namespace compmark
