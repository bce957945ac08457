// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The model of one recipe as AnyModel holds it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

#include "compmark/app/detail/held_model.hpp"
#include "compmark/app/recipe_names.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/core/absent.hpp"
#include "compmark/splat/anchor/missing_share.hpp"
#include "compmark/splat/training/model_file.hpp"
#include "compmark/splat/training/pipeline.hpp"

namespace compmark::detail {

template <class R>
class RecipeModel final : public HeldModel {
 public:
  explicit RecipeModel(LoadedModel<R> loaded) : model_(std::move(loaded.model)) { info = std::move(loaded.info); }
  Result<RenderedView> render(const Camera<double>& camera, const Lens& lens, ThreadExecutor& executor) override {
    const Result<ViewCamera<R>> at = view_camera(camera, lens);
    if (!at) return at.error();
    Result<ForwardReport> report = forward(*at, executor);
    if (!report) return report.error();
    if (missing_share > 0) {
      make_up_for_missing(context_.gaussians.columns(), missing_share);
      report->raster = pipeline_.draw_again(model_, *at, unseen_view, context_, executor);
      if (report->raster.error) return std::move(*report->raster.error);
    }
    return RenderedView{context_.image, report->gaussians, std::as_const(context_.gaussians).columns(),
                        R::Rasterizer::EffectPolicy::Filter::active};
  }
  Result<MatrixView<const float>> feature_gradient(const Camera<double>& camera, const Lens& lens,
                                                   ImageView<const float> d_image, ThreadExecutor& executor) override {
    const BlockHandle feature = model_.arena.layout().find("anchor.feature");
    if (!feature.valid()) {
      return Error{ErrorKind::unsupported,
                   {},
                   "recipe",
                   "\"" + info.recipe + "\" has anchors without features",
                   "give a model of compmark train"};
    }
    const Result<ViewCamera<R>> at = view_camera(camera, lens);
    if (!at) return at.error();
    if (const Result<ForwardReport> report = forward(*at, executor); !report) return report.error();
    pipeline_.begin_loss(context_);
    COMPMARK_ASSERT(d_image.size() == context_.d_image.size(), "feature_gradient: an image of the camera's size");
    std::copy_n(d_image.data, d_image.size(), context_.d_image.data);
    backward(*at, executor);
    return MatrixView<const float>(std::as_const(model_.arena).gradients(feature));
  }
  Result<GaussianShares> shares(const Camera<double>& camera, const Lens& lens, ThreadExecutor& executor) override {
    const Result<ViewCamera<R>> at = view_camera(camera, lens);
    if (!at) return at.error();
    if (const Result<ForwardReport> report = forward(*at, executor); !report) return report.error();
    pipeline_.begin_loss(context_);
    // The image is sum_p w_p(pixel) c_p + background: w is its sum's gradient by the colour.
    std::fill_n(context_.d_image.data, context_.d_image.size(), 1.0f);
    backward(*at, executor);
    const GaussianColumns<const float> drawn = std::as_const(context_.gaussians).columns();
    const std::span<const std::uint32_t> slot = pipeline_.decoder().statistics(context_.decoder).gaussian_slot;
    const std::size_t count = std::min(slot.size(), drawn.count);  // a far field's have no anchor
    return GaussianShares{slot.first(count), {std::as_const(context_.d_gaussians).columns().color[0], count}, drawn};
  }
  ParameterArena<float>& arena() override { return model_.arena; }
  [[nodiscard]] std::size_t anchor_count() const override { return model_.anchor_count(); }
  [[nodiscard]] RenderSettings render_settings() const override { return model_.render; }
  [[nodiscard]] Result<Done> write(const std::filesystem::path& path) const override {
    return write_model(path, model_, info);
  }
  [[nodiscard]] Result<CodecModel> coded(const CodedModelSettings& settings) const override {
    if constexpr (present<typename R::EntropyModel>) {
      return coded_model(model_, info, settings);
    } else {
      return Error{ErrorKind::unsupported,
                   {},
                   "recipe",
                   "\"" + info.recipe + "\" has no entropy model, so nothing is known of how its numbers are coded",
                   reading_recipe(info.recipe) == "scaffold"
                       ? "fit a codec to it: compmark fit-codec; or train with --codec hac or context_gs"
                       : "train with --codec hac or context_gs"};
    }
  }
  [[nodiscard]] Model<R>& model() { return model_; }

 private:
  /// Renders into the context. A view that shows more than there is memory for is no picture of the background.
  Result<ForwardReport> forward(const ViewCamera<R>& at, ThreadExecutor& executor) {
    ForwardReport report = pipeline_.forward(model_, at, unseen_view, context_, executor);
    if (report.raster.error) return std::move(*report.raster.error);
    return report;
  }
  /// After a forward pass and a gradient of its image: those of the parameters, set.
  void backward(const ViewCamera<R>& at, ThreadExecutor& executor) {
    const std::span<float> gradients = model_.arena.all_gradients();
    std::fill(gradients.begin(), gradients.end(), 0.0f);
    pipeline_.backward(model_, at, unseen_view, context_, executor);
  }
  [[nodiscard]] Result<ViewCamera<R>> view_camera(const Camera<double>& camera, const Lens& lens) {
    if (!is_pinhole(lens) && !(policy_ && lens == lens_)) {
      policy_ = lens_policy<RecipeLens<R>>(lens);
      lens_ = lens;
      if (!policy_) {
        return Error{ErrorKind::unsupported,
                     {},
                     "lens",
                     "is not of the " + std::string(lens_family<RecipeLens<R>>) +
                         " family, which is all that a model of recipe " + info.recipe + " projects through",
                     "render it without the lens, or give data that were trained on"};
      }
    }
    ViewCamera<R> at(camera);
    if constexpr (!std::is_same_v<RecipeLens<R>, PinholeLens>) {
      if (!is_pinhole(lens)) at.lens = *policy_;
    }
    return at;
  }

  Model<R> model_;
  Pipeline<R> pipeline_;
  typename Pipeline<R>::Context context_;
  Lens lens_;
  std::optional<RecipeLens<R>> policy_;  ///< of lens_: finding where a lens ends takes half a millisecond
};

}  // namespace compmark::detail
