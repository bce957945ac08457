// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Whom a run keeps informed, and what it cannot know by itself: the time and the memory of the machine. The model does
// not depend on any of it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "compmark/app/dataset_views.hpp"
#include "compmark/app/evaluate.hpp"
#include "compmark/app/reading.hpp"
#include "compmark/app/run/run_progress.hpp"
#include "compmark/app/run/run_results.hpp"
#include "compmark/codec/container/encoding.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/owner_key.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/watermark/proof/message.hpp"
#include "compmark/watermark/proof/report.hpp"

namespace compmark {

/// A run whose iterations begin.
struct RunBeginning {
  std::filesystem::path out;
  std::int64_t iteration = 0;  ///< finished before, by the run that is resumed
  std::int64_t total = 0;
  bool resumed = false;  ///< from a checkpoint
};

/// The message that a run hides or reads, with its decoder.
struct RunMark {
  OwnerKey key;
  FileDecoder decoder;
  Message message;
  std::vector<std::uint8_t> bits;  ///< the same, one a byte
  ReportSources sources;
  std::filesystem::path unmarked;        ///< the counterpart to compare with
  std::filesystem::path coded_unmarked;  ///< of the compressed model; empty: `unmarked`
  double unmarked_unit = 1;              ///< as in the counterpart's ModelInfo, likewise the origin
  std::array<double, 3> unmarked_origin{0, 0, 0};
  std::filesystem::path key_file;
  std::string decoder_tensors;  ///< tensors_sha256 (mark_record.hpp)
  bool for_compression = false;
  bool read_only = false;  ///< the source model already holds the message: it is only read, and nothing trains for it
};

/// What was read of a mark.
struct MarkMeasurement {
  VerificationReport report;
  std::optional<double> unmarked_psnr;            ///< of the counterpart's renders against the photographs, mean, dB
  std::optional<double> psnr_marked_vs_unmarked;  ///< of the two renders, mean over the views, dB
};

/// The compressed file of a run, read back as any other program would.
struct CompressedRun {
  std::filesystem::path file;
  CompressedMetrics metrics;
  Evaluation evaluation;                ///< of the views, of the decoded model
  std::optional<MarkMeasurement> mark;  ///< what was read of a message, likewise
};

/// The measurements of a run, before results.json says that it is finished.
struct RunFindings {
  std::filesystem::path out;
  std::filesystem::path source;  ///< finished model that the run began with; may be empty
  const TrainSettings& settings;
  double extent = 0;      ///< radius of the scene
  double voxel_size = 0;  ///< of the model
  const RunResults& results;
  const DatasetViews& measured;
  bool has_test = true;          ///< whether `measured` are test views, not those of the training
  const Evaluation& evaluation;  ///< of model.safetensors
  const RunMark* mark = nullptr;
  const std::optional<MarkMeasurement>& found;  ///< the message in model.safetensors
  const std::optional<CompressedRun>& coded;
};

/// What a run leaves, beside its files.
struct RunOutcome {
  bool was_finished = false;  ///< a resumed run that had nothing left to do: only `model` and `results` are set
  std::filesystem::path model;
  RunResults results;
  double psnr = 0;  ///< of model.safetensors, mean over the measured views, likewise
  double ssim = 0;
  std::size_t views = 0;
  std::optional<Verification> verification;  ///< of the message, from its renders
};

/// Told by runs. What is not overridden is not told; all calls come on the caller's thread.
class RunObserver {
 public:
  RunObserver() = default;
  RunObserver(const RunObserver&) = delete;
  RunObserver& operator=(const RunObserver&) = delete;
  virtual ~RunObserver() = default;

  virtual void on_warning(const std::string& /*sentence*/) {}  ///< something that is not used, or cannot be kept
  virtual void on_note(const std::string& /*sentence*/) {}     ///< what was chosen, and why
  /// An Error ends the run before its first iteration, and is its own. A run that marks afterwards begins twice.
  virtual Result<Done> on_begin(const RunBeginning& /*beginning*/) { return Done{}; }
  /// False writes a checkpoint and stops: ErrorKind::cancelled.
  virtual bool on_iteration(const RunProgress& /*progress*/) { return true; }
  /// The iterations are over, finished or not: measuring begins, or the function returns.
  virtual void on_iterations_end() {}
  /// While a decoder is fitted; false stops without a trace of it.
  virtual bool on_fit(std::size_t /*done*/, std::size_t /*total*/) { return true; }
  /// Measuring begins: of these views, in their order.
  virtual void on_measure(const DatasetViews& /*measured*/) {}
  /// A measured view of what others get: the compressed file of a run for a codec, else its model.
  virtual void on_view(const SeenView& /*view*/) {}
  /// The place for a page of one's own; an Error leaves the run unfinished, with its checkpoint.
  virtual Result<Done> on_findings(const RunFindings& /*findings*/, ThreadExecutor& /*executor*/) { return Done{}; }

  /// The run is finished: results.json says so.
  virtual void on_finished(const RunOutcome& /*outcome*/) {}

  /// Seconds of any clock, for the times in results.json; the library has none.
  [[nodiscard]] virtual double seconds() const { return 0; }
  /// Memory that is free on this machine, bytes, asked before a scene grows; 0: no limit.
  [[nodiscard]] virtual double free_memory_bytes() const { return 0; }
  /// Largest resident size of the process, 10^6 bytes, for results.json.
  [[nodiscard]] virtual double peak_memory_mb() const { return 0; }
};

}  // namespace compmark
