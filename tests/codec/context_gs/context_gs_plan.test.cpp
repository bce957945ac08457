// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/context_gs/context_gs_plan.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <set>
#include <vector>

namespace {

using namespace compmark;

constexpr std::size_t planned_anchors = 3000;

AnchorLevels some_levels() {
  const Random random(3, 0, random_stage("context gs plan test"));
  std::vector<Voxel> voxels(planned_anchors);
  std::vector<std::uint8_t> unmasked(planned_anchors);
  for (std::size_t i = 0; i < planned_anchors; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      voxels[i][axis] = static_cast<std::int32_t>(random.below(4 * i + axis, 50)) - 20;
    }
    unmasked[i] = random.uniform(4 * i + 3) < 0.9 ? 1 : 0;
  }
  AnchorLevels levels;
  levels.sort(voxels, {6, 17});
  levels.assign(unmasked);
  return levels;
}

}  // namespace

TEST_CASE(
    "context_gs/context_gs_plan: who is wanted, all of their ancestors, and nobody else, each once, parents before "
    "children") {
  const AnchorLevels levels = some_levels();
  std::vector<std::uint32_t> few, many;
  for (std::uint32_t i = 0; i < planned_anchors; ++i) {
    if (levels.level()[i] == 0 && few.size() < 4 && i > 1000) few.push_back(i);
    if (i % 3 == 0) many.push_back(i);
  }
  ContextGsPlan plan;  // one for all, as in training
  for (const double share : {0.0, 0.001, 0.2, 1.0}) {
    for (const std::vector<std::uint32_t>& rows : {few, many, std::vector<std::uint32_t>{}}) {
      const Random random(1, 2, 3);
      plan.build(levels, rows, random, share);
      std::set<std::uint32_t> wanted, drawn;
      std::size_t visible = 0;
      for (std::uint32_t i = 0; i < planned_anchors; ++i) {
        if (random.uniform(i) < share) drawn.insert(i);
      }
      CHECK(plan.drawn == drawn.size());
      for (const std::uint32_t row : rows) {
        visible += levels.level()[row] != AnchorLevels::masked ? 1 : 0;
        wanted.insert(row);
      }
      CHECK(plan.visible_unmasked == visible);
      wanted.insert(drawn.begin(), drawn.end());
      for (auto at = wanted.begin(); at != wanted.end();)
        at = levels.level()[*at] == AnchorLevels::masked ? wanted.erase(at) : std::next(at);
      const std::set<std::uint32_t> asked = wanted;
      for (std::uint32_t row : asked) {
        for (; row != AnchorLevels::none; row = levels.parent()[row]) wanted.insert(row);
      }
      CHECK((rows != few || share > 0 || wanted.size() > asked.size() + 4));

      std::vector<std::uint32_t> met;
      std::size_t end = 0;
      for (std::size_t level = 3; level-- > 0;) {
        for (const bool full : {false, true}) {
          const ContextGsPlan::Section& section = full ? plan.full[level] : plan.light[level];
          CHECK(section.first == end);
          CHECK(section.first % ContextGsPlan::panel == 0);
          end = section.first + section.panels() * ContextGsPlan::panel;
          for (std::size_t e = section.first; e < section.first + section.count; ++e) {
            const std::uint32_t row = plan.row[e];
            CHECK(levels.level()[row] == level);
            CHECK(full == (drawn.count(row) != 0));
            CHECK(plan.entry[row] == e);
            if (e > section.first) CHECK(plan.row[e - 1] < row);
            met.push_back(row);
            if (level == 2) {
              CHECK(plan.parent[e] == AnchorLevels::none);
              continue;
            }
            CHECK(plan.row[plan.parent[e]] == levels.parent()[row]);
            CHECK(plan.parent[e] < (level == 1 ? plan.light[1].first : plan.coarse));
            const auto* const children = plan.child.data();
            const auto first = plan.child_begin[plan.parent[e]], last = plan.child_begin[plan.parent[e] + 1];
            CHECK(std::is_sorted(children + first, children + last));
            CHECK(std::binary_search(children + first, children + last, static_cast<std::uint32_t>(e)));
          }
        }
      }
      CHECK(end == plan.capacity);
      std::sort(met.begin(), met.end());
      CHECK(std::equal(met.begin(), met.end(), wanted.begin(), wanted.end()));
      CHECK(plan.child.size() + plan.light[2].count + plan.full[2].count == met.size());
      // Panels: each entry in one, light ones first.
      std::size_t covered = 0, rates = 0;
      for (std::size_t level = 0; level < 3; ++level) {
        for (std::size_t p = 0; p < plan.panels(level); ++p) {
          const ContextGsPlan::Section at = plan.panel_at(level, p);
          CHECK(at.count > 0);
          CHECK(at.count <= ContextGsPlan::panel);
          covered += at.count;
          if (!plan.is_full(level, p)) continue;
          CHECK(plan.rate_of(level, at.first) + ContextGsPlan::panel <= plan.rates);
          rates += at.count;
        }
      }
      CHECK(covered == met.size());
      CHECK(rates == plan.drawn_unmasked);
    }
  }
}
