// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder for one scene. The waves of a lattice decoder of colour (mark/lattice_decoder.hpp) say something of every scene by themselves,
// and that changes from view to view; and a mark can move them at the same time in all views that see a surface, or only in some. Both are known
// before anything is hidden, from the unmarked host alone, so that the head can read where the scene is silent and a mark is heard. With p(v) the
// waves' means in view v, J(v) their gradient to the anchors' features in a metric that counts a feature by how much it shows,
//   noise      N = covariance of p over drawn views,
//   energy     E = mean over v of J(v) J(v)^T              what a mark that is made for one view would move there,
//   agreement  A = mean over u != v of J(u) J(v)^T         what a mark that is made for one view moves in another,
// the bits are read along the directions w of largest  w^T A w / w^T (N / tr N + conflict E / tr E) w : Fisher's discriminant with the signal's
// covariance A. They are then mixed by a random rotation, so that all bits are as strong, and scaled to deviation 1 on the unmarked host.
// The message plays no part, so the p-value of a random key stays exact (docs/verification.md); the decoder belongs to the scene and has to be
// kept, with its hash, like the key. Measured gain: docs/watermark.md. Cost: a render for every statistics view, `waves` ways back for every gradient view.
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/mark/lattice_decoder.hpp"
#include "compmark/mark/pretrain/lattice_network.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/pipeline/model.hpp"
#include "compmark/pipeline/pipeline.hpp"
#include "compmark/scene/between.hpp"

namespace compmark::inline v0 {

struct DecoderFitSettings {
  int bits = 48;
  int waves = 128;             ///< more than bits: there is nothing to choose from otherwise
  double period = 0.08;        ///< of the waves, colours in [0, 1]: 20 levels of 255
  double spread_octaves = 1;   ///< either way, of the periods
  std::uint64_t seed = 0;      ///< of waves, views and rotation
  int statistics_views = 600;  ///< some four times the waves: the covariance of fewer is mostly chance
  int gradient_views = 12;     ///< at least 2
  std::size_t anchors =
      10000;  ///< at most so many are looked at for the gradients: 2 x 4 bytes x waves x their features
  double conflict_weight = 0.1;  ///< of the energy beside the noise
  double ridge = 0.01;           ///< share of the mean variance that is added to every variance of the noise
};

template <class T>
struct DecoderFit {
  LatticeDecoder<T> decoder;
  double wave_deviation = 0;  ///< over the views, mean of the waves
  double wave_agreement = 0;  ///< tr A / tr E, mean of the waves
  double agreement = 0;       ///< the same of the directions that were chosen
  double noise_ratio = 0;     ///< their w^T N w / w^T A w, as a share of the waves' own; below 1
};

namespace detail {

/// Renders a host in drawn views and asks how its features move waves of the colour.
template <Recipe R, class Views, Executor E>
class WaveProbe {
 public:
  using T = typename R::Scalar;
  using Rows = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

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
  }

  /// Number n of the views of a stage.
  void render(const char* stage, std::size_t n) {
    const Random random(settings_.seed, n, random_stage(stage));
    const auto camera_of = [&](std::size_t i) -> ViewCamera<R> { return views_->camera(i); };
    view_ = random.below(std::uint64_t{1} << 20, views_->size());
    camera_ = drawn_camera(camera_of, views_->size(), view_, random);
    static_cast<void>(pipeline_.forward(*host_, camera_, view_, context_, *executor_));
  }
  /// The waves' means in the view, as they are read from its pixels in 8 bits.
  [[nodiscard]] const std::vector<T>& means() {
    round_to_8bit<T>(context_.image, context_.image);
    decoder_.pool(context_.image, reading_, *executor_);
    return reading_.pooled;
  }
  [[nodiscard]] std::size_t parameters() const { return anchors_.size() * columns_; }
  /// Gradient of wave k to the features of the anchors that are looked at. Call render() before; not means(), which rounds.
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

