// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/training/space_volume.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/splat/anchor/contracted_space.hpp>
#include <compmark/splat/training/pipeline.hpp>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "support/directional.hpp"
#include "support/small_scene.hpp"

using namespace compmark;

static_assert(std::is_same_v<SpaceVolumeLoss<float, EuclideanSpace, 5>::Context, ScaleVolumeLoss<float>::Context>);

namespace {

/// Anchors from inside a ball of radius 2 to 100 of its radii; every other one is decoded, into one to three Gaussians each.
struct Spread {
  static constexpr int offsets = testing::small_shape.offsets;
  std::vector<double> position;
  std::vector<std::uint32_t> visible, slot;
  std::array<std::vector<double>, 3> scale, gradient;

  explicit Spread(std::size_t anchors) {
    const Random random(4, 0, random_stage("test volume"));
    for (std::size_t a = 0; a < anchors; ++a) {
      const double far = std::pow(10.0, 3 * random.uniform(a) - 0.7);
      for (std::size_t axis = 0; axis < 3; ++axis) position.push_back(far * random.centered(100000 + 3 * a + axis));
      if (a % 2 == 0) continue;
      visible.push_back(static_cast<std::uint32_t>(a));
      for (std::size_t k = 0; k <= a % 3; ++k) {
        slot.push_back(static_cast<std::uint32_t>(a * offsets + k));
        for (std::size_t axis = 0; axis < 3; ++axis)
          scale[axis].push_back(0.02 * far * (0.5 + random.uniform(200000 + 9 * a + 3 * k + axis)));
      }
    }
    for (std::vector<double>& column : gradient) column.assign(slot.size(), 0.25);  // it is added to
  }
  template <class Context>
  void place(Context& context) const {
    context.position = {position.data(), position.size() / 3, 3};
    context.decoded.visible = visible;
    context.decoded.gaussian_slot = slot;
  }
  [[nodiscard]] std::array<const double*, 3> values() const {
    return {scale[0].data(), scale[1].data(), scale[2].data()};
  }
  [[nodiscard]] std::array<double*, 3> gradients() {
    return {gradient[0].data(), gradient[1].data(), gradient[2].data()};
  }
};

using World = SpaceVolumeLoss<double, EuclideanSpace, Spread::offsets>;
using Cells = SpaceVolumeLoss<double, ContractedSpace, Spread::offsets>;

}  // namespace

TEST_CASE("training/space_volume: volumes count in cells, and the gradient is that of central differences") {
  Spread spread(49);
  const std::size_t count = spread.slot.size();
  Cells::Context context;
  spread.place(context);
  const Cells cells(ContractedSpace{{0.3, -0.2, 0.1}, 2});
  SerialExecutor executor;
  const auto loss = [&] { return cells.forward(spread.values(), count, context, executor).loss; };
  double expected = 0, world = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double* p = spread.position.data() + 3 * (spread.slot[i] / Spread::offsets);
    const double r = std::hypot(p[0] - 0.3, p[1] + 0.2, p[2] - 0.1) / 2;
    const double across =
        r > 1 ? r / (2 - 1 / r) : 1;  // 1 over the length of a contracted step across the line of sight
    const double volume = spread.scale[0][i] * spread.scale[1][i] * spread.scale[2][i] / static_cast<double>(count);
    world += volume;
    expected += volume / (across * across * across);
  }
  CHECK(loss() == doctest::Approx(expected).epsilon(1e-13));
  CHECK(world > 20 * expected);  // the control: the far ones rule the loss in the world

  CHECK(loss() > 0);
  cells.backward(spread.values(), count, 3.0, spread.gradients(), context, executor);
  double worst = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < count; ++i) {
      double& scale = spread.scale[axis][i];
      const double at = scale, h = 0.5 * at;  // linear in each scale: any step is exact but for rounding
      scale = at + h;
      const double high = loss();
      scale = at - h;
      const double low = loss();
      scale = at;
      const double slope = 3 * (high - low) / (2 * h);
      worst = std::max(worst, std::abs(spread.gradient[axis][i] - 0.25 - slope) / slope);
    }
  }
  CHECK(worst < 1e-9);  // measured: 2.0e-11, where a small Gaussian changes a large sum
}

