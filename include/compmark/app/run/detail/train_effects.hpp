// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Chooses the recipe of a training from the effects of its photographs, or keeps that of the run which is resumed.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/app/capture.hpp"
#include "compmark/app/recipe_names.hpp"
#include "compmark/app/run/effect_choice.hpp"
#include "compmark/app/run/train.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/scene/open.hpp"
#include "compmark/splat/training/model_info.hpp"

namespace compmark::detail {

/// The folder of the unmarked model of a run that is marked afterwards.
inline constexpr const char* unmarked_folder = "unmarked";

/// Settings of a training while its recipe is chosen.
struct TrainChoice : TrainSceneSettings {
  std::optional<std::array<double, 3>> probed_background;  ///< one colour around opaque photographs, in [0, 1]
  std::vector<std::string> simulated;                      ///< effects of the chosen recipe
  std::vector<std::string> notes;                          ///< why it was chosen
  bool intra = false;                                      ///< RunPlan::intra
};

/// Recipe that a profile runs with unless another is given.
[[nodiscard]] inline std::string default_recipe(std::string_view profile) {
  if (profile == "official") return "compmark-host";
  if (profile == "paper") return "compmark-paper-host";
  return "scaffold";
}

/// A resumed run keeps its recipe, effects and background, whatever a probe would measure now. False if there is no run
/// to resume, or if the command gives other ones.
inline Result<bool> continue_begun(TrainChoice& chosen) {
  if (!chosen.resume || !chosen.recipe.empty() || chosen.effects != "auto") return false;
  // Of a run that is marked afterwards the unmarked model says it: a mark's checkpoint has no exposures.
  std::filesystem::path begun = chosen.out / "checkpoint.safetensors";
  if (marks_afterwards(chosen)) {
    for (const char* name : {"model.safetensors", "checkpoint.safetensors"}) {
      const std::filesystem::path unmarked = chosen.out / unmarked_folder / name;
      if (detail::file_exists(unmarked)) begun = unmarked;
    }
  }
  if (!detail::file_exists(begun)) return false;
  const Result<SafetensorsFile> file = read_safetensors(begun);
  if (!file) return file.error();
  const Result<std::string> text = file->text_of("info");
  if (!text) return text.error();
  const nlohmann::json json = json_from<nlohmann::json>(*text);
  const Result<ModelInfo> info = read_info(*file, json);
  if (!info) return info.error();
  if (is_coded_recipe(info->recipe) != (chosen.codec != "none")) return false;
  chosen.recipe = info->recipe;
  chosen.simulated = info->effects;
  const nlohmann::json background = json.value("background", nlohmann::json());
  if (!chosen.background && background.is_array() && background.size() == 3) {
    std::array<double, 3>& color = chosen.probed_background.emplace();
    for (std::size_t c = 0; c < 3; ++c) {
      if (!background[c].is_number()) return false;  // the trainer says what is wrong with the file
      color[c] = background[c].get<double>();
    }
  }
  if (chosen.lens == LensTreatment::undistort) {
    if (projects_lens(chosen.recipe)) chosen.lens = LensTreatment::keep;
    const auto& effects = chosen.simulated;
    if (std::find(effects.begin(), effects.end(), lens_ignored) != effects.end()) chosen.lens = LensTreatment::ignore;
  }
  chosen.notes.push_back("recipe " + chosen.recipe + ", as the run began");
  return true;
}

/// Chooses chosen.recipe, chosen.simulated and the background, with reasons in chosen.notes. An explicit --recipe is
/// kept; the recipes of the other profiles have no effects.
inline Result<Done> choose_effects(TrainChoice& chosen, ThreadExecutor& executor) {
  const Result<bool> begun = continue_begun(chosen);
  if (!begun) return begun.error();
  if (*begun) return Done{};
  DatasetSettings settings;
  const bool recipe_given = !chosen.recipe.empty();
  if (!recipe_given) chosen.recipe = default_recipe(chosen.profile);
  if (projects_lens(chosen.recipe) && chosen.lens == LensTreatment::undistort)
    chosen.lens = LensTreatment::keep;  // what it is there for
  settings.lens = chosen.lens;
  settings.downscale = chosen.downscale;
  settings.splat_up = chosen.splat_up;
  Result<Dataset> dataset = open_capture(chosen.data, settings, executor);
  if (!dataset) return dataset.error();
  const char* const background = effect_name(SceneEffect::constant_background);
  const bool probes = chosen.effects == "auto";
  std::vector<ProbedEffect> probed;
  // The colour of a background is in the photographs; renders of splats have no effects.
  if (!dataset->pictures && (probes || chosen.effects.find(background) != std::string::npos)) {
    Result<std::vector<ProbedEffect>> found = probe_scene(*dataset);
    if (!found) return found.error();
    probed = std::move(*found);
  }
  Result<std::vector<std::string>> wanted = wanted_effects(chosen.effects, probed);
  if (!wanted) return wanted.error();
  if (std::find(wanted->begin(), wanted->end(), background) != wanted->end()) {
    const auto found = std::find_if(probed.begin(), probed.end(), [](const ProbedEffect& effect) {
      return effect.effect == SceneEffect::constant_background;
    });
    if (chosen.background) {
      std::erase(*wanted, background);  // overruled
    } else if (found != probed.end()) {
      chosen.probed_background = found->color;
    } else {
      return Error{ErrorKind::invalid,
                   {},
                   "--effects",
                   std::string(background) + ": the borders of these photographs have no common colour",
                   "leave the effect out, or give the colour with --background"};
    }
  }
  EffectChoice choice = choose_recipe(*wanted, settings.lens);
  // What the readers do is recorded as it is, whatever was asked for.
  std::erase_if(choice.simulated,
                [](const std::string& name) { return name == "lens_distortion" || name == "fisheye"; });
  const auto any = [&](const auto& test) { return std::any_of(dataset->views.begin(), dataset->views.end(), test); };
  if (any([](const View& v) { return v.lens_treatment != LensTreatment::ignore; })) {
    const bool fisheye = any([](const View& v) { return is_fisheye(v.lens.model); });
    choice.simulated.insert(choice.simulated.begin(), fisheye ? "fisheye" : "lens_distortion");
  }
  if (settings.lens == LensTreatment::ignore && any([](const View& v) { return !is_pinhole(v.lens); }))
    choice.simulated.emplace_back(lens_ignored);
  if (!probes && (recipe_given || chosen.recipe != "scaffold")) {
    return Error{ErrorKind::invalid,
                 {},
                 "--effects",
                 "chooses among the scaffold recipes, but the recipe is " + chosen.recipe,
                 "leave out --effects, or --recipe and --profile"};
  }
  if (probes) {
    for (const ProbedEffect& effect : probed)
      chosen.notes.push_back(std::string("effect ") + effect_name(effect.effect) + ": " + effect.evidence);
  }
  if (recipe_given || chosen.recipe != "scaffold") {
    chosen.simulated.clear();
    for (const std::string& name : choice.simulated) {  // what needs no recipe
      if (name == "principal_point" || name == background || name == "lens_distortion" || name == "fisheye" ||
          name == lens_ignored)
        chosen.simulated.push_back(name);
    }
    if (recipe_given && choice.recipe != chosen.recipe)
      chosen.notes.push_back("recipe " + chosen.recipe + " as told; for these effects it would be " + choice.recipe);
    return Done{};
  }
  chosen.recipe = choice.recipe;
  chosen.simulated = choice.simulated;
  if (chosen.lens == LensTreatment::keep && !projects_lens(chosen.recipe))
    chosen.lens = LensTreatment::undistort;  // there is no lens to speak of
  for (const std::string& name : choice.left_out)
    chosen.notes.push_back("effect " + name + " is left out: no recipe of this tool has it together with the others");
  chosen.notes.push_back("recipe " + chosen.recipe);
  return Done{};
}

}  // namespace compmark::detail
