// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The step of adaptive quantization, q = Q0 (1 + tanh r) (HAC eq. 5; docs/spec/method.md, 5.2), in the form that keeps
// its digits: 2 Q0 sigmoid(2 r). The published form is exactly 0 in float from r = -9.01 on, and a division by it
// follows (docs/spec/numerics.md, QD1). The quantizers and the codecs share it.
#pragma once

#include <algorithm>
#include <cmath>

namespace compmark {

/// Smallest step in units of Q0.
inline constexpr double least_relative_step = 0x1p-10;

/// q in (0, 2 Q0), at least `least`. Relative error 2 ulp; monotone.
template <class T>
[[nodiscard]] inline T adaptive_step(T r, T q0, T least) {
  const T e = std::exp(-2 * std::abs(r));
  const T sigmoid = r >= T(0) ? 1 / (1 + e) : e / (1 + e);
  return std::max(2 * q0 * sigmoid, least);
}

/// dq/dr = 4 Q0 sigmoid(2 r) sigmoid(-2 r); 0 where the step is held at `least`.
template <class T>
[[nodiscard]] inline T adaptive_step_slope(T r, T q0, T least) {
  const T e = std::exp(-2 * std::abs(r));
  const T sigmoid = r >= T(0) ? 1 / (1 + e) : e / (1 + e);
  return 2 * q0 * sigmoid < least ? T(0) : 4 * q0 * e / ((1 + e) * (1 + e));
}

/// d ln q / dr = 2 sigmoid(-2 r), where nothing is held: what a rate term needs to lead a collapsed step back.
template <class T>
[[nodiscard]] inline T adaptive_step_log_slope(T r) {
  const T e = std::exp(-2 * std::abs(r));
  return r >= T(0) ? 2 * e / (1 + e) : 2 / (1 + e);
}

}  // namespace compmark
