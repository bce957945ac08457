// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The JPEG of a render: a round trip through the codec that the library writes images with.
#pragma once

#include <cstddef>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/scene/image.hpp"

namespace compmark {

/// A round trip through the codec that the library writes images with, as watermark/pretrain/augmentation.hpp calls it.
struct JpegCodec {
  void operator()(ImageView<const float> image, int quality, ImageView<float> output) const {
    const Result<ImageBytes> read = decode_image(encode_jpeg(to_bytes(image), quality), "");
    COMPMARK_ASSERT(read.ok(), "JpegCodec: a JPEG just written");
    for (std::size_t i = 0; i < image.plane_size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        output.data[c * image.plane_size() + i] = static_cast<float>(read->pixels[3 * i + c]) / 255.0f;
    }
  }
};

}  // namespace compmark
