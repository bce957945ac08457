// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Small message decoders with random weights of a sensible size, for the tests of the module watermark.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"

namespace compmark::testing {

/// Fills every layer (He scale, with normalisation) of `weights.layers`.
inline void randomise_layers(DecoderWeights& weights, std::uint64_t seed = 1) {
  const Random random(seed, 0, random_stage("tests/decoder"));
  std::uint64_t at = 0;
  const auto fill = [&](std::vector<float>& values, std::size_t n, double scale, double mean) {
    values.resize(n);
    for (float& value : values) value = static_cast<float>(mean + scale * random.normal(at++));
  };
  for (DecoderLayer& layer : weights.layers) {
    const std::size_t out = static_cast<std::size_t>(layer.shape.out), taps = layer.shape.taps();
    fill(layer.weight, out * taps, std::sqrt(2.0 / static_cast<double>(taps)), 0);
    fill(layer.bias, out, 0.1, 0);
    fill(layer.norm_weight, out, 0.2, 1);
    fill(layer.norm_bias, out, 0.2, 0);
    fill(layer.norm_mean, out, 0.2, 0);
    fill(layer.norm_variance, out, 0.1, 1);
  }
}

/// A hidden (stem 1) or strided decoder.
inline DecoderWeights small_decoder(int bits, int width, int depth, int stem = 1, std::uint64_t seed = 1) {
  DecoderWeights weights;
  weights.kind = stem == 1 ? DecoderKind::hidden : DecoderKind::strided;
  weights.bits = bits;
  weights.width = width;
  weights.depth = depth;
  weights.stem = stem;
  weights.layers = hidden_layers(width, depth, bits, stem);
  randomise_layers(weights, seed);
  const Random random(seed, 1, random_stage("tests/decoder"));
  const std::size_t n = static_cast<std::size_t>(bits);
  std::uint64_t at = 0;
  for (std::vector<float>* matrix : {&weights.linear_weight, &weights.whiten_weight}) {
    matrix->resize(n * n);
    for (float& value : *matrix) value = static_cast<float>(random.normal(at++) / std::sqrt(static_cast<double>(n)));
  }
  for (std::vector<float>* offset : {&weights.linear_bias, &weights.whiten_bias}) {
    offset->resize(n);
    for (float& value : *offset) value = static_cast<float>(0.1 * random.normal(at++));
  }
  return weights;
}

template <class T>
[[nodiscard]] std::vector<T> random_image(int height, int width, std::uint64_t seed = 1) {
  const Random random(seed, 2, random_stage("tests/decoder"));
  std::vector<T> image(3 * static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = static_cast<T>(random.uniform(i));
  return image;
}

}  // namespace compmark::testing
