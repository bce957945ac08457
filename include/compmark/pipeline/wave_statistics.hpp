// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What an unmarked host says to waves of colour, and what a mark could make it say: the statistics that decoder_fit.hpp chooses by. A wave's mean
// is read in views drawn between the training views and past them; its gradient goes back through the renderer to the anchors' features.
// Cost: a render for every statistics view, `waves` ways back for every gradient view, and their inner products.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/mark/lattice_decoder.hpp"
#include "compmark/mark/pretrain/augmentation.hpp"
#include "compmark/mark/pretrain/lattice_network.hpp"
#include "compmark/math/row_products.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/pipeline/decoder_fit_settings.hpp"
#include "compmark/pipeline/model.hpp"
#include "compmark/pipeline/pipeline.hpp"
#include "compmark/scene/between.hpp"

namespace compmark::inline v0 {

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
/// Views that say how loud a region may be.
[[nodiscard]] inline std::size_t limit_views(const DecoderFitSettings& settings) {
  return settings.region_limit > 0 && settings.regions > 1
             ? static_cast<std::size_t>(std::min(settings.limit_views, settings.statistics_views))
             : 0;
}
/// Parts of the work of a fit, for its observer.
[[nodiscard]] inline std::size_t fit_parts(const DecoderFitSettings& settings) {
  return static_cast<std::size_t>(settings.statistics_views) +
         static_cast<std::size_t>(settings.gradient_views) * (metric_draws + static_cast<std::size_t>(settings.waves)) +
         limit_views(settings);
}

/// Renders a host in drawn views and asks how its features move waves of the colour.
template <Recipe R, class Views, Executor E>
class WaveProbe {
 public:
  using T = typename R::Scalar;
  WaveProbe(Model<R>& host, const Views& views, const LatticeSettings& shape, const LatticeWeights<T>& waves,
            const DecoderFitSettings& settings, E& executor)
      : host_(&host),
        views_(&views),
        shape_(shape),
        waves_(&waves),
        settings_(settings),
        executor_(&executor),
        decoder_(shape, waves),
        feature_(host.arena.layout().find("anchor.feature")) {
    const MatrixView<T> gradients = host.arena.gradients(feature_);
    const std::size_t rows = std::min(settings.anchors, gradients.rows);
    for (std::size_t i = 0; i < rows; ++i) anchors_.push_back(i * gradients.rows / rows);
    columns_ = gradients.columns;
    room_ = ViewRoom([&](std::size_t i) -> ViewCamera<R> { return views_->camera(i); }, views_->size());
  }

  /// Number n of the views of a stage.
  void render(const char* stage, std::size_t n, double reach = 1) {
    const Random random(settings_.seed, n, random_stage(stage));
    const auto camera_of = [&](std::size_t i) -> ViewCamera<R> { return views_->camera(i); };
    view_ = room_.view(random.uniform(std::uint64_t{1} << 20));
    camera_ = drawn_camera(camera_of, views_->size(), view_, random, reach);
    static_cast<void>(pipeline_.forward(*host_, camera_, view_, context_, *executor_));
  }
  /// The waves' means in the view, as they are read from its pixels in 8 bits.
  [[nodiscard]] const std::vector<T>& means() { return read(context_.image); }
  /// The same after an edit, number n of the settings' stream.
  template <class Jpeg>
  [[nodiscard]] const std::vector<T>& edited_means(std::size_t n, const Jpeg& jpeg) {
    const Random random(settings_.seed, n, random_stage("decoder fit edit"));
    const AugmentationDraw draw = draw_augmentation(settings_.edits, random);
    return read(augmenter_.forward(round(context_.image), draw, jpeg, *executor_));  // an edit is one of 8 bits
  }
  /// The render of the view, as it is.
  [[nodiscard]] ImageView<const T> image() const { return context_.image; }
  [[nodiscard]] const ViewCamera<R>& camera() const { return camera_; }
  [[nodiscard]] std::size_t parameters() const { return anchors_.size() * columns_; }
  /// Gradient of wave k to the features of the anchors that are looked at, a row an anchor. Call render() before.
  void wave_gradient(std::size_t k, std::span<T> gradient) {
    LatticeSettings shape = shape_;
    shape.features = shape.bits = 1;
    LatticeWeights<T> wave(shape);
    const std::size_t dimensions = shape.dimensions();
    std::copy_n(waves_->frequency.data() + k * dimensions, dimensions, wave.frequency.data());
    wave.phase[0] = waves_->phase[k];
    wave.head[0] = T(1);
    way_back(LatticeDecoder<T>(shape, std::move(wave)), gradient);
  }
  /// The same of the waves' sum with random signs: for the metric.
  void signed_gradient(std::size_t n, std::span<T> gradient) {
    LatticeSettings shape = shape_;
    shape.bits = 1;
    LatticeWeights<T> waves = *waves_;
    const Random random(settings_.seed, n, random_stage("decoder fit signs"));
    waves.head.resize(waves.phase.size());
    waves.bias.assign(1, T(0));
    for (std::size_t k = 0; k < waves.head.size(); ++k) waves.head[k] = random.uniform(k) < 0.5 ? T(-1) : T(1);
    way_back(LatticeDecoder<T>(shape, std::move(waves)), gradient);
  }

