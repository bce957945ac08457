// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Where the pictures of a dataset come from that has no files of them: a splat file is rendered
// (app/splat_capture.hpp). ImageStore asks for a picture when it is needed, and keeps it as it keeps a decoded one.
#pragma once

#include "compmark/core/result.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/decode.hpp"
#include "compmark/scene/image.hpp"

namespace compmark {

class PictureSource {
 public:
  PictureSource() = default;
  PictureSource(const PictureSource&) = delete;
  PictureSource& operator=(const PictureSource&) = delete;
  virtual ~PictureSource() = default;
  /// The picture of a view of the dataset, at the size of its camera; the same bits whenever it is asked for.
  [[nodiscard]] virtual Result<StoredImage> picture(const View& view, const DecodeSettings& settings) const = 0;
};

}  // namespace compmark
