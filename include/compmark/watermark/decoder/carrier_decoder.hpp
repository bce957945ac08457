// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The carrier decoder needs no training. It takes means of a frozen network's features, whitens them on ordinary images
// and projects them on secret orthonormal carriers,
//   logits = C W (f(image) - mean)
// (Fernandez et al., "Watermarking images in self-supervised latent spaces", ICASSP 2022). On ordinary images the
// logits are uncorrelated with variance 1, so their signs are fair coins. The network is the AlexNet of LPIPS or random
// convolutions. Their first kernels have mean zero, so that they see texture and not colour (without it 84 instead of
// 96 % of the bits are right, docs/spec/watermark.md, 1.6). Cost: 12 k multiply-adds a pixel for random convolutions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"
#include "compmark/watermark/decoder/decoder_whitening.hpp"
#include "compmark/watermark/decoder/network_decoder.hpp"

namespace compmark {

template <class T = float, template <class> class Kernel = DirectConvolution>
class CarrierDecoder : public NetworkDecoder<T, Kernel> {
 public:
  CarrierDecoder() = default;
  /// `carriers` [bits, dimension] (carriers.hpp); `file` is for messages.
  [[nodiscard]] static Result<CarrierDecoder> create(const DecoderWeights& weights, const std::vector<double>& carriers,
                                                     const std::string& file = {}) {
    if (weights.kind != DecoderKind::carrier) return detail::wrong_kind("carrier", file);
    const std::size_t dimension = weights.whiten_bias.size();
    if (carriers.empty() || carriers.size() % dimension != 0 || carriers.size() / dimension > dimension) {
      return Error{ErrorKind::invalid, file, "carriers",
                   "the decoder needs carriers in " + std::to_string(dimension) + " dimensions",
                   "give the key: carriers come from its secret"};
    }
    return CarrierDecoder(weights, carriers);
  }

