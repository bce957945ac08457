// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/raster/reference.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/testing/raster_laws.hpp"
#include "compmark/testing/raster_scene.hpp"
#include "support/raster.hpp"

using namespace compmark;
using testing::one_pixel_stack;
using testing::raster_scene;
using testing::RasterScene;
using testing::render;
using testing::stack;

static_assert(Rasterizer<ReferenceRasterizer<float>>);
static_assert(Rasterizer<ReferenceRasterizer<long double, accuracy::inria>>);

namespace {

constexpr Accuracy published_backward{.exp_degree = 0, .published_backward = true};

template <class T>
T at(const RasterScene<T>& scene, const std::vector<T>& image, int c, int y, int x) {
  return image[static_cast<std::size_t>((c * scene.camera.height + y) * scene.camera.width + x)];
}

}  // namespace

TEST_CASE("raster/reference: one Gaussian on a pixel centre (docs/spec/method.md, 9)") {
  for (const auto& [opacity, factor] : {std::pair{0.5, 0.5}, std::pair{1.0, 0.99}, std::pair{0.0039, 0.0}}) {
    RasterScene<double> scene = stack<double>(1, opacity);
    scene.background = {};
    const auto inria = render(ReferenceRasterizer<double, accuracy::inria>{}, scene);
    const auto spec = render(ReferenceRasterizer<double>{}, scene);
    for (int c = 0; c < 3; ++c) {
      const double color = scene.gaussians.columns().color[static_cast<std::size_t>(c)][0];
      CHECK(at(scene, spec.image, c, 16, 16) ==
            doctest::Approx(factor * color).epsilon(1e-7));  // 0.99 is a float in the policy
      CHECK(at(scene, inria.image, c, 16, 16) == doctest::Approx(factor * color).epsilon(1e-7));
    }
    CHECK(spec.context.alpha[16 * 33 + 16] == doctest::Approx(factor).epsilon(1e-7));
    CHECK(spec.context.depth[16 * 33 + 16] == doctest::Approx(factor * 2).epsilon(1e-7));
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
  even.camera.cx = 15.5f;  // negative control: centres at whole numbers
  const auto shifted = render(ReferenceRasterizer<float>{}, even).image;
  CHECK(std::abs(at(even, shifted, 0, 16, 15) - at(even, shifted, 0, 16, 16)) > 1e-3f);
  const RasterScene<float> odd = stack<float>(1, 0.7f, 33, 33);
  const auto rendered = render(ReferenceRasterizer<float>{}, odd);
  const auto b = rendered.context.alpha.span();
  CHECK(std::max_element(b.begin(), b.end()) - b.begin() == 16 * 33 + 16);
}

TEST_CASE("raster/reference: closed form of one pixel off the centre, blur included") {
  const RasterScene<double> scene = stack<double>(1, 0.7);
  const auto got = render(ReferenceRasterizer<double>{}, scene);
  const double variance = (100 * 0.1 / 2) * (100 * 0.1 / 2) + 0.3;
  CHECK(got.context.alpha[16 * 33 + 19] == doctest::Approx(0.7 * std::exp(-9 / (2 * variance))).epsilon(1e-12));
  CHECK(got.context.alpha[13 * 33 + 20] == doctest::Approx(0.7 * std::exp(-25 / (2 * variance))).epsilon(1e-12));
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
  // With a layer of transmittance 0.009 first, the published rule drops the wall behind it and 90 times the threshold
  // shines through.
  scene.gaussians.columns().opacity[0] = 0.98;
  scene.gaussians.columns().opacity[1] = 0.55;  // 0.02 * 0.45 = 0.009
  CHECK(at(scene, render(ReferenceRasterizer<double>{}, scene).image, 0, 16, 16) <= 1e-4);
  CHECK(at(scene, render(ReferenceRasterizer<double, accuracy::inria>{}, scene).image, 0, 16, 16) ==
        doctest::Approx(0.009).epsilon(1e-6));
}

TEST_CASE("raster/reference: a clamped alpha does not move with the opacity; the published backward lets it (BF3)") {
  const RasterScene<double> scene = one_pixel_stack<double>(1, 0.995);  // the clamped pixel alone
  CHECK(render(ReferenceRasterizer<double>{}, scene).gradient.columns().opacity[0] == 0);
  CHECK(render(ReferenceRasterizer<double, published_backward>{}, scene).gradient.columns().opacity[0] != 0);
}

TEST_CASE_TEMPLATE(
    "raster/reference: where every colour equals the background nothing but the colour has a gradient (BB1)", T, float,
    double) {
  testing::check_flat_color<ReferenceRasterizer<T>>();
}

TEST_CASE("raster/reference: the table of blending gradients in float, six to 2300 layers (BB1)") {
  testing::check_blend_table<ReferenceRasterizer<float, testing::nearly_opaque>>();
}

TEST_CASE("raster/reference: alpha of exactly one is finite, and nothing behind it moves (BB2)") {
  const auto exact = render(ReferenceRasterizer<float, accuracy::exact>{}, one_pixel_stack<float>(4, 1.0f));
  CHECK(std::isfinite(exact.gradient.columns().opacity[0]));
  for (std::size_t i = 1; i < 4; ++i) CHECK(exact.gradient.columns().opacity[i] == 0);
  // Negative control: the transmittance in front as what is left, divided by 1 - alpha.
  const float alpha = 1, left = 1 - alpha, nearly = 1 - 6e-8f;
  CHECK(std::isnan(left / (1 - alpha)));
  CHECK(1 / (1 - nearly) > 1e7f);
}

TEST_CASE("raster/reference: weights and transmittance sum to one through 2300 layers (BF2)") {
  for (const float opacity : {0.0041f, 0.05f, 0.9f}) {
    RasterScene<float> scene = one_pixel_stack<float>(2300, opacity);
    scene.background = {1, 1, 1};
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < 2300; ++i) scene.gaussians.columns().color[c][i] = 1;
    }
    CHECK(std::abs(render(ReferenceRasterizer<float>{}, scene).image[0] - 1) <= 4e-7f * std::sqrt(2300.0f));
  }
  // What is left of a white background behind black fog, alone: no weight makes up for it.
  RasterScene<float> fog = one_pixel_stack<float>(2300, 0.001f);
  fog.background = {1, 1, 1};
  for (std::size_t c = 0; c < 3; ++c) std::fill_n(fog.gaussians.columns().color[c], 2300, 0.0f);
  const double exact = std::pow(1 - static_cast<double>(0.001f), 2300);
  const float got = render(ReferenceRasterizer<float, testing::nearly_opaque>{}, fog).image[0];
  float naive = 1;
  for (int i = 0; i < 2300; ++i) naive *= 1 - 0.001f;
  const double error = std::abs(static_cast<double>(got) / exact - 1),
               naive_error = std::abs(static_cast<double>(naive) / exact - 1);
  MESSAGE("error of the transmittance: ", error, ", by 1 - alpha: ", naive_error);
  CHECK(error < 4e-6);
  CHECK(naive_error > 1e-5);  // negative control
}

TEST_CASE(
    "raster/reference: gradient law of the whole rasterizer in double, alpha and depth planes included (R2, BF4)") {
  testing::check_gradient_law<ReferenceRasterizer<double, testing::smooth>>();
}

TEST_CASE("raster/reference: at the cut-off differences see a step, and with the ramp the slope (BF4)") {
  const auto slopes = [](const auto& rasterizer) {
    const double middle = 1.0 / 255 + 1e-7, step = 1e-6;
    const auto value = [&](double opacity) {
      const std::vector<double> image = render(rasterizer, one_pixel_stack<double>(1, opacity)).image;
      return image[0] + image[1] + image[2];
    };
    const double analytic = render(rasterizer, one_pixel_stack<double>(1, middle)).gradient.columns().opacity[0];
    return std::pair{(value(middle + step) - value(middle - step)) / (2 * step), analytic};
  };
  const auto [difference, slope] = slopes(ReferenceRasterizer<double, testing::smooth>{});
  CHECK(std::abs(difference / slope - 1) < 1e-5);
  const auto [step_difference, step_slope] = slopes(ReferenceRasterizer<double>{});
  CHECK(std::abs(step_difference / step_slope) > 100);  // negative control
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
