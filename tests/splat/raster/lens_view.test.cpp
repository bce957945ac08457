// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/raster/lens_view.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <vector>

#include "splat/raster/effects_law.hpp"

using namespace compmark;
using testing::image_of;
using testing::phone_lens;
using testing::raster_scene;
using testing::RasterScene;
using testing::render;
using testing::TileWith;
using testing::wide_lens;
using testing::with_lens;

namespace {

template <class T>
using PhoneEffects = RasterEffects<RadialTangentialLens<T>>;
template <class T>
using WideEffects = RasterEffects<FisheyeLens<T>>;

/// Gaussians that leave the image on all sides, some far enough for the clamp of the Jacobian.
template <class T>
RasterScene<T> spread_scene(std::size_t count, double spread) {
  RasterScene<T> scene = raster_scene<T>(4, count, 83, 61);
  const GaussianColumns<T> g = scene.gaussians.columns();
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 2; ++k) g.mean[k][i] *= static_cast<T>(spread);
    for (std::size_t k = 0; k < 3; ++k) g.scale[k][i] *= static_cast<T>(3);
  }
  return scene;
}

template <class T>
double largest_difference(const std::vector<T>& a, const std::vector<T>& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::abs(static_cast<double>(a[i] - b[i])));
  return worst;
}

/// Zeroth, first and second moments of the first channel.
struct Moments {
  double sum = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
};
Moments moments(const std::vector<double>& image, int width, int height) {
  Moments m;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double value = image[static_cast<std::size_t>(y * width + x)];
      m.sum += value;
      m.x += value * (x + 0.5);
      m.y += value * (y + 0.5);
    }
  }
  m.x /= m.sum;
  m.y /= m.sum;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double value = image[static_cast<std::size_t>(y * width + x)] / m.sum;
      m.xx += value * (x + 0.5 - m.x) * (x + 0.5 - m.x);
      m.xy += value * (x + 0.5 - m.x) * (y + 0.5 - m.y);
      m.yy += value * (y + 0.5 - m.y) * (y + 0.5 - m.y);
    }
  }
  return m;
}

/// One white Gaussian on black at the camera point p, standard deviation s, seen by `camera`.
RasterScene<double> one_gaussian(const Camera<double>& camera, const std::array<double, 3>& p, double s) {
  RasterScene<double> scene = raster_scene<double>(1, 1, camera.width, camera.height);
  scene.camera = camera;
  scene.background = {};
  const GaussianColumns<double> g = scene.gaussians.columns();
  for (std::size_t k = 0; k < 3; ++k) {
    g.mean[k][0] = p[k];
    g.scale[k][0] = s;
    g.color[k][0] = 1;
  }
  for (std::size_t k = 0; k < 4; ++k) g.rotation[k][0] = k == 0 ? 1 : 0;
  g.opacity[0] = 0.5;
  return scene;
}

/// Position and covariance of the image of a small Gaussian against distort() and central differences of it: an
/// independent way. The sum over pixels of a Gaussian of variance above 1 is its integral to 1e-8.
template <class Effects>
void check_image(const Lens& lens, const Camera<double>& camera, const std::array<double, 3>& p, double s) {
  using R = TileWith<double, testing::uncut, Effects>;
  const RasterScene<double> scene = one_gaussian(camera, p, s);
  const Moments got = moments(image_of(with_lens<R>(), scene), camera.width, camera.height);
  const auto pixel = [&](const std::array<double, 3>& q) {
    const std::array<double, 2> d = distort(lens, q[0] / q[2], q[1] / q[2]);
    return std::array<double, 2>{camera.fx * d[0] + camera.cx, camera.fy * d[1] + camera.cy};
  };
  const std::array<double, 2> mean = pixel(p);
  CHECK(std::abs(got.x - mean[0]) < 1e-6);
  CHECK(std::abs(got.y - mean[1]) < 1e-6);
  double xx = 0.3, xy = 0, yy = 0.3;  // the blur
  for (std::size_t k = 0; k < 3; ++k) {
    std::array<double, 3> above = p, below = p;
    const double h = 1e-5 * p[2];
    above[k] += h;
    below[k] -= h;
    const std::array<double, 2> a = pixel(above), b = pixel(below);
    const double dx = s * (a[0] - b[0]) / (2 * h), dy = s * (a[1] - b[1]) / (2 * h);
    xx += dx * dx;
    xy += dx * dy;
    yy += dy * dy;
  }
  CHECK(got.xx == doctest::Approx(xx).epsilon(1e-6));
  CHECK(got.yy == doctest::Approx(yy).epsilon(1e-6));
  CHECK(std::abs(got.xy - xy) < 1e-6 * (xx + yy));
}

