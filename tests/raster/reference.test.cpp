// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/raster/reference.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/testing/gradient.hpp"
#include "compmark/testing/raster_laws.hpp"
#include "compmark/testing/raster_scene.hpp"

using namespace compmark;
using testing::raster_scene;
using testing::RasterScene;

static_assert(Rasterizer<ReferenceRasterizer<float>>);
static_assert(Rasterizer<ReferenceRasterizer<long double, accuracy::inria>>);

namespace {

constexpr Accuracy smooth{.exp_degree = 0, .transmittance_stop = 0, .cutoff = CutoffRule::smooth};
constexpr Accuracy published_backward{.exp_degree = 0, .published_backward = true};
constexpr Accuracy nearly_opaque{.exp_degree = 0, .alpha_min = 1e-7f, .alpha_max = 0.9999f, .transmittance_stop = 0};

template <class T>
struct Rendered {
  std::vector<T> image;
  std::vector<T> alpha, depth;
  GaussianBatch<T> gradient;
};

/// Forward and, with d_image of ones (or the given one), backward.
template <class T, Accuracy accuracy>
Rendered<T> render(const ReferenceRasterizer<T, accuracy>& rasterizer, const RasterScene<T>& scene,
                   const std::vector<T>& d_image = {}) {
  SerialExecutor serial;
  Rendered<T> result;
  typename ReferenceRasterizer<T, accuracy>::Context context;
  const int w = scene.camera.width, h = scene.camera.height;
  result.image.resize(static_cast<std::size_t>(3 * w * h));
  const GaussianColumns<const T> gaussians = scene.gaussians.columns();
  rasterizer.forward(gaussians, scene.camera, scene.background, {result.image.data(), 3, h, w}, context, serial);
  result.alpha.assign(context.alpha.begin(), context.alpha.end());
  result.depth.assign(context.depth.begin(), context.depth.end());
  result.gradient.resize(scene.gaussians.size());
  result.gradient.set_zero();
  const std::vector<T> ones(result.image.size(), T(1));
  const std::vector<T>& d = d_image.empty() ? ones : d_image;
  rasterizer.backward(gaussians, scene.camera, scene.background, {d.data(), 3, h, w}, result.gradient.columns(),
                      context, serial);
  return result;
}

/// `count` identical isotropic Gaussians behind each other on the optical axis, which goes through the centre of pixel (w/2, h/2).
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

template <class T>
T at(const RasterScene<T>& scene, const std::vector<T>& image, int c, int y, int x) {
  return image[static_cast<std::size_t>((c * scene.camera.height + y) * scene.camera.width + x)];
}

}  // namespace

TEST_CASE("raster/reference: one Gaussian on a pixel centre (method sheet 8)") {
  for (const auto& [opacity, factor] : {std::pair{0.5, 0.5}, std::pair{1.0, 0.99}, std::pair{0.0039, 0.0}}) {
    RasterScene<double> scene = stack<double>(1, opacity);
    scene.background = {};
    const auto inria = render(ReferenceRasterizer<double, accuracy::inria>{}, scene),
               spec = render(ReferenceRasterizer<double>{}, scene);
    for (int c = 0; c < 3; ++c) {
      const double color = scene.gaussians.columns().color[static_cast<std::size_t>(c)][0];
      CHECK(at(scene, spec.image, c, 16, 16) ==
            doctest::Approx(factor * color).epsilon(1e-7));  // 0.99 is a float in the policy
      CHECK(at(scene, inria.image, c, 16, 16) == doctest::Approx(factor * color).epsilon(1e-7));
    }
    CHECK(spec.alpha[16 * 33 + 16] == doctest::Approx(factor).epsilon(1e-7));
    CHECK(spec.depth[16 * 33 + 16] == doctest::Approx(factor * 2).epsilon(1e-7));
  }
}

