// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark embed: hides a message in a finished model. It trains a residual of the features alone; the source model is
// not changed. Without --decoder one is fitted to the scene first. With --fidelity 0 the whole model trains on instead,
// with the photographs it was trained on: nothing grows, and the learning rates are small.
#include <compmark/app/compress.hpp>
#include <compmark/app/files.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <compmark/app/recipe_list.hpp>
#include "commands.hpp"
#include "finished_run.hpp"
#include "fit_run.hpp"
#include "mark_record.hpp"
#include "model_files.hpp"
#include "run_folder.hpp"
#include "train_coded.hpp"
#include "train_marked.hpp"
#include "train_recipe.hpp"

namespace tool {
namespace {

/// Settings of a mark in a finished model: only the residual trains. With --fidelity 0 (the published way) everything
/// trains on, at constant small rates and without growing. The message begins with the first iteration. `distortion` is
/// applied to the features of a model for a codec before the message is read: "round" as the file does, "noise" as wide
/// as a step (the distortion layer of the paper), or "none". The file is rounded in every case.
TrainSettings embed_settings(TrainSettings settings, const std::string& distortion) {
  settings.grow_until = 0;
  settings.mark.message.after = settings.mark.residual.after = 0;
  settings.mark.hsv.after = 0;
  settings.mark.frequency.after = 0;
  if (settings.mark.posthoc.fidelity > 0) {
    for (LearningRate* rate :
         {&settings.offset, &settings.feature, &settings.scaling, &settings.mlp_opacity, &settings.mlp_covariance,
          &settings.mlp_color, &settings.feature_bank, &settings.appearance, &settings.effects.exposure}) {
      *rate = {0, 0};
    }
    // A model for a codec is read as its file is: rounded from the first iteration on, with a fixed context.
    RateNumbers& rate = settings.rate;
    rate.mask = rate.grid = rate.context = {0, 0};
    rate.hyperprior = 0;
    constexpr std::int64_t always = -60000, never = 60000;  // of 30,000
    rate.noise_after = rate.context_after = distortion == "none" ? never : always;
    rate.round_after = distortion == "round" ? always : never;
    settings.mark.distortion.learning_rate = 0;
    return settings;
  }
  const auto last = [](LearningRate& rate) { rate.initial = rate.final; };
  last(settings.offset);
  last(settings.mlp_opacity);
  last(settings.mlp_color);
  settings.mlp_covariance = {settings.mlp_color.final, settings.mlp_color.final};
  settings.scaling = {settings.mark.residual.learning_rate / 10, settings.mark.residual.learning_rate / 100};
  settings.feature = {settings.mark.residual.learning_rate, settings.mark.residual.learning_rate / 10};
  return settings;
}

/// A resumed run keeps the decoder that it began with, and is not given another.
Result<Done> fitted_alike(const MarkOptions& mark, const std::string& note, const std::filesystem::path& decoder) {
  const auto number = [](double value) { return nlohmann::json(value).dump(); };
  const bool other_period = mark.period && note.find(", period " + number(*mark.period) + ",") == std::string::npos;
  const std::string tone = ", tone " + number(mark.tone.value_or(0)) + ",";
  const bool toned = note.find(", tone ") != std::string::npos;
  const bool other_tone = mark.tone && (*mark.tone > 0 ? (note + ",").find(tone) == std::string::npos : toned);
  if (!other_period && !other_tone) return Done{};
  return Error{ErrorKind::invalid, decoder.string(), other_period ? "--period" : "--tone",
               "names another decoder than this run began with",
               "give the first decoder, or leave the option out, or choose another --out"};
}

/// Holds the run's folder, as soon as something is written into it.
Result<Done> hold(TrainOptions& options) {
  if (options.folder) return Done{};
  Result<std::shared_ptr<const void>> held = hold_folder(options.out);
  if (!held) return held.error();
  options.folder = std::move(*held);
  return Done{};
}

/// Fits a decoder for the scene, of the key's length, into the run's folder; a run that is resumed has one.
Result<Done> make_decoder(TrainOptions& options) {
  if (options.mark.key.empty()) return Done{};  // load_mark says so
  const Result<OwnerKey> key = key_of(options.mark);
  if (!key) return key.error();
  FitOptions fit;
  fit.model = options.model;  // of a codec: as its file says it
  fit.data = options.data;
  fit.out = options.out / "decoder.safetensors";
  options.mark.decoder = fit.out;
  if (Result<Done> held = hold(options); !held) return held;  // or what is there may be of a run that is not done
  if (options.force && !options.resume) {
    if (Result<Done> moved = move_decoder_aside(fit.out); !moved) return moved;
  }
  if (std::filesystem::exists(fit.out)) {
    const Result<SafetensorsFile> file = read_safetensors(fit.out);
    if (!file) return file.error();
    const Result<std::string> model = file_sha256(options.model);
    if (!model) return model.error();
    const auto note = file->metadata.find("note");
    const bool of_this = note != file->metadata.end() && note->second.find(*model) != std::string::npos;
    if (options.resume && of_this) {
      Result<Done> alike = fitted_alike(options.mark, note->second, fit.out);
      if (alike || !options.force) return alike;
    }
    if (!options.force) {
      return Error{ErrorKind::invalid, fit.out.string(), "--decoder",
                   of_this ? "is missing, and a decoder of an earlier run is in this folder"
                           : "is missing, and a decoder of another model is in this folder",
                   "to keep it, choose another --out or name it with --decoder; to continue with a "
                   "decoder of this model, give --resume; to move it aside, give --force"};
    }
    if (Result<Done> moved = move_decoder_aside(fit.out); !moved) return moved;
  }
  if (std::filesystem::exists(options.out / "checkpoint.safetensors")) {
    return Error{ErrorKind::invalid,
                 (options.out / "checkpoint.safetensors").string(),
                 {},
                 "an unfinished run with another decoder is in this folder",
                 "continue it with its --decoder and --resume, or remove the file to start over"};
  }
  fit.fit.bits = static_cast<int>(key->bits);
  if (options.seed) fit.fit.seed = *options.seed;
  if (options.mark.period) fit.fit.period = *options.mark.period;
  if (options.mark.tone) fit.fit.tone = *options.mark.tone;
  fit.downscale = options.downscale;
  fit.threads = options.threads;
  const Result<FittedFile> made = fit_to_file(fit);
  if (!made) return made.error();
  std::fprintf(stderr, "compmark: decoder %s, fitted in %.0f s\n", fit.out.string().c_str(), made->seconds);
  return Done{};
}

/// What a codec writes of the unmarked model; an Error if it cannot.
Result<CodecModel> coded_host(const TrainOptions& options) {
  const Result<AnyModel> model = load_model(options.model, options.threads);
  if (!model) return model.error();
  Result<CodecModel> coded = model->coded({});
  if (coded) return coded;
  return in_file(coded.error(), options.model);
}

}  // namespace

Result<Done> can_mark_finished(const TrainOptions& options) {
  const bool coded = is_coded_recipe(options.recipe);
  const std::string marked = marking_recipe(options.recipe);
  // In the loss of the photographs their exposures would have to train on.
  const bool exposed_loss = marked != options.recipe && options.mark.fidelity && *options.mark.fidelity == 0;
  if (exposed_loss || !is_markable_recipe(options.recipe)) return no_message_in(options.recipe);
  if (options.mark.hold_steps && recipe_codec(options.recipe) != std::string_view("context_gs")) {
    return Error{ErrorKind::unsupported,
                 {},
                 "--hold-steps",
                 "works with context_gs models only: in them a mark would change the quantizer steps",
                 "leave it out"};
  }
  if (!coded || !options.mark.fidelity || *options.mark.fidelity > 0) return Done{};
  return Error{ErrorKind::unsupported,
               {},
               "--fidelity",
               "is 0, but a model for a codec can only be marked post hoc, with its unmarked renders"
               " as the target",
               "leave the option out, or hide the message while training: compmark train --codec "
               "--key --decoder"};
}

namespace {

int embed_under(TrainOptions options, const std::string& distortion) {
  if (Result<Done> free = check_unfinished(options.out, options.resume || options.force); !free)
    return fail(free.error());
  const Result<std::string> recipe = [&]() -> Result<std::string> {
    const Result<SafetensorsFile> file = read_safetensors(options.model);
    if (!file) return file.error();
    return model_recipe(*file);
  }();
  if (!recipe) return fail(recipe.error());
  options.recipe = *recipe;
  options.codec = recipe_codec(*recipe);
  const bool coded = is_coded_recipe(*recipe);
  const bool fitted = options.mark.decoder.empty() || fitted_decoder(options.mark.decoder);
  if (options.iterations == 0) options.iterations = coded ? (fitted ? 4000 : 8000) : 2000;
  if (coded) options.profile = "hac";  // as their training
  if (Result<Done> can = can_mark_finished(options); !can) return fail(can.error());
  if (Result<Done> fits = check_to_fit(options.mark); !fits) return fail(fits.error());
  options.recipe = marking_recipe(*recipe);
  if (options.recipe != *recipe)
    options.notes.push_back(
        "exposures of the photographs stay in the unmarked model: the mark is in renders, and"
        " renders have no exposure");
  if (!coded && distortion != "round") {
    return fail({ErrorKind::unsupported, options.model.string(), "--distortion", "works with models for a codec only",
                 "leave the option out, or mark a model of compmark train --codec or fit-codec"});
  }
  std::optional<CodecModel> unmarked;
  if (coded) {
    Result<CodecModel> found = coded_host(options);
    if (!found) return fail(found.error());
    unmarked = std::move(*found);
  }
  if (options.mark.decoder.empty()) {
    if (Result<Done> made = make_decoder(options); !made) return fail(made.error());
  }
  TrainSettings settings = *profile_settings(options.profile);
  settings.iterations = options.iterations;
  if (options.seed) settings.seed = *options.seed;
  const bool own_twin = options.mark.twin.empty();
  if (own_twin) options.mark.twin = options.model;
  settings.mark = posthoc_mark();
  // what each was measured with (docs/notebook/watermark_experiments.md)
  settings.mark.residual.learning_rate = fitted ? 0.006 : 0.001;
  Result<MarkInput> mark = load_mark(options.mark, settings);
  if (!mark) return fail(mark.error());
  // Rounding changes the file far more than a mark does, and a mark that moves values by whole steps is noise in other
  // views (docs/notebook/watermark_experiments.md).
  if (coded && !options.mark.fidelity) settings.mark.posthoc.fidelity = fitted ? 2000 : 600;
  // A mark in ancestors must not make the quantizer steps of their descendants finer (codec/model/held_steps.hpp).
  if (recipe_codec(*recipe) == std::string_view("context_gs") && distortion != "none" && !options.mark.hold_steps)
    settings.mark.posthoc.hold_steps_every = 50;
  const Result<std::string> digest = file_sha256(options.model);
  if (!digest) return fail(digest.error());
  settings.mark.identity += digest->substr(0, 16);              // a run is resumed from the same model alone
  if (coded) settings.mark.identity += "networks of the file";  // … and as earlier versions did not train it
  if (coded && own_twin) {
    if (Result<Done> held = hold(options); !held) return fail(held.error());
    const std::filesystem::path checkpoint = options.out / "checkpoint.safetensors";
    if (!options.resume && std::filesystem::exists(checkpoint)) return fail(unfinished_run(checkpoint));
    mark->coded_twin = options.out / "unmarked.cmk";
    ThreadExecutor executor(options.threads);
    tell_threads(executor, options.threads);
    // The check of a finished run below comes before anything of it is replaced.
    if (!options.resume || options.force || !holds_finished_run(options.out)) {
      const Result<CodecEncoded> written = write_coded(mark->coded_twin, *unmarked, executor);
      if (!written) return fail(written.error());
    }
  }
  settings = embed_settings(settings, distortion);
  return coded ? train_coded(options, settings, &*mark) : train_marked(options, settings, *mark);
}

}  // namespace

int embed_model(TrainOptions options) { return embed_under(std::move(options), "round"); }

Command add_embed(Options& app) {
  auto options = std::make_shared<TrainOptions>();
  auto distortion = std::make_shared<std::string>("round");
  options->iterations = 0;
  app.reads("--model", options->model, InputKind::trained_model,
            "the unmarked model (model.safetensors of a training or of fit-codec)")
      ->required();
  app.reads("--data", options->data, InputKind::dataset, "the dataset it was trained on")->required();
  app.writes_into("--out", options->out,
                  "folder for the marked model, results.json and report.html; for a codec also "
                  "model.cmk and unmarked.cmk")
      ->required();
  app.number("--iterations", options->iterations, run_length,
             "iterations of the run (default: 2000; 4000 for a codec, 8000 there with a decoder "
             "that is not fitted to the scene)");
  add_finished_model_options(app, *options);
  add_mark_options(app, options->mark, true);
  app.word("--distortion", *distortion,
           "how training replaces the quantizer of a codec before it reads the message: round "
           "(as the file does), noise (as wide as a step) or none")
      ->capture_default_str()
      ->check(CLI::IsMember({"round", "noise", "none"}));
  app.also([options](FileUse& use) {
    add_run_files(use, *options, options->out);
    add_record_written(use, options->mark.key);
    if (options->mark.decoder.empty()) use.write_in(options->out, {"decoder.safetensors", "decoder.json"}, "--out");
    if (options->mark.twin.empty()) use.write(options->out / "unmarked.cmk", "--out");
  });
  return [options, distortion]() -> int { return embed_under(*options, *distortion); };
}

}  // namespace tool
