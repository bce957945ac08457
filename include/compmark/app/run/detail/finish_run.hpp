// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The end of a run, whatever it trained: its model is measured, compressed and read, and results.json says so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "compmark/app/files.hpp"
#include "compmark/app/run/detail/finished_run.hpp"
#include "compmark/app/run/detail/run_data.hpp"
#include "compmark/app/run/detail/run_measure.hpp"
#include "compmark/app/run/payload_json.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/io/json_file.hpp"

namespace compmark::detail {

/// The result of a training.
struct RunEnd {
  std::size_t anchors = 0;
  double voxel_size = 0;
  double train_seconds = 0;
  double peak_memory_mb = 0;
  std::uint64_t revivals = 0;
  std::optional<StepSummary> distortion_step;
  std::optional<CodecModel> coded;  ///< of a run for compression
};

/// The last name of a path, also of "scene/": the name of a dataset.
[[nodiscard]] inline std::string base_name(const std::filesystem::path& path) {
  std::filesystem::path clean = path.lexically_normal();
  if (!clean.has_filename()) clean = clean.parent_path();
  return clean.filename().string();
}

/// Notes which decoder reads the mark of what this run wrote.
[[nodiscard]] inline Result<Done> keep_mark(const RunPlan& plan, const RunMark& mark,
                                            const std::filesystem::path& model, const std::string& digest, bool coded) {
  MarkRecord record;
  record.key_id = mark.sources.key_id;
  record.key_commitment = mark.sources.key_commitment;
  record.decoder = {mark.sources.decoder, mark.sources.decoder_sha256};
  record.decoder_tensors = mark.decoder_tensors;
  record.recipient = mark.key.recipient;
  record.models.push_back({model.filename().string(), digest});
  for (const auto& [also, name] :
       {std::pair(coded, "model.cmk"), std::pair(plan.recipe == "explicit", splat_file_name)}) {
    if (!also) continue;
    const Result<std::string> other = file_sha256(plan.out / name);
    if (!other) return other.error();
    record.models.push_back({name, *other});
  }
  return keep_record(record, mark.key_file, plan.out, warnings_of(*plan.observer));
}

/// Measures the model that was written, compresses it where `end` says so, reads the mark, writes the results.
[[nodiscard]] inline Result<RunOutcome> finish_run(const RunPlan& plan, RunData& run, const RunEnd& end,
                                                   const RunMark* mark) {
  ThreadExecutor& executor = *plan.executor;
  RunObserver& observer = *plan.observer;
  const TrainSettings& settings = run.settings;
  Result<std::string> digest = file_sha256(run.model);
  if (!digest) return digest.error();

  const bool has_test = run.test.size() != 0;
  const DatasetViews& measured = has_test ? run.test : run.train;
  observer.on_measure(measured);
  // Shown are renders of the file that others get: the compressed one if there is one.
  const SeenViewObserver keep = [&observer](const SeenView& view) -> Result<Done> {
    observer.on_view(view);
    return Done{};
  };
  Result<AnyModel> model = AnyModel::open(run.model, executor);  // what was written is what is measured
  if (!model) return model.error();
  Result<Evaluation> evaluation = evaluate_views(*model, measured, evaluation_of(observer, plan.lpips), executor,
                                                 end.coded ? SeenViewObserver() : keep);
  if (!evaluation) return evaluation.error();
  const double mean_psnr = evaluation->mean([](const ViewResult& v) { return v.psnr; });
  const double mean_ssim = evaluation->mean([](const ViewResult& v) { return v.ssim; });

  std::optional<CompressedRun> coded;
  if (end.coded) {
    Result<CompressedRun> written =
        write_and_measure(*end.coded, plan.out / "model.cmk", measured, plan.lpips, mark, keep, executor, observer);
    if (!written) return written.error();
    coded = std::move(*written);
  }
  std::optional<MarkMeasurement> measured_mark;
  if (mark != nullptr) {
    Result<MarkMeasurement> found = measure_mark(*model, *mark, measured, executor, observer);
    if (!found) return found.error();
    measured_mark = std::move(*found);
    measured_mark->report.sources.model = run.model.filename().string();
    measured_mark->report.sources.model_sha256 = *digest;
  }

  RunResults results;
  results.dataset = base_name(plan.data);
  results.recipe = plan.recipe;
  results.profile = settings.profile;
  results.iterations = settings.iterations;
  results.seed = settings.seed;
  results.threads = static_cast<int>(executor.concurrency());
  results.anchors = end.anchors;
  results.gaussians_per_view = evaluation->mean([](const ViewResult& v) { return static_cast<double>(v.gaussians); });
  results.train_seconds = end.train_seconds;
  results.peak_memory_mb = end.peak_memory_mb;
  results.revivals = end.revivals;
  results.distortion_step = end.distortion_step;
  if (has_test) {
    TestMetrics metrics{mean_psnr, mean_ssim, {}, static_cast<int>(measured.size()), {}};
    if (!plan.lpips.alex.empty())
      metrics.lpips_alex = evaluation->mean([](const ViewResult& v) { return *v.lpips_alex; });
    metrics.psnr_colour_fitted = evaluation->colour_fitted();
    results.test = metrics;
  }
  results.model_sha256 = *digest;
  Result<std::string> identity = run_identity(plan, settings);
  if (!identity) return identity.error();
  results.identity = std::move(*identity);
  results.effects = run.info.effects;
  if (plan.method) results.method = name_of(*plan.method);
  // Post-hoc embedding has no rate in its loss, so no lambda is recorded.
  const bool rates = mark == nullptr || mark->read_only || plan.model.empty();
  if (coded && rates) results.rate_lambda = settings.rate.lambda;
  if (coded) results.compressed = coded->metrics;
  if (measured_mark) {
    WatermarkMetrics metrics = watermark_metrics(measured_mark->report.verification);
    if (measured_mark->unmarked_psnr) metrics.psnr_cost_vs_unmarked = *measured_mark->unmarked_psnr - mean_psnr;
    metrics.psnr_marked_vs_unmarked = measured_mark->psnr_marked_vs_unmarked;
    results.watermark = metrics;
    nlohmann::ordered_json json = report_json<nlohmann::ordered_json>(measured_mark->report);
    if (mark->key.recipient != 0) json["recipient"] = mark->key.recipient;
    if (mark->key.corrects != 0) json["payload"] = payload_json(mark->key, measured_mark->report.verification.read);
    if (Result<Done> written = write_json(plan.out / "verification.json", json); !written) return written.error();
  }
  if (mark != nullptr && !mark->read_only) {
    if (Result<Done> kept = keep_mark(plan, *mark, run.model, *digest, coded.has_value()); !kept) return kept.error();
  }
  const RunFindings findings{plan.out, plan.model,  settings, run.extent.radius, end.voxel_size, results, measured,
                             has_test, *evaluation, mark,     measured_mark,     coded};
  if (Result<Done> told = observer.on_findings(findings, executor); !told) return told.error();
  // Written last: a run with this file counts as finished.
  if (Result<Done> written = write_results(plan.out / "results.json", results); !written) return written.error();
  std::error_code ignored;
  std::filesystem::remove(run.checkpoint, ignored);

  RunOutcome outcome;
  outcome.model = run.model;
  outcome.psnr = mean_psnr;
  outcome.ssim = mean_ssim;
  outcome.views = measured.size();
  if (measured_mark) outcome.verification = std::move(measured_mark->report.verification);
  outcome.results = std::move(results);
  observer.on_finished(outcome);
  return outcome;
}

}  // namespace compmark::detail
