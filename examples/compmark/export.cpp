// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark export: compmark/app/export.hpp, in words and numbers.
#include <compmark/app/export.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/splat/write_splat.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "commands.hpp"
#include "common.hpp"
#include "model_files.hpp"

namespace tool {
namespace {

using namespace compmark;

struct ExportOptions {
  std::filesystem::path model;
  std::filesystem::path out;
  std::string kind = "splat";
  int spz_version = 0;
  ExportSettings settings;
  std::size_t threads = 0;
  std::filesystem::path json;
};

/// Says what is done as it is done.
class ExportLines final : public ExportObserver {
 public:
  explicit ExportLines(const ExportOptions& options) : options_(options) {}
  void on_begin(const ExportReport& report) override {
    for (const std::string& warning : report.warnings) std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
  }
  void on_fitted(const ExportReport& report) override {
    const ShFitReport& fit = *report.fit;
    std::printf("fitted %zu of %zu slots over %zu cameras (%zu faint, %zu unseen), colour residual %.4f\n", fit.kept,
                fit.slots, report.cameras, fit.faint, fit.unseen, fit.color_rms);
  }
  void on_refined(const ExportReport& report) override {
    std::printf("refined in %lld iterations: mean square distance to the model's renders %.2e -> %.2e\n",
                static_cast<long long>(options_.settings.refine), report.refined->first_mse, report.refined->last_mse);
  }
  void on_written(const ExportReport& report) override {
    if (options_.settings.kind == ExportKind::anchors) {
      std::printf("%s: %zu anchors in the layout of the Scaffold family (the networks stay in %s)\n",
                  options_.out.string().c_str(), report.anchors, options_.model.string().c_str());
    } else if (!report.written) {
      std::printf("%s: a page of %zu Gaussians, SH degree %d; open it in a browser\n", options_.out.string().c_str(),
                  report.gaussians, report.degree);
    } else {
      const SplatWritten& written = *report.written;
      std::printf("%s: %zu Gaussians, SH degree %d, as %s%s%s, %llu bytes\n", options_.out.string().c_str(),
                  report.gaussians, report.degree, std::string(splat_format_name(written.format)).c_str(),
                  written.format == SplatFormat::spz ? " of version " : "",
                  written.format == SplatFormat::spz ? std::to_string(written.version).c_str() : "",
                  static_cast<unsigned long long>(written.bytes));
      for (const std::string& note : written.notes) std::fprintf(stderr, "compmark: warning: %s\n", note.c_str());
      if (written.format == SplatFormat::spz && written.version == 4 && options_.spz_version == 0)
        std::printf("note: a viewer that reads SPZ up to version 3 alone, as Spark does, needs --spz-version 3\n");
    }
  }

