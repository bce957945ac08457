// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/container/geometry.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/math/morton.hpp"

namespace {

using namespace compmark;

std::vector<Voxel> sorted(std::vector<Voxel> voxels) {
  const VoxelRange range = voxel_range(voxels);
  std::vector<Voxel> result;
  for (const std::uint32_t row : morton_order(voxels, range)) result.push_back(voxels[row]);
  return result;
}

/// Bytes, after checking that they decode to the same voxels.
std::size_t coded_size(const std::vector<Voxel>& voxels) {
  const std::vector<Voxel> in_order = sorted(voxels);
  const std::vector<std::byte> bytes = encode_geometry(in_order, voxel_range(in_order));
  const auto decoded = decode_geometry(bytes, in_order.size());
  REQUIRE_MESSAGE(decoded.ok(), (decoded.ok() ? "" : decoded.error().line()));
  CHECK(*decoded == in_order);
  return bytes.size();
}

/// A sphere's surface as a trained scene samples it: some anchors on the voxel grid, most grown on grids of 4 and 16
/// voxels.
std::vector<Voxel> surface(std::size_t n, int fine_in_ten, int coarse = 16) {
  const Random random(3, 0, random_stage("geometry test"));
  std::vector<Voxel> voxels;
  for (std::size_t i = 0; i < n; ++i) {
    double d[3], length = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      d[axis] = random.normal(4 * i + axis);
      length += d[axis] * d[axis];
    }
    const int grid = static_cast<int>(random.bits(4 * i + 3) % 10) < fine_in_ten ? 1 : i % 2 == 0 ? 4 : coarse;
    Voxel voxel;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      voxel[axis] = grid * static_cast<int>(std::lround(1000 * d[axis] / std::sqrt(length) / grid));
    }
    voxels.push_back(voxel);
  }
  return voxels;
}

/// What sorted Morton differences in Exp-Golomb cost, bits: the plain alternative.
double delta_bits(const std::vector<Voxel>& voxels) {
  const std::vector<Voxel> in_order = sorted(voxels);
  const VoxelRange range = voxel_range(in_order);
  double bits = 0, best = std::numeric_limits<double>::infinity();
  for (int rice = 0; rice < 40; ++rice) {
    bits = 0;
    std::uint64_t before = 0;
    for (const Voxel& voxel : in_order) {
      const std::uint64_t delta = range.code(voxel).low - before;
      before += delta;
      bits += 2 * std::floor(std::log2(static_cast<double>(delta >> rice) + 1)) + 1 + rice;
    }
    best = std::min(best, bits);
  }
  return best;
}

TEST_CASE("container/geometry: any set of voxels comes back") {
  CHECK(coded_size({}) == 13);
  CHECK(coded_size({{0, 0, 0}}) < 20);
  constexpr std::int32_t least = std::numeric_limits<std::int32_t>::min(),
                         greatest = std::numeric_limits<std::int32_t>::max();
  coded_size({{least, least, least}, {greatest, greatest, greatest}, {0, -1, 1}, {greatest, least, 0}});
  coded_size({{greatest, greatest, greatest}});
  coded_size(std::vector<Voxel>(1000, Voxel{7, -7, 7}));  // one voxel, a thousand anchors
  coded_size({{1, 1, 1}, {1, 1, 1}, {1, 1, 2}, {1, 1, 2}, {1, 1, 2}, {64, 0, 0}});
  std::vector<Voxel> dense;
  for (int i = 0; i < 4096; ++i) dense.push_back({i & 15, i >> 4 & 15, i >> 8});
  CHECK(coded_size(dense) < 120);  // a full cube says little: 0.2 bits a voxel
  const Random random(2, 0, random_stage("geometry test"));
  std::vector<Voxel> scattered;
  for (std::uint64_t i = 0; i < 500; ++i) {
    Voxel voxel;
    for (std::size_t axis = 0; axis < 3; ++axis) voxel[axis] = static_cast<std::int32_t>(random.bits(3 * i + axis));
    scattered.push_back(voxel);
  }
  coded_size(scattered);
}

TEST_CASE("container/geometry: fewer bits than 48 raw ones and than sorted Morton differences") {
  for (const int fine : {10, 2, 0}) {
    const std::vector<Voxel> voxels = surface(20'000, fine);
    const double n = static_cast<double>(voxels.size());
    const double bits = 8 * static_cast<double>(coded_size(voxels)) / n, deltas = delta_bits(voxels) / n;
    MESSAGE(fine, "0 % on single voxels: ", bits, " bits an anchor; Morton differences ", deltas, ", raw 48");
    CHECK(bits < deltas);
    CHECK(bits < 24);
  }
}

TEST_CASE(
    "container/geometry: a wrong count, every truncation and every flipped bit end in an error or in other voxels, "
    "never "
    "worse") {
  const std::vector<Voxel> voxels = sorted(surface(60, 3));
  const std::vector<std::byte> bytes = encode_geometry(voxels, voxel_range(voxels));
  CHECK(!decode_geometry(bytes, voxels.size() + 1).ok());
  CHECK(!decode_geometry(bytes, voxels.size() - 1).ok());
  CHECK(!decode_geometry(bytes, 0).ok());
  CHECK(!decode_geometry(bytes, std::uint64_t{1} << 60).ok());
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    CHECK(!decode_geometry(std::span<const std::byte>(bytes).first(n), voxels.size()).ok());
  }
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::vector<std::byte> damaged = bytes;
      damaged[i] ^= static_cast<std::byte>(1 << bit);
      const auto decoded = decode_geometry(damaged, voxels.size());
      CHECK((!decoded.ok() || *decoded != voxels));
    }
  }
}

}  // namespace
