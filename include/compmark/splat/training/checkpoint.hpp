// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A training run on disk: a model file with moments, step counts, growth statistics, the iteration and the columns that
// the loop's State has of its own (PosthocEmbedding: the message loss near each view and the wanted steps of a codec).
// Photographs' order and random numbers follow from (seed, iteration). A resumed run ends in the same bits. Settings
// are compared first.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/splat/training/checkpoint_parts.hpp"
#include "compmark/splat/training/model_file.hpp"
#include "compmark/splat/training/settings.hpp"

namespace compmark {

/// Of a run of `Loop`: Trainer<R, E> or PosthocEmbedding<R, E>.
template <class Loop>
struct Checkpoint {
  typename Loop::State state;
  ModelInfo info;
  double seconds = 0;           ///< training time so far, for the report
  std::vector<double> figures;  ///< as they were given to write_checkpoint
};

/// Writes the state under a temporary name and renames: a run killed while writing keeps its previous checkpoint.
/// `figures` are at most eight numbers of the run that the state does not hold; if one is not finite, none is kept.
template <class State, class Json = nlohmann::json>
[[nodiscard]] COMPMARK_ONCE Result<Done> write_checkpoint(const std::filesystem::path& path, const State& state,
                                                          const TrainSettings& settings, const ModelInfo& info,
                                                          double seconds, std::vector<double> figures = {}) {
  SafetensorsWriter writer;
  COMPMARK_ASSERT(figures.size() <= detail::most_figures, "write_checkpoint: at most eight figures");
  if (!std::all_of(figures.begin(), figures.end(), [](double x) { return std::isfinite(x); })) figures.clear();
  detail::CheckpointProgress progress{state.iteration, seconds, {}, std::move(figures)};
  if constexpr (requires { state.revival; }) progress.revival = state.revival;
  detail::add_common<typename std::remove_cvref_t<decltype(state.model.arena)>::Scalar,
                     std::remove_cvref_t<decltype(state.optimizer)>, Json>(
      writer, state.model.arena, detail::numbers_of(state.model), state.optimizer, progress, settings, info);
  if constexpr (requires { state.growth.statistics; }) detail::add_statistics(writer, state.growth.statistics);
  [[maybe_unused]] std::vector<std::vector<double>> kept;  // the writer copies nothing
  if constexpr (detail::has_columns<State>) {
    const auto add = [&](const char* name, const std::vector<double>& column, std::size_t count, double none) {
      kept.push_back(column.empty() ? std::vector<double>(count, none) : column);
      writer.template add_values<double>(name, {static_cast<std::int64_t>(kept.back().size())}, kept.back());
    };
    kept.reserve(detail::most_columns);
    State::for_each_column(state, settings, detail::training_views(info), add);
  }
  return writer.write(path);
}

/// Reads a checkpoint of a run with the same recipe, settings and views; an Error names the first difference.
template <class Loop, class Json = nlohmann::json>
[[nodiscard]] COMPMARK_ONCE Result<Checkpoint<Loop>> read_checkpoint(const std::filesystem::path& path,
                                                                     const TrainSettings& settings,
                                                                     const ModelInfo& info) {
  using R = typename Loop::RecipeType;
  const Result<SafetensorsFile> file = detail::open_checkpoint<Json>(path, settings);
  if (!file) return file.error();
  Result<LoadedModel<R>> model = detail::model_from<R>(*file);
  if (!model) return model.error();
  const Result<detail::CheckpointProgress> progress =
      detail::same_progress<Json>(*file, model->info, info, settings.iterations);
  if (!progress) return progress.error();

  Checkpoint<Loop> checkpoint;
  checkpoint.info = std::move(model->info);
  checkpoint.seconds = progress->seconds;
  checkpoint.figures = progress->figures;
  typename Loop::State& state = checkpoint.state;
  state.model = std::move(model->model);
  state.iteration = progress->iteration;
  if constexpr (requires { state.revival; }) state.revival = progress->revival;
  typename R::Optimizer{}.prepare(state.model.arena.layout(), state.optimizer);
  Result<Done> read = detail::read_moments(*file, state.optimizer, state.iteration);
  if constexpr (requires { state.growth.statistics; }) {
    state.growth.statistics.prepare(state.model.anchor_count(),
                                    static_cast<std::size_t>(R::AnchorModel::shape.offsets));
    if (read) read = detail::read_statistics(*file, state.growth.statistics, state.iteration);
  }
  if constexpr (detail::has_columns<typename Loop::State>) {
    const auto own = [&](const char* name, std::vector<double>& column, std::size_t count, double none) {
      if (read) read = detail::read_own_column(*file, name, column, count, none);
    };
    Loop::State::for_each_column(state, settings, detail::training_views(info), own);
  }
  if (!read) return read.error();
  return checkpoint;
}

}  // namespace compmark
