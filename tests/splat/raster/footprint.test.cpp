// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/raster/footprint.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace {

using F = Pack<float, 1>;
using L = Pack<long double, 1>;

struct Sample {
  Camera<float> camera;
  std::array<float, 3> mean, scale;
  std::array<float, 4> rotation;
};

/// Scales 1e-7 … 3 and depths 0.3 … 30, both log-uniform: the range of docs/spec/numerics.md, CV1.
Sample sample(std::uint64_t i) {
  const Random random(3, 0, random_stage("test/footprint"));
  const auto uniform = [&](std::uint64_t k) { return random.uniform(16 * i + k); };
  const auto log_uniform = [&](std::uint64_t k, double low, double high) {
    return std::exp(std::log(low) + (std::log(high) - std::log(low)) * uniform(k));
  };
  Sample s;
  s.camera.width = 800;
  s.camera.height = 600;
  s.camera.fx = s.camera.fy = 700;
  s.camera.cx = 400;
  s.camera.cy = 300;
  const double z = log_uniform(0, 0.3, 30);
  s.mean = {static_cast<float>(z * (uniform(1) - 0.5)), static_cast<float>(z * (uniform(2) - 0.5)),
            static_cast<float>(z)};
  for (std::size_t k = 0; k < 3; ++k) s.scale[k] = static_cast<float>(log_uniform(3 + k, 1e-7, 3));
  double norm = 0;
  std::array<double, 4> q{};
  for (std::size_t k = 0; k < 4; ++k) {
    q[k] = random.normal(16 * i + 8 + k);
    norm += q[k] * q[k];
  }
  for (std::size_t k = 0; k < 4; ++k) s.rotation[k] = static_cast<float>(q[k] / std::sqrt(norm));
  return s;
}

/// V in the scalar of the pack, from the float sample.
template <class P>
std::array<P, 6> axes_of(const Sample& s) {
  using T = typename P::Scalar;
  const detail::PinholeView<T> view(s.camera.cast<T>());
  std::array<P, 3> mean, scale;
  std::array<P, 4> rotation;
  for (std::size_t k = 0; k < 3; ++k) mean[k] = P(static_cast<T>(s.mean[k]));
  for (std::size_t k = 0; k < 3; ++k) scale[k] = P(static_cast<T>(s.scale[k]));
  for (std::size_t k = 0; k < 4; ++k) rotation[k] = P(static_cast<T>(s.rotation[k]));
  const auto at = detail::camera_point<T, 1>(view, mean, T(0.01));
  return detail::screen_axes(detail::screen_jacobian<T, 1>(view, at), detail::quaternion_matrix(rotation), scale).v;
}

}  // namespace

TEST_CASE("raster/footprint: the determinant keeps its digits where a c - b^2 loses them all (CV1)") {
  double robust = 0, naive = 0;
  int not_positive = 0;
  for (std::uint64_t i = 0; i < 200000; ++i) {
    const Sample s = sample(i);
    const auto f = detail::footprint_of(axes_of<F>(s), 0.3f);
    const auto exact = detail::footprint_of(axes_of<L>(s), static_cast<long double>(0.3f));
    const double truth = static_cast<double>(exact.determinant.native);
    robust = std::max(robust, std::abs(static_cast<double>(f.determinant.native) - truth) / truth);
    const float a = f.variance_x.native, b = f.covariance.native, c = f.variance_y.native;
    const float ac = a * c, bb = b * b;
    naive = std::max(naive, std::abs(static_cast<double>(ac - bb) - truth) / truth);
    if (!(f.determinant.native > 0)) ++not_positive;
  }
  MESSAGE("largest relative error: robust ", robust, ", a c - b^2 ", naive);
  CHECK(robust <= 5e-4);  // measured 3.7e-5
  CHECK(not_positive == 0);
  CHECK(naive > 1e-2);  // negative control
}