 private:
  void way_back(const LatticeDecoder<T>& decoder, std::span<T> gradient) {
    T logit = 0;
    const T one = 1;
    context_.d_image_storage.resize(context_.image.size());
    std::fill(context_.d_image_storage.begin(), context_.d_image_storage.end(), T(0));
    context_.d_image = {context_.d_image_storage.data(), 3, context_.image.height, context_.image.width};
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
  BlockHandle feature_;
  std::vector<std::size_t> anchors_;
  std::size_t columns_ = 0, view_ = 0;
  ViewCamera<R> camera_;
};

struct WaveStatistics {
  Eigen::VectorXd mean;
  Eigen::MatrixXd noise, energy, agreement;
};

template <Recipe R, class Views, Executor E>
[[nodiscard]] WaveStatistics wave_statistics(WaveProbe<R, Views, E>& probe, const DecoderFitSettings& settings) {
  using T = typename R::Scalar;
  using Rows = typename WaveProbe<R, Views, E>::Rows;
  const Eigen::Index waves = settings.waves, samples = settings.statistics_views;
  WaveStatistics found;
  Eigen::MatrixXd means(samples, waves);
  for (Eigen::Index n = 0; n < samples; ++n) {
    probe.render("decoder fit", static_cast<std::size_t>(n));
    const std::vector<T>& p = probe.means();
    for (Eigen::Index k = 0; k < waves; ++k) means(n, k) = static_cast<double>(p[static_cast<std::size_t>(k)]);
  }
  found.mean = means.colwise().mean();
  means.rowwise() -= found.mean.transpose();
  found.noise = means.transpose() * means / static_cast<double>(samples);

  // The metric: features that show much are moved less, by the root of their mean square gradient.
  const std::size_t parameters = probe.parameters(), views = static_cast<std::size_t>(settings.gradient_views);
  constexpr std::size_t draws = 6;
  std::vector<T> one(parameters);
  std::vector<double> square(parameters, 0.0);
  for (std::size_t n = 0; n < views; ++n) {
    probe.render("decoder fit gradient", n);
    for (std::size_t d = 0; d < draws; ++d) {
      probe.signed_gradient(n * draws + d, one);
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

  Rows gradient(waves, static_cast<Eigen::Index>(parameters)), sum = Rows::Zero(gradient.rows(), gradient.cols());
  found.energy = Eigen::MatrixXd::Zero(waves, waves);
  for (std::size_t n = 0; n < views; ++n) {
    probe.render("decoder fit gradient", n);
    for (Eigen::Index k = 0; k < waves; ++k) {
      T* const row = gradient.row(k).data();
      probe.wave_gradient(static_cast<std::size_t>(k), {row, parameters});
      for (std::size_t i = 0; i < parameters; ++i) row[i] *= scale[i];
    }
    found.energy += (gradient * gradient.transpose()).template cast<double>();
    sum += gradient;
  }
  const double count = static_cast<double>(views);
  found.agreement = ((sum * sum.transpose()).template cast<double>() - found.energy) / (count * (count - 1));
  found.energy /= count;
  return found;
}

}  // namespace detail

/// The decoder for `host`, whose gradients are used as workspace. `views` has size() and camera(i), of the cameras it was trained on. An Error where
/// nothing can be chosen: no view, or no colour between black and white in any.
template <Recipe R, class Views, Executor E>
[[nodiscard]] Result<DecoderFit<typename R::Scalar>> fit_decoder(Model<R>& host, const Views& views,
                                                                 const DecoderFitSettings& settings, E& executor) {
  using T = typename R::Scalar;
  COMPMARK_ASSERT(settings.bits > 0 && settings.waves >= settings.bits && settings.gradient_views >= 2 &&
                      settings.statistics_views >= settings.waves && settings.anchors > 0,
                  "fit_decoder: settings");
  if (views.size() == 0 || host.anchor_count() == 0) {
    return Error{ErrorKind::invalid, {}, "views", "there is no view or no anchor to fit a decoder to", "give a scene"};
  }
  LatticeSettings shape;
  shape.measure = LatticeMeasure::colour;
  shape.bits = settings.bits;
  shape.features = settings.waves;
  shape.sigma = {0.5};
  shape.stride = 2;
  shape.logit_scale = 8.0 / 3;  // a hinge with the margin of the profile, 4, lets go at 1.5 deviations of the host
  LatticeWeights<T> weights =
      random_lattice<T>(shape, std::vector<double>{settings.period}, settings.seed, settings.spread_octaves);
  detail::WaveProbe<R, Views, E> probe(host, views, shape, weights, settings, executor);
  const detail::WaveStatistics found = detail::wave_statistics(probe, settings);
  const Eigen::Index waves = settings.waves, bits = settings.bits;
  const double noise = found.noise.trace(), energy = found.energy.trace();
  if (!(noise > 0) || !(energy > 0) || !std::isfinite(noise) || !std::isfinite(energy)) {
    return Error{ErrorKind::invalid,
                 {},
                 "host",
                 "its renders hold no colour between black and white",
                 "a scene that can be seen from the cameras of the dataset"};
  }

  const double count = static_cast<double>(waves);
  const Eigen::MatrixXd floor = settings.ridge / count * Eigen::MatrixXd::Identity(waves, waves);
  const Eigen::MatrixXd against = found.noise / noise + floor + settings.conflict_weight * found.energy / energy;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(found.agreement / energy, against);
  if (solver.info() != Eigen::Success) {
    return Error{ErrorKind::invalid, {}, "host", "the statistics of its renders are degenerate", "more views"};
  }
  Eigen::MatrixXd directions = solver.eigenvectors().rightCols(bits);
  DecoderFit<T> fit;
  fit.wave_deviation = std::sqrt(noise / count);
  fit.wave_agreement = found.agreement.trace() / energy;
  double agreeing = 0, moving = 0, noisy = 0;
  for (Eigen::Index b = 0; b < bits; ++b) {
    auto w = directions.col(b);
    const double e = w.dot(found.energy * w), n = w.dot(found.noise * w);
    agreeing += w.dot(found.agreement * w) / e / static_cast<double>(bits);
    moving += w.dot(found.agreement * w);
    noisy += n;
    w *= 1 / std::sqrt(std::sqrt(e) * std::sqrt(n + settings.ridge * noise / count *
                                                        w.squaredNorm()));  // between equal strength and equal noise
  }
  fit.agreement = agreeing;
  fit.noise_ratio = noisy / moving / (noise / found.agreement.trace());

  Eigen::MatrixXd normal(bits, bits);
  const Random random(settings.seed, 0, random_stage("decoder fit rotation"));
  for (Eigen::Index i = 0; i < bits; ++i) {
    for (Eigen::Index j = 0; j < bits; ++j) normal(i, j) = random.normal(static_cast<std::uint64_t>(i * bits + j));
  }
  const Eigen::MatrixXd rotation = Eigen::HouseholderQR<Eigen::MatrixXd>(normal).householderQ();
  Eigen::MatrixXd head = rotation * directions.transpose();
  head *= std::sqrt(static_cast<double>(bits) / (head * found.noise * head.transpose()).trace());
  const Eigen::VectorXd bias = -head * found.mean;
  for (Eigen::Index b = 0; b < bits; ++b) {
    weights.bias[static_cast<std::size_t>(b)] = static_cast<T>(bias[b]);
    for (Eigen::Index k = 0; k < waves; ++k)
      weights.head[static_cast<std::size_t>(b * waves + k)] = static_cast<T>(head(b, k));
  }
  fit.decoder = {shape, std::move(weights)};
  return fit;
}

}  // namespace compmark::inline v0
