// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The weights of a message decoder as plain tables: what a file holds, what training makes, what a decoder is built
// from. A network is a chain of
//   [max pool 3 x 3, stride 2] -> convolution -> [batch normalisation, frozen] -> activation
// on the input of its convention, behind a space-to-depth stem; layers marked `tap` are averaged over all positions,
// and the averages, one after another, are the features. hidden and strided: logits = whiten(linear(features)) (Stable
// Signature's HiDDeN, docs/spec/watermark.md, 1.1, 1.3). carrier: logits = carriers * whiten(features), with carriers
// that come from a secret (docs/spec/watermark.md, 2).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/math/conv.hpp"
#include "compmark/watermark/decoder/input_convention.hpp"

namespace compmark {

/// Metadata "format" and "format_version" of a decoder file.
inline constexpr std::string_view decoder_format = "compmark decoder";
inline constexpr int decoder_format_version = 1;

enum class DecoderKind { hidden, strided, carrier };
enum class DecoderActivation { gelu, relu };

struct DecoderLayer {
  ConvShape shape{};
  bool pool = false;          ///< max pool before the convolution
  bool tap = false;           ///< averaged over positions into the features
  std::vector<float> weight;  ///< [out, in, kernel, kernel]
  std::vector<float> bias;
  std::vector<float> norm_weight;  ///< batch normalisation with running statistics; all four empty: none
  std::vector<float> norm_bias;
  std::vector<float> norm_mean;
  std::vector<float> norm_variance;
};

struct DecoderWeights {
  DecoderKind kind = DecoderKind::hidden;
  int bits = 0;   ///< of the message; 0 for a carrier file, whose length is the key's
  int width = 0;  ///< channels of the blocks
  int depth = 0;  ///< blocks of that width; one more block gives the features
  int stem = 1;   ///< space to depth: stem^2 pixels become channels (channel, row, column); 1: none
  DecoderActivation activation = DecoderActivation::gelu;
  double norm_epsilon = 1e-3;
  /// what a message loss multiplies the logits by; 10 suits the published whitening (docs/spec/watermark.md, 1.3)
  double logit_scale = 10;
  InputConvention input;
  std::vector<DecoderLayer> layers;
  std::vector<float> linear_weight;  ///< [bits, features]; carrier: empty
  std::vector<float> linear_bias;
  std::vector<float>
      whiten_weight;  ///< [bits, bits], carrier: [dimension, features]; may be empty for hidden and strided
  std::vector<float> whiten_bias;
  std::string note;  ///< where they come from: data, steps, seed

