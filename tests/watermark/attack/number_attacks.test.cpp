// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/core/parameters.hpp>
#include <compmark/core/random.hpp>
#include <compmark/watermark/attack/number_attacks.hpp>
#include <cstddef>
#include <limits>
#include <vector>

namespace number_attacks_test {
namespace {

using namespace compmark;

/// Places and scalings of 200 anchors, a colour network's last biases, and what no render reads.
struct Numbers {
  ParameterArena<float> arena;
  BlockHandle position, offset, scaling, feature, bias, other, training;
  Numbers() {
    const auto anchor = [&](const char* name, std::size_t columns) {
      return arena.add(name, 200, columns, RowKind::anchor, BlockRole::rendering, {});
    };
    position = anchor("anchor.position", 3);
    offset = anchor("anchor.offset", 6);
    scaling = anchor("anchor.scaling", 6);
    feature = anchor("anchor.feature", 4);
    bias = arena.add("mlp_color.2.bias", 1, 12, RowKind::fixed, BlockRole::rendering, {});
    other = arena.add("mlp_opacity.2.bias", 1, 12, RowKind::fixed, BlockRole::rendering, {});
    training = arena.add("only.training", 1, 12, RowKind::fixed, BlockRole::training, {});
    const Random random(3, 0, random_stage("test/numbers"));
    std::uint64_t n = 0;
    for (float& value : arena.all_values()) value = static_cast<float>(random.normal(n++));
  }
  [[nodiscard]] std::vector<float> of(BlockHandle block) const {
    const auto values = arena.values(block).flat();
    return {values.begin(), values.end()};
  }
};

}  // namespace

TEST_CASE(
    "attack/number_attacks: a mantissa of 10 bits is half precision's, to the nearest, and training numbers stay") {
  Numbers numbers;
  const Numbers before;
  const float largest = std::numeric_limits<float>::max();
  numbers.arena.values(numbers.feature)(0, 0) = 1 + 1.0f / 2048;  // a tie: to even, down
  numbers.arena.values(numbers.feature)(0, 1) = 1 + 3.0f / 2048;  // a tie: to even, up
  numbers.arena.values(numbers.feature)(0, 2) = largest;          // what would become infinite stays
  REQUIRE(MantissaAttack::apply(numbers.arena, 10, 0).ok());
  CHECK(numbers.arena.values(numbers.feature)(0, 0) == 1);
  CHECK(numbers.arena.values(numbers.feature)(0, 1) == 1 + 4.0f / 2048);
  CHECK(numbers.arena.values(numbers.feature)(0, 2) == largest);
  CHECK(numbers.of(numbers.training) == before.of(before.training));
  const std::vector<float> rounded = numbers.of(numbers.position), exact = before.of(before.position);
  for (std::size_t i = 0; i < exact.size(); ++i) {
    CHECK(std::abs(rounded[i] - exact[i]) <= std::abs(exact[i]) / 2048);
    int exponent = 0;
    const float eleven_bits = std::ldexp(std::frexp(rounded[i], &exponent), 11);
    CHECK(eleven_bits == std::round(eleven_bits));
  }
  Numbers whole;
  REQUIRE(MantissaAttack::apply(whole.arena, 23, 0).ok());
  CHECK(whole.of(whole.position) == before.of(before.position));
}

TEST_CASE("attack/number_attacks: jitter moves places alone, by shares of extents; the bias attack colours alone") {
  const Numbers before;
  Numbers moved;
  REQUIRE(JitterAttack::apply(moved.arena, 0.5, 4).ok());
  const MatrixView<const float> from = before.arena.values(before.position),
                                scaling = before.arena.values(before.scaling);
  double sum = 0;
  for (std::size_t a = 0; a < 200; ++a) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double step =
          static_cast<double>(moved.arena.values(moved.position)(a, k)) - static_cast<double>(from(a, k));
      sum += std::pow(step / std::exp(static_cast<double>(scaling(a, k))), 2) / 600;
    }
  }
  CHECK(std::sqrt(sum) == doctest::Approx(0.5).epsilon(0.1));  // 600 normal numbers: 3 % deviation
  CHECK(moved.of(moved.feature) == before.of(before.feature));
  CHECK(moved.of(moved.bias) == before.of(before.bias));
  Numbers coloured;
  REQUIRE(ColourBiasAttack::apply(coloured.arena, 0.25, 0).ok());
  for (std::size_t i = 0; i < 12; ++i) CHECK(coloured.of(coloured.bias)[i] == before.of(before.bias)[i] + 0.25f);
  CHECK(coloured.of(coloured.other) == before.of(before.other));
  CHECK(coloured.of(coloured.position) == before.of(before.position));
  // A model without such numbers is left alone.
  ParameterArena<float> none;
  const BlockHandle block = none.add("something", 1, 3, RowKind::fixed, BlockRole::rendering, {});
  none.values(block)(0, 1) = 2;
  REQUIRE(JitterAttack::apply(none, 0.5, 4).ok());
  REQUIRE(ColourBiasAttack::apply(none, 0.5, 4).ok());
  CHECK(none.values(block)(0, 1) == 2);
}

}  // namespace number_attacks_test