  /// What the loudest region of a view says to a decoder, the median over the views of the limit; nothing where the observer said stop.
  template <class O>
  [[nodiscard]] std::optional<double> loudest_region(LatticeSettings shape, const LatticeWeights<T>& weights,
                                                     O&& observer) {
    shape.region_limit = std::numeric_limits<double>::max();
    const LatticeDecoder<T> decoder(shape, weights);
    typename LatticeDecoder<T>::Context reading;
    const std::size_t views = limit_views(settings_), total = fit_parts(settings_);
    std::vector<double> loudest(views, 0.0);
    for (std::size_t n = 0; n < views; ++n) {
      render("decoder fit", n, settings_.reach);
      decoder.pool(round(context_.image), reading, *executor_);
      for (const T norm : reading.region_norm) loudest[n] = std::max(loudest[n], static_cast<double>(norm));
      if (!observer.on_progress(total - views + n + 1, total)) return std::nullopt;
    }
    std::nth_element(loudest.begin(), loudest.begin() + static_cast<std::ptrdiff_t>(views / 2), loudest.end());
    return loudest[views / 2];
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
  void way_back(const LatticeDecoder<T>& decoder, std::span<T> gradient) {
    T logit = 0;
    const T one = 1;
    pipeline_.begin_loss(context_);
    std::fill(context_.d_image_storage.begin(), context_.d_image_storage.end(), T(0));
    decoder.forward(context_.image, std::span<T>(&logit, 1), wave_, *executor_);
    decoder.backward(std::span<const T>(&one, 1), context_.d_image, wave_, *executor_);
    std::fill(host_->arena.all_gradients().begin(), host_->arena.all_gradients().end(), T(0));
    pipeline_.backward(*host_, camera_, view_, context_, *executor_);
    const MatrixView<const T> all = std::as_const(host_->arena).gradients(feature_);
    for (std::size_t i = 0; i < anchors_.size(); ++i) {
      std::copy_n(all.data + anchors_[i] * columns_, columns_, gradient.data() + i * columns_);
    }
  }

  Model<R>* host_;
  const Views* views_;
  LatticeSettings shape_;
  const LatticeWeights<T>* waves_;
  DecoderFitSettings settings_;
  E* executor_;
  Pipeline<R> pipeline_;
  typename Pipeline<R>::Context context_;
  LatticeDecoder<T> decoder_;
  typename LatticeDecoder<T>::Context reading_, wave_;
  Buffer<T> rounded_;
  Augmenter<T> augmenter_;
  BlockHandle feature_;
  std::vector<std::size_t> anchors_;
  ViewRoom room_;
  std::size_t columns_ = 0, view_ = 0;
  ViewCamera<R> camera_;
};

/// `mean` is [waves], `deviation` from it [waves, readings], the others [waves, waves]. Readings are `per_view` a view: as it is, then edited.
struct WaveStatistics {
  std::vector<double> mean, deviation, noise, energy, agreement;
  std::size_t per_view = 1;
};
/// Mean product of the rows of `table` [rows, readings]: of the first of every `per_view` readings, and of the others by `edit_weight`.
template <Executor E>
[[nodiscard]] std::vector<double> weighted_products(std::vector<double> table, std::size_t rows, std::size_t per_view,
                                                    double edit_weight, E& executor) {
  const std::size_t readings = table.size() / rows, clean = readings / per_view, edited = readings - clean;
  const double weight = edited == 0 ? 0 : edit_weight;
  for (std::size_t n = 0; n < readings; ++n) {
    const double scale =
        std::sqrt(n % per_view == 0 ? (1 - weight) / static_cast<double>(clean) : weight / static_cast<double>(edited));
    for (std::size_t k = 0; k < rows; ++k) table[k * readings + n] *= scale;
  }
  return row_products(std::span<const double>(table), rows, readings, executor);
}
[[nodiscard]] inline double trace(const std::vector<double>& matrix, std::size_t n) {
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += matrix[i * n + i];
  return sum;
}
/// w^T M w
[[nodiscard]] inline double quadratic(const std::vector<double>& matrix, const double* w, std::size_t n) {
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) {
    double row = 0;
    for (std::size_t j = 0; j < n; ++j) row += matrix[i * n + j] * w[j];
    sum += w[i] * row;
  }
  return sum;
}

/// Nothing where the observer said stop.
template <Recipe R, class Views, Executor E, class O = NoFitObserver, class Jpeg = NoJpeg>
[[nodiscard]] std::optional<WaveStatistics> wave_statistics(WaveProbe<R, Views, E>& probe,
                                                            const DecoderFitSettings& settings, E& executor,
                                                            O&& observer = {}, const Jpeg& jpeg = {}) {
  using T = typename R::Scalar;
  const std::size_t waves = static_cast<std::size_t>(settings.waves),
                    samples = static_cast<std::size_t>(settings.statistics_views),
                    edits = static_cast<std::size_t>(settings.edits_per_view), per_view = 1 + edits,
                    readings = samples * per_view;
  std::size_t done = 0;
  const std::size_t total = fit_parts(settings);
  WaveStatistics found;
  found.per_view = per_view;
  found.deviation.resize(waves * readings);
  found.mean.assign(waves, 0.0);
  const auto keep = [&](const std::vector<T>& p, std::size_t n) {
    for (std::size_t k = 0; k < waves; ++k) found.deviation[k * readings + n] = static_cast<double>(p[k]);
  };
  for (std::size_t n = 0; n < samples; ++n) {
    probe.render("decoder fit", n, settings.reach);
    keep(probe.means(), n * per_view);
    for (std::size_t e = 0; e < edits; ++e) keep(probe.edited_means(n * edits + e, jpeg), n * per_view + 1 + e);
    if (!observer.on_progress(++done, total)) return std::nullopt;
  }
  for (std::size_t k = 0; k < waves; ++k) {
    double* const row = found.deviation.data() + k * readings;
    for (std::size_t n = 0; n < samples; ++n) found.mean[k] += row[n * per_view] / static_cast<double>(samples);
    for (std::size_t n = 0; n < readings; ++n) row[n] -= found.mean[k];
  }
  found.noise = weighted_products(found.deviation, waves, per_view, settings.edit_weight, executor);

  // The metric: features that show much are moved less, by the root of their mean square gradient.
  const std::size_t parameters = probe.parameters(), views = static_cast<std::size_t>(settings.gradient_views);
  std::vector<T> one(parameters);
  std::vector<double> square(parameters, 0.0);
  for (std::size_t n = 0; n < views; ++n) {
    probe.render("decoder fit gradient", n);
    for (std::size_t d = 0; d < metric_draws; ++d) {
      probe.signed_gradient(n * metric_draws + d, one);
      if (!observer.on_progress(++done, total)) return std::nullopt;
      for (std::size_t i = 0; i < parameters; ++i)
        square[i] += static_cast<double>(one[i]) * static_cast<double>(one[i]);
    }
  }
  double mean_square = 0;
  for (const double s : square) mean_square += s / static_cast<double>(parameters);
  std::vector<T> scale(parameters);
  for (std::size_t i = 0; i < parameters; ++i) {
    scale[i] =
        static_cast<T>(1 / std::sqrt(square[i] / mean_square + 0.1));  // a tenth: what was hardly seen is not free
  }

  std::vector<T> gradient(waves * parameters), sum(waves * parameters, T(0));
  found.energy.assign(waves * waves, 0.0);
  const double count = static_cast<double>(views);
  for (std::size_t n = 0; n < views; ++n) {
    probe.render("decoder fit gradient", n);
    for (std::size_t k = 0; k < waves; ++k) {
      T* const row = gradient.data() + k * parameters;
      probe.wave_gradient(k, {row, parameters});
      if (!observer.on_progress(++done, total)) return std::nullopt;
      for (std::size_t i = 0; i < parameters; ++i) {
        row[i] *= scale[i];
        sum[k * parameters + i] += row[i];
      }
    }
    const std::vector<double> own = row_products(std::span<const T>(gradient), waves, parameters, executor);
    for (std::size_t i = 0; i < own.size(); ++i) found.energy[i] += own[i] / count;
  }
  found.agreement = row_products(std::span<const T>(sum), waves, parameters, executor);
  for (std::size_t i = 0; i < found.agreement.size(); ++i)
    found.agreement[i] = (found.agreement[i] / count - found.energy[i]) / (count - 1);
  return found;
}

}  // namespace detail

}  // namespace compmark::inline v0
