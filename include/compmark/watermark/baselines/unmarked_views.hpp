// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Training views whose photographs are renders of a frozen model: a mark that is learned by Trainer is then held to
// what the unmarked model shows, as GuardSplat (Chen et al., CVPR 2025) does. Satisfies TrainingViews. A view is
// rendered whenever it is loaded. Cost: a render a view that is loaded; nothing is kept but one image.
#pragma once

#include <algorithm>
#include <cstddef>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/splat/training/recipe.hpp"

namespace compmark {

/// The cameras of `views`, which must outlive this as the model does.
template <Recipe R, class Views, Executor E>
class UnmarkedViews {
 public:
  using Scalar = typename R::Scalar;

  UnmarkedViews(const Model<R>& model, const Views& views, E& executor)
      : model_(&model),
        views_(&views),
        executor_(&executor) {}

  [[nodiscard]] std::size_t size() const { return views_->size(); }
  [[nodiscard]] auto camera(std::size_t i) const { return views_->camera(i); }
  /// Fills `image` [3, height, width] of the size of camera i. An Error where the view shows more than the
  /// rasterizer has memory for (RasterReport::error).
  [[nodiscard]] Result<Done> load(std::size_t i, ImageView<Scalar> image) {
    ForwardReport rendered = pipeline_.forward(*model_, views_->camera(i), i, context_, *executor_);
    if (rendered.raster.error) return std::move(*rendered.raster.error);
    COMPMARK_ASSERT(image.size() == context_.image.size(), "UnmarkedViews: the image has not the camera's size");
    std::copy_n(context_.image.data, context_.image.size(), image.data);
    return Done{};
  }

 private:
  const Model<R>* model_;
  const Views* views_;
  E* executor_;
  Pipeline<R> pipeline_;
  typename Pipeline<R>::Context context_;
};

}  // namespace compmark
