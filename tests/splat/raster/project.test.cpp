// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/raster/project.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/raster/bin.hpp"
#include "compmark/splat/raster/project_backward.hpp"
#include "compmark/testing/raster_scene.hpp"

using namespace compmark;
using testing::raster_scene;
using testing::RasterScene;

namespace {

template <class T>
struct Projected {
  ProjectedSplats<T> splats;
  RasterReport report;
};

template <Accuracy accuracy = accuracy::standard, int W = 0, class T, Executor E>
Projected<T> run(const RasterScene<T>& scene, E& executor, ProjectionSettings<T> settings = {}) {
  Projected<T> result;
  ProjectWorkspace<T> workspace;
  const GaussianColumns<const T> gaussians = scene.gaussians.columns();
  result.report = project < accuracy, T,
  W == 0 ? native_width<T> : W > (gaussians, scene.camera, settings, result.splats, workspace, executor);
  return result;
}
template <Accuracy accuracy = accuracy::standard, int W = 0, class T>
Projected<T> run(const RasterScene<T>& scene, ProjectionSettings<T> settings = {}) {
  SerialExecutor serial;
  return run<accuracy, W>(scene, serial, settings);
}

template <class T>
bool same_splats(const Projected<T>& a, const Projected<T>& b) {
  return a.splats.count == b.splats.count &&
         std::memcmp(a.splats.splats.data(), b.splats.splats.data(), a.splats.count * sizeof(Splat<T>)) == 0;
}

template <class T>
std::array<T, 14> values(const Splat<T>& s) {
  return {s.u,   s.v,     s.slope, s.major, s.minor,     s.pivot_x,    s.opacity,
          s.red, s.green, s.blue,  s.depth, s.sigma_max, s.half_width, s.half_height};
}

template <class T>
bool all_finite(const Splat<T>& s) {
  for (const T value : values(s)) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

/// One Gaussian on the optical axis at depth z.
template <class T>
RasterScene<T> single(T z, T scale, T opacity) {
  RasterScene<T> scene = raster_scene<T>(1, 1, 64, 48);
  const GaussianColumns<T> g = scene.gaussians.columns();
  scene.camera.cx = 32;
  scene.camera.cy = 24;
  for (std::size_t k = 0; k < 3; ++k) {
    g.mean[k][0] = k == 2 ? z : T(0);
    g.scale[k][0] = scale;
  }
  for (std::size_t k = 0; k < 4; ++k) g.rotation[k][0] = k == 0 ? T(1) : T(0);
  g.opacity[0] = opacity;
  return scene;
}

}  // namespace

TEST_CASE("raster/project: what is not in front of the near plane is culled, NaN included, and changes nothing (PR1)") {
  const RasterScene<float> scene = raster_scene<float>(1, 100, 64, 48);
  const auto expected = run(scene);
  CHECK(expected.splats.count > 80);
  for (const float z : {-1.0f, -0.0f, 0.0f, 1e-30f, 0.2f, -1e30f, std::nanf("")}) {
    RasterScene<float> more = testing::reordered(scene, [] {
      std::vector<std::size_t> order{0};  // a copy of row 0, to be culled, before all the others (TB10)
      for (std::size_t i = 0; i < 100; ++i) order.push_back(i);
      return order;
    }());
    more.gaussians.columns().mean[2][0] = z;
    const auto got = run(more);
    CHECK(same_splats(got, expected));
    CHECK(got.splats.visible[0] == 0);
    CHECK(got.splats.place[0] == ProjectedSplats<float>::nowhere);
    // Negative control (TB10): splat i is not row i once a row is culled.
    std::size_t same = 0;
    for (std::size_t i = 0; i < got.splats.count; ++i) same += got.splats.source[i] == i ? 1 : 0;
    CHECK(2 * same < got.splats.count);
  }
  // Negative control (PR1): asked the other way round, a NaN is in front.
  CHECK_FALSE(std::nanf("") <= ProjectionSettings<float>{}.near_plane);
}

TEST_CASE_TEMPLATE("raster/project: giants stay finite and are not culled (PR2)", T, float, double) {
  for (const T log_scale : {T(-30), T(-10), T(0), T(10), T(20), T(30), T(40)}) {
    for (const T z : {T(3), T(0.21)}) {
      const auto got = run(single<T>(z, std::exp(log_scale), T(0.8)));
      REQUIRE(got.splats.count == 1);
      CHECK(all_finite(got.splats.splats[0]));
      CHECK(got.splats.splats[0].major > 0);
      CHECK(got.splats.splats[0].minor > 0);
    }
  }
  // Negative control: the determinant as a product of variances.
  const float variance = std::exp(2 * 40.0f) * (64.0f / 3) * (64.0f / 3);
  CHECK(std::isfinite(variance));
  CHECK_FALSE(std::isfinite(variance * variance - 0.0f));
}

TEST_CASE("raster/project: a crop with a shifted principal point sees the same splats (PR4)") {
  RasterScene<float> scene = raster_scene<float>(2, 300, 128, 96);
  const auto full = run(scene);
  scene.camera = scene.camera.cropped(32, 16, 64, 64);
  const auto crop = run(scene);
  CHECK(crop.splats.count > 50);
  for (std::size_t i = 0; i < crop.splats.count; ++i) {
    const std::uint32_t place = full.splats.place[crop.splats.source[i]];
    REQUIRE(place != ProjectedSplats<float>::nowhere);
    const Splat<float>& a = crop.splats.splats[i];
    const Splat<float>& b = full.splats.splats[place & ~ProjectedSplats<float>::pivot_bit];
    CHECK(std::abs(a.u + 32 - b.u) <= 2e-5f);  // 1 ulp of a coordinate of 128
    CHECK(std::abs(a.v + 16 - b.v) <= 2e-5f);
    if (a.u < -10 || a.u > 74 || a.v < -10 || a.v > 74) continue;  // beyond the crop's own limits
    CHECK(std::abs(a.slope - b.slope) <= 2e-6f);
    CHECK(std::abs(a.major - b.major) <= 2e-6f * b.major);
  }
}

namespace {

/// Variance along x, covariance, variance along y: back from the conditional form.
std::array<double, 3> covariance_of(const Splat<double>& s) {
  const double pivot = 1 / (2 * s.minor), determinant = pivot / (2 * s.major), b = s.slope * pivot;
  const double other = (determinant + b * b) / pivot;
  return s.pivot_x != 0 ? std::array<double, 3>{pivot, b, other} : std::array<double, 3>{other, b, pivot};
}

}  // namespace

TEST_CASE(
    "raster/project: a camera that is rolled by a quarter turn sees turned ellipses, unless one axis is clamped "
    "(PR5)") {
  RasterScene<double> scene = raster_scene<double>(12, 400, 160, 90);
  scene.camera.cx = 80;
  scene.camera.cy = 45;
  scene.camera.fy = scene.camera.fx;
  const detail::PinholeView<double> view(scene.camera);
  const Random random(12, 0, random_stage("test/roll"));
  const GaussianColumns<double> g = scene.gaussians.columns();
  for (std::size_t i = 0; i < 400; ++i) {
    g.mean[0][i] = 2 * static_cast<double>(random.centered(2 * i)) * view.x_high * g.mean[2][i];
    g.mean[1][i] = 2 * static_cast<double>(random.centered(2 * i + 1)) * view.y_high * g.mean[2][i];
    for (std::size_t k = 0; k < 3; ++k) g.scale[k][i] *= 20;  // large enough to reach into either image
  }
  const auto upright = run<accuracy::spec, 1>(scene);
  scene.camera.rotation_camera_world = {0, -1, 0, 1, 0, 0, 0, 0, 1};  // x is now -y, and y is x
  const auto rolled = run<accuracy::spec, 1>(scene);
  std::size_t free = 0, clamped = 0;
  double worst = 0, least_turned = 1;
  for (std::size_t i = 0; i < 400; ++i) {
    if (upright.splats.visible[i] == 0 || rolled.splats.visible[i] == 0) continue;
    const auto place = [i](const auto& run) { return run.splats.place[i] & ~ProjectedSplats<double>::pivot_bit; };
    const auto a = covariance_of(upright.splats.splats[place(upright)]);
    const auto b = covariance_of(rolled.splats.splats[place(rolled)]);
    const double error =
        std::max({std::abs(b[0] - a[2]), std::abs(b[1] + a[1]), std::abs(b[2] - a[0])}) / (a[0] + a[2]);
    const double sideways = std::abs(g.mean[0][i] / g.mean[2][i]) / view.y_high;  // rolled, it is the other axis' limit
    if (sideways < 1) {
      ++free;
      worst = std::max(worst, error);
    } else if (sideways > 1.2) {
      ++clamped;
      least_turned = std::min(least_turned, error);
    }
  }
  MESSAGE(free, " free, largest error ", worst, "; ", clamped, " clamped, least error ", least_turned);
  CHECK(free > 100);
  CHECK(worst < 1e-10);
  CHECK(clamped > 20);
  CHECK(least_turned > 1e-3);  // negative control, and the limit of the published clamp: beyond the widened image
}

TEST_CASE("raster/project: camera and scene moved together by 1e5 give the same picture (PR7)") {
  // Means on a grid of 1/64, so that moving them by a multiple of 1/64 is exact and all error is projection's own.
  RasterScene<float> scene = raster_scene<float>(3, 200, 800, 600);
  const GaussianColumns<float> g = scene.gaussians.columns();
  for (std::size_t i = 0; i < 200; ++i) {
    for (std::size_t k = 0; k < 3; ++k) g.mean[k][i] = std::round(g.mean[k][i] * 64) / 64;
  }
  scene.camera.center_world = {0.3, -0.1, 0.7};
  const auto expected = run(scene);
  for (const double move : {1e3, 1e5}) {
    RasterScene<float> moved = scene;
    const GaussianColumns<float> m = moved.gaussians.columns();
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t i = 0; i < 200; ++i) m.mean[k][i] = g.mean[k][i] + static_cast<float>(move);
      moved.camera.center_world[k] += move;
    }
    const auto got = run(moved);
    REQUIRE(got.splats.count == expected.splats.count);
    float naive = 0;
    for (std::size_t i = 0; i < got.splats.count; ++i) {
      CHECK(std::abs(got.splats.splats[i].u - expected.splats.splats[i].u) <= 1e-3f);  // 800 px: a few ulp
      CHECK(std::abs(got.splats.splats[i].v - expected.splats.splats[i].v) <= 1e-3f);
      const std::uint32_t source = got.splats.source[i];  // negative control: R x + t with t in float
      const float x = m.mean[0][source] + static_cast<float>(-moved.camera.center_world[0]);
      const float z = m.mean[2][source] + static_cast<float>(-moved.camera.center_world[2]);
      naive = std::max(naive, std::abs(moved.camera.fx * x / z + moved.camera.cx - expected.splats.splats[i].u));
    }
    if (move == 1e5) CHECK(naive > 0.1f);
  }
}

