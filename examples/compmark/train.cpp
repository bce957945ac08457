// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark train: trains a model on a dataset and writes it with its measurements and a page; with a key it hides a
// message too. Ctrl-C writes a checkpoint; --resume continues from it to the same bits as an uninterrupted run.
#include <algorithm>
#include <array>
#include <compmark/app/capture.hpp>
#include <compmark/app/recipe_names.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/scene/open.hpp>
#include <compmark/splat/training/model_info.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <compmark/app/recipe_list.hpp>
#include "commands.hpp"
#include "effects.hpp"
#include "mark_record.hpp"
#include "presets.hpp"
#include "results.hpp"
#include "run_folder.hpp"
#include "train_coded.hpp"
#include "train_marked.hpp"
#include "train_recipe.hpp"

namespace tool {
namespace {

/// The folder of the unmarked model of a run that is marked afterwards.
constexpr const char* unmarked_folder = "unmarked";

/// Whether this is post-hoc embedding: a key is given, and no option that asks for another way.
bool marks_afterwards(const TrainOptions& options) {
  const bool held = options.mark.fidelity && *options.mark.fidelity > 0;
  return (options.mark.decoder.empty() || held) && !options.mark.key.empty() && options.mark.twin.empty() &&
         !options.mark.for_compression;
}

/// A resumed run keeps its recipe, effects and background, whatever a probe would measure now. False if there is no run
/// to resume, or if the command gives other ones.
Result<bool> continue_begun(TrainOptions& options) {
  std::filesystem::path checkpoint = options.out / "checkpoint.safetensors";
  if (!std::filesystem::exists(checkpoint) && marks_afterwards(options))
    checkpoint = options.out / unmarked_folder / "checkpoint.safetensors";
  if (!options.resume || !options.recipe.empty() || options.effects != "auto" || !std::filesystem::exists(checkpoint))
    return false;
  const Result<SafetensorsFile> file = read_safetensors(checkpoint);
  if (!file) return file.error();
  const Result<std::string> text = file->text_of("info");
  if (!text) return text.error();
  const nlohmann::json json = json_from<nlohmann::json>(*text);
  const Result<ModelInfo> info = detail::read_info(*file, json);
  if (!info) return info.error();
  if (is_coded_recipe(info->recipe) != (options.codec != "none")) return false;
  options.recipe = info->recipe;
  options.simulated = info->effects;
  const nlohmann::json background = json.value("background", nlohmann::json());
  if (options.background.empty() && background.is_array() && background.size() == 3) {
    std::array<double, 3>& color = options.probed_background.emplace();
    for (std::size_t c = 0; c < 3; ++c) {
      if (!background[c].is_number()) return false;  // the trainer says what is wrong with the file
      color[c] = background[c].get<double>();
    }
  }
  if (options.lens == "undistort") {
    if (projects_lens(options.recipe)) options.lens = "project";
    const auto& effects = options.simulated;
    if (std::find(effects.begin(), effects.end(), lens_ignored) != effects.end()) options.lens = "ignore";
  }
  options.notes.push_back("recipe " + options.recipe + ", as the run began");
  return true;
}

/// Chooses options.recipe, options.simulated and the background, with reasons in options.notes. An explicit --recipe is
/// kept; the recipes of the other profiles have no effects.
Result<Done> choose_effects(TrainOptions& options) {
  const Result<bool> begun = continue_begun(options);
  if (!begun) return begun.error();
  if (*begun) return Done{};
  DatasetSettings settings;
  const bool recipe_given = !options.recipe.empty();
  if (!recipe_given) options.recipe = default_recipe(options.profile);
  if (projects_lens(options.recipe) && options.lens == "undistort") options.lens = "project";  // what it is there for
  settings.lens = lens_treatment(options);
  settings.downscale = options.downscale;
  Result<Dataset> dataset = open_dataset(options.data, settings);
  if (!dataset) return dataset.error();
  const char* const background = effect_name(SceneEffect::constant_background);
  const bool probes = options.effects == "auto";
  std::vector<ProbedEffect> probed;
  if (probes || options.effects.find(background) != std::string::npos) {  // its colour is in the photographs
    Result<std::vector<ProbedEffect>> found = probe_scene(*dataset);
    if (!found) return found.error();
    probed = std::move(*found);
  }
  Result<std::vector<std::string>> wanted = wanted_effects(options.effects, probed);
  if (!wanted) return wanted.error();
  if (std::find(wanted->begin(), wanted->end(), background) != wanted->end()) {
    const auto found = std::find_if(probed.begin(), probed.end(), [](const ProbedEffect& effect) {
      return effect.effect == SceneEffect::constant_background;
    });
    if (!options.background.empty()) {
      std::erase(*wanted, background);  // overruled
    } else if (found != probed.end()) {
      options.probed_background = found->color;
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
  if (!probes && (recipe_given || options.recipe != "scaffold")) {
    return Error{ErrorKind::invalid,
                 {},
                 "--effects",
                 "chooses among the scaffold recipes, but the recipe is " + options.recipe,
                 "leave out --effects, or --recipe and --profile"};
  }
  if (probes) {
    for (const ProbedEffect& effect : probed)
      options.notes.push_back(std::string("effect ") + effect_name(effect.effect) + ": " + effect.evidence);
  }
  if (recipe_given || options.recipe != "scaffold") {
    options.simulated.clear();
    for (const std::string& name : choice.simulated) {  // what needs no recipe
      if (name == "principal_point" || name == background || name == "lens_distortion" || name == "fisheye" ||
          name == lens_ignored)
        options.simulated.push_back(name);
    }
    if (recipe_given && choice.recipe != options.recipe)
      options.notes.push_back("recipe " + options.recipe + " as told; for these effects it would be " + choice.recipe);
    return Done{};
  }
  options.recipe = choice.recipe;
  options.simulated = choice.simulated;
  if (options.lens == "project" && !projects_lens(options.recipe))
    options.lens = "undistort";  // there is no lens to speak of
  for (const std::string& name : choice.left_out)
    options.notes.push_back("effect " + name + " is left out: no recipe of this tool has it together with the others");
  options.notes.push_back("recipe " + options.recipe);
  return Done{};
}

/// Whether exposures of photographs may train although a message is wanted. No recipe with a message has exposures, but
/// post-hoc embedding marks the renders of a finished model, and these have none (marking_recipe).
bool exposes(const TrainOptions& options) {
  if (!options.mark.wanted()) return true;
  return marks_afterwards(options) && (!options.mark.fidelity || *options.mark.fidelity > 0);
}

/// Three recipes can carry a message; an effect that none of them has is left out with a note.
void leave_out_unmarked(TrainOptions& options) {
  if (options.recipe.rfind("scaffold+", 0) != 0) return;
  const auto names = [&](const char* part) { return options.recipe.find(part) != std::string::npos; };
  const bool exposure = names("+exposure") && exposes(options);
  const std::string recipe = std::string("scaffold") + (exposure ? "+exposure" : "") +
                             (names("mask")     ? "+mask"
                              : names("+alpha") ? "+alpha"
                                                : "");
  if (recipe == options.recipe) return;
  for (const char* effect : {"exposure", "anti_aliasing", "far_field"}) {
    if (exposure && effect == std::string_view("exposure")) continue;
    if (std::erase(options.simulated, effect) != 0)
      options.notes.push_back(std::string("effect ") + effect + " is left out: no recipe with a message has it");
  }
  options.recipe = recipe;
  options.notes.push_back("recipe " + recipe);
}

/// From the recipe of the effects to one that trains for the codec, or that one can be fitted to; effects that it lacks
/// are left out with a note.
Result<Done> choose_codec(TrainOptions& options, bool recipe_given) {
  const bool coded = is_coded_recipe(options.recipe);
  if (options.codec == "none" && !coded && !options.for_fit_codec) return Done{};
  if (options.for_fit_codec && (coded || options.codec != "none")) {
    return Error{ErrorKind::invalid,
                 {},
                 "--for-fit-codec",
                 "belongs to a model without a codec, but this run trains for one",
                 "leave out one of the two options"};
  }
  if (coded) {
    if (options.recipe.find("+fitted") != std::string::npos) {
      return Error{ErrorKind::invalid,
                   {},
                   "--recipe",
                   "\"" + options.recipe + "\" is for fitting a codec to a finished model",
                   "use compmark fit-codec"};
    }
    if (options.codec != "none" && options.codec != recipe_codec(options.recipe)) {
      return Error{ErrorKind::invalid,
                   {},
                   "--codec",
                   "\"" + options.codec + "\" is not the codec of recipe " + options.recipe,
                   "leave out one of the two options"};
    }
    options.codec = recipe_codec(options.recipe);
    return Done{};
  }
  if (!recipe_given && !options.for_fit_codec && is_published_profile(options.profile)) {
    options.recipe = options.codec;  // its numbers in the codec's own recipe
    options.notes.push_back("recipe " + options.recipe);
    return Done{};
  }
  if (recipe_given || options.recipe.rfind("scaffold", 0) != 0) {
    return Error{ErrorKind::invalid,
                 {},
                 options.for_fit_codec ? "--for-fit-codec" : "--codec",
                 (options.for_fit_codec ? "" : "\"" + options.codec + "\" ") +
                     "has recipes of its own, but the recipe is " + options.recipe,
                 "leave out --recipe and --profile"};
  }
  const auto names = [&](const char* part) { return options.recipe.find(part) != std::string::npos; };
  // Masks before exposure: what a lens left empty must not count.
  const bool alpha = names("+alpha"), mask = !alpha && names("mask"),
             exposure = !alpha && !mask && names("+exposure") && exposes(options);
  options.recipe = (options.for_fit_codec ? "scaffold" : options.codec) + (alpha      ? "+alpha"
                                                                           : exposure ? "+exposure"
                                                                           : mask     ? "+mask"
                                                                                      : "");
  for (const auto& [effect, kept] :
       {std::pair{"alpha", alpha}, std::pair{"masks", mask}, std::pair{"exposure", exposure},
        std::pair{"anti_aliasing", false}, std::pair{"far_field", false}}) {
    if (!kept && std::erase(options.simulated, effect) != 0)
      options.notes.push_back(std::string("effect ") + effect + " is left out: no recipe for this run has it");
  }
  options.notes.push_back("recipe " + options.recipe);
  return Done{};
}

/// Trains the unmarked model in a folder of its own, then hides the message in it by post-hoc embedding. Without a
/// decoder one is fitted in between. The unmarked model is kept.
int train_then_mark(TrainOptions options, const TrainSettings& settings) {
  // All options are checked before hours of work.
  const Result<OwnerKey> key = key_of(options.mark);
  if (!key) return fail(key.error());
  const bool coded = is_coded_recipe(options.recipe);
  if (Result<Done> can = can_mark_finished(options); !can) return fail(can.error());
  if (Result<Done> apt = check_held(options.mark, options.mark.fidelity.value_or(1)); !apt) return fail(apt.error());
  if (Result<Done> fits = check_to_fit(options.mark); !fits) return fail(fits.error());
  Result<std::shared_ptr<const void>> held = hold_folder(options.out);
  if (!held) return fail(held.error());
  options.folder = std::move(*held);
  const std::filesystem::path checkpoint = options.out / "checkpoint.safetensors";
  if (!options.resume && std::filesystem::exists(checkpoint)) return fail(unfinished_run(checkpoint));
  const std::filesystem::path decoder = options.out / "decoder.safetensors";
  const bool fits = options.mark.decoder.empty();
  if (fits && !options.resume && !options.force && std::filesystem::exists(decoder)) {
    return fail({ErrorKind::invalid, decoder.string(), "--out", "holds the decoder of an earlier run",
                 "to keep it, choose another --out; to continue, give --resume; to move it aside, give"
                 " --force"});
  }
  for (const std::filesystem::path& folder : {options.out, options.out / unmarked_folder}) {
    if (Result<Done> free = check_unfinished(folder, options.resume || options.force); !free) return fail(free.error());
  }
  warn_of_record(options.mark.key, options.out);
  if (fits && options.force && !options.resume) {
    if (Result<Done> moved = move_decoder_aside(decoder); !moved) return fail(moved.error());
  }
  TrainOptions host = options;
  host.mark = {};
  host.folder.reset();  // its own
  host.out = options.out / unmarked_folder;
  host.json_log.clear();  // its own: host.out/log.jsonl
  const int code =
      coded ? train_coded(host, settings, nullptr)
            : with_recipe(options.recipe,
                          ExitCode([&](auto tag) { return run<typename decltype(tag)::Recipe>(host, settings); }));
  if (code != success) return code;
  TrainOptions marked = options;
  marked.model = host.out / "model.safetensors";
  marked.iterations = options.mark_iterations;
  marked.notes.clear();
  return embed_model(marked);
}

/// Sets the options of --preset that were not given.
void apply_preset(const Options& app, TrainOptions& options) {
  for (const Preset& preset : presets) {
    if (options.preset != preset.name) continue;
    if (app.count("--iterations") == 0) options.iterations = preset.iterations;
    if (app.count("--lambda") == 0) options.rate_lambda = preset.rate_lambda;
    if (app.count("--mark-iterations") == 0) options.mark_iterations = preset.mark_iterations;
  }
}

}  // namespace

Command add_train(Options& app) {
  auto options = std::make_shared<TrainOptions>();
  app.reads("--data", options->data, InputKind::dataset,
            "dataset folder (Blender, instant-ngp, nerfstudio, COLMAP or LLFF)")
      ->required();
  app.writes_into("--out", options->out, "folder for the model, results.json and report.html")->required();
  app.word("--recipe", options->recipe,
           "scaffold (with +mask, +alpha, +alpha+antialiasing, +antialiasing, "
           "+antialiasing+mask, +lens, +fisheye, +exposure, +exposure+mask, +farfield or "
           "+exposure+farfield), hac or context_gs (with +mask, +alpha or +exposure), "
           "compmark-host or compmark-paper-host (default: chosen from the data or the profile)");
  app.word("--codec", options->codec, "codec to train for: none, hac or context_gs; a codec writes model.cmk too")
      ->capture_default_str()
      ->check(CLI::IsMember({"none", "hac", "context_gs"}));
  app.flag("--for-fit-codec", options->for_fit_codec, "leave out effects that compmark fit-codec does not support");
  app.number("--lambda", options->rate_lambda, share_range,
             "with a codec: loss of one bit more a scalar, from 0.0005 (quality) to 0.004 (size)")
      ->capture_default_str();
  app.word("--profile", options->profile,
           "hyper-parameters: scaffold, hac, official (the program of the published method) or "
           "paper (its text); the last two hide a message while training (--decoder)")
      ->capture_default_str();
  app.number("--iterations", options->iterations, run_length, "iterations of the run; every phase scales with it")
      ->capture_default_str();
  std::vector<std::string> preset_names;
  for (const Preset& preset : presets) preset_names.emplace_back(preset.name);
  app.word("--preset", options->preset,
           "draft, standard or best: sets --iterations, --lambda and --mark-iterations, unless "
           "they are given")
      ->check(CLI::IsMember(preset_names));
  app.number("--downscale", options->downscale, downscale_range, "divide the size of the images by this")
      ->capture_default_str();
  app.number("--seed", options->seed, any_seed, "seed of every random number (default: the profile's)");
  app.number("--threads", options->threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  app.number("--max-anchors", options->max_anchors, any_count, "largest number of anchors; 0: no limit")
      ->capture_default_str();
  app.number("--memory-budget", options->memory_budget_mb, WholeRange{0, 1 << 24},
             "MiB of memory for decoded images; 0: chosen by the program")
      ->capture_default_str();
  app.number("--checkpoint-every", options->checkpoint_every, run_length, "iterations between checkpoints")
      ->capture_default_str();
  app.number("--voxel-size", options->voxel_size, RealRange{-1e9, 1e9},
             "cell size of anchors, in units of the dataset; 0 or less: median nearest-neighbour "
             "distance (default: the profile's)")
      ->each([options](const std::string&) { options->voxel_size_given = true; });
  app.word("--background", options->background, "colour behind transparent images: black or white (default: black)");
  app.word("--effects", options->effects,
           "scene effects to model, which choose the recipe: auto (measured as by compmark "
           "probe), none, or names separated by commas")
      ->capture_default_str();
  app.word("--lens", options->lens,
           "undistort (images are resampled once), project (Gaussians are projected through the "
           "lens) or ignore")
      ->capture_default_str()
      ->check(CLI::IsMember({"undistort", "project", "ignore"}));
  app.flag("--resume", options->resume, "continue the run in --out from its checkpoint");
  app.flag("--force", options->force, "replace a finished run in --out");
  app.writes("--json-log", options->json_log, OutputKind::words,
             "write progress to this file, one JSON object a line (default: log.jsonl in --out)");
  app.reads("--lpips-alex", options->lpips.alex, InputKind::weights,
            "LPIPS weights (safetensors) to report lpips_alex");
  app.reads("--lpips-squeeze", options->lpips.squeeze, InputKind::weights,
            "LPIPS weights (safetensors) to report lpips_squeeze");
  app.flag("--lpips-family-range", options->lpips.family_range,
           "give LPIPS images in [0, 1], as the 3DGS family does, not in [-1, 1]");
  add_mark_options(app, options->mark, false);
  app.number("--mark-iterations", options->mark_iterations, run_length,
             "iterations that hide the message after the training, without --decoder (default: "
             "2000; 4000 for a codec)");
  app.also([options](FileUse& use) {
    add_run_files(use, *options, options->out);
    add_record_written(use, options->mark.key);
    if (marks_afterwards(*options)) {
      add_run_files(use, *options, options->out / unmarked_folder);
      use.write_in(options->out, {"unmarked.cmk"}, "--out");
      if (options->mark.decoder.empty()) use.write_in(options->out, {"decoder.safetensors", "decoder.json"}, "--out");
    }
  });
  return [options, &app]() -> int {
    apply_preset(app, *options);
    if (Result<Done> free = check_unfinished(options->out, options->resume || options->force); !free)
      return fail(free.error());
    const bool coded = options->codec != "none" || is_coded_recipe(options->recipe);
    if (coded && options->profile == "scaffold") options->profile = "hac";
    std::optional<TrainSettings> settings = profile_settings(options->profile);
    if (!settings) {
      return fail({ErrorKind::invalid,
                   {},
                   "--profile",
                   "unknown profile \"" + options->profile + "\"",
                   "choose scaffold, hac, official or paper"});
    }
    const bool recipe_given = !options->recipe.empty();
    if (Result<Done> chosen = choose_effects(*options); !chosen) return fail(chosen.error());
    if (Result<Done> chosen = choose_codec(*options, recipe_given); !chosen) return fail(chosen.error());
    if (options->mark.wanted() && !recipe_given && !coded) leave_out_unmarked(*options);
    if (coded) {
      if (is_published_profile(options->profile)) *settings = for_codec(*settings);
      settings->rate.lambda = options->rate_lambda;
    }
    settings->iterations = options->iterations;
    settings->max_anchors = options->max_anchors;
    if (options->seed) settings->seed = *options->seed;
    if (options->voxel_size_given) settings->voxel_size = options->voxel_size;
    if (options->background == "white") {
      settings->background = {1, 1, 1};
    } else if (!options->background.empty() && options->background != "black") {
      return fail({ErrorKind::invalid,
                   {},
                   "--background",
                   "unknown colour \"" + options->background + "\"",
                   "choose black or white"});
    } else if (options->probed_background) {
      for (std::size_t c = 0; c < 3; ++c)
        settings->background[c] = static_cast<float>((*options->probed_background)[c]);
    }
    if (options->recipe.find("+antialiasing") != std::string::npos)
      settings->blur_variance = recipes::antialiasing_blur_variance;
    if (options->mark.wanted()) {
      if (is_published_profile(options->profile) && options->mark.decoder.empty()) {
        return fail(
            {ErrorKind::invalid,
             {},
             "--profile",
             "\"" + options->profile + "\" hides the message while the scene trains and needs a finished decoder",
             "give --decoder (one of weights/, or of compmark pretrain), or leave out --profile"});
      }
      if (is_published_profile(options->profile) && options->mark.fidelity && *options->mark.fidelity > 0) {
        return fail({ErrorKind::unsupported,
                     {},
                     "--fidelity",
                     "above 0 is for post-hoc embedding, but profile \"" + options->profile +
                         "\" hides the message while the scene trains",
                     "leave out one of the two options"});
      }
      if (marks_afterwards(*options)) return train_then_mark(*options, *settings);
      if (options->mark.fidelity && *options->mark.fidelity > 0) {
        const bool key = options->mark.key.empty(), twin = !options->mark.twin.empty();
        return fail({ErrorKind::unsupported,
                     {},
                     "--fidelity",
                     "above 0 needs a finished model to mark",
                     key    ? "give a --key too"
                     : twin ? "leave out --twin: this run trains the unmarked model too"
                            : "leave out --for-compression, which is for marks that train with the scene"});
      }
      for (const auto& [given, name] : {std::pair(options->mark.by_cost.has_value(), "--draw-by-cost"),
                                        std::pair(options->mark.hold_steps.has_value(), "--hold-steps")}) {
        if (!given) continue;
        return fail({ErrorKind::unsupported,
                     {},
                     name,
                     "belongs to post-hoc embedding, but this mark trains with the scene",
                     "leave out this option or --decoder, or mark the finished model with compmark embed"});
      }
      if (Result<Done> fits = check_to_fit(options->mark); !fits) return fail(fits.error());
      Result<MarkInput> mark = load_mark(options->mark, *settings);
      if (mark && coded) return train_coded(*options, *settings, &*mark);
      return mark ? train_marked(*options, *settings, *mark) : fail(mark.error());
    }
    if (coded) return train_coded(*options, *settings, nullptr);
    return with_recipe(options->recipe,
                       ExitCode([&](auto tag) { return run<typename decltype(tag)::Recipe>(*options, *settings); }));
  };
}

}  // namespace tool
