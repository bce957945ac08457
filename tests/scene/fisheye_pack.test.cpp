// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/fisheye_pack.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

using namespace compmark;

TEST_CASE("scene/fisheye_pack: packs of floats agree with the policy in long double, from the axis to 89.8 degrees") {
  FisheyeLens<float> lens;
  lens.k1 = -0.03f;
  lens.k2 = 0.004f;
  lens.k3 = -0.001f;
  lens.k4 = 0.0002f;
  FisheyeLens<long double> exact;
  exact.k1 = static_cast<long double>(lens.k1);
  exact.k2 = static_cast<long double>(lens.k2);
  exact.k3 = static_cast<long double>(lens.k3);
  exact.k4 = static_cast<long double>(lens.k4);
  double value = 0, first = 0, second = 0;
  for (int i = 0; i <= 4000; ++i) {
    const double r = i == 0 ? 0 : std::pow(10.0, -5 + 7.4 * i / 4000);
    const float a = static_cast<float>(r * std::cos(0.1 * i)), b = static_cast<float>(r * std::sin(0.1 * i));
    const auto got = detail::plane_of(lens, Pack<float, 4>(a), Pack<float, 4>(b));
    const LensPlane<long double> want = exact.plane(static_cast<long double>(a), static_cast<long double>(b));
    const auto error = [](Pack<float, 4> x, long double y) { return static_cast<double>(std::abs(x.lane(2) - y)); };
    // Every derivative by the ray is compared on the scale of a turn of the ray: one power of (1 + r^2) a derivative.
    const double scale = 1 + r * r;
    value = std::max({value, error(got.u, want.u), error(got.v, want.v)});
    first = std::max(
        {first, scale * error(got.u_a, want.u_a), scale * error(got.u_b, want.u_b), scale * error(got.v_b, want.v_b)});
    second = std::max({second, scale * r * error(got.u_aa, want.u_aa), scale * r * error(got.u_ab, want.u_ab),
                       scale * r * error(got.u_bb, want.u_bb), scale * r * error(got.v_bb, want.v_bb)});
    if (r < 1) CHECK(error(got.u_aa, want.u_aa) + error(got.v_bb, want.v_bb) < 2e-5);
  }
  CHECK(value < 1e-6);    // 2.9e-7 measured
  CHECK(first < 1.5e-4);  // 6.2e-5 measured, at 89.8 degrees: there the scale is r of what rounding leaves
  CHECK(second < 5e-4);   // 2.0e-4 measured
}
