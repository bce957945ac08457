// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Measures which scene effects a capture has: for each effect the measured number, its limit and a sentence of evidence
// (docs/spec/effects.md, 1). The list holds only effects above their limits, so that a recipe without the others can be
// chosen. Cost: decodes 128 photographs at most and goes once through the features.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/finish.hpp"
#include "compmark/scene/lens.hpp"
#include "compmark/scene/probe_pixels.hpp"
#include "compmark/scene/probe_sightings.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {

enum class SceneEffect {
  alpha,                ///< transparent photographs: a background of our choice, random while training
  constant_background,  ///< opaque photographs whose border has one colour
  principal_point,      ///< away from the image's centre
  lens_distortion,      ///< radial or tangential
  fisheye,              ///< equidistant lens
  exposure,             ///< the same points are brighter in some photographs
  distance_input,       ///< the same points from near and far
  anti_aliasing,        ///< the same points at different scales
  far_field,            ///< an unbounded scene around the cameras
  forward_facing,       ///< all cameras look the same way from about the same place
  masks                 ///< parts of photographs are to be ignored
};

[[nodiscard]] constexpr const char* effect_name(SceneEffect effect) {
  constexpr std::array<const char*, 11> names{
      "alpha",          "constant_background", "principal_point", "lens_distortion", "fisheye", "exposure",
      "distance_input", "anti_aliasing",       "far_field",       "forward_facing",  "masks"};
  return names[static_cast<std::size_t>(effect)];
}

struct ProbedEffect {
  SceneEffect effect;
  double value = 0;                      ///< what was measured
  double limit = 0;                      ///< above (forward_facing: below) which the effect is called for
  std::string evidence;                  ///< a sentence for the user
  std::array<double, 3> color{0, 0, 0};  ///< constant_background: of the borders, in [0, 1]
};

/// The limits (docs/spec/effects.md, 1).
struct ProbeSettings {
  double border_deviation = 2;       ///< levels
  double principal_point = 0.25;     ///< pixels
  double lens_displacement = 0.25;   ///< pixels
  double exposure_deviation = 0.05;  ///< of the logarithm
  double distance_ratio = 2;         ///< farthest to nearest, for the middle point
  double scale_ratio = 2;            ///< 95 % to 5 % quantile of f / z, for the middle point
  double far_ratio = 3;              ///< 99 % quantile of the depths in the photographs to their middle
  double forward_angle = 30;         ///< degrees from the mean direction
};

namespace detail {

/// Numbers of the cameras and points alone.
struct GeometryEvidence {
  double principal_point = 0, displacement = 0;
  std::string displacement_model;
  bool fisheye = false;
  double distance_ratio = 1, scale_ratio = 1, far_ratio = 0;
  double widest_angle = 180;  ///< degrees of any camera from the mean direction
  double baseline_to_depth = 1;
};

[[nodiscard]] inline GeometryEvidence look_at_geometry(const Dataset& dataset, const Sightings& sightings) {
  GeometryEvidence e;
  std::array<double, 3> forward{};
  double forward_norm = 0;
  const View* previous = nullptr;
  // One camera registered far away would decide distances and depths (scene/extent.hpp).
  const CameraCore core = camera_core(dataset, all_views(dataset), dataset.points);
  for (const View& view : dataset.views) {
    const Camera<double>& c = view.camera;
    e.principal_point =
        std::fmax(e.principal_point, std::fmax(std::abs(c.cx - c.width / 2.0), std::abs(c.cy - c.height / 2.0)));
    for (std::size_t k = 0; k < 3 && core.holds(view); ++k) forward[k] += c.rotation_camera_world[6 + k];
    const bool same = previous != nullptr && previous->lens == view.lens && previous->camera.fx == c.fx &&
                      previous->camera.width == c.width && previous->camera.height == c.height;
    if (!same && !is_pinhole(view.lens)) {
      const double moved = lens_displacement(c, view.lens);
      if (moved > e.displacement) e.fisheye = is_fisheye(view.lens.model);
      e.displacement = std::fmax(e.displacement, moved);
    }
    previous = &view;
  }
  forward_norm = std::hypot(forward[0], forward[1], forward[2]);
  if (forward_norm > 0 && dataset.views.size() >= 3) {
    e.widest_angle = 0;
    for (const View& view : dataset.views) {
      if (!core.holds(view)) continue;
      double cosine = 0;
      for (std::size_t k = 0; k < 3; ++k)
        cosine += view.camera.rotation_camera_world[6 + k] * forward[k] / forward_norm;
      e.widest_angle =
          std::fmax(e.widest_angle, std::acos(std::fmin(1, std::fmax(-1, cosine))) * 180 / std::numbers::pi);
    }
  }
  const CameraSpread spread = camera_spread(dataset);
  std::vector<double> distance_ratios, scale_ratios, depths, scales;
  for (std::size_t i = 0; i < sightings.list.size();) {
    double nearest = HUGE_VAL, farthest = 0;
    scales.clear();
    const std::size_t point = sightings.list[i].point;
    for (; i < sightings.list.size() && sightings.list[i].point == point; ++i) {
      const View& view = dataset.views[sightings.list[i].view];
      if (!core.holds(view)) continue;
      const Camera<double>& camera = view.camera;
      const std::array<double, 3> p = to_camera(camera, sightings.points[point]);
      if (!(p[2] > 0)) continue;
      const double d = std::hypot(p[0], p[1], p[2]);
      nearest = std::fmin(nearest, d);
      farthest = std::fmax(farthest, d);
      scales.push_back(camera.fx / p[2]);
      depths.push_back(p[2]);
    }
    if (scales.size() < 2) continue;
    distance_ratios.push_back(farthest / nearest);
    const double low = quantile(scales, 0.05);
    scale_ratios.push_back(quantile(scales, 0.95) / low);
  }
  if (!distance_ratios.empty()) e.distance_ratio = quantile(distance_ratios, 0.5);
  if (!scale_ratios.empty()) e.scale_ratio = quantile(scale_ratios, 0.5);
  if (!depths.empty()) e.baseline_to_depth = spread.radius / quantile(depths, 0.5);
  // Not the largest distance over the cameras' radius: one wrong match in a thousand is triangulated anywhere. Depth
  // over middle depth has a scale of its own: for cameras around a subject the middle is about their radius, so that a
  // ratio of 2 is the far side of their ball, the farthest that anything inside can be, and 3 is 2 radii from the
  // centre, where contracted cells begin to differ (by a third). Family of tests/scene/probe.test.cpp: everything
  // bounded (subject, rooms, halls, streets, a sphere from inside) stays below 2.6, surroundings at 2.5 radii and more
  // exceed 3 as soon as 2 in a hundred sightings are of them.
  if (!depths.empty() && !dataset.points_are_random) {
    const double middle = quantile(depths, 0.5);
    e.far_ratio = quantile(depths, 0.99) / middle;
  }
  return e;
}

}  // namespace detail

