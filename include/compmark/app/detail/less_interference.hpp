// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What app/detail/reading.hpp and app/detail/interference.hpp share: whether a decoder file has carriers, and a reading
// less what the unmarked scene says. Cost of the second: that of CoverInterference::subtract.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "compmark/app/reading.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/watermark/decoder/cover_interference.hpp"
#include "compmark/watermark/proof/report.hpp"

namespace compmark {
namespace detail {

/// Dimension of the carriers of a decoder file; 0 of a kind without carriers, and of one that its reader refuses.
[[nodiscard]] inline std::size_t carrier_dimension(const SafetensorsFile& file) {
  const auto kind = file.metadata.find("kind");
  const auto whitening = file.tensors.find("whiten.weight");
  if (kind == file.metadata.end() || kind->second != "carrier" || whitening == file.tensors.end() ||
      whitening->second.shape.empty())
    return 0;
  return static_cast<std::size_t>(std::max<std::int64_t>(whitening->second.shape[0], 0));
}

/// read_logits, less the interference where there is one.
[[nodiscard]] inline Result<ViewLogits> read_less(const FileDecoder& decoder, const CoverInterference* interference,
                                                  ImageView<const float> image, const std::string& name,
                                                  FileDecoder::Context& context, ThreadExecutor& executor) {
  Result<ViewLogits> view = read_logits(decoder, image, name, context, executor);
  if (!view || interference == nullptr) return view;
  PictureSketch<float> sketch;
  interference->subtract(sketch.of(image, executor), view->logits);
  return view;
}

}  // namespace detail
}  // namespace compmark
