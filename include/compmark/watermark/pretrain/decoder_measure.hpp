// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Measures the bit accuracy of a decoder on messages embedded through it (docs/spec/watermark.md, 1.5): random messages
// in the pixels of images at fixed PSNR, rounded to 8 bits, distorted, rounded again, read. The mean bit accuracy under
// each distortion is in the card of a weight file. Cost: an embedding of `steps` passes an image.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <string_view>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/pretrain/augmentation.hpp"
#include "compmark/watermark/pretrain/pixel_embedding.hpp"

namespace compmark {

struct MeasuredDistortion {
  std::string_view name;
  AugmentationDraw draw;
};

/// The distortions of the cards. Scaling is by side and by area: the published code and text differ
/// (docs/spec/watermark.md, 3).
[[nodiscard]] inline std::vector<MeasuredDistortion> measured_distortions() {
  const auto draw = [](Augmentation kind, double amount) {
    AugmentationDraw d;
    d.kind = kind;
    d.amount = amount;
    d.seed = 9;
    return d;
  };
  const double degree = std::numbers::pi / 180;
  return {{"none", draw(Augmentation::none, 0)},
          {"noise 0.01", draw(Augmentation::noise, 0.01)},
          {"noise 0.1", draw(Augmentation::noise, 0.1)},
          {"JPEG 50", draw(Augmentation::jpeg, 50)},
          {"JPEG 10", draw(Augmentation::jpeg, 10)},
          {"scale 75 % (area)", draw(Augmentation::resize, 0.866)},
          {"scale 75 % (side)", draw(Augmentation::resize, 0.75)},
          {"scale 50 % (side)", draw(Augmentation::resize, 0.5)},
          {"crop 40 % (area)", draw(Augmentation::crop, 0.4)},
          {"rotation 15", draw(Augmentation::rotation, 15 * degree)},
          {"rotation 30", draw(Augmentation::rotation, 30 * degree)},
          {"blur sigma 1", draw(Augmentation::blur, 1)},
          {"blur sigma 2", draw(Augmentation::blur, 2)},
          {"brightness 1.3", draw(Augmentation::brightness, 1.3)},
          {"brightness 0.7", draw(Augmentation::brightness, 0.7)}};
}

struct DecoderMeasurement {
  std::vector<double> accuracy;  ///< mean share of right bits, one a distortion
  std::vector<double> worst;     ///< of the worst image
  std::vector<double> error;     ///< standard error of the mean: images differ more than bits do
  double psnr = 0;               ///< mean, after rounding
  std::size_t images = 0;
};

/// `image(i, pixels)` fills a vector with image i (planar RGB in [0, 1]) and returns its view.
template <class Decoder, class Images, class Jpeg, Executor E>
[[nodiscard]] DecoderMeasurement measure_decoder(const Decoder& decoder, std::size_t count, const Images& image,
                                                 const PixelEmbeddingSettings& settings, std::uint64_t seed,
                                                 const Jpeg& jpeg, E& executor) {
  using T = typename Decoder::Scalar;
  const std::vector<MeasuredDistortion> distortions = measured_distortions();
  const std::vector<double> zeros(distortions.size(), 0);
  DecoderMeasurement result{zeros, std::vector<double>(distortions.size(), 1), zeros, 0, count};
  PixelEmbedding<Decoder> embedding;
  Augmenter<T> augmenter;
  std::vector<T> pixels, marked, read;
  const auto bits = static_cast<std::size_t>(decoder.bits());
  std::vector<T> signs(bits), logits(bits);
  const auto rounded = [](T v) { return std::floor(v * T(255) + T(0.5)) / T(255); };
  for (std::size_t i = 0; i < count; ++i) {
    const ImageView<const T> original = image(i, pixels);
    const Random random(seed, i, random_stage("mark/pretrain/measure"));
    for (std::size_t b = 0; b < bits; ++b) signs[b] = (random.bits(b) & 1u) != 0 ? T(1) : T(-1);
    marked.resize(original.size());
    const ImageView<T> view{marked.data(), 3, original.height, original.width};
    embedding.embed(decoder, original, std::span<const T>(signs), settings, mix_bits(seed) + i, jpeg, view, executor);
    double square = 0;
    for (std::size_t k = 0; k < marked.size(); ++k) {
      marked[k] = rounded(marked[k]);
      const double d = static_cast<double>(marked[k] - original.data[k]);
      square += d * d;
    }
    result.psnr -= 10 * std::log10(square / static_cast<double>(marked.size())) / static_cast<double>(count);
    for (std::size_t d = 0; d < distortions.size(); ++d) {
      const ImageView<const T> seen = augmenter.forward(ImageView<const T>(view), distortions[d].draw, jpeg, executor);
      read.assign(seen.data, seen.data + seen.size());
      for (T& value : read) value = rounded(value);
      decoder.forward(ImageView<const T>{read.data(), 3, seen.height, seen.width}, std::span<T>(logits),
                      embedding.context, executor);
      double right = 0;
      for (std::size_t b = 0; b < bits; ++b) right += logits[b] * signs[b] > T(0) ? 1.0 / static_cast<double>(bits) : 0;
      result.accuracy[d] += right / static_cast<double>(count);
      result.worst[d] = std::fmin(result.worst[d], right);
      result.error[d] += right * right / static_cast<double>(count);
    }
  }
  for (std::size_t d = 0; d < distortions.size(); ++d) {
    const double variance = std::fmax(0.0, result.error[d] - result.accuracy[d] * result.accuracy[d]);
    result.error[d] = count > 1 ? std::sqrt(variance / static_cast<double>(count - 1)) : 0;
  }
  return result;
}

}  // namespace compmark
