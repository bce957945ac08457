// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/evaluate.hpp.
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
#include "compmark/app/detail/lpips_nets.hpp"
#include "compmark/app/evaluate.hpp"
#include "compmark/metric/colour_fit.hpp"
#include "compmark/metric/psnr.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/metric/ssim.hpp"

namespace compmark {
namespace detail {

/// Copies the truth over the render where a pixel counts less than wholly; returns the share of pixels that count.
inline double hide_uncounted(std::span<const float> weight, ImageView<const float> truth, ImageView<float> render) {
  std::size_t counted = 0;
  for (std::size_t i = 0; i < weight.size(); ++i) {
    if (weight[i] >= 0.5f) {  // a pixel counts or it does not; JPEG masks are never quite white
      ++counted;
      continue;
    }
    for (std::size_t c = 0; c < 3; ++c) render.data[c * weight.size() + i] = truth.data[c * weight.size() + i];
  }
  return static_cast<double>(counted) / static_cast<double>(weight.size());
}

}  // namespace detail

COMPMARK_APP_INLINE double counted_psnr(ImageView<const float> image, ImageView<const float> target,
                                        std::span<const float> weight) {
  if (weight.empty()) return psnr(image, target);
  double squares = 0, light = 0, share = 0;  // of the pixels that count; of the others, by their weights
  std::size_t counted = 0;
  for (std::size_t i = 0; i < weight.size(); ++i) {
    const bool counts = weight[i] >= 0.5f;
    const double by = counts ? 1 : static_cast<double>(weight[i]);
    counted += counts;
    share += counts ? 0 : by;
    for (std::size_t c = 0; c < 3; ++c) {
      const double d = static_cast<double>(image.data[c * weight.size() + i]) - target.data[c * weight.size() + i];
      (counts ? squares : light) += by * (d * d);
    }
  }
  if (counted == 0) return share > 0 ? psnr_from_mse(light / (3 * share)) : std::nan("");
  return psnr_from_mse(squares / (3 * static_cast<double>(counted)));
}

COMPMARK_APP_INLINE Result<Evaluation> evaluate_views(AnyModel& model, DatasetViews views,
                                                      const EvaluateSettings& settings, ThreadExecutor& executor,
                                                      const SeenViewObserver& observer) {
  Result<LpipsNets> nets = LpipsNets::open(settings.lpips);
  if (!nets) return nets.error();

  // The gauge of an exposure is free: what the photograph's own exposure costs is told apart.
  const std::vector<std::string>& effects = model.info().effects;
  const bool exposure = std::find(effects.begin(), effects.end(), "exposure") != effects.end();
  Evaluation evaluation;
  Buffer<float> measured_storage, truth_storage, weight_storage;
  const std::array<double, 3> behind = model.render_settings().background;
  const std::array<float, 3> background{static_cast<float>(behind[0]), static_cast<float>(behind[1]),
                                        static_cast<float>(behind[2])};
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Camera<double> camera = views.camera(i);
    const double begin = settings.clock ? settings.clock() : 0;
    const Result<RenderedView> render = model.render(camera, views.lens(i), executor);
    const double end = settings.clock ? settings.clock() : 0;
    if (!render) return render.error();
    const RenderedView& rendered = *render;
    round_to_8bit<float>(rendered.image, rendered.image);
    measured_storage.resize(rendered.image.size());
    std::copy_n(rendered.image.data, rendered.image.size(), measured_storage.data());
    const ImageView<float> measured{measured_storage.data(), 3, camera.height, camera.width};
    truth_storage.resize(rendered.image.size());
    const ImageView<float> truth{truth_storage.data(), 3, camera.height, camera.width};
    weight_storage.resize(truth.plane_size());
    if (Result<Done> loaded = views.load_planes(i, background, {truth, nullptr, weight_storage.data()}); !loaded)
      return loaded.error();
    // Pixels that do not count are made right in a copy of the render, and the error is that of the others.
    const double counted = detail::hide_uncounted(weight_storage.span(), truth, measured);
    if (counted == 0) {
      return Error{ErrorKind::invalid, views.dataset->views[views.index[i]].mask_path.string(), "mask",
                   "leaves no pixel of the view \"" + views.dataset->views[views.index[i]].name + "\" to measure",
                   "correct the mask or remove the view"};
    }

    ViewResult result;
    result.name = views.dataset->views[views.index[i]].name;
    result.psnr = psnr(measured, truth) + 10 * std::log10(counted);
    result.ssim = ssim(measured, truth);
    if (exposure) result.psnr_colour_fitted = psnr_colour_fitted(measured, truth, weight_storage.span());
    const Result<LpipsNets::Distances> distances = nets->between(measured, truth, executor);
    if (!distances) return distances.error();
    result.lpips_alex = distances->alex;
    result.lpips_squeeze = distances->squeeze;
    result.milliseconds = end - begin;
    result.gaussians = rendered.gaussians;
    if (observer) {
      const Result<Done> seen = observer({i, result, ImageView<const float>(rendered.image),
                                          ImageView<const float>(measured), ImageView<const float>(truth)});
      if (!seen) return seen.error();
    }
    evaluation.views.push_back(std::move(result));
  }
  return evaluation;
}

}  // namespace compmark
