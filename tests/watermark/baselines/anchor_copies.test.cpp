// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/anchor_copies.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/splat/training/pipeline.hpp>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <string>
#include <vector>

#include "support/directional.hpp"

using namespace compmark;

TEST_CASE("baselines/anchor_copies: rows are kept in order and copies follow, networks are as they were") {
  using R = testing::SmoothRecipe;
  const Model<R> model = testing::random_model<R>(7);
  const std::vector<std::uint32_t> kept{0, 2, 5, 6}, copied{5, 0};
  const Model<R> result = with_copies(model, kept, copied);
  REQUIRE(result.anchor_count() == 6);
  std::vector<std::uint32_t> from = kept;
  from.insert(from.end(), copied.begin(), copied.end());
  for (std::size_t b = 0; b < model.arena.layout().blocks().size(); ++b) {
    const ArenaLayout::Block& block = model.arena.layout().blocks()[b];
    CAPTURE(std::string(block.name));
    const auto before = model.arena.values(BlockHandle{b}), after = result.arena.values(BlockHandle{b});
    if (block.kind == RowKind::fixed) {
      CHECK(std::equal(before.flat().begin(), before.flat().end(), after.flat().begin()));
      continue;
    }
    REQUIRE(after.rows == 6);
    for (std::size_t row = 0; row < 6; ++row)
      CHECK(std::equal(after.row(row), after.row(row) + after.columns, before.row(from[row])));
  }
}

TEST_CASE("baselines/anchor_copies: where all anchors are copied the transmittance of every pixel is squared") {
  using R = testing::SmoothRecipe;
  const Model<R> model = testing::random_model<R>(9);
  std::vector<std::uint32_t> all(9);
  std::iota(all.begin(), all.end(), std::uint32_t{0});
  const Camera<double> camera = testing::ring_camera(1, 5, 23, 19);
  SerialExecutor serial;
  const Pipeline<R> pipeline;
  // A render on white is one on black and the transmittance.
  const auto transmittance = [&](Model<R> shown) {
    Pipeline<R>::Context context;
    std::vector<double> light;
    for (const double behind : {0.0, 1.0}) {
      shown.render.background = {behind, behind, behind};
      static_cast<void>(pipeline.forward(shown, camera, 0, context, serial));
      for (std::size_t i = 0; i < context.image.size(); ++i) {
        if (behind == 0) {
          light.push_back(-context.image.data[i]);
        } else {
          light[i] += context.image.data[i];
        }
      }
    }
    return light;
  };
  const std::vector<double> once = transmittance(model), twice = transmittance(with_copies(model, all, all));
  double worst = 0, changed = 0;
  for (std::size_t i = 0; i < once.size(); ++i) {
    worst = std::max(worst, std::abs(twice[i] - once[i] * once[i]));
    changed = std::max(changed, std::abs(twice[i] - once[i]));
  }
  CHECK(worst < 1e-12);
  CHECK(changed > 0.05);  // the control: copies do change the render
}
