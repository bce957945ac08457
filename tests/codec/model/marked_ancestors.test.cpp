// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// ContextGS under a mark: what an anchor's context reads of its ancestors is what the file will hold of them, marked, whether they are in view or not.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/codec/context_gs/context_gs_model.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/recipes/recipe_stages.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/watermark/embed/residual.hpp"
#include "support/small_scene.hpp"
#include "support/stage_scene.hpp"

namespace {

using namespace compmark;

using testing::small_shape;

using Rate = ContextGsModel<double, small_shape.feature_dim, small_shape.offsets, 5>;
using MarkedRate = StageList<EmbedderStage<ResidualFeature<double>>, RateStage<Rate>>;

struct AncestorScene : testing::StageScene<double, MarkedRate> {
  static constexpr std::size_t anchors = 300;
  static constexpr double voxel_size = 0.02;
  ParameterArena<double>& arena = model.arena;
  AnchorHandles& table = model.anchors;
  std::vector<std::uint32_t> visible;

  static Rate::Settings settings() {
    Rate::Settings s;
    s.lambda = 40;  // the rate's gradient and the slopes' are of one size
    s.sample = 0.3;
    return s;
  }
  AncestorScene() : StageScene(anchors, small_shape) {
    stages.of<RateStage>() = RateStage(Rate(settings()));
    const Rate::Handles& rate = model.stages.of<RateStage>();
    const Random random(2, 0, random_stage("marked ancestors test"));
    std::uint64_t at = 0;
    const auto fill = [&](BlockHandle block, double scale, double shift) {
      for (double& value : arena.values(block).flat()) value = shift + scale * random.normal(at++);
    };
    for (double& x : arena.values(table.position).flat())
      x = voxel_size * static_cast<double>(std::lround(12 * random.normal(at++)));
    fill(table.feature, 2, 0.3);
    fill(table.scaling, 0.7, -4);
    fill(table.offset, 0.8, 0);
    fill(rate.mask, 2, 0);
    fill(rate.hyperprior, 1.5, 0);
    for (const auto& network : rate.network)
      fill(network.weight2, 0.05, 0);  // larger ones hold steps at their least, whose gradient is none
    fill(residual(), 0.5, 0);
    const AnchorColumns<const double> columns = anchor_values(std::as_const(arena), table);
    Rate::begin_context(arena, rate, columns.position, columns.feature, columns.scaling, columns.offset, voxel_size);
    for (std::uint32_t row = 0; row < anchors; row += 4) visible.push_back(row);
    context.visible.resize(visible.size());
    std::copy(visible.begin(), visible.end(), context.visible.begin());
    phases.of<RateStage>() = {.context = true, .seed = 3, .iteration = 12};
  }
  [[nodiscard]] BlockHandle residual() const { return model.stages.of<EmbedderStage>().residual; }
  [[nodiscard]] static double slope(std::size_t row, std::size_t c) {
    return std::sin(static_cast<double>(1 + 31 * row + c));
  }
  /// The rate, and slopes times the features that the decoder would read.
  template <Executor E>
  double loss(E& executor) {
    const AnchorColumns<const double> columns = read(executor);
    double sum = context.stages.of<RateStage>().report.loss;
    for (const std::uint32_t row : visible) {
      for (std::size_t c = 0; c < columns.feature.columns; ++c) sum += slope(row, c) * columns.feature(row, c);
    }
    return sum;
  }
  template <Executor E>
  void backward(E& executor) {
    std::fill(arena.all_gradients().begin(), arena.all_gradients().end(), 0.0);
    const AnchorColumns<double> d = gradients(executor);
    for (const std::uint32_t row : visible) {
      for (std::size_t c = 0; c < d.feature.columns; ++c) d.feature(row, c) += slope(row, c);
    }
    carry(executor);
  }
  /// Rows that are looked at for their descendants alone.
  [[nodiscard]] std::vector<std::size_t> ancestors() const {
    std::vector<std::size_t> rows;
    const auto& plan = context.stages.of<RateStage>().rate.plan;
    for (std::size_t row = 0; row < anchors; ++row) {
      if (plan.mark[row] == ContextGsPlan::needed) rows.push_back(row);
    }
    return rows;
  }
};

}  // namespace

TEST_CASE("model/marked_ancestors: gradients by the residual and by the features, of ancestors out of view too") {
  AncestorScene scene;
  SerialExecutor serial;
  const auto loss = [&] { return scene.loss(serial); };
  static_cast<void>(loss());
  scene.backward(serial);
  const std::vector<std::size_t> ancestors = scene.ancestors();
  REQUIRE(ancestors.size() > 5);
  const MatrixView<double> gradient = scene.arena.gradients(scene.residual());
  for (const std::size_t row : ancestors) {
    double size = 0;
    for (std::size_t c = 0; c < gradient.columns; ++c) size += std::abs(gradient(row, c));
    CHECK(size > 0);
  }
  for (const BlockHandle block : {scene.residual(), scene.table.feature}) {
    const std::span<double> d = scene.arena.gradients(block).flat();
    const std::vector<double> kept(d.begin(), d.end());
    CHECK(testing::gradient_law(loss, scene.arena.values(block).flat(), kept, 1e-6, 60) == "");
    // All at once. Measured 4e-7 and 2e-6; steps ten times as long meet kinks of hidden units.
    CHECK(testing::directional_error(loss, std::vector<std::span<double>>{scene.arena.values(block).flat()},
                                     std::vector<std::span<const double>>{kept}, 1e-6) < 2e-5);
  }
}

TEST_CASE("model/marked_ancestors: what is counted is what the marked model costs once its mark is baked in") {
  AncestorScene scene;
  SerialExecutor serial;
  const double marked = scene.loss(serial);
  const std::vector<std::size_t> ancestors = scene.ancestors();
  AncestorScene baked;
  baked.bake();
  baked.phases.of<EmbedderStage>().embeds = false;
  CHECK(baked.loss(serial) == doctest::Approx(marked).epsilon(1e-12));

  // Negative control: a mark that is left out of the ancestors alone costs something else.
  for (const std::size_t row : ancestors) {
    for (std::size_t c = 0; c < static_cast<std::size_t>(small_shape.feature_dim); ++c)
      scene.arena.values(scene.residual())(row, c) = 0;
  }
  CHECK(std::abs(scene.loss(serial) - marked) > 1e-6 * std::abs(marked));  // measured 2e-4
}

TEST_CASE("model/marked_ancestors: same bits at any thread count") {
  AncestorScene one, four;
  SerialExecutor serial;
  ThreadExecutor threads(4);
  CHECK(one.loss(serial) == four.loss(threads));
  one.backward(serial);
  four.backward(threads);
  CHECK(std::equal(one.arena.all_gradients().begin(), one.arena.all_gradients().end(),
                   four.arena.all_gradients().begin()));
}
