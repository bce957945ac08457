// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the tests of both rasterizers share: stacks of Gaussians on one pixel, one call for a picture or its gradient,
// the gradient law with the alpha and depth planes, and the table of blending gradients (docs/spec/numerics.md, BB1).
// Only for tests: it calls doctest.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/outputs.hpp"
#include "compmark/splat/raster/reference.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/raster_scene.hpp"

namespace compmark::testing {

inline constexpr Accuracy smooth{.exp_degree = 0, .transmittance_stop = 0, .cutoff = CutoffRule::smooth};
inline constexpr Accuracy nearly_opaque{
    .exp_degree = 0, .alpha_min = 1e-7f, .alpha_max = 0.9999f, .transmittance_stop = 0};

/// `count` identical isotropic Gaussians behind each other on the optical axis, which goes through the centre of pixel
/// (w/2, h/2).
template <class T>
RasterScene<T> stack(std::size_t count, T opacity, int width = 33, int height = 33) {
  RasterScene<T> scene = raster_scene<T>(1, count, width, height);
  scene.camera.fx = scene.camera.fy = 100;
  scene.camera.cx = T(width / 2) + T(0.5);
  scene.camera.cy = T(height / 2) + T(0.5);
  const GaussianColumns<T> g = scene.gaussians.columns();
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      g.mean[k][i] = k == 2 ? T(2) + T(i) / 1024 : T(0);
      g.scale[k][i] = T(0.1);
    }
    for (std::size_t k = 0; k < 4; ++k) g.rotation[k][i] = k == 0 ? T(1) : T(0);
    g.opacity[i] = opacity;
  }
  return scene;
}
/// The same seen through the centre pixel alone: there, alpha is the opacity.
template <class T>
RasterScene<T> one_pixel_stack(std::size_t count, T opacity) {
  RasterScene<T> scene = stack<T>(count, opacity);
  scene.camera = scene.camera.cropped(16, 16, 1, 1);
  return scene;
}

template <class R>
struct Rendered {
  std::vector<typename R::Scalar> image;
  GaussianBatch<typename R::Scalar> gradient;
  typename R::Context context;
};
template <class R>
std::vector<typename R::Scalar> image_of(const R& rasterizer, const RasterScene<typename R::Scalar>& scene,
                                         typename R::Context& context) {
  using T = typename R::Scalar;
  SerialExecutor serial;
  const int w = scene.camera.width, h = scene.camera.height;
  std::vector<T> image(static_cast<std::size_t>(3 * w * h), T(-7));
  rasterizer.forward(scene.gaussians.columns(), scene.camera, scene.background, {image.data(), 3, h, w}, context,
                     serial);
  return image;
}
template <class R>
std::vector<typename R::Scalar> image_of(const R& rasterizer, const RasterScene<typename R::Scalar>& scene) {
  typename R::Context context;
  return image_of(rasterizer, scene, context);
}
/// Forward, then backward with `d_image`, or ones.
template <class R>
Rendered<R> render(const R& rasterizer, const RasterScene<typename R::Scalar>& scene,
                   std::span<const typename R::Scalar> d_image = {}) {
  using T = typename R::Scalar;
  SerialExecutor serial;
  Rendered<R> result;
  result.image = image_of(rasterizer, scene, result.context);
  const GaussianColumns<const T> gaussians = scene.gaussians.columns();
  result.gradient.resize(gaussians.count);
  result.gradient.set_zero();
  const std::vector<T> ones(result.image.size(), T(1));
  rasterizer.backward(gaussians, scene.camera, scene.background,
                      {d_image.empty() ? ones.data() : d_image.data(), 3, scene.camera.height, scene.camera.width},
                      result.gradient.columns(), result.context, serial);
  return result;
}
template <class R>
GaussianBatch<typename R::Scalar> gradient_of(const R& rasterizer, const RasterScene<typename R::Scalar>& scene) {
  return render(rasterizer, scene).gradient;
}

