// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/attack/model_attacks.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

namespace model_attacks_test {
namespace {

using namespace compmark;

struct Numbers {
  ParameterArena<float> arena;
  BlockHandle feature, position, scaling, mask, weight, training;
  Numbers() {
    const auto add = [&](const char* name, std::size_t rows, std::size_t columns, RowKind kind, BlockRole role,
                         double scale) {
      const BlockHandle block = arena.add(name, rows, columns, kind, role, LearningSchedule::fixed());
      return std::pair(block, scale);
    };
    const std::vector<std::pair<BlockHandle, double>> blocks{
        add("anchor.feature", 400, 8, RowKind::anchor, BlockRole::rendering, 2),
        add("anchor.position", 400, 3, RowKind::anchor, BlockRole::rendering, 1),
        add("anchor.scaling", 400, 6, RowKind::anchor, BlockRole::rendering, 1),
        add("anchor.mask", 400, 2, RowKind::anchor, BlockRole::mask, 1),
        add("mlp_color.2.bias", 16, 8, RowKind::fixed, BlockRole::rendering, 0.1),
        add("noise.weight", 16, 8, RowKind::fixed, BlockRole::training, 0.1)};
    std::uint64_t at = 0;
    const Random random(3, 0, 0);
    for (const auto& [block, scale] : blocks) {
      for (float& value : arena.values(block).flat()) value = static_cast<float>(scale * random.normal(at++));
    }
    feature = blocks[0].first;
    position = blocks[1].first;
    scaling = blocks[2].first;
    mask = blocks[3].first;
    weight = blocks[4].first;
    training = blocks[5].first;
  }
  [[nodiscard]] std::vector<float> of(BlockHandle block) const {
    const MatrixView<const float> values = arena.values(block);
    return {values.data, values.data + values.size()};
  }
};

Numbers attacked(const std::string& text, std::uint64_t seed = 1) {
  Numbers numbers;
  REQUIRE(attack_model<ModelAttacks>(text, numbers.arena, seed).ok());
  return numbers;
}

}  // namespace

TEST_CASE(
    "attack/model_attacks: at the usual strength and at both ends a model stays finite, and what no render reads "
    "stays") {
  const Numbers before;
  ModelAttacks::each([&]<class A>() {
    for (const double amount : {A::amount.usual, A::amount.least, A::amount.most}) {
      CAPTURE(std::string(A::name));
      CAPTURE(amount);
      Numbers once, again;
      REQUIRE(A::apply(once.arena, amount, 3).ok());
      REQUIRE(A::apply(again.arena, amount, 3).ok());
      for (const float value : once.arena.all_values()) CHECK(std::isfinite(value));
      CHECK(once.of(once.feature) == again.of(again.feature));
      CHECK(once.of(once.training) == before.of(before.training));
      if (A::name == "prune") continue;
      std::vector<float> mask = once.of(once.mask);
      mask.resize(before.of(before.mask).size());  // without the rows of anchors that were added
      CHECK(mask == before.of(before.mask));
    }
    const Numbers changed = attacked(std::string(A::name));
    CHECK((changed.of(before.feature) != before.of(before.feature) ||
           changed.of(before.position) != before.of(before.position) ||
           changed.of(before.weight) != before.of(before.weight)));
  });
}

TEST_CASE("attack/model_attacks: each does what it is called") {
  const Numbers before;
  const std::vector<float> rounded = attacked("int8").of(before.feature), fine = attacked("int8:1").of(before.feature);
  CHECK(std::set<float>(rounded.begin(), rounded.end()).size() <= 256);
  CHECK(std::set<float>(fine.begin(), fine.end()).size() > 256);

  const std::vector<float> plain = before.of(before.feature), noisy = attacked("noise:0.1").of(before.feature);
  double squares = 0;
  for (std::size_t i = 0; i < plain.size(); ++i)
    squares += std::pow(static_cast<double>(noisy[i] - plain[i]), 2) / static_cast<double>(plain.size());
  CHECK(std::sqrt(squares) == doctest::Approx(0.1 * 2).epsilon(0.05));  // the features have the deviation 2
  CHECK(attacked("noise:0.1").of(before.weight) == before.of(before.weight));
  CHECK(attacked("noise", 1).of(before.feature) != attacked("noise", 2).of(before.feature));

  const Numbers fewer = attacked("prune:0.5");
  const std::size_t rows = fewer.arena.values(fewer.feature).rows;
  CHECK((rows > 160 && rows < 240));
  CHECK(fewer.arena.values(fewer.mask).rows == rows);
  std::size_t found = 0;  // every row that is left is one of before, with all of its blocks, in their order
  for (std::size_t row = 0; row < 400 && found < rows; ++row) {
    const float* const a = before.arena.values(before.feature).row(row);
    const float* const b = fewer.arena.values(fewer.feature).row(found);
    if (!std::equal(a, a + 8, b)) continue;
    CHECK(before.arena.values(before.mask)(row, 1) == fewer.arena.values(fewer.mask)(found, 1));
    ++found;
  }
  CHECK(found == rows);
  CHECK(attacked("prune:0.99").arena.values(before.feature).rows >= 1);
}

TEST_CASE("attack/model_attacks: clone doubles the share that was asked for, beside the originals, which stay") {
  const Numbers before, more = attacked("clone:0.5");
  const std::size_t rows = more.arena.values(more.feature).rows;
  CHECK((rows > 560 && rows < 640));
  CHECK(attacked("clone:1").arena.values(before.feature).rows == 800);
  CHECK(attacked("clone:0").of(before.feature) == before.of(before.feature));
  CHECK(attacked("clone:0.5", 2).arena.values(before.feature).rows != rows);
  for (const BlockHandle block : {before.feature, before.position, before.scaling, before.mask}) {
    std::vector<float> values = more.of(block);
    CHECK(values.size() / before.arena.values(block).columns == rows);
    values.resize(before.of(block).size());
    CHECK(values == before.of(block));
  }
  CHECK(more.of(more.weight) == before.of(before.weight));

  const auto position = more.arena.values(more.position), scaling = more.arena.values(more.scaling);
  const auto feature = more.arena.values(more.feature), mask = more.arena.values(more.mask);
  std::set<std::size_t> parents;
  double squares = 0;
  for (std::size_t row = 400; row < rows; ++row) {
    std::size_t parent = 0;
    while (parent < 400 && !std::equal(feature.row(row), feature.row(row) + 8, feature.row(parent))) ++parent;
    REQUIRE(parent < 400);
    parents.insert(parent);
    CHECK(std::equal(mask.row(row), mask.row(row) + 2, mask.row(parent)));
    CHECK(std::equal(scaling.row(row), scaling.row(row) + 6, scaling.row(parent)));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double extent = std::exp(static_cast<double>(scaling(parent, axis)));
      const double moved = static_cast<double>(position(row, axis) - position(parent, axis)) / extent;
      CHECK(moved != 0);
      squares += moved * moved / static_cast<double>(3 * (rows - 400));
    }
  }
  CHECK(parents.size() == rows - 400);  // nobody is doubled twice
  CHECK(std::sqrt(squares) == doctest::Approx(0.1).epsilon(0.1));
}

TEST_CASE("attack/model_attacks: clone stays finite where an anchor's extent is not, and needs no places") {
  Numbers numbers;
  for (float& value : numbers.arena.values(numbers.scaling).flat()) value = 1000;
  REQUIRE(attack_model<ModelAttacks>("clone:1", numbers.arena, 1).ok());
  for (const float value : numbers.arena.all_values()) CHECK(std::isfinite(value));

  ParameterArena<float> bare;
  const BlockHandle block =
      bare.add("anchor.feature", 3, 1, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  bare.values(block)(2, 0) = 5;
  REQUIRE(attack_model<ModelAttacks>("clone:1", bare).ok());
  CHECK(bare.values(block).rows == 6);
  CHECK(bare.values(block)(5, 0) == 5);
}

}  // namespace model_attacks_test
