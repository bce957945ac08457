// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/pipeline/pipeline.hpp>
#include <compmark/recipes/scaffold.hpp>

#include "small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::cloud;
using compmark::testing::ring_camera;

// Smooth everywhere: the cut-off is a ramp, nothing stops, nothing is clamped (numerics case BF4).
constexpr Accuracy smooth{.exp_degree = 0, .alpha_max = 1.0f, .transmittance_stop = 0.0f, .cutoff = CutoffRule::smooth};

struct SmallDouble : DefaultRecipe<double, DecoderShape{.feature_dim = 8, .offsets = 3}, smooth> {};
struct SmallDistance : DefaultRecipe<double, DecoderShape{.feature_dim = 8, .offsets = 3, .distance = true}, smooth> {};
struct SmallAppearance
    : DefaultRecipe<double, DecoderShape{.feature_dim = 8, .offsets = 3, .feature_bank = true, .appearance_dim = 4},
                    smooth> {};

/// A model with every parameter away from zero, so that every path carries gradient.
template <class R>
Model<R> random_model(std::size_t anchors) {
  Model<R> model;
  model.create(anchors, 2);
  R::GaussianDecoder::initialise(model.arena, model.decoder, 3);
  const AnchorColumns<double> columns = anchor_values(model.arena, model.anchors);
  const Random random(11, 0, random_stage("test model"));
  for (std::size_t i = 0; i < columns.position.size(); ++i) columns.position.data[i] = 1.2 * random.uniform(i) - 0.6;
  for (std::size_t i = 0; i < columns.offset.size(); ++i) columns.offset.data[i] = random.normal(i + 1000);
  for (std::size_t i = 0; i < columns.scaling.size(); ++i)
    columns.scaling.data[i] = -1.8 + 0.3 * random.normal(i + 2000);
  for (std::size_t i = 0; i < columns.feature.size(); ++i) columns.feature.data[i] = random.normal(i + 3000);
  model.render.background = {0.2, 0.4, 0.1};
  return model;
}

template <class R>
double loss_of(const Model<R>& model, const Camera<double>& camera, ImageView<const double> target,
               typename Pipeline<R>::Context& context) {
  SerialExecutor executor;
  const Pipeline<R> pipeline;
  static_cast<void>(pipeline.forward(model, camera, 1, context, executor));
  return pipeline.loss(target, {0.2, 0.01}, context, executor).total;
}

}  // namespace

TEST_CASE_TEMPLATE("pipeline: the directional derivative of the whole road equals central differences", R, SmallDouble,
                   SmallDistance, SmallAppearance) {
  Model<R> model = random_model<R>(24);
  const Camera<double> camera = ring_camera(1, 5, 37, 29);
  Buffer<double> target_storage(3 * 37 * 29);
  // Outside [0, 1]: |render - target| has no kink there, and SSIM keeps a slope.
  const Random random(5, 0, random_stage("test target"));
  for (std::size_t i = 0; i < target_storage.size(); ++i) target_storage[i] = 1.5 + random.uniform(i);
  const ImageView<const double> target{target_storage.data(), 3, 29, 37};

  typename Pipeline<R>::Context context;
  SerialExecutor executor;
  const Pipeline<R> pipeline;
  const double loss = loss_of(model, camera, target, context);
  CHECK(std::isfinite(loss));
  pipeline.backward(model, camera, 1, context, executor);

  const ArenaLayout& layout = model.arena.layout();
  const std::vector<double> start(model.arena.all_values().begin(), model.arena.all_values().end());
  for (int trial = 0; trial < 4; ++trial) {
    std::vector<double> direction(start.size(), 0.0);
    const Random pick(17, static_cast<std::uint64_t>(trial), random_stage("test direction"));
    for (const ArenaLayout::Block& block : layout.blocks()) {
      if (block.name == "anchor.position") continue;  // never trained: its gradient is not computed
      for (std::size_t i = 0; i < block.size(); ++i) direction[block.offset + i] = pick.normal(block.offset + i);
    }
    double analytic = 0;
    for (std::size_t i = 0; i < start.size(); ++i) analytic += direction[i] * model.arena.all_gradients()[i];
    double best = 1;
    for (const double h :
         {3e-5, 1e-5, 3e-6, 1e-6}) {  // best of a sweep: truncation against rounding (numerics sheet, section 4)
      const auto at = [&](double step) {
        for (std::size_t i = 0; i < start.size(); ++i) model.arena.all_values()[i] = start[i] + step * direction[i];
        typename Pipeline<R>::Context fresh;
        return loss_of(model, camera, target, fresh);
      };
      const double numeric = (at(h) - at(-h)) / (2 * h);
      best = std::min(best, std::abs(numeric - analytic) / std::max(1e-12, std::abs(numeric)));
    }
    std::copy(start.begin(), start.end(), model.arena.all_values().begin());
    INFO("trial ", trial, ": relative error ", best, " of derivative ", analytic);
    CHECK(std::abs(analytic) > 1e-6);
    CHECK(best <= 1e-6);
  }
}

TEST_CASE("pipeline: render and gradient have the same bits for 1, 2, 3 and 4 threads") {
  struct Small : DefaultRecipe<float, DecoderShape{.feature_dim = 16, .offsets = 5}> {};
  const auto run = [](std::size_t threads) {
    Model<Small> model;
    model.create(700, 1);
    Small::GaussianDecoder::initialise(model.arena, model.decoder, 3);
    const AnchorColumns<float> columns = anchor_values(model.arena, model.anchors);
    const auto points = cloud(700, 4);
    for (std::size_t i = 0; i < 700; ++i) {
      for (std::size_t a = 0; a < 3; ++a) columns.position(i, a) = points[i][a];
    }
    const Random random(1, 2, 3);
    for (float& x : columns.offset.flat()) x = random.centered(static_cast<std::uint64_t>(&x - columns.offset.data));
    for (float& x : columns.scaling.flat()) x = -2.5f;
    for (float& x : columns.feature.flat())
      x = random.centered(static_cast<std::uint64_t>(&x - columns.feature.data) + 99999);
    ThreadExecutor executor(threads);
    const Pipeline<Small> pipeline;
    Pipeline<Small>::Context context;
    const compmark::testing::BlobViews views{6, 100, 75};
    Buffer<float> target(3 * 100 * 75);
    static_cast<void>(views.load(0, ImageView<float>{target.data(), 3, 75, 100}));
    static_cast<void>(pipeline.forward(model, views.camera(0), 0, context, executor));
    const double loss = pipeline.loss(ImageView<const float>{target.data(), 3, 75, 100}, {}, context, executor).total;
    pipeline.backward(model, views.camera(0), 0, context, executor);
    std::vector<float> all(context.image.flat().begin(), context.image.flat().end());
    all.insert(all.end(), model.arena.all_gradients().begin(), model.arena.all_gradients().end());
    all.push_back(static_cast<float>(loss));
    return all;
  };
  const std::vector<float> one = run(1);
  CHECK(*std::max_element(one.begin(), one.end()) > 0);
  for (const std::size_t threads : {2u, 3u, 4u}) {
    const std::vector<float> many = run(threads);
    CHECK(one.size() == many.size());
    CHECK(std::equal(one.begin(), one.end(), many.begin(), [](float a, float b) {
      return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
    }));
  }
}
