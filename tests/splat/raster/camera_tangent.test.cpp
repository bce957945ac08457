// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/raster/camera_tangent.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/raster/reference.hpp"
#include "compmark/testing/raster_scene.hpp"

using namespace compmark;
using testing::raster_scene;
using testing::RasterScene;

namespace {

constexpr Accuracy smooth{.exp_degree = 0, .cutoff = CutoffRule::smooth};

template <class T>
struct TangentImages {
  std::vector<T> image, tangents;
  ImageView<T> view, planes;
  explicit TangentImages(const Camera<T>& camera)
      : image(3 * static_cast<std::size_t>(camera.width * camera.height)),
        tangents(9 * image.size()) {
    view = {image.data(), 3, camera.height, camera.width};
    planes = {tangents.data(), 27, camera.height, camera.width};
  }
};

template <class T, Accuracy accuracy, class Filter, class E>
TangentImages<T> with_tangents(const RasterScene<T>& scene, E& executor) {
  TangentImages<T> result(scene.camera);
  typename CameraTangent<T, accuracy, Filter>::Context context;
  const CameraTangent<T, accuracy, Filter> tangent(T(0.2), T(0.3));
  const Result<Done> done = tangent.render(scene.gaussians.columns(), scene.camera, scene.background, result.view,
                                           result.planes, context, executor);
  REQUIRE(done);
  return result;
}

/// The reference's image from the camera of the scene after a step.
template <class Filter>
std::vector<double> reference_image(const RasterScene<double>& scene, const CameraStep& step) {
  using R = ReferenceRasterizer<double, smooth, RasterEffects<PinholeLens, Filter>>;
  const Camera<double> camera = moved(scene.camera, step);
  std::vector<double> image(3 * static_cast<std::size_t>(camera.width * camera.height));
  typename R::Context context;
  SerialExecutor serial;
  R(typename R::Settings{0.2, 0.3, {}})
      .forward(scene.gaussians.columns(), camera, scene.background,
               ImageView<double>{image.data(), 3, camera.height, camera.width}, context, serial);
  return image;
}

/// Largest difference between the tangents and central differences of the reference, over the largest difference
/// quotient of each number, where the tangents of number p are taken for those of number permuted(p).
template <class Filter, class Permute>
double law_error(const RasterScene<double>& scene, const Permute& permuted) {
  SerialExecutor serial;
  const TangentImages<double> found = with_tangents<double, smooth, Filter>(scene, serial);
  double worst = 0;
  for (std::size_t p = 0; p < camera_parameters; ++p) {
    const double h = p < 7 ? 1e-6 : 1e-5;
    CameraStep step{};
    step[p] = h;
    const std::vector<double> above = reference_image<Filter>(scene, step);
    step[p] = -h;
    const std::vector<double> below = reference_image<Filter>(scene, step);
    double size = 0, error = 0;
    for (std::size_t i = 0; i < above.size(); ++i) {
      const double expected = (above[i] - below[i]) / (2 * h);
      size = std::max(size, std::abs(expected));
      error = std::max(error, std::abs(found.tangents[permuted(p) * above.size() + i] - expected));
    }
    CHECK(size > 1e-3);
    worst = std::max(worst, error / size);
  }
  return worst;
}

}  // namespace

TEST_CASE("camera tangents are the derivatives of the reference rasterizer by every number of the camera") {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    RasterScene<double> scene = raster_scene<double>(seed, 150, 37, 29);
    // Some that are clamped at full opacity, and some whose mean is beyond the limits of the Jacobian.
    const GaussianColumns<double> g = scene.gaussians.columns();
    for (std::size_t i = 0; i < 12; ++i) g.opacity[i] = 1;
    for (std::size_t i = 12; i < 20; ++i) {
      g.mean[0][i] *= 3;
      for (std::size_t k = 0; k < 3; ++k) g.scale[k][i] *= 8;
    }
    const auto same = [](std::size_t p) { return p; };
    CHECK(law_error<NoFilter>(scene, same) < 2e-5);
    CHECK(law_error<MipFilter>(scene, same) < 2e-5);
    // Negative controls: the numbers of another, and a filter that the derivative does not know.
    CHECK(law_error<NoFilter>(scene, [](std::size_t p) { return p == 3 ? std::size_t{4} : p; }) > 0.1);
    CHECK(law_error<NoFilter>(scene, [](std::size_t p) { return p == 6 ? std::size_t{5} : p; }) > 0.1);
  }
}

TEST_CASE("camera tangents leave the image as the tile rasterizer draws it, at any number of threads") {
  const RasterScene<float> scene = raster_scene<float>(7, 3000, 150, 90);
  SerialExecutor serial;
  ThreadExecutor threads(3);
  const auto one = with_tangents<float, accuracy::standard, NoFilter>(scene, serial);
  const auto many = with_tangents<float, accuracy::standard, NoFilter>(scene, threads);
  CHECK(one.image == many.image);
  CHECK(one.tangents == many.tangents);
  std::vector<float> image(one.image.size());
  TileRasterizer<float>::Context context;
  TileRasterizer<float>().forward(scene.gaussians.columns(), scene.camera, scene.background,
                                  ImageView<float>{image.data(), 3, 90, 150}, context, serial);
  CHECK(image == one.image);
  // Polynomial of degree 5 in float against double and the exponential of the library.
  const auto exact =
      with_tangents<double, Accuracy{.exp_degree = 0}, NoFilter>(testing::cast_scene<double>(scene), serial);
  for (std::size_t p = 0; p < camera_parameters; ++p) {
    double square = 0, error = 0;
    for (std::size_t i = p * image.size(); i < (p + 1) * image.size(); ++i) {
      square += exact.tangents[i] * exact.tangents[i];
      error += std::pow(exact.tangents[i] - static_cast<double>(one.tangents[i]), 2);
    }
    CHECK(error < 1e-6 * square);
  }
}

TEST_CASE("camera tangents are zero where one clamped splat covers the pixel") {
  RasterScene<double> scene = raster_scene<double>(1, 1, 16, 16);
  const GaussianColumns<double> g = scene.gaussians.columns();
  g.mean[0][0] = g.mean[1][0] = 0;
  g.mean[2][0] = 3;
  for (std::size_t k = 0; k < 3; ++k) g.scale[k][0] = 2;
  g.opacity[0] = 1;
  SerialExecutor serial;
  const auto clamped = with_tangents<double, smooth, NoFilter>(scene, serial);
  const std::size_t middle = 8 * 16 + 8, pixels = 256;
  for (std::size_t k = 0; k < 27; ++k) CHECK(clamped.tangents[k * pixels + middle] == 0);
  g.opacity[0] = 0.9;  // and below the clamp they are not
  const auto open = with_tangents<double, smooth, NoFilter>(scene, serial);
  double largest = 0;
  for (std::size_t k = 0; k < 27; ++k) largest = std::max(largest, std::abs(open.tangents[k * pixels + middle]));
  CHECK(largest > 0);
}
