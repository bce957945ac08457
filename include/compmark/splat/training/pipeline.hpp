// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The passes of one view, forward and backward, written once:
//   anchors -> visible -> GaussianDecoder -> Gaussians -> Rasterizer -> image -> (1 - l) L1 + l (1 - SSIM) + v volume
// and what the stages of the recipe do in between (stage.hpp): to the anchors before they are culled and before they
// are decoded, to the Gaussians, to the image, and as losses. Every step adds into the gradient spans it is given;
// nothing here knows an iteration number, a file or a clock. Longer than 300 lines: the forward and the backward pass
// are to be read side by side.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/gradient_mode.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/anchor/visibility.hpp"
#include "compmark/splat/effect/concept.hpp"
#include "compmark/splat/loss/photometric.hpp"
#include "compmark/splat/raster/concept.hpp"
#include "compmark/splat/raster/outputs.hpp"
#include "compmark/splat/training/anchor_overlay.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/recipe.hpp"
#include "compmark/splat/training/space_volume.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

/// Weights of the losses that every recipe has (docs/spec/method.md, 3.1).
struct LossWeights {
  double lambda_dssim = 0.2;
  double lambda_volume = 0.01;
  double image = 1;  ///< of them all; 1 but in the published schedule of a watermark
};

struct ForwardReport {
  std::size_t visible_anchors = 0;
  std::size_t gaussians = 0;  ///< with positive opacity, after the stages
  RasterReport raster;
};

struct LossReport {
  double total = 0;
  double l1 = 0;
  double ssim = 0;
  double volume = 0;
  double alpha = 0;  ///< mean absolute difference of coverage, if the recipe has an AlphaLoss
};

/// The arguments of the hooks of a forward or backward pass. M is Model<R>, const in a forward pass.
template <class M, class Decoder, class Context, class E>
struct ViewPass {
  M& model;
  std::size_t view;  ///< which photograph, for what depends on it
  const Decoder& decoder;
  Context& context;
  E& executor;
  bool reads_all_features;  ///< a stage reads the features of every anchor, not of the visible ones alone
};
/// … and the hooks of the losses.
template <class T, class Context, class E>
struct LossPass {
  const TargetView<T>& target;
  const LossWeights& weights;
  Context& context;
  E& executor;
  bool stages_weigh_pixels;  ///< target.weight says how much each pixel counts
};

template <Recipe R>
class Pipeline {
 public:
  using Scalar = typename R::Scalar;
  using Stages = typename Model<R>::Stages;
  using Phases = StageMembers<Stages, StagePhase>;
  using Volume = SpaceVolumeLoss<Scalar, typename R::Space, R::AnchorModel::shape.offsets>;
  static constexpr bool changes_attributes = Stages::changes_attributes;

  /// The workspace of one view between forward and backward; reused, so that nothing allocates after warm-up.
  struct Context {
    using Stages = RecipeStages<R>;
    Buffer<std::uint32_t> visible;
    VisibilityWorkspace visibility;
    GaussianBatch<Scalar> gaussians;
    GaussianBatch<Scalar> d_gaussians;
    typename R::GaussianDecoder::Context decoder;
    typename R::Rasterizer::Context raster;
    typename PhotometricLoss<Scalar>::Context photometric;
    Buffer<Scalar> image_storage;
    Buffer<Scalar> d_image_storage;
    typename Volume::Context volume;
    Scalar volume_weight = 0;  ///< of the loss that backward differentiates
    ImageView<Scalar> image;
    ImageView<Scalar> d_image;
    [[no_unique_address]] Phases phases;  ///< those of the last forward pass
    [[no_unique_address]] StageMembers<Stages, StageContext> stages;
    [[no_unique_address]] std::conditional_t<changes_attributes, AnchorOverlay<Scalar>, NoOverlay> overlay;
    /// What the decoder read in the last pass, where stages change it.
    [[no_unique_address]] std::conditional_t<changes_attributes, AnchorColumns<const Scalar>, detail::Nothing<R>> read;

    /// Of a stage, by its template; by its type: stages.of<S>().
    template <template <class...> class S>
    [[nodiscard]] auto& of() {
      return stages.template of<S>();
    }
    template <template <class...> class S>
    [[nodiscard]] const auto& of() const {
      return stages.template of<S>();
    }
  };

  Pipeline() { check_recipe<R>(); }

