// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder that reads the low band of a picture and not the picture: WateRF (Jang et al., CVPR 2024), whose
// decoder reads LL at two levels. Band and gradient are those of wavelet_low.hpp, in [0, 1] as the decoder's pictures
// are. Its files are those of `Decoder`, which reads the same marks from whole pictures if it brings a picture to a
// size of its own. Cost: the bands, and the decoder's passes on a picture of 4^-levels of the pixels.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/baselines/wavelet_low.hpp"
#include "compmark/watermark/decoder/concept.hpp"

namespace compmark {

template <class Decoder, int levels = 2>
class WaveletDecoder {
  static_assert(levels >= 1, "WaveletDecoder: at least one level");

 public:
  static constexpr bool is_absent = false;
  using Scalar = typename Decoder::Scalar;
  struct Context {
    typename Decoder::Context decoder;
    std::array<WaveletLow<Scalar>, static_cast<std::size_t>(levels)> low;
    std::array<Buffer<Scalar>, static_cast<std::size_t>(levels)> bands, d_bands;
    int height = 0, width = 0;  ///< of the image
  };

  WaveletDecoder() = default;
  WaveletDecoder(Decoder decoder) : decoder_(std::move(decoder)) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] int bits() const { return decoder_.bits(); }
  /// Its band has the decoder's smallest size.
  [[nodiscard]] int minimum_size() const { return decoder_.minimum_size() << levels; }
  [[nodiscard]] const Decoder& decoder() const { return decoder_; }

  template <Executor E>
  void forward(ImageView<const Scalar> image, std::span<Scalar> logits, Context& context, E& executor) const {
    context.height = image.height;
    context.width = image.width;
    ImageView<const Scalar> at = image;
    for (std::size_t level = 0; level < context.low.size(); ++level) {
      const ImageView<Scalar> band = shape(context, context.bands, level);
      context.low[level].forward(at, band, executor);
      at = band;
    }
    decoder_.forward(at, logits, context.decoder, executor);
  }
  /// ADDS to `d_image`, after the forward of the same context.
  template <Executor E>
  void backward(std::span<const Scalar> d_logits, ImageView<Scalar> d_image, Context& context, E& executor) const {
    ImageView<Scalar> d_at = cleared(context, context.low.size() - 1);
    decoder_.backward(d_logits, d_at, context.decoder, executor);
    for (std::size_t level = context.low.size(); level-- > 0;) {
      const ImageView<Scalar> d_wide = level == 0 ? d_image : cleared(context, level - 1);
      context.low[level].adjoint(ImageView<const Scalar>(d_at), d_wide, executor);
      d_at = d_wide;
    }
  }

 private:
  using Bands = std::array<Buffer<Scalar>, static_cast<std::size_t>(levels)>;
  /// The band behind `level`, of values or gradients.
  [[nodiscard]] static ImageView<Scalar> shape(const Context& context, Bands& bands, std::size_t level) {
    int height = context.height, width = context.width;
    for (std::size_t k = 0; k <= level; ++k) {
      height = WaveletLow<Scalar>::size(height);
      width = WaveletLow<Scalar>::size(width);
    }
    bands[level].resize(3 * static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
    return {bands[level].data(), 3, height, width};
  }
  [[nodiscard]] static ImageView<Scalar> cleared(Context& context, std::size_t level) {
    const ImageView<Scalar> band = shape(context, context.d_bands, level);
    std::fill_n(band.data, band.size(), Scalar(0));
    return band;
  }

  Decoder decoder_;
};

}  // namespace compmark
