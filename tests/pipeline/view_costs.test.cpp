// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/pipeline/view_costs.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <vector>

using namespace compmark;

TEST_CASE("pipeline/view_costs: a view is drawn as much oftener as it costs more, and none is forgotten") {
  ViewCosts costs;
  CHECK(costs.factors(1).empty());
  costs.add(2, 4, 3);
  CHECK(costs.factors(1) == std::vector<double>{1, 1, 1, 1});  // of what is not known, the mean
  costs.add(0, 4, 1);
  CHECK(costs.factors(1) == std::vector<double>{0.5, 1, 1.5, 1});
  CHECK(costs.factors(0) == std::vector<double>{1, 1, 1, 1});
  CHECK(costs.factors(0.5) == std::vector<double>{0.75, 1, 1.25, 1});
  // A running mean: one cheap reading is a tenth of it.
  costs.add(2, 4, 0);
  CHECK(costs.mean[2] == doctest::Approx(2.7).epsilon(1e-14));
  // What costs nothing any more is still drawn a twentieth as often as the mean; all of nothing, as often as by their room.
  ViewCosts cheap;
  cheap.add(0, 2, 0);
  CHECK(cheap.factors(1) == std::vector<double>{1, 1});
  cheap.add(1, 2, 8);
  CHECK(cheap.factors(1) == std::vector<double>{0.05, 2});
}