TEST_CASE("training/space_volume: in the world, and with everything in the ball, it is the published loss to the bit") {
  Spread spread(9000), plain = spread;
  const std::size_t count = spread.slot.size();
  SerialExecutor executor;
  World::Context published;
  Cells::Context ball, stretched;
  for (Cells::Context* context : {&ball, &stretched}) spread.place(*context);
  const Cells wide(ContractedSpace{{0, 0, 0}, 1e6});
  const double loss = World{}.forward(plain.values(), count, published, executor).loss;
  CHECK(std::bit_cast<std::uint64_t>(loss) ==
        std::bit_cast<std::uint64_t>(wide.forward(spread.values(), count, ball, executor).loss));
  World{}.backward(plain.values(), count, 0.01, plain.gradients(), published, executor);
  wide.backward(spread.values(), count, 0.01, spread.gradients(), ball, executor);
  CHECK(spread.gradient == plain.gradient);
  CHECK(Cells{}.forward(spread.values(), count, stretched, executor).loss < 0.1 * loss);  // the control

  Spread threaded(9000);
  ThreadExecutor threads(3);
  Cells::Context parallel;
  threaded.place(parallel);
  CHECK(Cells{}.forward(threaded.values(), count, parallel, threads).loss ==
        Cells{}.forward(spread.values(), count, stretched, executor).loss);
  CHECK(Cells{}.forward(threaded.values(), 0, parallel, threads).loss == 0);
}

namespace {

using compmark::testing::SmoothRecipe;
struct SmoothContracted : SmoothRecipe {
  using Space = ContractedSpace;
};

}  // namespace

TEST_CASE("training/space_volume: the directional derivative of the whole pass equals central differences") {
  constexpr int width = 37, height = 29;
  Model<SmoothContracted> model = compmark::testing::random_model<SmoothContracted>(24);
  const Camera<double> camera = compmark::testing::ring_camera(1, 5, width, height);
  const Random random(5, 0, random_stage("test target"));
  std::vector<double> target(3 * width * height);
  for (std::size_t i = 0; i < target.size(); ++i) target[i] = 1.5 + random.uniform(i);
  using Context = Pipeline<SmoothContracted>::Context;
  SerialExecutor executor;
  Pipeline<SmoothContracted> pipeline;
  const auto with_radius = [](double radius) {
    return Pipeline<SmoothContracted>::Volume(ContractedSpace{{0.05, 0, -0.1}, radius});
  };
  pipeline.volume() = with_radius(0.3);
  // Anchors lie within 0.6 of the middle of each axis: with a radius of 0.3 most are stretched, by up to 1.9. The weight makes the volume a
  // tenth of the loss.
  const auto loss = [&](Context& context) {
    static_cast<void>(pipeline.forward(model, camera, 1, context, executor));
    return pipeline.loss(ImageView<const double>{target.data(), 3, height, width}, {0.2, 30}, context, executor).total;
  };
  compmark::testing::check_directional_derivative(
      model, loss, [&](Context& context) { pipeline.backward(model, camera, 1, context, executor); });
  Context contracted;
  static_cast<void>(loss(contracted));
  const double volume =
      pipeline.loss(ImageView<const double>{target.data(), 3, height, width}, {0.2, 30}, contracted, executor).volume;
  pipeline.volume() = with_radius(100);
  const double world =
      pipeline.loss(ImageView<const double>{target.data(), 3, height, width}, {0.2, 30}, contracted, executor).volume;
  MESSAGE("volume ", volume, " in cells, ", world, " in the world");
  CHECK(volume < 0.8 * world);
  CHECK(sizeof(Pipeline<SmoothRecipe>::Context) < sizeof(Context));
}
