// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Registration: the camera from which a picture shows the scene of a model, however the picture was cut, scaled, turned
// by up to 30 degrees, recoloured or covered in part (docs/registration.md).
//   auto places = register_places(model, {}, threads);                     // once a model
//   auto found = register_picture(model, *places, picture, {}, threads);   // Result<Registration>
// Candidates by the gradients of small renders, then Gauss-Newton on the picture itself, coarse to fine. No state, no
// clock; the same bits at any thread count. Cost: 300 small renders a model; 30 to 150 renders a picture.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/register_places.hpp"
#include "compmark/app/register_render.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/mirror.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/register/camera_fit.hpp"
#include "compmark/scene/register/camera_search.hpp"

namespace compmark {

/// Where a picture was taken.
struct Registration {
  bool found = false;             ///< likeness >= RegisterSettings::enough
  bool mirrored = false;          ///< `camera` is that of the mirrored picture
  Camera<double> camera;          ///< of the picture's size, in the model's coordinates
  ToneMap tone;                   ///< from the render to the picture
  double likeness = 0;            ///< of the gradients of render and picture, at most 1, at 128 pixels
  double uncertainty_pixels = 0;  ///< rms over what is in view, if differences are independent noise
  int fit_width = 0, fit_height = 0;
  std::vector<float> weight;  ///< [fit_height, fit_width] 1 where the picture fits, 0 where it shows something else
};

namespace detail {

[[nodiscard]] inline double register_native_focal(const AnyModel& model) {
  std::vector<double> focal;
  for (const StoredView& view : model.info().views) focal.push_back(view.camera.fx);
  COMPMARK_ASSERT(!focal.empty(), "register_native_focal: places are of a model with cameras");
  std::nth_element(focal.begin(), focal.begin() + static_cast<std::ptrdiff_t>(focal.size() / 2), focal.end());
  return focal[focal.size() / 2];
}

/// How far points of the scene may be from where the camera puts them: root mean square over the opaque Gaussians in
/// view of the deviation that the information of the fit leaves, pixels of the fit.
[[nodiscard]] inline double register_uncertainty(const CameraFit& fit, const CameraFitSettings& settings,
                                                 GaussianColumns<const float> drawn) {
  const Camera<double>& camera = fit.camera;
  const double center = settings.center_free * std::max(camera.width, camera.height);
  CameraMatrix information = fit.information;
  const std::array<double, 3> free{settings.focal_free, center, center};
  for (std::size_t k = 0; k < 3; ++k) information[packed_index(6 + k, 6 + k)] += 1 / (free[k] * free[k]);
  std::array<double, 81> covariance{};
  for (std::size_t k = 0; k < camera_parameters; ++k) covariance[10 * k] = 1;
  if (!solve_positive(information, camera_parameters, covariance, camera_parameters)) return INFINITY;
  double sum = 0;
  std::size_t count = 0;
  const std::size_t stride = std::max<std::size_t>(1, drawn.count / 4096);
  for (std::size_t i = 0; i < drawn.count; i += stride) {
    if (!(drawn.opacity[i] > 0.5f)) continue;
    std::array<double, 3> p{};
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = 0; c < 3; ++c)
        p[r] +=
            camera.rotation_camera_world[3 * r + c] * (static_cast<double>(drawn.mean[c][i]) - camera.center_world[c]);
    }
    if (!(p[2] > 1e-6)) continue;
    const double x = p[0] / p[2], y = p[1] / p[2], u = camera.fx * x, v = camera.fy * y;
    if (!(u + camera.cx >= 0 && u + camera.cx <= camera.width && v + camera.cy >= 0 && v + camera.cy <= camera.height))
      continue;
    const double fx = camera.fx, fy = camera.fy, z = 1 / p[2];
    const std::array<std::array<double, 9>, 2> move{
        {{-fx * x * y, fx * (1 + x * x), -fx * y, fx * z, 0, -fx * x * z, u, 1, 0},
         {-fy * (1 + y * y), fy * x * y, fy * x, 0, fy * z, -fy * y * z, v, 0, 1}}};
    for (const std::array<double, 9>& m : move) {
      for (std::size_t a = 0; a < 9; ++a) {
        for (std::size_t b = 0; b < 9; ++b) sum += m[a] * covariance[9 * a + b] * m[b];
      }
    }
    ++count;
  }
  return count == 0 ? INFINITY : std::sqrt(sum / static_cast<double>(count));
}

}  // namespace detail

/// The least side of a picture whose camera is looked for, pixels.
inline constexpr int register_least_side = 32;

