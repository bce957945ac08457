// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/embed/view_costs.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <limits>
#include <vector>

using namespace compmark;

namespace {

std::vector<double> factors(const ViewCosts& costs, double share) {
  std::vector<double> factor{7};
  costs.factors(share, factor);
  return factor;
}

}  // namespace

TEST_CASE("embed/view_costs: a view is drawn as much oftener as it costs more, and none is forgotten") {
  ViewCosts costs;
  CHECK(factors(costs, 1).empty());
  costs.add(2, 4, 3);
  CHECK(factors(costs, 1) == std::vector<double>{1, 1, 1, 1});  // of what is not known, the mean
  costs.add(0, 4, 1);
  CHECK(factors(costs, 1) == std::vector<double>{0.5, 1, 1.5, 1});
  CHECK(factors(costs, 0) == std::vector<double>{1, 1, 1, 1});
  CHECK(factors(costs, 0.5) == std::vector<double>{0.75, 1, 1.25, 1});
  // A running mean: one cheap reading is a tenth of it.
  costs.add(2, 4, 0);
  CHECK(costs.mean[2] == doctest::Approx(2.7).epsilon(1e-14));
  // A reading that is no number says nothing.
  costs.add(2, 4, std::numeric_limits<double>::quiet_NaN());
  costs.add(3, 4, std::numeric_limits<double>::infinity());
  CHECK(costs.mean[2] == doctest::Approx(2.7).epsilon(1e-14));
  CHECK(costs.mean[3] == ViewCosts::unread);
  // What costs nothing any more is still drawn a twentieth as often as the mean; all of nothing, as often as by their clearance.
  ViewCosts cheap;
  cheap.add(0, 2, 0);
  CHECK(factors(cheap, 1) == std::vector<double>{1, 1});
  cheap.add(1, 2, 8);
  CHECK(factors(cheap, 1) == std::vector<double>{0.05, 2});
}
