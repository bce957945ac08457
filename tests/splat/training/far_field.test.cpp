// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A recipe with a contracted space trains, is resumed, and asks for its ball; where the ball holds everything it ends in the bits of the
// recipe without.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/scene/procedural_write.hpp>
#include <compmark/scene/random_points.hpp>
#include <compmark/splat/anchor/contracted_space.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <vector>

#include "support/short_training.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::cloud;
using compmark::testing::short_trainings;
using compmark::testing::SmallRecipe;

struct Contracted : SmallRecipe {
  using Space = ContractedSpace;
};
static_assert(sizeof(Model<SmallRecipe>) == sizeof(Model<Contracted>));  // the space is no part of a model

TrainSettings short_run_of_radius(double radius) {
  TrainSettings settings;
  settings.iterations = 60;
  settings.grow_interval = 10;
  settings.statistics_after = 1000;
  settings.grow_after = 2000;
  settings.grow_until = 29000;
  settings.gradient_threshold = 1e-5;
  settings.voxel_size = 0.05;
  settings.init_factor = 4;
  settings.effects.space_radius = radius;
  return settings;
}

/// All values of the trained model, as bits; grows on the way.
template <class R>
std::vector<std::uint32_t> trained_bits(const TrainSettings& settings) {
  SerialExecutor executor;
  const BlobViews views;
  Trainer<R, SerialExecutor> trainer(settings, views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(cloud(200, 1)).ok());
  const std::size_t before = trainer.model().anchor_count();
  REQUIRE(trainer.run(views).ok());
  CHECK(trainer.model().anchor_count() > before);
  std::vector<std::uint32_t> bits;
  for (const float x : trainer.model().arena.all_values()) {
    CHECK(std::isfinite(x));
    bits.push_back(std::bit_cast<std::uint32_t>(x));
  }
  return bits;
}

}  // namespace

TEST_CASE("training/far_field: with all of the scene in the ball training has the bits of the plain recipe") {
  const std::vector<std::uint32_t> plain = trained_bits<SmallRecipe>(short_run_of_radius(0));
  CHECK(trained_bits<Contracted>(short_run_of_radius(1000)) == plain);
  CHECK(trained_bits<Contracted>(short_run_of_radius(0.4)) != plain);  // the control: half of the cloud is outside
}

namespace {

/// The built-in scene before a far coloured sky, of which a pixel sees the colour of its direction.
class SkyViews {
 public:
  static constexpr int side = 40;
  static constexpr std::size_t pixels = side * side;
  SkyViews() {
    ProceduralSettings settings;
    settings.width = settings.height = side;
    settings.views_train = 80;
    settings.views_test = 8;
    const ProceduralScene scene(settings.seed);
    SerialExecutor executor;
    for (int i = 0; i < 88; ++i) {
      const Split split = i < 80 ? Split::train : Split::test;
      const Camera<double> c = procedural_camera(settings, split, i < 80 ? i : i - 80);
      const ImageBytes bytes = render_procedural(scene, c, executor);
      std::vector<float> image(3 * pixels);
      for (std::size_t k = 0; k < pixels; ++k) {
        const double x = (static_cast<double>(k % side) + 0.5 - c.cx) / c.fx;
        const double y = (static_cast<double>(k / side) + 0.5 - c.cy) / c.fy, n = std::sqrt(x * x + y * y + 1);
        const auto along = [&](std::size_t axis) {
          const std::array<double, 9>& r = c.rotation_camera_world;
          return (r[axis] * x + r[3 + axis] * y + r[6 + axis]) / n;
        };
        const double alpha = bytes.pixels[4 * k + 3] / 255.0;
        for (std::size_t channel = 0; channel < 3; ++channel) {
          const double sky = 0.6 + 0.3 * std::sin(9 * along(channel) + 2 * along((channel + 1) % 3));
          image[channel * pixels + k] =
              static_cast<float>(alpha * bytes.pixels[4 * k + channel] / 255.0 + (1 - alpha) * sky);
        }
      }
      camera_.push_back(c);
      image_.push_back(std::move(image));
    }
  }
  [[nodiscard]] std::size_t size() const { return 80; }
  [[nodiscard]] Camera<double> camera(std::size_t i) const { return camera_[i]; }
  [[nodiscard]] Result<Done> load(std::size_t i, ImageView<float> image) const {
    std::copy(image_[i].begin(), image_[i].end(), image.data);
    return Done{};
  }
  template <class R>
  [[nodiscard]] double test_psnr(const Model<R>& model) const {
    SerialExecutor executor;
    typename Pipeline<R>::Context context;
    double error = 0;
    for (std::size_t i = 80; i < 88; ++i) {
      static_cast<void>(Pipeline<R>{}.forward(model, camera_[i], unseen_view, context, executor));
      for (std::size_t k = 0; k < 3 * pixels; ++k)
        error += std::pow(static_cast<double>(context.image.data[k] - image_[i][k]), 2) / (24.0 * pixels);
    }
    return -10 * std::log10(error);
  }

 private:
  std::vector<Camera<double>> camera_;
  std::vector<std::vector<float>> image_;
};

/// Test PSNR after a short training that starts from points in the scene and on a sphere of 60 radii.
template <class R>
double trained_sky_psnr(const SkyViews& views, std::int64_t iterations) {
  TrainSettings settings;
  settings.iterations = iterations;
  settings.voxel_size = 0.05;
  settings.init_factor = 4;
  settings.grow_interval = 50;
  settings.effects.space_radius = 4.4;
  std::vector<std::array<float, 3>> points = random_points(1000, 1.3, 1).position;
  for (int i = 0; i < 1000; ++i) {
    const double z = (i + 0.5) / 500 - 1, flat = std::sqrt(1 - z * z), angle = 2.399963229728653 * i, far = 60 * 4.4;
    points.push_back({static_cast<float>(far * flat * std::cos(angle)),
                      static_cast<float>(far * flat * std::sin(angle)), static_cast<float>(far * z)});
  }
  SerialExecutor executor;
  Trainer<R, SerialExecutor> trainer(settings, views.size(), 4.4, executor);
  REQUIRE(trainer.initialise(points).ok());
  REQUIRE(trainer.run(views).ok());
  return views.test_psnr(trainer.model());
}

}  // namespace

TEST_CASE("training/far_field: a sky sixty radii away is learned in contracted space, and lost in the world") {
  const SkyViews views;
  const std::int64_t iterations = short_trainings ? 12 : 1000;
  const double contracted = trained_sky_psnr<Contracted>(views, iterations),
               world = trained_sky_psnr<SmallRecipe>(views, iterations);
  MESSAGE("test PSNR: ", contracted, " contracted, ", world, " in the world");
  // Measured: 24.5 dB and 15.0 dB. Contracted cells with the scale volume of the world (a stretch of 1 in SpaceVolumeLoss): 15.4 dB.
  CHECK((short_trainings || contracted > world + 5));
}

TEST_CASE(
    "training/far_field: a contraction without a radius is refused, and its numbers are part of what is resumed") {
  SerialExecutor executor;
  Trainer<Contracted, SerialExecutor> trainer(short_run_of_radius(0), 6, 3.3, executor);
  const Result<Done> refused = trainer.initialise(cloud(20, 1));
  REQUIRE(!refused.ok());
  CHECK(refused.error().field == "space_radius");
  CHECK(settings_json(short_run_of_radius(1)) != settings_json(short_run_of_radius(2)));
  CHECK(!settings_json(short_run_of_radius(0)).contains("effects"));
}
