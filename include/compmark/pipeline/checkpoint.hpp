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
[[nodiscard]] inline nlohmann::json settings_json(const TrainSettings& s) {
  const auto rate = [](const LearningRate& r) { return nlohmann::json{r.initial, r.final}; };
  nlohmann::json json{{"profile", s.profile},
                      {"iterations", s.iterations},
                      {"seed", s.seed},
                      {"lambda_dssim", s.lambda_dssim},
                      {"lambda_volume", s.lambda_volume},
                      {"offset", rate(s.offset)},
                      {"feature", rate(s.feature)},
                      {"scaling", rate(s.scaling)},
                      {"mlp_opacity", rate(s.mlp_opacity)},
                      {"mlp_covariance", rate(s.mlp_covariance)},
                      {"mlp_color", rate(s.mlp_color)},
                      {"feature_bank", rate(s.feature_bank)},
                      {"appearance", rate(s.appearance)},
                      {"voxel_size", s.voxel_size},
                      {"init_factor", s.init_factor},
                      {"max_anchors", s.max_anchors},
                      {"gradient_threshold", s.gradient_threshold},
                      {"success_threshold", s.success_threshold},
                      {"min_opacity", s.min_opacity},
                      {"statistics_after", s.statistics_after},
                      {"grow_after", s.grow_after},
                      {"grow_until", s.grow_until},
                      {"pause_from", s.pause_from},
                      {"pause_until", s.pause_until},
                      {"grow_interval", s.grow_interval},
                      {"near_plane", s.near_plane},
                      {"blur_variance", s.blur_variance},
                      {"background", s.background}};
  // Named only where they were changed: a run without effects has the bytes it had before there were any.
  if (s.effects != EffectNumbers{}) {
    json["effects"] = {{"exposure", rate(s.effects.exposure)},
                       {"lambda_alpha", s.effects.lambda_alpha},
                       {"space_origin", s.effects.space_origin},
                       {"space_radius", s.effects.space_radius}};
  }
  const std::optional<TrainSettings> profile = profile_settings(s.profile);
  if (const MarkNumbers& m = s.mark; m != (profile ? profile->mark : MarkNumbers{})) {
    json["mark"] = {{"lambda_message", m.lambda_message},
                    {"message_after", m.message_after},
                    {"message_ramp", m.message_ramp},
                    {"message_every", m.message_every},
                    {"logit_scale", m.logit_scale},
                    {"hinge_margin", m.hinge_margin},
                    {"between_every", m.between_every},
                    {"lambda_hsv", m.lambda_hsv},
                    {"hsv_after", m.hsv_after},
                    {"lambda_frequency", m.lambda_frequency},
                    {"frequency_after", m.frequency_after},
                    {"image_weight", m.image_weight},
                    {"residual_rate", m.residual_rate},
                    {"residual_decay", m.residual_decay},
                    {"residual_after", m.residual_after},
                    {"distortion_rate", m.distortion_rate},
                    {"feature_noise", m.feature_noise},
                    {"scaling_noise", m.scaling_noise},
                    {"offset_noise", m.offset_noise},
                    {"noise_after", m.noise_after},
                    {"adaptive_after", m.adaptive_after},
                    {"hard_fraction", m.hard_fraction},
                    {"least_step", m.least_step},
                    {"step_rate_weight", m.step_rate_weight},
                    {"identity", m.identity}};
  }
  if (const RateNumbers& r = s.rate; r != (profile ? profile->rate : RateNumbers{})) {
    json["rate"] = {{"lambda", r.lambda},
                    {"noise_after", r.noise_after},
                    {"context_after", r.context_after},
                    {"round_after", r.round_after},
                    {"mask_weight", r.mask_weight},
                    {"sample", r.sample},
                    {"feature_step", r.feature_step},
                    {"scaling_step", r.scaling_step},
                    {"offset_step", r.offset_step},
                    {"mask", rate(r.mask)},
                    {"grid", rate(r.grid)},
                    {"context", rate(r.context)},
                    {"hyperprior", r.hyperprior}};
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
template <class State>
[[nodiscard]] Result<Done> write_checkpoint(const std::filesystem::path& path, const State& state,
                                            const TrainSettings& settings, const ModelInfo& info, double seconds) {
  using Scalar = typename std::remove_cvref_t<decltype(state.model.arena)>::Scalar;
  SafetensorsWriter writer;
  const nlohmann::json progress{{"iteration", state.iteration}, {"seconds", seconds}};
  writer.metadata = {{"format", "compmark.checkpoint"},
                     {"version", "1"},
                     {"info", detail::info_json(state.model, info).dump()},
                     {"settings", settings_json(settings).dump()},
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
template <Recipe R, Executor E>
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
  const nlohmann::json stored = nlohmann::json::parse(*settings_text, nullptr, false);
  const nlohmann::json wanted = nlohmann::json::parse(settings_json(settings).dump());
  if (!stored.is_object()) return refuse("__metadata__.settings", "is not a JSON object");
  for (const auto& [key, value] : wanted.items()) {
    if (key == "effects" || key == "mark") continue;  // below, with fewer words
    const nlohmann::json found = stored.value(key, nlohmann::json());
    if (found != value)
      return refuse("settings", key + " is " + found.dump() + " in the checkpoint and " + value.dump() + " now");
  }
  if (stored.value("effects", nlohmann::json()) != wanted.value("effects", nlohmann::json()))
    return refuse("settings", "the numbers of effects are others in the checkpoint");
  if (stored.value("mark", nlohmann::json()) != wanted.value("mark", nlohmann::json()))
    return refuse("settings", "the watermark (its message, decoder or numbers) is another one in the checkpoint");
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
    return refuse("origin", "is " + nlohmann::json(model->info.origin).dump() + " in the checkpoint and " +
                                nlohmann::json(info.origin).dump() + " now: the same files give the same origin");
  }

  Checkpoint<R, E> checkpoint;
  checkpoint.info = std::move(model->info);
  checkpoint.state.model = std::move(model->model);
  const Result<std::string> progress_text = file->text_of("progress");
  if (!progress_text) return progress_text.error();
  const nlohmann::json progress = nlohmann::json::parse(*progress_text, nullptr, false);
  if (!progress.is_object() || !progress.value("iteration", nlohmann::json()).is_number_integer() ||
      !progress.value("seconds", nlohmann::json()).is_number()) {
    return refuse("__metadata__.progress", "lacks iteration or seconds");
  }
  checkpoint.state.iteration = progress["iteration"].get<std::int64_t>();
  checkpoint.seconds = progress["seconds"].get<double>();
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
