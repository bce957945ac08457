// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The common base of loops over iterations, the training of a scene (Trainer) and the hiding of a message in a finished
// model (PosthocEmbedding): its numbers, a pipeline whose stages know them, the phases of the iteration, the learning
// rates, and running to the end. `Self` is the loop; it has a member state() with the finished iterations and the
// model, and step(views). Cost: none.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/splat/optim/concept.hpp"
#include "compmark/splat/training/learning_rates.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/observer.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

/// The arguments of a stage's hook between the backward pass of a photographed view and the step of the optimiser.
template <class PipelineType, class ModelType, class Views, class E>
struct TrainingPass {
  const PipelineType& pipeline;
  ModelType& model;
  Views& views;
  std::size_t view;
  std::uint64_t seed;
  std::int64_t t;
  const typename PipelineType::Phases& phases;
  E& executor;
  bool adjusted;                ///< anchors were born or died: the gradients of this iteration are gone
  std::optional<Error>& error;  ///< set by a stage that cannot go on: the step ends with it
};

template <class Self, Recipe R, Executor E>
class TrainingLoop {
 public:
  using RecipeType = R;
  using Scalar = typename R::Scalar;
  using Stages = typename Pipeline<R>::Stages;

  /// Runs until the end, or until the observer says stop (checked after each iteration).
  template <class Views, class O = NoObserver>
  [[nodiscard]] Result<Done> run(Views& views, O&& observer = {}) {
    while (!finished()) {
      Result<IterationReport> report = self().step(views);
      if (!report) return report.error();
      if (!observer.on_iteration(std::as_const(self()), *report)) break;
    }
    return Done{};
  }

  [[nodiscard]] bool finished() const { return self().state().iteration >= settings_.iterations; }
  [[nodiscard]] const Model<R>& model() const { return self().state().model; }
  [[nodiscard]] const TrainSettings& settings() const { return settings_; }
  [[nodiscard]] const Pipeline<R>& pipeline() const { return pipeline_; }
  /// A stage, to tell it before the first step what is no number: set_watermark does.
  template <template <class...> class S>
  [[nodiscard]] auto& stage() {
    return pipeline_.template stage<S>();
  }

 protected:
  TrainingLoop(TrainSettings settings, E& executor) : settings_(std::move(settings)), executor_(&executor) {
    Stages::forward([&]<class S>() { pipeline_.template stage<S>().template configure<R>(settings_); });
  }

  /// What the stages do in iteration t.
  void set_phases([[maybe_unused]] std::int64_t t) {
    Stages::forward(
        [&]<class S>() { pipeline_.template stage<S>().set_phase(iteration(t), phases_.template of<S>()); });
  }
  /// What they make up from the model before it.
  void prepare_model([[maybe_unused]] std::int64_t t, Model<R>& model) {
    Stages::forward([&]<class S>() {
      pipeline_.template stage<S>().prepare_model(iteration(t), model, model.template blocks<S>());
    });
  }
  [[nodiscard]] StageIteration iteration(std::int64_t t) const { return {t, settings_.iterations, settings_.seed}; }

  template <class Views>
  static constexpr bool has_cameras_of_recipe =
      std::is_same_v<ViewCamera<R>, Camera<double>> ||
      std::is_same_v<std::remove_cvref_t<decltype(std::declval<Views&>().camera(0))>, ViewCamera<R>>;

  TrainSettings settings_;
  E* executor_;
  Pipeline<R> pipeline_;
  [[no_unique_address]] typename R::Optimizer optimizer_;
  typename Pipeline<R>::Context context_;
  [[no_unique_address]] typename Pipeline<R>::Phases phases_;
  std::vector<double> rates_;

 private:
  [[nodiscard]] Self& self() { return static_cast<Self&>(*this); }
  [[nodiscard]] const Self& self() const { return static_cast<const Self&>(*this); }
};

}  // namespace compmark
