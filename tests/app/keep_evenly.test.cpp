// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/detail/keep_evenly.hpp>
#include <cstddef>
#include <numeric>
#include <vector>

TEST_CASE("app/keep_evenly: as many as were asked for, in their order, from the first on, at even distances") {
  for (std::size_t all = 1; all <= 30; ++all) {
    for (std::size_t count = 1; count <= all; ++count) {
      std::vector<std::size_t> items(all);
      std::iota(items.begin(), items.end(), std::size_t{0});
      compmark::detail::keep_evenly(items, count);
      REQUIRE(items.size() == count);
      CHECK(items.front() == 0);
      for (std::size_t i = 1; i < count; ++i) {
        const std::size_t apart = items[i] - items[i - 1];
        CHECK((apart == all / count || apart == all / count + 1));
      }
    }
  }
  std::vector<int> some{3, 1, 2};
  compmark::detail::keep_evenly(some, 0);  // all
  CHECK(some == std::vector<int>{3, 1, 2});
  compmark::detail::keep_evenly(some, 7);
  CHECK(some == std::vector<int>{3, 1, 2});
}
