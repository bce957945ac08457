// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Run-time numbers of a training run and the four named profiles (docs/spec/method.md, 8). Iterations are 1-based;
// every window is written for a run of 30,000 and scales with the run, so --iterations 3000 is the same recipe,
// shorter.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "compmark/splat/training/coarse_to_fine.hpp"

namespace compmark {

/// Initial and final learning rate; equal means constant. Log-linear in between (docs/spec/method.md, 3.2).
struct LearningRate {
  double initial = 0;
  double final = 0;

  friend bool operator==(const LearningRate&, const LearningRate&) = default;
};

/// Numbers of the effects a recipe may have (splat/effect/concept.hpp); of no meaning to the others.
struct EffectNumbers {
  LearningRate exposure{0.005, 0.0005};         ///< of the maps' twelve entries
  double lambda_alpha = 0.1;                    ///< weight of the alpha loss
  std::array<double, 3> space_origin{0, 0, 0};  ///< of the contraction: centre of the cameras
  double space_radius = 0;  ///< … and their radius, which a contracted space needs (scene/far_field.hpp)

  friend bool operator==(const EffectNumbers&, const EffectNumbers&) = default;
};

/// Numbers of the message's stage (stages/message.hpp; windows as below). Defaults are the published program's, but for
/// image_weight: its 10 for the image's losses from iteration 20,000 on is invisible to Adam apart from a jump of the
/// step size (docs/spec/method.md, 7.9), so that here the message's weight is a tenth instead; the profile
/// "official" sets the published pair.
struct MessageSettings {
  double lambda = 0.045;
  std::int64_t after = 20000;  ///< no message before, full weight after `ramp` more
  std::int64_t ramp = 5000;
  std::int64_t every = 1;   ///< cadence: every n-th iteration, n times the weight; does not scale
  double logit_scale = 10;  ///< of the cross entropy; a decoder file states what suits its logits
  double hinge_margin = 0;  ///< above 0: a hinge instead, no pull on a bit that is right by this much (scaled logits)
  double hinge_power = 1;   ///< at least 1: of the hinge, in units of its margin; above 1 wrong bits are pulled harder
  std::int64_t novel_view_every = 0;  ///< every n-th iteration reads a view between two training views too; 0: never
  double image_weight = 1;            ///< of every other loss once the message has begun
  bool sum = false;                   ///< the loss is the sum over the bits, as in the paper, and not their mean
  bool own_scale = false;             ///< logit_scale is that of the profile, whatever a decoder file states
  double edited_share = 0;  ///< of the readings, before which a picture is edited where the decoder can do that

  friend bool operator==(const MessageSettings&, const MessageSettings&) = default;
};

/// Numbers of PosthocEmbedding beyond those of the message and the residual.
struct PosthocSettings {
  /// Above 0: the weight of the mean square difference between marked and unmarked renders in sampled novel views of a
  /// finished model.
  double fidelity = 0;
  /// Above 0 the fidelity is that of a camera which stands as far from the nearest photograph as the median photograph
  /// does; it falls with this power of the distance beyond, and is up to twice as much nearer by. 0: the same
  /// everywhere.
  double fidelity_fall = 0;
  /// The share of the sampled views that is drawn by the message loss near them, 0 (by clearance alone) to 1.
  double draw_by_cost = 0;
  double orbit_share = 0;  ///< of the sampled views that orbit a training view; the others lie between neighbours
  /// The share of the readings that are at a training view, where the fidelity is that to its photograph in place of the
  /// unmarked render: what the mark takes from the scene there, it is taught to make up for. Needs views with
  /// photographs (TrainingViews).
  double photograph_share = 0;
  double lost_anchors =
      0;  ///< largest share of the anchors that is left out of a reading, where the recipe can do that
  /// Where the context reads ancestors (ContextGS): iterations between step-bias calibrations
  /// (codec/model/step_bias_calibration.hpp); 0: never. Does not scale.
  std::int64_t calibrate_steps_every = 0;

  friend bool operator==(const PosthocSettings&, const PosthocSettings&) = default;
};

/// The image whose hues decide which pixels are saturated. If it is the render alone (as released), a wrong colour can
/// leave the mask and is then free.
enum class HueSource : std::uint8_t { rendered, target, either };

/// Numbers of the loss of saturated colours (docs/spec/method.md, 5.4).
struct HsvSettings {
  double lambda = 0.6;
  bool as_written = false;  ///< saturated colours by the paper's thresholds, not by those that were released
  HueSource source = HueSource::rendered;
  std::int64_t after = 20000;

