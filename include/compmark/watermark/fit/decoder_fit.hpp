// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Fits a message decoder to one scene: a linear head on Fourier features of colour
// (watermark/decoder/lattice_decoder.hpp). The features of an unmarked scene interfere with a message, and this cover
// interference changes with the view. A mark can move some features alike in all views that see a surface, others only
// in single views. Both are measured on the unmarked model before anything is hidden, and the head reads along
// directions of little interference that a mark moves well. The interference is predicted from the view as far as
// possible, and subtracted (nuisance_subspace.hpp, watermark/decoder/cover_prediction.hpp). With q(v) the rest of the
// features' means in view v, and J(v) their gradient to the anchors' features, in a metric that counts an anchor's
// feature by its effect on the image,
//   noise      N = covariance of q over sampled novel views, clean and after gentle edits,
//   energy     E = mean over v of J(v) J(v)^T         the effect of a mark that is made for one view, in that view,
//   agreement  A = mean over u != v of J(u) J(v)^T    the effect of a mark that is made for one view, in another,
// the bits are read along the directions w of largest w^T A w / w^T (N / n + conflict E / tr E) w, n the variance of
// the features themselves: Fisher's discriminant with the signal's covariance A. A random rotation then mixes these
// directions, so that all bits are equally strong, and the logits are scaled to deviation 1 on the unmarked model. The
// message plays no part, so the p-value of a random key stays exact (docs/verification.md). The decoder belongs to the
// scene and has to be kept, with its hash, like the key. Last, the limit of a region is measured: a region that is much
// louder than the loudest of an ordinary view gets a smaller weight. Measured gain:
// docs/notebook/watermark_experiments.md. Cost: a render and 1 + edits readings for every statistics view, `features`
// backward passes for every gradient view, the kernel ridge regression of all readings, and a render and a reading for
// every view of the limit.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/math/eigen_pairs.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/fit/decoder_fit_settings.hpp"
#include "compmark/watermark/fit/fourier_statistics.hpp"
#include "compmark/watermark/fit/nuisance_subspace.hpp"
#include "compmark/watermark/pretrain/lattice_network.hpp"
#include "compmark/watermark/pretrain/whitening.hpp"

