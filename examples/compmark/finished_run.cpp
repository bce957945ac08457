// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "finished_run.hpp"

#include <algorithm>
#include <array>
#include <compmark/app/files.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/model_info.hpp>
#include <compmark/splat/training/settings_json.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>
#include <vector>

#include "differences.hpp"
#include "results.hpp"

namespace tool {
namespace {

using namespace compmark;
namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Options by the settings that they say.
struct Said {
  const char* setting;
  const char* option;
};
constexpr std::array<Said, 17> options_of_settings{{
    {"iterations", "--iterations"},
    {"seed", "--seed"},
    {"profile", "--profile"},
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
    {"mark.fidelity", "--fidelity"},
    {"mark.fidelity_fall", "--fidelity-fall"},
    {"mark.draw_by_cost", "--draw-by-cost"},
    {"mark.hold_steps_every", "--hold-steps"},
}};
/// Differences in the data, if no setting above and no file has changed: other settings follow from them.
constexpr std::array<Said, 2> options_of_others{{{"mark.identity", "--for-compression"}, {"feature", "--touch-up"}}};

Json flat(const Json& settings) {
  Json result = Json::object();
  for (const auto& [key, value] : settings.items()) {
    if (!value.is_object()) {
      result[key] = value;
      continue;
    }
    for (const auto& [inner, number] : value.items()) result[key + "." + inner] = number;
  }
  return result;
}

void compare_settings(const Json& before, const Json& now, Differences& differences) {
  for (const Said& said : options_of_settings)
    differences.values(said.option, before.value(said.setting, Json()), now.value(said.setting, Json()));
  if (!differences.none()) return;
  for (const Said& said : options_of_others) {
    if (before.value(said.setting, Json()) != now.value(said.setting, Json()))
      return differences.add(said.option, "differs");
  }
  if (before != now) differences.add("the profile's numbers", "differ");
}

void compare_data(const ModelInfo& before, const ModelInfo& now, Differences& differences) {
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

}  // namespace

Result<std::string> run_identity(const TrainOptions& options, const TrainSettings& settings) {
  Json files = Json::object();
  if (!options.mark.key.empty()) {
    const Result<OwnerKey> key = key_of(options.mark);
    if (!key) return key.error();
    files["--key"] = key->commitment();
  }
  for (const auto& [option, path] : {std::pair<const char*, const fs::path&>("--model", options.model),
                                     {"--decoder", options.mark.decoder},
                                     {"--twin", options.mark.twin},
                                     {"--lpips-alex", options.lpips.alex},
                                     {"--lpips-squeeze", options.lpips.squeeze}}) {
    if (path.empty()) continue;
    const Result<std::string> digest = file_sha256(path);
    if (!digest) return digest.error();
    files[option] = *digest;
  }
  if (options.lpips.family_range) files["--lpips-family-range"] = true;
  return Json{{"settings", settings_json(settings)}, {"files", std::move(files)}}.dump();
}

bool holds_finished_run(const fs::path& folder) {
  std::error_code status;
  if (fs::exists(folder / "checkpoint.safetensors", status) || !fs::exists(folder / "results.json", status))
    return false;
  const Result<Results> results = read_results(folder / "results.json");
  if (!results) return false;
  // A later run that replaced it and did not end has left its model, or its file.
  if (results->compressed && fs::file_size(folder / "model.cmk", status) != results->compressed->bytes) return false;
  const Result<std::string> digest = file_sha256(folder / "model.safetensors");
  return digest && *digest == results->model_sha256;
}

Result<bool> is_finished(const TrainOptions& options, const RunData& run) {
  if (!holds_finished_run(options.out)) return false;
  const Result<Results> results = read_results(options.out / "results.json");
  if (!results) return results.error();
  const Result<SafetensorsFile> file = read_safetensors(run.model);
  if (!file) return file.error();
  const Result<std::string> text = file->text_of("info");
  if (!text) return text.error();
  const Result<ModelInfo> info = detail::read_info(*file, json_from<Json>(*text));
  if (!info) return info.error();

  Differences differences;
  const Result<std::string> identity = run_identity(options, run.settings);
  if (!identity) return identity.error();
  const Json now = json_from<Json>(*identity);
  const Json before = json_from<Json>(results->identity);
  differences.values("the recipe (--recipe, --codec, --effects)", info->recipe, run.info.recipe);
  if (before.is_object()) {
    const Json files = before.value("files", Json::object());
    for (const char* option :
         {"--model", "--key", "--decoder", "--twin", "--lpips-alex", "--lpips-squeeze", "--lpips-family-range"})
      differences.files(option, files.value(option, Json()), now["files"].value(option, Json()));
    compare_settings(flat(before.value("settings", Json::object())), flat(now["settings"]), differences);
  } else {  // of a version that kept less
    differences.values("--iterations", results->iterations, run.settings.iterations);
    differences.values("--seed", results->seed, run.settings.seed);
    differences.values("--profile", results->profile, run.settings.profile);
    if (results->rate_lambda) differences.values("--lambda", *results->rate_lambda, run.settings.rate.lambda);
  }
  compare_data(*info, run.info, differences);
  if (differences.none() && info->effects != run.info.effects) differences.add("--effects, or --lens,", "differs");
  if (differences.none()) return true;
  if (options.force) return false;
  return Error{ErrorKind::invalid, options.out.string(), "--resume",
               "the run in this folder is finished (results.json), and " + differences.text(),
               "leave out --resume and choose another --out, or give --force to replace it"};
}

}  // namespace tool
