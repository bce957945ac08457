// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concepts of effects: what lies between the render and the photograph, and only where a scene calls for it.
// Each has an absent type, the default of every recipe, which leaves no member, no branch, no parameter and no byte
// (laws and costs: docs/effects.md).
//
//   Exposure       the photograph's own gain and offset          NoExposure | AffineExposure
//   Background     what is behind the scene while training       ConstantBackground | RandomBackground
//   AlphaLoss      the render's coverage against the alpha       NoAlphaLoss | L1AlphaLoss
//   PixelWeights   pixels that do not count                      NoPixelWeights | MaskedPixels
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "compmark/core/absent.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// Index of a photograph that was not trained on. The rules for it are fixed: exposure is the gauge (no change),
/// appearance is the mean of the trained embeddings.
inline constexpr std::size_t unseen_view = std::numeric_limits<std::size_t>::max();

/// What a render is compared with. `alpha` and `weight` are [height, width] in [0, 1], or null where there are none.
template <class T>
struct TargetView {
  ImageView<const T> image;
  const T* alpha = nullptr;   ///< coverage of the photograph
  const T* weight = nullptr;  ///< how much each pixel counts

  explicit TargetView(ImageView<const T> rgb, const T* coverage = nullptr, const T* counts = nullptr)
      : image(rgb),
        alpha(coverage),
        weight(counts) {}
};

/// The photograph shows the scene's colours as they are.
struct NoExposure : Absent<NoExposure> {
  struct Handles {};
};
template <class X>
concept Exposure = X::is_absent ||
    requires(ParameterArena<typename X::Scalar>& arena, typename X::Handles handles,
             ImageView<typename X::Scalar> image, typename X::Context& context, SerialExecutor& executor) {
  { X::add_parameters(arena, std::size_t{}) } -> std::same_as<typename X::Handles>;
  X::initialise(arena, handles);
  X::forward(arena, handles, std::size_t{}, image, context, executor);
  X::backward(arena, handles, std::size_t{}, image, context, executor);
  X::fix_gauge(arena, handles);
};

/// The background of RenderSettings, always.
struct ConstantBackground : Absent<ConstantBackground> {};
template <class B>
concept Background = B::is_absent || requires(std::uint64_t seed, std::uint64_t iteration) {
  { B::color(seed, iteration) } -> std::same_as<std::array<double, 3>>;
};

/// Coverage is not supervised.
struct NoAlphaLoss : Absent<NoAlphaLoss> {};
template <class L>
concept AlphaLoss = L::is_absent ||
    requires(std::span<const typename L::Scalar> alpha, typename L::Context& context, SerialExecutor& executor) {
  {
    L::forward_backward(alpha, alpha, alpha.data(), typename L::Scalar{}, context, executor)
    } -> std::convertible_to<double>;
};

/// Every pixel counts.
struct NoPixelWeights : Absent<NoPixelWeights> {};
template <class W>
concept PixelWeights = W::is_absent || requires(ImageView<typename W::Scalar> image, const typename W::Scalar* weight,
                                                typename W::Context& context, SerialExecutor& executor) {
  W::mix(image, image, weight, context, executor);
  W::apply(image, weight, context, executor);
};

}  // namespace compmark
