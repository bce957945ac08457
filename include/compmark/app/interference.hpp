// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Measures the cover interference of an unmarked model for a decoder that knows no scene, and writes it to a small
// file, for ReadingSettings::interference. No key is needed, and the file serves every key: keep it with the keys of
// the scene, for who has it sees what pictures of the unmarked scene look like, at 8 x 8.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

#include "compmark/app/compiled.hpp"
#include "compmark/app/observer.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"

namespace compmark {

/// Errors name these fields as the tool's options do ("--model").
struct InterferenceSettings {
  std::filesystem::path model;    ///< unmarked; of any recipe, with the cameras of its training
  std::filesystem::path decoder;  ///< any decoder file
  std::filesystem::path out;      ///< file to write
  std::size_t views = 600;        ///< sampled novel views, between the cameras; at least 2
  std::uint64_t seed = 0;
};

struct MeasuredInterference {
  double deviation = 0;  ///< of the decoder's outputs over the views
  double told = 0;       ///< share of their variance that other views tell of a view (CoverInterferenceFit)
};

/// The same file at any number of threads. The observer counts views. Cost: a render and a reading a view; 600 views of
/// 400 x 400 take a minute of one thread.
[[nodiscard]] Result<MeasuredInterference> measure_interference(const InterferenceSettings& settings,
                                                                ThreadExecutor& executor,
                                                                const WorkObserver& observer = {});

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/interference.hpp"
#endif
