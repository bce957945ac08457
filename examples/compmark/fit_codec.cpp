// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark fit-codec: compresses a model that was not trained for a codec (compmark/app/run/fit_codec.hpp).
#include <compmark/app/run/fit_codec.hpp>
#include <memory>

#include "commands.hpp"
#include "run_folder.hpp"
#include "run_options.hpp"

namespace tool {
namespace {

using namespace compmark;

struct FitCodecOptions {
  FitCodecSettings settings;
  RunOptions run;
};

}  // namespace

Command add_fit_codec(Options& app) {
  auto options = std::make_shared<FitCodecOptions>();
  app.reads("--model", options->settings.model, InputKind::trained_model,
            "a finished model (model.safetensors of a training without --codec)")
      ->required();
  app.reads("--data", options->settings.data, InputKind::dataset, "the dataset it was trained on")->required();
  app.writes_into("--out", options->settings.out,
                  "folder for model.cmk, model.safetensors, results.json and report.html")
      ->required();
  app.word("--codec", options->settings.codec, "hac or context_gs")
      ->capture_default_str()
      ->check(CLI::IsMember({"hac", "context_gs"}));
  app.number("--lambda", options->settings.rate_lambda, share_range, "loss of one bit more a scalar")
      ->capture_default_str();
  app.flag("--touch-up", options->settings.touch_up,
           "also train the model's attributes and networks, at small learning rates; the file is"
           " smaller, but the model changes");
  app.number("--iterations", options->settings.iterations, run_length, "iterations of the run")->capture_default_str();
  app.reads("--key", options->settings.mark.key, InputKind::key,
            "owner's key of a marked model; its message is read from the fitted model and from "
            "its file (with --decoder)");
  app.reads("--decoder", options->settings.mark.decoder, InputKind::decoder, "message decoder that reads it");
  app.reads("--unmarked", options->settings.mark.twin, InputKind::model,
            "the unmarked counterpart, a model or its .cmk, to measure the cost of the mark and "
            "of the file");
  add_finished_model_options(app, options->settings, options->run);
  app.also([options](FileUse& use) {
    const FitCodecSettings& settings = options->settings;
    add_run_files(use, {settings.out, options->run.json_log, settings.model, settings.mark.wanted()}, settings.out);
    add_record_read(use, settings.mark.key, settings.model);
  });
  return [options]() -> int { return show_run(options->settings, options->run, fit_codec); };
}

}  // namespace tool
