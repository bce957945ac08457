// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/raster/project_backward.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/raster_scene.hpp"

using namespace compmark;
using testing::raster_scene;
using testing::RasterScene;

namespace {

constexpr Accuracy published{.exp_degree = 0, .published_backward = true};
constexpr std::size_t probes = 6;

/// A loss that sees a splat through a few points around its mean, as pixels do: sum c_p opacity exp(-sigma(p)) +
/// colours and depth. The points stay where they are when the parameters move.
template <class T>
struct Probes {
  std::vector<std::array<T, 3>> point;  // [probes per Gaussian]: x, y, c
  static constexpr T color_weight = T(0.3), depth_weight = T(0.7);

  explicit Probes(const ProjectedSplats<T>& projected) : point(projected.gaussians * probes) {
    const Random random(17, 0, random_stage("test/probes"));
    for (std::size_t i = 0; i < projected.count; ++i) {
      const Splat<T>& s = projected.splats[i];
      for (std::size_t p = 0; p < probes; ++p) {
        // A point with sigma of order 1: d_b and w drawn on the scale of the splat.
        const auto draw = [&](std::size_t k) { return static_cast<T>(random.centered(i * 64 + p * 4 + k) * 2.5f); };
        const T b = draw(0) / std::sqrt(s.minor), a = draw(1) / std::sqrt(s.major) + s.slope * b;
        point[projected.source[i] * probes + p] = {s.u + (s.pivot_x != 0 ? b : a), s.v + (s.pivot_x != 0 ? a : b),
                                                   draw(2)};
      }
    }
  }

