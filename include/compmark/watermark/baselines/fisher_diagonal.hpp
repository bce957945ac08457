// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// How much the renders say of an anchor: the diagonal of the Fisher information of its features and offsets,
//   H = sum over views, pixels, channels and parameters of (d render / d parameter)^2,
// as FisherRF (Jiang et al., ECCV 2024) has it and GaussianMarker (Huang et al., NeurIPS 2024) takes it. Where H is
// small, the renders leave the anchor uncertain. A sum of squares over pixels is no gradient of a scalar, so it is
// estimated: with signs e of +1 and -1 drawn for every pixel and channel, the expectation of (d sum e render / d
// parameter)^2 is the sum of the squares. Differs from the paper, which squares inside a rasterizer of its own, and
// sums over places and spherical harmonics: anchors have features and offsets. Cost: one render and one backward pass a
// view.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/splat/training/recipe.hpp"

namespace compmark {

/// The information of every anchor of one model, view after view.
template <Recipe R>
class FisherDiagonal {
 public:
  using Scalar = typename R::Scalar;

  explicit FisherDiagonal(const Model<R>& model) : model_(model), information_(model.anchor_count(), 0.0) {}

  /// ADDS a view's part, estimated with the signs of (seed, view). An Error where the view shows more than the
  /// rasterizer has memory for (RasterReport::error); then nothing is added.
  template <Executor E>
  [[nodiscard]] Result<Done> add_view(const ViewCamera<R>& camera, std::size_t view, std::uint64_t seed, E& executor) {
    const Random random(seed, view, random_stage("fisher signs"));
    return add_squares(
        camera, view,
        [&](ImageView<Scalar> slope) {
          for (std::size_t i = 0; i < slope.size(); ++i) slope.data[i] = Scalar(random.bits(i) >> 63 != 0 ? 1 : -1);
        },
        executor);
  }
  /// ADDS the squares of the gradient of sum slope * render, where `fill` sets the slope [3, height, width]. Errors
  /// are those of add_view.
  template <class Fill, Executor E>
  [[nodiscard]] Result<Done> add_squares(const ViewCamera<R>& camera, std::size_t view, const Fill& fill, E& executor) {
    auto& arena = model_.arena;
    for (Scalar& gradient : arena.all_gradients()) gradient = Scalar(0);
    ForwardReport rendered = pipeline_.forward(model_, camera, view, context_, executor);
    if (rendered.raster.error) return std::move(*rendered.raster.error);
    pipeline_.begin_loss(context_);
    fill(context_.d_image);
    pipeline_.backward(model_, camera, view, context_, executor);
    for (const BlockHandle block : {model_.anchors.feature, model_.anchors.offset}) {
      const MatrixView<const Scalar> gradient = std::as_const(arena).gradients(block);
      for (const std::uint32_t row : context_.visible.span()) {
        double sum = 0;
        for (std::size_t c = 0; c < gradient.columns; ++c) {
          const double slope = static_cast<double>(gradient(row, c));
          sum += slope * slope;
        }
        information_[row] += sum;
      }
    }
    return Done{};
  }

  /// [anchors], at least 0; 0 where no view sees the anchor.
  [[nodiscard]] std::span<const double> information() const { return information_; }

 private:
  Model<R> model_;  ///< a copy, for its gradients
  std::vector<double> information_;
  Pipeline<R> pipeline_;
  typename Pipeline<R>::Context context_;
};

}  // namespace compmark
