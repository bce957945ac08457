// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Gains of the frequency loss. Distances d are in whole cycles over the side of the image, sqrt(ky^2 + kx^2), the index
// distance of a transform: resampling an image keeps them, so that 30 is the same band at any resolution, the published
// 1024 x 1024 included. The published filter is a ring notch, not a high pass: it lets the mean and everything below d
// = 20 through (docs/spec/numerics.md, FR1).
#pragma once

#include <cmath>

#include "compmark/core/config.hpp"

namespace compmark {

enum class FrequencyBand {
  ring_notch,  ///< 1 - exp(-(d - radius)^2 / (2 spread^2)), as published
  high_pass,   ///< 1 - exp(-d^2 / (2 radius^2)), as intended: no mean, values of both signs
};

struct FrequencyGain {
  FrequencyBand band = FrequencyBand::ring_notch;
  double radius = 30;
  double spread = 5;  ///< of the ring

  [[nodiscard]] double operator()(int ky, int kx) const {
    const double d = std::hypot(static_cast<double>(ky), static_cast<double>(kx));
    if (band == FrequencyBand::high_pass) return -std::expm1(-d * d / (2 * radius * radius));
    return -std::expm1(-(d - radius) * (d - radius) / (2 * spread * spread));
  }
};

}  // namespace compmark
