// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/attack/anchor_attacks.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "compmark/watermark/attack/model_attacks.hpp"

namespace anchor_attacks_test {
namespace {

using namespace compmark;

/// 500 anchors; the feature's first column is the row's number.
struct Anchors {
  static constexpr std::size_t rows = 500;
  ParameterArena<float> arena;
  BlockHandle position, scaling, feature, training, weight;
  AnchorEvidence evidence;
  Anchors() {
    const auto anchor = [&](const char* name, std::size_t columns, BlockRole role) {
      return arena.add(name, rows, columns, RowKind::anchor, role, {});
    };
    position = anchor("anchor.position", 3, BlockRole::rendering);
    scaling = anchor("anchor.scaling", 6, BlockRole::rendering);
    feature = anchor("anchor.feature", 4, BlockRole::rendering);
    training = anchor("only.training", 1, BlockRole::training);
    weight = arena.add("mlp_color.0.weight", 4, 4, RowKind::fixed, BlockRole::rendering, {});
    const Random random(7, 0, random_stage("test/anchors"));
    std::uint64_t n = 0;
    for (float& value : arena.all_values()) value = static_cast<float>(random.normal(n++));
    for (std::size_t row = 0; row < rows; ++row) {
      arena.values(feature)(row, 0) = static_cast<float>(row);
      evidence.significance.push_back(random.uniform(90000 + row));
      evidence.opacity.push_back(random.uniform(190000 + row));
    }
  }
  [[nodiscard]] std::vector<float> of(BlockHandle block) const {
    const auto values = arena.values(block).flat();
    return {values.begin(), values.end()};
  }
  /// The numbers of the rows that are left.
  [[nodiscard]] std::vector<std::size_t> left() const {
    const MatrixView<const float> values = arena.values(feature);
    std::vector<std::size_t> rows_left;
    for (std::size_t row = 0; row < values.rows; ++row) rows_left.push_back(static_cast<std::size_t>(values(row, 0)));
    return rows_left;
  }
};

Anchors attacked(const std::string& text, std::uint64_t seed = 1) {
  Anchors anchors;
  REQUIRE(attack_model<ModelAttacks>(text, anchors.arena, seed, &anchors.evidence).ok());
  return anchors;
}

}  // namespace

TEST_CASE("attack/anchor_attacks: at strength 0 they change nothing, at their usual one the same for the same seed") {
  const Anchors before;
  for (const char* text : {"lightgaussian:0", "prune_opacity:0", "cutout:1", "merge:0", "smooth_features:0"}) {
    CAPTURE(text);
    const Anchors after = attacked(text);
    for (const BlockHandle block : {before.position, before.scaling, before.feature, before.training, before.weight})
      CHECK(after.of(block) == before.of(block));
  }
  for (const char* text : {"lightgaussian", "prune_opacity", "cutout", "merge", "smooth_features"}) {
    CAPTURE(text);
    const Anchors once = attacked(text), again = attacked(text);
    CHECK(once.of(once.feature) == again.of(again.feature));
    CHECK(once.of(once.feature) != before.of(before.feature));
    CHECK(once.of(once.weight) == before.of(before.weight));
  }
}

TEST_CASE(
    "attack/anchor_attacks: pruning by evidence throws away the least of it, and refuses what is not this model's") {
  const Anchors before;
  for (const bool opacity : {false, true}) {
    CAPTURE(opacity);
    const std::vector<double>& score = opacity ? before.evidence.opacity : before.evidence.significance;
    const std::vector<std::size_t> left = attacked(opacity ? "prune_opacity:0.66" : "lightgaussian:0.66").left();
    CHECK(left.size() == 170);  // 500 - floor(330)
    CHECK(std::is_sorted(left.begin(), left.end()));
    double least = 2, most = -1;
    for (std::size_t row = 0; row < Anchors::rows; ++row) {
      if (std::binary_search(left.begin(), left.end(), row)) {
        least = std::min(least, score[row]);
      } else {
        most = std::max(most, score[row]);
      }
    }
    CHECK(least >= most);
  }
  CHECK(attacked("lightgaussian:0.66").left() != attacked("prune_opacity:0.66").left());  // the control: two evidences
  Anchors short_of_one;
  short_of_one.evidence.significance.pop_back();
  CHECK(attack_model<ModelAttacks>("lightgaussian", short_of_one.arena, 0, &short_of_one.evidence)
            .error()
            .line()
            .find("evidence of 499 anchors for a model of 500") != std::string::npos);
  CHECK(attack_model<ModelAttacks>("lightgaussian", short_of_one.arena).error().line().find("looks at renders") !=
        std::string::npos);
  CHECK(*needs_renders<ModelAttacks>("lightgaussian:0.5"));
  CHECK_FALSE(*needs_renders<ModelAttacks>("prune"));
  CHECK_FALSE(needs_renders<ModelAttacks>("blur").ok());
}

TEST_CASE("attack/anchor_attacks: a cut-out is a ball, and another seed cuts another") {
  const Anchors before, cut = attacked("cutout:0.2");
  const std::vector<std::size_t> left = cut.left();
  CHECK(left.size() == 100);
  CHECK(attacked("cutout:0.2", 2).left() != left);
  const MatrixView<const float> position = before.arena.values(before.position);
  bool ball = false;  // round one of those that are kept, all that are kept are nearer than all that are not
  for (const std::size_t middle : left) {
    double farthest = 0, nearest = std::numeric_limits<double>::infinity();
    for (std::size_t row = 0; row < Anchors::rows; ++row) {
      const double distance = squared_distance(position, row, middle);
      if (std::binary_search(left.begin(), left.end(), row)) {
        farthest = std::max(farthest, distance);
      } else {
        nearest = std::min(nearest, distance);
      }
    }
    ball = ball || farthest <= nearest;
  }
  CHECK(ball);
}

TEST_CASE("attack/anchor_attacks: merged anchors are means of near ones, the others stay as they were") {
  const Anchors before, merged = attacked("merge:0.1");
  const MatrixView<const float> position = before.arena.values(before.position),
                                after = merged.arena.values(merged.position),
                                feature = merged.arena.values(merged.feature);
  REQUIRE(after.rows == 450);
  std::vector<double> apart;
  std::size_t same = 0;
  for (std::size_t row = 0; row < after.rows; ++row) {
    const double number = static_cast<double>(feature(row, 0));
    bool found = false;
    for (std::size_t a = 0; a < Anchors::rows && !found; ++a) {
      found = std::equal(after.row(row), after.row(row) + 3, position.row(a)) && number == static_cast<double>(a);
    }
    same += found ? 1 : 0;
    if (found) continue;
    double distance = -1;
    for (std::size_t a = 0; a < Anchors::rows; ++a) {
      const double b = 2 * number - static_cast<double>(a);
      if (!(b > static_cast<double>(a)) || b >= Anchors::rows || b != std::floor(b)) continue;
      const auto other = static_cast<std::size_t>(b);
      bool mean = true;
      for (std::size_t k = 0; k < 3; ++k)
        mean = mean && after(row, k) == 0.5f * position(a, k) + 0.5f * position(other, k);
      if (mean) distance = std::sqrt(squared_distance(position, a, other));
    }
    CHECK(distance >= 0);
    apart.push_back(distance);
  }
  CHECK(same == 400);
  REQUIRE(apart.size() == 50);
  std::sort(apart.begin(), apart.end());
  CHECK(apart[25] < 0.5);  // of 500 normal places, two drawn at random are 2.2 apart
}

TEST_CASE("attack/anchor_attacks: smoothing takes from features what their neighbours do not have") {
  const Anchors before;
  const auto deviation = [&](const Anchors& anchors) {
    double squares = 0;
    for (std::size_t row = 0; row < Anchors::rows; ++row)
      squares += std::pow(static_cast<double>(anchors.arena.values(anchors.feature)(row, 2)), 2);
    return std::sqrt(squares / Anchors::rows);
  };
  CHECK(deviation(attacked("smooth_features:1")) < 0.45 * deviation(before));  // 1 / sqrt(8) of independent numbers
  CHECK(deviation(attacked("smooth_features:0.5")) < 0.7 * deviation(before));
  CHECK(attacked("smooth_features:1").of(before.position) == before.of(before.position));
  // Features that all are the same stay.
  Anchors flat;
  for (float& value : flat.arena.values(flat.feature).flat()) value = 0.75f;
  const std::vector<float> plain = flat.of(flat.feature);
  REQUIRE(attack_model<ModelAttacks>("smooth_features:1", flat.arena).ok());
  CHECK(flat.of(flat.feature) == plain);
}

TEST_CASE("attack/anchor_attacks: anchors in one place, one anchor, and none, are not a crash") {
  for (const std::size_t rows : {std::size_t{0}, std::size_t{1}, std::size_t{3}}) {
    CAPTURE(rows);
    for (const char* text :
         {"lightgaussian:0.99", "prune_opacity:0.99", "cutout:0.001", "merge:0.4", "smooth_features:1"}) {
      CAPTURE(text);
      ParameterArena<float> arena;
      const BlockHandle position = arena.add("anchor.position", rows, 3, RowKind::anchor, BlockRole::rendering, {});
      arena.add("anchor.feature", rows, 2, RowKind::anchor, BlockRole::rendering, {});
      const AnchorEvidence evidence{std::vector<double>(rows, 1.0), std::vector<double>(rows, 1.0)};
      REQUIRE(attack_model<ModelAttacks>(text, arena, 0, &evidence).ok());
      CHECK(arena.values(position).rows >= std::min<std::size_t>(rows, 1));
    }
  }
}

}  // namespace anchor_attacks_test
