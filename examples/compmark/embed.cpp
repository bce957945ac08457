// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark embed: hides a message in a finished model (compmark/app/run/embed.hpp).
#include <compmark/app/run/embed.hpp>
#include <memory>
#include <string>

#include "commands.hpp"
#include "run_folder.hpp"
#include "run_options.hpp"

namespace tool {
namespace {

using namespace compmark;

struct EmbedOptions {
  EmbedSettings settings;
  RunOptions run;
  std::string distortion = "round";
};

int embed(EmbedOptions options) {
  if (options.distortion == "noise") options.settings.distortion = EmbedDistortion::noise;
  if (options.distortion == "none") options.settings.distortion = EmbedDistortion::none;
  return show_run(options.settings, options.run, embed_message);
}

}  // namespace

Command add_embed(Options& app) {
  auto options = std::make_shared<EmbedOptions>();
  app.reads("--model", options->settings.model, InputKind::trained_model,
            "the unmarked model (model.safetensors of a training or of fit-codec)")
      ->required();
  app.reads("--data", options->settings.data, InputKind::dataset, "the dataset it was trained on")->required();
  app.writes_into("--out", options->settings.out,
                  "folder for the marked model, results.json and report.html; for a codec also "
                  "model.cmk and unmarked.cmk")
      ->required();
  app.number("--iterations", options->settings.iterations, run_length,
             "iterations of the run (default: 2000; 4000 for a codec, 8000 there with a decoder "
             "that is not fitted to the scene)");
  add_finished_model_options(app, options->settings, options->run);
  add_mark_options(app, options->settings.mark, true);
  app.word("--distortion", options->distortion,
           "how training replaces the quantizer of a codec before it reads the message: round "
           "(as the file does), noise (as wide as a step) or none")
      ->capture_default_str()
      ->check(CLI::IsMember({"round", "noise", "none"}));
  app.also([options](FileUse& use) {
    const EmbedSettings& settings = options->settings;
    add_run_files(use, {settings.out, options->run.json_log, settings.model, settings.mark.wanted()}, settings.out);
    add_record_written(use, settings.mark.key);
    if (settings.mark.decoder.empty()) use.write_in(settings.out, {"decoder.safetensors", "decoder.json"}, "--out");
    if (settings.mark.twin.empty()) use.write(settings.out / "unmarked.cmk", "--out");
  });
  return [options]() -> int { return embed(*options); };
}

}  // namespace tool
