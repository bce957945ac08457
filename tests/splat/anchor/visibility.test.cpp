// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The prefilter against the published formulas in plain double, and the cases PR1, PR2, PR4, PR7 of
// docs/spec/numerics.md.
#include "compmark/splat/anchor/visibility.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/gaussians.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/scene/lens_policy.hpp"
#include "compmark/splat/raster/tile.hpp"

namespace {

using namespace compmark;

template <class T>
struct Cloud {
  std::vector<T> position, scaling;
  explicit Cloud(std::size_t n, double spread = 3, std::uint64_t seed = 1) : position(3 * n), scaling(6 * n) {
    const Random random(seed, 0, 0);
    // Rounded to float, so that float and double see the same cloud.
    for (std::size_t i = 0; i < 3 * n; ++i) position[i] = static_cast<T>(static_cast<float>(spread * random.normal(i)));
    for (std::size_t i = 0; i < 6 * n; ++i)
      scaling[i] = static_cast<T>(static_cast<float>(-3 + random.normal((1u << 30) + i)));
  }
  std::size_t size() const { return position.size() / 3; }
  AnchorColumns<const T> columns() const {
    AnchorColumns<const T> c;
    c.position = {position.data(), size(), 3};
    c.scaling = {scaling.data(), size(), 6};
    return c;
  }
};

template <class T>
Camera<T> test_camera() {
  Camera<T> camera;
  camera.width = 200;
  camera.height = 150;
  camera.fx = T(180);
  camera.fy = T(175);
  camera.cx = T(100);
  camera.cy = T(75);
  camera.center_world = {0.5, -0.25, -4};
  // Rotation of the unit quaternion (w, x, y, z) = (0.9, 0.1, -0.4, 0.1414…).
  const double w = 0.9, x = 0.1, y = -0.4, z = std::sqrt(1 - 0.81 - 0.01 - 0.16);
  const std::array<double, 9> r{1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                                2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                                2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  for (std::size_t i = 0; i < 9; ++i) camera.rotation_camera_world[i] = static_cast<T>(r[i]);
  return camera;
}

/// The published test of one anchor, literally (docs/spec/method.md, 2.1), identity rotation; principal point at the
/// image centre.
bool published_visible(const Camera<double>& camera, const double* position, const double* log_scale,
                       double near_plane) {
  double t[3] = {};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      t[i] += camera.rotation_camera_world[3 * i + j] * (position[j] - camera.center_world[j]);
  }
  if (t[2] <= near_plane) return false;
  const double tan_x = camera.width / (2 * camera.fx), tan_y = camera.height / (2 * camera.fy);
  const double tx = std::min(1.3 * tan_x, std::max(-1.3 * tan_x, t[0] / t[2])) * t[2];
  const double ty = std::min(1.3 * tan_y, std::max(-1.3 * tan_y, t[1] / t[2])) * t[2];
  const double j[2][3] = {{camera.fx / t[2], 0, -camera.fx * tx / (t[2] * t[2])},
                          {0, camera.fy / t[2], -camera.fy * ty / (t[2] * t[2])}};
  double c[2][2] = {};
  for (std::size_t a = 0; a < 2; ++a) {
    for (std::size_t b = 0; b < 2; ++b) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        double pa = 0, pb = 0;
        for (std::size_t i = 0; i < 3; ++i) {
          pa += j[a][i] * camera.rotation_camera_world[3 * i + axis];
          pb += j[b][i] * camera.rotation_camera_world[3 * i + axis];
        }
        c[a][b] += pa * pb * std::exp(2 * log_scale[axis]);
      }
    }
  }
  c[0][0] += 0.3;
  c[1][1] += 0.3;
  const double det = c[0][0] * c[1][1] - c[0][1] * c[0][1];
  const double mid = 0.5 * (c[0][0] + c[1][1]);
  const double radius = std::ceil(3 * std::sqrt(mid + std::sqrt(std::max(0.1, mid * mid - det))));
  const double pixel[2] = {camera.fx * t[0] / t[2] + camera.cx - 0.5, camera.fy * t[1] / t[2] + camera.cy - 0.5};
  const int tiles[2] = {(camera.width + 15) / 16, (camera.height + 15) / 16};
  for (std::size_t i = 0; i < 2; ++i) {
    const double low = std::min<double>(tiles[i], std::max(0.0, std::trunc((pixel[i] - radius) / 16)));
    const double high = std::min<double>(tiles[i], std::max(0.0, std::trunc((pixel[i] + radius + 15) / 16)));
    if (low >= high) return false;
  }
  return true;
}