TEST_CASE(
    "raster/footprint: the conditional exponent is right for thin splats where the conic is not, and never negative "
    "(CV2)") {
  const Random random(5, 0, random_stage("test/exponent"));
  double robust = 0, naive = 0;
  int negative = 0;
  for (std::uint64_t i = 0; i < 200000; ++i) {
    // A tilted ellipse: standard deviations 1 … 1000 px by 0 … 0.5 px, plus the blur: variance ratios up to 1e6.
    const double angle = 6.283185307179586 * random.uniform(8 * i), wide = std::exp(6.9 * random.uniform(8 * i + 1));
    const double thin = 0.5 * random.uniform(8 * i + 2);
    std::array<F, 6> v;
    std::array<L, 6> exact_v;
    const std::array<double, 6> values{wide * std::cos(angle), -thin * std::sin(angle), 0,
                                       wide * std::sin(angle), thin * std::cos(angle),  0};
    for (std::size_t k = 0; k < 6; ++k) {
      v[k] = F(static_cast<float>(values[k]));
      exact_v[k] = L(static_cast<long double>(static_cast<float>(values[k])));
    }
    const auto f = detail::footprint_of(v, 0.3f);
    const auto exact = detail::footprint_of(exact_v, static_cast<long double>(0.3f));
    // A point of the ellipse, up to 3.3 standard deviations out along its axes.
    const double p = 3.3 * (2 * random.uniform(8 * i + 3) - 1) * std::sqrt(wide * wide + 0.3);
    const double q = 3.3 * (2 * random.uniform(8 * i + 4) - 1) * std::sqrt(thin * thin + 0.3);
    const auto dx = static_cast<float>(p * std::cos(angle) - q * std::sin(angle)),
               dy = static_cast<float>(p * std::sin(angle) + q * std::cos(angle));
    const float a = f.pivot_x.native ? dy : dx, b = f.pivot_x.native ? dx : dy;
    const float w = a - f.slope.native * b;
    const float sigma = f.major.native * w * w + f.minor.native * b * b;
    const long double ex = dx, ey = dy;
    const long double truth = (exact.variance_y.native * ex * ex + exact.variance_x.native * ey * ey -
                               2 * exact.covariance.native * ex * ey) /
                              (2 * exact.determinant.native);
    const float det = f.determinant.native;
    const float conic = 0.5f * (f.variance_y.native / det * dx * dx + f.variance_x.native / det * dy * dy) -
                        f.covariance.native / det * dx * dy;
    const double alpha = std::exp(-static_cast<double>(truth));
    robust = std::max(robust, std::abs(std::exp(-static_cast<double>(sigma)) - alpha));
    naive = std::max(naive, std::abs(std::exp(-static_cast<double>(conic)) - alpha));
    if (!(sigma >= 0)) ++negative;
  }
  MESSAGE("largest error of alpha: conditional ", robust, ", conic ", naive);
  CHECK(robust <= 1e-4);  // measured 3.6e-5; what the rounding of dx and of the slope leaves
  CHECK(negative == 0);
  CHECK(naive > 1e-2);  // negative control: measured 3.2e-2
}

TEST_CASE("raster/footprint: rank-deficient Gaussians have the determinants of the closed form (CV7)") {
  Sample s = sample(1);
  const float e = 0.3f;
  const auto footprint = [&](float a, float b, float c) {
    s.scale = {a, b, c};
    return detail::footprint_of(axes_of<F>(s), e);
  };
  const float unit = 4 * std::numeric_limits<float>::epsilon();
  const auto point = footprint(0, 0, 0);
  CHECK(std::abs(point.determinant.native - e * e) <= unit * e * e);
  const auto needle = footprint(1, 0, 0);  // e (trace + e), the trace being that of V V^T
  const float trace = needle.variance_x.native + needle.variance_y.native - 2 * e;
  CHECK(needle.determinant.native == doctest::Approx(e * (trace + e)).epsilon(1e-5));
  const auto disc = footprint(1, 1, 0);
  CHECK(disc.determinant.native > needle.determinant.native);
  for (const auto& f : {point, needle, disc}) {
    CHECK(std::isfinite(f.slope.native));
    CHECK(std::isfinite(f.major.native));
    CHECK(std::isfinite(f.minor.native));
  }
  // Negative control: the inverse of the covariance in space has 1 / scale^2, and a direction within the disc none of it.
  CHECK_FALSE(std::isfinite(0.0f * (1 / (s.scale[2] * s.scale[2]))));
}

TEST_CASE(
    "raster/footprint: limits of the Jacobian follow the principal point, 1.3 tan(fov/2) when it is central (PR4)") {
  Camera<double> camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 500;
  camera.fy = 510;
  camera.cx = 320;
  camera.cy = 240;
  const detail::PinholeView<double> central(camera);
  CHECK(central.x_high == doctest::Approx(1.3 * 320 / 500).epsilon(1e-14));
  CHECK(central.x_low == doctest::Approx(-1.3 * 320 / 500).epsilon(1e-14));
  CHECK(central.y_high == doctest::Approx(1.3 * 240 / 510).epsilon(1e-14));
  camera.cx = 0;  // the right half of a camera twice as wide: its left edge is the optical axis
  const detail::PinholeView<double> half(camera);
  CHECK(half.x_low == doctest::Approx(-0.3 * 320 / 500).epsilon(1e-14));
  CHECK(half.x_high == doctest::Approx(640.0 / 500 + 0.3 * 320 / 500).epsilon(1e-14));
  // Negative control: limits that are symmetric about the axis end within this image.
  CHECK(central.x_high < (camera.width - camera.cx) / camera.fx);
}

