// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Windows of a run: at 30,000 iterations exactly the published ones (docs/spec/method.md, 4.2), counted by the
// published conditions.
#include "compmark/splat/optim/phases.hpp"

#include <doctest/doctest.h>

#include <initializer_list>

using namespace compmark;

TEST_CASE("optim/phases: at 30000 iterations each profile acts exactly when the published loop does") {
  const DensityPhases scaffold = DensityPhases::scaffold(30000);
  const DensityPhases hac = DensityPhases::hac(30000);
  const DensityPhases official = DensityPhases::official(30000);
  int scaffold_calls = 0, official_calls = 0, official_fag = 0;
  for (std::int64_t t = 1; t <= 30000; ++t) {
    const bool statistics = t > 500 && t < 15000;
    const bool gap = t >= 3000 && t < 4000;
    REQUIRE(scaffold.observes(t) == statistics);
    REQUIRE(official.observes(t) == statistics);  // the pause stops adjustments, not statistics
    REQUIRE(scaffold.adjusts(t) == (statistics && t > 1500 && t % 100 == 0));
    REQUIRE(hac.adjusts(t) == (statistics && t > 1500 && t % 100 == 0 && !gap));
    REQUIRE(official.adjusts(t) == (statistics && t % 100 == 0 && !gap));
    scaffold_calls += scaffold.adjusts(t) ? 1 : 0;
    official_calls += official.adjusts(t) ? 1 : 0;
    official_fag += official.adjusts(t) && t >= 10000 ? 1 : 0;
  }
  CHECK(scaffold_calls == 134);
  CHECK(official_calls == 24 + 60 + 50);
  CHECK(official_fag == 50);
}

TEST_CASE("optim/phases: a shorter run is the same recipe, its interval stays") {
  const DensityPhases phases = DensityPhases::scaffold(3000);
  CHECK_FALSE(phases.observes(50));
  CHECK(phases.observes(51));
  CHECK(phases.observes(1499));
  CHECK_FALSE(phases.observes(1500));
  int calls = 0;
  for (std::int64_t t = 1; t <= 3000; ++t) calls += phases.adjusts(t) ? 1 : 0;
  CHECK(calls == 13);  // 200, 300, … 1400
  CHECK(phases.adjusts(200));
  CHECK_FALSE(phases.adjusts(100));
}

TEST_CASE("optim/phases: scaling rounds to nearest, keeps the ends and never swaps two iterations") {
  for (const std::int64_t total : {1, 7, 100, 2999, 30000, 45000, 1000000}) {
    CHECK(scale_iteration(0, total) == 0);
    CHECK(scale_iteration(30000, total) == total);
    std::int64_t last = 0;
    for (std::int64_t t = 0; t <= 30000; t += 37) {
      const std::int64_t scaled = scale_iteration(t, total);
      REQUIRE(scaled >= last);
      REQUIRE(2 * 30000 * scaled <= 2 * t * total + 30000);
      REQUIRE(2 * 30000 * scaled > 2 * t * total - 30000);
      last = scaled;
    }
  }
  for (std::int64_t t = 0; t <= 30000; ++t) REQUIRE(scale_iteration(t, 30000) == t);
}

TEST_CASE("optim/phases: a window contains its begin and not its end, and fades in linearly") {
  const Window window{10, 20};
  CHECK_FALSE(window.contains(9));
  CHECK(window.contains(10));
  CHECK(window.contains(19));
  CHECK_FALSE(window.contains(20));
  CHECK(window.length() == 10);
  CHECK(window.progress(9) == 0);
  CHECK(window.progress(10) == 0);
  CHECK(window.progress(15) == 0.5);
  CHECK(window.progress(20) == 1);
  CHECK_FALSE(Window{}.contains(0));
  CHECK(Window{5, 3}.length() == 0);
}
