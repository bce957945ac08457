// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Run-time numbers of a watermarked training and the phases they resolve to (method sheet, 5.2, 5.4, 5.7). Windows are written for a run of
// 30,000 iterations and scale with the run, as everywhere. Defaults are the published program's, but for image_weight: its 10 for the image's
// losses from iteration 20,000 on is invisible to Adam apart from a jump of the step size (trap A16), so that here the message's weight is a
// tenth instead; the profile "official" sets the published pair.
#pragma once

#include <algorithm>
#include <cstdint>

#include "compmark/core/random.hpp"
#include "compmark/optim/phases.hpp"
#include "compmark/pipeline/mark_losses.hpp"
#include "compmark/quant/distortion.hpp"

namespace compmark::inline v0 {

/// Numbers of a recipe with a watermark; of no meaning to the others.
struct MarkNumbers {
  double lambda_message = 0.045;
  std::int64_t message_after = 20000;  ///< no message before, full weight after message_ramp more
  std::int64_t message_ramp = 5000;
  std::int64_t message_every = 1;  ///< cadence: every n-th iteration, n times the weight; does not scale
  double logit_scale = 0;          ///< 0: the decoder's own
  double lambda_hsv = 0.6;
  std::int64_t hsv_after = 20000;
  double lambda_frequency = 0.1;
  std::int64_t frequency_after = 9999;
  double image_weight = 1;  ///< of every other loss once the message has begun

  double residual_rate = 0.0015;    ///< learning rate of the embedder's residual
  double distortion_rate = 0.001;   ///< learning rate of the distortion layer's network
  double feature_noise = 1;         ///< Q0 of features: uniform noise first, the step of the network later
  double scaling_noise = 0.001;     ///< of exp(scaling), world units, from the first iteration
  double offset_noise = 0.2;        ///< from the first iteration
  std::int64_t noise_after = 3000;  ///< features without noise until here
  std::int64_t adaptive_after = 10000;
  double hard_fraction = 0;     ///< of the adaptive iterations that round instead of drawing noise
  double least_step = 0;        ///< against the collapse of the step, see quant/distortion.hpp
  double step_rate_weight = 0;  ///< likewise

  friend bool operator==(const MarkNumbers&, const MarkNumbers&) = default;
};

/// Which weights and amplitudes hold in which iteration of a run of `total`.
class MarkPhases {
 public:
  MarkPhases() = default;
  MarkPhases(const MarkNumbers& numbers, std::int64_t total)
      : numbers_(numbers),
        message_{scale_iteration(numbers.message_after, total),
                 scale_iteration(numbers.message_after + numbers.message_ramp, total)},
        hsv_after_(scale_iteration(numbers.hsv_after, total)),
        frequency_after_(scale_iteration(numbers.frequency_after, total)),
        noise_after_(scale_iteration(numbers.noise_after, total)),
        adaptive_after_(scale_iteration(numbers.adaptive_after, total)) {}

  [[nodiscard]] MarkWeights weights(std::int64_t t) const {
    MarkWeights weights;
    if (t > message_.begin) {
      const std::int64_t every = std::max<std::int64_t>(1, numbers_.message_every);
      if (t % every == 0) {
        weights.message = numbers_.lambda_message * message_.progress(t) * static_cast<double>(every);
      }
      weights.image = numbers_.image_weight;
    }
    if (t > hsv_after_) weights.hsv = numbers_.lambda_hsv * weights.image;
    if (t > frequency_after_) weights.frequency = numbers_.lambda_frequency * weights.image;
    return weights;
  }

  [[nodiscard]] DistortionPhase distortion(std::int64_t t, std::uint64_t seed) const {
    DistortionPhase phase;
    phase.seed = seed;
    phase.iteration = static_cast<std::uint64_t>(t);
    phase.scaling = numbers_.scaling_noise;
    phase.offset = numbers_.offset_noise;
    if (t > adaptive_after_) {
      phase.adaptive = numbers_.feature_noise != 0;
      if (phase.adaptive && numbers_.hard_fraction > 0) {
        const Random random(seed, phase.iteration, random_stage("hard rounding"));
        phase.round = random.uniform(0) < numbers_.hard_fraction;
      }
    } else if (t > noise_after_) {
      phase.feature_uniform = numbers_.feature_noise;
    }
    return phase;
  }

 private:
  MarkNumbers numbers_;
  Window message_;
  std::int64_t hsv_after_ = 0, frequency_after_ = 0, noise_after_ = 0, adaptive_after_ = 0;
};

}  // namespace compmark::inline v0
