// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Renders views of a model and measures them against their photographs, all on images rounded to 8 bits.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compiled.hpp"
#include "compmark/app/dataset_views.hpp"
#include "compmark/app/lpips_nets.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

struct EvaluateSettings {
  LpipsFiles lpips;
  std::function<double()> clock;  ///< milliseconds of any clock, for ViewResult::milliseconds; the library has none
};

struct ViewResult {
  std::string name;
  double psnr = 0;  ///< dB
  double ssim = 0;
  std::optional<double> psnr_colour_fitted;  ///< after the best affine map of colours; of models with an exposure
  std::optional<double> lpips_alex;
  std::optional<double> lpips_squeeze;
  double milliseconds = 0;  ///< of the render; 0 without a clock
  std::size_t gaussians = 0;
};

struct Evaluation {
  std::vector<ViewResult> views;

  template <class Member>
  [[nodiscard]] double mean(Member member) const {
    double sum = 0;
    for (const ViewResult& view : views) sum += member(view);
    return views.empty() ? 0 : sum / static_cast<double>(views.size());
  }
  /// Mean over the views; nothing for models without an exposure.
  [[nodiscard]] std::optional<double> colour_fitted() const {
    if (views.empty() || !views[0].psnr_colour_fitted) return std::nullopt;
    return mean([](const ViewResult& view) { return *view.psnr_colour_fitted; });
  }
};

/// One view and what was measured of it.
struct SeenView {
  std::size_t index = 0;  ///< of the views that are measured
  const ViewResult& result;
  ImageView<const float> render;    ///< as anybody has it who renders the model
  ImageView<const float> measured;  ///< with the photograph where pixels do not count
  ImageView<const float> truth;
};
/// Called for every view, may be empty; images are 8-bit rounded and valid during the call. An Error ends the
/// evaluation and is its own.
using SeenViewObserver = std::function<Result<Done>(const SeenView& view)>;

/// PSNR over the pixels that count at least by half; all of them where `weight` is empty. Where none counts so much, each
/// counts by its weight; NaN if all weights are 0. At most psnr_of_identical_images, as psnr.
[[nodiscard]] double counted_psnr(ImageView<const float> image, ImageView<const float> target,
                                  std::span<const float> weight);

/// Every view of `views`, in their order. Error: a photograph that cannot be read, a mask that leaves nothing, weights
/// that are none of LPIPS. Cost: a render, a photograph and the measures a view; memory of three images.
[[nodiscard]] Result<Evaluation> evaluate_views(AnyModel& model, DatasetViews views, const EvaluateSettings& settings,
                                                ThreadExecutor& executor, const SeenViewObserver& observer = {});

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/evaluate.hpp"
#endif
