// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/context_gs/anchor_levels.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>
#include <vector>

#include "compmark/codec/context_gs/anchor_cells.hpp"
#include "compmark/codec/context_gs/context_gs_levels.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;

/// Voxels of a bumpy sphere, some twice, in an order that no sort made.
std::vector<Voxel> surface(std::size_t n, std::int32_t radius, std::int32_t shift = 0) {
  const Random random(3, 0, random_stage("anchor levels test"));
  std::vector<Voxel> voxels(n);
  for (std::size_t i = 0; i < n; ++i) {
    double d[3], norm = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      d[axis] = random.normal(3 * i + axis);
      norm += d[axis] * d[axis];
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      voxels[i][axis] = shift + static_cast<std::int32_t>(std::lround(radius * d[axis] / std::sqrt(norm)));
    }
    if (i % 50 == 49) voxels[i] = voxels[i - 7];
  }
  return voxels;
}
std::vector<std::uint8_t> some_unmasked(std::size_t n) {
  const Random random(4, 0, random_stage("anchor levels test"));
  std::vector<std::uint8_t> unmasked(n);
  for (std::size_t i = 0; i < n; ++i) unmasked[i] = random.uniform(i) < 0.8 ? 1 : 0;
  return unmasked;
}
Voxel cell(const Voxel& v, std::int32_t kappa) {
  Voxel c{};
  for (std::size_t axis = 0; axis < 3; ++axis) {  // floor, in another way than the header's
    c[axis] = static_cast<std::int32_t>(std::floor(static_cast<long double>(v[axis]) / kappa));
  }
  return c;
}
/// The definition, word by word.
void reference(const std::vector<Voxel>& voxels, const std::vector<std::uint8_t>& unmasked, AnchorCells cells,
               std::vector<int>& level, std::vector<std::uint32_t>& parent) {
  const auto code = [&](std::size_t i) {
    const auto biased = [&](std::size_t axis) { return static_cast<std::uint32_t>(voxels[i][axis]) ^ 0x80000000u; };
    const MortonCode c = morton_code(biased(0), biased(1), biased(2));
    return std::make_tuple(c.high, c.low, i);
  };
  std::map<Voxel, std::uint32_t> fine, coarse;
  const auto head = [&](std::map<Voxel, std::uint32_t>& heads, const Voxel& c, std::size_t i) {
    const auto [at, fresh] = heads.try_emplace(c, static_cast<std::uint32_t>(i));
    if (!fresh && code(i) < code(at->second)) at->second = static_cast<std::uint32_t>(i);
  };
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    if (unmasked[i] != 0) head(fine, cell(voxels[i], cells.fine), i);
  }
  for (const auto& [c, i] : fine) head(coarse, cell(voxels[i], cells.coarse), i);
  level.assign(voxels.size(), AnchorLevels::masked);
  parent.assign(voxels.size(), AnchorLevels::none);
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    if (unmasked[i] == 0) continue;
    const std::uint32_t first = fine.at(cell(voxels[i], cells.fine));
    level[i] = 0;
    if (first != i) parent[i] = first;
    if (first != i) continue;
    const std::uint32_t second = coarse.at(cell(voxels[i], cells.coarse));
    level[i] = second == i ? 2 : 1;
    if (second != i) parent[i] = second;
  }
}

}  // namespace

TEST_CASE("context_gs/anchor_levels: a coordinate's cell is rounded down, at the ends of the range too") {
  CHECK(cell_coordinate(-1, 5) == -1);
  CHECK(cell_coordinate(-5, 5) == -1);
  CHECK(cell_coordinate(-6, 5) == -2);
  CHECK(cell_coordinate(INT32_MIN, 3) == -715827883);
  CHECK(cell_coordinate(INT32_MAX, INT32_MAX) == 1);
}

