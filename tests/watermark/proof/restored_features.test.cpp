// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/proof/restored_features.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/watermark/attack/model_attacks.hpp"

namespace {

using namespace compmark;

/// Anchors on a grid, a mark of .1 in the features of one of them.
struct RestoredPair {
  static constexpr std::size_t rows = 400, features = 4;
  ParameterArena<float> unmarked, marked;
  RestoredPair() {
    for (ParameterArena<float>* arena : {&unmarked, &marked}) {
      const AnchorHandles anchors = add_anchor_blocks(*arena, rows, DecoderShape{static_cast<int>(features), 2});
      const Random random(2, 0, random_stage("test/restored"));
      for (std::size_t row = 0; row < rows; ++row) {
        const std::size_t cell[3] = {row % 8, row / 8 % 8, row / 64};
        for (std::size_t axis = 0; axis < 3; ++axis)
          arena->values(anchors.position)(row, axis) = 0.25f * static_cast<float>(cell[axis]);
        for (std::size_t axis = 0; axis < 6; ++axis) arena->values(anchors.scaling)(row, axis) = -3;
        for (std::size_t k = 0; k < features; ++k) {
          arena->values(anchors.feature)(row, k) = static_cast<float>(random.normal(row * features + k));
          if (arena == &marked) arena->values(anchors.feature)(row, k) += sign(row, k);
        }
      }
    }
  }
  static float sign(std::size_t row, std::size_t k) { return (row * 7 + k * 3) % 5 < 2 ? 0.1f : -0.1f; }
  /// Mean over the features of how much of the mark is in `arena`, an unmarked one that was restored.
  [[nodiscard]] double carried(const ParameterArena<float>& arena) const {
    const auto feature = arena.values(arena.layout().find("anchor.feature"));
    const auto before = unmarked.values(unmarked.layout().find("anchor.feature"));
    double sum = 0;
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t k = 0; k < features; ++k)
        sum += static_cast<double>(feature(row, k) - before(row, k)) / static_cast<double>(sign(row, k));
    }
    return sum / (rows * features);
  }
};

}  // namespace

TEST_CASE("proof/restored_features: what is left of a model speaks in the unmarked one for what is gone") {
  const RestoredPair pair;
  ThreadExecutor executor(2);
  struct Case {
    const char* attack;
    std::size_t least, most;
    double raised;
  };
  for (const Case& c : {Case{"prune:0", 400, 400, 1}, Case{"clone:0.5", 400, 400, 1}, Case{"jitter:0.2", 400, 400, 1},
                        Case{"float16", 400, 400, 1}, Case{"prune:0.5", 160, 240, 2}, Case{"prune:0.9", 15, 70, 3}}) {
    CAPTURE(std::string(c.attack));
    ParameterArena<float> suspected = pair.marked, restored = pair.unmarked;
    REQUIRE(attack_model<ModelAttacks>(c.attack, suspected, 3).ok());
    const Result<RestoredFeatures> found = restore_features(restored, suspected, executor);
    REQUIRE(found.ok());
    CHECK(found->anchors == 400);
    CHECK(found->found >= c.least);
    CHECK(found->found <= c.most);
    const double share = static_cast<double>(found->found) / 400;
    CHECK(found->raised == doctest::Approx(std::min(3.0, 1 / share)).epsilon(1e-12));
    // Half the precision has 11 bits: of features below 4, 2e-3 is a fiftieth of the mark.
    CHECK(pair.carried(restored) == doctest::Approx(found->raised * share).epsilon(0.03));
    // The control: an unmarked model carries nothing, whatever was done to it.
    ParameterArena<float> innocent = pair.unmarked, again = pair.unmarked;
    REQUIRE(attack_model<ModelAttacks>(c.attack, innocent, 3).ok());
    REQUIRE(restore_features(again, innocent, executor).ok());
    CHECK(std::abs(pair.carried(again)) < 0.03);
  }
}

TEST_CASE("proof/restored_features: another scene, other features and numbers that are none") {
  const RestoredPair pair;
  ThreadExecutor executor(2);
  ParameterArena<float> elsewhere = pair.marked, restored = pair.unmarked;
  for (float& x : elsewhere.values(elsewhere.layout().find("anchor.position")).flat()) x += 100;
  // A scene that was moved as a whole is that scene.
  const Result<RestoredFeatures> moved = restore_features(restored, elsewhere, executor);
  REQUIRE(moved.ok());
  CHECK(moved->found >= 350);  // 367: of four numbers a feature, and the mark a third of what keeps two apart
  CHECK(pair.carried(restored) == doctest::Approx(1).epsilon(0.03));
  restored = pair.unmarked;
  const Random random(8, 0, random_stage("test/another scene"));
  std::uint64_t n = 0;
  for (float& x : elsewhere.values(elsewhere.layout().find("anchor.feature")).flat())
    x = static_cast<float>(100 + random.normal(n++));
  const Result<RestoredFeatures> none = restore_features(restored, elsewhere, executor);
  REQUIRE_FALSE(none.ok());
  CHECK(none.error().field == "anchor.position");
  ParameterArena<float> wider;
  add_anchor_blocks(wider, 10, DecoderShape{8, 2});
  const Result<RestoredFeatures> other = restore_features(restored, wider, executor);
  REQUIRE_FALSE(other.ok());
  CHECK(other.error().field == "anchor.feature");

  ParameterArena<float> broken = pair.marked;
  broken.values(broken.layout().find("anchor.feature"))(5, 0) = std::numeric_limits<float>::quiet_NaN();
  REQUIRE(restore_features(restored, broken, executor).ok());
  const auto feature = restored.values(restored.layout().find("anchor.feature"));
  CHECK(feature(5, 0) == pair.unmarked.values(pair.unmarked.layout().find("anchor.feature"))(5, 0));
}
