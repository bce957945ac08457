// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark evaluate: measures one or several models against a dataset: PSNR, SSIM and, given weights, LPIPS; the cost
// of a mark and the bits of a message; bytes by section and milliseconds.
#include <compmark/app/run/mark_record.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/watermark/attack/picture_attacks.hpp>
#include <compmark/watermark/proof/report.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "common.hpp"
#include "comparison.hpp"
#include "decoder_choice.hpp"
#include "evaluation.hpp"
#include "reading.hpp"
#include "run_folder.hpp"
#include "run_options.hpp"

namespace tool {
namespace {

using namespace compmark;

struct EvaluateOptions {
  CompareSettings compared;
  std::string split = "test";
  std::size_t threads = 0;
  EvaluationFiles files;
};

/// A warning if the marks of this key are read by another decoder.
void warn_other_decoder(const CompareSettings& compared) {
  if (compared.key.empty() || compared.decoder.empty()) return;
  const Result<OwnerKey> key = load_key(compared.key);
  if (!key) return;  // whose error is told where it is needed
  if (const Result<Done> recorded = check_recorded(compared.key, *key, compared.decoder, {}, print_warning); !recorded)
    std::fprintf(stderr, "compmark: warning: %s: %s\n", compared.decoder.string().c_str(),
                 recorded.error().problem.c_str());
}

int run(const EvaluateOptions& options) {
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  warn_other_decoder(options.compared);
  ShownModels shown(options.files.html.empty() ? 0 : 3);
  const Result<Comparison> comparison = compare_models(options.compared, executor, shown);
  if (!comparison) return fail(comparison.error());
  std::fputs(evaluation_text(*comparison).c_str(), stdout);
  const Result<Done> written =
      write_evaluation(*comparison, shown.pictures, options.compared.data, executor.concurrency(), options.files);
  return written ? static_cast<int>(success) : fail(written.error());
}

}  // namespace

Command add_evaluate(Options& app) {
  auto options = std::make_shared<EvaluateOptions>();
  CompareSettings& input = options->compared;
  app.reads("--model", input.models, InputKind::model,
            "model.safetensors of a run, a compressed .cmk or a splat file; give several to compare them")
      ->required();
  app.reads("--data", input.data, InputKind::dataset,
            "dataset folder (Blender, instant-ngp, nerfstudio, COLMAP or LLFF)")
      ->required();
  app.reads("--unmarked", input.unmarked, InputKind::model,
            "unmarked counterparts, to measure the cost of the mark: one for all models, or one "
            "for each --model in their order");
  app.reads("--key", input.key, InputKind::key, "owner's key; its message is read from the renders");
  add_recipient(app, input.recipient);
  app.reads("--decoder", input.decoder, InputKind::decoder, reading_decoder_text);
  app.reads(
      "--interference", input.interference, InputKind::interference,
      "what the unmarked scene says to the decoder by itself (a file of compmark interference); it is subtracted");
  app.words("--attack", input.attacks,
            "edit every render so before it is read once more, in 8 bits: " + PictureAttacks::names() +
                ", each with its strength, as jpeg:50; may be given several times");
  app.word("--split", options->split, "views that are measured: test or train")
      ->capture_default_str()
      ->check(CLI::IsMember({"test", "train"}));
  app.writes("--json", options->files.json, OutputKind::words, "write the figures to this file");
  app.writes("--csv", options->files.csv, OutputKind::words,
             "write a CSV line for each view of each model, and one for each model, to this file");
  app.writes("--html", options->files.html, OutputKind::words,
             "write a page with all figures, bytes by section, bits and pictures");
  app.number("--downscale", input.downscale, downscale_range, "divide the images' size by this")->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all")->capture_default_str();
  app.reads("--lpips-alex", input.evaluate.lpips.alex, InputKind::weights, "LPIPS AlexNet weights (safetensors)");
  app.reads("--lpips-squeeze", input.evaluate.lpips.squeeze, InputKind::weights,
            "LPIPS SqueezeNet weights (safetensors)");
  app.flag("--lpips-family-range", input.evaluate.lpips.family_range,
           "give LPIPS images in [0, 1], as the 3DGS family does, not in [-1, 1]");
  app.also([options](FileUse& use) { add_record_read(use, options->compared.key); });
  return [options]() -> int {
    options->compared.split = options->split == "test" ? Split::test : Split::train;
    CompareSettings& compared = options->compared;
    if (!compared.key.empty()) {
      if (const Result<Done> chosen = choose_decoder(compared.decoder, compared.models.front()); !chosen)
        return fail(chosen.error());
    }
    options->compared.evaluate.clock = evaluation_settings().clock;
    return run(*options);
  };
}

}  // namespace tool