/// Finds the camera of a picture [3, height, width] of colours in [0, 1]. Error: a side below register_least_side, or
/// one of AnyModel::render. A picture of something else, or of one colour, is no error: `found` is false.
[[nodiscard]] inline Result<Registration> register_picture(AnyModel& model, std::span<const SearchPlace> places,
                                                           ImageView<const float> picture,
                                                           const RegisterSettings& settings, ThreadExecutor& executor) {
  if (std::min(picture.width, picture.height) < register_least_side)
    return Error{ErrorKind::invalid, "", "size",
                 "is " + std::to_string(picture.width) + " x " + std::to_string(picture.height) +
                     " pixels, too little to find a camera",
                 "give pictures of at least " + std::to_string(register_least_side) + " pixels a side"};
  if (places.empty()) return Registration{};
  const int longest = std::max(picture.width, picture.height);
  // Mirrored pictures are candidates like the others.
  std::vector<float> turned;
  std::array<ImageView<const float>, 2> sides{picture, picture};
  if (settings.mirrored) {
    turned.assign(picture.data, picture.data + picture.size());
    const ImageView<float> view{turned.data(), 3, picture.height, picture.width};
    mirror_rows(view);
    sides[1] = view;
  }
  struct Candidate {
    CameraFit fit;
    std::size_t side, group;
  };
  detail::RegisterRender render(model, detail::register_native_focal(model), executor);
  bool failed = false;
  const auto fitted = [&](const Candidate& from, int size, const CameraFitSettings& fit) {
    const detail::RegisterPicture small(sides[from.side], size, executor);
    const auto draw = [&](const Camera<double>& camera, ImageView<float> image, ImageView<float> tangents) {
      return render(camera, image, tangents);
    };
    Candidate to{
        fit_camera(small.view, from.fit.camera.resized(small.view.width, small.view.height), fit, draw, executor),
        from.side, from.group};
    failed = to.fit.weight.empty();  // not even the camera that it began with is drawn; failed steps were rejected
    return to;
  };
  const auto by_likeness = [](const Candidate& a, const Candidate& b) { return a.fit.likeness > b.fit.likeness; };

  std::vector<Candidate> candidates;
  for (std::size_t side = 0; side < (settings.mirrored ? 2 : 1); ++side) {
    for (const SearchMatch& match : search_cameras(places, sides[side], SearchSettings{}, places.size(), executor)) {
      candidates.push_back({{}, side, places[match.place].group});
      candidates.back().fit.camera = match.camera;
      candidates.back().fit.likeness = match.likeness;
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), by_likeness);
  // The best of each group: those of wrong assumptions are more, and would crowd out the right ones.
  std::vector<std::size_t> taken;
  std::vector<Candidate> kept;
  for (Candidate& candidate : candidates) {
    taken.resize(std::max(taken.size(), candidate.group + 1));
    if (taken[candidate.group]++ < settings.candidates) kept.push_back(std::move(candidate));
  }
  candidates = std::move(kept);
  if (candidates.empty()) return Registration{};

  // In order of likeness, until one is certain; then the best two at twice the size.
  CameraFitSettings fit;
  fit.steps = 20;
  fit.damping = 1e-4;
  fit.least_scale = .1;
  fit.enough = .02;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    candidates[i] = fitted(candidates[i], 64, fit);
    if (failed) return render.error();
    if (candidates[i].fit.likeness > .9) candidates.resize(i + 1);
  }
  std::stable_sort(candidates.begin(), candidates.end(), by_likeness);
  // What is nowhere near after the first fit is no picture of the scene; another look would take as long again.
  candidates.resize(std::min<std::size_t>(candidates.front().fit.likeness < .3 ? 1 : 2, candidates.size()));
  fit.steps = 20;
  fit.damping = 1e-5;
  fit.least_scale = .05;
  fit.enough = .01;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    candidates[i] = fitted(candidates[i], 128, fit);
    if (failed) return render.error();
    if (candidates[i].fit.likeness > .95) candidates.resize(i + 1);
  }
  std::stable_sort(candidates.begin(), candidates.end(), by_likeness);
  Candidate best = std::move(candidates.front());
  // Some valleys are long: one that comes nearer is given time.
  if (best.fit.likeness > .45 && best.fit.likeness < .95) {
    fit.steps = 30;
    best = fitted(best, 128, fit);
    if (failed) return render.error();
  }
  Registration result;
  result.mirrored = best.side == 1;
  result.likeness = best.fit.likeness;
  result.found = result.likeness >= settings.enough;

  fit.damping = 1e-6;
  if (result.found) {
    const int finest = std::min(longest, settings.finest);
    if (finest > 192) {
      fit.steps = 12;
      fit.least_scale = .03;
      best = fitted(best, std::min(256, (finest + 128) / 2), fit);
      if (failed) return render.error();
    }
    fit.steps = 20;
    fit.least_scale = .02;
    fit.enough = 1e-3;
    const Candidate smaller = fitted(best, finest, fit);
    if (failed) return render.error();
    best = smaller;
    if (finest == longest) {
      // A render as it was made: its blur is of these very pixels.
      render.rendered_at_this_size(true);
      Candidate same = fitted(smaller, finest, fit);
      if (failed) return render.error();
      if (same.fit.cost < smaller.fit.cost) best = std::move(same);
    }
  }
  if (render.drawn().count == 0) {  // the last step may have failed
    if (const Result<RenderedView> seen = render.look(best.fit.camera); !seen) return seen.error();
  }
  result.camera = best.fit.camera.resized(picture.width, picture.height);
  result.tone = best.fit.tone;
  result.uncertainty_pixels = detail::register_uncertainty(best.fit, fit, render.drawn()) *
                              static_cast<double>(longest) / std::max(best.fit.camera.width, best.fit.camera.height);
  result.fit_width = best.fit.camera.width;
  result.fit_height = best.fit.camera.height;
  result.weight = std::move(best.fit.weight);
  return result;
}

}  // namespace compmark
