// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "train_page.hpp"

#include <algorithm>
#include <array>
#include <compmark/app/compress.hpp>
#include <compmark/app/files.hpp>
#include <compmark/app/run/run_results.hpp>
#include <compmark/watermark/proof/report.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "common.hpp"
#include "mark_plot.hpp"
#include "progress.hpp"

namespace tool {

using namespace compmark;

namespace {

std::string decimals(double value, int digits) { return format_text("%.*f", digits, value); }

std::string kibibytes(std::uint64_t bytes) { return format_text("%.1f KiB", static_cast<double>(bytes) / 1024); }

std::string background_name(const std::array<float, 3>& color) {
  if (color == std::array<float, 3>{0, 0, 0}) return "black";
  if (color == std::array<float, 3>{1, 1, 1}) return "white";
  return decimals(255 * double{color[0]}, 0) + " " + decimals(255 * double{color[1]}, 0) + " " +
         decimals(255 * double{color[2]}, 0);
}

/// A path as the address of a link: what means something there is written as %XX.
std::string address(const std::filesystem::path& path) {
  std::string text;
  for (const char c : path.generic_string()) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       std::string_view("-_.~/").find(c) != std::string_view::npos;
    text += plain ? std::string(1, c) : format_text("%%%02X", static_cast<unsigned>(static_cast<unsigned char>(c)));
  }
  return text;
}

/// The run whose finished model this one began with.
struct SourceRun {
  RunResults results;
  std::vector<ProgressLine> lines;
  std::string page;  ///< its address, from the folder of this run
};
/// Nothing where the model's folder is not that of its run: a log of something else would be worse than none.
std::optional<SourceRun> source_run(const RunFindings& f) {
  if (f.source.empty()) return std::nullopt;
  const std::filesystem::path folder = f.source.parent_path();
  Result<RunResults> results = read_results(folder / "results.json");
  const Result<std::string> digest = file_sha256(f.source);
  if (!results || !digest || results->model_sha256 != *digest) return std::nullopt;
  SourceRun source;
  source.results = std::move(*results);
  Result<std::vector<ProgressLine>> log = read_progress_log(folder / "log.jsonl");
  if (log && !log->empty() && log->back().iteration == source.results.iterations) source.lines = std::move(*log);
  std::error_code none;
  const std::filesystem::path page = folder / "report.html";
  if (std::filesystem::exists(page, none)) source.page = address(std::filesystem::proximate(page, f.out, none));
  return source;
}

bool marks(const RunFindings& f) { return f.mark != nullptr && !f.mark->read_only; }

/// The training of the source model, if this run began with one, and this run.
std::vector<ReportCurve> run_curves(const RunFindings& f, const std::vector<ProgressLine>& curve,
                                    std::optional<SourceRun>& source) {
  std::vector<ReportCurve> curves;
  const bool from_model = !f.source.empty();
  if (source)
    curves.push_back({marks(f) ? "Training of the unmarked model" : "Training of the model that was compressed",
                      std::move(source->lines), false, source->page});
  const char* const heading = !from_model ? (marks(f) ? "Training, with the message" : "Training")
                              : marks(f)  ? "Hiding the message"
                                          : "Fitting the codec";
  curves.push_back({heading, curve, from_model && marks(f) && f.settings.mark.posthoc.fidelity > 0});
  return curves;
}

ReportTable mark_table(const std::string& heading, const WatermarkMetrics& m, const RunMark& mark) {
  ReportTable table{heading,
                    {{"key id", mark.sources.key_id},
                     {"decoder sha256", mark.sources.decoder_sha256},
                     {"bits", std::to_string(mark.bits.size())},
                     {"bit accuracy, mean and worst view", decimals(m.mean, 4) + ", " + decimals(m.min, 4)},
                     {"p-value of all views together", detail::short_number(m.p_value)},
                     {"p-value of the worst view", detail::short_number(m.largest_view_p_value)}}};
  if (m.psnr_cost_vs_unmarked)
    table.rows.emplace_back("PSNR lost to the unmarked counterpart", decimals(*m.psnr_cost_vs_unmarked, 2) + " dB");
  if (m.psnr_marked_vs_unmarked)
    table.rows.emplace_back("PSNR of marked against unmarked", decimals(*m.psnr_marked_vs_unmarked, 2) + " dB");
  return table;
}

ReportTable compressed_table(const CompressedRun& run) {
  const CompressedMetrics& m = run.metrics;
  return {"Compressed",
          {{"codec", m.codec},
           {"file", run.file.filename().string()},
           {"size", kibibytes(m.bytes)},
           {"PSNR", decimals(m.test.psnr, 2) + " dB"},
           {"SSIM", decimals(m.test.ssim, 4)},
           {"encoded in", decimals(m.encode_seconds, 2) + " s"},
           {"decoded in", decimals(m.decode_seconds, 2) + " s"}}};
}

/// The bytes of a file by purpose, and those of the unmarked file if there is one.
ReportGrid section_grid(const CompressedRun& coded, const std::optional<CodedFile>& unmarked) {
  ReportGrid grid{"Bytes by section", {"section", "model.cmk", "of it"}, {}};
  if (unmarked) grid.columns.emplace_back("unmarked.cmk");
  std::uint64_t whole = 0;
  for (const auto& [name, bytes] : unmarked ? unmarked->sections : coded.metrics.sections) whole += bytes;
  const double all = static_cast<double>(std::max<std::uint64_t>(1, coded.metrics.bytes));
  for (const auto& section : coded.metrics.sections) {
    std::vector<std::string> row{section.first, std::to_string(section.second),
                                 decimals(100 * static_cast<double>(section.second) / all, 1) + " %"};
    if (unmarked) {
      const auto same = std::find_if(unmarked->sections.begin(), unmarked->sections.end(),
                                     [&](const auto& other) { return other.first == section.first; });
      row.push_back(same == unmarked->sections.end() ? "" : std::to_string(same->second));
    }
    grid.rows.push_back(std::move(row));
  }
  grid.rows.push_back({"the whole file", std::to_string(coded.metrics.bytes), ""});
  if (unmarked) grid.rows.back().push_back(std::to_string(whole));
  return grid;
}

}  // namespace

