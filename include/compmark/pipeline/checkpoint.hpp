// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A training run on disk, exactly: parameters, Adam's moments and step counts, growth statistics, the iteration. Random numbers and the
// order of views are functions of (seed, iteration) and need no state. A run resumed from a checkpoint ends in the same bits.
// The file is a model file with more tensors in it; its settings are stored and compared, field by field, before anything is believed.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/absent.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/pipeline/model_file.hpp"
#include "compmark/pipeline/settings.hpp"
#include "compmark/pipeline/trainer.hpp"

namespace compmark::inline v0 {

template <Recipe R, Executor E>
struct Checkpoint {
  typename Trainer<R, E>::State state;
  ModelInfo info;
  double seconds = 0;  ///< training time so far, for the report
};

/// Every number that changes what a run computes. Two runs with equal objects continue each other.
template <class Json = nlohmann::json>
[[nodiscard]] Json settings_json(const TrainSettings& s) {
  const auto rate = [](const LearningRate& r) { return Json{r.initial, r.final}; };
  Json json;
  json["profile"] = s.profile;
  json["iterations"] = s.iterations;
  json["seed"] = s.seed;
  json["lambda_dssim"] = s.lambda_dssim;
  json["lambda_volume"] = s.lambda_volume;
  json["offset"] = rate(s.offset);
  json["feature"] = rate(s.feature);
  json["scaling"] = rate(s.scaling);
  json["mlp_opacity"] = rate(s.mlp_opacity);
  json["mlp_covariance"] = rate(s.mlp_covariance);
  json["mlp_color"] = rate(s.mlp_color);
  json["feature_bank"] = rate(s.feature_bank);
  json["appearance"] = rate(s.appearance);
  json["voxel_size"] = s.voxel_size;
  json["init_factor"] = s.init_factor;
  json["max_anchors"] = s.max_anchors;
  json["gradient_threshold"] = s.gradient_threshold;
  json["success_threshold"] = s.success_threshold;
  json["min_opacity"] = s.min_opacity;
  json["statistics_after"] = s.statistics_after;
  json["grow_after"] = s.grow_after;
  json["grow_until"] = s.grow_until;
  json["pause_from"] = s.pause_from;
  json["pause_until"] = s.pause_until;
  json["grow_interval"] = s.grow_interval;
  json["near_plane"] = s.near_plane;
  json["blur_variance"] = s.blur_variance;
  json["background"] = s.background;
  // Named only where they were changed: a run without effects has the bytes it had before there were any.
  if (s.effects != EffectNumbers{}) {
    Json& effects = json["effects"];
    effects["exposure"] = rate(s.effects.exposure);
    effects["lambda_alpha"] = s.effects.lambda_alpha;
    effects["space_origin"] = s.effects.space_origin;
    effects["space_radius"] = s.effects.space_radius;
  }
  const std::optional<TrainSettings> profile = profile_settings(s.profile);
  if (const MarkNumbers& m = s.mark; m != (profile ? profile->mark : MarkNumbers{})) {
    Json& mark = json["mark"];
    mark["lambda_message"] = m.lambda_message;
    mark["message_after"] = m.message_after;
    mark["message_ramp"] = m.message_ramp;
    mark["message_every"] = m.message_every;
    mark["logit_scale"] = m.logit_scale;
    mark["hinge_margin"] = m.hinge_margin;
    mark["between_every"] = m.between_every;
    if (m.fidelity != 0) mark["fidelity"] = m.fidelity;  // checkpoints are older than this number
    mark["lambda_hsv"] = m.lambda_hsv;
    mark["hsv_after"] = m.hsv_after;
    mark["lambda_frequency"] = m.lambda_frequency;
    mark["frequency_after"] = m.frequency_after;
    if (m.frequency_grow_from != 10000 || m.frequency_grow_until != 15000)
      mark["frequency_grow"] = {m.frequency_grow_from, m.frequency_grow_until};
    if (m.frequency_band_lowest != 0.1 || m.frequency_band_highest != 0.3)
      mark["frequency_band"] = {m.frequency_band_lowest, m.frequency_band_highest};
    mark["image_weight"] = m.image_weight;
    mark["residual_rate"] = m.residual_rate;
    mark["residual_decay"] = m.residual_decay;
    mark["residual_after"] = m.residual_after;
    mark["distortion_rate"] = m.distortion_rate;
    mark["feature_noise"] = m.feature_noise;
    mark["scaling_noise"] = m.scaling_noise;
    mark["offset_noise"] = m.offset_noise;
    mark["noise_after"] = m.noise_after;
    mark["adaptive_after"] = m.adaptive_after;
    mark["hard_fraction"] = m.hard_fraction;
    mark["least_step"] = m.least_step;
    mark["step_rate_weight"] = m.step_rate_weight;
    mark["identity"] = m.identity;
  }
  if (const RateNumbers& r = s.rate; r != (profile ? profile->rate : RateNumbers{})) {
    Json& rates = json["rate"];
    rates["lambda"] = r.lambda;
    rates["noise_after"] = r.noise_after;
    rates["context_after"] = r.context_after;
    rates["round_after"] = r.round_after;
    rates["mask_weight"] = r.mask_weight;
    rates["sample"] = r.sample;
    rates["feature_step"] = r.feature_step;
    rates["scaling_step"] = r.scaling_step;
    rates["offset_step"] = r.offset_step;
    rates["mask"] = rate(r.mask);
    rates["grid"] = rate(r.grid);
    rates["context"] = rate(r.context);
    rates["hyperprior"] = r.hyperprior;
  }
  return json;
}

namespace detail {

/// The columns of the growth statistics under their names in the file.
template <class Statistics, class F>
void for_each_statistic(Statistics& statistics, F&& f) {
  f("growth.opacity_sum", statistics.opacity_sum);
  f("growth.visits", statistics.visits);
  f("growth.gradient_sum", statistics.gradient_sum);
  f("growth.gradient_count", statistics.gradient_count);
}

}  // namespace detail

/// Writes the state under a temporary name and renames: a run killed while writing keeps its previous checkpoint.
template <class State, class Json = nlohmann::json>
[[nodiscard]] Result<Done> write_checkpoint(const std::filesystem::path& path, const State& state,
                                            const TrainSettings& settings, const ModelInfo& info, double seconds) {
  using Scalar = typename std::remove_cvref_t<decltype(state.model.arena)>::Scalar;
  SafetensorsWriter writer;
  Json progress;
  progress["iteration"] = state.iteration;
  progress["seconds"] = seconds;
  writer.metadata = {{"format", "compmark.checkpoint"},
                     {"version", "1"},
                     {"info", detail::info_text(detail::numbers_of(state.model), info)},
                     {"settings", settings_json<Json>(settings).dump()},
                     {"progress", progress.dump()}};
  detail::add_block_tensors(writer, state.model.arena);
  detail::add_camera_tensors(writer, info.views);
  const auto rows = static_cast<std::int64_t>(state.optimizer.first_moment.size());
  writer.template add_values<Scalar>("optimizer.first_moment", {rows}, state.optimizer.first_moment.span());
  writer.template add_values<Scalar>("optimizer.second_moment", {rows}, state.optimizer.second_moment.span());
  writer.template add_values<std::uint64_t>(
      "optimizer.steps", {static_cast<std::int64_t>(state.optimizer.steps.size())}, state.optimizer.steps);
  if constexpr (requires { state.growth.statistics; }) {
    detail::for_each_statistic(state.growth.statistics, [&](const char* name, const auto& column) {
      using Value = std::remove_cvref_t<decltype(column[0])>;
      writer.template add_values<Value>(name, {static_cast<std::int64_t>(column.size())},
                                        std::span<const Value>(column.data(), column.size()));
    });
  }
  return writer.write(path);
}

/// The first view that two runs do not have in common.
struct OtherView {
  std::string field;  ///< "view" or "lens"
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

/// Reads a checkpoint of a run with the same recipe, settings and views; anything else is refused with the name of what differs.
template <Recipe R, Executor E, class Json = nlohmann::json>
[[nodiscard]] Result<Checkpoint<R, E>> read_checkpoint(const std::filesystem::path& path, const TrainSettings& settings,
                                                       const ModelInfo& info) {
  const Result<SafetensorsFile> file = read_safetensors(path);
  if (!file) return file.error();
  const auto refuse = [&](std::string field, std::string problem) {
    return Error{ErrorKind::invalid, path.string(), std::move(field), std::move(problem),
                 "resume with the options the run was started with, or remove the checkpoint to start over"};
  };
  const Result<std::string> format = file->text_of("format");
  if (!format) return format.error();
  if (*format != "compmark.checkpoint")
    return refuse("__metadata__.format", "is \"" + *format + "\", not a checkpoint");
  const Result<std::string> settings_text = file->text_of("settings");
  if (!settings_text) return settings_text.error();
  const Json stored = json_from<Json>(*settings_text);
  const Json wanted = json_from<Json>(settings_json<Json>(settings).dump());
  if (!stored.is_object()) return refuse("__metadata__.settings", "is not a JSON object");
  for (const auto& [key, value] : wanted.items()) {
    if (key == "effects" || key == "mark" || key == "rate") continue;  // below, with fewer words
    const Json found = stored.value(key, Json());
    if (found != value)
      return refuse("settings", key + " is " + found.dump() + " in the checkpoint and " + value.dump() + " now");
  }
  if (stored.value("effects", Json()) != wanted.value("effects", Json()))
    return refuse("settings", "the numbers of effects are others in the checkpoint");
  if (stored.value("mark", Json()) != wanted.value("mark", Json()))
    return refuse("settings", "the watermark (its message, decoder or numbers) is another one in the checkpoint");
  if (stored.value("rate", Json()) != wanted.value("rate", Json()))
    return refuse("settings", "the rate's numbers (lambda and its phases) are others in the checkpoint");
  Result<LoadedModel<R>> model = detail::model_from<R>(*file);
  if (!model) return model.error();
  if (model->info.effects != info.effects) {
    const auto list = [](const std::vector<std::string>& names) {
      std::string text;
      for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
      return text.empty() ? std::string("none") : text;
    };
    return refuse("effects", "are " + list(model->info.effects) + " in the checkpoint and " + list(info.effects) +
                                 " now (a lens taken out or ignored, for instance)");
  }
  if (model->info.recipe != info.recipe)
    return refuse("recipe", "is " + model->info.recipe + " in the checkpoint and " + info.recipe + " now");
  if (model->info.views.size() != info.views.size()) {
    return refuse("views", "are " + std::to_string(model->info.views.size()) + " in the checkpoint and " +
                               std::to_string(info.views.size()) + " now");
  }
  if (const std::optional<OtherView> other = other_view(model->info.views, info.views))
    return refuse(other->field, "of view " + other->name + " is another one in the checkpoint");
  if (model->info.origin != info.origin) {
    return refuse("origin", "is " + Json(model->info.origin).dump() + " in the checkpoint and " +
                                Json(info.origin).dump() + " now: the same files give the same origin");
  }
  if (model->info.unit != info.unit) {
    return refuse("unit", "is " + Json(model->info.unit).dump() + " in the checkpoint and " + Json(info.unit).dump() +
                              " now: the same files give the same unit");
  }

  Checkpoint<R, E> checkpoint;
  checkpoint.info = std::move(model->info);
  checkpoint.state.model = std::move(model->model);
  const Result<std::string> progress_text = file->text_of("progress");
  if (!progress_text) return progress_text.error();
  const Json progress = json_from<Json>(*progress_text);
  if (!progress.is_object() || !progress.value("iteration", Json()).is_number_integer() ||
      !progress.value("seconds", Json()).is_number()) {
    return refuse("__metadata__.progress", "lacks iteration or seconds");
  }
  checkpoint.state.iteration = progress["iteration"].template get<std::int64_t>();
  checkpoint.seconds = progress["seconds"].template get<double>();
  if (checkpoint.state.iteration < 0 || checkpoint.state.iteration > settings.iterations)
    return refuse("iteration", "is outside the run");

  typename R::Optimizer{}.prepare(checkpoint.state.model.arena.layout(), checkpoint.state.optimizer);
  const auto fill = [&](const char* name, auto& column) -> Result<Done> {
    using Value = std::remove_cvref_t<decltype(column[0])>;
    const Result<std::vector<Value>> values = file->template values<Value>(name);
    if (!values) return values.error();
    if (values->size() != column.size()) {
      return refuse(name,
                    "has " + std::to_string(values->size()) + " values, expected " + std::to_string(column.size()));
    }
    std::copy(values->begin(), values->end(), column.begin());
    return Done{};
  };
  if (Result<Done> r = fill("optimizer.first_moment", checkpoint.state.optimizer.first_moment); !r) return r.error();
  if (Result<Done> r = fill("optimizer.second_moment", checkpoint.state.optimizer.second_moment); !r) return r.error();
  if (Result<Done> r = fill("optimizer.steps", checkpoint.state.optimizer.steps); !r) return r.error();
  if constexpr (requires { checkpoint.state.growth.statistics; }) {
    checkpoint.state.growth.statistics.prepare(checkpoint.state.model.anchor_count(),
                                               static_cast<std::size_t>(R::AnchorModel::shape.offsets));
    Result<Done> result = Done{};
    detail::for_each_statistic(checkpoint.state.growth.statistics, [&](const char* name, auto& column) {
      if (result) result = fill(name, column);
    });
    if (!result) return result.error();
  }
  return checkpoint;
}

}  // namespace compmark::inline v0