template <class T, int W = native_width<T>, class Lens = PinholeLens>
std::vector<std::uint32_t> visible_of(const AnchorColumns<const T>& columns, const Camera<T>& camera,
                                      const VisibilitySettings& settings = {}, const Lens& lens = {}) {
  Buffer<std::uint32_t> visible;
  VisibilityWorkspace workspace;
  SerialExecutor executor;
  visible_anchors<T, W>(columns, camera, settings, visible, workspace, executor, lens);
  return {visible.begin(), visible.end()};
}

/// Visibility of one anchor straight ahead of a plain camera at the origin.
bool sees(std::array<float, 3> position, std::array<float, 3> log_scale = {-3, -3, -3}) {
  Cloud<float> cloud(1);
  for (std::size_t i = 0; i < 3; ++i) {
    cloud.position[i] = position[i];
    cloud.scaling[i] = log_scale[i];
  }
  Camera<float> camera;
  camera.width = camera.height = 64;
  camera.fx = camera.fy = 60;
  camera.cx = camera.cy = 32;
  return !visible_of<float>(cloud.columns(), camera).empty();
}

}  // namespace

TEST_CASE("anchor/visibility: the published set, at any number of anchors and lanes") {
  const Camera<double> camera = test_camera<double>();
  for (const std::size_t n : {0u, 1u, 7u, 16u, 17u, 5000u}) {
    const Cloud<double> cloud(n);
    std::vector<std::uint32_t> expected;
    for (std::uint32_t i = 0; i < n; ++i) {
      if (published_visible(camera, cloud.position.data() + 3 * i, cloud.scaling.data() + 6 * i, 0.2))
        expected.push_back(i);
    }
    CHECK(visible_of<double>(cloud.columns(), camera) == expected);
    CHECK(visible_of<double, 1>(cloud.columns(), camera) == expected);
    const Cloud<float> rounded(n);
    const std::vector<std::uint32_t> in_float = visible_of<float>(rounded.columns(), test_camera<float>());
    CHECK(in_float == visible_of<float, 1>(rounded.columns(), test_camera<float>()));
    // A radius or tile border that falls on an integer may round to the other side in float: at most one in a thousand.
    std::size_t different = 0;
    std::vector<int> seen(n, 0);
    for (const std::uint32_t i : expected) seen[i] ^= 1;
    for (const std::uint32_t i : in_float) seen[i] ^= 1;
    for (const int one : seen) different += one != 0 ? 1u : 0u;
    CHECK(different * 1000 <= n);
    if (n == 5000) {
      CHECK(expected.size() > 500);
      CHECK(expected.size() < 4000);
    }
  }
}

TEST_CASE("anchor/visibility: the same list at any thread count") {
  const Cloud<float> cloud(20011);
  const std::vector<std::uint32_t> expected = visible_of<float>(cloud.columns(), test_camera<float>());
  for (const std::size_t threads : {2u, 4u}) {
    ThreadExecutor executor(threads);
    Buffer<std::uint32_t> visible;
    VisibilityWorkspace workspace;
    visible_anchors(cloud.columns(), test_camera<float>(), {}, visible, workspace, executor);
    CHECK(std::vector<std::uint32_t>(visible.begin(), visible.end()) == expected);
  }
}

TEST_CASE("anchor/visibility: at and behind the near plane nothing is visible (PR1)") {
  for (const float z : {-1.0f, -0.0f, 0.0f, 1e-30f, 0.2f, std::numeric_limits<float>::quiet_NaN(),
                        -std::numeric_limits<float>::infinity()}) {
    CAPTURE(z);
    CHECK_FALSE(sees({0, 0, z}));
  }
  CHECK(sees({0, 0, 0.2001f}));
}

