// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Schedules against the published numbers (docs/spec/method.md, 9) and against the float formula that drifts
// (docs/spec/numerics.md, OP5).
#include "compmark/splat/optim/schedule.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <initializer_list>

using namespace compmark;

static_assert(Schedule<Constant> && Schedule<LogLinear>);

TEST_CASE("optim/schedule: the published rates at the middle and at the end of the run") {
  const double extent = 4.7;
  const LogLinear offset{0.01 * extent, 0.0001 * extent, 30000};
  CHECK(offset.value(15000) == doctest::Approx(extent * 0.001).epsilon(1e-14));
  CHECK(LogLinear{0.008, 5e-5, 30000}.value(15000) == doctest::Approx(6.3246e-4).epsilon(1e-5));
  CHECK(LogLinear{0.008, 5e-5, 30000}.value(15000) == doctest::Approx(std::sqrt(0.008 * 5e-5)).epsilon(1e-14));
  CHECK(LogLinear{0.002, 0.00002, 30000}.value(15000) == doctest::Approx(2e-4).epsilon(1e-14));
  CHECK(offset.value(30000) == 0.0001 * extent);  // the ends are exact
  CHECK(LogLinear{0.008, 5e-5, 30000}.value(30000) == 5e-5);
  CHECK(LogLinear{0.008, 5e-5, 30000}.value(40000) == 5e-5);  // clipped
}

TEST_CASE("optim/schedule: equal ends are that rate exactly, zero stays zero") {
  const LogLinear constant{0.004, 0.004, 30000};
  const LogLinear never{0, 0, 30000};
  for (const std::int64_t t : {1, 2, 777, 15000, 29999, 30000}) {
    CHECK(constant.value(t) == 0.004);
    CHECK(never.value(t) == 0);
  }
  CHECK(Constant{0.007}.value(12345) == 0.007);
}

TEST_CASE("optim/schedule: equal steps change the rate by equal factors, and a shorter run is the same curve") {
  const LogLinear schedule{0.01, 0.0001, 30000};
  const LogLinear shorter{0.01, 0.0001, 3000};
  const double factor = std::pow(0.01, 1.0 / 30000);
  for (std::int64_t t = 1; t < 30000; t += 613) {
    CHECK(schedule.value(t + 1) / schedule.value(t) == doctest::Approx(factor).epsilon(1e-13));
  }
  for (std::int64_t t = 1; t < 3000; t += 61)
    CHECK(shorter.value(t) == doctest::Approx(schedule.value(10 * t)).epsilon(1e-14));
}

TEST_CASE("optim/schedule: negative control, the float power drifts (numerics OP5)") {
  const float power = std::pow(0.999f, 30000.0f);
  const double exact = std::exp(30000 * std::log(0.999));
  CHECK(std::abs(static_cast<double>(power) / exact - 1) > 1e-4);  // measured: 4e-4
  const LogLinear schedule{1, exact, 30000};
  CHECK(std::abs(schedule.value(29999) * 0.999 / exact - 1) < 1e-13);
}
