// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A scene of a given size for benchmarks of whole training iterations: anchors in a ball in front of the camera, a target of noise, and
// Adam with rates so small that the scene stays what it is. A template on the recipe, so that an effect is measured on the same scene.
#pragma once

#include <cmath>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <cstddef>
#include <vector>

namespace compmark::benchmarks {

struct Workload {
  std::size_t anchors = 30000;
  int size = 400;
  double sigma_px = 2.2;     ///< median standard deviation of a Gaussian on screen
  double opacity_shift = 0;  ///< of the opacity head's bias, so that half of the offsets are positive
};

/// (a) and (b): 150,000 and 500,000 Gaussians.
inline constexpr Workload workload_a{30000, 400, 1.27, 0.071}, workload_b{100000, 800, 1.36, 0.071};

/// Anchors in a ball in front of the camera; the opacity head is biased so that half of the offsets are positive.
template <class R>
struct IterationScene {
  explicit IterationScene(const Workload& work) {
    camera.width = camera.height = work.size;
    camera.fx = camera.fy = 1.4 * work.size;
    camera.cx = camera.cy = 0.5 * work.size;
    camera.center_world = {0, 0, -4};
    model.create(work.anchors, 1);
    R::GaussianDecoder::initialise(model.arena, model.decoder, 1);
    model.initialise_stages(1);
    const MatrixView<float> bias = model.arena.values(model.decoder.opacity.bias2);
    for (std::size_t k = 0; k < bias.columns; ++k) bias(0, k) -= static_cast<float>(work.opacity_shift);
    const AnchorColumns<float> columns = anchor_values(model.arena, model.anchors);
    const Random random(1234, 0, random_stage("benchmark scene"));
    const double base = work.sigma_px * 4.0 / (1.4 * work.size);
    for (std::size_t i = 0; i < work.anchors; ++i) {
      for (std::size_t a = 0; a < 3; ++a)
        columns.position(i, a) = static_cast<float>(2.4 * random.uniform(9 * i + a) - 1.2);
      for (std::size_t c = 0; c < columns.offset.columns; ++c)
        columns.offset(i, c) = static_cast<float>(random.normal(1000003 * (c + 1) + i));
      for (std::size_t c = 0; c < 6; ++c) {
        columns.scaling(i, c) = static_cast<float>(
            std::log(2 * base) + 0.6 * random.normal(77777777 + 6 * i + c));  // times a sigmoid of about 1/2
      }
      for (std::size_t c = 0; c < columns.feature.columns; ++c)
        columns.feature(i, c) = static_cast<float>(2 * random.normal(900000000 + 32 * i + c));
    }
    target_storage.resize(3 * static_cast<std::size_t>(work.size * work.size));
    for (std::size_t i = 0; i < target_storage.size(); ++i) target_storage[i] = static_cast<float>(random.uniform(i));
    target = {target_storage.data(), 3, work.size, work.size};
    planes.resize(target.plane_size(), 1.0f);
    optimizer.prepare(model.arena.layout(), adam);
    rates.assign(model.arena.layout().blocks().size(), 1e-9);  // steps of full cost that leave the scene as it is
  }

  Model<R> model;
  Camera<double> camera;
  Buffer<float> target_storage;
  ImageView<const float> target;
  Buffer<float> planes;  ///< alpha and weights of the target: ones
  typename R::Optimizer optimizer;
  typename R::Optimizer::State adam;
  std::vector<double> rates;
  Pipeline<R> pipeline;
  typename Pipeline<R>::Context context;
  typename Pipeline<R>::Phases phases;  ///< of the next iteration

  /// One whole iteration, as Trainer::step but for images and growing.
  template <class E>
  ForwardReport step(E& executor) {
    const ForwardReport report = pipeline.forward(model, camera, 0, context, executor, phases);
    const TargetView<float> view(target, planes.data(), planes.data());
    pipeline.loss(view, {}, context, executor);
    pipeline.backward(model, camera, 0, context, executor);
    optimizer.step(model.arena, rates, adam, executor, {.zero_gradients_after = true});
    Pipeline<R>::Stages::forward([&]<class S>() { S::after_step(model.arena, model.template blocks<S>(), rates); });
    return report;
  }
};

}  // namespace compmark::benchmarks
