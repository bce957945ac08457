// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Edits of place, sharpness and file: the distortions of watermark/pretrain/augmentation.hpp as edits of a chain, one
// type a kind. JPEG is that of the library's own files, by straight-through. Cost: as there; JPEG ~25 ns a pixel.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/watermark/edit/concept.hpp"
#include "compmark/watermark/pretrain/augmentation.hpp"

namespace compmark {

/// A picture saved as JPEG and read again. What cannot be coded, a picture without pixels, stays as it is.
template <class T>
void jpeg_picture(ImageView<const T> image, int quality, ImageView<T> output) {
  std::copy_n(image.data, image.size(), output.data);
  const std::vector<std::byte> file = encode_jpeg(to_bytes(image), quality);
  const Result<ImageBytes> read = decode_image(std::span<const std::byte>(file), "picture.jpg");
  if (!read || read->width != image.width || read->height != image.height) return;
  const std::size_t channels = static_cast<std::size_t>(read->channels), plane = image.plane_size();
  for (std::size_t c = 0; c < static_cast<std::size_t>(image.channels); ++c) {
    for (std::size_t i = 0; i < plane; ++i)
      output.data[c * plane + i] = static_cast<T>(read->pixels[i * channels + std::min(c, channels - 1)]) / T(255);
  }
}

/// One kind of distortion as an edit.
template <Augmentation kind>
struct AugmentationEdit {
  using Settings = AugmentationSettings;
  using Draw = AugmentationDraw;
  template <class T>
  using Context = Augmenter<T>;

  [[nodiscard]] static Draw draw(Settings settings, const Random& random, std::uint64_t first) {
    settings.weight = {};
    settings.weight[static_cast<std::size_t>(kind)] = 1;
    return draw_augmentation(settings, random, first);
  }
  template <class T, Executor E>
  [[nodiscard]] static ImageView<const T> forward(ImageView<const T> image, const Draw& draw, Context<T>& context,
                                                  E& executor) {
    return context.forward(image, draw, jpeg_picture<T>, executor);
  }
  template <class T, Executor E>
  static void backward(ImageView<const T> d_output, const Draw& /*draw*/, ImageView<T> d_image, Context<T>& context,
                       E& executor) {
    context.backward(d_output, d_image, executor);
  }
};

using CropEdit = AugmentationEdit<Augmentation::crop>;
using ResizeEdit = AugmentationEdit<Augmentation::resize>;
using RotationEdit = AugmentationEdit<Augmentation::rotation>;
using BlurEdit = AugmentationEdit<Augmentation::blur>;
using NoiseEdit = AugmentationEdit<Augmentation::noise>;
using JpegEdit = AugmentationEdit<Augmentation::jpeg>;

static_assert(PictureEdit<JpegEdit>);

}  // namespace compmark
