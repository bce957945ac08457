// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "run_telling.hpp"

#include <unistd.h>

#include <compmark/watermark/proof/report.hpp>
#include <cstdio>
#include <utility>

#include "common.hpp"
#include "report.hpp"
#include "shell_word.hpp"

namespace tool {

using namespace compmark;

namespace {

constexpr const char* unread_mark =
    "the mark cannot be read yet: more --mark-iterations (--iterations of embed), or a lower --fidelity; do not"
    " publish this model\n";

}  // namespace

FitLine::FitLine() : terminal_(isatty(STDERR_FILENO) == 1) {}

void FitLine::show(std::size_t done, std::size_t total) {
  const double since = std::chrono::duration<double>(Clock::now() - last_).count();
  if (done != total && since < (terminal_ ? 0.2 : 10)) return;
  last_ = Clock::now();
  const double spent = std::chrono::duration<double>(last_ - start_).count(),
               left = spent * static_cast<double>(total - done) / static_cast<double>(done);
  std::fprintf(stderr, "%sfit %.0f %%  ETA %s%s", terminal_ ? "\r" : "",
               100 * static_cast<double>(done) / static_cast<double>(total), format_duration(left).c_str(),
               !terminal_ || done == total ? "\n" : "\x1b[K");
}

RunTelling::RunTelling(std::filesystem::path out, std::filesystem::path json_log, bool resume, std::FILE* figures,
                       PeakMemory memory)
    : out_(std::move(out)),
      json_log_(std::move(json_log)),
      resume_(resume),
      figures_(figures),
      memory_(std::move(memory)) {}

void RunTelling::on_warning(const std::string& sentence) {
  if (warned_.insert(sentence).second) print_warning(sentence);
}

void RunTelling::on_note(const std::string& sentence) {
  if (began_ && progress_) {
    progress_->note(sentence);
  } else {
    print_note(sentence);
  }
}

Result<Done> RunTelling::on_begin(const RunBeginning& beginning) {
  if (beginning.resumed) print_note("resuming after iteration " + std::to_string(beginning.iteration));
  ProgressSettings settings;
  settings.json_log = json_log_.empty() || beginning.out != out_ ? beginning.out / "log.jsonl" : json_log_;
  settings.append = resume_;
  Result<Progress> progress = Progress::open(std::move(settings));
  if (!progress) return progress.error();
  progress_.emplace(std::move(*progress));
  began_ = false;
  watch_.emplace();
  return Done{};
}

bool RunTelling::on_iteration(const RunProgress& progress) {
  began_ = true;
  ProgressLine line;
  static_cast<RunProgress&>(line) = progress;
  progress_->show(line);
  return !interrupted();
}

void RunTelling::on_iterations_end() {
  watch_.reset();
  progress_->finish();
  began_ = false;
  if (!log_failure_) log_failure_ = progress_->log_failure();
}

bool RunTelling::on_fit(std::size_t done, std::size_t total) {
  if (!fit_) fit_.emplace();
  fit_->show(done, total);
  return true;  // a signal ends the process: nothing of a fit is kept
}

void RunTelling::on_measure(const DatasetViews& measured) { shown_.emplace(measured); }

void RunTelling::on_view(const SeenView& view) { shown_->keep(view); }

Result<Done> RunTelling::on_findings(const RunFindings& findings, ThreadExecutor& executor) {
  if (findings.mark != nullptr) {
    const RunMark& mark = *findings.mark;
    const std::filesystem::path& counterpart =
        findings.coded && !mark.coded_unmarked.empty() ? mark.coded_unmarked : mark.unmarked;
    if (!counterpart.empty()) {
      if (Result<Done> added = shown_->add_unmarked(counterpart, executor); !added) return added;
    }
  }
  return write_report(findings.out / "report.html", run_page(findings, progress_->curve(), shown_->pictures));
}

void RunTelling::on_finished(const RunOutcome& outcome) {
  const RunResults& results = outcome.results;
  const std::filesystem::path folder = outcome.model.parent_path();
  std::fprintf(
      figures_,
      "%s: %lld iterations in %.0f s, %zu anchors, %s PSNR %.2f dB, SSIM %.4f over %zu views\nmodel %s\nsha256 "
      "%s\nreport %s\n",
      results.dataset.c_str(), static_cast<long long>(results.iterations), results.train_seconds,
      static_cast<std::size_t>(results.anchors), results.test ? "test" : "training", outcome.psnr, outcome.ssim,
      outcome.views, outcome.model.string().c_str(), results.model_sha256.c_str(),
      (folder / "report.html").string().c_str());
  if (const std::optional<CompressedMetrics>& coded = results.compressed) {
    std::fprintf(figures_, "compressed %s: %llu bytes, PSNR %.2f dB, SSIM %.4f\n",
                 (folder / "model.cmk").string().c_str(), static_cast<unsigned long long>(coded->bytes),
                 coded->test.psnr, coded->test.ssim);
    if (const std::optional<WatermarkMetrics>& m = coded->watermark) {
      std::fprintf(figures_, "  bits read: %.1f %% in the mean, %.1f %% in the worst view", 100 * m->mean,
                   100 * m->min);
      if (m->psnr_cost_vs_unmarked)
        std::fprintf(figures_, ", %.2f dB lost to the unmarked counterpart", *m->psnr_cost_vs_unmarked);
      std::fprintf(figures_, "\n");
    }
  }
  if (outcome.verification) {
    // The owner's own mark: a judge's sentence on what was not read says nothing of what to do. Of too few bits, and of
    // a codec that is fitted to a marked model, it does.
    const bool fitted = results.method.empty() && results.recipe.find("+fitted") != std::string::npos;
    const bool read = outcome.verification->verdict == Verdict::detected || !outcome.verification->threshold || fitted;
    std::fprintf(
        figures_, "bits read: %.1f %% in the mean, %.1f %% in the worst view\n%s", 100 * results.watermark->mean,
        100 * results.watermark->min,
        (read ? report_text(*outcome.verification) : evidence_text(*outcome.verification) + unread_mark).c_str());
    if (results.watermark->psnr_marked_vs_unmarked) {
      std::fprintf(figures_, "against the unmarked counterpart: ");
      if (const std::optional<double> lost = results.watermark->psnr_cost_vs_unmarked)
        std::fprintf(figures_, "%.2f dB lost, ", *lost);
      std::fprintf(figures_, "%.2f dB between the renders\n", *results.watermark->psnr_marked_vs_unmarked);
    }
  }
  if (outcome.model != out_ / outcome.model.filename()) {  // trained on the way to a marked one
    std::fprintf(figures_, "kept for you alone: %s\n", folder.string().c_str());
    return;
  }
  // Splats that came as a file go out as one.
  const std::filesystem::path shown = results.recipe == "explicit" ? folder / "marked.ply" : outcome.model;
  std::fprintf(figures_, "next: compmark export --model %s --out %s\n", shell_word(shown).c_str(),
               shell_word(folder / "scene.html").c_str());
}

double RunTelling::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
double RunTelling::free_memory_bytes() const { return tool::free_memory_bytes(); }
double RunTelling::peak_memory_mb() const { return memory_.mb().value_or(0); }

std::optional<Error> RunTelling::failure(const Result<RunOutcome>& outcome) const {
  if (!outcome) return outcome.error();
  return log_failure_;
}

int RunTelling::finish(const Result<RunOutcome>& outcome) {
  if (!outcome && outcome.error().kind == ErrorKind::cancelled) {
    print_note(outcome.error().problem + "; " + outcome.error().remedy);
    return interrupted_exit;
  }
  const std::optional<Error> failed = failure(outcome);
  return failed ? fail(*failed) : success;
}

}  // namespace tool
