// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// How much of a model's error an anchor carries, as 3D-GSW (Jang et al., CVPR 2025) decides what a finished model can
// do without: the gradient, by the colour of a Gaussian, of mean(e * render), e = |render - photograph| held fixed. It
// is the sum over the pixels of e alpha T / (3 height width). Differs from the paper: an anchor's is the largest of its
// Gaussians'. Cost: a render and a backward pass of the rasterizer a view.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/splat/training/recipe.hpp"

namespace compmark {

/// The largest contribution of every anchor of one model to any view and channel.
template <Recipe R>
class ErrorContribution {
 public:
  using Scalar = typename R::Scalar;

  explicit ErrorContribution(const Model<R>& model) : model_(&model), largest_(model.anchor_count(), 0.0) {}

  /// Looks at a view; `photograph` [3, height, width]. An Error where the view shows more than the rasterizer has memory
  /// for (RasterReport::error); then nothing is contributed.
  template <Executor E>
  [[nodiscard]] Result<Done> add_view(const ViewCamera<R>& camera, std::size_t view, ImageView<const Scalar> photograph,
                                      E& executor) {
    ForwardReport rendered = pipeline_.forward(*model_, camera, view, context_, executor);
    if (rendered.raster.error) return std::move(*rendered.raster.error);
    slope_.resize(context_.image.size());
    for (std::size_t i = 0; i < slope_.size(); ++i)
      slope_[i] = std::abs(context_.image.data[i] - photograph.data[i]) / static_cast<Scalar>(slope_.size());
    context_.d_gaussians.resize(context_.gaussians.size());
    context_.d_gaussians.set_zero();
    pipeline_.rasterizer(model_->render, camera)
        .backward(std::as_const(context_.gaussians).columns(), camera.template cast<Scalar>(),
                  pipeline_.background(model_->render),
                  ImageView<const Scalar>{slope_.data(), 3, context_.image.height, context_.image.width},
                  context_.d_gaussians.columns(), context_.raster, executor);
    const std::span<const std::uint32_t> slot = slots();
    const GaussianColumns<const Scalar> gradient = std::as_const(context_.d_gaussians).columns();
    for (std::size_t p = 0; p < gradient.count; ++p) {
      double& largest = largest_[anchor(slot[p])];
      for (std::size_t c = 0; c < 3; ++c) largest = std::max(largest, static_cast<double>(gradient.color[c][p]));
    }
    return Done{};
  }

  /// [anchors], at least 0; 0 where no view sees the anchor.
  [[nodiscard]] std::span<const double> largest() const { return largest_; }

  // Of the last view without an error.
  [[nodiscard]] ImageView<const Scalar> image() const { return context_.image; }
  /// Calls visit(anchor row, centre [3] in the world) for every Gaussian.
  template <class Visit>
  void for_gaussians(const Visit& visit) const {
    const std::span<const std::uint32_t> slot = slots();
    const auto world = context_.gaussians.columns();
    for (std::size_t p = 0; p < world.count; ++p)
      visit(anchor(slot[p]),
            std::array<double, 3>{static_cast<double>(world.mean[0][p]), static_cast<double>(world.mean[1][p]),
                                  static_cast<double>(world.mean[2][p])});
  }

 private:
  [[nodiscard]] std::span<const std::uint32_t> slots() const {
    return pipeline_.decoder().statistics(context_.decoder).gaussian_slot;
  }
  [[nodiscard]] static std::size_t anchor(std::uint32_t slot) {
    return slot / static_cast<std::size_t>(R::AnchorModel::shape.offsets);
  }

  const Model<R>* model_;
  std::vector<double> largest_;
  Pipeline<R> pipeline_;
  typename Pipeline<R>::Context context_;
  Buffer<Scalar> slope_;
};

}  // namespace compmark