  friend bool operator==(const HsvSettings&, const HsvSettings&) = default;
};

/// Numbers of the loss of frequencies, and of growing by its error map.
struct FrequencySettings {
  double lambda = 0.1;
  std::int64_t after = 9999;
  std::int64_t grow_from = 10000,
               grow_until = 15000;  ///< window of frequency-aware growing; it looks where the loss is on
  /// Of the error beside its median: where growing looks; the paper's is -0.3 to 0.3.
  double band_lowest = 0.1, band_highest = 0.3;
  int side = 0;                   ///< images are brought to side x side first, as released: 1024; 0: their own size
  bool high_pass = false;         ///< the filter passes high frequencies alone; else all but a ring, as released
  bool published_pixels = false;  ///< growing looks at the pixel that the released program takes, not at the true one

  friend bool operator==(const FrequencySettings&, const FrequencySettings&) = default;
};

/// Numbers of the embedder's residual (stages/embedder.hpp).
struct ResidualSettings {
  double learning_rate = 0.0015;
  double decay = 1;        ///< of that rate, over the iterations in which the residual trains
  std::int64_t after = 0;  ///< the residual is zero until here, and the run to the bit that of the unmarked model
  /// Of explicit Gaussians that are marked post hoc: spherical harmonics above this degree stay as they are, since the
  /// file that is written has none. 3: all of them move.
  int harmonics = 3;

  friend bool operator==(const ResidualSettings&, const ResidualSettings&) = default;
};

/// Numbers of the distortion layer (stages/distortion.hpp; docs/spec/method.md, 5.2).
struct DistortionSettings {
  double learning_rate = 0.001;     ///< of the layer's network
  double feature_noise = 1;         ///< Q0 of features: uniform noise first, the step of the network later
  double scaling_noise = 0.001;     ///< of exp(scaling), world units, from the first iteration
  double offset_noise = 0.2;        ///< from the first iteration
  std::int64_t noise_after = 3000;  ///< features without noise until here
  std::int64_t adaptive_after = 10000;
  double hard_fraction = 0;  ///< of the adaptive iterations that round instead of drawing noise
  double least_step = 0;     ///< against the collapse of the step, see watermark/embed/distortion.hpp
  double rate_weight = 0;    ///< likewise; held_step_rate in the profiles of CompMarkGS

  friend bool operator==(const DistortionSettings&, const DistortionSettings&) = default;
};

/// Numbers of the stages of a watermark, each stage's its own; of no meaning to a recipe without the stage.
struct MarkNumbers {
  MessageSettings message;
  PosthocSettings posthoc;
  HsvSettings hsv;
  FrequencySettings frequency;
  ResidualSettings residual;
  DistortionSettings distortion;

  std::string identity;  ///< hash of message, decoder and the model begun from; a run is resumed with the same alone

  friend bool operator==(const MarkNumbers&, const MarkNumbers&) = default;
};

/// Numbers of a recipe with an entropy model, of which the coded size is a loss; of no meaning to the others
/// (docs/spec/compression.md, 1.6 to 1.8; windows as below).
struct RateNumbers {
  double lambda = 0.001;               ///< loss of one bit more a coded scalar
  std::int64_t noise_after = 3000;     ///< attributes carry the noise of the base steps from here
  std::int64_t context_after = 10000;  ///< … that of the predicted steps, and the rate counts, from here
  std::int64_t round_after = 30000;    ///< steps round instead of drawing noise from here
  double mask_weight = 5e-4;           ///< of the mean sigmoid of the masks' logits, from context_after
  double sample = 0;  ///< share of all anchors whose bits are counted in an iteration; 0: what the entropy model says
  double step_share = 0;            ///< share of the others that teach their steps; 0: what the entropy model says
  double feature_step = 1;          ///< Q0
  double scaling_step = 0.001;      ///< of exp(scaling), world units
  double offset_step = 0.2;         ///< of offsets, which are in units of exp(scaling)
  LearningRate mask{0.01, 0.0001};  ///< in units of the scene extent
  LearningRate grid{0.005, 0.00001};
  LearningRate context{0.005, 0.00001};
  double hyperprior = 0.0075;  ///< of ContextGS' z

  friend bool operator==(const RateNumbers&, const RateNumbers&) = default;
};

struct TrainSettings {
  std::string profile = "scaffold";
  std::int64_t iterations = 30000;
  std::uint64_t seed = 0;

  // losses
  double lambda_dssim = 0.2;
  double lambda_volume = 0.01;

  // learning rates; offsets are in units of the scene extent
  LearningRate offset{0.01, 0.0001};
  LearningRate feature{0.0075, 0.0075};
  LearningRate scaling{0.007, 0.007};
  LearningRate mlp_opacity{0.002, 0.00002};
  LearningRate mlp_covariance{0.004, 0.004};
  LearningRate mlp_color{0.008, 0.00005};
  LearningRate feature_bank{0.01, 0.00001};
  LearningRate appearance{0.05, 0.0005};

