// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A decoder that anything can carry a message for: colours of a plane, without a training.
#pragma once

#include <compmark/watermark/decoder/lattice_decoder.hpp>
#include <compmark/watermark/pretrain/lattice_network.hpp>
#include <cstddef>
#include <vector>

namespace compmark::testing {

/// Eight Fourier features of colour, a bit a feature: what a surface keeps from wherever it is seen (watermark/decoder/lattice_decoder.hpp).
inline LatticeDecoder<float> colours() {
  LatticeSettings settings;
  settings.measure = LatticeMeasure::colour;
  settings.bits = settings.features = 8;
  settings.sigma = {0.5};
  settings.stride = 1;
  settings.gate = 0.02;
  LatticeWeights<float> weights = random_lattice<float>(settings, std::vector<double>{0.1}, 3);
  for (std::size_t b = 0; b < 8; ++b) weights.head[9 * b] = 1;
  return {settings, weights};
}

}  // namespace compmark::testing