TEST_CASE("anchor/visibility: giants and dwarfs ahead of the camera are visible (PR2), poisoned rows are not") {
  for (const float log_scale : {-30.0f, -10.0f, 0.0f, 10.0f, 20.0f, 30.0f, 40.0f, 80.0f}) {
    CAPTURE(log_scale);
    CHECK(sees({0, 0, 3}, {log_scale, log_scale, log_scale}));
    CHECK(sees({0, 0, 0.21f}, {log_scale, -log_scale, log_scale}));
  }
  // Negative control: the plain discriminant overflows there and the comparison with a NaN radius would drop the giant.
  const float variance = std::exp(2 * 40.0f) * 400;
  CHECK_FALSE(std::isfinite(variance * variance - variance * variance));
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                       -std::numeric_limits<float>::infinity()};
  for (const float value : bad) {
    for (std::size_t i = 0; i < 3; ++i) {
      std::array<float, 3> position{0, 0, 3}, log_scale{-3, -3, -3};
      position[i] = value;
      CHECK_FALSE(sees(position));
      log_scale[i] = value;
      CHECK_FALSE(sees({0, 0, 3}, log_scale));
    }
  }
}

TEST_CASE("anchor/visibility: beside the image nothing is visible unless its radius reaches in") {
  CHECK_FALSE(sees({3, 0, 3}));
  CHECK(sees({3, 0, 3}, {-0.5f, -0.5f, -0.5f}));
  CHECK_FALSE(sees({0, -30, 3}));
}

TEST_CASE("anchor/visibility: a crop sees what the whole image sees there (PR4)") {
  const Cloud<double> cloud(4000);
  const Camera<double> camera = test_camera<double>();
  const Camera<double> crop = camera.cropped(48, 32, 64, 48);
  const std::vector<std::uint32_t> whole = visible_of<double>(cloud.columns(), camera);
  const std::vector<std::uint32_t> part = visible_of<double>(cloud.columns(), crop);
  CHECK(part.size() > 100);
  CHECK(part.size() < whole.size());
  std::vector<bool> in_whole(4000, false);
  for (const std::uint32_t i : whole) in_whole[i] = true;
  // Inside the limits of the crop's own field of view the two Jacobians are the same, so that the footprints are too.
  const detail::VisibilityCamera<double> limits(crop, {});
  std::size_t inside = 0;
  for (const std::uint32_t i : part) {
    double t[3] = {};
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t j = 0; j < 3; ++j) {
        t[row] += camera.rotation_camera_world[3 * row + j] * (cloud.position[3 * i + j] - camera.center_world[j]);
      }
    }
    const double x = t[0] / t[2], y = t[1] / t[2];
    if (x < limits.least_x || x > limits.most_x || y < limits.least_y || y > limits.most_y) continue;
    ++inside;
    CHECK(in_whole[i]);
  }
  CHECK(inside > 50);
  // Negative control: limits symmetric about the axis, as published, do not even contain the crop's own image.
  CHECK(1.3 * crop.width / (2 * crop.fx) < std::max(crop.cx, crop.width - crop.cx) / crop.fx);
}

TEST_CASE("anchor/visibility: the set does not change far from the origin (PR7)") {
  Cloud<float> near(3000);
  for (float& x : near.position) x = std::round(x * 64) / 64;
  Cloud<float> far = near;
  Camera<float> camera = test_camera<float>(), far_camera = camera;
  camera.center_world = {0.503, -0.257, -4.001};
  for (std::size_t i = 0; i < 3; ++i) far_camera.center_world[i] = camera.center_world[i] + 131072;
  for (float& x : far.position) x += 131072;  // exact: a multiple of 1/64
  CHECK(visible_of<float>(near.columns(), camera) == visible_of<float>(far.columns(), far_camera));
}

namespace {

/// Which anchors of a cloud the rasterizer draws, each taken as one upright Gaussian of its own scales. At an opacity
/// of 0.35 a Gaussian ends at 0.35 e^(-r^2 / 2) = 1/255, 2.996 standard deviations: within the published three.
template <class Lens>
std::vector<bool> drawn(const Cloud<float>& cloud, const Camera<float>& camera, const Lens& lens) {
  GaussianBatch<float> gaussians;
  gaussians.resize(cloud.size());
  gaussians.set_zero();
  const GaussianColumns<float> g = gaussians.columns();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      g.mean[k][i] = cloud.position[3 * i + k];
      g.scale[k][i] = std::exp(cloud.scaling[6 * i + k]);
    }
    g.rotation[0][i] = 1;
    g.opacity[i] = 0.35f;
  }
  using Raster = EffectTileRasterizer<float, RasterEffects<Lens>>;
  typename Raster::Settings settings;
  settings.lens = lens;
  const Raster raster(settings);
  typename Raster::Context context;
  std::vector<float> image(static_cast<std::size_t>(3 * camera.width * camera.height));
  SerialExecutor executor;
  raster.forward(std::as_const(gaussians).columns(), camera, {0, 0, 0},
                 ImageView<float>{image.data(), 3, camera.height, camera.width}, context, executor);
  std::vector<bool> result;
  for (const auto flag : raster.screen(context).visible) result.push_back(flag != 0);
  return result;
}