template <class R>
void check_gradients_around_the_clamp(bool horizontal) {
  for (const double times : {0.6, 0.97, 1.03, 1.2}) {
    for (const double side : {-1.0, 1.0}) {
      RasterScene<double> scene = raster_scene<double>(2, 5, 26, 19);
      const R rasterizer = with_lens<R>();
      const detail::LensView<double, typename R::EffectPolicy::Lens> view(scene.camera, rasterizer.settings().lens);
      const double limit = horizontal ? (side > 0 ? view.x_high : view.x_low) : (side > 0 ? view.y_high : view.y_low);
      const GaussianColumns<double> g = scene.gaussians.columns();
      for (std::size_t i = 0; i < 5; ++i) {
        g.mean[horizontal ? 0 : 1][i] = times * limit * g.mean[2][i];
        for (std::size_t k = 0; k < 3; ++k) g.scale[k][i] *= 20;
      }
      typename R::Context context;
      image_of(rasterizer, scene, context);
      const auto visible = rasterizer.screen(context).visible;
      REQUIRE(std::count(visible.begin(), visible.end(), 1) >= 3);
      CAPTURE(times);
      CAPTURE(side);
      testing::check_gradients(rasterizer, scene, 3e-7);
    }
  }
}

}  // namespace

TEST_CASE(
    "raster/lens_view: the rays that land at a point are found, and the limits of the Jacobian follow them (PR4)") {
  const auto phone = *radial_tangential_lens<double>(phone_lens);
  const auto wide = *fisheye_lens<double>(wide_lens);
  for (const double u : {-0.55, -0.2, 0.0, 0.3, 0.6}) {
    for (const double v : {-0.4, 0.0, 0.45}) {
      const std::array<double, 2> a = detail::ray_through(phone, u, v), b = detail::ray_through(wide, 1.7 * u, 1.7 * v);
      const Undistorted expected = undistort(phone_lens, u, v), expected_wide = undistort(wide_lens, 1.7 * u, 1.7 * v);
      if (expected.converged) {
        CHECK(std::hypot(a[0] - expected.x, a[1] - expected.y) < 1e-12);
      } else {
        CHECK(phone.inside(a[0], a[1]));
      }
      REQUIRE(expected_wide.converged);
      CHECK(std::hypot(b[0] - expected_wide.x, b[1] - expected_wide.y) < 1e-11 * (1 + std::hypot(b[0], b[1])));
    }
  }
  // An image that the lens does not fill: the limits stay within the lens, and are nearly all of it.
  RadialTangentialLens<double> barrel;
  barrel.k1 = -0.3;  // r (1 - 0.3 r^2) turns back at r^2 = 1 / 0.9, where it is 0.70
  barrel.limit2 = 1 / 0.9;
  const detail::RayLimits<double> all = detail::ray_limits(barrel, detail::RayLimits<double>{-3, 3, -3, 3});
  const double limit = std::sqrt(barrel.limit2);
  CHECK(all.x_high <= limit);
  CHECK(all.x_high > 0.9 * limit);
  CHECK(all.x_low < -0.9 * limit);
  // Zero coefficients: the pinhole's limits to the bit.
  const Camera<float> camera = raster_scene<float>(1, 1, 83, 61).camera;
  const detail::PinholeView<float> pinhole(camera);
  const detail::LensView<float, RadialTangentialLens<float>> zero(camera, {});
  CHECK(pinhole.x_low == zero.x_low);
  CHECK(pinhole.x_high == zero.x_high);
  CHECK(pinhole.y_low == zero.y_low);
  CHECK(pinhole.y_high == zero.y_high);
}

