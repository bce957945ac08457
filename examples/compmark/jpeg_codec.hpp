// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compmark/core/config.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/views.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/scene/image.hpp>
#include <cstddef>

namespace tool {

/// A round trip through the codec that the library writes images with, as watermark/pretrain/augmentation.hpp calls it.
struct JpegCodec {
  void operator()(compmark::ImageView<const float> image, int quality, compmark::ImageView<float> output) const {
    const compmark::Result<compmark::ImageBytes> read =
        compmark::decode_image(compmark::encode_jpeg(compmark::to_bytes(image), quality), "");
    COMPMARK_ASSERT(read.ok(), "JpegCodec: a JPEG just written");
    for (std::size_t i = 0; i < image.plane_size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        output.data[c * image.plane_size() + i] = static_cast<float>(read->pixels[3 * i + c]) / 255.0f;
    }
  }
};

}  // namespace tool
