// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/anchor/nearest_rows.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;

/// Places [rows, 3], coarse, so that distances are often equal, and places too.
struct CoarsePlaces {
  std::vector<float> storage;
  MatrixView<const float> view;
  CoarsePlaces(std::size_t rows, std::uint64_t seed) : storage(3 * rows) {
    const Random random(seed, 0, random_stage("test/nearest"));
    for (std::size_t i = 0; i < storage.size(); ++i) storage[i] = static_cast<float>(std::floor(4 * random.normal(i)));
    view = {storage.data(), rows, 3};
  }
};

}  // namespace

TEST_CASE("anchor/nearest_rows: the nearest are those that a search of all finds") {
  const CoarsePlaces places(300, 3);
  const auto nearest = nearest_rows(places.view, 9);
  for (std::uint32_t row = 0; row < 300; ++row) {
    std::vector<Neighbour> all;
    for (std::uint32_t other = 0; other < 300; ++other) {
      if (other != row) all.emplace_back(squared_distance(places.view, row, other), other);
    }
    std::sort(all.begin(), all.end());
    all.resize(9);
    CHECK(nearest[row] == all);
  }
  ThreadExecutor three(3);
  CHECK(nearest_rows(places.view, 9, three) == nearest);
}

TEST_CASE(
    "anchor/nearest_rows: the same places are found among others that are fewer, doubled and a little elsewhere") {
  constexpr std::uint32_t rows = 300;
  const CoarsePlaces places(rows, 4);
  // Every third is gone; the others come in the reverse order, moved by a third at most of what keeps two apart, with a
  // double farther off behind, and one that is no place.
  const Random random(9, 0, random_stage("test/moved"));
  std::vector<float> others;
  std::vector<std::uint32_t> kept;
  for (std::uint32_t row = rows; row-- > 0;) {
    if (row % 3 == 0) continue;
    kept.push_back(row);
    for (std::size_t axis = 0; axis < 3; ++axis)
      others.push_back(places.view(row, axis) + static_cast<float>(0.2 * (random.uniform(3 * row + axis) - 0.5)));
  }
  for (std::size_t i = 0; i < kept.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) others.push_back(others[3 * i + axis] + 0.4f);
  }
  others.insert(others.end(), 3, std::numeric_limits<float>::quiet_NaN());
  const MatrixView<const float> among{others.data(), others.size() / 3, 3};
  ThreadExecutor executor(3);
  const auto found = same_places(places.view, among, executor);
  const auto nearest = nearest_rows(places.view, 1);
  std::size_t unique = 0;
  for (std::uint32_t row = 0; row < rows; ++row) {
    // A search of all, as the sentence of same_places has it.
    std::optional<std::uint32_t> expected;
    double least = 0;
    for (std::uint32_t other = 0; other < among.rows; ++other) {
      double distance = 0;
      for (std::size_t axis = 0; axis < 3; ++axis)
        distance += std::pow(static_cast<double>(among(other, axis)) - static_cast<double>(places.view(row, axis)), 2);
      if (!(distance == 0 || distance < 0.25 * nearest[row].front().first)) continue;
      if (!expected || distance < least) expected = other, least = distance;
    }
    REQUIRE(found[row] == expected);
    if (nearest[row].front().first == 0) continue;  // two places in one: a moved one is neither's
    ++unique;
    CHECK(found[row].has_value() == (row % 3 != 0));
    if (found[row]) CHECK(kept[*found[row]] == row);
  }
  CHECK(unique > 100);
  SerialExecutor one_thread;
  CHECK(same_places(places.view, among, one_thread) == found);

  // A place alone is matched by whatever is nearest, and by nothing where there is nothing.
  const CoarsePlaces one(1, 5);
  CHECK(same_places(one.view, among, executor)[0].has_value());
  CHECK_FALSE(same_places(one.view, MatrixView<const float>{others.data(), 0, 3}, executor)[0].has_value());
}
