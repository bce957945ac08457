// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a run measures of its model and of its file: renders against photographs, and the message in them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compress.hpp"
#include "compmark/app/dataset_views.hpp"
#include "compmark/app/evaluate.hpp"
#include "compmark/app/files.hpp"
#include "compmark/app/run/detail/told.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/app/run/run_results.hpp"
#include "compmark/codec/container/cmk.hpp"
#include "compmark/metric/psnr.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/watermark/proof/verify.hpp"

namespace compmark::detail {

/// Reads the message from every view of a marked model, as a verifier does: from renders rounded to 8 bits.
[[nodiscard]] inline Result<MarkMeasurement> measure_mark(AnyModel& model, const RunMark& mark, DatasetViews views,
                                                          ThreadExecutor& executor, const RunObserver& observer) {
  std::optional<AnyModel> counterpart;
  if (!mark.unmarked.empty()) {
    Result<AnyModel> loaded = AnyModel::open(mark.unmarked, executor);
    if (!loaded) return loaded.error();
    counterpart = std::move(*loaded);
  }
  MarkMeasurement found;
  FileDecoder::Context context;
  double between = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Camera<double> camera = views.camera(i);
    const Result<RenderedView> render = model.render(camera, views.lens(i), executor);
    if (!render) return render.error();
    round_to_8bit<float>(render->image, render->image);
    Result<ViewLogits> read = read_logits(mark.decoder, ImageView<const float>(render->image),
                                          views.dataset->views[views.index[i]].name, context, executor);
    if (!read) return read.error();
    read->sha256 = pixels_sha256(render->image);
    found.report.views.push_back(std::move(*read));
    if (counterpart) {
      const Result<RenderedView> unmarked = counterpart->render(camera, views.lens(i), executor);
      if (!unmarked) return unmarked.error();
      round_to_8bit<float>(unmarked->image, unmarked->image);
      between += psnr(ImageView<const float>(render->image), ImageView<const float>(unmarked->image));
    }
  }
  Result<Verification> verification = verify_message(mark.message, found.report.views, VerifySettings{});
  if (!verification) return verification.error();
  found.report.verification = std::move(*verification);
  found.report.sources = mark.sources;
  if (counterpart) {
    found.psnr_marked_vs_unmarked = between / static_cast<double>(views.size());
    if (views.dataset->pictures) return found;  // they are the counterpart's own renders
    const Result<Evaluation> evaluation = evaluate_views(*counterpart, views, evaluation_of(observer), executor);
    if (!evaluation) return evaluation.error();
    found.unmarked_psnr = evaluation->mean([](const ViewResult& view) { return view.psnr; });
  }
  return found;
}

/// The part of it that results.json holds.
[[nodiscard]] inline WatermarkMetrics watermark_metrics(const Verification& verification) {
  const BitAccuracy accuracy = bit_accuracy(verification);
  WatermarkMetrics metrics;
  metrics.mean = accuracy.mean;
  metrics.min = accuracy.min;
  metrics.views = static_cast<int>(accuracy.views);
  metrics.p_value = verification.evidence.p_value;
  metrics.largest_view_p_value = accuracy.largest_p;
  return metrics;
}

/// Writes `file`, loads it and measures it over `measured`; `mark` may be null, `keep` is called for every view of the
/// decoded model.
[[nodiscard]] inline Result<CompressedRun> write_and_measure(const CodecModel& model, const std::filesystem::path& file,
                                                             const DatasetViews& measured, const LpipsFiles& lpips,
                                                             const RunMark* mark, const SeenViewObserver& keep,
                                                             ThreadExecutor& executor, const RunObserver& observer) {
  CompressedRun run;
  run.file = file;
  const double encoding = observer.seconds();
  const Result<CodecEncoded> encoded = write_coded(file, model, executor);
  if (!encoded) return encoded.error();
  run.metrics.encode_seconds = observer.seconds() - encoding;
  const double decoding = observer.seconds();
  Result<AnyModel> decoded = AnyModel::open(file, executor);  // what was written is what is measured
  if (!decoded) return decoded.error();
  run.metrics.decode_seconds = observer.seconds() - decoding;
  Result<Evaluation> evaluation = evaluate_views(*decoded, measured, evaluation_of(observer, lpips), executor, keep);
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
    RunMark compared = *mark;
    if (!mark->coded_unmarked.empty()) compared.unmarked = mark->coded_unmarked;
    Result<MarkMeasurement> found = measure_mark(*decoded, compared, measured, executor, observer);
    if (!found) return found.error();
    WatermarkMetrics metrics = watermark_metrics(found->report.verification);
    if (found->unmarked_psnr) metrics.psnr_cost_vs_unmarked = *found->unmarked_psnr - run.metrics.test.psnr;
    metrics.psnr_marked_vs_unmarked = found->psnr_marked_vs_unmarked;
    run.metrics.watermark = metrics;
    run.mark = std::move(*found);
  }
  run.evaluation = std::move(*evaluation);
  return run;
}

}  // namespace compmark::detail
