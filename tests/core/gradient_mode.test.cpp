// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The law of a stage that may set: what it leaves on poisoned memory is what it adds to zeros. Photometric loss and
// projection have it in their own tests; here are whole rasterizers, with planes, effects and Gaussians that no pixel
// sees.
#include "compmark/core/gradient_mode.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/core/random.hpp>
#include <compmark/scene/lens_camera.hpp>
#include <compmark/splat/raster/concept.hpp>
#include <compmark/splat/raster/effects.hpp>
#include <compmark/splat/raster/reference.hpp>
#include <compmark/splat/raster/tile.hpp>
#include <compmark/testing/raster_scene.hpp>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

using namespace compmark;

namespace {

constexpr RasterOutputs with_alpha{.alpha = true, .screen_statistics = true};
using Plain = TileRasterizer<float>;
using Alpha = TileRasterizer<float, accuracy::standard, with_alpha>;
using Phone = EffectTileRasterizer<float, RasterEffects<RadialTangentialLens<float>, MipFilter>>;

constexpr int width = 83, height = 59;
constexpr std::size_t rows = 517;  // no multiple of a pack

template <class R, GradientMode mode>
std::vector<float> gradient(float before, GaussianBatch<float>& gradients) {
  testing::RasterScene<float> scene = testing::raster_scene<float>(9, rows, width, height);
  for (std::size_t i = 0; i < rows; i += 7) scene.gaussians.columns().mean[2][i] = -1;  // behind the camera
  for (std::size_t i = 64; i < 96; ++i) scene.gaussians.columns().mean[0][i] = 1000;    // whole packs beside the image
  const GaussianColumns<const float> gaussians = std::as_const(scene.gaussians).columns();
  SerialExecutor executor;
  typename R::Context context;
  std::vector<float> image(3 * width * height), d_image(image.size()), d_alpha(image.size() / 3);
  const Random random(3, 0, random_stage("test d_image"));
  for (std::size_t i = 0; i < d_image.size(); ++i) d_image[i] = static_cast<float>(random.centered(i));
  for (std::size_t i = 0; i < d_alpha.size(); ++i) d_alpha[i] = static_cast<float>(random.centered(i + d_image.size()));
  typename R::Settings settings;
  if constexpr (std::is_same_v<R, Phone>)
    settings.lens = *lens_policy<RadialTangentialLens<float>>({LensModel::opencv, {-0.2, 0.03, 0.002, -0.001}});
  const R rasterizer{settings};
  static_cast<void>(rasterizer.forward(gaussians, scene.camera, scene.background, {image.data(), 3, height, width},
                                       context, executor));
  gradients.resize(rows);
  std::fill(gradients.storage().begin(), gradients.storage().end(), before);
  const ImageView<const float> d{d_image.data(), 3, height, width};
  if constexpr (std::is_same_v<R, Alpha>) {
    PlaneGradients<float> planes;
    planes.alpha = {d_alpha.data(), 1, height, width};
    rasterizer.template backward<mode>(gaussians, scene.camera, scene.background, d, planes, gradients.columns(),
                                       context, executor);
  } else {
    rasterizer.template backward<mode>(gaussians, scene.camera, scene.background, d, gradients.columns(), context,
                                       executor);
  }
  std::vector<float> values;
  const GaussianColumns<float> columns = gradients.columns();
  const auto take = [&](const auto& group) {
    for (const float* column : group) values.insert(values.end(), column, column + rows);
  };
  take(columns.mean);
  take(columns.scale);
  take(columns.rotation);
  take(columns.color);
  values.insert(values.end(), columns.opacity, columns.opacity + rows);
  return values;
}

}  // namespace

TEST_CASE_TEMPLATE("core/gradient_mode: set leaves on poison what add leaves on zeros, and add keeps what was there", R,
                   Plain, Alpha, Phone) {
  GaussianBatch<float> gradients;
  const std::vector<float> added = gradient<R, GradientMode::add>(0.0f, gradients);
  const std::vector<float> set = gradient<R, GradientMode::set>(std::numeric_limits<float>::quiet_NaN(), gradients);
  const std::vector<float> twice = gradient<R, GradientMode::add>(16.0f, gradients);
  REQUIRE(added.size() == 14 * rows);
  float largest = 0, difference = 0, moved = 0;
  std::size_t zeros = 0;
  for (std::size_t i = 0; i < added.size(); ++i) {
    REQUIRE(std::isfinite(set[i]));  // every element was written, those of Gaussians that no pixel sees too
    largest = std::max(largest, std::abs(added[i]));
    difference = std::max(difference, std::abs(set[i] - added[i]));
    moved = std::max(moved, std::abs(twice[i] - 16 - added[i]) / (16 + std::abs(added[i])));
    zeros += added[i] == 0 ? 1 : 0;
    if (added[i] == 0) CHECK(set[i] == 0);
  }
  CHECK(largest > 0.1f);
  CHECK(zeros >= 14 * (rows / 7));
  // Two instantiations: a multiply-add may be fused in one and not in the other.
  CHECK(difference <= 1e-5f * largest);
  CHECK(moved < 1e-5f);
}

TEST_CASE("core/gradient_mode: who cannot set says so, and a pipeline clears for it") {
  static_assert(GradientSettingRasterizer<Plain> && GradientSettingRasterizer<Phone>);
  static_assert(Rasterizer<ReferenceRasterizer<float>> && !GradientSettingRasterizer<ReferenceRasterizer<float>>);
}
