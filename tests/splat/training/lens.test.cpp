// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A lens through the whole pipeline: derivative, culling, training, file.
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/captures.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/scene/lens_camera.hpp>
#include <compmark/scene/procedural_write.hpp>
#include <compmark/scene/random_points.hpp>
#include <compmark/splat/export/bake.hpp>
#include <compmark/splat/raster/effects.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <type_traits>
#include <vector>

#include "support/directional.hpp"
#include "support/short_training.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::ring_camera;
using compmark::testing::short_trainings;
using compmark::testing::smooth_accuracy;
using compmark::testing::SmoothRecipe;

const Lens phone_lens{LensModel::opencv, {-0.25, 0.08, 0.004, -0.003}};
const Lens wide_lens{LensModel::opencv_fisheye, {-0.03, 0.004, -0.001, 0.0002}};

template <class Lens>
struct Through : SmoothRecipe {
  using Rasterizer = EffectTileRasterizer<double, RasterEffects<Lens>, smooth_accuracy>;
  using DensityControl = NoGrowth;
};
using ThroughPhone = Through<RadialTangentialLens<double>>;
using ThroughWide = Through<FisheyeLens<double>>;

template <class R>
const Lens& lens_of() {
  return std::is_same_v<RecipeLens<R>, FisheyeLens<typename R::Scalar>> ? wide_lens : phone_lens;
}

}  // namespace

TEST_CASE_TEMPLATE("training/lens: the directional derivative of the whole pass through a lens equals differences", R,
                   ThroughPhone, ThroughWide) {
  constexpr int width = 37, height = 29;
  Model<R> model = compmark::testing::random_model<R>(24);
  const ViewCamera<R> camera(ring_camera(1, 5, width, height), *lens_policy<RecipeLens<R>>(lens_of<R>()));
  const Random random(5, 0, random_stage("test target"));
  std::vector<double> target(3 * width * height);
  for (std::size_t i = 0; i < target.size(); ++i) target[i] = 1.5 + random.uniform(i);
  using Context = typename Pipeline<R>::Context;
  SerialExecutor executor;
  const Pipeline<R> pipeline;
  compmark::testing::check_directional_derivative(
      model,
      [&](Context& context) {
        static_cast<void>(pipeline.forward(model, camera, 1, context, executor));
        return pipeline.loss(ImageView<const double>{target.data(), 3, height, width}, {0.2, 0.01}, context, executor)
            .total;
      },
      [&](Context& context) { pipeline.backward(model, camera, 1, context, executor); });
  // The lens is in the picture at all: without it the image is another one. A camera alone is that of a viewer without lenses.
  Context with, without;
  static_cast<void>(pipeline.forward(model, camera, 1, with, executor));
  static_cast<void>(pipeline.forward(model, ring_camera(1, 5, width, height), 1, without, executor));
  double difference = 0;
  for (std::size_t i = 0; i < with.image.size(); ++i)
    difference = std::max(difference, std::abs(with.image.data[i] - without.image.data[i]));
  CHECK(difference > 1e-3);  // measured: 0.034, and 0.0048 between two fisheyes
}

TEST_CASE("training/lens: without a lens the camera is Camera<double>, and the bake is seen through the lens") {
  static_assert(std::is_same_v<ViewCamera<recipes::Scaffold>, Camera<double>>);
  static_assert(std::is_same_v<ViewCamera<recipes::ScaffoldAntiAliased>, Camera<double>>);
  static_assert(std::is_same_v<ViewCamera<recipes::ScaffoldLens>, LensCamera<RadialTangentialLens<float>>>);
  Model<ThroughPhone> model = compmark::testing::random_model<ThroughPhone>(24);
  const ViewCamera<ThroughPhone> camera(ring_camera(1, 5, 37, 29),
                                        *lens_policy<RadialTangentialLens<double>>(phone_lens));
  SerialExecutor executor;
  Pipeline<ThroughPhone>::Context context;
  static_cast<void>(Pipeline<ThroughPhone>{}.forward(model, camera, 1, context, executor));
  const SplatTable table = bake_at_camera(model, camera, 1, executor);
  SplatRenderer<ThroughPhone> renderer(model.render);
  const ImageView<const double> baked = renderer.render(table, camera, executor);
  double difference = 0;
  for (std::size_t i = 0; i < baked.size(); ++i)
    difference = std::max(difference, std::abs(context.image.data[i] - baked.data[i]));
  CHECK(difference < 1e-5);  // the table is in single precision
}

