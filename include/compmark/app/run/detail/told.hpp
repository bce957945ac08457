// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a RunObserver is told by functions that know none.
#pragma once

#include <string>

#include "compmark/app/observer.hpp"
#include "compmark/app/run/run_observer.hpp"

namespace compmark::detail {

[[nodiscard]] inline SentenceSink warnings_of(RunObserver& observer) {
  return [&observer](const std::string& sentence) { observer.on_warning(sentence); };
}
[[nodiscard]] inline SentenceSink notes_of(RunObserver& observer) {
  return [&observer](const std::string& sentence) { observer.on_note(sentence); };
}
/// Measures with these LPIPS weights, if any, and the milliseconds of a render by the observer's clock.
[[nodiscard]] inline EvaluateSettings evaluation_of(const RunObserver& observer, const LpipsFiles& lpips = {}) {
  return {lpips, [&observer] { return 1000 * observer.seconds(); }};
}

}  // namespace compmark::detail
