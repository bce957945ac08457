// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The window of the structural similarity of Wang et al. (IEEE TIP 2004) as the splatting family uses it: 11 taps,
// sigma 1.5, separable, normalised to sum one, and its two stabilising constants for a data range of 1.
#pragma once

#include <array>
#include <cmath>

namespace compmark {

inline constexpr int ssim_radius = 5;
inline constexpr int ssim_taps = 2 * ssim_radius + 1;
inline constexpr double ssim_c1 = 0.01 * 0.01;
inline constexpr double ssim_c2 = 0.03 * 0.03;

/// Tap k of the window is weight |k - 5|: [0] is the centre. The centre is one minus the rounded others, so that the
/// sum of the rounded weights misses one by half an ulp of the centre at most: a variance E[x^2] - mean^2 is biased by
/// exactly that miss.
template <class T>
[[nodiscard]] inline std::array<T, ssim_radius + 1> ssim_window() {
  std::array<long double, ssim_radius + 1> exact{};
  long double sum = 0;
  for (int k = 0; k <= ssim_radius; ++k) {
    exact[static_cast<std::size_t>(k)] = std::exp(-static_cast<long double>(k * k) / (2 * 1.5L * 1.5L));
    sum += (k == 0 ? 1 : 2) * exact[static_cast<std::size_t>(k)];
  }
  std::array<T, ssim_radius + 1> weights{};
  long double others = 0;
  for (std::size_t k = 1; k <= ssim_radius; ++k) {
    weights[k] = static_cast<T>(exact[k] / sum);
    others += 2 * static_cast<long double>(weights[k]);
  }
  weights[0] = static_cast<T>(1 - others);
  return weights;
}

}  // namespace compmark
