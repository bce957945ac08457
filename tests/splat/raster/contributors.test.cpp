// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Case BF6: forward and backward must blend the very same splats at every pixel, whatever the compiler's flags made of
// the two loops. Seen from outside: with splat i alone white on black, the picture is its weight at every pixel; with
// one pixel alone in the gradient of the picture, the gradient of the colours is the weight of every splat there.
// tests/CMakeLists.txt builds this file with several sets of flags.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/splat/raster/tile.hpp"
#include "compmark/testing/raster_scene.hpp"

namespace {

using namespace compmark;
using testing::RasterScene;

constexpr int image_width = 20, image_height = 18;  // neither a multiple of the tile nor of a pack
constexpr std::size_t pixel_count = image_width * image_height, splat_count = 42;

/// FNV-1a over the (pixel, splat) pairs of positive weight, pixels first.
std::uint64_t hash_of(const std::vector<float>& weights) {
  std::uint64_t hash = 14695981039346656037u;
  for (std::size_t at = 0; at < weights.size(); ++at) {
    if (weights[at] == 0) continue;
    for (int byte = 0; byte < 8; ++byte) hash = (hash ^ (at >> (8 * byte) & 255)) * 1099511628211u;
  }
  return hash;
}

/// Weights [pixel, splat] as forward blends them: three splats a render, one a channel.
template <class R>
std::vector<float> forward_weights(RasterScene<float> scene) {
  const R rasterizer;
  typename R::Context context;
  SerialExecutor serial;
  scene.background = {};
  std::vector<float> weights(pixel_count * splat_count), image(3 * pixel_count);
  const GaussianColumns<float> g = scene.gaussians.columns();
  for (std::size_t first = 0; first < splat_count; first += 3) {
    for (std::size_t c = 0; c < 3; ++c) {
      std::fill_n(g.color[c], splat_count, 0.0f);
      g.color[c][first + c] = 1;
    }
    rasterizer.forward(g, scene.camera, scene.background, {image.data(), 3, image_height, image_width}, context,
                       serial);
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t p = 0; p < pixel_count; ++p) weights[p * splat_count + first + c] = image[c * pixel_count + p];
    }
  }
  return weights;
}

/// The same as backward sees them: three pixels a pass, one a channel.
template <class R>
std::vector<float> backward_weights(const RasterScene<float>& scene) {
  const R rasterizer;
  typename R::Context context;
  SerialExecutor serial;
  std::vector<float> weights(pixel_count * splat_count), image(3 * pixel_count), d_image(3 * pixel_count);
  GaussianBatch<float> gradient;
  gradient.resize(splat_count);
  const GaussianColumns<const float> g = scene.gaussians.columns();
  rasterizer.forward(g, scene.camera, scene.background, {image.data(), 3, image_height, image_width}, context, serial);
  for (std::size_t first = 0; first < pixel_count; first += 3) {
    std::fill(d_image.begin(), d_image.end(), 0.0f);
    for (std::size_t c = 0; c < 3; ++c) d_image[c * pixel_count + first + c] = 1;
    gradient.set_zero();
    rasterizer.backward(g, scene.camera, scene.background, {d_image.data(), 3, image_height, image_width},
                        gradient.columns(), context, serial);
    for (std::size_t c = 0; c < 3; ++c)
      std::copy_n(gradient.columns().color[c], splat_count, &weights[(first + c) * splat_count]);
  }
  return weights;
}

/// Large splats, so that edges cross many pixels; in every fifth scene opaque ones, so that pixels stop too.
RasterScene<float> scene_of(std::uint64_t seed) {
  RasterScene<float> scene = testing::raster_scene<float>(seed, splat_count, image_width, image_height);
  for (float* const column : scene.gaussians.columns().scale)
    std::for_each_n(column, splat_count, [](float& x) { x *= 4; });
  if (seed % 5 == 0) std::fill_n(scene.gaussians.columns().opacity, splat_count, 0.99f);
  return scene;
}

}  // namespace

TEST_CASE_TEMPLATE("raster/contributors: forward and backward blend the same splats at every pixel of 100 scenes (BF6)",
                   R, TileRasterizer<float>, TileRasterizer<float, accuracy::inria>,
                   TileRasterizer<float, accuracy::draft>) {
  float worst = 0;
  std::size_t pairs = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const RasterScene<float> scene = scene_of(seed);
    const std::vector<float> forward = forward_weights<R>(scene), backward = backward_weights<R>(scene);
    CHECK(hash_of(forward) == hash_of(backward));
    for (std::size_t i = 0; i < forward.size(); ++i) {
      worst = std::max(worst, std::abs(forward[i] - backward[i]));
      pairs += forward[i] != 0 ? 1u : 0u;
    }
  }
  INFO(pairs, " pairs; largest difference of a weight ", worst);
  CHECK(pairs > 100000);
  CHECK(worst <= 1e-6f);
}

TEST_CASE("raster/contributors: negative control, a cut-off one part in a hundred away is another list") {
  constexpr Accuracy moved{.alpha_min = 1.01f / 255.0f};
  std::size_t differ = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const RasterScene<float> scene = scene_of(seed);
    const std::vector<float> forward = forward_weights<TileRasterizer<float>>(scene),
                             backward = backward_weights<TileRasterizer<float, moved>>(scene);
    differ += hash_of(forward) != hash_of(backward) ? 1u : 0u;
  }
  CHECK(differ > 0);
}