TEST_CASE(
    "raster/reference: pixel centres are at one half: an even image is symmetric, an odd one peaks in the middle "
    "(PR6)") {
  RasterScene<float> even = stack<float>(1, 0.7f, 32, 32);
  even.camera.cx = even.camera.cy = 16;
  even.background = {};
  const auto a = render(ReferenceRasterizer<float>{}, even).image;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 16; ++x) {
      CHECK(at(even, a, 0, y, x) == doctest::Approx(at(even, a, 0, y, 31 - x)).epsilon(2.4e-7));
      CHECK(at(even, a, 0, x, y) == doctest::Approx(at(even, a, 0, 31 - x, y)).epsilon(2.4e-7));
    }
  }
  const RasterScene<float> odd = stack<float>(1, 0.7f, 33, 33);
  const auto b = render(ReferenceRasterizer<float>{}, odd).alpha;
  CHECK(std::max_element(b.begin(), b.end()) - b.begin() == 16 * 33 + 16);
}

TEST_CASE("raster/reference: closed form of one pixel off the centre, blur included") {
  const RasterScene<double> scene = stack<double>(1, 0.7);
  const auto got = render(ReferenceRasterizer<double>{}, scene);
  const double variance = (100 * 0.1 / 2) * (100 * 0.1 / 2) + 0.3;
  CHECK(got.alpha[16 * 33 + 19] == doctest::Approx(0.7 * std::exp(-9 / (2 * variance))).epsilon(1e-12));
  CHECK(got.alpha[13 * 33 + 20] == doctest::Approx(0.7 * std::exp(-25 / (2 * variance))).epsilon(1e-12));
}

TEST_CASE(
    "raster/reference: an opaque wall leaks at most the threshold; under the published rule it leaks more (BF1)") {
  RasterScene<double> scene = stack<double>(3, 1.0);  // clamped to 0.99 at the centre
  for (std::size_t c = 0; c < 3; ++c) {
    scene.background[c] = 1;
    for (std::size_t i = 0; i < 3; ++i) scene.gaussians.columns().color[c][i] = 0;
  }
  const double inclusive = at(scene, render(ReferenceRasterizer<double>{}, scene).image, 0, 16, 16);
  const double exclusive = at(scene, render(ReferenceRasterizer<double, accuracy::inria>{}, scene).image, 0, 16, 16);
  CHECK(inclusive <= 1e-4 * 1.0001);
  CHECK(exclusive >= inclusive);
  // With a layer of transmittance 0.009 first, the published rule drops the wall behind it and 90 times the threshold shines through.
  scene.gaussians.columns().opacity[0] = 0.98;
  scene.gaussians.columns().opacity[1] = 0.55;  // 0.02 * 0.45 = 0.009
  CHECK(at(scene, render(ReferenceRasterizer<double>{}, scene).image, 0, 16, 16) <= 1e-4);
  CHECK(at(scene, render(ReferenceRasterizer<double, accuracy::inria>{}, scene).image, 0, 16, 16) ==
        doctest::Approx(0.009).epsilon(1e-6));
}

TEST_CASE("raster/reference: a clamped alpha does not move with the opacity; the published backward lets it (BF3)") {
  RasterScene<double> scene = stack<double>(1, 0.995);
  scene.camera = scene.camera.cropped(16, 16, 1, 1);  // the clamped pixel alone
  CHECK(render(ReferenceRasterizer<double>{}, scene).gradient.columns().opacity[0] == 0);
  CHECK(render(ReferenceRasterizer<double, published_backward>{}, scene).gradient.columns().opacity[0] != 0);
}

TEST_CASE_TEMPLATE(
    "raster/reference: where every colour equals the background nothing but the colour has a gradient (BB1)", T, float,
    double) {
  RasterScene<T> scene = raster_scene<T>(3, 60, 40, 30);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < 60; ++i) scene.gaussians.columns().color[c][i] = scene.background[c];
  }
  const auto got = render(ReferenceRasterizer<T>{}, scene);
  const auto columns = testing::all_columns(got.gradient.columns());
  for (std::size_t c = 0; c < 11; ++c) {
    for (std::size_t i = 0; i < 60; ++i) CHECK(columns[c][i] == T(0));
  }
}