TEST_CASE("raster/project: scene, camera and near plane scaled by k give the same splats (PR8)") {
  const RasterScene<float> scene = raster_scene<float>(4, 200, 128, 96);
  const auto expected = run(scene);
  for (const float k : {1e-3f, 1e3f}) {
    RasterScene<float> scaled = scene;
    const GaussianColumns<float> g = scaled.gaussians.columns();
    for (std::size_t i = 0; i < 200; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        g.mean[axis][i] *= k;
        g.scale[axis][i] *= k;
      }
    }
    const auto got = run(scaled, ProjectionSettings<float>{.near_plane = 0.2f * k});
    REQUIRE(got.splats.count == expected.splats.count);
    for (std::size_t i = 0; i < got.splats.count; ++i) {
      const auto a = values(got.splats.splats[i]), b = values(expected.splats.splats[i]);
      for (std::size_t f = 0; f < 14; ++f) {
        if (f != 10) CHECK(std::abs(a[f] - b[f]) <= 1e-5f * (1 + std::abs(b[f])));  // 10 is the depth
      }
    }
  }
}

TEST_CASE_TEMPLATE("raster/project: any poison in any of the 14 slots leaves everything else untouched (TB1, BF9)", T,
                   float, double) {
  const RasterScene<T> scene = raster_scene<T>(5, 40, 64, 48);
  const T infinity = std::numeric_limits<T>::infinity(), nan = std::numeric_limits<T>::quiet_NaN();
  const T poison[] = {nan,     -nan,     infinity, -infinity, T(0),    T(-0.0),  std::numeric_limits<T>::denorm_min(),
                      T(1e38), T(-1e38), T(1e-38), T(-1e-38), T(1),    T(-1),    T(1) / 255,
                      T(0.5),  T(16),    T(-16),   T(255),    T(1e10), T(-1e10), T(1e20),
                      T(3e4)};
  SerialExecutor serial;
  for (std::size_t slot = 0; slot < 14; ++slot) {
    for (const T value : poison) {
      RasterScene<T> bad = scene;
      testing::all_columns(bad.gaussians.columns())[slot][7] = value;
      const auto got = run(bad);
      REQUIRE(got.splats.count + 1 >= 20);
      for (std::size_t i = 0; i < got.splats.count; ++i) CHECK(all_finite(got.splats.splats[i]));
      CHECK(got.report.scrubbed == (std::isfinite(value) && (slot < 11 || std::abs(value) <= 100) ? 0u : 1u));
      TileLists lists;
      BinWorkspace bins;
      REQUIRE(bin<accuracy::standard>(got.splats, 64, 48, BinSettings{}, lists, bins, serial).ok());
      const std::vector<SplatGradient<T>> sums(got.splats.gaussians,
                                               SplatGradient<T>{1, 1, 1, 1, 1, 1, 1, 1, 1, 1, {}});
      GaussianBatch<T> gradient;
      gradient.resize(40);
      gradient.set_zero();
      std::vector<T> norm(40, T(-1));
      const GaussianColumns<const T> gaussians = std::as_const(bad.gaussians).columns();
      project_backward<accuracy::standard, T>(gaussians, bad.camera, {}, got.splats, sums, gradient.columns(), norm,
                                              serial);
      for (const T* column : testing::all_columns(gradient.columns())) {
        for (std::size_t i = 0; i < 40; ++i) {
          CHECK(std::isfinite(column[i]));
          if (got.splats.visible[i] == 0) CHECK(column[i] == T(0));
        }
      }
      for (std::size_t i = 0; i < 40; ++i) CHECK(norm[i] >= T(0));
    }
  }
}

