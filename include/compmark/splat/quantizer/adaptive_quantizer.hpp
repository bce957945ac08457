// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Quantizer with a step of its own for every value: x^ = q round(x / q), ties to even (docs/spec/compression.md, 1.3;
// docs/spec/numerics.md, QZ1 and QZ2). Training passes gradients straight through. Its base steps Q0 are those of HAC:
// 1 for features, 0.001 for exp(scaling), 0.2 for offsets.
#pragma once

#include <cmath>

#include "compmark/splat/quantizer/step.hpp"

namespace compmark {

template <class T>
struct AdaptiveQuantizer {
  static constexpr bool is_absent = false;
  using Scalar = T;
  /// Base steps.
  struct Settings {
    double feature = 1;
    double scaling = 0.001;  ///< of exp(scaling), world units
    double offset = 0.2;
  };

  /// Step for the context's r, its slope and that of its logarithm; see splat/quantizer/step.hpp.
  [[nodiscard]] static T step(T r, T q0, T least) { return adaptive_step(r, q0, least); }
  [[nodiscard]] static T step_slope(T r, T q0, T least) { return adaptive_step_slope(r, q0, least); }
  [[nodiscard]] static T step_log_slope(T r) { return adaptive_step_log_slope(r); }
  [[nodiscard]] static T step(T r, T q0) { return step(r, q0, static_cast<T>(least_relative_step) * q0); }
  [[nodiscard]] static T step_slope(T r, T q0) { return step_slope(r, q0, static_cast<T>(least_relative_step) * q0); }
  /// The integer that is coded.
  [[nodiscard]] static T symbol(T x, T q) { return std::nearbyint(x / q); }
  /// The value that is decoded.
  [[nodiscard]] static T value(T x, T q) { return q * symbol(x, q); }
  /// (x^ - x) / q in [-1/2, 1/2]: what the distortion layer draws at random instead.
  [[nodiscard]] static T error(T x, T q) {
    const T scaled = x / q;
    return std::nearbyint(scaled) - scaled;
  }
};

}  // namespace compmark