namespace {

/// The built-in scene photographed through a lens, training and test views alike.
template <class R>
struct LensViews {
  static constexpr int side = 64;
  std::vector<ViewCamera<R>> cameras;
  std::vector<ImageBytes> images;

  LensViews(Split split, int count, bool lens_known) {
    ProceduralSettings settings;
    settings.width = settings.height = side;
    settings.views_train = 24;
    settings.views_test = 4;
    settings.camera_angle_x = 1.6;  // a wide lens, whose border the scene reaches: that is where it bends
    settings.camera_distance = 1.9;
    const ProceduralScene scene(settings.seed);
    ThreadExecutor executor(2);
    for (int i = 0; i < count; ++i) {
      // The axis beside the middle and every camera rolled otherwise: what the lens does is not the same to the scene in any two views.
      const Camera<double> upright = procedural_camera(settings, split, i);
      Camera<double> camera = upright;
      camera.cx = 0.25 * side;
      for (std::size_t k = 0; k < 3; ++k) {
        const double angle = 2.4 * i, c = std::cos(angle), s = std::sin(angle);
        camera.rotation_camera_world[k] =
            c * upright.rotation_camera_world[k] + s * upright.rotation_camera_world[3 + k];
        camera.rotation_camera_world[3 + k] =
            c * upright.rotation_camera_world[3 + k] - s * upright.rotation_camera_world[k];
      }
      images.push_back(render_procedural(scene, camera, executor, strong));
      if constexpr (std::is_same_v<ViewCamera<R>, Camera<double>>) {
        cameras.push_back(camera);
      } else {
        cameras.emplace_back(camera, lens_known ? *lens_policy<RecipeLens<R>>(strong) : RecipeLens<R>{});
      }
    }
  }
  inline static const Lens strong{LensModel::opencv, {-0.25, 0.05, 0.002, -0.001}};

  [[nodiscard]] std::size_t size() const { return cameras.size(); }
  [[nodiscard]] ViewCamera<R> camera(std::size_t i) const { return cameras[i]; }
  [[nodiscard]] Result<Done> load(std::size_t i, ImageView<float> image) const {
    const std::size_t pixels = side * side;
    for (std::size_t k = 0; k < pixels; ++k) {
      const float alpha = static_cast<float>(images[i].pixels[4 * k + 3]) / 255;
      for (std::size_t c = 0; c < 3; ++c)
        image.data[c * pixels + k] = alpha * static_cast<float>(images[i].pixels[4 * k + c]) / 255;
    }
    return Done{};
  }
};

using Ignoring = compmark::testing::UngrownRecipe;
struct Projecting : Ignoring {
  using Rasterizer = EffectTileRasterizer<float, RasterEffects<RadialTangentialLens<float>>>;
};

template <class R>
double trained_lens_psnr(bool lens_known) {
  const LensViews<R> views(Split::train, 24, lens_known), test(Split::test, 4, lens_known);
  TrainSettings settings;
  settings.iterations = short_trainings ? 12 : 400;
  settings.voxel_size = 0.05;
  ThreadExecutor executor(2);
  Trainer<R, ThreadExecutor> trainer(settings, views.size(), 4.4, executor);
  REQUIRE(trainer.initialise(random_points(3000, 1.3, 1).position).ok());
  REQUIRE(trainer.run(views).ok());
  typename Pipeline<R>::Context context;
  std::vector<float> target(3 * 64 * 64);
  double error = 0;
  for (std::size_t i = 0; i < test.size(); ++i) {
    REQUIRE(test.load(i, {target.data(), 3, 64, 64}).ok());
    static_cast<void>(Pipeline<R>{}.forward(trainer.model(), test.camera(i), unseen_view, context, executor));
    for (std::size_t k = 0; k < target.size(); ++k) {
      const double d = static_cast<double>(context.image.data[k] - target[k]);
      error += d * d / static_cast<double>(target.size() * test.size());
    }
  }
  return -10 * std::log10(error);
}

}  // namespace

TEST_CASE("training/lens: photographs through a lens train better with it than with the lens ignored") {
  const double ignored = trained_lens_psnr<Ignoring>(false), projected = trained_lens_psnr<Projecting>(true),
               ideal = trained_lens_psnr<Projecting>(false);
  MESSAGE("PSNR of test photographs through the lens: ignored ", ignored, " dB, projected ", projected,
          " dB, projected with zero coefficients ", ideal);
  if (short_trainings) return;
  CHECK(projected > ignored + 0.5);
  CHECK(std::abs(ideal - ignored) < 0.3);  // zero coefficients are the pinhole, to rounding
}