std::size_t missed(const std::vector<bool>& seen, const std::vector<std::uint32_t>& listed) {
  std::vector<bool> in_list(seen.size(), false);
  for (const std::uint32_t i : listed) in_list[i] = true;
  std::size_t count = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) count += seen[i] && !in_list[i] ? 1u : 0u;
  return count;
}

}  // namespace

TEST_CASE("anchor/visibility: through a lens nothing that is drawn is left out") {
  Camera<float> camera = test_camera<float>();
  camera.fx = camera.fy = 90;  // 96 degrees wide
  const Cloud<float> cloud(6000, 4);
  const auto check = [&](const auto& lens, const std::string& name) {
    CAPTURE(name);
    const std::vector<bool> seen = drawn(cloud, camera, lens);
    const std::vector<std::uint32_t> listed = visible_of<float>(cloud.columns(), camera, {}, lens);
    const std::vector<std::uint32_t> straight = visible_of<float>(cloud.columns(), camera);
    const auto count = static_cast<std::size_t>(std::count(seen.begin(), seen.end(), true));
    MESSAGE(name, ": ", count, " drawn, ", listed.size(), " listed, ", missed(seen, straight),
            " missed without the lens");
    CHECK(count > 1000);
    CHECK(missed(seen, listed) == 0);
    CHECK(missed(seen, straight) > 20);  // negative control
    CHECK(listed.size() < 2 * count);    // and it is still a filter
    CHECK(visible_of<float, 1>(cloud.columns(), camera, {}, lens) == listed);
  };
  check(*radial_tangential_lens<float>({LensModel::opencv, {-0.25, 0.08, 0.004, -0.003}}), "phone");
  check(*radial_tangential_lens<float>({LensModel::simple_radial, {-0.3}}), "barrel that folds at 46 degrees");
  check(*fisheye_lens<float>({LensModel::opencv_fisheye, {-0.03, 0.004, -0.001, 0.0002}}), "fisheye");
  // Zero coefficients: what the pinhole lists, and the ring of one pixel that its count of tiles misses.
  const std::vector<std::uint32_t> pinhole = visible_of<float>(cloud.columns(), camera),
                                   zero = visible_of<float>(cloud.columns(), camera, {}, RadialTangentialLens<float>{});
  CHECK(std::includes(zero.begin(), zero.end(), pinhole.begin(), pinhole.end()));
  CHECK(static_cast<double>(zero.size()) < 1.02 * static_cast<double>(pinhole.size()));
}

TEST_CASE("anchor/visibility: beyond the rays of a lens an anchor is seen by its size only, and poisoned rows never") {
  RadialTangentialLens<float> lens = *radial_tangential_lens<float>({LensModel::simple_radial, {-0.3f}});
  CHECK(std::sqrt(lens.limit2) == doctest::Approx(1.054).epsilon(1e-3));
  Camera<float> camera;
  camera.width = camera.height = 200;  // wider than the lens, which ends 0.70 * 90 = 63 pixels from the middle
  camera.fx = camera.fy = 90;
  camera.cx = camera.cy = 100;
  const auto sees_through = [&](std::array<float, 3> position, float log_scale) {
    Cloud<float> cloud(1);
    std::copy(position.begin(), position.end(), cloud.position.begin());
    std::fill(cloud.scaling.begin(), cloud.scaling.end(), log_scale);
    return !visible_of<float>(cloud.columns(), camera, {}, lens).empty();
  };
  CHECK(sees_through({3.1f, 0, 3}, -3));
  CHECK_FALSE(sees_through({4.5f, 0, 3}, -3));  // 1.5 is 40 pixels beyond 1.054, and the radius is 5
  CHECK(sees_through({4.5f, 0, 3}, 0));
  CHECK_FALSE(sees_through({1e30f, 0, 3}, -3));
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    CHECK_FALSE(sees_through({bad, 0, 3}, -3));
    CHECK_FALSE(sees_through({0, 0, 3}, bad));
  }
}
