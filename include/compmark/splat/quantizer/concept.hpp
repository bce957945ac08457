// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concepts of quantization, two sides of one step: a Quantizer chooses the step and rounds by it, a DistortionLayer
// adds the noise that stands in for rounding while training, of the steps of the recipe's Quantizer.
//
//   Quantizer                        meaning                                                          cost a value
//   typename Q::Scalar               number type                                                      -
//   Q::step(r, q0, least)            the step q for a network's output r and the base step q0         a few flops
//   Q::step_slope(r, q0, least)      dq/dr; 0 where the step does not depend on r, or is held         a few flops
//   Q::step_log_slope(r)             d ln q / dr where nothing is held                                a few flops
//   Q::symbol(x, q), Q::value(x, q)  the integer that is coded, and the value that is decoded         a division
//   Q::error(x, q)                   (value(x, q) - x) / q                                            a division
//   Q::base_step(low, high)          may be left out: q0 of a channel with these extremes, where the  a few flops
//                                    data say it and not the settings of a run
//
// Laws (testing/quantizer_laws.hpp): Q1 step >= least > 0, and 0 < step <= 2 q0 where nothing is held; Q2 step_slope
// is the derivative of step and step_log_slope that of ln step; Q3 value(x, q) = q symbol(x, q), |error| <= 1/2, and
// value(value(x)) = value(x), as far as the integers reach (of 8 bits: 127 q); Q4 symbol(-x, q) = -symbol(x, q).
//
//   DistortionLayer                                meaning                                            cost an anchor
//   typename D::Scalar, D::Handles, D::Context     number type, its blocks, scratch                   -
//   D::add_parameters(arena), D::initialise(…)     its blocks and their first values                  once
//   d.forward(arena, blocks, rows, phase,          distorts the listed rows of three tables in place  a network
//     feature, scaling, offset, context, executor)
//   d.backward(arena, blocks, rows, d_feature,     turns gradients by what it made into gradients by  a network
//     d_scaling, context, executor)                what it read, in place; ADDS its blocks' gradients
//   D::WithQuantizer<Q>                            the layer with another quantizer; may be left out  -
#pragma once

#include <concepts>
#include <cstdint>
#include <span>

#include "compmark/core/absent.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// No noise in training: costs nothing and leaves no trace.
struct NoDistortion : Absent<NoDistortion> {};
/// Attributes are stored as they are.
struct NoQuantizer : Absent<NoQuantizer> {};

/// What the layer does in one iteration; resolved from the run's phases by the trainer. All zero: it is not called.
struct DistortionPhase {
  double feature_uniform = 0;  ///< width of uniform noise on features, before the adaptive one begins
  bool adaptive = false;       ///< noise of the learned step on features
  bool round = false;          ///< … or hard rounding by that step
  double scaling = 0;          ///< width of the noise on exp(scaling), world units
  double offset = 0;           ///< width of the noise on offsets
  double rate = 1;             ///< factor of the layer's own rate weight: that of the image's losses
  std::uint64_t seed = 0, iteration = 0;

  [[nodiscard]] bool active() const { return feature_uniform != 0 || adaptive || scaling != 0 || offset != 0; }
};

struct DistortionReport {
  double mean_step = 0;  ///< of q over visible anchors and channels, 0 while it is not adaptive
  double rate_loss = 0;  ///< rate_weight * mean(-log2(q / Q0))
};

/// Steps of a layer in units of Q0, over the visible anchors and their channels.
struct StepSummary {
  double mean = 0, median = 0;
};

template <class Q>
concept Quantizer = Q::is_absent || requires(typename Q::Scalar x) {
  { Q::step(x, x, x) } -> std::convertible_to<typename Q::Scalar>;
  { Q::step_slope(x, x, x) } -> std::convertible_to<typename Q::Scalar>;
  { Q::step_log_slope(x) } -> std::convertible_to<typename Q::Scalar>;
  { Q::symbol(x, x) } -> std::convertible_to<typename Q::Scalar>;
  { Q::value(x, x) } -> std::convertible_to<typename Q::Scalar>;
  { Q::error(x, x) } -> std::convertible_to<typename Q::Scalar>;
};

/// A quantizer whose base step comes from the data.
template <class Q>
concept DataQuantizer = Quantizer<Q> && requires(typename Q::Scalar x) {
  { Q::base_step(x, x) } -> std::convertible_to<typename Q::Scalar>;
};

template <class D>
concept DistortionLayer = D::is_absent ||
    requires(const D& layer, ParameterArena<typename D::Scalar>& arena, const ParameterArena<typename D::Scalar>& read,
             const typename D::Handles& blocks, std::span<const std::uint32_t> rows, const DistortionPhase& phase,
             MatrixView<typename D::Scalar> table, typename D::Context& context, SerialExecutor& executor) {
  { D::add_parameters(arena) } -> std::same_as<typename D::Handles>;
  D::initialise(arena, blocks, std::uint64_t{});
  {
    layer.forward(read, blocks, rows, phase, table, table, table, context, executor)
    } -> std::convertible_to<DistortionReport>;
  layer.backward(arena, blocks, rows, table, table, context, executor);
};

namespace detail {
template <class Layer, class Q>
struct WithQuantizer {
  using type = Layer;
};
template <class Layer, class Q>
  requires requires { typename Layer::template WithQuantizer<Q>; }
struct WithQuantizer<Layer, Q> {
  using type = typename Layer::template WithQuantizer<Q>;
};
}  // namespace detail
/// A distortion layer with the steps of this quantizer; one that does not ask for a quantizer stays what it is.
template <class Layer, class Q>
using WithQuantizer = typename detail::WithQuantizer<Layer, Q>::type;

}  // namespace compmark