namespace compmark {

template <class T>
struct DecoderFit {
  LatticeDecoder<T> decoder;
  double feature_deviation = 0;  ///< over the views, mean of the features
  double feature_agreement = 0;  ///< tr A / tr E, mean of the features
  double agreement = 0;          ///< the same of the directions that were chosen
  double held_back = 0;          ///< share of the sampled views with a region that is louder than the limit
  double noise_ratio = 0;        ///< their w^T N w / w^T A w, as a share of the features' own; below 1
};

/// The decoder for the model `unmarked`, whose gradients are used as workspace. `views` has size() and camera(i), of
/// the cameras it was trained on. An Error where nothing can be chosen: no view, or no colour between black and
/// white in any; where a view shows more than the rasterizer has memory for (RasterReport::error); of kind cancelled
/// where the observer said stop (decoder_fit_settings.hpp).
template <Recipe R, class Views, Executor E, class O = NoFitObserver, class Jpeg = NoJpeg>
[[nodiscard]] Result<DecoderFit<typename R::Scalar>> fit_decoder(Model<R>& unmarked, const Views& views,
                                                                 DecoderFitSettings settings, E& executor,
                                                                 O&& observer = {}, const Jpeg& jpeg = {}) {
  using T = typename R::Scalar;
  COMPMARK_ASSERT(settings.bits > 0 && settings.features >= settings.bits && settings.gradient_views >= 2 &&
                      settings.statistics_views >= settings.features && settings.anchors > 0 &&
                      settings.coordinates >= 0 && settings.features - settings.coordinates >= settings.bits &&
                      settings.edits_per_view >= 0 && settings.edits_per_view < 16 && settings.edit_weight >= 0 &&
                      settings.edit_weight <= 1 && settings.width > 0 && settings.prediction_ridge > 0 &&
                      settings.regions >= 1 && settings.region_limit >= 0 && settings.limit_views >= 0 &&
                      settings.region_positions > 0 && settings.tone >= 0,
                  "fit_decoder: settings");
  if (views.size() == 0 || unmarked.anchor_count() == 0) {
    return Error{ErrorKind::invalid, {}, "views", "there is no view or no anchor to fit a decoder to", "give a scene"};
  }
  settings.regions = detail::region_count(views, settings);
  LatticeSettings shape;
  shape.measure = LatticeMeasure::colour;
  shape.bits = settings.bits;
  shape.features = settings.features;
  shape.sigma = {settings.blur};
  shape.stride = settings.stride;
  // A hinge with the profile's margin, 4, is satisfied at 2.5 deviations of the unmarked model.
  shape.logit_scale = 1.6;
  LatticeWeights<T> weights =
      random_lattice<T>(shape, std::vector<double>{settings.period}, settings.seed, settings.spread_octaves);
  detail::FourierProbe<R, Views, E> probe(unmarked, views, shape, weights, settings, executor);
  const Result<detail::FourierStatistics> statistics =
      detail::fourier_statistics(probe, settings, executor, observer, jpeg);
  if (!statistics) return statistics.error();
  const detail::FourierStatistics& found = *statistics;
  const std::size_t features = static_cast<std::size_t>(settings.features),
                    bits = static_cast<std::size_t>(settings.bits);
  const double noise = detail::trace(found.noise, features), energy = detail::trace(found.energy, features);
  if (!(noise > 0) || !(energy > 0) || !std::isfinite(noise) || !std::isfinite(energy)) {
    return Error{ErrorKind::invalid,
                 {},
                 "model",
                 "its renders hold no colour between black and white",
                 "a scene that can be seen from the cameras of the dataset"};
  }
  // The directions to choose from: all of them, or the complement of the nuisance subspace less its prediction.
  std::optional<detail::NuisanceComplement> complement = detail::nuisance_complement(found, settings, executor);
  const std::size_t left = complement ? complement->count : 0;
  const double count = static_cast<double>(features);
  std::vector<double> moved, agreeing, against;
  if (complement) {
    moved = detail::seen_along(found.energy, complement->direction, features);
    agreeing = detail::seen_along(found.agreement, complement->direction, features);
    against.resize(left * left);
    for (std::size_t i = 0; i < against.size(); ++i) {
      against[i] = complement->noise[i] / noise + settings.conflict_weight * moved[i] / energy;
      if (i % (left + 1) == 0) against[i] += settings.ridge / count;
    }
  }
  std::optional<EigenPairs> pairs;
  if (complement) pairs = symmetric_eigen_pairs(agreeing, against, left);
  if (!pairs) {
    return Error{ErrorKind::invalid, {}, "model", "the statistics of its renders are degenerate", "give more views"};
  }

  DecoderFit<T> fit;
  fit.feature_deviation = std::sqrt(noise / count);
  fit.feature_agreement = detail::trace(found.agreement, features) / energy;
  double moving = 0, noisy = 0, total_noise = 0;
  for (std::size_t b = 0; b < bits; ++b) {
    double* const w = pairs->vectors.data() + b * left;
    const double e = detail::quadratic(moved, w, left), n = detail::quadratic(complement->noise, w, left);
    const double agreement = detail::quadratic(agreeing, w, left);
    fit.agreement += agreement / e / static_cast<double>(bits);
    moving += agreement;
    noisy += n;
    // Between directions of equal strength and of equal noise.
    double square = 0;
    for (std::size_t k = 0; k < left; ++k) square += w[k] * w[k];
    const double scale = 1 / std::sqrt(std::sqrt(e * (n + settings.ridge * noise / count * square)));
    if (!(scale > 0) || !std::isfinite(scale)) {
      return Error{ErrorKind::invalid,
                   {},
                   "model",
                   "its views agree on fewer directions of colour than there are bits",
                   "fewer bits, or a scene that is seen from more sides"};
    }
    for (std::size_t k = 0; k < left; ++k) w[k] *= scale;
    total_noise += n * scale * scale;
  }
  fit.noise_ratio = noisy / moving * detail::trace(found.agreement, features) / noise;

  const Random random(settings.seed, 0, random_stage("decoder fit rotation"));
  const std::vector<double> rotation = orthonormal_rows(bits, bits, random);
  const double unit = std::sqrt(static_cast<double>(bits) / total_noise);
  std::vector<double> row(left);
  for (std::size_t b = 0; b < bits; ++b) {
    std::fill(row.begin(), row.end(), 0.0);
    for (std::size_t d = 0; d < bits; ++d) {
      for (std::size_t k = 0; k < left; ++k) row[k] += unit * rotation[b * bits + d] * pairs->vectors[d * left + k];
    }
    double bias = 0;
    for (std::size_t k = 0; k < features; ++k) {
      double value = 0;
      for (std::size_t d = 0; d < left; ++d) value += row[d] * complement->direction[d * features + k];
      weights.head[b * features + k] = static_cast<T>(value);
      bias -= value * found.mean[k];
    }
    weights.bias[b] = static_cast<T>(bias);
    complement->add_prediction(b, bits, row, weights.cover);
  }
  if (detail::limit_views(settings) > 0) {
    LatticeSettings limited = shape;
    limited.regions = settings.regions;
    const Result<std::vector<double>> loudest = probe.loudest_regions(limited, weights, observer);
    if (!loudest) return loudest.error();
    limited.region_limit = settings.region_limit * (*loudest)[loudest->size() / 2];
    const auto above = loudest->end() - std::upper_bound(loudest->begin(), loudest->end(), limited.region_limit);
    fit.held_back = static_cast<double>(above) / static_cast<double>(loudest->size());
    if (limited.limited()) shape = limited;
  }
  fit.decoder = {shape, std::move(weights)};
  return fit;
}

}  // namespace compmark