TEST_CASE("raster/project: a non-finite colour is black, a huge one is clamped, neither moves (BF9)") {
  RasterScene<float> scene = single(3.0f, 0.1f, 0.8f);
  const GaussianColumns<float> g = scene.gaussians.columns();
  g.color[0][0] = std::numeric_limits<float>::infinity();
  g.color[1][0] = 1e30f;
  const auto got = run(scene);
  CHECK(got.report.scrubbed == 1);
  CHECK(got.splats.splats[0].red == 0);
  CHECK(got.splats.splats[0].green == 100);
  // Negative control: blended as it is, with a weight of 0.
  const float weight = 0, pixel = 0.5f + weight * g.color[0][0];
  CHECK(std::isnan(pixel));
}

TEST_CASE("raster/project: opacities at and above the cut-off survive, those below do not (TB8, TB9)") {
  const float cut = 1.0f / 255.0f;
  const auto visible = [](float opacity) { return run(single(3.0f, 0.1f, opacity)).splats.count; };
  for (const float opacity :
       {0.0f, -0.0f, -0.5f, std::nextafter(cut, 0.0f), std::nanf(""), std::numeric_limits<float>::denorm_min()}) {
    CHECK(visible(opacity) == 0);
  }
  // Negative controls: the half-width of an opacity below the cut-off is no number (TB8), and other ways to ask for "above
  // 0" let through what is not (TB9).
  CHECK(std::isnan(std::sqrt(2 * std::log(255 * std::nextafter(cut, 0.0f)))));
  for (const float opacity : {0.0f, -0.0f}) CHECK(opacity >= 0);
  CHECK_FALSE(std::nanf("") < 0);
  for (const float opacity : {cut, std::nextafter(cut, 1.0f), 0.5f, 1.0f}) CHECK(visible(opacity) == 1);
  CHECK(run<accuracy::inria>(single(3.0f, 0.1f, 0.5f * cut)).splats.count ==
        1);  // the published rule does not look at the opacity
  CHECK(run<accuracy::inria>(single(3.0f, 0.1f, 0.0f)).splats.count == 0);
}