TEST_CASE("context_gs/anchor_levels: the split is the definition's, masked anchors or none, far from the origin too") {
  for (const std::int32_t shift : {0, -1000, 2147483000}) {
    const std::vector<Voxel> voxels = surface(3000, 60, shift);
    const AnchorCells cells{7, 19};
    AnchorLevels levels;
    levels.sort(voxels, cells);
    for (const bool masked : {true, false}) {
      const std::vector<std::uint8_t> unmasked = masked ? some_unmasked(3000) : std::vector<std::uint8_t>(3000, 1);
      masked ? levels.assign(unmasked) : levels.assign();
      std::vector<int> level;
      std::vector<std::uint32_t> parent;
      reference(voxels, unmasked, cells, level, parent);
      CHECK(std::equal(level.begin(), level.end(), levels.level().begin()));
      CHECK(std::equal(parent.begin(), parent.end(), levels.parent().begin()));
      for (std::size_t l = 0; l < 3; ++l) {
        CHECK(levels.counts()[l] ==
              static_cast<std::size_t>(std::count(level.begin(), level.end(), static_cast<int>(l))));
      }
    }
  }
}

TEST_CASE(
    "context_gs/anchor_levels: one level an anchor, a parent that is coarser and of the same cell, none at level 2") {
  const std::vector<Voxel> voxels = surface(5000, 80, -20);
  const AnchorCells cells = choose_anchor_cells(voxels);
  AnchorLevels levels;
  levels.sort(voxels, cells);
  levels.assign();
  CHECK(levels.counts()[0] + levels.counts()[1] + levels.counts()[2] == voxels.size());
  std::size_t children_of_two = 0;
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    const int level = levels.level()[i];
    if (level == 2) {
      CHECK(levels.parent()[i] == AnchorLevels::none);
      continue;
    }
    const std::uint32_t parent = levels.parent()[i];
    const std::int32_t kappa = level == 1 ? cells.coarse : cells.fine;
    CHECK(levels.level()[parent] > level);
    CHECK(cell(voxels[i], kappa) == cell(voxels[parent], kappa));
    CHECK(!morton_less(voxels[i], voxels[parent]));
    children_of_two += level == 0 && levels.level()[parent] == 2 ? 1 : 0;
    for (std::size_t axis = 0; axis < 3; ++axis) CHECK(std::abs(voxels[i][axis] - voxels[parent][axis]) < kappa);
  }
  CHECK(children_of_two > 50);
  // A fifth of the anchors, and a fifth of those: the published target, within the tolerance or one voxel.
  const double heads = static_cast<double>(levels.counts()[1] + levels.counts()[2]);
  CHECK(heads / 5000 == doctest::Approx(0.2).epsilon(0.2));
  CHECK(static_cast<double>(levels.counts()[2]) / heads == doctest::Approx(0.2).epsilon(0.3));
}

TEST_CASE("context_gs/anchor_levels: masked anchors do not exist, and the order of the rows does not matter") {
  const std::vector<Voxel> voxels = surface(2000, 40);
  const std::vector<std::uint8_t> unmasked = some_unmasked(2000);
  const AnchorCells cells{6, 14};
  AnchorLevels all, kept;
  all.sort(voxels, cells);
  all.assign(unmasked);
  // Only the unmasked ones, and of those whose voxels are alike the order among themselves alone is kept.
  std::vector<std::uint32_t> order;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    if (unmasked[i] != 0) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const auto mixed = [&](std::uint32_t i) {
      return mix_bits(static_cast<std::uint64_t>(voxels[i][0] * 1000 * 1000 + voxels[i][1] * 1000 + voxels[i][2]));
    };
    return mixed(a) < mixed(b);
  });
  std::vector<Voxel> shuffled;
  for (const std::uint32_t row : order) shuffled.push_back(voxels[row]);
  kept.sort(shuffled, cells);
  kept.assign();
  for (std::size_t i = 0; i < order.size(); ++i) {
    CHECK(kept.level()[i] == all.level()[order[i]]);
    const std::uint32_t parent = kept.parent()[i];
    CHECK((parent == AnchorLevels::none ? parent : order[parent]) == all.parent()[order[i]]);
  }
}