/// Laws R2 and BF4: every column and one direction through all of them against central differences, alpha and depth
/// planes included.
template <class R>
void check_gradient_law() {
  constexpr int width = 26, height = 19;
  constexpr std::size_t n = 14, pixels = width * height;
  RasterScene<double> scene = raster_scene<double>(7, n, width, height);
  std::vector<double> image(3 * pixels), d_image(3 * pixels), d_alpha(pixels), d_depth(pixels);
  const Random random(5, 0, random_stage("test/gradient_law"));
  for (std::size_t i = 0; i < 3 * pixels; ++i) d_image[i] = static_cast<double>(random.centered(i));
  for (std::size_t i = 0; i < pixels; ++i) {
    d_alpha[i] = static_cast<double>(random.centered(10000 + i));
    d_depth[i] = static_cast<double>(random.centered(20000 + i));
  }
  const R rasterizer;
  typename R::Context context;
  SerialExecutor serial;
  const GaussianColumns<const double> gaussians = std::as_const(scene.gaussians).columns();
  const auto loss = [&] {
    rasterizer.forward(gaussians, scene.camera, scene.background, {image.data(), 3, height, width}, context, serial);
    double sum = 0;
    for (std::size_t i = 0; i < 3 * pixels; ++i) sum += d_image[i] * image[i];
    for (std::size_t i = 0; i < pixels; ++i) sum += d_alpha[i] * context.alpha[i] + d_depth[i] * context.depth[i];
    return sum;
  };
  loss();
  GaussianBatch<double> gradient;
  gradient.resize(n);
  gradient.set_zero();
  const PlaneGradients<double> d_planes{{d_alpha.data(), 1, height, width}, {d_depth.data(), 1, height, width}};
  rasterizer.backward(gaussians, scene.camera, scene.background, {d_image.data(), 3, height, width}, d_planes,
                      gradient.columns(), context, serial);
  std::vector<std::span<double>> variables;
  std::vector<std::span<const double>> gradients;
  for (std::size_t c = 0; c < 14; ++c) {
    variables.emplace_back(all_columns(scene.gaussians.columns())[c], n);
    gradients.emplace_back(all_columns(gradient.columns())[c], n);
    const std::string broken = gradient_law(loss, variables[c], gradients[c], 1e-6, n);
    CHECK_MESSAGE(broken.empty(), "column " << c << ": " << broken);
  }
  CHECK(directional_error(loss, variables, gradients, 1e-5) <= 1e-8);
  gradient.columns().scale[1][3] *= 1.01;  // negative control
  CHECK(directional_error(loss, variables, gradients, 1e-5) > 1e-8);
}

/// A kind of pixel: how many layers, and how opaque layer i is; u is random in (0, 1).
struct BlendPattern {
  const char* name;
  std::size_t layers;
  double (*alpha)(std::size_t i, double u);
};
inline constexpr std::array<BlendPattern, 7> blend_patterns{{
    {"six opaque layers", 6, [](std::size_t, double) { return 0.999; }},
    {"an opaque stack", 60, [](std::size_t, double) { return 0.9; }},
    {"a translucent stack", 60, [](std::size_t, double) { return 0.3; }},
    {"layers of every opacity", 300, [](std::size_t, double u) { return 0.004 + 0.995 * u; }},
    {"a wall inside fog", 600, [](std::size_t i, double) { return i == 300 ? 0.999 : 0.01; }},
    {"fog", 2300, [](std::size_t, double) { return 0.01; }},
    {"fog at the cut-off", 2300, [](std::size_t, double) { return 1.0 / 255.0; }},
}};

/// Layers of the pattern with random colours before a random background: the gradient of the first layer's to the last
/// layer's alpha.
inline RasterScene<float> blend_scene(const BlendPattern& pattern, std::uint64_t seed) {
  RasterScene<float> scene = one_pixel_stack<float>(pattern.layers, 0.5f);
  const Random random(seed, 0, random_stage("test/blend"));
  for (std::size_t i = 0; i < pattern.layers; ++i) {
    scene.gaussians.columns().opacity[i] = static_cast<float>(pattern.alpha(i, random.uniform(4 * i + 3)));
    for (std::size_t c = 0; c < 3; ++c) {
      scene.gaussians.columns().color[c][i] = static_cast<float>(random.uniform(4 * i + c));
    }
  }
  for (std::size_t c = 0; c < 3; ++c) scene.background[c] = static_cast<float>(random.uniform(100000 + c));
  return scene;
}

