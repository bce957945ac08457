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
  AnchorEvidence evidence;
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
    for (std::size_t row = 0; row < 400; ++row) {
      evidence.significance.push_back(random.uniform(100000 + row));
      evidence.opacity.push_back(random.uniform(200000 + row));
    }
  }
  [[nodiscard]] std::vector<float> of(BlockHandle block) const {
    const MatrixView<const float> values = arena.values(block);
    return {values.data, values.data + values.size()};
  }
};

Numbers attacked(const std::string& text, std::uint64_t seed = 1) {
  Numbers numbers;
  REQUIRE(attack_model<ModelAttacks>(text, numbers.arena, seed, &numbers.evidence).ok());
  return numbers;
}
template <class A>
Result<Done> apply(Numbers& numbers, double amount, std::uint64_t seed) {
  if constexpr (RenderedAttack<A>) {
    return A::apply(numbers.arena, amount, seed, numbers.evidence);
  } else {
    return A::apply(numbers.arena, amount, seed);
  }
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
      REQUIRE(apply<A>(once, amount, 3).ok());
      REQUIRE(apply<A>(again, amount, 3).ok());
      for (const float value : once.arena.all_values()) CHECK(std::isfinite(value));
      CHECK(once.of(once.feature) == again.of(again.feature));
      CHECK(once.of(once.training) == before.of(before.training));
      if (once.arena.values(once.mask).rows < 400) continue;
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

TEST_CASE("attack/model_attacks: noise is on all numbers that renders read, or on features alone") {
  const Numbers before, all = attacked("parameter_noise:0.005"), features = attacked("feature_noise:0.2");
  const auto change = [&](const Numbers& after, BlockHandle block) {
    const std::vector<float> from = before.of(block), to = after.of(block);
    double squares = 0;
    for (std::size_t i = 0; i < from.size(); ++i)
      squares += std::pow(static_cast<double>(to[i] - from[i]), 2) / static_cast<double>(from.size());
    return std::sqrt(squares);
  };
  for (const BlockHandle block : {before.feature, before.position, before.scaling, before.weight})
    CHECK(change(all, block) == doctest::Approx(0.005).epsilon(0.12));  // whatever their size
  CHECK(change(all, before.training) == 0);
  CHECK(change(features, before.feature) == doctest::Approx(0.2 * 2).epsilon(0.05));
  for (const BlockHandle block : {before.position, before.scaling, before.weight, before.training})
    CHECK(change(features, block) == 0);
  for (const char* text : {"parameter_noise:0", "feature_noise:0", "float16:0"}) {
    const Numbers after = attacked(text);
    CHECK(std::equal(after.arena.all_values().begin(), after.arena.all_values().end(),
                     before.arena.all_values().begin()));
  }
}

TEST_CASE("attack/model_attacks: 4 bits are 16 levels a tensor or a channel, with zero among them and ends kept") {
  Numbers one;
  for (std::size_t row = 0; row < 400; ++row) one.arena.values(one.feature)(row, 3) = row < 200 ? 0.0f : 0.001f;
  ParameterArena<float>& arena = one.arena;
  const std::vector<float> plain = one.of(one.feature);
  REQUIRE(Int4Attack::apply(arena, 0, 0).ok());
  const std::vector<float> tensor = one.of(one.feature);
  CHECK(std::set<float>(tensor.begin(), tensor.end()).size() <= 16);
  const auto [low, high] = std::minmax_element(plain.begin(), plain.end());
  const double step = (static_cast<double>(*high) - static_cast<double>(*low)) / 15;
  for (std::size_t i = 0; i < plain.size(); ++i)
    CHECK(std::abs(static_cast<double>(tensor[i]) - static_cast<double>(plain[i])) <= 1.01 * step);
  for (std::size_t row = 0; row < 400; ++row) CHECK(tensor[8 * row + 3] == 0);  // a column of small numbers is lost
  const Numbers fine = attacked("int4:1");
  const MatrixView<const float> columns = fine.arena.values(fine.feature);
  for (std::size_t k = 0; k < 8; ++k) {
    std::set<float> levels;
    for (std::size_t row = 0; row < 400; ++row) levels.insert(columns(row, k));
    CHECK((levels.size() > 8 && levels.size() <= 16));
    CHECK(levels.count(0) == 1);
  }
  Numbers constant;
  for (float& value : constant.arena.values(constant.feature).flat()) value = 1.5f;
  REQUIRE(Int4Attack::apply(constant.arena, 0, 0).ok());
  for (const float value : constant.of(constant.feature)) CHECK(value == doctest::Approx(1.5));
}

TEST_CASE("attack/model_attacks: half precision has 11 bits, numbers below 2^-14 and an end") {
  CHECK(detail::rounded_to_half(1 + 1.0f / 2048) == 1);  // a tie, to even
  CHECK(detail::rounded_to_half(1 + 3.0f / 2048) == 1 + 4.0f / 2048);
  CHECK(detail::rounded_to_half(65504) == 65504);
  CHECK(detail::rounded_to_half(-1e9f) == -65504);
  CHECK(detail::rounded_to_half(0x1p-24f) == 0x1p-24f);
  CHECK(detail::rounded_to_half(0x1p-26f) == 0);
  CHECK(detail::rounded_to_half(0x1.8p-24f) == 0x1p-23f);
  CHECK(detail::rounded_to_half(0x1.fffp-15f) == 0x1p-14f);
  for (int exponent = -24; exponent < 16; ++exponent) {
    const float value = std::ldexp(1.0f, exponent);
    CHECK(detail::rounded_to_half(value) == value);
    CHECK(detail::rounded_to_half(-value) == -value);
  }
  const Numbers before, after = attacked("float16");
  CHECK(after.of(after.position) != before.of(before.position));
  CHECK(after.of(after.position) == attacked("mantissa:10").of(before.position));  // of that size they are the same
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