TEST_CASE("raster/reference: blending gradients in float, thin and opaque, short and long stacks (BB1, BB2)") {
  for (const std::size_t count : {std::size_t{6}, std::size_t{60}, std::size_t{2300}}) {
    for (const float opacity : {0.999f, 0.9f, 0.3f, 0.01f}) {
      RasterScene<float> scene = stack<float>(count, opacity);
      scene.camera = scene.camera.cropped(16, 16, 1, 1);
      const Random random(1, 0, random_stage("test/blend"));
      for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t c = 0; c < 3; ++c)
          scene.gaussians.columns().color[c][i] = static_cast<float>(random.uniform(3 * i + c));
      }
      const auto got = render(ReferenceRasterizer<float, nearly_opaque>{}, scene);
      const auto expected =
          render(ReferenceRasterizer<long double, nearly_opaque>{}, testing::cast_scene<long double>(scene));
      double worst = 0, size = 0;
      for (std::size_t i = 0; i < count; ++i) {
        const auto truth = static_cast<double>(expected.gradient.columns().opacity[i]);
        worst = std::max(worst, std::abs(static_cast<double>(got.gradient.columns().opacity[i]) - truth));
        size = std::max(size, std::abs(truth));
      }
      CHECK(worst <= 3e-6 * size);  // the sheet: 1.2e-6 at 2300 layers
      if (count == 6 &&
          opacity == 0.999f) {  // negative control: colour behind = (all - in front), divided by 1 - alpha
        const float background = scene.background[0] + scene.background[1] + scene.background[2];
        const auto color = [&](std::size_t i) {
          const auto g = scene.gaussians.columns();
          return g.color[0][i] + g.color[1][i] + g.color[2][i];
        };
        float all = 0, transmittance = 1, front = 0, naive = 0;
        for (std::size_t i = 0; i < count; ++i, transmittance *= 1 - opacity) all += transmittance * opacity * color(i);
        all += transmittance * background;
        transmittance = 1;
        for (std::size_t i = 0; i < count; ++i, transmittance *= 1 - opacity) {
          front += transmittance * opacity * color(i);
          const float d_alpha = transmittance * color(i) - (all - front) / (1 - opacity);
          naive = std::max(naive, std::abs(d_alpha - static_cast<float>(expected.gradient.columns().opacity[i])));
        }
        CHECK(static_cast<double>(naive) > 1e-5 * size);
      }
    }
  }
  RasterScene<float> opaque = stack<float>(4, 1.0f);  // alpha = 1 exactly: finite, and nothing behind it moves
  opaque.camera = opaque.camera.cropped(16, 16, 1, 1);
  const auto exact = render(ReferenceRasterizer<float, accuracy::exact>{}, opaque);
  CHECK(std::isfinite(exact.gradient.columns().opacity[0]));
  for (std::size_t i = 1; i < 4; ++i) CHECK(exact.gradient.columns().opacity[i] == 0);
}

TEST_CASE("raster/reference: weights and transmittance sum to one through 2300 layers (BF2)") {
  for (const float opacity : {0.0041f, 0.05f, 0.9f}) {
    RasterScene<float> scene = stack<float>(2300, opacity);
    scene.background = {1, 1, 1};
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < 2300; ++i) scene.gaussians.columns().color[c][i] = 1;
    }
    scene.camera = scene.camera.cropped(16, 16, 1, 1);
    CHECK(std::abs(render(ReferenceRasterizer<float>{}, scene).image[0] - 1) <= 4e-7f * std::sqrt(2300.0f));
  }
}

