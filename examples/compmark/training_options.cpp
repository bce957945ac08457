// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "training_options.hpp"

#include <compmark/app/recipe_names.hpp>

#include "decoder_choice.hpp"

#include <optional>
#include <string>
#include <vector>

#include "nearest_word.hpp"
#include "presets.hpp"
#include "run_folder.hpp"

namespace tool {

using namespace compmark;

namespace {

/// Sets the options of --preset that were not given.
void apply_preset(const Options& app, const std::string& name, TrainSceneSettings& settings) {
  for (const Preset& preset : presets) {
    if (name != preset.name) continue;
    if (app.count("--iterations") == 0) settings.iterations = preset.iterations;
    if (app.count("--lambda") == 0) settings.rate_lambda = preset.rate_lambda;
    if (app.count("--mark-iterations") == 0) settings.mark_iterations = preset.mark_iterations;
  }
}

/// What a training asks for beside its photographs.
void bind_training(Options& app, TrainOptions& options) {
  app.writes_into("--out", options.settings.out, "folder for the model, results.json and report.html")->required();
  app.word("--recipe", options.settings.recipe,
           "scaffold (with +mask, +alpha, +alpha+antialiasing, +antialiasing, "
           "+antialiasing+mask, +lens, +fisheye, +exposure, +exposure+mask, +farfield or "
           "+exposure+farfield), hac or context_gs (with +mask, +alpha, +exposure or +exposure+mask), "
           "compmark-host or compmark-paper-host (default: chosen from the data or the profile)");
  app.word("--codec", options.settings.codec,
           "codec to train for: none, hac, context_gs, or hac_plus, which trains as hac and writes a smaller file; a "
           "codec writes model.cmk too")
      ->capture_default_str()
      ->check(CLI::IsMember({"none", "hac", "context_gs", "hac_plus"}));
  app.flag("--for-fit-codec", options.settings.for_fit_codec,
           "leave out effects that compmark fit-codec does not support");
  app.number(
         "--lambda", options.settings.rate_lambda, share_range,
         "with --codec: weight of the file's size in the loss: larger gives a smaller file and a worse picture, from "
         "0.0005 (quality) to 0.004 (size)")
      ->capture_default_str();
  app.word("--profile", options.settings.profile,
           "hyper-parameters: scaffold, hac, official (the program of the published method) or "
           "paper (its text); the last two hide a message while training (--decoder)")
      ->capture_default_str();
  app.number("--iterations", options.settings.iterations, run_length,
             "iterations of the run; every phase scales with it")
      ->capture_default_str();
  std::vector<std::string> preset_names;
  for (const Preset& preset : presets) preset_names.emplace_back(preset.name);
  app.word("--preset", options.preset,
           "draft, standard or best: sets --iterations, --lambda and --mark-iterations, unless "
           "they are given")
      ->check(CLI::IsMember(preset_names));
  app.number("--downscale", options.settings.downscale, downscale_range, "divide the size of the images by this")
      ->capture_default_str();
  app.word(
      "--coarse-to-fine", options.settings.coarse_to_fine,
      "levels that look at smaller photographs first, as FACTOR:UNTIL: 2:0.6 halves their sides for the first 0.6 of "
      "the iterations, 4:0.2,2:0.6 has two levels (default: none)");
  app.number("--seed", options.settings.seed, any_seed, "seed of every random number (default: the profile's)");
  app.number("--threads", options.run.threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  app.number("--max-anchors", options.settings.max_anchors, any_count, "largest number of anchors; 0: no limit")
      ->capture_default_str();
  app.number("--memory-budget", options.settings.memory_budget_mb, WholeRange{0, 1 << 24},
             "MiB of memory for decoded images; 0: chosen by the program")
      ->capture_default_str();
  app.number("--checkpoint-every", options.settings.checkpoint_every, run_length, "iterations between checkpoints")
      ->capture_default_str();
  app.number("--voxel-size", options.settings.voxel_size, RealRange{-1e9, 1e9},
             "cell size of anchors, in units of the dataset; 0 or less: median nearest-neighbour "
             "distance (default: the profile's)");
  app.word("--background", options.background, "colour behind transparent images: black or white (default: black)");
  app.word("--effects", options.settings.effects,
           "scene effects to model, which choose the recipe: auto (measured as by compmark "
           "probe), none, or names separated by commas")
      ->capture_default_str();
  app.word("--lens", options.lens,
           "undistort (images are resampled once), project (Gaussians are projected through the "
           "lens) or ignore")
      ->capture_default_str()
      ->check(CLI::IsMember({"undistort", "project", "ignore"}));
  add_splat_up(app, options.settings.splat_up);
  app.flag("--resume", options.settings.resume, "continue the run in --out from its checkpoint");
  app.flag("--force", options.settings.force, "replace a finished run in --out");
  app.writes("--json-log", options.run.json_log, OutputKind::words,
             "write progress to this file, one JSON object a line (default: log.jsonl in --out)");
  app.reads("--lpips-alex", options.settings.lpips.alex, InputKind::weights,
            "LPIPS weights (safetensors) to report lpips_alex");
  app.reads("--lpips-squeeze", options.settings.lpips.squeeze, InputKind::weights,
            "LPIPS weights (safetensors) to report lpips_squeeze");
  app.flag("--lpips-family-range", options.settings.lpips.family_range,
           "give LPIPS images in [0, 1], as the 3DGS family does, not in [-1, 1]");
  add_mark_options(app, options.settings.mark, false);
  app.number(
      "--mark-iterations", options.settings.mark_iterations, run_length,
      "iterations that hide the message after the training (default: 2000; 4000 for a codec with --decoder fit)");
  app.also([&options](FileUse& use) {
    const TrainSceneSettings& settings = options.settings;
    const RunFiles run{settings.out, options.run.json_log, {}, settings.mark.wanted()};
    add_run_files(use, run, settings.out);
    add_record_written(use, settings.mark.key);
    if (marks_afterwards(settings)) {
      add_run_files(use, run, settings.out / "unmarked");
      use.write_in(settings.out, {"unmarked.cmk"}, "--out");
      if (fits_decoder(settings.mark)) use.write_in(settings.out, {"decoder.safetensors", "decoder.json"}, "--out");
    }
  });
}

}  // namespace

void bind_options(Options& app, TrainOptions& options) {
  app.reads("--data", options.settings.data, InputKind::dataset,
            "dataset folder (Blender, instant-ngp, nerfstudio, COLMAP or LLFF), or a splat file, whose renders are "
            "the photographs")
      ->required();
  bind_training(app, options);
}

void bind_adopt_options(Options& app, TrainOptions& options) {
  app.reads("--splat", options.settings.data, InputKind::splats,
            "splat file of any program (PLY, compressed PLY, SPZ, SOG, .splat, .ksplat or .glb), not the folder of a "
            "capture; its renders from 128 cameras round it are the photographs")
      ->required();
  bind_training(app, options);
}

Result<Done> check_given(const Options& app, const TrainOptions& options) {
  const TrainSceneSettings& settings = options.settings;
  // Presets set both of them.
  if (app.count("--lambda") != 0 && settings.codec == "none" && !is_coded_recipe(settings.recipe)) {
    return Error{ErrorKind::invalid,
                 {},
                 "--lambda",
                 "weighs the size of a compressed file, and none is asked for",
                 "give --codec, or leave it out"};
  }
  if (app.count("--mark-iterations") != 0 && settings.mark.key.empty()) {
    return Error{ErrorKind::invalid, {}, "--mark-iterations", "needs a message to hide", "give --key"};
  }
  if (app.count("--mark-iterations") != 0 && !marks_afterwards(settings)) {
    return Error{ErrorKind::invalid,
                 {},
                 "--mark-iterations",
                 "is of a message that is hidden after the training, but here it is hidden while the scene trains",
                 "give --iterations, or leave it out"};
  }
  return Done{};
}

Result<Done> complete(const Options& app, TrainOptions& options) {
  TrainSceneSettings& settings = options.settings;
  apply_preset(app, options.preset, settings);
  settings.lens = options.lens == "ignore"    ? LensTreatment::ignore
                  : options.lens == "project" ? LensTreatment::keep
                                              : LensTreatment::undistort;
  if (options.background == "white") {
    settings.background = {1, 1, 1};
  } else if (options.background == "black") {
    settings.background = {0, 0, 0};
  } else if (!options.background.empty()) {
    return Error{ErrorKind::invalid,
                 {},
                 "--background",
                 "unknown colour \"" + options.background + "\"",
                 "choose black or white"};
  }
  return choose_decoder(settings.mark);
}

void bind_options(Options& app, EmbedOptions& options) {
  app.reads("--model", options.settings.model, InputKind::markable,
            "the unmarked model: model.safetensors of a training or of fit-codec, or a splat file of any program")
      ->required();
  app.reads("--data", options.settings.data, InputKind::dataset,
            "the dataset it was trained on; not needed for a splat file, which is then seen from cameras round it");
  app.writes_into("--out", options.settings.out,
                  "folder for the marked model, results.json and report.html; for a codec also "
                  "model.cmk and unmarked.cmk, for a splat file marked.ply")
      ->required();
  app.number("--iterations", options.settings.iterations, run_length,
             "iterations of the run (default: 2000; in a model for a codec 4000 with a decoder that is fitted to the "
             "scene, and 8000 with any other file than the program's)");
  add_finished_model_options(app, options.settings, options.run);
  add_splat_up(app, options.settings.splat_up);
  add_mark_options(app, options.settings.mark, true);
  app.word("--method", options.method,
           "compmark, or as a published baseline hides its message, to compare with (docs/baselines.md): waterf, "
           "guardsplat, gaussianmarker or 3dgsw, in models of the recipe scaffold")
      ->capture_default_str();
  app.word("--distortion", options.distortion,
           "how training replaces the quantizer of a codec before it reads the message: round "
           "(as the file does), noise (as wide as a step) or none")
      ->capture_default_str()
      ->check(CLI::IsMember({"round", "noise", "none"}));
  app.word("--codec", options.settings.codec,
           "codec of the file that is written of a model for a codec. trained: the one that it was trained for; "
           "hac_plus: "
           "fewer bytes, of a model for hac")
      ->capture_default_str()
      ->check(CLI::IsMember({"trained", "hac_plus"}));
  app.also([&options](FileUse& use) {
    const EmbedSettings& settings = options.settings;
    add_run_files(use, {settings.out, options.run.json_log, settings.model, settings.mark.wanted()}, settings.out);
    add_record_written(use, settings.mark.key);
    if (fits_decoder(settings.mark)) use.write_in(settings.out, {"decoder.safetensors", "decoder.json"}, "--out");
    if (settings.mark.unmarked.empty()) use.write(settings.out / "unmarked.cmk", "--out");
    use.write(settings.out / "marked.ply", "--out");
  });
}

namespace {

Error unknown_method(const std::string& name) {
  const std::vector<std::string> known(embed_method_names.begin(), embed_method_names.end());
  std::string all;
  for (const std::string& one : known) all += (all.empty() ? "" : ", ") + one;
  const std::string nearest = nearest_word(name, known);
  return {ErrorKind::invalid,
          {},
          "--method",
          "\"" + name + "\" is none of " + all,
          nearest.empty() ? "give one of them" : "did you mean " + nearest + "?"};
}

}  // namespace

Result<Done> complete(const Options& /*app*/, EmbedOptions& options) {
  if (options.distortion == "noise") options.settings.distortion = EmbedDistortion::noise;
  if (options.distortion == "none") options.settings.distortion = EmbedDistortion::none;
  const std::optional<EmbedMethod> method = embed_method(options.method);
  if (!method) return unknown_method(options.method);
  options.settings.method = *method;
  return choose_decoder(options.settings.mark);
}

void bind_options(Options& app, FitCodecOptions& options) {
  app.reads("--model", options.settings.model, InputKind::trained_model,
            "a finished model (model.safetensors of a training without --codec)")
      ->required();
  app.reads("--data", options.settings.data, InputKind::dataset, "the dataset it was trained on")->required();
  app.writes_into("--out", options.settings.out,
                  "folder for model.cmk, model.safetensors, results.json and report.html")
      ->required();
  app.word("--codec", options.settings.codec,
           "hac, context_gs, or hac_plus, which is fitted as hac and writes a smaller file")
      ->capture_default_str()
      ->check(CLI::IsMember({"hac", "context_gs", "hac_plus"}));
  app.number("--lambda", options.settings.rate_lambda, share_range,
             "weight of the file's size in the loss: larger gives a smaller file and a worse picture")
      ->capture_default_str();
  app.flag("--touch-up", options.settings.touch_up,
           "also train the model's attributes and networks, at small learning rates; the file is"
           " smaller, but the model changes");
  app.number("--iterations", options.settings.iterations, run_length, "iterations of the run")->capture_default_str();
  app.reads("--key", options.settings.mark.key, InputKind::key,
            "owner's key of a marked model; its message is read from the fitted model and from "
            "its file");
  add_recipient(app, options.settings.mark.recipient);
  app.reads("--decoder", options.settings.mark.decoder, InputKind::decoder, reading_decoder_text);
  app.reads("--unmarked", options.settings.mark.unmarked, InputKind::model,
            "the unmarked counterpart, a model or its .cmk, to measure the cost of the mark and "
            "of the file");
  add_finished_model_options(app, options.settings, options.run);
  app.also([&options](FileUse& use) {
    const FitCodecSettings& settings = options.settings;
    add_run_files(use, {settings.out, options.run.json_log, settings.model, settings.mark.wanted()}, settings.out);
    add_record_read(use, settings.mark.key, settings.model);
  });
}

Result<Done> complete(const Options& /*app*/, FitCodecOptions& options) {
  MarkSettings& mark = options.settings.mark;
  return mark.key.empty() ? Result<Done>(Done{}) : choose_decoder(mark.decoder, options.settings.model);
}

}  // namespace tool
