// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recognises a finished run. If it is exactly the run that would be resumed, nothing is left to do; with other settings
// it would be another run, which replaces the finished one only where that is wanted.
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "compmark/app/files.hpp"
#include "compmark/app/recipe_names.hpp"
#include "compmark/app/run/detail/run_data.hpp"
#include "compmark/app/run/detail/run_mark.hpp"
#include "compmark/app/run/differences.hpp"
#include "compmark/app/run/run_results.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/splat/training/checkpoint.hpp"
#include "compmark/splat/training/model_info.hpp"
#include "compmark/splat/training/settings_json.hpp"

namespace compmark::detail {

/// Options by the settings that they say.
struct OptionOfSetting {
  const char* setting;
  const char* option;
};
inline constexpr std::array<OptionOfSetting, 23> options_of_settings{{
    {"iterations", "--iterations"},
    {"seed", "--seed"},
    {"profile", "--profile"},
    {"coarse_to_fine", "--coarse-to-fine"},
    {"max_anchors", "--max-anchors"},
    {"voxel_size", "--voxel-size"},
    {"background", "--background"},
    {"rate.lambda", "--lambda"},
    {"rate.round_after", "--distortion"},
    {"mark.lambda_message", "--message-weight"},
    {"mark.message_every", "--message-every"},
    {"mark.hinge_margin", "--message-margin"},
    {"mark.hinge_power", "--message-power"},
    {"mark.residual_rate", "--message-rate"},
    {"mark.step_rate_weight", "--step-rate"},
    {"mark.fidelity", "--fidelity"},
    {"mark.fidelity_fall", "--fidelity-fall"},
    {"mark.draw_by_cost", "--sample-by-loss"},
    {"mark.orbit_share", "--orbit"},
    {"mark.photograph_share", "--photographs"},
    {"mark.edited_share", "--edits"},
    {"mark.lost_anchors", "--lost-anchors"},
    {"mark.hold_steps_every", "--calibrate-steps"},
}};
/// Differences in the data, if no setting above and no file has changed: other settings follow from them.
inline constexpr std::array<OptionOfSetting, 2> options_of_others{
    {{"mark.identity", "--for-compression"}, {"feature", "--touch-up"}}};

inline nlohmann::json flat_settings(const nlohmann::json& settings) {
  nlohmann::json result = nlohmann::json::object();
  for (const auto& [key, value] : settings.items()) {
    if (!value.is_object()) {
      result[key] = value;
      continue;
    }
    for (const auto& [inner, number] : value.items()) result[key + "." + inner] = number;
  }
  return result;
}

inline void compare_settings(const nlohmann::json& before, const nlohmann::json& now, Differences& differences) {
  for (const OptionOfSetting& said : options_of_settings)
    differences.values(said.option, before.value(said.setting, nlohmann::json()),
                       now.value(said.setting, nlohmann::json()));
  if (!differences.none()) return;
  for (const OptionOfSetting& said : options_of_others) {
    if (before.value(said.setting, nlohmann::json()) != now.value(said.setting, nlohmann::json()))
      return differences.add(said.option, "differs");
  }
  if (before != now) differences.add("the profile's numbers", "differ");
}

inline void compare_data(const ModelInfo& before, const ModelInfo& now, Differences& differences) {
  if (before.views.size() != now.views.size()) {
    differences.values("--data (its views)", before.views.size(), now.views.size());
    return;
  }
  const std::optional<OtherView> other = other_view(before.views, now.views);
  if (!other && (before.origin != now.origin || before.unit != now.unit)) return differences.add("--data", "differs");
  if (!other) return;
  const auto size = [](const ModelInfo& info) {
    const Camera<double>& camera = info.views.front().camera;
    return std::to_string(camera.width) + " x " + std::to_string(camera.height);
  };
  if (before.views.front().name == now.views.front().name && size(before) != size(now)) {
    differences.values("--downscale (an image's size)", size(before), size(now));
  } else {
    differences.add("--data (" + other->field + " of " + other->name + ")", "differs");
  }
}

/// The identity of a run beside its model, for results.json: JSON of its settings and of the files it read (SHA-256; a
/// key by its commitment).
[[nodiscard]] inline Result<std::string> run_identity(const RunPlan& plan, const TrainSettings& settings) {
  nlohmann::json files = nlohmann::json::object();
  if (!plan.mark.key.empty()) {
    const Result<OwnerKey> key = key_of(plan.mark, {});
    if (!key) return key.error();
    files["--key"] = key->commitment();
    if (key->recipient != 0) files["--recipient"] = key->recipient;
  }
  for (const auto& [option, path] : {std::pair<const char*, const std::filesystem::path&>("--model", plan.model),
                                     {"--decoder", plan.mark.decoder},
                                     {"--unmarked", plan.mark.unmarked},
                                     {"--lpips-alex", plan.lpips.alex},
                                     {"--lpips-squeeze", plan.lpips.squeeze}}) {
    if (path.empty()) continue;
    const Result<std::string> digest = file_sha256(path);
    if (!digest) return digest.error();
    files[option] = *digest;
  }
  if (plan.lpips.family_range) files["--lpips-family-range"] = true;
  if (plan.mark.spread) files["--spread"] = *plan.mark.spread;
  if (plan.intra) files["--codec"] = "hac_plus";  // of the others the recipe tells
  return nlohmann::json{{"settings", settings_json(settings)}, {"files", std::move(files)}}.dump();
}

/// Whether a finished run is in a folder: results of the files that are there, and no checkpoint.
[[nodiscard]] inline bool holds_finished_run(const std::filesystem::path& folder) {
  std::error_code status;
  if (std::filesystem::exists(folder / "checkpoint.safetensors", status) ||
      !std::filesystem::exists(folder / "results.json", status))
    return false;
  const Result<RunResults> results = read_results(folder / "results.json");
  if (!results) return false;
  // A later run that replaced it and did not end has left its model, or its file.
  if (results->compressed && std::filesystem::file_size(folder / "model.cmk", status) != results->compressed->bytes)
    return false;
  const Result<std::string> digest = file_sha256(folder / "model.safetensors");
  return digest && *digest == results->model_sha256;
}

/// An error where a finished run had another key, or none, or another codec: what else differs follows from that, and
/// is left unsaid. Runs of models that differ are left to compare_settings.
[[nodiscard]] inline Result<Done> check_same_kind(const RunPlan& plan, const std::string& recipe_before,
                                                  const std::string& recipe, const nlohmann::json& before,
                                                  const nlohmann::json& now) {
  const auto refused = [&](const std::string& problem, const std::string& remedy) {
    return Error{ErrorKind::invalid, plan.out.string(), "--resume",
                 "the run in this folder is finished (results.json), and " + problem,
                 remedy + ", or choose another --out"};
  };
  const auto value = [](const nlohmann::json& files, const char* option) {
    return files.value(option, nlohmann::json());
  };
  const nlohmann::json model = value(before, "--model");  // a run that marks afterwards has one, and its training none
  if (!model.is_null() && !plan.model.empty() && model != value(now, "--model")) return Done{};
  const nlohmann::json key_before = value(before, "--key"), key_now = value(now, "--key");
  if (key_before != key_now) {
    if (key_before.is_null()) return refused("was made without --key", "leave --key out");
    const bool marks = plan.model.empty();  // a fit of a codec only reads the mark
    if (key_now.is_null())
      return refused(marks ? "was marked with --key" : "was made with --key", "give --key KEY again");
    return refused("--key differs", "give the --key that it was made with");
  }
  const auto codec = [&](const std::string& name, const nlohmann::json& files) {
    const nlohmann::json written = value(files, "--codec");
    return written.is_string() ? written.get<std::string>() : std::string(recipe_codec(name));
  };
  const std::string codec_before = codec(recipe_before, before), codec_now = codec(recipe, now);
  const bool of_mark = !plan.model.empty() && trained_codec(codec_before) == trained_codec(codec_now);
  if (codec_before == codec_now || of_mark) return Done{};
  return refused("--codec was " + codec_before + " and is " + codec_now, "give --codec " + codec_before + " again");
}

/// An error where what is resumed in plan.out is not the marking of a model that lies in `unmarked`, so that a training
/// would begin whose mark cannot be hidden there: a run without a key, finished or not, or a finished one of another
/// key. With `force` a finished one is replaced.
[[nodiscard]] inline Result<Done> check_resumes_mark(const RunPlan& plan, const OwnerKey& key,
                                                     const std::filesystem::path& unmarked) {
  const std::filesystem::path checkpoint = plan.out / "checkpoint.safetensors";
  if (!plan.resume) return Done{};
  if (file_exists(checkpoint) && !file_exists(unmarked / "model.safetensors")) {  // a mark's comes after its model
    return Error{ErrorKind::invalid, checkpoint.string(), "--resume", "is of a run without --key",
                 "continue it without --key and mark its model with compmark embed, or choose another --out"};
  }
  if (plan.force || !holds_finished_run(plan.out)) return Done{};
  const Result<RunResults> results = read_results(plan.out / "results.json");
  if (!results) return results.error();
  const nlohmann::json before = json_from<nlohmann::json>(results->identity);
  if (!before.is_object()) return Done{};  // of a version that kept less
  const nlohmann::json key_before = before.value("files", nlohmann::json::object()).value("--key", nlohmann::json());
  if (key_before.is_null()) {
    return Error{ErrorKind::invalid, plan.out.string(), "--resume",
                 "the run in this folder is finished (results.json), and was made without --key",
                 "mark its model with compmark embed --model " + (plan.out / "model.safetensors").string() +
                     ", or choose another --out to train it again"};
  }
  if (key_before == key.commitment()) return Done{};
  return Error{ErrorKind::invalid, plan.out.string(), "--resume",
               "the run in this folder is finished (results.json), and --key differs",
               "give the --key that it was made with, or choose another --out"};
}

/// Whether the run in plan.out is finished and has the same settings. An error names the options that differ; with
/// `force` there is none.
[[nodiscard]] inline Result<bool> is_finished(const RunPlan& plan, const RunData& run) {
  if (!holds_finished_run(plan.out)) return false;
  const Result<RunResults> results = read_results(plan.out / "results.json");
  if (!results) return results.error();
  const Result<SafetensorsFile> file = read_safetensors(run.model);
  if (!file) return file.error();
  const Result<std::string> text = file->text_of("info");
  if (!text) return text.error();
  const Result<ModelInfo> info = read_info(*file, json_from<nlohmann::json>(*text));
  if (!info) return info.error();

  Differences differences;
  const Result<std::string> identity = run_identity(plan, run.settings);
  if (!identity) return identity.error();
  const nlohmann::json now = json_from<nlohmann::json>(*identity);
  const nlohmann::json before = json_from<nlohmann::json>(results->identity);
  nlohmann::json files =
      before.is_object() ? before.value("files", nlohmann::json::object()) : nlohmann::json::object();
  if (files.contains("--twin")) files["--unmarked"] = files["--twin"];  // as the option was called
  if (before.is_object() && !plan.force) {
    if (Result<Done> same = check_same_kind(plan, info->recipe, run.info.recipe, files, now["files"]); !same)
      return same.error();
  }
  differences.values("the recipe (--recipe, --codec, --effects)", info->recipe, run.info.recipe);
  if (plan.method) {  // earlier versions had one
    const std::string method = results->method.empty() ? std::string(name_of(EmbedMethod::compmark)) : results->method;
    differences.values("--method", method, std::string(name_of(*plan.method)));
  }
  if (before.is_object()) {
    for (const char* option : {"--model", "--key", "--decoder", "--unmarked", "--spread", "--recipient", "--lpips-alex",
                               "--lpips-squeeze", "--lpips-family-range", "--codec"})
      differences.files(option, files.value(option, nlohmann::json()), now["files"].value(option, nlohmann::json()));
    compare_settings(flat_settings(before.value("settings", nlohmann::json::object())), flat_settings(now["settings"]),
                     differences);
  } else {  // of a version that kept less
    differences.values("--iterations", results->iterations, run.settings.iterations);
    differences.values("--seed", results->seed, run.settings.seed);
    differences.values("--profile", results->profile, run.settings.profile);
    if (results->rate_lambda) differences.values("--lambda", *results->rate_lambda, run.settings.rate.lambda);
  }
  compare_data(*info, run.info, differences);
  if (differences.none() && info->effects != run.info.effects) differences.add("--effects, or --lens,", "differs");
  if (differences.none()) return true;
  if (plan.force) return false;
  return Error{ErrorKind::invalid, plan.out.string(), "--resume",
               "the run in this folder is finished (results.json), and " + differences.text(),
               "leave out --resume and choose another --out, or give --force to replace it"};
}

}  // namespace compmark::detail