  /// The loss; with `sums`, the sums that the pixel loop would hand to backward.
  T operator()(const ProjectedSplats<T>& projected, std::vector<SplatGradient<T>>* sums = nullptr) const {
    T loss = 0;
    for (std::size_t i = 0; i < projected.count; ++i) {
      const Splat<T>& s = projected.splats[i];
      SplatGradient<T> sum{};
      for (std::size_t p = 0; p < probes; ++p) {
        const auto& [x, y, c] = point[projected.source[i] * probes + p];
        const T d_a = s.pivot_x != 0 ? y - s.v : x - s.u, d_b = s.pivot_x != 0 ? x - s.u : y - s.v;
        const T w = d_a - s.slope * d_b, g = c * s.opacity * std::exp(-(s.major * w * w + s.minor * d_b * d_b));
        loss += g;
        sum.g += g;
        sum.g_w += g * w;
        sum.g_b += g * d_b;
        sum.g_ww += g * w * w;
        sum.g_wb += g * w * d_b;
        sum.g_bb += g * d_b * d_b;
      }
      loss += color_weight * (s.red + 2 * s.green - s.blue) + depth_weight * s.depth;
      sum.red = color_weight;
      sum.green = 2 * color_weight;
      sum.blue = -color_weight;
      sum.depth = depth_weight;
      if (sums != nullptr) sums->push_back(sum);
    }
    return loss;
  }
};

template <class T>
struct Backward {
  GaussianBatch<T> gradient;
  std::vector<T> norm;
  std::vector<SplatGradient<T>> sums;
};

template <Accuracy accuracy, int W, class T>
ProjectedSplats<T> projected(const RasterScene<T>& scene, ProjectionSettings<T> settings) {
  SerialExecutor serial;
  ProjectedSplats<T> result;
  ProjectWorkspace<T> workspace;
  const GaussianColumns<const T> gaussians = scene.gaussians.columns();
  project<accuracy, T, W>(gaussians, scene.camera, settings, result, workspace, serial);
  return result;
}

/// One sum per splat, in depth order, to one per Gaussian; those of invisible ones are NaN, because nobody may use
/// them.
template <class T>
std::vector<SplatGradient<T>> by_gaussian(const ProjectedSplats<T>& splats, const std::vector<SplatGradient<T>>& sums) {
  constexpr T nan = std::numeric_limits<T>::quiet_NaN();
  std::vector<SplatGradient<T>> result(splats.gaussians, {nan, nan, nan, nan, nan, nan, nan, nan, nan, nan, {}});
  for (std::size_t i = 0; i < splats.count; ++i) result[splats.source[i]] = sums[i];
  return result;
}

template <Accuracy accuracy, int W, class T, Executor E>
Backward<T> backward(const RasterScene<T>& scene, const Probes<T>& loss, ProjectionSettings<T> settings, E& executor) {
  Backward<T> result;
  const ProjectedSplats<T> splats = projected<accuracy, W>(scene, settings);
  loss(splats, &result.sums);
  result.gradient.resize(scene.gaussians.size());
  result.gradient.set_zero();
  result.norm.assign(scene.gaussians.size(), T(-1));
  const GaussianColumns<const T> gaussians = scene.gaussians.columns();
  project_backward<accuracy, T, W>(gaussians, scene.camera, settings, splats, by_gaussian(splats, result.sums),
                                   result.gradient.columns(), result.norm, executor);
  return result;
}

/// The gradient law over all 14 columns, each relative to its own largest gradient. Empty when it holds.
template <Accuracy accuracy, int W>
std::string law(RasterScene<double>& scene, double tolerance, ProjectionSettings<double> settings = {}) {
  SerialExecutor serial;
  const Probes<double> loss(projected<accuracy, W>(scene, settings));
  const auto run = backward<accuracy, W>(scene, loss, settings, serial);
  const auto columns = testing::all_columns(scene.gaussians.columns());
  const auto gradients = testing::all_columns(run.gradient.columns());
  const std::size_t n = scene.gaussians.size();
  std::string broken;
  for (std::size_t c = 0; c < 14; ++c) {
    const std::string text =
        testing::gradient_law([&] { return loss(projected<accuracy, W>(scene, settings)); },
                              std::span<double>(columns[c], n), std::span<const double>(gradients[c], n), tolerance, n);
    if (!text.empty()) broken += "column " + std::to_string(c) + ": " + text + "\n";
  }
  return broken;
}

/// Some rotation for the camera, so that no axis is special.
template <class T>
void turn(Camera<T>& camera) {
  const double a = 0.3, b = -0.2;
  const std::array<double, 9> r{std::cos(a),
                                -std::sin(a) * std::cos(b),
                                std::sin(a) * std::sin(b),
                                std::sin(a),
                                std::cos(a) * std::cos(b),
                                -std::cos(a) * std::sin(b),
                                0,
                                std::sin(b),
                                std::cos(b)};
  for (std::size_t k = 0; k < 9; ++k) camera.rotation_camera_world[k] = static_cast<T>(r[k]);
  camera.center_world = {0.1, -0.2, -0.5};
}

}  // namespace

TEST_CASE("raster/project_backward: gradient law in double, one lane and eight (R2, CV3, CV4, CV8)") {
  RasterScene<double> scene = raster_scene<double>(1, 37, 120, 90);
  turn(scene.camera);
  // 1.3e-7 measured: the truncation of the central difference; the analytic gradient agrees to more digits than that.
  const std::string one = law<accuracy::spec, 1>(scene, 5e-7), eight = law<accuracy::spec, 8>(scene, 5e-7);
  CHECK_MESSAGE(one.empty(), one);
  CHECK_MESSAGE(eight.empty(), eight);
}

