// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "coded_run.hpp"

#include <chrono>
#include <compmark/codec/container/cmk.hpp>
#include <cstdio>

#include "evaluation.hpp"
#include "mark_plot.hpp"
#include "model_files.hpp"

namespace tool {
namespace {

using namespace compmark;
using Clock = std::chrono::steady_clock;

double since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

template <class... Values>
std::string formatted(const char* format, Values... values) {
  char text[160];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

}  // namespace

std::string coded_text(const CodecReport& report) {
  std::string text = formatted("%llu bytes, %llu anchors with %llu unmasked offsets", report.total_bytes + 0ull,
                               report.anchors + 0ull, report.live_offsets + 0ull);
  if (report.dropped != 0) text += formatted(", %llu anchors without one are left out", report.dropped + 0ull);
  text += "\n";
  if (report.profile == ContainerProfile::context_gs) {
    text += formatted("  levels: %llu coarse anchors, %llu, %llu fine\n", report.level_anchors[2] + 0ull,
                      report.level_anchors[1] + 0ull, report.level_anchors[0] + 0ull);
  }
  for (const auto& [name, bytes] : coded_sections(report)) {
    text += formatted("  %-30s %10llu  %5.1f %%\n", name.c_str(), bytes + 0ull,
                      100.0 * static_cast<double>(bytes) / static_cast<double>(report.total_bytes));
  }
  static constexpr const char* groups[3] = {"feature", "extent", "offset"};
  for (std::size_t group = 0; group < 3; ++group) {
    if (report.clamped[group] != 0) {
      text += formatted("  warning: %llu values of %s were outside of the coded range and are clipped to it\n",
                        report.clamped[group] + 0ull, groups[group]);
    }
    if (report.symbols[group] == 0) continue;
    text += formatted("  %s: %.3f bits a scalar\n", groups[group],
                      report.ideal_bits[group] / static_cast<double>(report.symbols[group]));
  }
  if (report.hyperprior_symbols != 0) {
    text += formatted("  hyperprior: %.3f bits a scalar\n",
                      report.hyperprior_bits / static_cast<double>(report.hyperprior_symbols));
  }
  return text;
}

nlohmann::ordered_json coded_json(const CodecReport& report) {
  nlohmann::ordered_json sections;
  for (const auto& [name, bytes] : coded_sections(report)) sections[name] = bytes;
  nlohmann::ordered_json bits;
  static constexpr const char* groups[3] = {"feature", "extent", "offset"};
  for (std::size_t group = 0; group < 3; ++group) {
    if (report.symbols[group] != 0)
      bits[groups[group]] = report.ideal_bits[group] / static_cast<double>(report.symbols[group]);
  }
  if (report.hyperprior_symbols != 0)
    bits["hyperprior"] = report.hyperprior_bits / static_cast<double>(report.hyperprior_symbols);
  return {{"codec", codec_name(report.profile)},
          {"bytes", report.total_bytes},
          {"estimated_bytes", report.estimated_bytes()},
          {"anchors", report.anchors},
          {"dropped_anchors", report.dropped},
          {"live_offsets", report.live_offsets},
          {"bits_per_scalar", std::move(bits)},
          {"clamped", report.clamped},
          {"sections", std::move(sections)}};
}

Result<CodedRun> write_and_measure(const CodecModel& model, const std::filesystem::path& file,
                                   const DatasetViews& measured, const LpipsFiles& lpips, const MarkInput* mark,
                                   const SeenViewObserver& keep, ThreadExecutor& executor) {
  CodedRun run;
  const auto encoding = Clock::now();
  const Result<CodecEncoded> encoded = write_coded(file, model, executor);
  if (!encoded) return encoded.error();
  run.metrics.encode_seconds = since(encoding);
  const auto decoding = Clock::now();
  Result<AnyModel> decoded = load_model(file, executor.concurrency());  // what was written is what is measured
  if (!decoded) return decoded.error();
  run.metrics.decode_seconds = since(decoding);
  Result<Evaluation> evaluation = evaluate_views(*decoded, measured, evaluation_settings(lpips), executor, keep);
  if (!evaluation) return evaluation.error();
  const CodecReport& report = encoded->report;
  run.metrics.codec = codec_name(report.profile);
  run.metrics.bytes = report.total_bytes;
  run.metrics.anchors = report.anchors;
  run.metrics.sections = coded_sections(report);
  run.metrics.test.psnr = evaluation->mean([](const ViewResult& v) { return v.psnr; });
  run.metrics.test.ssim = evaluation->mean([](const ViewResult& v) { return v.ssim; });
  run.metrics.test.views = static_cast<int>(measured.size());
  if (!lpips.alex.empty())
    run.metrics.test.lpips_alex = evaluation->mean([](const ViewResult& v) { return *v.lpips_alex; });
  if (mark != nullptr) {
    MarkInput compared = *mark;
    if (!mark->coded_twin.empty()) compared.twin = mark->coded_twin;
    Result<MarkMeasurement> found = measure_mark(*decoded, compared, measured, executor);
    if (!found) return found.error();
    WatermarkMetrics metrics = watermark_metrics(found->report.verification);
    if (found->unmarked_psnr) metrics.psnr_cost_vs_unmarked = *found->unmarked_psnr - run.metrics.test.psnr;
    metrics.psnr_marked_vs_unmarked = found->psnr_marked_vs_unmarked;
    run.metrics.watermark = metrics;
    run.bits = logit_plot(mark->message, found->report.verification, "Bits of all views, compressed");
    run.mark = std::move(*found);
  }
  run.table.heading = "Compressed";
  run.table.rows = {{"codec", run.metrics.codec},
                    {"file", file.filename().string()},
                    {"size", formatted("%.1f KiB", static_cast<double>(run.metrics.bytes) / 1024)},
                    {"PSNR", formatted("%.2f dB", run.metrics.test.psnr)},
                    {"SSIM", formatted("%.4f", run.metrics.test.ssim)},
                    {"encoded in", formatted("%.2f s", run.metrics.encode_seconds)},
                    {"decoded in", formatted("%.2f s", run.metrics.decode_seconds)}};
  run.evaluation = std::move(*evaluation);
  return run;
}

}  // namespace tool