 private:
  const ExportOptions& options_;
};

void print_comparison(const ExportReport& report, bool photographs) {
  const BakeReport& compared = *report.compared;
  std::printf("against the model's own renders: PSNR %.2f dB mean, %.2f dB worst (%s), over %zu views%s\n",
              compared.mean_bake_to_model, compared.worst_bake_to_model,
              report.compared_views[compared.worst_view].c_str(), report.compared_views.size(),
              report.held_out ? " that nothing was fitted over" : "");
  if (report.from_file) {
    std::printf("the same of the file, read back: PSNR %.2f dB mean, %.2f dB worst: the price of the format\n",
                report.from_file->mean_bake_to_model, report.from_file->worst_bake_to_model);
  }
  if (!photographs) return;
  std::printf("against the photographs: model %.2f dB, export %.2f dB, loss of the bake %.2f dB\n",
              compared.mean_model_to_target, compared.mean_bake_to_target, compared.loss());
}

std::string word_of(SplatFormat format) {
  for (const SplatEnding& known : splat_endings) {
    if (known.format == format) return std::string(known.word);
  }
  return {};
}

nlohmann::ordered_json export_json(const ExportOptions& options, const std::string& recipe,
                                   const ExportReport& report) {
  nlohmann::ordered_json json{{"schema", "compmark.export.1"},
                              {"format", options.kind},
                              {"recipe", recipe},
                              {"warnings", report.warnings},
                              {"anchors", report.anchors}};
  if (options.settings.kind == ExportKind::anchors) return json;
  json["gaussians"] = report.gaussians;
  json["sh_degree"] = report.degree;
  if (report.written) {
    const SplatWritten& written = *report.written;
    json["file"] = {{"format", word_of(written.format)}, {"bytes", written.bytes}, {"notes", written.notes}};
    if (written.version != 0) json["file"]["version"] = written.version;
    if (written.fractional_bits) json["file"]["fractional_bits"] = *written.fractional_bits;
  }
  if (!report.compared) return json;
  const BakeReport& compared = *report.compared;
  json["views"] = report.compared_views.size();
  json["psnr_to_model"] = {{"mean", compared.mean_bake_to_model}, {"worst", compared.worst_bake_to_model}};
  json["held_out"] = report.held_out;
  if (report.from_file) {
    json["psnr_of_file_to_model"] = {{"mean", report.from_file->mean_bake_to_model},
                                     {"worst", report.from_file->worst_bake_to_model}};
  }
  if (!options.settings.data.empty()) {
    json["psnr_to_photographs"] = {{"model", compared.mean_model_to_target}, {"export", compared.mean_bake_to_target}};
  }
  return json;
}

/// Whether --format or the ending of --out asks for SPZ. A name of no format is export_model's to refuse.
bool writes_spz(const ExportOptions& options) {
  if (options.kind != "splat") return options.kind == word_of(SplatFormat::spz);
  const Result<SplatFormat> named = splat_format_of_name(options.out);
  return (named && *named == SplatFormat::spz) || (!named && options.out.extension() != ".html");
}

int run(const ExportOptions& options) {
  Result<AnyModel> model = load_model(options.model, options.threads);
  if (!model) return fail(model.error());
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  ExportLines lines(options);
  const Result<ExportReport> report = export_model(*model, options.out, options.settings, executor, lines);
  if (!report) return fail(report.error());
  if (report->compared) print_comparison(*report, !options.settings.data.empty());
  if (options.json.empty()) return success;
  const Result<Done> written =
      write_file(options.json, export_json(options, model->info().recipe, *report).dump(2) + "\n");
  return written ? static_cast<int>(success) : fail(written.error());
}

}  // namespace

Command add_export(Options& app) {
  auto options = std::make_shared<ExportOptions>();
  app.reads("--model", options->model, InputKind::model,
            "model.safetensors of a run, a compressed .cmk, or a splat file")
      ->required();
  app.writes("--out", options->out, OutputKind::splats,
             "file to write: .ply, .compressed.ply, .spz, .splat, .sog or .glb says the format; .html is a page that "
             "shows the splats in a browser")
      ->required();
  std::vector<std::string> formats{"splat", "anchors", "page"};
  for (const SplatEnding& known : splat_endings) formats.emplace_back(known.word);
  app.word("--format", options->kind,
           "splat (Gaussians, in the format of the ending of --out), one of the formats by name, page, or anchors (a "
           "PLY in the layout of Scaffold)")
      ->capture_default_str()
      ->check(CLI::IsMember(formats));
  app.number("--spz-bits", options->settings.file.fractional_bits, WholeRange{0, 23},
             "SPZ: bits of a position behind the point, of 24; default: 12, or as many as fit");
  app.number("--spz-version", options->spz_version, WholeRange{3, 4},
             "SPZ: 4 (Zstandard) or 3 (gzip); default: 4 where this program has libzstd");
  app.word("--view", options->settings.view,
           "bake exactly for this stored view instead of fitting over all training views");
  app.number("--sh-degree", options->settings.degree, WholeRange{0, 3},
             "degree of the fitted colour, and at most of the splats of another program")
      ->capture_default_str();
  app.number("--refine", options->settings.refine, WholeRange{0, 1000000},
             "iterations that refine the fitted splats to match renders of the model; 0: none")
      ->capture_default_str();
  app.reads("--data", options->settings.data, InputKind::dataset,
            "dataset; reports the loss against its photographs too");
  app.number("--downscale", options->settings.downscale, downscale_range,
             "divide the size of the photographs by this, as in the training")
      ->capture_default_str();
  app.number("--compare", options->settings.compare, any_count, "number of views to measure the loss on; 0: none")
      ->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all")->capture_default_str();
  app.writes("--json", options->json, OutputKind::words, "write counts, figures and warnings to this file");
  return [options, &app]() -> int {
    for (const char* name : {"--spz-bits", "--spz-version"}) {
      if (app.count(name) != 0 && !writes_spz(*options)) {
        return fail(Error{ErrorKind::invalid, options->out.string(), name,
                          "is for SPZ files, and --out names another format", "leave it out, or end --out in .spz"});
      }
    }
    if (app.count("--downscale") != 0 && options->settings.data.empty()) {
      return fail(Error{ErrorKind::invalid,
                        {},
                        "--downscale",
                        "is of photographs, and no --data is given",
                        "leave it out, or give --data"});
    }
    if (options->kind == "anchors") options->settings.kind = ExportKind::anchors;
    const bool page = options->kind == "splat" && options->out.extension() == ".html";
    if (page || options->kind == "page") options->settings.kind = ExportKind::page;
    for (const SplatEnding& known : splat_endings) {
      if (options->kind == known.word) options->settings.file.format = known.format;
    }
    options->settings.file.spz_version = options->spz_version;
    return run(*options);
  };
}

}  // namespace tool
