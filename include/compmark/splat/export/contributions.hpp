// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The contribution of each Gaussian to a view: w = sum over pixels of alpha * transmittance, in pixels. The image is
// sum_p w_p(pixel) c_p + background, so w is the gradient of the image's sum by the colour: one forward and one
// backward pass with an image gradient of one.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/pipeline.hpp"

namespace compmark {

/// The slots (anchor row * K + k) that contribute to one view, ascending, with their contributions in pixels.
struct ViewContributions {
  std::vector<std::uint32_t> visible;  ///< anchor rows that were decoded, ascending
  std::vector<std::pair<std::uint32_t, float>> slots;
};

/// Measures views of one model after another; the workspace is kept. Slots below 1e-4 pixels are left out.
template <Recipe R>
class ContributionMeter {
 public:
  using T = typename R::Scalar;

  /// An Error where the view shows more than the rasterizer has memory for (RasterReport::error).
  template <Executor E>
  [[nodiscard]] Result<ViewContributions> measure(const Model<R>& model, const Camera<double>& camera,
                                                  std::size_t appearance_view, E& executor) {
    ForwardReport rendered = pipeline_.forward(model, camera, appearance_view, context_, executor);
    if (rendered.raster.error) return std::move(*rendered.raster.error);
    context_.d_image_storage.resize(context_.image.size(), T(1));
    context_.d_gaussians.resize(context_.gaussians.size());
    context_.d_gaussians.set_zero();
    const ImageView<const T> ones{context_.d_image_storage.data(), 3, camera.height, camera.width};
    pipeline_.rasterizer(model.render)
        .backward(std::as_const(context_.gaussians).columns(), camera.template cast<T>(),
                  pipeline_.background(model.render), ones, context_.d_gaussians.columns(), context_.raster, executor);
    ViewContributions view;
    view.visible.assign(context_.visible.begin(), context_.visible.end());
    const std::span<const std::uint32_t> slot = pipeline_.decoder().statistics(context_.decoder).gaussian_slot;
    const GaussianColumns<const T> gradient = std::as_const(context_.d_gaussians).columns();
    for (std::size_t p = 0; p < gradient.count; ++p) {
      const float weight = static_cast<float>(gradient.color[0][p]);  // the three channels have the same
      if (weight > 1e-4f) view.slots.emplace_back(slot[p], weight);
    }
    std::sort(view.slots.begin(), view.slots.end());
    return view;
  }

 private:
  Pipeline<R> pipeline_;
  typename Pipeline<R>::Context context_;
};

}  // namespace compmark