TEST_CASE(
    "raster/reference: gradient law of the whole rasterizer in double, alpha and depth planes included (R2, BF4)") {
  RasterScene<double> scene = raster_scene<double>(7, 14, 26, 19);
  const std::size_t n = 14, pixels = 26 * 19;
  std::vector<double> image(3 * pixels), d_image(3 * pixels), d_alpha(pixels), d_depth(pixels);
  const Random random(5, 0, random_stage("test/reference_law"));
  for (std::size_t i = 0; i < 3 * pixels; ++i) d_image[i] = static_cast<double>(random.centered(i));
  for (std::size_t i = 0; i < pixels; ++i) {
    d_alpha[i] = static_cast<double>(random.centered(10000 + i));
    d_depth[i] = static_cast<double>(random.centered(20000 + i));
  }
  using R = ReferenceRasterizer<double, smooth>;
  const R rasterizer;
  R::Context context;
  SerialExecutor serial;
  const GaussianColumns<const double> gaussians = std::as_const(scene.gaussians).columns();
  const auto loss = [&] {
    rasterizer.forward(gaussians, scene.camera, scene.background, {image.data(), 3, 19, 26}, context, serial);
    double sum = 0;
    for (std::size_t i = 0; i < 3 * pixels; ++i) sum += d_image[i] * image[i];
    for (std::size_t i = 0; i < pixels; ++i) sum += d_alpha[i] * context.alpha[i] + d_depth[i] * context.depth[i];
    return sum;
  };
  loss();
  GaussianBatch<double> gradient;
  gradient.resize(n);
  gradient.set_zero();
  const PlaneGradients<double> planes{{d_alpha.data(), 1, 19, 26}, {d_depth.data(), 1, 19, 26}};
  rasterizer.backward(gaussians, scene.camera, scene.background, {d_image.data(), 3, 19, 26}, planes,
                      gradient.columns(), context, serial);
  const auto x = testing::all_columns(scene.gaussians.columns());
  const auto d = testing::all_columns(gradient.columns());
  for (std::size_t c = 0; c < 14; ++c) {
    const std::string broken =
        testing::gradient_law(loss, std::span<double>(x[c], n), std::span<const double>(d[c], n), 1e-6, n);
    CHECK_MESSAGE(broken.empty(), "column " << c << ": " << broken);
  }
  std::vector<std::span<double>> variables;
  std::vector<std::span<const double>> gradients;
  for (std::size_t c = 0; c < 14; ++c) {
    variables.emplace_back(x[c], n);
    gradients.emplace_back(d[c], n);
  }
  CHECK(testing::directional_error(loss, variables, gradients, 1e-5) <= 1e-8);
  gradient.columns().scale[1][3] *= 1.01;  // negative control
  CHECK(testing::directional_error(loss, variables, gradients, 1e-5) > 1e-8);
}

TEST_CASE("raster/reference: the laws of the concept (R3-R6), in float, double and under the published rules") {
  const std::string a = testing::raster_laws(ReferenceRasterizer<double>{}, 1, 120);
  CHECK_MESSAGE(a.empty(), a);
  const std::string b = testing::raster_laws(ReferenceRasterizer<float>{}, 2, 120);
  CHECK_MESSAGE(b.empty(), b);
  const std::string c = testing::raster_laws(ReferenceRasterizer<float, accuracy::inria>{}, 3, 120);
  CHECK_MESSAGE(c.empty(), c);
}

TEST_CASE("raster/reference: float agrees with long double (R1)") {
  const std::string broken =
      testing::raster_agrees(ReferenceRasterizer<float>{}, ReferenceRasterizer<long double>{}, {}, 4, 60);
  CHECK_MESSAGE(broken.empty(), broken);
}

TEST_CASE("raster/reference: a poisoned Gaussian leaves the picture finite (BF9, TB1)") {
  for (std::size_t slot = 0; slot < 14; ++slot) {
    for (const float value : {std::nanf(""), INFINITY, -INFINITY, 1e38f, -1e38f}) {
      RasterScene<float> scene = raster_scene<float>(8, 20, 24, 18);
      testing::all_columns(scene.gaussians.columns())[slot][3] = value;
      const auto got = render(ReferenceRasterizer<float>{}, scene);
      for (const float pixel : got.image) CHECK(std::isfinite(pixel));
      for (const float* column : testing::all_columns(got.gradient.columns())) {
        for (std::size_t i = 0; i < 20; ++i) CHECK(std::isfinite(column[i]));
      }
    }
  }
}
