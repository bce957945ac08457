// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a rasterizer is asked for beyond the colour image, as a compile-time policy: an output that is not asked for has
// no buffer, no branch and no instruction.
#pragma once

#include "compmark/core/buffer.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// Structural, so that it can be a template argument.
struct RasterOutputs {
  bool alpha = false;  ///< 1 - final transmittance, per pixel
  bool depth = false;  ///< sum of blend weight * camera z, per pixel (not divided by alpha; the background counts as 0)
  bool screen_statistics = false;  ///< per Gaussian: norm of the gradient of its mean on the screen, for growing

  friend constexpr bool operator==(const RasterOutputs&, const RasterOutputs&) = default;
};

/// Gradients of the extra planes, each [1, height, width]; an empty view (data == nullptr) counts as zero.
template <class T>
struct PlaneGradients {
  ImageView<const T> alpha{};
  ImageView<const T> depth{};
};

namespace detail {

/// What the context of a rasterizer derives from, each only where it was asked for.
template <class T>
struct AlphaPlane {
  Buffer<T> alpha;  ///< [height, width] 1 - final transmittance
};
template <class T>
struct DepthPlane {
  Buffer<T> depth;  ///< [height, width] sum of weight * camera z
};
template <class T>
struct GradientNorms {
  Buffer<T> gradient_norm;  ///< [gaussians]
};
struct NoAlphaPlane {};
struct NoDepthPlane {};
struct NoGradientNorms {};

}  // namespace detail

}  // namespace compmark
