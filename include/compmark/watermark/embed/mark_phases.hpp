// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The schedule of a watermarked training: weights and amplitudes of each iteration (docs/spec/method.md, 5.2, 5.4,
// 5.7). The windows of MarkNumbers are written for a run of 30,000 iterations and scale with the run, as everywhere.
// Cost: none.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "compmark/core/random.hpp"
#include "compmark/splat/optim/phases.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/watermark/embed/distortion.hpp"

namespace compmark {

/// Weights of one iteration.
struct MarkWeights {
  double message = 0;
  double hsv = 0;
  double frequency = 0;
  double image = 1;  ///< of the losses that every recipe has
};

/// The weights and amplitudes of an iteration of a run of `total`.
class MarkPhases {
 public:
  MarkPhases() = default;
  MarkPhases(const MarkNumbers& numbers, std::int64_t total)
      : numbers_(numbers),
        message_{scale_iteration(numbers.message.after, total),
                 scale_iteration(numbers.message.after + numbers.message.ramp, total)},
        hsv_after_(scale_iteration(numbers.hsv.after, total)),
        frequency_after_(scale_iteration(numbers.frequency.after, total)),
        noise_after_(scale_iteration(numbers.distortion.noise_after, total)),
        adaptive_after_(scale_iteration(numbers.distortion.adaptive_after, total)) {}

  [[nodiscard]] MarkWeights weights(std::int64_t t) const {
    MarkWeights weights;
    if (t > message_.begin) {
      const std::int64_t every = std::max<std::int64_t>(1, numbers_.message.every);
      if (t % every == 0) {
        weights.message = numbers_.message.lambda * message_.progress(t) * static_cast<double>(every);
      }
      weights.image = numbers_.message.image_weight;
    }
    if (t > hsv_after_) weights.hsv = numbers_.hsv.lambda * weights.image;
    if (t > frequency_after_) weights.frequency = numbers_.frequency.lambda * weights.image;
    return weights;
  }

  /// Whether the difference to the unmarked renders is in the loss (PosthocEmbedding).
  [[nodiscard]] bool held() const { return numbers_.posthoc.fidelity > 0; }
  /// Weight of the mean square difference to the unmarked render, in an iteration that reads.
  [[nodiscard]] double fidelity() const { return numbers_.posthoc.fidelity * static_cast<double>(novel_view_every()); }
  /// Whether this weight falls with the distance from the photographs.
  [[nodiscard]] bool fidelity_falls() const { return held() && numbers_.posthoc.fidelity_fall > 0; }
  /// The same at a camera that stands `medians` from the nearest photograph (scene/novel_view.hpp): at a median the
  /// same weight, nearer up to twice as much, far away a twentieth. The cost of a mark is to be compared with the
  /// model's own error there, which grows with the distance.
  [[nodiscard]] double fidelity(double medians) const {
    if (!fidelity_falls()) return fidelity();
    constexpr double least = 0.05;
    return fidelity() * std::max(least, 2 / (1 + std::pow(medians, numbers_.posthoc.fidelity_fall)));
  }

  /// The share of the sampled views that orbit a training view.
  [[nodiscard]] double orbit_share() const { return numbers_.posthoc.orbit_share; }
  /// The share of the readings that are held to a photograph.
  [[nodiscard]] double photograph_share() const { return numbers_.posthoc.photograph_share; }

  /// Whether iteration t reads a view between the training views too, and the weight of what it reads.
  [[nodiscard]] bool reads_between(std::int64_t t) const {
    return novel_view_every() > 0 && t % novel_view_every() == 0 && novel_view_weight(t) != 0;
  }
  [[nodiscard]] double novel_view_weight(std::int64_t t) const {
    if (t <= message_.begin) return 0;
    return numbers_.message.lambda * message_.progress(t) * static_cast<double>(novel_view_every());
  }

  [[nodiscard]] DistortionPhase distortion(std::int64_t t, std::uint64_t seed) const {
    DistortionPhase phase;
    phase.seed = seed;
    phase.iteration = static_cast<std::uint64_t>(t);
    phase.scaling = numbers_.distortion.scaling_noise;
    phase.offset = numbers_.distortion.offset_noise;
    phase.rate = weights(t).image;
    if (t > adaptive_after_) {
      phase.adaptive = numbers_.distortion.feature_noise != 0;
      if (phase.adaptive && numbers_.distortion.hard_fraction > 0) {
        const Random random(seed, phase.iteration, random_stage("hard rounding"));
        phase.round = random.uniform(0) < numbers_.distortion.hard_fraction;
      }
    } else if (t > noise_after_) {
      phase.feature_uniform = numbers_.distortion.feature_noise;
    }
    return phase;
  }

 private:
  /// Post-hoc embedding has no other reading: without a number it reads in every iteration.
  [[nodiscard]] std::int64_t novel_view_every() const {
    return held() ? std::max<std::int64_t>(1, numbers_.message.novel_view_every) : numbers_.message.novel_view_every;
  }

  MarkNumbers numbers_;
  Window message_;
  std::int64_t hsv_after_ = 0, frequency_after_ = 0, noise_after_ = 0, adaptive_after_ = 0;
};

}  // namespace compmark
