// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The parts of a checkpoint (checkpoint.hpp) that are the same for every recipe: what a run is compared by, moments,
// statistics and columns. They are functions of their own so that a program with many recipes has each of them once.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/file_kind.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/splat/training/checkpoint_state.hpp"
#include "compmark/splat/training/model_file.hpp"
#include "compmark/splat/training/revival.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/settings_json.hpp"

namespace compmark {

namespace detail {

[[nodiscard]] inline std::size_t training_views(const ModelInfo& info) {
  return static_cast<std::size_t>(
      std::count_if(info.views.begin(), info.views.end(), [](const StoredView& view) { return !view.test; }));
}

/// A state that keeps numbers of its own beside model and moments, each as a vector of doubles.
template <class State>
concept has_columns = requires(State& state, const TrainSettings& settings) {
  State::for_each_column(state, settings, std::size_t{}, [](const char*, auto&, std::size_t, double) {});
};
inline constexpr std::size_t most_columns = 8;

/// The columns of the growth statistics under their names in the file.
template <class Statistics, class F>
void for_each_statistic(Statistics& statistics, F&& f) {
  f("growth.opacity_sum", statistics.opacity_sum);
  f("growth.visits", statistics.visits);
  f("growth.gradient_sum", statistics.gradient_sum);
  f("growth.gradient_count", statistics.gradient_count);
}

// The parts of a checkpoint that are the same for every recipe, compiled once and not for each.

/// The finished iterations of a run.
struct CheckpointProgress {
  std::int64_t iteration = 0;
  double seconds = 0;
  Revival revival;
  std::vector<double> figures;  ///< whoever wrote them knows what they are
};
/// So many figures a checkpoint may have.
inline constexpr std::size_t most_figures = 8;

template <class T, class Moments, class Json>
void add_common(SafetensorsWriter& writer, const ParameterArena<T>& arena, const ModelNumbers& numbers,
                const Moments& moments, const CheckpointProgress& progress, const TrainSettings& settings,
                const ModelInfo& info) {
  Json json;
  json["iteration"] = progress.iteration;
  json["seconds"] = progress.seconds;
  add_revival(json, progress.revival);
  if (!progress.figures.empty()) json["figures"] = progress.figures;
  writer.metadata = {{"format", "compmark.checkpoint"},
                     {"version", "1"},
                     {"info", info_text(numbers, info)},
                     {"settings", settings_json<Json>(settings).dump()},
                     {"progress", json.dump()}};
  add_block_tensors(writer, arena);
  add_camera_tensors(writer, info.views);
  const auto rows = static_cast<std::int64_t>(moments.first_moment.size());
  writer.template add_values<T>("optimizer.first_moment", {rows}, moments.first_moment.span());
  writer.template add_values<T>("optimizer.second_moment", {rows}, moments.second_moment.span());
  writer.template add_values<std::uint64_t>("optimizer.steps", {static_cast<std::int64_t>(moments.steps.size())},
                                            moments.steps);
}

template <class Statistics>
void add_statistics(SafetensorsWriter& writer, const Statistics& statistics) {
  for_each_statistic(statistics, [&](const char* name, const auto& column) {
    using Value = std::remove_cvref_t<decltype(column[0])>;
    writer.template add_values<Value>(name, {static_cast<std::int64_t>(column.size())},
                                      std::span<const Value>(column.data(), column.size()));
  });
}

}  // namespace detail

/// The first view that two runs do not have in common.
struct OtherView {
  std::string field;  ///< "views" or "lens"
  std::string name;
};
/// Names, splits, cameras and lenses, compared exactly; nothing if they agree. Their numbers must be equal.
[[nodiscard]] inline std::optional<OtherView> other_view(std::span<const StoredView> before,
                                                         std::span<const StoredView> now) {
  COMPMARK_ASSERT(before.size() == now.size(), "other_view: numbers of views");
  for (std::size_t i = 0; i < now.size(); ++i) {
    const StoredView &old = before[i], &view = now[i];
    const Camera<double>&a = old.camera, &b = view.camera;
    const std::string name = std::to_string(i) + " (" + view.name + ")";
    if (old.name != view.name || old.test != view.test || a.width != b.width || a.height != b.height ||
        a.center_world != b.center_world || a.rotation_camera_world != b.rotation_camera_world || a.fx != b.fx ||
        a.fy != b.fy || a.cx != b.cx || a.cy != b.cy) {
      return OtherView{"views", name};
    }
    // A pinhole by any name is one: the file does not keep which.
    if (old.lens != view.lens && !(is_pinhole(old.lens) && is_pinhole(view.lens))) return OtherView{"lens", name};
  }
  return std::nullopt;
}

namespace detail {

[[nodiscard]] inline Error other_run(const SafetensorsFile& file, std::string field, std::string problem) {
  return Error{ErrorKind::invalid, file.path, std::move(field), std::move(problem),
               "resume with the options the run was started with, or remove the checkpoint to start over"};
}

/// Checks that a file is a checkpoint of a run with these settings.
template <class Json = nlohmann::json>
[[nodiscard]] Result<Done> check_same_settings(const SafetensorsFile& file, const TrainSettings& settings) {
  if (const Result<Done> kind = expect_kind(file, FileKind::checkpoint); !kind) return kind.error();
  const Result<std::string> format = file.text_of("format");
  if (!format) return format.error();
  if (*format != "compmark.checkpoint")
    return other_run(file, "__metadata__.format", "is \"" + *format + "\", not a checkpoint");
  const Result<std::string> text = file.text_of("settings");
  if (!text) return text.error();
  const Json stored = json_from<Json>(*text);
  const Json wanted = json_from<Json>(settings_json<Json>(settings).dump());
  if (!stored.is_object()) return other_run(file, "__metadata__.settings", "is not a JSON object");
  for (const auto& [key, value] : wanted.items()) {
    if (key == "effects" || key == "mark" || key == "rate") continue;  // below, with fewer words
    const Json found = stored.value(key, Json());
    if (found != value) {
      return other_run(file, "settings",
                       key + " is " + found.dump() + " in the checkpoint and " + value.dump() + " now");
    }
  }
  for (const auto& [key, value] : stored.items()) {  // what is named only where it was changed
    if (key != "effects" && key != "mark" && key != "rate" && !wanted.contains(key))
      return other_run(file, "settings", key + " is " + value.dump() + " in the checkpoint and another number now");
  }
  if (stored.value("effects", Json()) != wanted.value("effects", Json()))
    return other_run(file, "settings", "the numbers of effects are others in the checkpoint");
  if (stored.value("mark", Json()) != wanted.value("mark", Json()))
    return other_run(
        file, "settings",
        "the watermark (its message, decoder or numbers), or the model that was begun from, is another one in "
        "the checkpoint");
  if (stored.value("rate", Json()) != wanted.value("rate", Json()))
    return other_run(file, "settings", "the rate's numbers (lambda and its phases) are others in the checkpoint");
  return Done{};
}

/// Checks that a checkpoint is of a run with this recipe and these views.
template <class Json = nlohmann::json>
[[nodiscard]] Result<Done> check_same_info(const SafetensorsFile& file, const ModelInfo& before, const ModelInfo& now) {
  if (before.effects != now.effects) {
    const auto list = [](const std::vector<std::string>& names) {
      std::string text;
      for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
      return text.empty() ? std::string("none") : text;
    };
    return other_run(file, "effects",
                     "are " + list(before.effects) + " in the checkpoint and " + list(now.effects) +
                         " now (a lens taken out or ignored, for instance)");
  }
  if (before.recipe != now.recipe)
    return other_run(file, "recipe", "is " + before.recipe + " in the checkpoint and " + now.recipe + " now");
  if (before.views.size() != now.views.size()) {
    return other_run(file, "views",
                     "are " + std::to_string(before.views.size()) + " in the checkpoint and " +
                         std::to_string(now.views.size()) + " now");
  }
  if (const std::optional<OtherView> other = other_view(before.views, now.views))
    return other_run(file, other->field, "of view " + other->name + " is another one in the checkpoint");
  if (before.origin != now.origin) {
    return other_run(file, "origin",
                     "is " + Json(before.origin).dump() + " in the checkpoint and " + Json(now.origin).dump() +
                         " now: the same files give the same origin");
  }
  if (before.unit != now.unit) {
    return other_run(file, "unit",
                     "is " + Json(before.unit).dump() + " in the checkpoint and " + Json(now.unit).dump() +
                         " now: the same files give the same unit");
  }
  return Done{};
}

template <class Json = nlohmann::json>
[[nodiscard]] Result<CheckpointProgress> progress_of(const SafetensorsFile& file, std::int64_t iterations) {
  const Result<std::string> text = file.text_of("progress");
  if (!text) return text.error();
  const Json json = json_from<Json>(*text);
  if (!json.is_object() || !json.value("iteration", Json()).is_number_integer() ||
      !json.value("seconds", Json()).is_number()) {
    return no_state(file, "__metadata__.progress", "lacks iteration or seconds");
  }
  CheckpointProgress progress{
      json["iteration"].template get<std::int64_t>(), json["seconds"].template get<double>(), {}, {}};
  if (progress.iteration < 0 || progress.iteration > iterations)
    return no_state(file, "iteration", "is outside the run");
  if (!read_revival(json, progress.iteration, progress.revival))
    return no_state(file, "progress.revival", "is not two counts of this run's iterations");
  if (!(progress.seconds >= 0) || !std::isfinite(progress.seconds))
    return no_state(file, "seconds", "are no time that a run has taken");
  const Json figures = json.value("figures", Json::array());
  const auto is_figure = [](const Json& one) { return one.is_number() && std::isfinite(one.template get<double>()); };
  if (!figures.is_array() || figures.size() > most_figures || !std::all_of(figures.begin(), figures.end(), is_figure)) {
    return no_state(file, "progress.figures",
                    "is not a list of at most " + std::to_string(most_figures) + " finite numbers");
  }
  progress.figures = figures.template get<std::vector<double>>();
  return progress;
}

/// Reads a column whose length is known.
template <class Value>
[[nodiscard]] Result<Done> read_column(const SafetensorsFile& file, const char* name, std::span<Value> column) {
  const Result<std::vector<Value>> values = file.values<Value>(name);
  if (!values) return values.error();
  const std::string found = std::to_string(values->size()), wanted = std::to_string(column.size());
  if (found != wanted) return other_run(file, name, "has " + found + " values, expected " + wanted);
  std::copy(values->begin(), values->end(), column.begin());
  return Done{};
}

/// A checkpoint's file, if it is one of a run with these settings.
template <class Json>
[[nodiscard]] Result<SafetensorsFile> open_checkpoint(const std::filesystem::path& path,
                                                      const TrainSettings& settings) {
  Result<SafetensorsFile> file = read_safetensors(path);
  if (!file) return file;
  if (Result<Done> same = check_same_settings<Json>(*file, settings); !same) return same.error();
  return file;
}
/// What it says of the run, if that is of the same recipe and views.
template <class Json>
[[nodiscard]] Result<CheckpointProgress> same_progress(const SafetensorsFile& file, const ModelInfo& before,
                                                       const ModelInfo& now, std::int64_t iterations) {
  if (Result<Done> same = check_same_info<Json>(file, before, now); !same) return same.error();
  return progress_of<Json>(file, iterations);
}

/// Fills moments and statistics, which have their sizes already, and checks them.
template <class Moments>
[[nodiscard]] Result<Done> read_moments(const SafetensorsFile& file, Moments& moments, std::int64_t iterations) {
  Result<Done> read = Done{};
  const auto fill = [&](const char* name, auto& column) {
    using Value = std::remove_cvref_t<decltype(column[0])>;
    if (read) read = read_column(file, name, std::span<Value>(column.data(), column.size()));
  };
  fill("optimizer.first_moment", moments.first_moment);
  fill("optimizer.second_moment", moments.second_moment);
  fill("optimizer.steps", moments.steps);
  return read ? check_moments(file, moments, iterations) : read;
}
template <class Statistics>
[[nodiscard]] Result<Done> read_statistics(const SafetensorsFile& file, Statistics& statistics,
                                           std::int64_t iterations) {
  Result<Done> read = Done{};
  for_each_statistic(statistics, [&](const char* name, auto& column) {
    using Value = std::remove_cvref_t<decltype(column[0])>;
    if (read) read = read_column(file, name, std::span<Value>(column.data(), column.size()));
  });
  return read ? check_statistics(file, statistics, iterations) : read;
}
/// A column of doubles that a loop has of its own; one that holds `none` alone is left empty.
[[nodiscard]] inline Result<Done> read_own_column(const SafetensorsFile& file, const char* name,
                                                  std::vector<double>& column, std::size_t count, double none) {
  column.resize(count);
  if (Result<Done> read = read_column(file, name, std::span<double>(column)); !read) return read;
  if (!std::all_of(column.begin(), column.end(), [](double number) { return std::isfinite(number); }))
    return other_run(file, name, "holds a number that is not finite");
  if (std::all_of(column.begin(), column.end(), [none](double number) { return number == none; })) column.clear();
  return Done{};
}

}  // namespace detail

}  // namespace compmark
