// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Explicit Gaussians of a model, for viewers without anchors and networks; here exact for one camera. For all cameras
// at once see sh_fit.hpp. compare_bake measures the loss: PSNR of the baked render against the model's own, view by
// view.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/metric/psnr.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/splat_table.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/pipeline.hpp"

namespace compmark {

/// The Gaussians that are drawn for this camera, colours as degree 0: rendered from here the table is the model. Those
/// without opacity, which a codec's masks took, are left out. `view` chooses the appearance row, if the recipe has one.
/// The table is decoded before anything is drawn: it is whole, also where the view shows more than the rasterizer has
/// memory for. Cost: one render.
template <Recipe R, Executor E>
[[nodiscard]] SplatTable bake_at_camera(const Model<R>& model, const ViewCamera<R>& camera, std::size_t view,
                                        E& executor) {
  typename Pipeline<R>::Context context;
  Pipeline<R>{}.forward(model, camera, view, context, executor);
  return to_splat_table(std::as_const(context.gaussians).columns());
}

/// Renders explicit Gaussians as a viewer would, with the rasterizer and the render settings of the model they come
/// from.
template <Recipe R>
class SplatRenderer {
 public:
  using Scalar = typename R::Scalar;
  explicit SplatRenderer(const RenderSettings& render) : render_(render) {}

  /// Image [3, height, width]; valid until the next call. With an error() it is the background.
  template <Executor E>
  ImageView<const Scalar> render(const SplatTable& table, const ViewCamera<R>& camera, E& executor) {
    to_gaussians(table, camera.center_world, gaussians_, executor);
    image_.resize(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    const ImageView<Scalar> image{image_.data(), 3, camera.height, camera.width};
    report_ = Pipeline<R>::rasterizer(render_, camera)
                  .forward(std::as_const(gaussians_).columns(), camera.template cast<Scalar>(),
                           Pipeline<R>::background(render_), image, context_, executor);
    return image;
  }
  /// Of the last render: it shows more than the rasterizer has memory for.
  [[nodiscard]] const std::optional<Error>& error() const { return report_.error; }

 private:
  RenderSettings render_;
  RasterReport report_;
  GaussianBatch<Scalar> gaussians_;
  typename R::Rasterizer::Context context_;
  Buffer<Scalar> image_;
};

/// One camera's figures, all PSNR in dB on images rounded to 8 bits.
struct BakeComparison {
  double bake_to_model = 0;  ///< render of the bake against the model's own render
  double model_to_target = std::numeric_limits<double>::quiet_NaN();  ///< NaN without ground truth
  double bake_to_target = std::numeric_limits<double>::quiet_NaN();
};

struct BakeReport {
  std::vector<BakeComparison> views;
  double mean_bake_to_model = 0;
  double worst_bake_to_model = 0;
  std::size_t worst_view = 0;  ///< index into the cameras
  double mean_model_to_target = std::numeric_limits<double>::quiet_NaN();
  double mean_bake_to_target = std::numeric_limits<double>::quiet_NaN();
  /// The loss by the bake, dB against photographs.
  [[nodiscard]] double loss() const { return mean_model_to_target - mean_bake_to_target; }
};

/// Fills the ground truth of camera i: targets(i, image). Empty where there is none.
using BakeTargets = std::function<Result<Done>(std::size_t, ImageView<float>)>;

/// Renders `table_at(i)` (a const SplatTable&) and the model at every camera. `appearance_view` is the appearance row.
/// Cost: two renders a camera.
template <Recipe R, class TableAt, Executor E>
  requires std::same_as<typename R::Scalar, float>
[[nodiscard]] Result<BakeReport> compare_bakes(const Model<R>& model, const TableAt& table_at,
                                               std::span<const Camera<double>> cameras, const BakeTargets& targets,
                                               std::size_t appearance_view, E& executor) {
  const Pipeline<R> pipeline;
  typename Pipeline<R>::Context context;
  SplatRenderer<R> renderer(model.render);
  Buffer<float> rounded_model, rounded_bake, target;
  BakeReport report;
  double sum_bake = 0, sum_model_target = 0, sum_bake_target = 0;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const ForwardReport rendered = pipeline.forward(model, cameras[i], appearance_view, context, executor);
    const std::size_t size = context.image.size();
    const auto view_of = [&](Buffer<float>& buffer) {
      return ImageView<float>{buffer.data(), 3, cameras[i].height, cameras[i].width};
    };
    if (rendered.raster.error) return *rendered.raster.error;
    rounded_model.resize(size);
    round_to_8bit(ImageView<const float>(context.image), view_of(rounded_model));
    const SplatTable& table = table_at(i);
    rounded_bake.resize(size);
    round_to_8bit(renderer.render(table, cameras[i], executor), view_of(rounded_bake));
    if (renderer.error()) return *renderer.error();
    BakeComparison one;
    one.bake_to_model = psnr(view_of(rounded_bake), view_of(rounded_model));
    if (targets) {
      target.resize(size);
      if (Result<Done> loaded = targets(i, view_of(target)); !loaded) return loaded.error();
      one.model_to_target = psnr(view_of(rounded_model), view_of(target));
      one.bake_to_target = psnr(view_of(rounded_bake), view_of(target));
    }
    sum_bake += one.bake_to_model;
    sum_model_target += one.model_to_target;
    sum_bake_target += one.bake_to_target;
    if (i == 0 || one.bake_to_model < report.worst_bake_to_model) {
      report.worst_bake_to_model = one.bake_to_model;
      report.worst_view = i;
    }
    report.views.push_back(one);
  }
  const double n = static_cast<double>(std::max<std::size_t>(1, cameras.size()));
  report.mean_bake_to_model = sum_bake / n;
  report.mean_model_to_target = sum_model_target / n;
  report.mean_bake_to_target = sum_bake_target / n;
  return report;
}

/// One table for all cameras.
template <Recipe R, Executor E>
[[nodiscard]] Result<BakeReport> compare_bake(const Model<R>& model, const SplatTable& table,
                                              std::span<const Camera<double>> cameras, const BakeTargets& targets,
                                              std::size_t appearance_view, E& executor) {
  return compare_bakes(
      model, [&](std::size_t) -> const SplatTable& { return table; }, cameras, targets, appearance_view, executor);
}

}  // namespace compmark
