// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept Rasterizer: Gaussians and a camera in, a planar RGB image out, and its backward pass.
//
//   expression                                             meaning                                             cost
//   typename R::Scalar, R::Settings, R::Context            number type, run-time numbers, what backward needs
//   r.forward(gaussians, camera, background, image, ctx,   overwrites image [3, height, width]; fills ctx      O(pairs)
//   executor)
//   r.backward(gaussians, camera, background, d_image,     ADDS into d_gaussians; call after forward with the  O(pairs)
//   d_gaussians, ctx, executor)                            same arguments and ctx
//   r.screen(ctx)                                          ScreenStatistics of the last backward, for growing  O(1)
//
// Laws (testing/laws.hpp): R1 equals ReferenceRasterizer within the preset's stated error; R2 gradients obey the
// gradient law in double under CutoffRule::smooth; R3 the order of the input does not change the image when depths
// differ, ties go by index; R4 a Gaussian that is culled changes no bit; R5 same bits at any thread count; R6 blend
// weights and the final transmittance sum to one.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <optional>
#include <span>

#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/gradient_mode.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

template <class T>
struct Camera;

/// One entry per input Gaussian. Valid until the next forward on the same context.
template <class T>
struct ScreenStatistics {
  std::span<const std::uint8_t> visible;  ///< 1 where the Gaussian's footprint overlaps the image
  std::span<const T>
      /// norm of dL/d(mean in normalised device coordinates): (W/2 dL/du, H/2 dL/dv); empty if not asked for
      gradient_norm;
};

/// What one forward did: counts of every cull, clamp and scrub (nothing is repaired silently).
struct RasterReport {
  std::size_t visible = 0;   ///< Gaussians with a footprint on the image
  std::size_t pairs = 0;     ///< (Gaussian, tile) pairs after the footprint test
  std::size_t scrubbed = 0;  ///< Gaussians dropped or changed because a value was not finite
  /// The view has more pairs than memory is set apart for (BinSettings), and the image is the background.
  std::optional<Error> error{};
};

template <class R>
concept Rasterizer = requires(const R& rasterizer, GaussianColumns<const typename R::Scalar> gaussians,
                              const Camera<typename R::Scalar>& camera, std::array<typename R::Scalar, 3> background,
                              ImageView<typename R::Scalar> image, ImageView<const typename R::Scalar> d_image,
                              GaussianColumns<typename R::Scalar> d_gaussians, typename R::Context& context,
                              SerialExecutor& executor) {
  typename R::Settings;
  { rasterizer.forward(gaussians, camera, background, image, context, executor) } -> std::same_as<RasterReport>;
  rasterizer.backward(gaussians, camera, background, d_image, d_gaussians, context, executor);
  { rasterizer.screen(context) } -> std::same_as<ScreenStatistics<typename R::Scalar>>;
};

/// A Rasterizer whose backward can also overwrite d_gaussians. Optional: a pipeline clears the gradients for the
/// others.
template <class R>
concept GradientSettingRasterizer = Rasterizer<R> &&
    requires(const R& rasterizer, GaussianColumns<const typename R::Scalar> gaussians,
             const Camera<typename R::Scalar>& camera, std::array<typename R::Scalar, 3> background,
             ImageView<const typename R::Scalar> d_image, GaussianColumns<typename R::Scalar> d_gaussians,
             typename R::Context& context, SerialExecutor& executor) {
  rasterizer.template backward<GradientMode::set>(gaussians, camera, background, d_image, d_gaussians, context,
                                                  executor);
};

}  // namespace compmark
