// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which block trains how fast, and which does not.
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/pipeline/learning_rates.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/recipes/scaffold.hpp>

using namespace compmark;

TEST_CASE("pipeline/learning_rates: log-linear between the published ends, offsets and masks in units of the extent") {
  const TrainSettings settings;
  const double extent = 3;
  const auto rate = [&](const char* name, std::int64_t t) {
    return learning_rate<recipes::HacScaffold>(name, settings, extent, t);
  };
  // Method sheet, 3.2: 0.01 to 0.0001 times the extent; half-way in log space is the geometric mean.
  CHECK(rate("anchor.offset", 0) == doctest::Approx(0.03));
  CHECK(rate("anchor.offset", 15000) == doctest::Approx(0.003));
  CHECK(rate("anchor.offset", 30000) == doctest::Approx(0.0003));
  CHECK(rate("anchor.mask", 15000) == doctest::Approx(0.003));
  CHECK(rate("anchor.feature", 123) == 0.0075);
  CHECK(rate("mlp_color.0.weight", 30000) == doctest::Approx(0.00005));
}

TEST_CASE("pipeline/learning_rates: the context trains from where it begins, its constants never; positions never") {
  const TrainSettings settings;
  const auto rate = [&](const char* name, std::int64_t t) {
    return learning_rate<recipes::HacScaffold>(name, settings, 1.0, t);
  };
  for (const char* name : {"hash_grid", "context.0.weight", "context.2.bias"}) {
    CAPTURE(name);
    CHECK(rate(name, 10000) == 0);
    CHECK(rate(name, 10001) > 0);
    CHECK(rate(name, 30000) == doctest::Approx(0.00001));
  }
  for (const char* name : {"context.box", "context.statistics", "anchor.position", "nobody"})
    CHECK(rate(name, 20000) == 0);
  // A recipe without an entropy model knows none of these names.
  CHECK(learning_rate<recipes::Scaffold>("hash_grid", settings, 1.0, 20000) == 0);
  CHECK(learning_rate<recipes::Scaffold>("anchor.mask", settings, 1.0, 20000) == 0);
}
