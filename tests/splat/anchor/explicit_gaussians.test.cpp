// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/anchor/explicit_gaussians.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/raster/tile.hpp"

namespace {

using namespace compmark;

struct ScatteredGaussians {
  ParameterArena<float> arena;
  AnchorHandles anchors;
  Camera<float> camera{.width = 120, .height = 80, .fx = 110, .fy = 105, .cx = 55, .cy = 42};

  explicit ScatteredGaussians(std::size_t rows) {
    anchors = ExplicitGaussians<float, 1>::add_parameters(arena, rows);
    const auto fill = [&](BlockHandle block, double mean, double deviation) {
      std::size_t i = 0;
      for (float& value : arena.values(block).flat())
        value = static_cast<float>(mean + deviation * Random(8, 2, block.index).normal(i++));
    };
    fill(anchors.position, 0, 2);
    fill(anchors.scaling, -3, 1);
    fill(anchors.offset, 0, 0.3);
    fill(anchors.feature, 0.3, 0.3);
  }
  AnchorColumns<const float> table() const { return anchor_values(arena, anchors); }
  template <class E>
  std::vector<std::uint32_t> visible(E& executor) const {
    Buffer<std::uint32_t> found;
    VisibilityWorkspace workspace;
    ExplicitGaussians<float, 1>::find_visible(table(), camera, PinholeLens{}, {}, found, workspace, executor);
    return {found.data(), found.data() + found.size()};
  }
  std::vector<float> render(const std::vector<std::uint32_t>& rows) const {
    SerialExecutor executor;
    GaussianBatch<float> batch;
    ExplicitDecoder<float, 1>::Context context;
    ExplicitDecoder<float, 1>{}.forward(table(), rows, camera.center_world, 0, arena, {}, batch, context, executor);
    std::vector<float> pixels(3 * 120 * 80);
    TileRasterizer<float>::Context raster;
    TileRasterizer<float>{}.forward(std::as_const(batch).columns(), camera, {0, 0, 0},
                                    {pixels.data(), 3, camera.height, camera.width}, raster, executor);
    return pixels;
  }
};

}  // namespace

TEST_CASE("anchor/explicit_gaussians: what is left out is in no picture, to the bit, and most of a scene is left out") {
  ScatteredGaussians scene(6000);
  SerialExecutor executor;
  std::vector<std::uint32_t> all(6000);
  std::iota(all.begin(), all.end(), 0u);
  for (int turn = 0; turn < 4; ++turn) {
    const float a = 0.7f * static_cast<float>(turn);
    scene.camera.rotation_camera_world = {std::cos(a), 0, std::sin(a), 0, 1, 0, -std::sin(a), 0, std::cos(a)};
    scene.camera.center_world = {0.5 * turn, 0.2, -1.0 + turn};
    const std::vector<std::uint32_t> visible = scene.visible(executor);
    CHECK(std::is_sorted(visible.begin(), visible.end()));
    CHECK(visible.size() < 4500);
    CHECK(visible.size() > 50);
    CHECK(scene.render(visible) == scene.render(all));
    // Negative control: the pictures do see a Gaussian less.
    std::vector<std::uint32_t> fewer = visible;
    fewer.erase(fewer.begin(), fewer.begin() + static_cast<std::ptrdiff_t>(fewer.size() / 2));
    CHECK(scene.render(fewer) != scene.render(all));
  }
}

TEST_CASE("anchor/explicit_gaussians: behind the near plane nothing is visible, NaN is, and threads change nothing") {
  ScatteredGaussians scene(9000);
  const MatrixView<float> position = scene.arena.values(scene.anchors.position);
  position(0, 2) = -1;
  position(1, 0) = std::numeric_limits<float>::quiet_NaN();
  SerialExecutor serial;
  ThreadExecutor threads(3);
  const std::vector<std::uint32_t> visible = scene.visible(serial);
  CHECK(visible == scene.visible(threads));
  CHECK(std::binary_search(visible.begin(), visible.end(), 1u));
  const AnchorColumns<const float> table = scene.table();
  for (const std::uint32_t row : visible) {
    if (row != 1) CHECK(table.position(row, 2) + table.offset(row, 2) * std::exp(table.scaling(row, 2)) > 0.2f);
  }
}