TEST_CASE("raster/project_backward: the derivative by the covariance is that of both entries off the diagonal (CV4)") {
  // sigma = (c x^2 + a y^2 - 2 b x y) / (2 (a c - b^2)); the axes have the covariance [a b; b c].
  const double a = 7, b = 2.5, c = 3, x = 1.3, y = -0.8, step = 1e-6;
  const auto sigma = [&](double off) { return (c * x * x + a * y * y - 2 * off * x * y) / (2 * (a * c - off * off)); };
  std::array<Pack<double, 1>, 6> axes;
  for (auto& value : axes) value = Pack<double, 1>(0.0);
  axes[0] = Pack<double, 1>(std::sqrt(a));
  axes[3] = Pack<double, 1>(b / std::sqrt(a));
  axes[4] = Pack<double, 1>(std::sqrt(c - b * b / a));
  const auto f = detail::footprint_of(axes, 0.0);
  REQUIRE(f.pivot_x.native);  // x is the wider axis
  const double w = y - f.slope.native * x;
  const double v_y = 2 * f.major.native * w, v_x = 2 * f.minor.native * x - f.slope.native * v_y;
  const double slope = (sigma(b + step) - sigma(b - step)) / (2 * step);
  CHECK(-v_x * v_y == doctest::Approx(slope).epsilon(1e-8));
  CHECK(std::abs(-0.5 * v_x * v_y / slope - 1) > 0.4);  // negative control: one entry's share, taken for the whole
}

TEST_CASE("raster/project_backward: the clamp of the Jacobian is differentiated, on both sides of the limit (PR3)") {
  for (const double times : {0.5, 0.999, 1.001, 2.0}) {
    for (const double side : {-1.0, 1.0}) {
      for (const std::size_t axis : {std::size_t{0}, std::size_t{1}}) {
        RasterScene<double> scene = raster_scene<double>(2, 8, 120, 90);
        const detail::PinholeView<double> view(scene.camera);
        const double limit = axis == 0 ? (side > 0 ? view.x_high : view.x_low) : (side > 0 ? view.y_high : view.y_low);
        const GaussianColumns<double> g = scene.gaussians.columns();
        for (std::size_t i = 0; i < 8; ++i) {
          g.mean[axis][i] = times * limit * g.mean[2][i];
          for (std::size_t k = 0; k < 3; ++k) g.scale[k][i] *= 30;  // large enough to reach into the image
        }
        const auto seen = projected<accuracy::spec, 1>(scene, {});
        REQUIRE(seen.count >= 4);
        const std::string broken = law<accuracy::spec, 8>(scene, 1e-7);
        CHECK_MESSAGE(broken.empty(), broken);
        const std::string control = law<published, 8>(scene, 1e-4);  // negative control: the published factor 2
        CHECK(control.empty() == (times < 1));
      }
    }
  }
}

TEST_CASE(
    "raster/project_backward: gradients survive determinants from 1e-6 to 1e30, where the inverse gives zero (CV3)") {
  for (const double scale : {1e-5, 1e-2, 1.0, 1e3, 1e5}) {
    RasterScene<float> scene = raster_scene<float>(3, 16, 120, 90);
    for (std::size_t i = 0; i < 16; ++i) {
      for (std::size_t k = 0; k < 3; ++k) scene.gaussians.columns().scale[k][i] *= static_cast<float>(10 * scale);
    }
    SerialExecutor serial;
    const ProjectionSettings<float> settings{.blur_variance = 1e-3f};
    const Probes<float> loss(projected<accuracy::spec, 16>(scene, settings));
    const auto run = backward<accuracy::spec, 16>(scene, loss, settings, serial);
    const auto splats = projected<accuracy::spec, 16>(scene, settings);
    for (std::size_t i = 0; i < splats.count; ++i) {
      const double pivot = 1 / (2 * static_cast<double>(splats.splats[i].minor)),
                   det = pivot / (2 * static_cast<double>(splats.splats[i].major));
      float size = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const float d = run.gradient.columns().scale[k][splats.source[i]];
        CHECK(std::isfinite(d));
        size += std::abs(d);
      }
      CHECK(size > 0);
      if (scale == 1e5) {
        CHECK(det > 1e19);  // negative control: here 1 / (det^2 + 1e-7) in float is 1 / infinity
        const auto d = static_cast<float>(det);
        CHECK(1.0f / (d * d + 1e-7f) == 0.0f);
      }
    }
  }
}

