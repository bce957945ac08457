// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Renders views of a model and measures them, all on images rounded to 8 bits.
#pragma once

#include <compmark/core/thread_executor.hpp>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common.hpp"
#include "model_files.hpp"

namespace tool {

/// Weight files of LPIPS; empty: not measured.
struct LpipsFiles {
  std::filesystem::path alex;
  std::filesystem::path squeeze;
  bool family_range = false;  ///< feed [0, 1] as the 3DGS family does, instead of the [-1, 1] that LPIPS defines
};

struct ViewResult {
  std::string name;
  double psnr = 0;
  double ssim = 0;
  std::optional<double> psnr_colour_fitted;  ///< after the best affine map of colours; of models with an exposure
  std::optional<double> lpips_alex;
  std::optional<double> lpips_squeeze;
  double milliseconds = 0;
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
  compmark::ImageView<const float> render;    ///< the plain render of the model
  compmark::ImageView<const float> measured;  ///< the same, with the photograph where pixels do not count
  compmark::ImageView<const float> truth;
};
/// Called for every view; images are 8-bit rounded and valid during the call.
using KeepView = std::function<void(const SeenView& view)>;

/// PSNR over the pixels that count at least by half; all of them where `weight` is empty. NaN if none counts.
double counted_psnr(compmark::ImageView<const float> image, compmark::ImageView<const float> target,
                    std::span<const float> weight);

compmark::Result<Evaluation> evaluate_views(compmark::AnyModel& model, DatasetViews views, const LpipsFiles& lpips,
                                            compmark::ThreadExecutor& executor, const KeepView& keep);

}  // namespace tool