  /// Renders one view into context.image [3, height, width]. `view` selects the appearance and the exposure, if the
  /// recipe has them; unseen_view is a photograph that was not trained on. `phases` is what the stages do beyond a
  /// plain render; the backward pass does the same. Where the report has an error (raster), the image is the background.
  template <Executor E>
  ForwardReport forward(const Model<R>& model, const ViewCamera<R>& camera, std::size_t view, Context& context,
                        E& executor, const Phases& phases = {}) const {
    const Camera<Scalar> scalar_camera = camera.template cast<Scalar>();
    const auto pass = view_pass(model, view, phases, context, executor);
    AnchorColumns<const Scalar> columns = before_culling(pass);
    context.image_storage.resize(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    context.image = {context.image_storage.data(), 3, camera.height, camera.width};

    ForwardReport report;
    const VisibilitySettings visibility{model.render.near_plane, model.render.blur_variance};
    R::AnchorModel::find_visible(columns, scalar_camera, lens_of(camera), visibility, context.visible,
                                 context.visibility, executor);
    Stages::forward([&]<class S>() { stage<S>().choose_visible(phases.template of<S>(), context.visible); });
    report.visible_anchors = context.visible.size();
    columns = attributes(pass, columns);
    report.gaussians = decoder_.forward(columns, context.visible.span(), camera.center_world, view, model.arena,
                                        model.decoder, context.gaussians, context.decoder, executor);
    Stages::forward([&]<class S>() { stage<S>().gaussians(pass, own<S>(pass)); });
    if constexpr (Stages::masks_gaussians) {
      const GaussianColumns<const Scalar> drawn = std::as_const(context.gaussians).columns();
      report.gaussians = static_cast<std::size_t>(std::count_if(drawn.opacity, drawn.opacity + drawn.count,
                                                                [](Scalar opacity) { return opacity > Scalar(0); }));
    }
    Volume::look(context.volume, columns.position, [&] { return decoder_.statistics(context.decoder); });
    report.raster = draw(pass, camera);
    return report;
  }

  /// Draws context.gaussians, which the caller changed, once more, and does to the image what forward() does. Call after
  /// a forward() of the same model, camera and view. Nothing can be differentiated after it.
  template <Executor E>
  RasterReport draw_again(const Model<R>& model, const ViewCamera<R>& camera, std::size_t view, Context& context,
                          E& executor) const {
    return draw(view_pass(model, view, context.phases, context, executor), camera);
  }

  /// What the stages make of the attributes of the anchors in context.visible, which the caller filled: the part of
  /// forward() before the decoder.
  template <Executor E>
  AnchorColumns<const Scalar> read_attributes(const Model<R>& model, Context& context, E& executor,
                                              const Phases& phases) const {
    const auto pass = view_pass(model, unseen_view, phases, context, executor);
    return attributes(pass, before_culling(pass));
  }

  /// Loss of context.image against `target`, and its gradient in context.d_image (set, not added: the backward pass
  /// starts here). Call after forward.
  template <Executor E>
  LossReport loss(const TargetView<Scalar>& target, const LossWeights& weights, Context& context, E& executor) const {
    set_room(context);
    LossReport report;
    const LossPass<Scalar, Context, E> pass{target, weights, context, executor, Stages::needs_pixel_weights};
    const PhotometricLoss<Scalar> photometric({static_cast<Scalar>(weights.lambda_dssim)});
    ImageView<const Scalar> compared = context.image;
    Stages::forward([&]<class S>() { stage<S>().before_photometric(pass, own_loss<S>(context), compared); });
    PhotometricReport image_loss = photometric.template forward_backward<GradientMode::set>(
        compared, target.image, static_cast<Scalar>(weights.image), context.d_image, context.photometric, executor);
    Stages::backward([&]<class S>() { stage<S>().after_photometric(pass, own_loss<S>(context), image_loss); });
    report.l1 = image_loss.l1;
    report.ssim = image_loss.ssim;
    report.total = weights.image * image_loss.loss;
    context.volume_weight = static_cast<Scalar>(weights.image * weights.lambda_volume);
    if (weights.lambda_volume != 0) {
      const GaussianColumns<const Scalar> gaussians = std::as_const(context.gaussians).columns();
      report.volume = volume_.forward(gaussians.scale, gaussians.count, context.volume, executor).loss;
      report.total += weights.image * weights.lambda_volume * report.volume;
    }
    Stages::forward([&]<class S>() { stage<S>().loss(pass, own_loss<S>(context), report); });
    return report;
  }

  /// In place of loss() for a caller with a loss of its own of the render: room in context.d_image, whose every value
  /// it sets, and nothing of the losses that loss() would add. Call after forward.
  void begin_loss(Context& context) const {
    set_room(context);
    context.volume_weight = 0;
    Stages::forward([&]<class S>() { stage<S>().no_loss(own_loss<S>(context), context.image); });
  }

  /// The same for a target that is nothing but an image.
  template <Executor E>
  LossReport loss(ImageView<const Scalar> target, const LossWeights& weights, Context& context, E& executor) const {
    return loss(TargetView<Scalar>(target), weights, context, executor);
  }

  /// Carries context.d_image back to context.d_gaussians (set) and on into the gradients of the model's arena (adds).
  template <Executor E>
  void backward(Model<R>& model, const ViewCamera<R>& camera, std::size_t view, Context& context, E& executor) const {
    static_cast<void>(model.arena.all_gradients());  // memory is taken before threads ask for it
    const Camera<Scalar> scalar_camera = camera.template cast<Scalar>();
    const GaussianColumns<const Scalar> gaussians = std::as_const(context.gaussians).columns();
    context.d_gaussians.resize(context.gaussians.size());
    const GaussianColumns<Scalar> d_gaussians = context.d_gaussians.columns();
    const typename R::Rasterizer raster = rasterizer(model.render, camera);
    const std::array<Scalar, 3> behind = background(model.render, context.phases);
    const ViewPass<Model<R>, typename R::GaussianDecoder, Context, E> pass{
        model, view, decoder_, context, executor, reads_all(context.phases)};
    Stages::backward([&]<class S>() { stage<S>().image_backward(pass, own<S>(pass)); });
    if constexpr (Stages::needs_alpha) {
      PlaneGradients<Scalar> d_planes;
      Stages::forward([&]<class S>() { stage<S>().plane_gradients(own_loss<S>(context), context.image, d_planes); });
      raster.template backward<GradientMode::set>(gaussians, scalar_camera, behind, context.d_image, d_planes,
                                                  d_gaussians, context.raster, executor);
    } else if constexpr (GradientSettingRasterizer<typename R::Rasterizer>) {
      raster.template backward<GradientMode::set>(gaussians, scalar_camera, behind, context.d_image, d_gaussians,
                                                  context.raster, executor);
    } else {
      set_zero(context.d_gaussians.storage(), executor);
      raster.backward(gaussians, scalar_camera, behind, context.d_image, d_gaussians, context.raster, executor);
    }
    if (context.volume_weight != Scalar(0)) {
      volume_.backward(gaussians.scale, gaussians.count, context.volume_weight, d_gaussians.scale, context.volume,
                       executor);
    }
    Stages::backward([&]<class S>() { stage<S>().gaussians_backward(pass, own<S>(pass)); });
    const std::span<const std::uint32_t> visible = context.visible.span();
    if constexpr (changes_attributes) {
      decoder_.backward(context.read, visible, camera.center_world, view, model.arena, model.decoder,
                        std::as_const(context.d_gaussians).columns(),
                        context.overlay.gradients(model.arena, model.anchors, visible, executor), context.decoder,
                        executor);
      Stages::backward([&]<class S>() { stage<S>().attributes_backward(pass, own<S>(pass)); });
      context.overlay.add_to(model.arena, model.anchors, visible, executor);
    } else {
      decoder_.backward(std::as_const(model).columns(), visible, camera.center_world, view, model.arena, model.decoder,
                        std::as_const(context.d_gaussians).columns(), anchor_gradients(model.arena, model.anchors),
                        context.decoder, executor);
    }
  }

  [[nodiscard]] const typename R::GaussianDecoder& decoder() const { return decoder_; }
  /// The loss of large Gaussians, in the lengths of the recipe's space.
  [[nodiscard]] Volume& volume() { return volume_; }
  /// A stage, by its type or its template: stage<MessageStage>().
  template <class S>
  [[nodiscard]] S& stage() {
    return stages_.template of<S>();
  }
  template <class S>
  [[nodiscard]] const S& stage() const {
    return stages_.template of<S>();
  }
  template <template <class...> class S>
  [[nodiscard]] auto& stage() {
    return stages_.template of<S>();
  }
  template <template <class...> class S>
  [[nodiscard]] const auto& stage() const {
    return stages_.template of<S>();
  }
  [[nodiscard]] static typename R::Rasterizer rasterizer(const RenderSettings& render) {
    return typename R::Rasterizer{typename R::Rasterizer::Settings{static_cast<Scalar>(render.near_plane),
                                                                   static_cast<Scalar>(render.blur_variance)}};
  }
  /// The same with the lens of the camera, if the recipe projects through one.
  [[nodiscard]] static typename R::Rasterizer rasterizer(const RenderSettings& render,
                                                         [[maybe_unused]] const ViewCamera<R>& camera) {
    if constexpr (std::is_same_v<RecipeLens<R>, PinholeLens>) {
      return rasterizer(render);
    } else {
      typename R::Rasterizer::Settings settings = rasterizer(render).settings();
      settings.lens = camera.lens;
      return typename R::Rasterizer{settings};
    }
  }
  /// The lens that a camera of the recipe has.
  [[nodiscard]] static decltype(auto) lens_of([[maybe_unused]] const ViewCamera<R>& camera) {
    if constexpr (std::is_same_v<RecipeLens<R>, PinholeLens>) {
      return PinholeLens{};
    } else {
      return (camera.lens);
    }
  }
  /// The background: what a stage draws there in a training iteration, else the colour of the model.
  [[nodiscard]] static std::array<Scalar, 3> background(const RenderSettings& render,
                                                        [[maybe_unused]] const Phases& phases) {
    std::array<Scalar, 3> color = background(render);
    Stages::forward([&]<class S>() { S::background(phases.template of<S>(), color); });
    return color;
  }
  [[nodiscard]] static std::array<Scalar, 3> background(const RenderSettings& render) {
    return {static_cast<Scalar>(render.background[0]), static_cast<Scalar>(render.background[1]),
            static_cast<Scalar>(render.background[2])};
  }

 private:
  template <Executor E>
  auto view_pass(const Model<R>& model, std::size_t view, const Phases& phases, Context& context, E& executor) const {
    context.phases = phases;
    return ViewPass<const Model<R>, typename R::GaussianDecoder, Context, E>{
        model, view, decoder_, context, executor, reads_all(context.phases)};
  }
  /// The part of forward() after the stages had the Gaussians.
  template <class Pass>
  RasterReport draw(const Pass& pass, const ViewCamera<R>& camera) const {
    Context& context = pass.context;
    const RasterReport report =
        rasterizer(pass.model.render, camera)
            .forward(std::as_const(context.gaussians).columns(), camera.template cast<Scalar>(),
                     background(pass.model.render, context.phases), context.image, context.raster, pass.executor);
    Stages::forward([&]<class S>() { stage<S>().image(pass, own<S>(pass)); });
    return report;
  }
  [[nodiscard]] static bool reads_all([[maybe_unused]] const Phases& phases) {
    bool all = false;
    Stages::forward([&]<class S>() { all = all || S::reads_all_features(phases.template of<S>()); });
    return all;
  }
  template <class S, class Pass>
  [[nodiscard]] static StageOf<S> own(const Pass& pass) {
    return {pass.model.template blocks<S>(), pass.context.phases.template of<S>(),
            pass.context.stages.template of<S>()};
  }
  template <class S>
  [[nodiscard]] static StageOfLoss<S> own_loss(Context& context) {
    return {context.phases.template of<S>(), context.stages.template of<S>()};
  }
  /// What decides which anchors are visible.
  template <class Pass>
  AnchorColumns<const Scalar> before_culling(const Pass& pass) const {
    pass.context.overlay.begin();
    AnchorColumns<const Scalar> columns = pass.model.columns();
    Stages::forward([&]<class S>() { stage<S>().before_culling(pass, own<S>(pass), columns); });
    return columns;
  }
  /// What the decoder reads of the visible anchors.
  template <class Pass>
  AnchorColumns<const Scalar> attributes(const Pass& pass, AnchorColumns<const Scalar> columns) const {
    Stages::forward([&]<class S>() { stage<S>().attributes(pass, own<S>(pass), columns); });
    if constexpr (changes_attributes) pass.context.read = columns;
    return columns;
  }
  static void set_room(Context& context) {
    context.d_image_storage.resize(context.image.size());
    context.d_image = {context.d_image_storage.data(), 3, context.image.height, context.image.width};
  }
  template <Executor E>
  static void set_zero(std::span<Scalar> values, E& executor) {
    executor.for_chunks(values.size(), std::size_t{1} << 16, [values](std::size_t begin, std::size_t end, std::size_t) {
      std::fill(values.begin() + static_cast<std::ptrdiff_t>(begin), values.begin() + static_cast<std::ptrdiff_t>(end),
                Scalar{});
    });
  }

  [[no_unique_address]] typename R::GaussianDecoder decoder_;
  [[no_unique_address]] Volume volume_;
  [[no_unique_address]] StageMembers<Stages, StageItself> stages_;
};

}  // namespace compmark
