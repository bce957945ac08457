// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/math/pack.hpp>
#include <compmark/scene/lens_policy.hpp>
#include <compmark/testing/gradient.hpp>

#include <cmath>
#include <string>
#include <vector>

using namespace compmark;

namespace {

const Lens opencv{LensModel::opencv, {-0.2, 0.06, 0.002, -0.003}};
const Lens cubic{LensModel::full_opencv, {-0.2, 0.06, 0.002, -0.003, 0.01}};
const Lens kannala_brandt{LensModel::opencv_fisheye, {-0.03, 0.004, -0.001, 0.0002}};

/// Points in front of the camera: on the axis, around both borders of the fisheye's series (r = 1/4, 1/2), at the
/// image's edge.
const std::vector<std::array<double, 3>> lens_points{{0, 0, 2},        {1e-9, -2e-9, 1}, {0.1, -0.2, 2},
                                                     {0.2499, 0, 1},   {0.2501, 0, 1},   {0.3, 0.3999, 1},
                                                     {-0.9, 0.7, 1.3}, {120, -80, 200},  {3e-4, 4e-4, 1e-3}};

/// A projection, its Jacobian and its backward pass against central differences of a loss that reads both outputs.
template <class Policy>
void check(const Policy& policy, const Lens& lens) {
  const std::array<double, 2> g{0.7, -1.3};
  const std::array<double, 6> h{0.3, -0.2, 0.9, 1.1, 0.4, -0.6};
  for (std::array<double, 3> p : lens_points) {
    CAPTURE(p[0]);
    CAPTURE(p[2]);
    const std::array<double, 2> expected = distort(lens, p[0] / p[2], p[1] / p[2]);
    const std::array<double, 2> got = policy.project(p[0], p[1], p[2]);
    for (std::size_t i = 0; i < 2; ++i) CHECK(std::abs(got[i] - expected[i]) < 1e-15 * 4);
    const std::array<double, 6> jacobian = policy.jacobian(p[0], p[1], p[2]);
    // Lengths relative to z: the scene's unit must not matter (case PR8).
    const double z = p[2];
    std::array<double, 3> q{p[0] / z, p[1] / z, 1};
    for (std::size_t i = 0; i < 2; ++i) {
      const auto loss = [&] { return policy.project(q[0] * z, q[1] * z, q[2] * z)[i]; };
      const std::array<double, 3> row{jacobian[3 * i] * z, jacobian[3 * i + 1] * z, jacobian[3 * i + 2] * z};
      CHECK(testing::gradient_law(loss, q, row, 1e-8) == "");
    }
    const auto loss = [&] {
      const std::array<double, 2> u = policy.project(q[0] * z, q[1] * z, q[2] * z);
      const std::array<double, 6> j = policy.jacobian(q[0] * z, q[1] * z, q[2] * z);
      double sum = g[0] * u[0] + g[1] * u[1];
      for (std::size_t i = 0; i < 6; ++i) sum += h[i] * j[i] * z;
      return sum;
    };
    std::array<double, 6> scaled = h;
    for (double& v : scaled) v *= z;
    const std::array<double, 3> d = policy.backward(p[0], p[1], p[2], g, scaled);
    const std::array<double, 3> gradient{d[0] * z, d[1] * z, d[2] * z};
    CHECK(testing::gradient_law(loss, q, gradient, 1e-8) == "");  // measured: 1e-9
  }
}

}  // namespace

TEST_CASE("scene/lens_policy: projection, Jacobian and backward are those of central differences") {
  check(PinholeLens{}, Lens{});
  check(*radial_tangential_lens<double>(opencv), opencv);
  check(*radial_tangential_lens<double>(cubic), cubic);
  check(*radial_tangential_lens<double>(Lens{}), Lens{});
  check(*fisheye_lens<double>(kannala_brandt), kannala_brandt);
  check(*fisheye_lens<double>({LensModel::fisheye, {}}), {LensModel::fisheye, {}});
}

TEST_CASE("scene/lens_policy: the law notices a wrong second derivative") {
  // Negative control: the backward of a lens with another k2.
  const RadialTangentialLens<double> lens = *radial_tangential_lens<double>(opencv);
  RadialTangentialLens<double> wrong = lens;
  wrong.k2 *= 1.01;
  std::array<double, 3> p{0.4, 0.3, 1};
  const std::array<double, 6> h{1, 0, 0, 0, 1, 0};
  const auto loss = [&] {
    const std::array<double, 6> j = lens.jacobian(p[0], p[1], p[2]);
    return j[0] + j[4];
  };
  CHECK(testing::gradient_law(loss, p, lens.backward(p[0], p[1], p[2], {0, 0}, h), 1e-7) == "");
  CHECK(testing::gradient_law(loss, p, wrong.backward(p[0], p[1], p[2], {0, 0}, h), 1e-7) != "");
}

