// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Embeds a message into one image through a frozen decoder, by gradient steps on its pixels at fixed PSNR, with one
// drawn distortion a step (expectation over transformations; none: plain). It measures what a decoder can carry
// (docs/spec/watermark.md, 1.5) and makes the training pairs of a decoder without an encoder. The loss is the cross
// entropy of the signed logits, sum softplus(-temperature s z). Cost: a forward and a backward pass of the decoder a
// step.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/pretrain/augmentation.hpp"
#include "compmark/watermark/pretrain/pixel_adam.hpp"

namespace compmark {

/// d/dz of softplus(-temperature s z), s = +-1.
template <class T>
[[nodiscard]] T signed_logit_slope(T logit, T sign, T temperature) {
  const T x = temperature * sign * logit;
  const T e = std::exp(-std::abs(x));
  return -temperature * sign * (x > T(0) ? e / (T(1) + e) : T(1) / (T(1) + e));
}

struct PixelEmbeddingSettings {
  int steps = 200;
  double psnr = 38.2;
  double rate = 0.003;
  double temperature = 2;  ///< of the logits, for a decoder whose logits have unit spread on unmarked images
  AugmentationSettings augmentation;
};

template <class Decoder>
struct PixelEmbedding {
  using T = typename Decoder::Scalar;
  PixelChange<T> change;
  Augmenter<T> augmenter;
  typename Decoder::Context context;
  std::vector<T> logits, slope;
  Buffer<T> d_distorted, d_image;

  /// Fills `marked` with the image that carries `signs` (+1 and -1). `key` seeds the distortions.
  template <Executor E, class Jpeg>
  void embed(const Decoder& decoder, ImageView<const T> image, std::span<const T> signs,
             const PixelEmbeddingSettings& settings, std::uint64_t key, const Jpeg& jpeg, ImageView<T> marked,
             E& executor) {
    change.reset(image.size());
    logits.resize(signs.size());
    slope.resize(signs.size());
    for (int step = 0; step < settings.steps; ++step) {
      change.write(image, marked);
      const Random random(key, static_cast<std::uint64_t>(step), random_stage("mark/pretrain/embed"));
      const ImageView<const T> seen =
          augmenter.forward(marked, draw_augmentation(settings.augmentation, random), jpeg, executor);
      decoder.forward(seen, std::span<T>(logits), context, executor);
      for (std::size_t b = 0; b < signs.size(); ++b)
        slope[b] = signed_logit_slope(logits[b], signs[b], static_cast<T>(settings.temperature));
      d_distorted.resize(seen.size(), T(0));
      d_image.resize(image.size(), T(0));
      const ImageView<T> d_seen{d_distorted.data(), seen.channels, seen.height, seen.width};
      const ImageView<T> d_marked{d_image.data(), image.channels, image.height, image.width};
      decoder.backward(std::span<const T>(slope), d_seen, context, executor);
      augmenter.backward(d_seen, d_marked, executor);
      const double left = 1 - static_cast<double>(step) / settings.steps;
      change.step(image, d_marked, settings.rate * std::min(1.0, 2 * left + 0.05), settings.psnr);
    }
    change.write(image, marked);
  }
};

}  // namespace compmark