TEST_CASE("raster/project: depth order, ties by index, source and place inverse to each other (TB4)") {
  RasterScene<float> scene = raster_scene<float>(6, 500, 64, 48);
  for (std::size_t i = 0; i < 500; ++i) {
    float& z = scene.gaussians.columns().mean[2][i];
    z = std::round(z * 4) / 4;
  }
  const auto got = run(scene);
  const auto& splats = got.splats;
  std::size_t visible = 0;
  for (std::size_t i = 0; i < splats.count; ++i) {
    const std::uint32_t place = splats.place[splats.source[i]];
    CHECK((place & ~ProjectedSplats<float>::pivot_bit) == i);
    CHECK(((place & ProjectedSplats<float>::pivot_bit) != 0) == (splats.splats[i].pivot_x == 1));
    if (i == 0) continue;
    CHECK(splats.splats[i - 1].depth <= splats.splats[i].depth);
    if (splats.splats[i - 1].depth == splats.splats[i].depth) CHECK(splats.source[i - 1] < splats.source[i]);
  }
  for (const std::uint8_t flag : splats.visible) visible += flag;
  CHECK(visible == splats.count);
  CHECK(got.report.visible == splats.count);
}

TEST_CASE("raster/project: the same bits at any thread count, the same splats at any pack width") {
  const RasterScene<float> scene = raster_scene<float>(7, 9001, 200, 150);
  const auto expected = run(scene);
  for (const std::size_t threads : {2u, 4u, 8u}) {
    ThreadExecutor executor(threads);
    CHECK(same_splats(run(scene, executor), expected));
  }
  const auto close = [&](const Projected<float>& got) {
    REQUIRE(got.splats.count == expected.splats.count);
    for (std::size_t i = 0; i < got.splats.count; ++i) {
      const auto a = values(got.splats.splats[i]), b = values(expected.splats.splats[i]);
      if (a[5] != b[5]) continue;  // the pivot may differ where the two variances are equal but for the rounding
      for (std::size_t f = 0; f < 14; ++f) CHECK(std::abs(a[f] - b[f]) <= 2e-5f * (1 + std::abs(b[f])));
    }
  };
  close(run<accuracy::standard, 1>(scene));
  close(run<accuracy::standard, 4>(scene));
  close(run<accuracy::standard, 8>(scene));
}