TEST_CASE("raster/project_backward: float against double, condition numbers up to 1e6 (CV3)") {
  RasterScene<float> scene = raster_scene<float>(4, 500, 120, 90);
  for (std::size_t i = 0; i < 500; ++i) {
    scene.gaussians.columns().scale[0][i] = 0.3f;  // ~10 px against the blur's 0.55 px and 1e-3 of depth
    scene.gaussians.columns().scale[1][i] = 1e-4f;
  }
  SerialExecutor serial;
  RasterScene<double> exact = testing::cast_scene<double>(scene);
  const auto splats = projected<accuracy::spec, 8>(exact, {});
  const Probes<double> loss(splats);
  const auto expected = backward<accuracy::spec, 8>(exact, loss, {}, serial);
  // The sums, rounded, go into the float backward: only its own error is measured.
  const auto float_splats = projected<accuracy::spec, 16>(scene, {});
  std::vector<SplatGradient<float>> sums(float_splats.count);
  GaussianBatch<float> gradient;
  gradient.resize(500);
  gradient.set_zero();
  std::vector<char> comparable(500, 0);
  for (std::size_t i = 0; i < float_splats.count; ++i) {
    const std::uint32_t source = float_splats.source[i];
    if (splats.visible[source] == 0) continue;
    const std::uint32_t place = splats.place[source] & ~ProjectedSplats<double>::pivot_bit;
    if (splats.splats[place].pivot_x != static_cast<double>(float_splats.splats[i].pivot_x)) continue;
    const SplatGradient<double>& s = expected.sums[place];
    const auto f = [](double x) { return static_cast<float>(x); };
    sums[i] = {f(s.g),   f(s.g_w),   f(s.g_b),  f(s.g_ww),  f(s.g_wb), f(s.g_bb),
               f(s.red), f(s.green), f(s.blue), f(s.depth), {}};
    comparable[source] = 1;
  }
  const GaussianColumns<const float> gaussians = std::as_const(scene.gaussians).columns();
  project_backward<accuracy::spec, float>(gaussians, scene.camera, {}, float_splats, by_gaussian(float_splats, sums),
                                          gradient.columns(), {}, serial);
  const auto a = testing::all_columns(gradient.columns());
  const auto b = testing::all_columns(expected.gradient.columns());
  for (std::size_t c = 0; c < 14; ++c) {
    double difference = 0, size = 0;
    for (std::size_t i = 0; i < 500; ++i) {
      if (comparable[i] == 0) continue;
      difference += (static_cast<double>(a[c][i]) - b[c][i]) * (static_cast<double>(a[c][i]) - b[c][i]);
      size += b[c][i] * b[c][i];
    }
    CHECK(std::sqrt(difference / size) <= 1e-4);
  }
}

TEST_CASE("raster/project_backward: the norm for growing is that of (W/2 dL/du, H/2 dL/dv), zero where not visible") {
  RasterScene<double> scene = raster_scene<double>(5, 50, 120, 90);
  scene.gaussians.columns().mean[2][3] = -1;
  SerialExecutor serial;
  const auto splats = projected<accuracy::spec, 8>(scene, {});
  const Probes<double> loss(splats);
  const auto run = backward<accuracy::spec, 8>(scene, loss, {}, serial);
  CHECK(run.norm[3] == 0);
  for (std::size_t i = 0; i < splats.count; ++i) {
    const Splat<double>& s = splats.splats[i];
    const SplatGradient<double>& g = run.sums[i];
    const double a = 2 * s.major * g.g_w, b = 2 * s.minor * g.g_b - s.slope * a;
    const double u = s.pivot_x != 0 ? b : a, v = s.pivot_x != 0 ? a : b;
    CHECK(run.norm[splats.source[i]] == doctest::Approx(std::hypot(60 * u, 45 * v)).epsilon(1e-10));
  }
}