TEST_CASE("context_gs/anchor_levels: no anchors, one anchor, one voxel, one cell") {
  AnchorLevels levels;
  levels.sort({}, {3, 9});
  levels.assign();
  CHECK(levels.level().empty());
  CHECK(choose_anchor_cells({}) == AnchorCells{1, 1});
  std::vector<Voxel> voxels(5, Voxel{-7, 3, 2});
  levels.sort(voxels, choose_anchor_cells(voxels));
  levels.assign();
  CHECK(levels.counts() == std::array<std::size_t, 3>{4, 0, 1});
  CHECK(levels.level()[0] == 2);
  for (std::size_t i = 1; i < 5; ++i) CHECK(levels.parent()[i] == 0);
  const std::vector<std::uint8_t> nobody(5, 0);
  levels.assign(nobody);
  CHECK(levels.counts() == std::array<std::size_t, 3>{});
  voxels = {{INT32_MIN, 0, 0}, {INT32_MAX, 0, 0}, {0, INT32_MIN, INT32_MAX}};
  levels.sort(voxels, choose_anchor_cells(voxels));
  levels.assign();
  CHECK(levels.counts()[0] + levels.counts()[1] + levels.counts()[2] == 3);
}

TEST_CASE("context_gs/anchor_levels: negative control: rows in the published order have other anchors' parents") {
  const std::vector<Voxel> voxels = surface(20000, 150);
  const AnchorCells cells = choose_anchor_cells(voxels);
  AnchorLevels levels;
  levels.sort(voxels, cells);
  levels.assign();
  // The published code gathers the parents of level 1 by ascending row, and codes its anchors by ascending cell.
  std::vector<std::uint32_t> by_row, by_cell;
  for (std::uint32_t i = 0; i < voxels.size(); ++i) {
    if (levels.level()[i] == 1) by_row.push_back(i);
  }
  by_cell = by_row;
  std::sort(by_cell.begin(), by_cell.end(), [&](std::uint32_t a, std::uint32_t b) {
    return cell(voxels[a], cells.fine) < cell(voxels[b], cells.fine);
  });
  std::size_t right = 0, ours = 0;
  for (std::size_t i = 0; i < by_cell.size(); ++i) {
    const Voxel own = cell(voxels[by_cell[i]], cells.coarse);
    right += own == cell(voxels[levels.parent()[by_row[i]]], cells.coarse) ? 1 : 0;
    ours += own == cell(voxels[levels.parent()[by_cell[i]]], cells.coarse) ? 1 : 0;
  }
  CHECK(ours == by_cell.size());
  CHECK(static_cast<double>(right) < 0.05 * static_cast<double>(by_cell.size()));
}

TEST_CASE("context_gs/anchor_levels: while training, sorted when anchors change, assigned when one dies, else kept") {
  constexpr double size = 0.013;
  const std::vector<Voxel> voxels = surface(700, 30);
  std::vector<float> position(2100), mask(1400, 0.0f);
  for (std::size_t i = 0; i < 700; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) position[3 * i + axis] = voxel_position(voxels[i][axis], size);
  }
  SerialExecutor serial;
  ContextGsLevels<float> levels;
  const auto update = [&](std::size_t n, AnchorCells cells) {
    return levels.update(MatrixView<const float>{position.data(), n, 3}, MatrixView<const float>{mask.data(), n, 2},
                         cells, size, serial);
  };
  CHECK(update(700, {4, 11}) == 2);
  CHECK(std::equal(voxels.begin(), voxels.end(), levels.voxels().begin()));
  CHECK(update(700, {4, 11}) == 0);
  mask[6] = -9;  // anchor 3 lives by its second offset
  CHECK(update(700, {4, 11}) == 0);
  mask[7] = -9;
  CHECK(update(700, {4, 11}) == 1);
  CHECK(levels.levels().level()[3] == AnchorLevels::masked);
  CHECK(update(600, {4, 11}) == 2);
  CHECK(update(600, {5, 11}) == 2);
  position[0] += 0.013f;
  CHECK(update(600, {5, 11}) == 2);
  AnchorLevels fresh;
  std::vector<std::uint8_t> unmasked(600, 1);
  unmasked[3] = 0;
  fresh.sort(levels.voxels(), {5, 11});
  fresh.assign(unmasked);
  CHECK(std::equal(fresh.parent().begin(), fresh.parent().end(), levels.levels().parent().begin()));
}
