// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Refines fitted splats against the model they come from. sh_fit.hpp fits colours well (its residual is ~0.001), but a
// model also changes opacity, scale and rotation with the view, and one average of them loses decibels. Here the table
// is rendered, compared with the model's own render (mean square, which is what PSNR measures) and moved by Adam, one
// camera an iteration. Means stay: they are exact. Cost: two renders and a backward pass an iteration; 16 bytes a
// number of the table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/result.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/splat_table.hpp"
#include "compmark/splat/effect/concept.hpp"
#include "compmark/splat/optim/adam.hpp"
#include "compmark/splat/optim/schedule.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/splat/training/training_views.hpp"

namespace compmark {

/// Learning rates fall log-linearly to `final_rate` times these.
struct SplatRefineSettings {
  std::int64_t iterations = 500;
  double opacity = 0.02;  ///< a logit
  double log_scale = 0.01;
  double rotation = 0.003;
  double color = 0.01;  ///< coefficient of degree 0
  double color_rest = 0.002;
  double final_rate = 0.1;
  std::uint64_t seed = 0;  ///< of the order of the cameras
  std::size_t appearance_view = unseen_view;
};

struct SplatRefineReport {
  /// Mean square distance to the model's renders, over the first pass over the cameras and over the last (or all
  /// iterations, if fewer).
  double first_mse = 0;
  double last_mse = 0;
  std::size_t skipped_blocks = 0;  ///< columns whose gradient was not finite
};

namespace detail {

/// The table's trainable columns as one-column blocks of an arena.
class SplatArena {
 public:
  SplatArena(SplatTable& table, const SplatRefineSettings& settings) {
    for (std::size_t i = 0; i < 3; ++i) add("scale_", i, table.log_scale[i], settings.log_scale);
    for (std::size_t i = 0; i < 4; ++i) add("rot_", i, table.rotation[i], settings.rotation);
    add("opacity_", 0, table.opacity, settings.opacity);
    for (std::size_t i = 0; i < table.sh.size(); ++i) {
      add("sh_", i, table.sh[i], i % table.coefficients() == 0 ? settings.color : settings.color_rest);
    }
    arena_ = ParameterArena<float>();
    for (const Column& column : columns_)
      arena_.add(column.name, table.count, 1, RowKind::fixed, BlockRole::rendering,
                 LearningSchedule::constant(column.rate));
    for (std::size_t b = 0; b < columns_.size(); ++b)
      std::copy(columns_[b].values->begin(), columns_[b].values->end(), arena_.values({b}).data);
    adam_.prepare(arena_.layout(), state_);
  }

  [[nodiscard]] SplatTableGradient<float> gradient() {
    SplatTableGradient<float> result;
    std::size_t b = 0;
    for (float*& column : result.log_scale) column = arena_.gradients({b++}).data;
    for (float*& column : result.rotation) column = arena_.gradients({b++}).data;
    result.opacity = arena_.gradients({b++}).data;
    while (b < columns_.size()) result.sh.push_back(arena_.gradients({b++}).data);
    return result;
  }

  /// One step, the gradients to zero, and the new values back into the table.
  template <Executor E>
  std::size_t step(double rate, E& executor) {
    rates_.clear();
    for (const Column& column : columns_) rates_.push_back(column.rate * rate);
    const AdamReport report = adam_.step(arena_, rates_, state_, executor);
    for (float& value : arena_.all_gradients()) value = 0;
    for (std::size_t b = 0; b < columns_.size(); ++b) {
      const std::span<const float> values = std::as_const(arena_).values({b}).flat();
      std::copy(values.begin(), values.end(), columns_[b].values->begin());
    }
    return report.skipped_blocks;
  }

 private:
  struct Column {
    std::string name;
    std::vector<float>* values;
    double rate;
  };
  void add(const char* name, std::size_t index, std::vector<float>& values, double rate) {
    columns_.push_back({name + std::to_string(index), &values, rate});
  }
  std::vector<Column> columns_;
  ParameterArena<float> arena_;
  Adam<float> adam_;
  typename Adam<float>::State state_;
  std::vector<double> rates_;
};

}  // namespace detail

/// Moves `table` towards what `model` shows from `cameras`. Deterministic, whatever the number of threads. An Error
/// where a view of either shows more than the rasterizer has memory for (RasterReport::error); the table then is that
/// of the iterations before.
template <Recipe R, Executor E>
  requires std::same_as<typename R::Scalar, float>
[[nodiscard]] Result<SplatRefineReport> refine_splats(const Model<R>& model, SplatTable& table,
                                                      std::span<const Camera<double>> cameras,
                                                      const SplatRefineSettings& settings, E& executor) {
  SplatRefineReport report;
  if (table.count == 0 || cameras.empty() || settings.iterations <= 0) return report;
  detail::SplatArena arena(table, settings);
  const Pipeline<R> pipeline;
  typename Pipeline<R>::Context target;
  typename R::Rasterizer::Context context;
  GaussianBatch<float> gaussians, d_gaussians;
  Buffer<float> image, d_image;
  Buffer<double> partial;
  ViewOrder order(settings.seed, cameras.size());
  const typename R::Rasterizer rasterizer = pipeline.rasterizer(model.render);
  const LogLinear schedule{1, settings.final_rate, settings.iterations};
  const auto window = std::min<std::int64_t>(settings.iterations, static_cast<std::int64_t>(cameras.size()));
  for (std::int64_t t = 1; t <= settings.iterations; ++t) {
    const Camera<double>& camera = cameras[order.at(t)];
    const Camera<float> scalar_camera = camera.template cast<float>();
    ForwardReport shown = pipeline.forward(model, camera, settings.appearance_view, target, executor);
    if (shown.raster.error) return std::move(*shown.raster.error);
    const std::size_t size = target.image.size();
    image.resize(size);
    d_image.resize(size);
    to_gaussians(table, camera.center_world, gaussians, executor);
    d_gaussians.resize(table.count);
    d_gaussians.set_zero();
    RasterReport drawn =
        rasterizer.forward(std::as_const(gaussians).columns(), scalar_camera, pipeline.background(model.render),
                           ImageView<float>{image.data(), 3, camera.height, camera.width}, context, executor);
    if (drawn.error) return std::move(*drawn.error);
    constexpr std::size_t grain = std::size_t{1} << 14;
    partial.resize(chunk_count(size, grain));
    const double squares =
        ordered_sum<double>(executor, size, grain, partial.span(), [&](std::size_t begin, std::size_t end) {
          double sum = 0;
          for (std::size_t i = begin; i < end; ++i) {
            const float difference = image[i] - target.image.data[i];
            d_image[i] = 2 * difference / static_cast<float>(size);
            sum += static_cast<double>(difference) * static_cast<double>(difference);
          }
          return sum;
        });
    rasterizer.backward(std::as_const(gaussians).columns(), scalar_camera, pipeline.background(model.render),
                        ImageView<const float>{d_image.data(), 3, camera.height, camera.width}, d_gaussians.columns(),
                        context, executor);
    to_gaussians_backward(table, camera.center_world, std::as_const(gaussians).columns(),
                          std::as_const(d_gaussians).columns(), arena.gradient(), executor);
    report.skipped_blocks += arena.step(schedule.value(t), executor);
    const double mse = squares / static_cast<double>(size) / static_cast<double>(window);
    if (t <= window) report.first_mse += mse;
    if (t > settings.iterations - window) report.last_mse += mse;
  }
  return report;
}

}  // namespace compmark
