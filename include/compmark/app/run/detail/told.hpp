// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a RunObserver is told by functions that know none.
#pragma once

#include <cstddef>
#include <string>

#include "compmark/app/observer.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/codec/model/grid_anchors.hpp"

namespace compmark::detail {

[[nodiscard]] inline SentenceSink warnings_of(RunObserver& observer) {
  return [&observer](const std::string& sentence) { observer.on_warning(sentence); };
}
[[nodiscard]] inline SentenceSink notes_of(RunObserver& observer) {
  return [&observer](const std::string& sentence) { observer.on_note(sentence); };
}
/// What a user is told of anchors that were moved onto the grid of a codec.
[[nodiscard]] inline std::string told_moves(const GridMoves& moves, std::size_t anchors) {
  return std::to_string(moves.anchors) + " of " + std::to_string(anchors) +
         " anchors lay off the grid that a codec stores and were moved onto it; their Gaussians stay where they were";
}
/// Measures with these LPIPS weights, if any, and the milliseconds of a render by the observer's clock.
[[nodiscard]] inline EvaluateSettings evaluation_of(const RunObserver& observer, const LpipsFiles& lpips = {}) {
  return {lpips, [&observer] { return 1000 * observer.seconds(); }};
}

}  // namespace compmark::detail
