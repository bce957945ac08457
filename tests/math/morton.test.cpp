// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The Morton code against its definition, digit by digit, and the two orders of voxels.
#include "compmark/math/morton.hpp"

#include <doctest/doctest.h>
#include <array>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

TEST_CASE("math/morton: a code is the interleaved digits, up to 32 bits an axis") {
  const Random random(1, 0, random_stage("morton test"));
  for (std::uint64_t i = 0; i < 200; ++i) {
    std::array<std::uint32_t, 3> x{};
    for (std::size_t axis = 0; axis < 3; ++axis) x[axis] = static_cast<std::uint32_t>(random.bits(3 * i + axis));
    const MortonCode code = morton_code(x[0], x[1], x[2]);
    for (unsigned bit = 0; bit < 96; ++bit) {
      const bool in_code = ((bit < 63 ? code.low >> bit : code.high >> (bit - 63)) & 1u) != 0;
      REQUIRE(in_code == ((x[bit % 3] >> (bit / 3) & 1u) != 0));
    }
    CHECK((code.high >> 33) == 0);
    CHECK((code.low >> 63) == 0);
  }
}

TEST_CASE("math/morton: anchors of one voxel keep their order") {
  const std::vector<Voxel> voxels{{5, 5, 5}, {1, 0, 0}, {5, 5, 5}, {-70, 3, 9}, {1, 0, 0}};
  const VoxelRange range = voxel_range(voxels);
  CHECK(range.origin == Voxel{-128, 0, 0});
  CHECK(range.bits == 8);
  CHECK(morton_order(voxels, range) == std::vector<std::uint32_t>{3, 1, 4, 0, 2});
}

TEST_CASE("math/morton: morton_less is the order of the codes from the least voxel there is") {
  const Random random(1, 0, 0);
  std::size_t less = 0;
  for (std::size_t i = 0; i < 4000; ++i) {
    Voxel a{}, b{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int shift = static_cast<int>(random.below(9 * i + axis, 32));
      a[axis] = static_cast<std::int32_t>(random.bits(9 * i + 3 + axis) >> 32) >> shift;
      b[axis] = i % 3 == 0 ? a[axis] ^ static_cast<std::int32_t>(random.below(9 * i + 6 + axis, 4))
                           : static_cast<std::int32_t>(random.bits(9 * i + 6 + axis) >> 32) >> shift;
    }
    const auto code = [](const Voxel& v) {
      const auto biased = [&](std::size_t axis) { return static_cast<std::uint32_t>(v[axis]) ^ 0x80000000u; };
      return morton_code(biased(0), biased(1), biased(2));
    };
    CHECK(morton_less(a, b) == (code(a) < code(b)));
    less += morton_less(a, b) ? 1 : 0;
  }
  CHECK(less > 1000);
}
