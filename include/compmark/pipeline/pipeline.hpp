// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The road of one view, forward and backward, written once (DESIGN: how data flows):
//   anchors -> visible -> (Embedder -> DistortionLayer | EntropyModel ->) GaussianDecoder -> (offset masks ->) Gaussians -> Rasterizer -> image -> (1 - l) L1 + l (1 - SSIM) + v volume
// Every stage adds into the gradient spans it is given; nothing here knows an iteration number, a file or a clock.
// Stages a recipe leaves out are empty members and leave no branch.
// Longer than 300 lines: the way there and the way back, with every optional stage, are to be read side by side.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include "compmark/anchor/visibility.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/gradient_mode.hpp"
#include "compmark/core/views.hpp"
#include "compmark/effect/concept.hpp"
#include "compmark/loss/photometric.hpp"
#include "compmark/pipeline/mark_losses.hpp"
#include "compmark/pipeline/model.hpp"
#include "compmark/pipeline/recipe.hpp"
#include "compmark/pipeline/space_volume.hpp"
#include "compmark/raster/concept.hpp"
#include "compmark/raster/outputs.hpp"
#include "compmark/scene/camera.hpp"

namespace compmark {

/// Weights of the base losses (method sheet, section 3.1).
struct LossWeights {
  double lambda_dssim = 0.2;
  double lambda_volume = 0.01;
  double lambda_alpha = 0;  ///< of the recipe's AlphaLoss, if it has one
};

struct ForwardReport {
  std::size_t visible_anchors = 0;
  std::size_t gaussians = 0;  ///< with positive opacity, given to the rasterizer
  RasterReport raster;
};

struct LossReport {
  double total = 0;
  double l1 = 0;
  double ssim = 0;
  double volume = 0;
  double alpha = 0;  ///< mean absolute difference of coverage, if the recipe has an AlphaLoss
};

namespace detail {
/// In the place of what a recipe leaves out; a type of its own for each, so that none takes room.
template <class Stage>
struct Nothing {};
}  // namespace detail

template <Recipe R>
class Pipeline {
 public:
  using Scalar = typename R::Scalar;
  using Road = typename Model<R>::Road;
  using Volume = SpaceVolumeLoss<Scalar, typename R::Space, R::AnchorModel::shape.offsets>;
  using Marks = MarkLosses<Scalar, typename R::MessageDecoder, typename R::HsvLoss, typename R::FrequencyLoss>;

  /// What one view needs between forward and backward; reused, so that nothing allocates after warm-up.
  struct Context {
    Buffer<std::uint32_t> visible;
    VisibilityWorkspace visibility;
    GaussianBatch<Scalar> gaussians;
    GaussianBatch<Scalar> d_gaussians;
    typename R::GaussianDecoder::Context decoder;
    typename R::Rasterizer::Context raster;
    typename PhotometricLoss<Scalar>::Context photometric;
    Buffer<Scalar> image_storage;
    Buffer<Scalar> d_image_storage;
    typename Volume::Context volume;  ///< with a space that stretches: set volume.space before a training pass
    Scalar volume_weight = 0;         ///< of the loss that backward differentiates
    ImageView<Scalar> image;
    ImageView<Scalar> d_image;
    [[no_unique_address]] typename R::Exposure::Context exposure;
    [[no_unique_address]] typename R::Background::Context background;
    [[no_unique_address]] typename R::AlphaLoss::Context alpha_loss;
    [[no_unique_address]] typename R::PixelWeights::Context pixel_weights;
    /// Set road.phase and marks.weights before a training pass; by default nothing is distorted or read.
    [[no_unique_address]] std::conditional_t<Road::is_absent, detail::Nothing<Road>, typename Road::Context> road;
    [[no_unique_address]] std::conditional_t<Marks::is_absent, detail::Nothing<Marks>, typename Marks::Context> marks;
  };

  Pipeline() { check_recipe<R>(); }