TEST_CASE_TEMPLATE("raster/project: streaming stores write the same splats", T, float, double) {
  const RasterScene<T> scene = raster_scene<T>(11, 3000, 200, 150);
  const auto expected = run(scene);
  auto got = run(scene);
  std::memset(got.splats.splats.data(), 0, got.splats.count * sizeof(Splat<T>));
  const detail::PinholeView<T> view(scene.camera);
  const GaussianColumns<const T> gaussians = scene.gaussians.columns();
  constexpr int W = native_width<T>;
  detail::write_splats<accuracy::standard, true, T, W>(gaussians, view, ProjectionSettings<T>{}, 0, 3000, got.splats);
  CHECK(same_splats(got, expected));
}

TEST_CASE("raster/project: no Gaussian, and none visible (TB10)") {
  RasterScene<float> scene = raster_scene<float>(8, 20, 64, 48);
  for (std::size_t i = 0; i < 20; ++i) scene.gaussians.columns().mean[2][i] = -3;
  CHECK(run(scene).splats.count == 0);
  scene.gaussians.resize(0);
  CHECK(run(scene).splats.count == 0);
}

TEST_CASE("raster/project: the published radius (docs/spec/method.md, 2.1, step 7)") {
  const RasterScene<double> scene = raster_scene<double>(9, 200, 128, 96);
  const auto got = run<accuracy::inria>(scene);
  for (std::size_t i = 0; i < got.splats.count; ++i) {
    const Splat<double>& s = got.splats.splats[i];
    // Back from the conditional form to a, b, c.
    const double pivot = 1 / (2 * s.minor), det = pivot / (2 * s.major), b = s.slope * pivot,
                 other = (det + b * b) / pivot;
    const double middle = (pivot + other) / 2,
                 radius = std::ceil(3 * std::sqrt(middle + std::sqrt(std::max(0.1, middle * middle - det))));
    CHECK(std::abs(s.half_width - radius) <= 1);  // ceil of a value that may sit on an integer
    CHECK(s.half_width == std::round(s.half_width));
    CHECK(s.half_height == s.half_width);
  }
}