TEST_CASE("raster/project_backward: adds, leaves invisible rows alone, same bits at any thread count") {
  RasterScene<float> scene = raster_scene<float>(6, 7001, 120, 90);
  for (std::size_t i = 0; i < 7001; i += 5) scene.gaussians.columns().mean[2][i] = -1;
  SerialExecutor serial;
  const Probes<float> loss(projected<accuracy::spec, 16>(scene, {}));
  const auto expected = backward<accuracy::spec, 16>(scene, loss, {}, serial);
  for (const std::size_t threads : {2u, 4u}) {
    ThreadExecutor executor(threads);
    const auto run = backward<accuracy::spec, 16>(scene, loss, {}, executor);
    const auto a = testing::all_columns(run.gradient.columns()), b = testing::all_columns(expected.gradient.columns());
    std::size_t different = 0;
    for (std::size_t c = 0; c < 14; ++c) {
      for (std::size_t i = 0; i < 7001; ++i) different += a[c][i] == b[c][i] ? 0 : 1;
    }
    CHECK(different == 0);
  }
  GaussianBatch<float> twice = expected.gradient;
  const auto splats = projected<accuracy::spec, 16>(scene, {});
  const GaussianColumns<const float> gaussians = std::as_const(scene.gaussians).columns();
  project_backward<accuracy::spec, float>(gaussians, scene.camera, {}, splats, by_gaussian(splats, expected.sums),
                                          twice.columns(), {}, serial);
  const auto a = testing::all_columns(twice.columns());
  const auto b = testing::all_columns(expected.gradient.columns());
  std::size_t wrong = 0;
  for (std::size_t c = 0; c < 14; ++c) {
    for (std::size_t i = 0; i < 7001; ++i) wrong += a[c][i] == 2 * b[c][i] && (i % 5 != 0 || b[c][i] == 0) ? 0 : 1;
  }
  CHECK(wrong == 0);
}

TEST_CASE("raster/project_backward: GradientMode::set is add on cleared gradients, whatever was there before") {
  RasterScene<float> scene = raster_scene<float>(6, 1003, 120, 90);
  for (std::size_t i = 0; i < 1003; i += 5) scene.gaussians.columns().mean[2][i] = -1;
  for (std::size_t i = 320; i < 352; ++i) scene.gaussians.columns().mean[2][i] = -1;  // whole packs are invisible too
  SerialExecutor serial;
  const auto splats = projected<accuracy::spec, 16>(scene, {});
  const auto expected = backward<accuracy::spec, 16>(scene, Probes<float>(splats), {}, serial);
  GaussianBatch<float> set = expected.gradient;
  for (float& value : set.storage()) value = std::numeric_limits<float>::quiet_NaN();
  const GaussianColumns<const float> gaussians = std::as_const(scene.gaussians).columns();
  project_backward<accuracy::spec, float, 16, GradientMode::set>(
      gaussians, scene.camera, {}, splats, by_gaussian(splats, expected.sums), set.columns(), {}, serial);
  const auto a = testing::all_columns(set.columns());
  const auto b = testing::all_columns(expected.gradient.columns());
  // Two instantiations: the compiler may fuse a multiply-add in one and not in the other, so that the last bits differ.
  for (std::size_t c = 0; c < 14; ++c) {
    float largest = 0, difference = 0;
    bool zero = true;
    for (std::size_t i = 0; i < 1003; ++i) {
      largest = std::max(largest, std::abs(b[c][i]));
      difference = std::max(difference, std::isfinite(a[c][i]) ? std::abs(a[c][i] - b[c][i]) : 1e30f);
      if (splats.visible[i] == 0) zero = zero && a[c][i] == 0;
    }
    CAPTURE(c);
    CHECK(difference <= 1e-5f * largest);
    CHECK(zero);
  }
}
