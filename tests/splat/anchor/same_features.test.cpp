// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/anchor/same_features.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/anchor/reference_same_features.hpp"

namespace {

using namespace compmark;

struct FeatureRows {
  std::size_t rows, columns;
  std::vector<float> storage;
  [[nodiscard]] MatrixView<const float> view() const { return {storage.data(), rows, columns}; }
};

FeatureRows feature_rows(std::size_t rows, std::size_t columns, std::uint64_t seed,
                         const std::function<double(const Random&, std::size_t, std::size_t)>& number) {
  const Random random(seed, 0, random_stage("test/feature rows"));
  FeatureRows made{rows, columns, std::vector<float>(rows * columns)};
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t k = 0; k < columns; ++k)
      made.storage[row * columns + k] = static_cast<float>(number(random, row, k));
  }
  return made;
}

/// Every second row of another order, moved by normal numbers of `sigma`.
FeatureRows moved_half(const FeatureRows& of, double sigma) {
  const Random random(77, 0, random_stage("test/moved features"));
  FeatureRows made{0, of.columns, {}};
  for (std::size_t row = of.rows; row-- > 0;) {
    if (random.uniform(row) < 0.5) continue;
    for (std::size_t k = 0; k < of.columns; ++k) {
      const std::size_t at = row * of.columns + k;
      made.storage.push_back(of.storage[at] + static_cast<float>(sigma * random.normal(1'000'000 + at)));
    }
    ++made.rows;
  }
  return made;
}

/// How many are found; those of the reference, at any number of threads.
std::size_t check_same(const FeatureRows& one, const FeatureRows& among) {
  const auto expected = reference_same_features(one.view(), among.view());
  SerialExecutor serial;
  ThreadExecutor three(3);
  CHECK(same_features(one.view(), among.view(), serial) == expected);
  CHECK(same_features(one.view(), among.view(), three) == expected);
  return static_cast<std::size_t>(
      std::count_if(expected.begin(), expected.end(), [](const auto& other) { return other.has_value(); }));
}

}  // namespace

TEST_CASE("anchor/same_features: features find each other among many, and chance finds next to nobody") {
  constexpr std::size_t rows = 1500, columns = 12;  // more than one group of either
  ThreadExecutor executor(2);
  const Random random(6, 0, random_stage("test/features"));
  std::vector<float> one(rows * columns), among, chance(rows * columns);
  for (std::size_t i = 0; i < one.size(); ++i) {
    one[i] = static_cast<float>(5 + random.normal(i));
    chance[i] = static_cast<float>(5 + random.normal(1'000'000 + i));
  }
  // Every second is gone, the others are in the reverse order and a little different; one is no number.
  std::vector<std::size_t> kept;
  for (std::size_t row = rows; row-- > 0;) {
    if (row % 2 == 0) continue;
    kept.push_back(row);
    for (std::size_t k = 0; k < columns; ++k)
      among.push_back(one[row * columns + k] + static_cast<float>(0.1 * random.normal(2'000'000 + row * columns + k)));
  }
  among[0] = std::numeric_limits<float>::quiet_NaN();
  const MatrixView<const float> all{one.data(), rows, columns}, some{among.data(), kept.size(), columns};
  const auto found = same_features(all, some, executor);
  std::size_t right = 0;
  for (std::size_t row = 0; row < rows; ++row) {
    if (!found[row]) continue;
    CHECK(kept[*found[row]] == row);
    ++right;
  }
  CHECK(right >= kept.size() * 98 / 100);
  CHECK(right <= kept.size() - 1);  // without the one that is no number
  const auto back = same_features(some, all, executor);
  for (std::size_t row = 0; row < kept.size(); ++row) {
    if (back[row]) CHECK(*back[row] == kept[row]);
  }
  CHECK(std::count_if(back.begin(), back.end(), [](const auto& other) { return other.has_value(); }) >= 700);
  std::size_t by_chance = 0;
  for (const auto& other : same_features(all, MatrixView<const float>{chance.data(), rows, columns}, executor))
    by_chance += other.has_value() ? 1 : 0;
  CHECK(by_chance < rows / 20);
  MESSAGE(right, " of ", kept.size(), ", by chance ", by_chance);
}

