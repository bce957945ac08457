// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/pipeline.hpp>

#include "support/directional.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::cloud;
using compmark::testing::ring_camera;
using compmark::testing::smooth_accuracy;
using compmark::testing::SmoothRecipe;

struct SmallDistance
    : DefaultRecipe<double, DecoderShape{.feature_dim = 8, .offsets = 3, .distance = true}, smooth_accuracy> {};
struct SmallAppearance
    : DefaultRecipe<double, DecoderShape{.feature_dim = 8, .offsets = 3, .feature_bank = true, .appearance_dim = 4},
                    smooth_accuracy> {};

template <class R>
double loss_of(const Model<R>& model, const Camera<double>& camera, ImageView<const double> target,
               typename Pipeline<R>::Context& context) {
  SerialExecutor executor;
  const Pipeline<R> pipeline;
  static_cast<void>(pipeline.forward(model, camera, 1, context, executor));
  return pipeline.loss(target, {0.2, 0.01}, context, executor).total;
}

}  // namespace

TEST_CASE_TEMPLATE("pipeline: the directional derivative of the whole pass equals central differences", R, SmoothRecipe,
                   SmallDistance, SmallAppearance) {
  Model<R> model = compmark::testing::random_model<R>(24);
  const Camera<double> camera = ring_camera(1, 5, 37, 29);
  Buffer<double> target_storage(3 * 37 * 29);
  // Outside [0, 1]: |render - target| has no kink there, and SSIM keeps a slope.
  const Random random(5, 0, random_stage("test target"));
  for (std::size_t i = 0; i < target_storage.size(); ++i) target_storage[i] = 1.5 + random.uniform(i);
  const ImageView<const double> target{target_storage.data(), 3, 29, 37};

  using Context = typename Pipeline<R>::Context;
  SerialExecutor executor;
  compmark::testing::check_directional_derivative(
      model, [&](Context& context) { return loss_of(model, camera, target, context); },
      [&](Context& context) { Pipeline<R>{}.backward(model, camera, 1, context, executor); });
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
