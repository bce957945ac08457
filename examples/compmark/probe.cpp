// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark probe: measures the scene effects of a capture, with the evidence, and prints the recipe that train would
// choose.
#include <algorithm>
#include <compmark/app/run/effect_choice.hpp>
#include <compmark/io/splat/read_splat.hpp>
#include <compmark/scene/open.hpp>
#include <compmark/scene/probe.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "commands.hpp"
#include "common.hpp"

namespace tool {

Command add_probe(Options& app) {
  struct Told {
    std::filesystem::path data;
    bool json = false;
  };
  auto options = std::make_shared<Told>();
  app.reads("--data", options->data, InputKind::dataset,
            "dataset folder (Blender, instant-ngp, nerfstudio, COLMAP or LLFF)")
      ->required();
  app.flag("--json", options->json, "print one JSON object instead of text");
  return [options]() -> int {
    using namespace compmark;
    if (is_splat_file(options->data)) {
      return fail({ErrorKind::unsupported, options->data.string(), "--data",
                   "is a splat file, which has no photographs whose effects could be measured",
                   "train --data and adopt --splat take it as it is"});
    }
    Result<Dataset> dataset = open_dataset(options->data, {});
    if (!dataset) return fail(dataset.error());
    Result<std::vector<ProbedEffect>> effects = probe_scene(*dataset);
    if (!effects) return fail(effects.error());
    std::vector<SceneEffect> unmeasured = unmeasured_effects(*dataset);
    std::erase_if(unmeasured, [&](SceneEffect effect) {  // the one place that all cameras look at may say enough
      return std::any_of(effects->begin(), effects->end(),
                         [&](const ProbedEffect& probed) { return probed.effect == effect; });
    });
    const EffectChoice choice = choose_recipe(*wanted_effects("auto", *effects), LensTreatment::undistort);
    if (options->json) {
      nlohmann::ordered_json json{{"dataset", options->data.string()},
                                  {"kind", dataset->kind},
                                  {"views_train", dataset->indices(Split::train).size()},
                                  {"views_test", dataset->indices(Split::test).size()},
                                  {"points", dataset->points.size()},
                                  {"points_are_random", dataset->points_are_random},
                                  {"warnings", dataset->warnings},
                                  {"recipe", choice.recipe},
                                  {"left_out", choice.left_out},
                                  {"not_measured", nlohmann::ordered_json::array()},
                                  {"effects", nlohmann::ordered_json::array()}};
      for (const SceneEffect effect : unmeasured) json["not_measured"].push_back(effect_name(effect));
      for (const ProbedEffect& effect : *effects) {
        json["effects"].push_back({{"name", effect_name(effect.effect)},
                                   {"value", effect.value},
                                   {"limit", effect.limit},
                                   {"evidence", effect.evidence}});
        if (effect.effect == SceneEffect::constant_background) json["effects"].back()["color"] = effect.color;
      }
      std::printf("%s\n", json.dump(2).c_str());
      return success;
    }
    for (const std::string& warning : dataset->warnings)
      std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
    std::printf("%s: %s, %zu training and %zu test views, %s\n", options->data.string().c_str(), dataset->kind.c_str(),
                dataset->indices(Split::train).size(), dataset->indices(Split::test).size(),
                dataset->points_are_random ? "no points: training begins with random ones"
                                           : (std::to_string(dataset->points.size()) + " points").c_str());
    if (effects->empty()) std::printf("  no effect of this capture needs to be modelled\n");
    for (const ProbedEffect& effect : *effects) {
      std::printf("  %-20s %10.4g  (limit %g)  %s\n", effect_name(effect.effect), effect.value, effect.limit,
                  effect.evidence.c_str());
    }
    for (const SceneEffect effect : unmeasured) {
      std::printf("  %-20s cannot be measured without %s\n", effect_name(effect),
                  effect == SceneEffect::exposure ? "COLMAP's features" : "a point cloud");
    }
    std::printf("  recipe: %s\n", choice.recipe.c_str());
    for (const std::string& name : choice.left_out) {
      std::printf("  measured, but no recipe of this tool models it together with the others: %s\n", name.c_str());
    }
    return success;
  };
}

}  // namespace tool
