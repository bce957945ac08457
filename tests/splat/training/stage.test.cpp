// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A stage of one's own: one type in the list of a recipe, and nothing else is touched. It trains, it is called in order, and where it is left out
// nothing of it is there.
#include "compmark/splat/training/stage.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/recipes/captures.hpp"
#include "compmark/recipes/recipe_stages.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/trainer.hpp"
#include "support/directional.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;

/// The photographs are dimmed by one unknown factor, exp(gain), which is a block of the model: image -> exp(gain) image, and a loss that keeps the
/// gain small.
struct DimmedStage : Stage<DimmedStage> {
  using Own = StageOf<DimmedStage>;
  struct Handles {
    BlockHandle gain;
  };
  struct Phase {
    double weight = 0;  ///< of gain^2
  };
  struct Context {
    std::vector<double> before;
    double gain = 0;
  };
  double weight = 0.01;

  template <class Arena>
  static Handles add_parameters(Arena& arena, const AnchorHandles&, std::size_t) {
    return {arena.add("dimmed.gain", 1, 1, RowKind::fixed, BlockRole::rendering, LearningSchedule::constant(0.02))};
  }
  void set_phase(const StageIteration&, Phase& phase) const { phase.weight = weight; }
  template <class Pass>
  static void image(const Pass& pass, const Own& own) {
    const auto image = pass.context.image;
    own.context.before.assign(image.data, image.data + image.size());
    own.context.gain = static_cast<double>(pass.model.arena.values(own.blocks.gain).data[0]);
    for (std::size_t i = 0; i < image.size(); ++i)
      image.data[i] =
          static_cast<std::remove_cvref_t<decltype(image.data[i])>>(std::exp(own.context.gain) * own.context.before[i]);
  }
  template <class Pass, class Report>
  static void loss(const Pass&, const StageOfLoss<DimmedStage>& own, Report& report) {
    report.total += own.phase.weight * own.context.gain * own.context.gain;
  }
  template <class Pass>
  static void image_backward(const Pass& pass, const Own& own) {
    const auto d_image = pass.context.d_image;
    const double factor = std::exp(own.context.gain);
    double sum = 2 * own.phase.weight * own.context.gain;
    for (std::size_t i = 0; i < d_image.size(); ++i) {
      sum += static_cast<double>(d_image.data[i]) * factor * own.context.before[i];
      d_image.data[i] =
          static_cast<std::remove_cvref_t<decltype(d_image.data[i])>>(factor * static_cast<double>(d_image.data[i]));
    }
    auto& gradient = pass.model.arena.gradients(own.blocks.gain).data[0];
    gradient += static_cast<std::remove_cvref_t<decltype(gradient)>>(sum);
  }
};
struct Dimmed : recipes::Scaffold {
  using Stages = StageList<DimmedStage>;
};
template <class Base>
struct DimmedOver : Base {
  using Stages = StageList<DimmedStage>;
};

/// Writes down who was called.
template <int number>
struct Noted : Stage<Noted<number>> {
  struct Context {
    std::string* calls = nullptr;
  };
  template <class Pass>
  static void image(const Pass&, const StageOf<Noted>& own) {
    if (own.context.calls != nullptr) *own.context.calls += std::to_string(number);
  }
  template <class Pass>
  static void image_backward(const Pass&, const StageOf<Noted>& own) {
    if (own.context.calls != nullptr) *own.context.calls += std::to_string(number);
  }
};
struct NotedThrice : testing::SmoothRecipe {
  using Stages = StageList<Noted<1>, Noted<2>, Noted<3>>;
};

template <class T>
struct Wrapped : Stage<Wrapped<T>> {
  struct Context {
    T value{};
  };
};

}  // namespace

TEST_CASE("training/stage: lists are found by type and by template, and join") {
  using List = JoinStages<StageList<Noted<1>>, StageList<>, StageList<Wrapped<int>, DimmedStage>>;
  static_assert(std::is_same_v<List, StageList<Noted<1>, Wrapped<int>, DimmedStage>>);
  static_assert(has_stage<List, Wrapped> && !has_stage<StageList<Noted<1>>, Wrapped>);
  static_assert(std::is_same_v<FindStage<List, Wrapped>, Wrapped<int>>);
  static_assert(!List::changes_attributes && !StageList<>::changes_attributes && !StageList<>::needs_alpha);
  StageMembers<List, StageContext> contexts;
  contexts.of<Wrapped>().value = 7;
  CHECK(contexts.of<Wrapped<int>>().value == 7);
  std::string order;
  List::forward([&]<class S>() { order += std::is_same_v<S, DimmedStage> ? "d" : "."; });
  List::backward([&]<class S>() { order += std::is_same_v<S, DimmedStage> ? "d" : "."; });
  CHECK(order == "..dd..");
}