  [[nodiscard]] int features() const {
    int sum = 0;
    for (const DecoderLayer& layer : layers) sum += layer.tap ? layer.shape.out : 0;
    return sum;
  }
  /// Rows of whiten_weight.
  [[nodiscard]] int dimension() const { return static_cast<int>(whiten_bias.size()); }
};

/// The chain of a HiDDeN decoder without its values: `depth` blocks of `width` channels and one of `features`, behind a
/// stem.
[[nodiscard]] inline std::vector<DecoderLayer> hidden_layers(int width, int depth, int features, int stem = 1) {
  std::vector<DecoderLayer> layers(static_cast<std::size_t>(depth) + 1);
  int in = 3 * stem * stem;
  for (std::size_t n = 0; n < layers.size(); ++n) {
    const bool last = n + 1 == layers.size();
    layers[n].shape = {in, last ? features : width, 3, 1, 1};
    layers[n].tap = last;
    in = width;
  }
  return layers;
}

/// The smallest input, in positions a side behind the stem, for which every layer keeps at least one position. 0 if
/// that is above `limit`: a file of a few kilobytes can name 64 layers of stride 16, whose input no image has.
[[nodiscard]] inline int smallest_input(const std::vector<DecoderLayer>& layers, int limit = 65536) {
  std::int64_t n = 1;
  for (std::size_t l = layers.size(); l-- > 0;) {
    const ConvShape& s = layers[l].shape;
    n = std::max<std::int64_t>(1, (n - 1) * s.stride + s.kernel - 2 * s.padding);
    if (layers[l].pool) n = 2 * n + 1;
    if (n > limit) return 0;
  }
  return static_cast<int>(n);
}

/// Smaller images would leave a kernel that sees more border than image, or a layer without a position. 0: no image is
/// large enough.
[[nodiscard]] inline int smallest_picture(const DecoderWeights& weights) {
  const int smallest = smallest_input(weights.layers);
  return smallest == 0 ? 0 : std::max(3, smallest) * weights.stem << weights.input.haar_levels;
}

/// A layer with its normalisation inside: w g / sqrt(v + eps) and (b - m) g / sqrt(v + eps) + beta, in double, rounded
/// once.
template <class T>
void fold_normalisation(const DecoderLayer& layer, double epsilon, std::vector<T>& weight, std::vector<T>& bias) {
  weight.resize(layer.weight.size());
  bias.resize(layer.bias.size());
  const std::size_t taps = layer.shape.taps();
  for (std::size_t o = 0; o < bias.size(); ++o) {
    double scale = 1, shift = 0;
    if (!layer.norm_weight.empty()) {
      scale =
          static_cast<double>(layer.norm_weight[o]) / std::sqrt(static_cast<double>(layer.norm_variance[o]) + epsilon);
      shift = static_cast<double>(layer.norm_bias[o]) - static_cast<double>(layer.norm_mean[o]) * scale;
    }
    for (std::size_t k = 0; k < taps; ++k)
      weight[o * taps + k] = static_cast<T>(static_cast<double>(layer.weight[o * taps + k]) * scale);
    bias[o] = static_cast<T>(static_cast<double>(layer.bias[o]) * scale + shift);
  }
}

/// logits = matrix * features + offset.
struct DecoderHead {
  int rows = 0;
  int columns = 0;
  std::vector<double> matrix;  ///< [rows, columns]
  std::vector<double> offset;  ///< [rows]
};

/// outer * (inner * x + inner_offset) + outer_offset as one map; an empty outer is the identity.
[[nodiscard]] inline DecoderHead compose_head(int columns, const std::vector<float>& inner,
                                              const std::vector<float>& inner_offset, const std::vector<double>& outer,
                                              const std::vector<double>& outer_offset) {
  const std::size_t features = static_cast<std::size_t>(columns), middle = inner_offset.size();
  const std::size_t rows = outer.empty() ? middle : outer.size() / middle;
  DecoderHead head{static_cast<int>(rows), columns, std::vector<double>(rows * features), std::vector<double>(rows)};
  for (std::size_t r = 0; r < rows; ++r) {
    if (!outer_offset.empty()) head.offset[r] = outer_offset[r];
    for (std::size_t m = 0; m < middle; ++m) {
      const double factor = outer.empty() ? (r == m ? 1.0 : 0.0) : outer[r * middle + m];
      if (factor == 0) continue;
      head.offset[r] += factor * static_cast<double>(inner_offset[m]);
      for (std::size_t f = 0; f < features; ++f)
        head.matrix[r * features + f] += factor * static_cast<double>(inner[m * features + f]);
    }
  }
  return head;
}

/// Linear and whitening of a hidden or strided decoder as one map.
[[nodiscard]] inline DecoderHead hidden_head(const DecoderWeights& weights) {
  return compose_head(weights.features(), weights.linear_weight, weights.linear_bias,
                      {weights.whiten_weight.begin(), weights.whiten_weight.end()},
                      {weights.whiten_bias.begin(), weights.whiten_bias.end()});
}

/// The first `bits` outputs of a longer decoder: whitened outputs are uncorrelated, so a part of them is a decoder too
/// (docs/spec/watermark.md, 1.6).
[[nodiscard]] inline DecoderWeights keep_bits(DecoderWeights weights, int bits) {
  if (weights.kind == DecoderKind::carrier || bits >= weights.bits) return weights;
  const DecoderHead head = hidden_head(weights);
  weights.linear_weight.assign(head.matrix.begin(),
                               head.matrix.begin() + static_cast<std::ptrdiff_t>(bits) * head.columns);
  weights.linear_bias.assign(head.offset.begin(), head.offset.begin() + bits);
  weights.whiten_weight.clear();
  weights.whiten_bias.clear();
  weights.bits = bits;
  return weights;
}

/// One line where the file's message length is not the one that is asked for.
[[nodiscard]] inline Result<Done> require_bits(const DecoderWeights& weights, int bits, const std::string& file = {}) {
  if (weights.kind == DecoderKind::carrier) {
    if (bits <= weights.dimension()) return Done{};
    return Error{ErrorKind::invalid, file, "bits",
                 "the decoder has room for " + std::to_string(weights.dimension()) + " bits, the message has " +
                     std::to_string(bits),
                 "use a shorter message or a decoder of more dimensions"};
  }
  if (weights.bits == bits) return Done{};
  return Error{ErrorKind::invalid, file, "bits",
               "the decoder reads " + std::to_string(weights.bits) + " bits, the message has " + std::to_string(bits),
               "use a key and a decoder of one length"};
}

namespace detail {
[[nodiscard]] inline Error wrong_kind(const char* wanted, const std::string& file) {
  return {ErrorKind::invalid, file, "kind", std::string("is not a ") + wanted + " decoder",
          "use StoredDecoder, which takes every kind"};
}
}  // namespace detail

}  // namespace compmark
