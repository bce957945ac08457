// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/export/bake.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "bake_scene.hpp"
#include "compmark/core/thread_executor.hpp"

using namespace compmark;
using testing::BakeRecipe;

TEST_CASE("export/bake: from its own camera a bake is the model, to the rounding of logarithms and logits") {
  const Model<BakeRecipe> model = testing::bake_model(200, 2, 1);
  const std::vector<Camera<double>> cameras = testing::orbit_cameras(5);
  ThreadExecutor executor(2);
  const Pipeline<BakeRecipe> pipeline;
  Pipeline<BakeRecipe>::Context context;
  SplatRenderer<BakeRecipe> renderer(model.render);
  for (const Camera<double>& camera : cameras) {
    pipeline.forward(model, camera, 0, context, executor);
    const SplatTable table = bake_at_camera(model, camera, 0, executor);
    CHECK(table.count == context.gaussians.size());
    CHECK(table.degree == 0);
    const ImageView<const float> image = renderer.render(table, camera, executor);
    float largest = 0, brightest = 0;
    for (std::size_t i = 0; i < image.size(); ++i) {
      largest = std::max(largest, std::abs(image.data[i] - context.image.data[i]));
      brightest = std::max(brightest, image.data[i]);
    }
    CHECK(brightest > 0.3f);  // there is something to see
    CHECK(largest < 5e-3f);   // one alpha at the cut-off of 1/255 may fall on the other side; elsewhere ~1e-6
  }
}

TEST_CASE("export/bake: compare_bake tells a good bake from one of another camera, and measures against ground truth") {
  const Model<BakeRecipe> model = testing::bake_model(200, 2, 3);
  const std::vector<Camera<double>> cameras = testing::orbit_cameras(6);
  ThreadExecutor executor(2);
  std::vector<SplatTable> own;
  for (const Camera<double>& camera : cameras) own.push_back(bake_at_camera(model, camera, 0, executor));
  const auto exact = compare_bakes(
      model, [&](std::size_t i) -> const SplatTable& { return own[i]; }, std::span<const Camera<double>>(cameras), {},
      0, executor);
  REQUIRE(exact.ok());
  CHECK(exact->worst_bake_to_model > 60);
  CHECK(std::isnan(exact->loss()));

  // Targets: the model's own render, slightly wrong, so that all three figures are known.
  const Pipeline<BakeRecipe> pipeline;
  Pipeline<BakeRecipe>::Context context;
  const auto targets = [&](std::size_t i, ImageView<float> image) -> Result<Done> {
    pipeline.forward(model, cameras[i], 0, context, executor);
    for (std::size_t p = 0; p < image.size(); ++p) image.data[p] = std::min(1.0f, context.image.data[p] + 0.02f);
    return Done{};
  };
  const auto fixed = compare_bake(model, own[0], std::span<const Camera<double>>(cameras), targets, 0, executor);
  REQUIRE(fixed.ok());
  CHECK(fixed->views[0].bake_to_model > 60);
  CHECK(fixed->worst_view != 0);
  CHECK(fixed->worst_bake_to_model < 40);  // the bake of camera 0 seen from elsewhere
  CHECK(fixed->mean_model_to_target == doctest::Approx(-20 * std::log10(0.02)).epsilon(0.02));
  CHECK(fixed->loss() > 1);

  const auto failing = [](std::size_t, ImageView<float>) -> Result<Done> {
    return Error{ErrorKind::not_found, "x.png", "", "", ""};
  };
  const auto failed = compare_bake(model, own[0], std::span<const Camera<double>>(cameras), failing, 0, executor);
  REQUIRE_FALSE(failed.ok());
  CHECK(failed.error().file == "x.png");
}