TEST_CASE("raster/lens_view: a lens with zero coefficients is the pinhole to rounding, clamped Jacobians included") {
  const auto check = [](auto scalar, double image, double gradient) {
    using T = decltype(scalar);
    const RasterScene<T> scene = spread_scene<T>(200, 1.6);
    const auto pinhole = render(TileRasterizer<T, accuracy::spec>{}, scene);
    const auto zero = render(TileWith<T, accuracy::spec, PhoneEffects<T>>{}, scene);
    CHECK(largest_difference(pinhole.image, zero.image) <= image);
    const auto a = testing::all_columns(pinhole.gradient.columns()), b = testing::all_columns(zero.gradient.columns());
    for (std::size_t c = 0; c < 14; ++c) {
      double worst = 0, size = 0;
      for (std::size_t i = 0; i < 200; ++i) {
        worst = std::max(worst, std::abs(static_cast<double>(a[c][i] - b[c][i])));
        size = std::max(size, std::abs(static_cast<double>(a[c][i])));
      }
      CHECK(worst <= gradient * size);
    }
    // Negative control: a thousandth of a coefficient is seen.
    auto settings = typename TileWith<T, accuracy::spec, PhoneEffects<T>>::Settings{};
    settings.lens.k1 = T(1e-3);
    const auto bent = image_of(TileWith<T, accuracy::spec, PhoneEffects<T>>(settings), scene);
    CHECK(largest_difference(pinhole.image, bent) > 10 * image);
  };
  check(double{}, 1e-12, 1e-11);
  check(float{}, 1e-4, 1e-4);
}

TEST_CASE(
    "raster/lens_view: the image of a Gaussian is where the lens puts its mean, and as large as the lens makes it") {
  Camera<double> camera;
  camera.width = 200;
  camera.height = 160;
  camera.fx = 150;
  camera.fy = 155;
  camera.cx = 97;
  camera.cy = 82;
  for (const double a : {-0.45, -0.1, 0.0, 0.4}) {
    for (const double b : {-0.3, 0.05, 0.35}) {
      check_image<PhoneEffects<double>>(phone_lens, camera, {2 * a, 2 * b, 2}, 0.03);
      check_image<WideEffects<double>>(wide_lens, camera, {2 * a, 2 * b, 2}, 0.03);
    }
  }
}

TEST_CASE("raster/lens_view: a fisheye draws beyond 60 degrees from its axis, at the angle that its polynomial says") {
  Camera<double> camera;
  camera.width = camera.height = 320;
  camera.fx = camera.fy = 100;
  camera.cx = camera.cy = 160;
  for (const double degrees : {20.0, 61.0, 75.0, 82.0}) {
    for (const double turn : {0.3, 2.0, 4.4}) {
      const double theta = degrees * std::numbers::pi / 180;
      const std::array<double, 3> p{3 * std::sin(theta) * std::cos(turn), 3 * std::sin(theta) * std::sin(turn),
                                    3 * std::cos(theta)};
      CAPTURE(degrees);
      check_image<WideEffects<double>>(wide_lens, camera, p, 0.05);
      const auto& k = wide_lens.parameters;
      const double t2 = theta * theta;
      const double r = 100 * theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
      using R = TileWith<double, testing::uncut, WideEffects<double>>;
      const Moments m = moments(image_of(with_lens<R>(), one_gaussian(camera, p, 0.05)), 320, 320);
      CHECK(m.x == doctest::Approx(160 + r * std::cos(turn)).epsilon(1e-7));
      CHECK(m.y == doctest::Approx(160 + r * std::sin(turn)).epsilon(1e-7));
      // Negative control: a pinhole of this focal length has nothing of it in the image.
      const auto pinhole =
          moments(image_of(TileRasterizer<double, testing::uncut>{}, one_gaussian(camera, p, 0.05)), 320, 320);
      CHECK((degrees < 70 || pinhole.sum < 1e-6));
    }
  }
}

TEST_CASE(
    "raster/lens_view: beyond the region where the lens is one-to-one nothing is drawn and nothing has a gradient") {
  using R = TileWith<float, accuracy::standard, PhoneEffects<float>>;
  using Reference = ReferenceRasterizer<double, accuracy::spec, PhoneEffects<double>>;
  R::Settings settings;
  settings.lens.k1 = -0.3f;  // r (1 - 0.3 r^2) turns back at r^2 = 1 / 0.9
  settings.lens.limit2 = 1.0f / 0.9f;
  RasterScene<float> scene = raster_scene<float>(6, 20, 83, 61);
  const GaussianColumns<float> g = scene.gaussians.columns();
  REQUIRE(std::hypot(g.mean[0][7], g.mean[1][7]) < g.mean[2][7]);
  RasterScene<float> without = scene;
  without.gaussians.columns().opacity[7] = 0;
  g.mean[0][7] = 1.5f * g.mean[2][7];  // lands at 0.49 f: inside the image, were it drawn
  g.mean[1][7] = 0;
  for (std::size_t k = 0; k < 3; ++k) g.scale[k][7] = 0.3f;
  const auto run = render(R(settings), scene);
  CHECK(run.context.projected.visible[7] == 0);
  CHECK(run.image == image_of(R(settings), without));
  for (const float* column : testing::all_columns(run.gradient.columns())) CHECK(column[7] == 0);
  Reference::Settings exact;
  exact.lens.k1 = -0.3;
  exact.lens.limit2 = 1 / 0.9;
  const auto reference = render(Reference(exact), testing::cast_scene<double>(scene));
  CHECK(reference.context.visible[7] == 0);
  settings.lens.limit2 = 4;  // negative control: the ghost
  CHECK(render(R(settings), scene).context.projected.visible[7] == 1);
}

