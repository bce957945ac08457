// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The settings of a run as JSON, for checkpoints: a run is resumed with the same settings alone.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>

#include "compmark/splat/training/settings.hpp"

namespace compmark {

/// Every number that changes what a run computes. Two runs with equal objects continue each other.
template <class Json = nlohmann::json>
[[nodiscard]] Json settings_json(const TrainSettings& s) {
  const auto rate = [](const LearningRate& r) { return Json{r.initial, r.final}; };
  Json json;
  json["profile"] = s.profile;
  json["iterations"] = s.iterations;
  json["seed"] = s.seed;
  json["lambda_dssim"] = s.lambda_dssim;
  json["lambda_volume"] = s.lambda_volume;
  json["offset"] = rate(s.offset);
  json["feature"] = rate(s.feature);
  json["scaling"] = rate(s.scaling);
  json["mlp_opacity"] = rate(s.mlp_opacity);
  json["mlp_covariance"] = rate(s.mlp_covariance);
  json["mlp_color"] = rate(s.mlp_color);
  json["feature_bank"] = rate(s.feature_bank);
  json["appearance"] = rate(s.appearance);
  json["voxel_size"] = s.voxel_size;
  json["init_factor"] = s.init_factor;
  json["max_anchors"] = s.max_anchors;
  if (s.most_revivals != 3) json["most_revivals"] = s.most_revivals;  // checkpoints are older than this number
  json["gradient_threshold"] = s.gradient_threshold;
  json["success_threshold"] = s.success_threshold;
  json["min_opacity"] = s.min_opacity;
  json["statistics_after"] = s.statistics_after;
  json["grow_after"] = s.grow_after;
  json["grow_until"] = s.grow_until;
  json["pause_from"] = s.pause_from;
  json["pause_until"] = s.pause_until;
  json["grow_interval"] = s.grow_interval;
  json["near_plane"] = s.near_plane;
  json["blur_variance"] = s.blur_variance;
  json["background"] = s.background;
  for (const CoarseLevel& level : s.coarse_to_fine.levels)
    json["coarse_to_fine"].push_back({level.factor, level.until});
  // Named only where they were changed: a run without effects has the bytes it had before there were any.
  if (s.effects != EffectNumbers{}) {
    Json& effects = json["effects"];
    effects["exposure"] = rate(s.effects.exposure);
    effects["lambda_alpha"] = s.effects.lambda_alpha;
    effects["space_origin"] = s.effects.space_origin;
    effects["space_radius"] = s.effects.space_radius;
  }
  const std::optional<TrainSettings> profile = profile_settings(s.profile);
  if (const MarkNumbers& m = s.mark; m != (profile ? profile->mark : MarkNumbers{})) {
    Json& mark = json["mark"];
    mark["lambda_message"] = m.message.lambda;
    mark["message_after"] = m.message.after;
    mark["message_ramp"] = m.message.ramp;
    mark["message_every"] = m.message.every;
    mark["logit_scale"] = m.message.logit_scale;
    mark["hinge_margin"] = m.message.hinge_margin;
    if (m.message.hinge_power != 1) mark["hinge_power"] = m.message.hinge_power;  // as fidelity
    mark["between_every"] = m.message.novel_view_every;
    if (m.posthoc.fidelity != 0) mark["fidelity"] = m.posthoc.fidelity;  // checkpoints are older than this number
    if (m.posthoc.fidelity_fall != 0) mark["fidelity_fall"] = m.posthoc.fidelity_fall;
    if (m.message.sum) mark["message_sum"] = true;
    if (m.message.own_scale) mark["own_logit_scale"] = true;
    if (m.message.edited_share != 0) mark["edited_share"] = m.message.edited_share;
    if (m.posthoc.lost_anchors != 0) mark["lost_anchors"] = m.posthoc.lost_anchors;
    if (m.posthoc.draw_by_cost != 0) mark["draw_by_cost"] = m.posthoc.draw_by_cost;
    if (m.posthoc.orbit_share != 0) mark["orbit_share"] = m.posthoc.orbit_share;
    if (m.posthoc.photograph_share != 0) mark["photograph_share"] = m.posthoc.photograph_share;
    if (m.posthoc.calibrate_steps_every != 0) mark["hold_steps_every"] = m.posthoc.calibrate_steps_every;
    mark["lambda_hsv"] = m.hsv.lambda;
    if (m.hsv.as_written) mark["hsv_as_written"] = true;  // as fidelity
    if (m.hsv.source != HueSource::rendered) mark["hsv_source"] = static_cast<int>(m.hsv.source);
    mark["hsv_after"] = m.hsv.after;
    mark["lambda_frequency"] = m.frequency.lambda;
    mark["frequency_after"] = m.frequency.after;
    if (m.frequency.grow_from != 10000 || m.frequency.grow_until != 15000)
      mark["frequency_grow"] = {m.frequency.grow_from, m.frequency.grow_until};
    if (m.frequency.band_lowest != 0.1 || m.frequency.band_highest != 0.3)
      mark["frequency_band"] = {m.frequency.band_lowest, m.frequency.band_highest};
    if (m.frequency.side != 0) mark["frequency_side"] = m.frequency.side;
    if (m.frequency.high_pass) mark["frequency_high_pass"] = true;
    if (m.frequency.published_pixels) mark["frequency_published_pixels"] = true;
    mark["image_weight"] = m.message.image_weight;
    mark["residual_rate"] = m.residual.learning_rate;
    mark["residual_decay"] = m.residual.decay;
    mark["residual_after"] = m.residual.after;
    if (m.residual.harmonics != 3) mark["residual_harmonics"] = m.residual.harmonics;
    mark["distortion_rate"] = m.distortion.learning_rate;
    mark["feature_noise"] = m.distortion.feature_noise;
    mark["scaling_noise"] = m.distortion.scaling_noise;
    mark["offset_noise"] = m.distortion.offset_noise;
    mark["noise_after"] = m.distortion.noise_after;
    mark["adaptive_after"] = m.distortion.adaptive_after;
    mark["hard_fraction"] = m.distortion.hard_fraction;
    mark["least_step"] = m.distortion.least_step;
    mark["step_rate_weight"] = m.distortion.rate_weight;
    mark["identity"] = m.identity;
  }
  if (const RateNumbers& r = s.rate; r != (profile ? profile->rate : RateNumbers{})) {
    Json& rates = json["rate"];
    rates["lambda"] = r.lambda;
    rates["noise_after"] = r.noise_after;
    rates["context_after"] = r.context_after;
    rates["round_after"] = r.round_after;
    rates["mask_weight"] = r.mask_weight;
    rates["sample"] = r.sample;
    if (r.step_share != 0) rates["step_share"] = r.step_share;  // checkpoints are older than this number
    rates["feature_step"] = r.feature_step;
    rates["scaling_step"] = r.scaling_step;
    rates["offset_step"] = r.offset_step;
    rates["mask"] = rate(r.mask);
    rates["grid"] = rate(r.grid);
    rates["context"] = rate(r.context);
    rates["hyperprior"] = r.hyperprior;
  }
  return json;
}

}  // namespace compmark
