// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Observes the iterations of a run: progress, checkpoints, memory, and trainings that have failed.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "compmark/app/evaluate.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/splat/training/checkpoint.hpp"
#include "compmark/splat/training/trainer.hpp"

namespace compmark::detail {

/// Tells the progress of a loop, writes checkpoints, and ends a run that cannot get anywhere.
struct TrainObserver {
  RunObserver* told = nullptr;
  const ModelInfo* info = nullptr;
  std::int64_t checkpoint_every = 1000;
  std::filesystem::path checkpoint;
  double seconds_before = 0;
  double peak_before_mb = 0;
  double begin = 0;                            ///< by the clock of `told`
  std::optional<StepSummary> distortion_step;  ///< of the last iteration, where a layer tells it
  bool stopped = false;
  std::optional<Error> failure;
  double last_psnr = 0;
  std::int64_t patience = 0;       ///< iterations in a row that may render nothing: two rounds of the training views
  std::int64_t empty_renders = 0;  ///< as many were there in a row
  std::function<Result<Done>(std::size_t anchors, std::size_t grown)> growth;  ///< checks that there is memory for more

  [[nodiscard]] double seconds() const { return seconds_before + told->seconds() - begin; }
  [[nodiscard]] double peak_memory_mb() const { return std::max(peak_before_mb, told->peak_memory_mb()); }
  /// What a checkpoint keeps of the run beside its state.
  [[nodiscard]] std::vector<double> figures() const {
    std::vector<double> kept{peak_memory_mb()};
    if (distortion_step) kept.insert(kept.end(), {distortion_step->mean, distortion_step->median});
    return kept;
  }
  /// Takes up what figures() gave.
  void take_up(double seconds_so_far, const std::vector<double>& kept) {
    seconds_before = seconds_so_far;
    if (!kept.empty()) peak_before_mb = kept[0];
    if (kept.size() == 3) distortion_step = {kept[1], kept[2]};
  }

  template <class TrainerType>
  COMPMARK_ONCE bool on_iteration(const TrainerType& trainer, const IterationReport& report) {
    // The PSNR of a training view costs a pass over the image: measured for every tenth iteration, the rate of the log.
    if (report.iteration % 10 == 1 || report.iteration == report.total) {
      const double psnr = counted_psnr(trainer.image(), trainer.target(), trainer.weight());
      if (!std::isnan(psnr)) last_psnr = psnr;  // of a view of which nothing counts there is none
    }
    RunProgress line;
    if constexpr (requires { trainer.context(); } && has_stage<typename TrainerType::Stages, RateStage>) {
      const auto& rate = trainer.context().template of<RateStage>().report;
      if (rate.sampled != 0) line.bits_per_scalar = rate.bits_per_scalar;
    }
    if constexpr (requires { trainer.state().revival; })
      line.revivals = static_cast<std::uint64_t>(trainer.state().revival.revivals);
    const MarkReport mark = mark_report(trainer);
    if (mark.bits != 0) line.bit_accuracy = static_cast<double>(mark.matches) / static_cast<double>(mark.bits);
    if (!tell(line, report)) return false;
    const bool stop = stopped || failure, last = report.iteration == report.total;
    // After the last one too: what comes then (files, figures, a page) may fail, and is made again without training.
    if (stop || last || report.iteration % checkpoint_every == 0) {
      if constexpr (requires { trainer.context(); } && has_stage<typename TrainerType::Stages, DistortionStage>) {
        distortion_step = trainer.pipeline().template stage<DistortionStage>().step_summary(
            trainer.context().template of<DistortionStage>());
      }
      const Result<Done> written =
          write_checkpoint(checkpoint, trainer.state(), trainer.settings(), *info, seconds(), figures());
      if (!written && last && !stop) {  // the model that comes is smaller, and what counts
        told->on_warning(written.error().line());
      } else if (!written) {
        failure = written.error();
        return false;
      }
    }
    return !stop;
  }

 private:
  /// What is the same for every recipe. `line` has what is not; false where nothing is left to train or to keep.
  bool tell(RunProgress& line, const IterationReport& report) {
    line.iteration = report.iteration;
    line.total = report.total;
    line.loss = report.loss.total;
    line.l1 = report.loss.l1;
    line.ssim = report.loss.ssim;
    line.psnr = last_psnr;
    line.anchors = report.anchors;
    line.gaussians = report.forward.gaussians;
    stopped = !told->on_iteration(line);
    if (report.skipped_blocks != 0) {
      told->on_note("iteration " + std::to_string(report.iteration) + ": " + std::to_string(report.skipped_blocks) +
                    " parameter blocks had a gradient that is not finite and were not updated");
    }
    if (report.revived) {
      told->on_note("iteration " + std::to_string(report.iteration) + ": no Gaussian had been drawn for " +
                    std::to_string(Revival::patience) + " iterations, so that the opacities were set anew");
    }
    // Opacities of zero or less get no gradient, so that such a scene can never change: the remaining hours would train
    // nothing.
    if (report.rendered) empty_renders = report.forward.gaussians == 0 ? empty_renders + 1 : 0;
    if (empty_renders > patience) {
      failure = Error{ErrorKind::invalid,
                      {},
                      "iteration " + std::to_string(report.iteration),
                      "the training has failed: in " + std::to_string(empty_renders) +
                          " iterations no Gaussian had an opacity above 0, so that none can learn any more",
                      "give another --seed; if most pixels are background, use a recipe that trains on "
                      "alpha (leave out --recipe and --profile); if the photographs are black, replace them"};
      return false;
    }
    if (report.adjusted && report.grown > 0 && report.iteration < report.total) {
      if (const Result<Done> room = growth(report.anchors, report.grown); !room) failure = room.error();
    }
    return true;
  }
};

}  // namespace compmark::detail
