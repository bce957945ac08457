// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message in the pixels of one image: the change that Adam makes step by step, kept in [0, 1] and on a ball of given
// PSNR around the original. A fixed distortion compares the bits of decoders at equal cost; a weighted image loss would
// trade one for the other. Cost: ~2 ns a value and step.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

template <class T>
struct PixelChange {
  Buffer<T> change, first, second;  ///< what is added to the original, and Adam's moments
  std::size_t steps = 0;

  void reset(std::size_t count) {
    change.resize(count, T(0));
    first.resize(count, T(0));
    second.resize(count, T(0));
    steps = 0;
  }

  /// original + change; inside [0, 1] because step() keeps it there.
  void write(ImageView<const T> original, ImageView<T> marked) const {
    for (std::size_t i = 0; i < change.size(); ++i) marked.data[i] = original.data[i] + change[i];
  }

  /// One step of `rate` against `gradient`, then back onto the ball: mean square change at most 10^(-psnr / 10).
  void step(ImageView<const T> original, ImageView<const T> gradient, double rate, double psnr) {
    constexpr double beta1 = 0.9, beta2 = 0.99;
    ++steps;
    const double t = static_cast<double>(steps);
    const T step_size = static_cast<T>(rate / -std::expm1(t * std::log(beta1)));
    const T root = static_cast<T>(1 / std::sqrt(-std::expm1(t * std::log(beta2))));
    double square = 0;
    for (std::size_t i = 0; i < change.size(); ++i) {
      const T g = gradient.data[i];
      first[i] += static_cast<T>(1 - beta1) * (g - first[i]);
      second[i] += static_cast<T>(1 - beta2) * (g * g - second[i]);
      const T moved = change[i] - step_size * first[i] / (std::sqrt(second[i]) * root + T(1e-12));
      change[i] = std::clamp(original.data[i] + moved, T(0), T(1)) - original.data[i];
      square += static_cast<double>(change[i]) * static_cast<double>(change[i]);
    }
    const double allowed = std::pow(10, -psnr / 10) * static_cast<double>(change.size());
    if (square <= allowed) return;
    const T factor = static_cast<T>(std::sqrt(allowed / square));
    for (std::size_t i = 0; i < change.size(); ++i) change[i] *= factor;
  }
};

}  // namespace compmark
