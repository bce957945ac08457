// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/testing/archetypes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/trainer.hpp"
#include "compmark/testing/executor_laws.hpp"

using namespace compmark;

static_assert(Executor<testing::ExecutorArchetype>, "the archetype meets its concept");
static_assert(Rasterizer<testing::RasterizerArchetype<float>>, "the archetype meets its concept");
static_assert(Rasterizer<testing::RasterizerArchetype<double>>, "the archetype meets its concept");
static_assert(GaussianDecoder<testing::GaussianDecoderArchetype<float, DecoderShape{}>>,
              "the archetype meets its concept");
static_assert(ImageLoss<testing::ImageLossArchetype<float>>, "the archetype meets its concept");
static_assert(Optimizer<testing::OptimizerArchetype<float>>, "the archetype meets its concept");
static_assert(DensityControl<testing::DensityControlArchetype<float>>, "the archetype meets its concept");

namespace {

/// Nothing but archetypes where a concept stands at the door.
struct Bare : DefaultRecipe<float, DecoderShape{.feature_dim = 8, .offsets = 3}> {
  using GaussianDecoder = testing::GaussianDecoderArchetype<float, DecoderShape{.feature_dim = 8, .offsets = 3}>;
  using Rasterizer = testing::RasterizerArchetype<float>;
  using DensityControl = testing::DensityControlArchetype<float>;
  using Optimizer = testing::OptimizerArchetype<float>;
};

struct OneGreyView {
  [[nodiscard]] std::size_t size() const { return 1; }
  [[nodiscard]] Camera<double> camera(std::size_t /*view*/) const {
    Camera<double> camera;
    camera.width = camera.height = 12;
    camera.fx = camera.fy = 12;
    camera.cx = camera.cy = 6;
    camera.center_world = {0, 0, -3};
    camera.rotation_camera_world = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    return camera;
  }
  [[nodiscard]] Result<Done> load(std::size_t /*view*/, ImageView<float> image) const {
    for (float& pixel : image.flat()) pixel = 0.5f;
    return Done{};
  }
};

}  // namespace

TEST_CASE("testing/archetypes: the executor archetype obeys E1 to E4") {
  const std::string broken = testing::executor_laws([](std::size_t) { return testing::ExecutorArchetype{}; });
  CHECK_MESSAGE(broken.empty(), broken);
}

TEST_CASE("testing/archetypes: a recipe of archetypes trains, so stages ask for no more than their concepts say") {
  testing::ExecutorArchetype executor;
  TrainSettings settings;
  settings.iterations = 40;
  settings.grow_interval = 1;
  settings.statistics_after = 0;
  settings.grow_after = 0;
  settings.grow_until = 30000;
  Trainer<Bare, testing::ExecutorArchetype> trainer(settings, 1, 1.0, executor);
  const std::array<std::array<float, 3>, 5> points{
      {{0, 0, 0}, {0.3f, 0, 0}, {0, 0.3f, 0}, {0, 0, 0.3f}, {0.3f, 0.3f, 0}}};
  REQUIRE(trainer.initialise(points).ok());
  const std::vector<float> before(trainer.model().arena.all_values().begin(), trainer.model().arena.all_values().end());
  OneGreyView views;
  std::size_t adjusted = 0;
  while (!trainer.finished()) {
    const Result<IterationReport> report = trainer.step(views);
    REQUIRE(report.ok());
    CHECK(report->forward.visible_anchors > 0);
    CHECK(report->forward.gaussians > 0);
    CHECK(report->loss.l1 == 0.5);
    adjusted += report->adjusted ? 1u : 0u;
  }
  CHECK(adjusted > 0);
  CHECK(std::equal(before.begin(), before.end(), trainer.model().arena.all_values().begin(),
                   trainer.model().arena.all_values().end()));
}