 private:
  CarrierDecoder(const DecoderWeights& weights, const std::vector<double>& carriers)
      : NetworkDecoder<T, Kernel>(
            weights, compose_head(weights.features(), weights.whiten_weight, weights.whiten_bias, carriers, {})) {}
};

/// Random convolutions: 3 -> width (zero-mean kernels), -> 2 width at stride 2, -> 2 width, -> features, all 3 x 3 with
/// GELU. Uniform weights of He's variance from `seed`: the same numbers on every machine. Normalisation and whitening
/// come with calibrate_carriers().
[[nodiscard]] inline DecoderWeights random_carrier_network(std::uint64_t seed, const InputConvention& input,
                                                           int width = 32, int features = 96) {
  DecoderWeights weights;
  weights.kind = DecoderKind::carrier;
  weights.width = width;
  weights.depth = 3;
  weights.logit_scale = 1;
  weights.input = input;
  weights.note = "random convolutions, seed " + std::to_string(seed);
  const std::array<std::array<int, 3>, 4> shapes{
      {{3, width, 1}, {width, 2 * width, 2}, {2 * width, 2 * width, 1}, {2 * width, features, 1}}};
  for (std::size_t l = 0; l < shapes.size(); ++l) {
    DecoderLayer layer;
    layer.shape = {shapes[l][0], shapes[l][1], 3, shapes[l][2], 1};
    layer.tap = l + 1 == shapes.size();
    const std::size_t taps = layer.shape.taps(), out = static_cast<std::size_t>(layer.shape.out);
    const Random random(seed, l, random_stage("mark/random_carrier_network"));
    const float scale = static_cast<float>(
        std::sqrt(24.0 / static_cast<double>(taps)));  // a centred uniform number has variance 1 / 12
    layer.weight.resize(out * taps);
    layer.bias.assign(out, 0.0f);
    for (std::size_t i = 0; i < layer.weight.size(); ++i) layer.weight[i] = scale * random.centered(i);
    for (std::size_t k = 0; l == 0 && k < layer.weight.size(); k += 9) {  // each colour's kernel on its own
      float mean = 0;
      for (std::size_t i = 0; i < 9; ++i) mean += layer.weight[k + i] / 9;
      for (std::size_t i = 0; i < 9; ++i) layer.weight[k + i] -= mean;
    }
    weights.layers.push_back(std::move(layer));
  }
  return weights;
}

/// The AlexNet features of an LPIPS file (relu2 to relu5, 1088 means) as a frozen network: `TensorFile` as in
/// Lpips::load.
template <class TensorFile>
[[nodiscard]] Result<DecoderWeights> alex_carrier_network(const TensorFile& file) {
  DecoderWeights weights;
  weights.kind = DecoderKind::carrier;
  weights.activation = DecoderActivation::relu;
  weights.width = 64;
  weights.depth = 4;
  weights.logit_scale = 1;
  weights.input = {
      0, 2, {0.970, 0.912, 0.812}, {0.458, 0.448, 0.450}, 0};  // (2 v - 1 - shift) / scale of the LPIPS networks
  weights.note = "AlexNet features of LPIPS v0.1, relu2 to relu5";
  const std::array<ConvShape, 5> shapes{
      {{3, 64, 11, 4, 2}, {64, 192, 5, 1, 2}, {192, 384, 3, 1, 1}, {384, 256, 3, 1, 1}, {256, 256, 3, 1, 1}}};
  for (std::size_t l = 0; l < shapes.size(); ++l) {
    DecoderLayer layer;
    layer.shape = shapes[l];
    layer.pool = l == 1 || l == 2;
    layer.tap = l > 0;
    const std::string name = "features.conv" + std::to_string(l + 1);
    auto weight = file.floats(name + ".weight", {shapes[l].out, shapes[l].in, shapes[l].kernel, shapes[l].kernel});
    if (!weight) return weight.error();
    auto bias = file.floats(name + ".bias", {shapes[l].out});
    if (!bias) return bias.error();
    layer.weight = std::move(*weight);
    layer.bias = std::move(*bias);
    weights.layers.push_back(std::move(layer));
  }
  return weights;
}

/// Fits the whitening of a carrier network to ordinary images: `image(i)` gives the i-th of `count` as ImageView<const
/// float>. `normalise` first scales every layer so that each channel has mean 0 and variance 1 over the images before
/// its activation (batch statistics, one layer after the other); a pretrained network needs none. At most `dimension`
/// directions are kept. False where the images do not span one.
template <class Images, Executor E>
[[nodiscard]] bool calibrate_carriers(DecoderWeights& weights, std::size_t count, const Images& image, int dimension,
                                      bool normalise, E& executor) {
  for (std::size_t l = 0; normalise && l < weights.layers.size(); ++l) {
    DecoderWeights part = weights;  // the network up to here, without its last activation
    part.layers.resize(l + 1);
    for (DecoderLayer& layer : part.layers) layer.tap = false;
    part.layers.back().tap = true;
    const std::size_t out = static_cast<std::size_t>(part.layers.back().shape.out);
    std::vector<double> mean(out, 0.0), square(out, 0.0);
    const NetworkDecoder<float> decoder(part, {0, part.features(), {}, {}});
    typename NetworkDecoder<float>::Context scratch;
    for (std::size_t i = 0; i < count; ++i) decoder.add_moments(image(i), mean, square, scratch, executor);
    DecoderLayer& layer = weights.layers[l];
    layer.norm_weight.assign(out, 1.0f);
    layer.norm_bias.assign(out, 0.0f);
    layer.norm_mean.resize(out);
    layer.norm_variance.resize(out);
    for (std::size_t c = 0; c < out; ++c) {
      const double m = mean[c] / static_cast<double>(count);
      layer.norm_mean[c] = static_cast<float>(m);
      layer.norm_variance[c] = static_cast<float>(std::max(0.0, square[c] / static_cast<double>(count) - m * m));
    }
  }
  FeatureStatistics statistics;
  const NetworkDecoder<float> network(weights, {0, weights.features(), {}, {}});
  typename NetworkDecoder<float>::Context context;
  std::vector<double> row(static_cast<std::size_t>(weights.features()));
  for (std::size_t i = 0; i < count; ++i) {
    network.forward_features(image(i), row, context, executor);
    statistics.add(row);
  }
  if (statistics.count() < 2) return false;
  Whitening whitening = make_whitening(statistics, dimension);
  weights.whiten_weight = std::move(whitening.weight);
  weights.whiten_bias = std::move(whitening.bias);
  return whitening.dimension > 0;
}

}  // namespace compmark
