// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Compresses a trained model: writes the file, reads it back as any other program would, renders and measures it.
#pragma once

#include <compmark/app/compress.hpp>
#include <compmark/app/evaluate.hpp>
#include <compmark/codec/container/codec_model.hpp>
#include <compmark/codec/container/encoding.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mark_input.hpp"
#include "report.hpp"
#include "results.hpp"

namespace tool {

struct CodedRun {
  CompressedMetrics metrics;
  compmark::Evaluation evaluation;      ///< of the views, of the decoded model
  std::optional<MarkMeasurement> mark;  ///< what was read of a message, likewise
  ReportTable table;                    ///< for the page
  std::optional<Plot> bits;             ///< for the page, of a marked model
};

/// Writes `file`, loads it and measures it over `measured`; `mark` may be null, `keep` is called for every view of the
/// decoded model.
compmark::Result<CodedRun> write_and_measure(const compmark::CodecModel& model, const std::filesystem::path& file,
                                             const compmark::DatasetViews& measured, const compmark::LpipsFiles& lpips,
                                             const MarkInput* mark, const compmark::SeenViewObserver& keep,
                                             compmark::ThreadExecutor& executor);

/// The encoder's report, for people and for programs.
std::string coded_text(const compmark::CodecReport& report);
nlohmann::ordered_json coded_json(const compmark::CodecReport& report);

}  // namespace tool