  // anchors
  double voxel_size = 0.001;       ///< world units; 0 or less: the median distance of nearest neighbours
  int init_factor = 16;            ///< growing starts at cells of voxel_size * init_factor
  std::size_t max_anchors = 0;     ///< 0: no limit
  std::int64_t most_revivals = 3;  ///< a training that died is brought back so often (splat/training/revival.hpp)

  // density control; windows in iterations of a 30,000 run, scaled to this run
  double gradient_threshold = 0.0002;
  double success_threshold = 0.8;
  double min_opacity = 0.005;
  std::int64_t statistics_after = 500;
  std::int64_t grow_after = 1500;
  std::int64_t grow_until = 15000;
  std::int64_t pause_from = 0, pause_until = 0;  ///< no adjustment for pause_from <= t < pause_until
  std::int64_t grow_interval = 100;              ///< not scaled: it counts visits

  // rendering
  double near_plane = 0.2;
  double blur_variance = 0.3;
  std::array<float, 3> background{0, 0, 0};

  CoarseToFine coarse_to_fine;  ///< sizes at which the photographs are looked at; by default their own alone

  EffectNumbers effects;
  MarkNumbers mark;
  RateNumbers rate;
};

/// A mark in the loss of the photographs, which trains everything. It is published, with numbers measured here
/// (docs/notebook/watermark_experiments.md): it begins when growing ends, has a hinge with a margin, and is also read
/// in sampled novel views.
[[nodiscard]] inline MarkNumbers mark_in_the_photographs() {
  MarkNumbers mark;
  mark.message.lambda = 0.002;
  mark.message.after = mark.residual.after = 15000;
  mark.message.hinge_margin = 4;
  mark.message.novel_view_every = 1;
  mark.residual.learning_rate = 0.002;
  return mark;
}
/// A mark for post-hoc embedding in a finished model (PosthocEmbedding; docs/notebook/watermark_experiments.md).
[[nodiscard]] inline MarkNumbers posthoc_mark() {
  MarkNumbers mark = mark_in_the_photographs();
  mark.message.lambda = 0.25;
  mark.message.ramp = 0;
  mark.posthoc.fidelity = 3000;
  mark.posthoc.fidelity_fall = 2;
  mark.residual.learning_rate = 0.006;
  mark.residual.decay = 0.05;
  return mark;
}

/// A profile's numbers inside a codec: growing pauses while features carry noise for the first time, as both
/// codecs' authors have it (docs/spec/method.md, 5.8).
[[nodiscard]] inline TrainSettings for_codec(TrainSettings settings) {
  settings.pause_from = 3000;
  settings.pause_until = 4000;
  return settings;
}

/// The rate weight that holds the step of the distortion layer in the profiles of CompMarkGS. Nothing that is published
/// holds it, so that it falls until the layer does nothing (docs/spec/method.md, 7.11).
inline constexpr double held_step_rate = 0.001;

/// "scaffold": Scaffold-GS defaults. "hac": those with the pause in growing that the codecs' authors make. "official":
/// what the published CompMarkGS code does. "paper": what its paper says.
[[nodiscard]] inline std::optional<TrainSettings> profile_settings(std::string_view profile) {
  TrainSettings settings;
  settings.profile = std::string(profile);
  if (profile == "scaffold" || profile == "hac") {
    settings.mark = mark_in_the_photographs();
    return profile == "hac" ? for_codec(settings) : settings;
  }
  if (profile == "official") {
    settings.seed = 42;
    settings.lambda_dssim = 0.35;
    settings.gradient_threshold = 0.0007;
    settings.grow_after = 500;  // the published test of update_from was dropped: docs/spec/method.md, 4.2
    settings.pause_from = 3000;
    settings.pause_until = 4000;
    settings.mark.message.lambda = 0.45;
    settings.mark.message.image_weight = 10;
    settings.mark.frequency.side = 1024;
    settings.mark.frequency.published_pixels = true;
    settings.mark.distortion.rate_weight = held_step_rate;
    return settings;
  }
  if (profile == "paper") {
    settings.seed = 42;
    settings.mark.message.after = settings.mark.message.ramp = 0;
    settings.mark.message.sum = settings.mark.message.own_scale = true;
    settings.mark.message.logit_scale = 1;
    settings.mark.frequency.band_lowest = -0.3;
    settings.mark.frequency.high_pass = true;
    settings.mark.distortion.scaling_noise = settings.mark.distortion.offset_noise = 0;
    settings.mark.distortion.rate_weight = held_step_rate;
    settings.mark.hsv.as_written = true;
    settings.grow_after = 1599;
    return settings;
  }
  return std::nullopt;
}

}  // namespace compmark
