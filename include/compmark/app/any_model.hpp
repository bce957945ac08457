// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model of any shipped recipe, from model.safetensors or a .cmk, behind one type, for viewers and editors. A program
// that renders, edits or writes models needs no recipe's type, and compiles them once where compmark::app is linked
// (compiled.hpp). It is not part of compmark.hpp, because it compiles every stage of every recipe: include it by
// itself.
//   auto model = AnyModel::open("scene.cmk", threads);             // Result<AnyModel>
//   auto view = model->render(model->info().views[0], threads);    // Result<RenderedView>
// with_model (recipe_model.hpp) gives the type to a program that needs it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "compmark/app/compiled.hpp"
#include "compmark/app/detail/held_model.hpp"
#include "compmark/app/model_source.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/lens_model.hpp"
#include "compmark/splat/training/model_info.hpp"

namespace compmark {

namespace detail {
struct HeldAccess;
}

class AnyModel {
 public:
  /// Opens either kind of file; the recipe's name in it chooses the type. Errors are those of ModelSource::open, and a
  /// recipe that is none of the shipped ones. `sha256`, if any, is set to that of the bytes that were read.
  [[nodiscard]] static Result<AnyModel> open(const std::filesystem::path& path, ThreadExecutor& executor,
                                             std::string* sha256 = nullptr);
  [[nodiscard]] static Result<AnyModel> load(const ModelSource& source);

  /// Renders a camera in the model's coordinates through `lens`, that of the photograph; a model that does not project
  /// through lenses ignores it. Error: a lens of another family than the model's. Memory: the image and its Gaussians,
  /// kept for the next call.
  [[nodiscard]] Result<RenderedView> render(const Camera<double>& camera, const Lens& lens, ThreadExecutor& executor) {
    return held_->render(camera, lens, executor);
  }
  [[nodiscard]] Result<RenderedView> render(const Camera<double>& camera, ThreadExecutor& executor) {
    return held_->render(camera, Lens{}, executor);
  }
  /// A camera that the model was trained with: one of info().views.
  [[nodiscard]] Result<RenderedView> render(const StoredView& view, ThreadExecutor& executor) {
    return held_->render(view.camera, view.lens, executor);
  }

  /// The gradient of sum d_image * render to the features of the anchors [anchors, features], at a camera whose picture
  /// has the size of d_image. Valid until the next call; cost: a forward and a backward pass. Error: one of render, or
  /// a model whose anchors have no features.
  [[nodiscard]] Result<MatrixView<const float>> feature_gradient(const Camera<double>& camera, const Lens& lens,
                                                                 ImageView<const float> d_image,
                                                                 ThreadExecutor& executor) {
    return held_->feature_gradient(camera, lens, d_image, executor);
  }

  /// What each Gaussian gives to the render of a camera. Valid until the next call; cost: a forward and a backward pass.
  /// Error: one of render.
  [[nodiscard]] Result<GaussianShares> shares(const StoredView& view, ThreadExecutor& executor) {
    return held_->shares(view.camera, view.lens, executor);
  }

  /// Renders from now on as if this share of the anchors were gone and what is left stood in for them
  /// (splat/anchor/missing_share.hpp); 0 is the model as it is. Its numbers, feature_gradient and shares are those of the
  /// model as it is. Error: a share that is not in [0, 1).
  [[nodiscard]] Result<Done> make_up_for(double missing_share);

  /// Recipe, profile, cameras, unit and origin of the lengths.
  [[nodiscard]] const ModelInfo& info() const { return held_->info; }
  [[nodiscard]] RenderSettings render_settings() const { return held_->render_settings(); }
  [[nodiscard]] std::size_t anchor_count() const { return held_->anchor_count(); }
  /// Every number of the model, by blocks; they may be changed.
  [[nodiscard]] ParameterArena<float>& arena() { return held_->arena(); }
  /// The file that it was read from.
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  /// Bytes of that file; 0 if there is none any more.
  [[nodiscard]] std::uint64_t file_bytes() const { return file_bytes_; }

  /// As model.safetensors, under a temporary name and renamed.
  [[nodiscard]] Result<Done> write(const std::filesystem::path& path) const { return held_->write(path); }
  /// The contents of its .cmk (codec/container/cmk.hpp writes it). Error: its recipe does not train for compression.
  [[nodiscard]] Result<CodecModel> coded(const CodedModelSettings& settings = {}) const {
    return held_->coded(settings);
  }

 private:
  friend struct detail::HeldAccess;
  explicit AnyModel(std::unique_ptr<detail::HeldModel> held) : held_(std::move(held)) {}

  std::unique_ptr<detail::HeldModel> held_;
  std::filesystem::path file_;
  std::uint64_t file_bytes_ = 0;
};

namespace detail {

struct HeldAccess {
  [[nodiscard]] static AnyModel made(std::unique_ptr<HeldModel> held, const std::filesystem::path& file,
                                     std::uint64_t file_bytes) {
    AnyModel model(std::move(held));
    model.file_ = file;
    model.file_bytes_ = file_bytes;
    return model;
  }
  [[nodiscard]] static HeldModel& held(AnyModel& model) { return *model.held_; }
};

}  // namespace detail
}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/any_model.hpp"
#endif
