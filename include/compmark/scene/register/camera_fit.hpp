// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The camera from which a picture was rendered, from a camera near it: Levenberg's and Marquardt's damped Gauss-Newton
// on the difference between the picture and the tone-mapped render, with the weights of Geman and McClure,
//     w = 1 / (1 + e^2 / c^2)^2,   e^2 = mean over the channels of (T(render) - picture)^2,   c from the median of e,
// so that what is painted over, or is no part of the scene, does not pull. The render comes from a callable,
//     bool render(const Camera<double>&, ImageView<float> image, ImageView<float> tangents),
// with the derivatives of splat/raster/camera_tangent.hpp in 27 planes. Cost: one call of it a step, and 200
// multiply-adds a pixel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/symmetric.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/register/camera_step.hpp"
#include "compmark/scene/register/fit_sums.hpp"
#include "compmark/scene/register/picture_likeness.hpp"
#include "compmark/scene/register/tone_map.hpp"

namespace compmark {

struct CameraFitSettings {
  int steps = 12;            ///< at most
  double least_scale = .02;  ///< c is not below this: differences as small as this count whole
  double most_scale = .5;
  double damping = 1e-3;    ///< of the first step, a share of the diagonal
  double enough = 1e-3;     ///< pixels: a step that moves the image by less is the last
  double focal_free = .3;   ///< deviation of ln(focal length) from the start that is expected
  double center_free = .2;  ///< the same of the principal point, in widths of the picture
};

struct CameraFit {
  Camera<double> camera;
  ToneMap tone;
  double cost = 0;             ///< mean over the pixels of rho(e) = e^2 / (1 + e^2 / c^2)
  double scale = 0;            ///< c
  double variance = 0;         ///< of one pixel's difference, where it fits
  CameraMatrix information{};  ///< sum of w J^T J / variance, of the steps of camera_step.hpp at this size
  double likeness = 0;         ///< of the render and the picture (picture_likeness.hpp)
  std::vector<float> weight;   ///< [height, width] w of every pixel
  int steps = 0;
};

/// Fits a camera of the picture's size to `picture` [3, height, width], from `start`. The camera is `start` where
/// nothing better was met. A step whose render fails is rejected as one that comes no nearer; where the render of `start`
/// fails, `weight` is empty and nothing was fitted. Deterministic, and the same bits at any thread count if the callable's are.
template <class Render, Executor E>
[[nodiscard]] CameraFit fit_camera(ImageView<const float> picture, const Camera<double>& start,
                                   const CameraFitSettings& settings, const Render& render, E& executor) {
  detail::FitRoom room, trial_room;
  room.resize(picture.width, picture.height);
  trial_room.resize(picture.width, picture.height);
  const double pixels = static_cast<double>(room.error.size());
  CameraFit fit;
  fit.camera = start;
  constexpr double ridge = 1e-4;
  const auto draw = [&](const Camera<double>& camera, detail::FitRoom& into) {
    return render(camera, into.view, into.planes);
  };
  const double center = settings.center_free * std::max(picture.width, picture.height);
  const auto prior = [&](const Camera<double>& camera) {
    const double f = std::log(camera.fx / start.fx) / settings.focal_free, x = (camera.cx - start.cx) / center,
                 y = (camera.cy - start.cy) / center;
    return std::array<double, 3>{f, x, y};
  };
  if (!draw(start, room)) return fit;
  fit.tone = fit_tone(room.view, picture, room.weight.data(), ridge, executor);
  double damping = settings.damping, deviation = 1;
  bool fresh = true;
  detail::FitSums sums;
  for (; fit.steps < settings.steps; ++fit.steps) {
    if (fresh) {
      // Tone and weights take turns: those of the last step, then once more with their own.
      detail::fit_errors(room, picture, fit.tone, executor);
      deviation = std::clamp(detail::fit_deviation(room), 5e-4, settings.most_scale);
      fit.scale = std::clamp(2.5 * deviation, settings.least_scale, settings.most_scale);
      static_cast<void>(detail::fit_sums<false>(room, picture, fit.tone, fit.scale, executor));
      fit.tone = fit_tone(room.view, picture, room.weight.data(), ridge, executor);
      sums = detail::fit_sums<true>(room, picture, fit.tone, fit.scale, executor);
      fresh = false;
    }
    const double noise = 3 * deviation * deviation;  // so much one deviation of the prior weighs
    const std::array<double, 3> away = prior(fit.camera);
    const double cost = sums.cost + noise * (away[0] * away[0] + away[1] * away[1] + away[2] * away[2]);
    const std::array<double, 3> free{settings.focal_free, center, center};
    CameraMatrix h = sums.h;
    CameraStep step;
    for (std::size_t p = 0; p < camera_parameters; ++p) step[p] = -sums.g[p];
    for (std::size_t k = 0; k < 3; ++k) {
      h[packed_index(6 + k, 6 + k)] += noise / (free[k] * free[k]);
      step[6 + k] -= noise * away[k] / free[k];
    }
    for (std::size_t p = 0; p < camera_parameters; ++p)
      h[packed_index(p, p)] += damping * h[packed_index(p, p)] + 1e-12 * sums.h[packed_index(3, 3)] + 1e-30;
    if (!solve_positive(h, camera_parameters, step, 1)) break;
    const Camera<double> next = moved(fit.camera, step);
    if (!draw(next, trial_room)) {  // as a step that comes no nearer
      damping *= 10;
      if (damping > 1e4) break;
      continue;
    }
    std::copy(room.weight.begin(), room.weight.end(), trial_room.weight.begin());
    const ToneMap tone = fit_tone(trial_room.view, picture, trial_room.weight.data(), ridge, executor);
    const detail::FitSums after = detail::fit_sums<false>(trial_room, picture, tone, fit.scale, executor);
    const std::array<double, 3> there = prior(next);
    const double reached = after.cost + noise * (there[0] * there[0] + there[1] * there[1] + there[2] * there[2]);
    if (reached < cost) {
      // How far the image moves: the step's change of the image over that of a pixel's translation.
      double change = 0;
      for (std::size_t p = 0; p < camera_parameters; ++p) {
        for (std::size_t q = 0; q < camera_parameters; ++q)
          change += step[p] * step[q] * sums.h[p >= q ? packed_index(p, q) : packed_index(q, p)];
      }
      const double pixel = (sums.h[packed_index(7, 7)] + sums.h[packed_index(8, 8)]) / 2;
      fit.camera = next;
      fit.tone = tone;
      std::swap(room, trial_room);
      fresh = true;
      damping = std::max(1e-7, damping / 8);
      if (change < settings.enough * settings.enough * pixel) break;
    } else {
      damping *= 10;
      if (damping > 1e4) break;
    }
  }
  detail::fit_errors(room, picture, fit.tone, executor);
  fit.scale = std::clamp(2.5 * detail::fit_deviation(room), settings.least_scale, settings.most_scale);
  sums = detail::fit_sums<true>(room, picture, fit.tone, fit.scale, executor);
  fit.cost = sums.cost / pixels;
  fit.variance = std::max(sums.weighted_square / std::max(sums.weight, 1e-9), 1e-7);
  fit.likeness = picture_likeness(room.view, picture);
  fit.weight = std::move(room.weight);
  for (std::size_t k = 0; k < 45; ++k) fit.information[k] = sums.h[k] / fit.variance;
  return fit;
}

}  // namespace compmark