TEST_CASE("raster/footprint: q and -q have one matrix, to the bit (QU4)") {
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const Sample s = sample(i);
    std::array<F, 4> q, opposite;
    for (std::size_t k = 0; k < 4; ++k) {
      q[k] = F(s.rotation[k]);
      opposite[k] = F(-s.rotation[k]);
    }
    const auto a = detail::quaternion_matrix(q), b = detail::quaternion_matrix(opposite);
    for (std::size_t k = 0; k < 9; ++k) CHECK(a[k].native == b[k].native);
  }
}

TEST_CASE("raster/footprint: logarithm of positive floats within 1.5 ulp") {
  constexpr int W = native_width < float >> 1 ? native_width<float> : 4;
  double worst = 0;
  for (double x = 1.2e-38; x < 3e38; x *= 1.00037) {
    const auto f = static_cast<float>(x);
    const double expected = std::log(static_cast<double>(f));
    const double error = std::abs(static_cast<double>(detail::log_positive(Pack<float, W>(f)).lane(W - 1)) - expected);
    worst = std::max(worst, error / std::max(std::abs(expected), 0.01));
  }
  CHECK(worst <= 1.5 * 1.2e-7);
  CHECK(detail::log_positive(Pack<float, W>(1.0f)).lane(0) == 0.0f);
}

TEST_CASE("raster/footprint: no float becomes an index outside its range (TB1)") {
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float x :
       {-infinity, -1e38f, -1.0f, -0.0f, 0.0f, std::numeric_limits<float>::denorm_min(), std::nanf("")}) {
    CHECK(detail::clamp_to_index(x, 17) == 0);
  }
  for (const float x : {17.0f, 1e10f, 1e38f, infinity}) CHECK(detail::clamp_to_index(x, 17) == 17);
  CHECK(detail::clamp_to_index(16.99f, 17) == 16);
  const auto none = detail::tile_rectangle<FootprintRule::exact_tiles, 16>(std::nanf(""), 3.0f, 5.0f, 5.0f, 100, 100);
  CHECK(none.empty());
  const auto all = detail::tile_rectangle<FootprintRule::exact_tiles, 16>(3.0f, 3.0f, infinity, infinity, 100, 50);
  CHECK((all.x_begin == 0 && all.y_begin == 0 && all.x_end == 7 && all.y_end == 4));
  CHECK(std::isnan(std::min(std::max(std::nanf(""), 0.0f), 17.0f)));  // negative control: a clamp that keeps it
}

TEST_CASE("raster/footprint: the box holds every pixel centre that can reach alpha_min and little more (CV5)") {
  const Random random(9, 0, random_stage("test/box"));
  std::size_t beyond_three = 0;
  double largest_square = 0;
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const Sample s = sample(i);
    const auto f = detail::footprint_of(axes_of<F>(s), 0.3f);
    if (!(f.variance_x.native < 1600) || !(f.variance_y.native < 1600)) continue;
    const double opacity = random.uniform(i), sigma_max = std::log(opacity * 255);
    if (!(sigma_max > 0)) continue;
    const double reach = sigma_max * 2.0002 + 2e-5;
    const double x = std::sqrt(reach * static_cast<double>(f.variance_x.native)),
                 y = std::sqrt(reach * static_cast<double>(f.variance_y.native));
    double touched_x = 0, touched_y = 0;
    for (double t = 0; t < 6.283; t += 0.01) {  // the ellipse sigma = sigma_max, through the conditional form
      const double r = std::sqrt(sigma_max), w = r * std::cos(t) / std::sqrt(static_cast<double>(f.major.native));
      const double b = r * std::sin(t) / std::sqrt(static_cast<double>(f.minor.native)),
                   a = w + static_cast<double>(f.slope.native) * b;
      touched_x = std::max(touched_x, std::abs(f.pivot_x.native ? b : a));
      touched_y = std::max(touched_y, std::abs(f.pivot_x.native ? a : b));
    }
    CHECK(touched_x <= x);
    CHECK(touched_y <= y);
    CHECK(x <= touched_x * 1.001 + 0.02);
    CHECK(y <= touched_y * 1.001 + 0.02);
    // Negative controls: three standard deviations, and the square of the larger eigenvalue with the published floor under the root.
    const double a = static_cast<double>(f.variance_x.native), c = static_cast<double>(f.variance_y.native);
    beyond_three += touched_x > 3 * std::sqrt(a) ? 1 : 0;
    const double middle = (a + c) / 2, determinant = static_cast<double>(f.determinant.native);
    const double radius2 = 9 * (middle + std::sqrt(std::max(0.1, middle * middle - determinant)));
    largest_square = std::max(largest_square, radius2 / (x * y));
  }
  CHECK(beyond_three > 100);
  CHECK(largest_square > 10);
}
