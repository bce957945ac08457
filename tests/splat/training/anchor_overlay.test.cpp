// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/training/anchor_overlay.hpp"

#include <doctest/doctest.h>

#include <cstring>
#include <string>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/recipes/recipe_stages.hpp"
#include "compmark/testing/gradient.hpp"
#include "support/small_scene.hpp"
#include "support/stage_scene.hpp"

namespace {

using namespace compmark;

using testing::small_shape;

template <class T, class Embed, class Distort>
using Changing =
    JoinStages<StageList<>, detail::NamedStage<EmbedderStage, Embed>, detail::NamedStage<DistortionStage, Distort>>;

template <class T, class Embed, class Distort>
struct OverlayScene : testing::StageScene<T, Changing<T, Embed, Distort>> {
  static constexpr std::size_t anchors = 40;
  using Base = testing::StageScene<T, Changing<T, Embed, Distort>>;
  using Base::context;
  using Base::model;
  ParameterArena<T>& arena = model.arena;
  std::vector<std::uint32_t> visible;

  OverlayScene() : Base(anchors, small_shape) {
    const Random random(2, 0, random_stage("anchor road test"));
    for (std::size_t i = 0; i < arena.all_values().size(); ++i) {
      arena.all_values()[i] += static_cast<T>(0.4 * random.normal(i));
    }
    for (std::uint32_t row = 2; row < anchors; row += 3) visible.push_back(row);
    context.visible.resize(visible.size());
    std::copy(visible.begin(), visible.end(), context.visible.begin());
  }
  [[nodiscard]] static T slope(std::size_t which, std::size_t row, std::size_t c) {
    return static_cast<T>(std::sin(static_cast<double>(1 + 1000 * which + 31 * row + c)));
  }
  template <class F>
  static void for_tables(const AnchorColumns<T>& columns, const F& f) {
    std::size_t which = 0;
    for (const MatrixView<T>& view : {columns.feature, columns.position, columns.scaling, columns.offset})
      f(view, which++);
  }
  /// sum over visible rows of slope * what the decoder would read
  template <Executor E>
  double loss(E& executor) {
    const AnchorColumns<const T> columns = this->read(executor);
    double sum = 0;
    std::size_t which = 0;
    for (const MatrixView<const T>& view : {columns.feature, columns.position, columns.scaling, columns.offset}) {
      for (const std::uint32_t row : visible) {
        for (std::size_t c = 0; c < view.columns; ++c) {
          sum += static_cast<double>(slope(which, row, c)) * static_cast<double>(view(row, c));
        }
      }
      ++which;
    }
    if constexpr (present<Distort>) sum += context.stages.template of<DistortionStage>().report.rate_loss;
    return sum;
  }
  template <Executor E>
  void backward(E& executor) {
    const AnchorColumns<T> d = this->gradients(executor);
    for_tables(d, [&](const MatrixView<T>& view, std::size_t which) {
      for (const std::uint32_t row : visible) {
        for (std::size_t c = 0; c < view.columns; ++c) view(row, c) += slope(which, row, c);
      }
    });
    this->carry(executor);
  }
};
using OverlayNoise = QuantizationNoise<double, small_shape.feature_dim>;
template <AnchorAttribute target>
using Mark = BoundedResidual<double, target>;

template <class Embed, class Distort>
std::string gradients(const DistortionPhase& phase) {
  OverlayScene<double, Embed, Distort> scene;
  if constexpr (present<Distort>) scene.phases.template of<DistortionStage>() = phase;
  SerialExecutor serial;
  const auto loss = [&] { return scene.loss(serial); };
  static_cast<void>(loss());
  scene.backward(serial);
  const std::vector<double> gradient(scene.arena.all_gradients().begin(), scene.arena.all_gradients().end());
  // Once more: what is handed on must add, and the tables of the first time must not be left over.
  static_cast<void>(loss());
  scene.backward(serial);
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    if (scene.arena.all_gradients()[i] != gradient[i] + gradient[i]) return "the second pass did not add the same";
  }
  return testing::gradient_law(loss, scene.arena.all_values(), gradient, 1e-6, 400);
}

}  // namespace

TEST_CASE(
    "training/anchor_overlay: gradients of every block, for each attribute that may carry the mark (central "
    "differences)") {
  DistortionPhase noisy;
  noisy.adaptive = true;
  noisy.scaling = 0.01;
  noisy.offset = 0.2;
  noisy.seed = 5;
  CHECK(gradients<Mark<AnchorAttribute::feature>, NoDistortion>({}) == "");
  CHECK(gradients<Mark<AnchorAttribute::position>, NoDistortion>({}) == "");
  CHECK(gradients<Mark<AnchorAttribute::scaling>, NoDistortion>({}) == "");
  CHECK(gradients<Mark<AnchorAttribute::offset>, NoDistortion>({}) == "");
  CHECK(gradients<NoEmbedder, OverlayNoise>(noisy) == "");
  CHECK(gradients<Mark<AnchorAttribute::feature>, OverlayNoise>(noisy) == "");
  CHECK(gradients<Mark<AnchorAttribute::scaling>, OverlayNoise>(noisy) == "");
  noisy.adaptive = false;
  noisy.feature_uniform = 1;
  CHECK(gradients<Mark<AnchorAttribute::feature>, OverlayNoise>(noisy) == "");
  CHECK(gradients<Mark<AnchorAttribute::feature>, OverlayNoise>({}) == "");  // a phase of nothing
}

TEST_CASE("training/anchor_overlay: with neither stage the decoder reads the arena itself, and nothing is stored") {
  OverlayScene<float, NoEmbedder, NoDistortion> scene;
  static_assert(!decltype(scene)::Stages::changes_attributes);
  static_assert(Changing<float, ResidualFeature<float>, NoDistortion>::changes_attributes);
  SerialExecutor serial;
  const AnchorColumns<const float> columns = scene.read(serial);
  CHECK(columns.feature.data == scene.arena.values(scene.model.anchors.feature).data);
}

TEST_CASE("training/anchor_overlay: baking keeps what is read, to the bit") {
  OverlayScene<float, ResidualFeature<float>, NoDistortion> scene;
  SerialExecutor serial;
  const double before = scene.loss(serial);
  scene.bake();
  CHECK(scene.loss(serial) == before);
  for (const float r : scene.arena.values(scene.model.stages.of<EmbedderStage>().residual).flat()) CHECK(r == 0.0f);
}

TEST_CASE("training/anchor_overlay: same bits at any thread count") {
  using Scene = OverlayScene<float, ResidualFeature<float>, QuantizationNoise<float, small_shape.feature_dim>>;
  Scene one, four;
  one.phases.of<DistortionStage>().adaptive = four.phases.of<DistortionStage>().adaptive = true;
  SerialExecutor serial;
  ThreadExecutor threads(4);
  CHECK(one.loss(serial) == four.loss(threads));
  one.backward(serial);
  four.backward(threads);
  CHECK(std::memcmp(one.arena.all_gradients().data(), four.arena.all_gradients().data(),
                    one.arena.all_gradients().size_bytes()) == 0);
}
