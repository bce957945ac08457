// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark/app/evaluate.hpp with this program's clock.
#pragma once

#include <chrono>
#include <compmark/app/evaluate.hpp>
#include <compmark/core/thread_executor.hpp>

#include "common.hpp"

namespace tool {

/// Measures with these LPIPS weights, if any, and the milliseconds of a render.
[[nodiscard]] inline compmark::EvaluateSettings evaluation_settings(const compmark::LpipsFiles& lpips = {}) {
  const auto milliseconds = [] {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
  };
  return {lpips, milliseconds};
}

}  // namespace tool
