// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark fit-codec: compresses a model that was not trained for a codec. It fits the codec's part to the model: how
// finely each anchor is rounded, which offsets can be masked, and how probable each number is. The loss of the
// photographs measures the error of rounding. The model's attributes and networks keep their bits; with --touch-up they
// train on. A mark of the model is rounded too, and --key and --decoder measure what is left of it; a mark that is
// hidden in the fitted model instead (compmark embed) is trained under the rounding of its file.
#include <compmark/app/files.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <compmark/app/recipe_list.hpp>
#include "commands.hpp"
#include "common.hpp"
#include "mark_input.hpp"
#include "mark_record.hpp"
#include "model_files.hpp"
#include "run_folder.hpp"
#include "train_coded.hpp"
#include "train_run.hpp"

namespace tool {
namespace {

using namespace compmark;

/// Of a finished model: nothing grows, and the rate counts from the first iteration on.
TrainSettings codec_settings(TrainSettings settings, bool touch_up, bool exposes) {
  settings.grow_until = 0;
  settings.rate.noise_after = settings.rate.context_after = 0;
  const auto last = [&](LearningRate& rate) {
    rate = touch_up ? LearningRate{rate.final, rate.final} : LearningRate{};
  };
  for (LearningRate* rate : {&settings.offset, &settings.mlp_opacity, &settings.mlp_color}) last(*rate);
  if (exposes) last(settings.effects.exposure);
  // Those that are constant in a training.
  for (LearningRate* rate : {&settings.feature, &settings.scaling, &settings.mlp_covariance})
    *rate = touch_up ? LearningRate{rate->final / 10, rate->final / 100} : LearningRate{};
  return settings;
}

/// The recipe that fits `codec` to models of `recipe`.
Result<std::string> fitted_recipe(const std::string& recipe, const std::string& codec,
                                  const std::filesystem::path& model) {
  if (is_coded_recipe(recipe)) {
    return Error{ErrorKind::invalid, model.string(), "recipe", "\"" + recipe + "\" is already trained for a codec",
                 "write its file with compmark compress"};
  }
  const bool mask = recipe.find("+mask") != std::string::npos, exposure = recipe == "scaffold+exposure";
  if (reading_recipe(recipe) != "scaffold" && !exposure) {
    return Error{ErrorKind::unsupported, model.string(), "recipe", "\"" + recipe + "\" cannot be fitted with a codec",
                 "use scaffold, alone or with +mask, +alpha or +exposure; compmark train --codec "
                 "trains others for "};
  }
  return codec + "+fitted" + (mask ? "+mask" : exposure ? "+exposure" : "");
}

int fit_codec(TrainOptions options, bool touch_up) {
  if (Result<Done> free = check_unfinished(options.out, options.resume || options.force); !free)
    return fail(free.error());
  if (is_coded_file(options.model))
    return fail({ErrorKind::invalid, options.model.string(), {}, "is compressed already", "copy the file"});
  const Result<std::string> recipe = [&]() -> Result<std::string> {
    const Result<SafetensorsFile> file = read_safetensors(options.model);
    if (!file) return file.error();
    Result<std::string> of_model = model_recipe(*file);
    return of_model ? fitted_recipe(*of_model, options.codec, options.model) : of_model;
  }();
  if (!recipe) return fail(recipe.error());
  options.recipe = *recipe;
  options.profile = "hac";
  const Result<std::string> digest = file_sha256(options.model);
  if (!digest) return fail(digest.error());
  TrainSettings settings = *profile_settings(options.profile);
  settings.iterations = options.iterations;
  if (options.seed) settings.seed = *options.seed;
  settings.rate.lambda = options.rate_lambda;
  std::optional<MarkInput> mark;
  if (options.mark.wanted()) {
    if (options.mark.key.empty())
      return fail({ErrorKind::invalid, {}, "--key", "is missing", "give the key that the model was marked with"});
    if (Result<Done> fits = check_to_fit(options.mark); !fits) return fail(fits.error());
    TrainSettings of_a_mark = settings;  // nothing trains for it
    Result<MarkInput> read = load_mark(options.mark, of_a_mark);
    if (!read) return fail(read.error());
    if (const Result<Done> recorded = check_recorded(options.mark.key, read->key, options.mark.decoder, options.model);
        !recorded)
      std::fprintf(stderr, "compmark: warning: %s: %s\n", options.mark.decoder.string().c_str(),
                   recorded.error().problem.c_str());
    mark = std::move(*read);
    mark->read_only = true;
  }
  const bool exposes = options.recipe.find("+exposure") != std::string::npos;
  settings.mark.identity = digest->substr(0, 16);  // a run is resumed from the same model alone
  return train_coded(options, codec_settings(std::move(settings), touch_up, exposes), mark ? &*mark : nullptr);
}

}  // namespace

Command add_fit_codec(Options& app) {
  auto options = std::make_shared<TrainOptions>();
  auto touch_up = std::make_shared<bool>(false);
  options->iterations = 3000;
  options->codec = "hac";
  app.reads("--model", options->model, InputKind::trained_model,
            "a finished model (model.safetensors of a training without --codec)")
      ->required();
  app.reads("--data", options->data, InputKind::dataset, "the dataset it was trained on")->required();
  app.writes_into("--out", options->out, "folder for model.cmk, model.safetensors, results.json and report.html")
      ->required();
  app.word("--codec", options->codec, "hac or context_gs")
      ->capture_default_str()
      ->check(CLI::IsMember({"hac", "context_gs"}));
  app.number("--lambda", options->rate_lambda, share_range, "loss of one bit more a scalar")->capture_default_str();
  app.flag("--touch-up", *touch_up,
           "also train the model's attributes and networks, at small learning rates; the file is"
           " smaller, but the model changes");
  app.number("--iterations", options->iterations, run_length, "iterations of the run")->capture_default_str();
  app.reads("--key", options->mark.key, InputKind::key,
            "owner's key of a marked model; its message is read from the fitted model and from "
            "its file (with --decoder)");
  app.reads("--decoder", options->mark.decoder, InputKind::decoder, "message decoder that reads it");
  app.reads("--twin", options->mark.twin, InputKind::model,
            "the unmarked counterpart, a model or its .cmk, to measure the cost of the mark and "
            "of the file");
  add_finished_model_options(app, *options);
  app.also([options](FileUse& use) {
    add_run_files(use, *options, options->out);
    add_record_read(use, options->mark.key, options->model);
  });
  return [options, touch_up]() -> int { return fit_codec(*options, *touch_up); };
}

}  // namespace tool
