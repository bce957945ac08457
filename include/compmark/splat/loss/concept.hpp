// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept ImageLoss: two images in, a number and its gradient with respect to the first out.
//
//   expression                                           meaning                                              cost
//   typename L::Scalar, L::Settings, L::Context          number type, run-time numbers, scratch               -
//   l.forward(rendered, target, ctx, executor)           report; `report.loss` is the value                   O(pixels)
//   l.forward_backward(rendered, target, weight,         same, and ADDS weight dloss/drendered into           O(pixels)
//   d_rendered, ctx, ex)                                 d_rendered
//
// Laws: G1 the gradient agrees with central differences in double; G2 identical images give the value 0 and a gradient
// of exact zeros; G3 same bits at any thread count; G4 nothing is allocated after the first call of a size; G5
// gradients are added, never overwritten.
#pragma once

#include <concepts>

#include "compmark/core/absent.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

template <class L>
concept ImageLoss = requires(const L& loss, ImageView<const typename L::Scalar> rendered,
                             ImageView<const typename L::Scalar> target, typename L::Scalar weight,
                             ImageView<typename L::Scalar> d_rendered, typename L::Context& context,
                             SerialExecutor& executor) {
  typename L::Settings;
  { loss.forward(rendered, target, context, executor).loss } -> std::convertible_to<double>;
  {
    loss.forward_backward(rendered, target, weight, d_rendered, context, executor).loss
    } -> std::convertible_to<double>;
};

/// No HSV loss: saturated colours count like all others.
struct NoHsvLoss : Absent<NoHsvLoss> {};
/// No frequency loss.
struct NoFrequencyLoss : Absent<NoFrequencyLoss> {};

}  // namespace compmark