TEST_CASE("anchor/same_features: those that the search of all pairs finds, of any rows") {
  const auto normal = [](const Random& random, std::size_t row, std::size_t k) { return random.normal(64 * row + k); };
  // Of few columns and more than there are axes; of less than a pack, a group and more.
  for (const std::size_t columns : {1u, 3u, 8u, 17u, 32u}) {
    for (const std::size_t rows : {1u, 15u, 256u, 700u}) {
      CAPTURE(columns);
      CAPTURE(rows);
      const FeatureRows one = feature_rows(rows, columns, 3, normal);
      check_same(one, moved_half(one, 0.1));
      check_same(moved_half(one, 0.6), one);
      CHECK(check_same(one, one) == rows);
      check_same(one, feature_rows(rows, columns, 4, normal));
    }
  }
  CHECK(check_same(feature_rows(0, 4, 1, normal), feature_rows(9, 4, 1, normal)) == 0);
  CHECK(check_same(feature_rows(9, 4, 1, normal), feature_rows(0, 4, 1, normal)) == 0);
  CHECK(check_same(feature_rows(9, 4, 1, normal), feature_rows(1, 4, 1, normal)) == 1);
  // More columns than axes are turned for.
  const FeatureRows wide = feature_rows(300, 140, 5, normal);
  CHECK(check_same(wide, moved_half(wide, 0.1)) > 100);
}

TEST_CASE("anchor/same_features: clusters, doubles, ties, and numbers of any size") {
  // Clusters a thousandth wide, each of some tens of rows.
  const FeatureRows clusters = feature_rows(600, 12, 6, [](const Random& random, std::size_t row, std::size_t k) {
    return random.normal(row % 20 * 64 + k) + 1e-3 * random.normal(100'000 + 64 * row + k);
  });
  CHECK(check_same(clusters, moved_half(clusters, 1e-4)) > 50);
  // Numbers of three values: most distances are equal to many, and rows too.
  const FeatureRows coarse = feature_rows(500, 4, 7, [](const Random& random, std::size_t row, std::size_t k) {
    return std::floor(3 * random.uniform(8 * row + k));
  });
  check_same(coarse, moved_half(coarse, 0));
  check_same(coarse, coarse);
  // Every row twice: nobody is much nearer than his double.
  const FeatureRows doubled = feature_rows(
      600, 9, 8, [](const Random& random, std::size_t row, std::size_t k) { return random.normal(row / 2 * 16 + k); });
  CHECK(check_same(doubled, doubled) == 0);
  // Doubles in `one` alone: the lower has the row.
  const FeatureRows single = feature_rows(
      300, 9, 8, [](const Random& random, std::size_t row, std::size_t k) { return random.normal(row * 16 + k); });
  CHECK(check_same(doubled, single) == 300);
  const FeatureRows equal = feature_rows(400, 5, 9, [](const Random&, std::size_t, std::size_t) { return 1.5; });
  CHECK(check_same(equal, equal) == 0);
  // A spread that is small beside the mean, and one that is large beside most of it; squares that are no normal numbers
  // or none at all.
  for (const double scale : {1e-22, 1e-18, 1.0, 1e12, 1e18, 3e19}) {
    CAPTURE(scale);
    const FeatureRows scaled = feature_rows(300, 20, 10, [&](const Random& random, std::size_t row, std::size_t k) {
      return scale * (1000 + random.normal(32 * row + k) * (row % 50 == 0 ? 1e4 : 1));
    });
    check_same(scaled, moved_half(scaled, 0.1 * scale));
  }
  FeatureRows broken = feature_rows(
      300, 6, 11, [](const Random& random, std::size_t row, std::size_t k) { return random.normal(8 * row + k); });
  const FeatureRows whole = broken;
  broken.storage[6 * 7] = std::numeric_limits<float>::quiet_NaN();
  broken.storage[6 * 9 + 5] = std::numeric_limits<float>::infinity();
  broken.storage[6 * 11] = std::numeric_limits<float>::max();
  CHECK(check_same(broken, whole) == 297);
  CHECK(check_same(whole, broken) == 297);
}