TEST_CASE("training/stage: what a recipe leaves out takes no room") {
  static_assert(std::is_empty_v<StageMembers<StageList<>, StageContext>>);
  static_assert(std::is_empty_v<StageMembers<StageList<Noted<1>, Noted<2>>, StageHandles>>);  // two empty ones too
  static_assert(sizeof(Model<recipes::Scaffold>) < sizeof(Model<Dimmed>));
  static_assert(sizeof(Pipeline<recipes::Scaffold>) == sizeof(recipes::Scaffold::GaussianDecoder));
  Model<recipes::Scaffold> plain;
  plain.create(5, 2);
  CHECK(!plain.arena.layout().find("dimmed.gain").valid());
  CHECK(RecipeStages<recipes::Scaffold>::count == 0);
  CHECK(RecipeStages<recipes::ScaffoldAlpha>::count == 2);
}

TEST_CASE("training/stage: hooks are called in the order of the list, and backwards in the reverse order") {
  Model<NotedThrice> model = testing::random_model<NotedThrice>(12);
  const Pipeline<NotedThrice> pipeline;
  Pipeline<NotedThrice>::Context context;
  std::string calls;
  decltype(context.stages)& stages = context.stages;
  stages.of<Noted<1>>().calls = stages.of<Noted<2>>().calls = stages.of<Noted<3>>().calls = &calls;
  SerialExecutor executor;
  const Camera<double> camera = testing::ring_camera(1, 5, 20, 16);
  static_cast<void>(pipeline.forward(model, camera, 0, context, executor));
  CHECK(calls == "123");
  const std::vector<double> target(3 * 20 * 16, 0.5);
  static_cast<void>(pipeline.loss(ImageView<const double>{target.data(), 3, 16, 20}, {}, context, executor));
  pipeline.backward(model, camera, 0, context, executor);
  CHECK(calls == "123321");
}

TEST_CASE("training/stage: the directional derivative with a stage of one's own equals central differences") {
  using R = DimmedOver<testing::SmoothRecipe>;
  Model<R> model = testing::random_model<R>(24);
  model.arena.values(model.blocks<DimmedStage>().gain).data[0] = 0.3;
  const Camera<double> camera = testing::ring_camera(1, 5, 37, 29);
  const Random random(5, 0, random_stage("test target"));
  std::vector<double> target(3 * 37 * 29);
  for (std::size_t i = 0; i < target.size(); ++i) target[i] = 1.5 + random.uniform(i);
  const Pipeline<R> pipeline;
  Pipeline<R>::Phases phases;
  phases.of<DimmedStage>().weight = 2;
  SerialExecutor executor;
  using Context = Pipeline<R>::Context;
  testing::check_directional_derivative(
      model,
      [&](Context& context) {
        static_cast<void>(pipeline.forward(model, camera, 1, context, executor, phases));
        return pipeline.loss(ImageView<const double>{target.data(), 3, 29, 37}, {0.2, 0.01}, context, executor).total;
      },
      [&](Context& context) { pipeline.backward(model, camera, 1, context, executor); });
}

TEST_CASE("training/stage: a stage of one's own trains with the model, whoever else does, at any thread count") {
  const auto gain = [](std::size_t threads) {
    TrainSettings settings;
    settings.iterations = 60;
    settings.voxel_size = 0.05;
    ThreadExecutor executor(threads);
    Trainer<Dimmed, ThreadExecutor> trainer(settings, 6, 1.0, executor);
    REQUIRE(trainer.initialise(testing::cloud(300, 7)).ok());
    testing::BlobViews views;
    REQUIRE(trainer.run(views).ok());
    return trainer.model().arena.values(trainer.model().blocks<DimmedStage>().gain).data[0];
  };
  const float trained = gain(1);
  CHECK(trained != 0.0f);
  CHECK(std::abs(trained) < 2.0f);
  CHECK(gain(3) == trained);
}