/// What BB1 replaces, in float, for d_image of ones: colour in front, transmittance and a separate background term,
/// divided by 1 - alpha.
inline std::vector<float> classic_alpha_gradient(const RasterScene<float>& scene) {
  const GaussianColumns<const float> g = scene.gaussians.columns();
  const auto color = [&](std::size_t i) { return g.color[0][i] + g.color[1][i] + g.color[2][i]; };
  float all = 0, transmittance = 1;
  for (std::size_t i = 0; i < g.count; ++i, transmittance *= 1 - g.opacity[i - 1]) {
    all += transmittance * g.opacity[i] * color(i);
  }
  const float background = scene.background[0] + scene.background[1] + scene.background[2];
  const float last = transmittance;
  std::vector<float> d_alpha(g.count);
  float front = 0;
  transmittance = 1;
  for (std::size_t i = 0; i < g.count; ++i) {
    front += transmittance * g.opacity[i] * color(i);
    d_alpha[i] = transmittance * color(i) - (all - front) / (1 - g.opacity[i]) - last * background / (1 - g.opacity[i]);
    transmittance *= 1 - g.opacity[i];
  }
  return d_alpha;
}

/// Errors of a tensor gathered over many pixels.
struct BlendError {
  double worst = 0, size = 0, squares = 0, all_squares = 0;

  template <class Gradient>
  void add(const Gradient& got, const long double* truth, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      const double exact = static_cast<double>(truth[i]), error = static_cast<double>(got[i]) - exact;
      worst = std::max(worst, std::abs(error));
      size = std::max(size, std::abs(exact));
      squares += error * error;
      all_squares += exact * exact;
    }
  }
  [[nodiscard]] double largest() const { return worst / size; }
  [[nodiscard]] double relative() const { return std::sqrt(squares / all_squares); }
};

/// The table of BB1: seven patterns, 300 pixels each, against long double. Bounds: twice what was measured first
/// (1.2e-6 of the largest gradient, relative L2 6e-7).
template <class R>
void check_blend_table() {
  for (const BlendPattern& pattern : blend_patterns) {
    BlendError error, classic;
    for (std::uint64_t seed = 0; seed < 300; ++seed) {
      const RasterScene<float> scene = blend_scene(pattern, seed);
      const auto truth = gradient_of(ReferenceRasterizer<long double, nearly_opaque>{}, cast_scene<long double>(scene));
      const auto got = gradient_of(R{}, scene);
      error.add(got.columns().opacity, truth.columns().opacity, pattern.layers);
      classic.add(classic_alpha_gradient(scene), truth.columns().opacity, pattern.layers);
    }
    INFO(std::string(pattern.name), ": largest ", error.largest(), ", relative L2 ", error.relative(), "; classic ",
         classic.largest(), ", ", classic.relative());
    CHECK(error.largest() <= 2.4e-6);
    CHECK(error.relative() <= 1.2e-6);
    CHECK(classic.relative() > 3 * error.relative());  // negative control
  }
}

/// Where every colour is the background's, nothing but the colour has a gradient: not even rounding. The classic scheme
/// gives noise.
template <class R>
void check_flat_color() {
  using T = typename R::Scalar;
  for (const std::uint64_t seed : {3u, 12u}) {
    RasterScene<T> scene = raster_scene<T>(seed, 400, 70, 50);
    scene.background = {T(0.3), T(0.7), T(0.1)};
    for (std::size_t c = 0; c < 3; ++c) std::fill_n(scene.gaussians.columns().color[c], 400, scene.background[c]);
    const auto gradient = gradient_of(R{}, scene);
    const auto columns = all_columns(gradient.columns());
    for (std::size_t c = 0; c < 11; ++c) {
      for (std::size_t i = 0; i < 400; ++i) CHECK(columns[c][i] == T(0));
    }
    CHECK(*std::max_element(columns[11], columns[11] + 400) > T(0));
  }
  RasterScene<float> flat = blend_scene(blend_patterns[3], 1);
  for (std::size_t c = 0; c < 3; ++c) std::fill_n(flat.gaussians.columns().color[c], 300, flat.background[c]);
  const std::vector<float> classic = classic_alpha_gradient(flat);
  CHECK(*std::max_element(classic.begin(), classic.end()) > 1e-8f);  // negative control
}

}  // namespace compmark::testing