TEST_CASE("raster/lens_view: points at, behind and absurdly far beside the camera leave a finite image (PR1, BF9)") {
  RasterScene<float> scene = raster_scene<float>(6, 16, 83, 61);
  const GaussianColumns<float> g = scene.gaussians.columns();
  const std::array<float, 8> bad{0.0f, -1.0f, 1e-30f, 1e30f, -1e30f, 1e38f, 0.2f, 0.2000001f};
  for (std::size_t i = 0; i < 8; ++i) {
    g.mean[2][i] = std::abs(bad[i]) > 1 ? 1.0f : bad[i];
    g.mean[0][i] = std::abs(bad[i]) > 1 ? bad[i] : 1.0f;
  }
  const auto check = [&](const auto& rasterizer) {
    const auto run = render(rasterizer, scene);
    for (const float value : run.image) CHECK(std::isfinite(value));
    for (const float* column : testing::all_columns(run.gradient.columns())) {
      for (std::size_t i = 0; i < 16; ++i) CHECK(std::isfinite(column[i]));
    }
  };
  check(with_lens<TileWith<float, accuracy::standard, PhoneEffects<float>>>());
  check(with_lens<TileWith<float, accuracy::standard, WideEffects<float>>>());
  TileWith<float, accuracy::standard, PhoneEffects<float>>::Settings unlimited;
  unlimited.lens.k1 = 0.1f;  // one-to-one everywhere
  unlimited.lens.k3 = 0.1f;
  check(TileWith<float, accuracy::standard, PhoneEffects<float>>(unlimited));
}

TEST_CASE("raster/lens_view: tiles equal the reference through a lens, and keep the laws (R1, R3-R6)") {
  using testing::check_agreement_with_effects;
  check_agreement_with_effects<TileWith<double, accuracy::spec, PhoneEffects<double>>,
                               ReferenceRasterizer<double, accuracy::spec, PhoneEffects<double>>>(1e-12, 1e-11);
  check_agreement_with_effects<TileWith<double, accuracy::spec, WideEffects<double>>,
                               ReferenceRasterizer<double, accuracy::spec, WideEffects<double>>>(1e-12, 1e-11);
  check_agreement_with_effects<TileWith<float, accuracy::standard, PhoneEffects<float>>,
                               ReferenceRasterizer<double, accuracy::standard, PhoneEffects<double>>>(2e-5, 1e-3);
  check_agreement_with_effects<TileWith<float, accuracy::standard, WideEffects<float>>,
                               ReferenceRasterizer<double, accuracy::standard, WideEffects<double>>>(2e-5, 1e-3);
  const std::string laws =
      testing::raster_laws(with_lens<TileWith<float, accuracy::standard, WideEffects<float>>>(), 9);
  CHECK_MESSAGE(laws.empty(), laws);
}

TEST_CASE("raster/lens_view: gradients through a lens, the clamp on and off (R2, PR3)") {
  using Phone = PhoneEffects<double>;
  using Wide = WideEffects<double>;
  RasterScene<double> scene = raster_scene<double>(7, 14, 26, 19);
  testing::check_gradients(with_lens<ReferenceRasterizer<double, testing::uncut, Phone>>(), scene, 3e-7);
  testing::check_gradients(with_lens<ReferenceRasterizer<double, testing::uncut, Wide>>(), scene, 3e-7);
  testing::check_gradients(with_lens<TileWith<double, testing::uncut, Phone>>(), scene, 3e-7);
  testing::check_gradients(with_lens<TileWith<double, testing::uncut, Wide>>(), scene, 3e-7);
  check_gradients_around_the_clamp<TileWith<double, testing::uncut, Phone>>(true);
  check_gradients_around_the_clamp<TileWith<double, testing::uncut, Phone>>(false);
  check_gradients_around_the_clamp<ReferenceRasterizer<double, testing::uncut, Wide>>(true);
  check_gradients_around_the_clamp<TileWith<double, testing::uncut, Wide>>(false);
}
