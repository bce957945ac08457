// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The AnchorModel that a recipe names is the one that is asked which anchors a view sees.
#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/anchor/level_of_detail.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "support/directional.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::SmoothRecipe;

/// Sees every other anchor.
struct EveryOther : SmoothRecipe::AnchorModel {
  static std::size_t& calls() {
    static std::size_t count = 0;
    return count;
  }
  template <class Lens, Executor E>
  static void find_visible(const AnchorColumns<const double>& columns, const Camera<double>& camera, const Lens& lens,
                           const VisibilitySettings& settings, Buffer<std::uint32_t>& visible,
                           VisibilityWorkspace& workspace, E& executor) {
    ++calls();
    SmoothRecipe::AnchorModel::find_visible(columns, camera, lens, settings, visible, workspace, executor);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < visible.size(); ++i) {
      if (visible[i] % 2 == 0) visible[kept++] = visible[i];
    }
    visible.resize(kept);
  }
};
struct SeesEveryOther : SmoothRecipe {
  using AnchorModel = EveryOther;
};

template <class R>
std::vector<double> render(std::size_t& visible) {
  const Model<R> model = testing::random_model<R>(40);
  typename Pipeline<R>::Context context;
  SerialExecutor executor;
  const ForwardReport report = Pipeline<R>{}.forward(model, testing::ring_camera(1, 5, 37, 29), 0, context, executor);
  visible = report.visible_anchors;
  return {context.image.data, context.image.data + context.image.size()};
}

}  // namespace

TEST_CASE("training/own_anchors: the anchors of the recipe are asked, and what they leave out is not drawn") {
  std::size_t all = 0, half = 0, detailed = 0, coarse = 0;
  const std::vector<double> whole = render<SmoothRecipe>(all);
  CHECK(EveryOther::calls() == 0);
  const std::vector<double> partial = render<SeesEveryOther>(half);
  CHECK(EveryOther::calls() == 1);
  CHECK(2 * half <= all + 1);
  CHECK(partial != whole);
  CHECK(render<recipes::WithDetail<SmoothRecipe, DetailLimit{.least_pixels = 0}>>(detailed) == whole);
  CHECK(detailed == all);
  CHECK(render<recipes::WithDetail<SmoothRecipe, DetailLimit{.least_pixels = 1e6f}>>(coarse) != whole);
  CHECK(coarse == 0);
}