TEST_CASE("scene/lens_policy: no lens is the pinhole's arithmetic, and stores nothing") {
  CHECK(std::is_empty_v<PinholeLens>);
  const RadialTangentialLens<double> none;
  for (const auto& p : lens_points) {
    CHECK(PinholeLens{}.project(p[0], p[1], p[2]) == std::array<double, 2>{p[0] / p[2], p[1] / p[2]});
    CHECK(none.project(p[0], p[1], p[2]) == PinholeLens{}.project(p[0], p[1], p[2]));
    const double w = 1 / p[2];
    CHECK(PinholeLens{}.jacobian(p[0], p[1], p[2]) ==
          std::array<double, 6>{w, 0, -(p[0] * w) * w, 0, w, -(p[1] * w) * w});
  }
  CHECK(std::is_same_v<decltype(PinholeLens{}.inside(1.0, 2.0)), std::true_type>);
}

TEST_CASE("scene/lens_policy: packs and single precision agree with doubles") {
  using P = Pack<float, 4>;
  const FisheyeLens<float> fisheye = *fisheye_lens<float>(kannala_brandt);
  const RadialTangentialLens<float> radial = *radial_tangential_lens<float>(opencv);
  const FisheyeLens<double> fisheye_double = *fisheye_lens<double>(kannala_brandt);
  const RadialTangentialLens<double> radial_double = *radial_tangential_lens<double>(opencv);
  const std::array<float, 4> x{0.1f, 0.45f, -0.55f, 0.0f}, y{-0.2f, 0.3f, 0.6f, 0.0f}, z{1.0f, 1.0f, 1.2f, 2.0f};
  const std::array<P, 2> g{P(0.5f), P(-0.25f)};
  const std::array<P, 6> h{P(0.3f), P(-0.2f), P(0.9f), P(1.1f), P(0.4f), P(-0.6f)};
  const std::array<double, 6> h_double{0.3, -0.2, 0.9, 1.1, 0.4, -0.6};
  const auto compare = [&](const auto& single, const auto& real) {
    const P px = P::load(x.data()), py = P::load(y.data()), pz = P::load(z.data());
    const std::array<P, 2> u = single.project(px, py, pz);
    const std::array<P, 6> j = single.jacobian(px, py, pz);
    const std::array<P, 3> d = single.backward(px, py, pz, g, h);
    for (std::size_t i = 0; i < 4; ++i) {
      const int lane = static_cast<int>(i);
      const double dx = static_cast<double>(x[i]), dy = static_cast<double>(y[i]), dz = static_cast<double>(z[i]);
      for (std::size_t k = 0; k < 2; ++k)
        CHECK(std::abs(static_cast<double>(u[k].lane(lane)) - real.project(dx, dy, dz)[k]) < 3e-7);
      for (std::size_t k = 0; k < 6; ++k)
        CHECK(std::abs(static_cast<double>(j[k].lane(lane)) - real.jacobian(dx, dy, dz)[k]) < 2e-6);
      const std::array<double, 3> expected = real.backward(dx, dy, dz, {0.5, -0.25}, h_double);
      for (std::size_t k = 0; k < 3; ++k) CHECK(std::abs(static_cast<double>(d[k].lane(lane)) - expected[k]) < 1e-5);
    }
  };
  compare(fisheye, fisheye_double);
  compare(radial, radial_double);
}

TEST_CASE("scene/lens_policy: which lens is of which family, and where it ends") {
  CHECK(!radial_tangential_lens<double>(kannala_brandt));
  CHECK(!fisheye_lens<double>(opencv));
  CHECK(!radial_tangential_lens<double>({LensModel::full_opencv, {0, 0, 0, 0, 0, 0.1}}));
  CHECK(!fisheye_lens<double>({LensModel::thin_prism_fisheye, {}}));
  const RadialTangentialLens<double> folding = *radial_tangential_lens<double>({LensModel::simple_radial, {-0.1}});
  CHECK(folding.inside(1.82, 0.0));
  CHECK(!folding.inside(1.83, 0.0));
}