/// Effects that this dataset cannot measure, so that their absence from the list means nothing. Exposure needs COLMAP's
/// features; distances, scales and depths need points that are not random, or else one place where all cameras look.
[[nodiscard]] inline std::vector<SceneEffect> unmeasured_effects(const Dataset& dataset) {
  std::vector<SceneEffect> effects;
  if (!detail::features_of(dataset).are_features) effects.push_back(SceneEffect::exposure);
  if (dataset.points_are_random) {
    for (const SceneEffect effect : {SceneEffect::distance_input, SceneEffect::anti_aliasing, SceneEffect::far_field})
      effects.push_back(effect);
  }
  return effects;
}

/// The effects of a dataset, in the order of SceneEffect.
[[nodiscard]] inline Result<std::vector<ProbedEffect>> probe_scene(const Dataset& dataset,
                                                                   const ProbeSettings& settings = {}) {
  std::vector<ProbedEffect> effects;
  if (dataset.views.empty()) return effects;
  const detail::Sightings sightings = detail::find_sightings(dataset);
  const Result<detail::PixelEvidence> pixels = detail::look_at_pixels(dataset, sightings);
  if (!pixels) return pixels.error();
  const detail::GeometryEvidence e = detail::look_at_geometry(dataset, sightings);
  const auto text = [](double v) { return detail::two_digits(v); };
  const auto call = [&](bool called, SceneEffect effect, double value, double limit, std::string evidence) {
    if (called) effects.push_back({effect, value, limit, std::move(evidence), {}});
  };
  const bool alpha = pixels->transparent > 0;
  call(alpha, SceneEffect::alpha, pixels->transparent, 0,
       text(100 * pixels->transparent) + " % of the pixels are transparent");
  call(!alpha && pixels->border_deviation < settings.border_deviation, SceneEffect::constant_background,
       pixels->border_deviation, settings.border_deviation,
       "the borders of all photographs have the colour " + text(pixels->border[0]) + " " + text(pixels->border[1]) +
           " " + text(pixels->border[2]) + ", with a deviation of " + text(pixels->border_deviation) + " levels");
  if (!effects.empty() && effects.back().effect == SceneEffect::constant_background) {
    for (std::size_t c = 0; c < 3; ++c) effects.back().color[c] = pixels->border[c] / 255;
  }
  call(e.principal_point > settings.principal_point, SceneEffect::principal_point, e.principal_point,
       settings.principal_point, "the principal point is up to " + text(e.principal_point) + " pixels off the centre");
  const bool lens = e.displacement > settings.lens_displacement;
  call(lens && !e.fisheye, SceneEffect::lens_distortion, e.displacement, settings.lens_displacement,
       "the lens moves pixels by up to " + text(e.displacement));
  call(lens && e.fisheye, SceneEffect::fisheye, e.displacement, settings.lens_displacement,
       "the lens is a fisheye, which moves pixels by up to " + text(e.displacement));
  call(pixels->exposure_deviation > settings.exposure_deviation, SceneEffect::exposure, pixels->exposure_deviation,
       settings.exposure_deviation,
       "the same points are brighter or darker by a factor of " + text(std::exp(pixels->exposure_deviation)) +
           " from photograph to photograph");
  call(e.distance_ratio > settings.distance_ratio, SceneEffect::distance_input, e.distance_ratio,
       settings.distance_ratio, "the middle point is seen from distances with a ratio of " + text(e.distance_ratio));
  call(e.scale_ratio > settings.scale_ratio, SceneEffect::anti_aliasing, e.scale_ratio, settings.scale_ratio,
       "the middle point is seen at scales with a ratio of " + text(e.scale_ratio));
  const bool forward = e.widest_angle < settings.forward_angle && e.baseline_to_depth < 0.5;
  call(!forward && e.far_ratio > settings.far_ratio, SceneEffect::far_field, e.far_ratio, settings.far_ratio,
       "the farthest points are " + text(e.far_ratio) + " times as deep as the middle one");
  call(forward, SceneEffect::forward_facing, e.widest_angle, settings.forward_angle,
       "all cameras look within " + text(e.widest_angle) + " degrees of one direction, from a place " +
           text(e.baseline_to_depth) + " times as large as the scene is deep");
  const auto masked = std::count_if(dataset.views.begin(), dataset.views.end(),
                                    [](const View& view) { return !view.mask_path.empty(); });
  call(masked > 0, SceneEffect::masks, static_cast<double>(masked), 0,
       std::to_string(masked) + " photographs have masks");
  return effects;
}

}  // namespace compmark