ShownViews::ShownViews(const DatasetViews& measured) : views_(measured) {
  const std::size_t shown = std::min<std::size_t>(3, measured.size());
  views_.index.clear();
  for (std::size_t s = 0; s < shown; ++s) {
    number_.push_back(s * measured.size() / shown);
    views_.index.push_back(measured.index[number_.back()]);
  }
}

void ShownViews::keep(const SeenView& view) {
  if (std::find(number_.begin(), number_.end(), view.index) == number_.end()) return;
  pictures.push_back({view.result.name, make_report_image(view.truth), make_report_image(view.measured),
                      view.result.psnr, view.result.ssim, view.result.lpips_alex});
}

Result<Done> ShownViews::add_unmarked(const std::filesystem::path& counterpart, ThreadExecutor& executor) {
  Result<AnyModel> model = AnyModel::open(counterpart, executor);
  if (!model) return model.error();
  const Result<Evaluation> seen =
      evaluate_views(*model, views_, evaluation_settings(), executor, [&](const SeenView& view) -> Result<Done> {
        pictures[view.index].unmarked = {counterpart.filename().string(), make_report_image(view.measured),
                                         view.result.psnr, view.result.ssim};
        return Done{};
      });
  if (!seen) return seen.error();
  return Done{};
}

ReportInput run_page(const RunFindings& f, const std::vector<ProgressLine>& curve, std::vector<ReportView> pictures) {
  const TrainSettings& settings = f.settings;
  const RunResults& results = f.results;
  const Evaluation& evaluation = f.coded ? f.coded->evaluation : f.evaluation;
  const std::optional<MarkMeasurement>& proof = f.coded ? f.coded->mark : f.found;
  const std::string file = f.coded ? "model.cmk" : "model.safetensors", split = f.has_test ? "test" : "training";
  const auto mean = [](const Evaluation& of, double ViewResult::*figure) {
    return of.mean([&](const ViewResult& view) { return view.*figure; });
  };
  std::optional<SourceRun> source = source_run(f);

  ReportInput page;
  page.title = results.dataset;
  page.subtitle = "recipe " + results.recipe + ", profile " + settings.profile + ", " +
                  std::to_string(settings.iterations) + " iterations" +
                  (f.coded ? "; measured and shown from model.cmk, read back as another program would" : "");
  page.headline = {
      {decimals(mean(evaluation, &ViewResult::psnr), 2) + " dB",
       "PSNR of " + file + ", mean over " + std::to_string(evaluation.views.size()) + " " + split + " views"},
      {decimals(mean(evaluation, &ViewResult::ssim), 4), "SSIM"}};
  std::optional<CodedFile> unmarked;
  if (f.coded) {
    page.headline.emplace_back(kibibytes(f.coded->metrics.bytes), "model.cmk");
    if (f.mark != nullptr && !f.mark->coded_unmarked.empty()) {
      if (Result<CodedFile> counterpart = coded_file(f.mark->coded_unmarked); counterpart) {
        std::error_code none;
        unmarked = std::move(*counterpart);
        page.headline.emplace_back(kibibytes(std::filesystem::file_size(f.mark->coded_unmarked, none)), "unmarked.cmk");
      }
    }
  }
  if (proof) {
    const Verification& verification = proof->report.verification;
    page.headline.emplace_back(format_text("%zu of %zu", verification.evidence.matches, verification.bits),
                               "bits read from all views together");
    page.headline.emplace_back(detail::short_number(verification.evidence.p_value), "p-value");
    page.words.push_back({"Read from the renders of " + file, report_text(verification)});
  }
  page.headline.emplace_back(std::to_string(f.coded ? f.coded->metrics.anchors : results.anchors), "anchors");
  if (source) page.headline.emplace_back(format_duration(source->results.train_seconds), "training time");
  page.headline.emplace_back(format_duration(results.train_seconds), !source    ? "training time"
                                                                     : marks(f) ? "hiding the message"
                                                                                : "fitting the codec");
  page.headline.emplace_back(decimals(mean(evaluation, &ViewResult::milliseconds), 1) + " ms", "render of a view");

  page.curves = run_curves(f, curve, source);
  page.renders = f.coded ? "decoded model.cmk" : "render";
  page.views = std::move(pictures);
  if (f.coded && f.coded->mark)
    page.plots.push_back(
        logit_plot(f.mark->message, f.coded->mark->report.verification, "Bits of all views, compressed"));
  if (f.found)
    page.plots.push_back(logit_plot(f.mark->message, f.found->report.verification,
                                    f.coded ? "Bits of all views, before the codec" : "Bits of all views"));

  if (f.coded) page.grids.push_back(section_grid(*f.coded, unmarked));
  ReportGrid views{"Every " + split + " view of " + file, {"view", "PSNR dB", "SSIM", "ms", "Gaussians"}, {}};
  for (const ViewResult& view : evaluation.views) {
    views.rows.push_back({view.name, decimals(view.psnr, 2), decimals(view.ssim, 4), decimals(view.milliseconds, 1),
                          std::to_string(view.gaussians)});
  }
  page.grids.push_back(std::move(views));

  if (f.coded) {
    page.tables.push_back(compressed_table(*f.coded));
    if (f.coded->metrics.watermark)
      page.tables.push_back(mark_table("Watermark in model.cmk", *f.coded->metrics.watermark, *f.mark));
    page.tables.push_back({"Before the codec: model.safetensors",
                           {{"PSNR", decimals(mean(f.evaluation, &ViewResult::psnr), 2) + " dB"},
                            {"SSIM", decimals(mean(f.evaluation, &ViewResult::ssim), 4)},
                            {"anchors", std::to_string(results.anchors)}}});
  }
  if (results.watermark)
    page.tables.push_back(
        mark_table(f.coded ? "Watermark before the codec" : "Watermark", *results.watermark, *f.mark));
  if (const std::optional<compmark::StepSummary>& step = results.distortion_step) {
    page.tables.push_back(
        {"Distortion layer, last iteration",
         {{"mean step, of Q0", decimals(step->mean, 4)}, {"median step, of Q0", decimals(step->median, 4)}}});
  }
  page.tables.push_back({"Settings",
                         {{"seed", std::to_string(settings.seed)},
                          {"lambda (1 - SSIM)", decimals(settings.lambda_dssim, 3)},
                          {"voxel size", decimals(f.voxel_size, 6)},
                          {"growing threshold", decimals(settings.gradient_threshold, 6)},
                          {"scene extent", decimals(f.extent, 4)},
                          {"background", background_name(settings.background)},
                          {"model sha256", results.model_sha256}}});
  page.tables.push_back(machine_table(results.threads));
  return page;
}

}  // namespace tool