  /// Renders one view into context.image [3, height, width]. `view` selects the appearance and the exposure, if the recipe has them;
  /// unseen_view is a photograph that was not trained on.
  template <Executor E>
  ForwardReport forward(const Model<R>& model, const ViewCamera<R>& camera, std::size_t view, Context& context,
                        E& executor) const {
    const Camera<Scalar> scalar_camera = camera.template cast<Scalar>();
    AnchorColumns<const Scalar> columns = model.columns();
    if constexpr (!Road::is_absent) {
      columns = road_.before_culling(model.arena, model.anchors, model.road, context.road, executor);
    }
    context.image_storage.resize(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    context.image = {context.image_storage.data(), 3, camera.height, camera.width};

    ForwardReport report;
    const VisibilitySettings visibility{model.render.near_plane, model.render.blur_variance};
    find_visible(columns, camera, scalar_camera, visibility, context.visible, context.visibility, executor);
    report.visible_anchors = context.visible.size();
    if constexpr (!Road::is_absent) {
      columns = road_.forward(model.arena, model.road, context.visible.span(), columns, context.road, executor);
      context.road.read = columns;
    }
    report.gaussians = decoder_.forward(columns, context.visible.span(), camera.center_world, view, model.arena,
                                        model.decoder, context.gaussians, context.decoder, executor);
    if constexpr (present<typename R::EntropyModel>) {
      R::EntropyModel::mask_opacity(model.arena, model.road.rate, decoder_.statistics(context.decoder).gaussian_slot,
                                    context.gaussians.columns().opacity, executor);
    }
    if constexpr (present<typename R::Space>) {
      context.volume.position = columns.position;
      context.volume.decoded = decoder_.statistics(context.decoder);
    }
    report.raster = rasterizer(model.render, camera)
                        .forward(std::as_const(context.gaussians).columns(), scalar_camera,
                                 background(model.render, context), context.image, context.raster, executor);
    if constexpr (present<typename R::Exposure>) {
      R::Exposure::forward(model.arena, model.exposure, view, context.image, context.exposure, executor);
    }
    return report;
  }

  /// Loss of context.image against `target` and its gradient in context.d_image (set, not added: the first link of the way back). Call
  /// after forward.
  template <Executor E>
  LossReport loss(const TargetView<Scalar>& target, const LossWeights& weights, Context& context, E& executor) const {
    context.d_image_storage.resize(context.image.size());
    context.d_image = {context.d_image_storage.data(), 3, context.image.height, context.image.width};
    LossReport report;
    const PhotometricLoss<Scalar> photometric({static_cast<Scalar>(weights.lambda_dssim)});
    ImageView<const Scalar> compared = context.image;
    if constexpr (present<typename R::PixelWeights>) {
      R::PixelWeights::mix(context.image, target.image, target.weight, context.pixel_weights, executor);
      compared.data = context.pixel_weights.mixed.data();
    }
    PhotometricReport image_loss = photometric.template forward_backward<GradientMode::set>(
        compared, target.image, static_cast<Scalar>(image_weight(context)), context.d_image, context.photometric,
        executor);
    if constexpr (present<typename R::PixelWeights>) {
      const double factor = context.pixel_weights.factor;
      R::PixelWeights::apply(context.d_image, target.weight, context.pixel_weights, executor);
      image_loss = {image_loss.l1 * factor, 1 - (1 - image_loss.ssim) * factor, image_loss.loss * factor};
    }
    report.l1 = image_loss.l1;
    report.ssim = image_loss.ssim;
    report.total = image_weight(context) * image_loss.loss;
    context.volume_weight = static_cast<Scalar>(image_weight(context) * weights.lambda_volume);
    if (weights.lambda_volume != 0) {
      const GaussianColumns<const Scalar> gaussians = std::as_const(context.gaussians).columns();
      report.volume = Volume{}.forward(gaussians.scale, gaussians.count, context.volume, executor).loss;
      report.total += image_weight(context) * weights.lambda_volume * report.volume;
    }
    if constexpr (present<typename R::AlphaLoss>) {
      COMPMARK_ASSERT(target.alpha != nullptr, "Pipeline::loss: this recipe compares alpha, and the target has none");
      const std::size_t pixels = context.image.plane_size();
      const Scalar* counts = nullptr;
      if constexpr (present<typename R::PixelWeights>) counts = target.weight;
      report.alpha = R::AlphaLoss::forward_backward(
          std::span<const Scalar>(context.raster.alpha.data(), pixels), std::span<const Scalar>(target.alpha, pixels),
          counts, static_cast<Scalar>(image_weight(context) * weights.lambda_alpha), context.alpha_loss, executor);
      report.total += image_weight(context) * weights.lambda_alpha * report.alpha;
    }
    if constexpr (!Marks::is_absent) {
      context.marks.report =
          marks_.forward_backward(context.image, target.image, context.d_image, context.marks, executor);
      report.total += context.marks.report.total;
    }
    if constexpr (present<typename R::DistortionLayer>) report.total += context.road.distortion.rate_loss;
    if constexpr (present<typename R::EntropyModel>) report.total += context.road.rate.report.loss;
    return report;
  }

  /// In place of loss() for a caller with a loss of its own of the render: room in context.d_image, whose every value it sets, and nothing of the
  /// losses that loss() would add. Call after forward.
  static void begin_loss(Context& context) {
    context.d_image_storage.resize(context.image.size());
    context.d_image = {context.d_image_storage.data(), 3, context.image.height, context.image.width};
    context.volume_weight = 0;
    if constexpr (present<typename R::AlphaLoss>) {
      context.alpha_loss.d_alpha.resize(context.image.plane_size());
      std::fill(context.alpha_loss.d_alpha.begin(), context.alpha_loss.d_alpha.end(), Scalar(0));
    }
  }

  /// The message alone, of a render that there is no photograph of, in place of loss(): context.d_image is set from what was read, and with a
  /// weight `fidelity` above 0 from the mean square difference to `host`, the unmarked render of the same view.
  template <Executor E>
  MarkReport message_loss(double weight, double fidelity, ImageView<const Scalar> host, Context& context,
                          E& executor) const requires(present<typename R::MessageDecoder>) {
    begin_loss(context);
    const double departure =
        square_departure(context.image, host, static_cast<Scalar>(fidelity), context.d_image, context, executor);
    context.marks.weights = {weight, 0, 0, 0};
    context.marks.report =
        marks_.forward_backward(context.image, context.image, context.d_image, context.marks, executor);
    context.marks.report.departure = departure;
    context.marks.report.total += fidelity * departure;
    return context.marks.report;
  }

  /// The same for a target that is nothing but an image.
  template <Executor E>
  LossReport loss(ImageView<const Scalar> target, const LossWeights& weights, Context& context, E& executor) const {
    return loss(TargetView<Scalar>(target), weights, context, executor);
  }

  /// Carries context.d_image back to context.d_gaussians (set) and on into the gradients of the model's arena (adds).
  template <Executor E>
  void backward(Model<R>& model, const ViewCamera<R>& camera, std::size_t view, Context& context, E& executor) const {
    const Camera<Scalar> scalar_camera = camera.template cast<Scalar>();
    const GaussianColumns<const Scalar> gaussians = std::as_const(context.gaussians).columns();
    context.d_gaussians.resize(context.gaussians.size());
    const GaussianColumns<Scalar> d_gaussians = context.d_gaussians.columns();
    const typename R::Rasterizer raster = rasterizer(model.render, camera);
    const std::array<Scalar, 3> behind = background(model.render, context);
    if constexpr (present<typename R::Exposure>) {
      R::Exposure::backward(model.arena, model.exposure, view, context.d_image, context.exposure, executor);
    }
    if constexpr (present<typename R::AlphaLoss>) {
      PlaneGradients<Scalar> d_planes;
      d_planes.alpha = {context.alpha_loss.d_alpha.data(), 1, context.image.height, context.image.width};
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
      Volume{}.backward(gaussians.scale, gaussians.count, context.volume_weight, d_gaussians.scale, context.volume,
                        executor);
    }
    if constexpr (present<typename R::EntropyModel>) {
      R::EntropyModel::mask_opacity_backward(model.arena, model.road.rate,
                                             decoder_.statistics(context.decoder).gaussian_slot, gaussians.opacity,
                                             std::as_const(context.d_gaussians).columns().opacity, executor);
    }
    if constexpr (Road::is_absent) {
      decoder_.backward(std::as_const(model).columns(), context.visible.span(), camera.center_world, view, model.arena,
                        model.decoder, std::as_const(context.d_gaussians).columns(),
                        anchor_gradients(model.arena, model.anchors), context.decoder, executor);
    } else {
      decoder_.backward(context.road.read, context.visible.span(), camera.center_world, view, model.arena,
                        model.decoder, std::as_const(context.d_gaussians).columns(),
                        road_.gradients(model.arena, model.anchors, context.visible.span(), context.road, executor),
                        context.decoder, executor);
      road_.backward(model.arena, model.anchors, model.road, context.visible.span(), context.road, executor);
    }
  }

  [[nodiscard]] const typename R::GaussianDecoder& decoder() const { return decoder_; }
  /// What is read from the render and how it counts: decoder, message, losses. Only recipes with a watermark have it.
  [[nodiscard]] auto& marks() { return marks_; }
  [[nodiscard]] const auto& marks() const { return marks_; }
  /// Embedder, distortion layer and entropy model. Only recipes with one of them have it.
  [[nodiscard]] auto& road() { return road_; }
  [[nodiscard]] const auto& road() const { return road_; }
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
  /// The anchors that this camera may see.
  template <Executor E>
  static void find_visible(const AnchorColumns<const Scalar>& columns, [[maybe_unused]] const ViewCamera<R>& camera,
                           const Camera<Scalar>& scalar_camera, const VisibilitySettings& settings,
                           Buffer<std::uint32_t>& visible, VisibilityWorkspace& workspace, E& executor) {
    if constexpr (std::is_same_v<RecipeLens<R>, PinholeLens>) {
      visible_anchors(columns, scalar_camera, settings, visible, workspace, executor);
    } else {
      visible_anchors(columns, scalar_camera, settings, visible, workspace, executor, camera.lens);
    }
  }
  /// What is behind the scene: the drawn colour of a training iteration with a random background, else that of the model.
  [[nodiscard]] static std::array<Scalar, 3> background(const RenderSettings& render, const Context& context) {
    if constexpr (present<typename R::Background>) {
      if (context.background.drawn) {
        const std::array<double, 3>& c = context.background.color;
        return {static_cast<Scalar>(c[0]), static_cast<Scalar>(c[1]), static_cast<Scalar>(c[2])};
      }
    }
    return background(render);
  }
  [[nodiscard]] static std::array<Scalar, 3> background(const RenderSettings& render) {
    return {static_cast<Scalar>(render.background[0]), static_cast<Scalar>(render.background[1]),
            static_cast<Scalar>(render.background[2])};
  }

 private:
  /// Weight of the losses that every recipe has; 1 but in the published schedule of a watermark.
  [[nodiscard]] static constexpr double image_weight([[maybe_unused]] const Context& context) {
    if constexpr (Marks::is_absent) {
      return 1;
    } else {
      return context.marks.weights.image;
    }
  }
  /// fidelity * mean (image - host)^2: its gradient into d_image (set), the mean returned; zeros at a fidelity of 0.
  template <Executor E>
  static double square_departure(ImageView<const Scalar> image, ImageView<const Scalar> host, Scalar fidelity,
                                 ImageView<Scalar> d_image, Context& context, E& executor) {
    if (!(fidelity > Scalar(0))) {
      set_zero(d_image.flat(), executor);
      return 0;
    }
    COMPMARK_ASSERT(host.size() == image.size(), "Pipeline::message_loss: the host's render is of another size");
    constexpr std::size_t grain = 1 << 14;
    const Scalar slope = Scalar(2) * fidelity / static_cast<Scalar>(image.size());
    context.marks.square.resize(chunk_count(image.size(), grain));
    executor.for_chunks(image.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      double sum = 0;
      for (std::size_t i = begin; i < end; ++i) {
        const Scalar difference = image.data[i] - host.data[i];
        d_image.data[i] = slope * difference;
        sum += static_cast<double>(difference) * static_cast<double>(difference);
      }
      context.marks.square[begin / grain] = sum;
    });
    double sum = 0;
    for (std::size_t c = 0; c < context.marks.square.size(); ++c) sum += context.marks.square[c];
    return sum / static_cast<double>(image.size());
  }
  template <Executor E>
  static void set_zero(std::span<Scalar> values, E& executor) {
    executor.for_chunks(values.size(), std::size_t{1} << 16, [values](std::size_t begin, std::size_t end, std::size_t) {
      std::fill(values.begin() + static_cast<std::ptrdiff_t>(begin), values.begin() + static_cast<std::ptrdiff_t>(end),
                Scalar{});
    });
  }

  [[no_unique_address]] typename R::GaussianDecoder decoder_;
  [[no_unique_address]] std::conditional_t<Road::is_absent, detail::Nothing<Road>, Road> road_;
  [[no_unique_address]] std::conditional_t<Marks::is_absent, detail::Nothing<Marks>, Marks> marks_;
};

}  // namespace compmark
