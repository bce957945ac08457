// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Reads a message from the renders of a model of any recipe, with any message decoder, as someone does who checks a
// claim: nothing but 8-bit images is read. verify.hpp says what the readings prove. Cost: a render and a forward pass
// of the decoder a view; the memory of one view.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/proof/report.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark {

/// One reading a view, "view 0" and so on. `views` has size() and camera(i), as that of a training; its photographs are
/// not looked at. Views count as unseen in training: nothing that belongs to one photograph alone is in the render.
/// Error: a view shows more than the rasterizer has memory for (RasterReport::error), an image is too small for the
/// decoder, or a logit is not finite.
template <Recipe R, MessageDecoder D, class Views, Executor E>
[[nodiscard]] Result<std::vector<ViewLogits>> read_model(const Model<R>& model, const Views& views, const D& decoder,
                                                         E& executor) {
  using T = typename R::Scalar;
  const Pipeline<R> pipeline;
  typename Pipeline<R>::Context context;
  typename D::Context scratch;
  std::vector<ViewLogits> readings;
  for (std::size_t i = 0; i < views.size(); ++i) {
    ForwardReport rendered = pipeline.forward(model, views.camera(i), unseen_view, context, executor);
    if (rendered.raster.error) return std::move(*rendered.raster.error);
    round_to_8bit<T>(context.image, context.image);
    Result<ViewLogits> reading =
        read_logits(decoder, ImageView<const T>(context.image), "view " + std::to_string(i), scratch, executor);
    if (!reading) return reading.error();
    readings.push_back(std::move(*reading));
  }
  return readings;
}

}  // namespace compmark
