// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Decoders of the sizes that are in use, with weights that mean nothing: their time does not depend on them where there
// is a gradient at all.
#pragma once

#include <algorithm>
#include <compmark/watermark/decoder/lattice_decoder.hpp>

namespace compmark::benchmarks {

[[nodiscard]] inline LatticeDecoder<float> any_lattice(const LatticeSettings& settings) {
  LatticeWeights<float> weights(settings);
  std::fill(weights.frequency.begin(), weights.frequency.end(), 3.0f);
  std::fill(weights.head.begin(), weights.head.end(), 0.1f);  // a head of zeros has no gradient
  return {settings, weights};
}
/// The decoder that is shipped: 256 Fourier features of local contrast.
[[nodiscard]] inline LatticeDecoder<float> shipped_lattice() {
  LatticeSettings settings;
  settings.bits = 48;
  settings.features = 256;
  settings.sigma = {3, 6, 12};
  settings.stride = 4;
  return any_lattice(settings);
}
/// A decoder as compmark fit makes them but for the prediction: 320 Fourier features of colour, every pixel.
[[nodiscard]] inline LatticeDecoder<float> fitted_lattice() {
  LatticeSettings settings;
  settings.measure = LatticeMeasure::colour;
  settings.bits = 48;
  settings.features = 320;
  settings.sigma = {0.5};
  settings.stride = 1;
  return any_lattice(settings);
}

}  // namespace compmark::benchmarks
