// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark evaluate: measures one or several models against a dataset: PSNR, SSIM and, given weights, LPIPS; the cost
// of a mark and the bits of a message; bytes by section and milliseconds.
#include <compmark/io/json_file.hpp>
#include <compmark/mark/report.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "common.hpp"
#include "comparison.hpp"
#include "mark_record.hpp"
#include "reading.hpp"

namespace tool {
namespace {

using namespace compmark;

struct EvaluateOptions {
  ComparisonInput input;
  std::filesystem::path json, csv, html;
};

int run(const EvaluateOptions& options) {
  const ComparisonInput& input = options.input;
  ThreadExecutor executor(input.threads);
  tell_threads(executor, input.threads);
  const Result<Comparison> comparison = compare_models(input, executor);
  if (!comparison) return fail(comparison.error());
  if (comparison->models.size() == 1) {
    for (const ViewResult& view : comparison->models[0].evaluation.views) {
      std::printf("%-24s PSNR %6.2f dB  SSIM %.4f", view.name.c_str(), view.psnr, view.ssim);
      if (view.lpips_alex) std::printf("  LPIPS-alex %.4f", *view.lpips_alex);
      if (view.lpips_squeeze) std::printf("  LPIPS-squeeze %.4f", *view.lpips_squeeze);
      std::printf("  %.1f ms\n", view.milliseconds);
    }
  }
  std::printf("mean over %zu views\n%s", comparison->models[0].evaluation.views.size(),
              grid_text(comparison_grid(*comparison)).c_str());
  for (const ComparedModel& model : comparison->models) {
    if (model.sections.empty()) continue;
    std::printf("%s\n", model.name.c_str());
    for (const auto& [name, bytes] : model.sections) {
      std::printf("  %-30s %10llu  %5.1f %%\n", name.c_str(), static_cast<unsigned long long>(bytes),
                  100 * static_cast<double>(bytes) / static_cast<double>(model.bytes));
    }
  }
  if (!options.json.empty()) {
    if (Result<Done> written = write_file(options.json, comparison_json(*comparison).dump(2) + "\n"); !written)
      return fail(written.error());
  }
  if (!options.csv.empty()) {
    if (Result<Done> written = write_file(options.csv, comparison_csv(*comparison)); !written)
      return fail(written.error());
  }
  if (!options.html.empty()) {
    ReportInput report = comparison_report(*comparison, base_name(input.data));
    for (const ComparedModel& compared : comparison->models) {
      if (compared.verification)
        report.words.push_back(
            {"Read from the renders of " + compared.name + (compared.is_unmarked ? " (unmarked)" : ""),
             report_text(*compared.verification)});
    }
    report.tables.push_back(machine_table(static_cast<int>(executor.concurrency())));
    if (Result<Done> written = write_report(options.html, report); !written) return fail(written.error());
  }
  return success;
}

}  // namespace

Command add_evaluate(Options& app) {
  auto options = std::make_shared<EvaluateOptions>();
  ComparisonInput& input = options->input;
  app.reads("--model", input.models, InputKind::model,
            "model.safetensors of a run or a compressed .cmk; give several to compare them")
      ->required();
  app.reads("--data", input.data, InputKind::dataset,
            "dataset folder (Blender, instant-ngp, nerfstudio, COLMAP or LLFF)")
      ->required();
  app.reads("--unmarked", input.unmarked, InputKind::model,
            "unmarked counterparts, to measure the cost of the mark: one for all models, or one "
            "for each --model in their order");
  app.reads("--key", input.key, InputKind::key, "owner's key; its message is read from the renders (with --decoder)");
  app.reads("--decoder", input.decoder, InputKind::decoder, "message decoder that reads it");
  app.word("--split", input.split, "test or train")->capture_default_str()->check(CLI::IsMember({"test", "train"}));
  app.writes("--json", options->json, OutputKind::words, "write the figures to this file");
  app.writes("--csv", options->csv, OutputKind::words,
             "write a CSV line for each view of each model, and one for each model, to this file");
  app.writes("--html", options->html, OutputKind::words,
             "write a page with all figures, bytes by section, bits and pictures");
  app.number("--downscale", input.downscale, downscale_range, "divide the images' size by this")->capture_default_str();
  app.number("--threads", input.threads, thread_range, "0: all")->capture_default_str();
  app.reads("--lpips-alex", input.lpips.alex, InputKind::weights, "LPIPS AlexNet weights (safetensors)");
  app.reads("--lpips-squeeze", input.lpips.squeeze, InputKind::weights, "LPIPS SqueezeNet weights (safetensors)");
  app.flag("--lpips-family-range", input.lpips.family_range,
           "give LPIPS images in [0, 1], as the 3DGS family does, not in [-1, 1]");
  app.also([options](FileUse& use) { add_record_read(use, options->input.key); });
  return [options]() -> int {
    options->input.shown = options->html.empty() ? 0 : 3;
    return run(*options);
  };
}

}  // namespace tool
