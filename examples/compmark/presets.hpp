// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Settings of a marked, compressed scene by what there is time for. What each costs and gives is for
// examples/tradeoff.cpp to measure (docs/accuracy_vs_time.md).
#pragma once

#include <array>
#include <cstdint>

namespace tool {

struct Preset {
  const char* name;
  std::int64_t iterations;       ///< of the training
  double rate_lambda;            ///< loss of one bit more a scalar
  std::int64_t mark_iterations;  ///< of hiding the message afterwards
};

inline constexpr std::array<Preset, 3> presets = {{
    {"draft", 2000, 0.004, 1000},
    {"standard", 10000, 0.002, 4000},
    {"best", 30000, 0.001, 8000},
}};

}  // namespace tool
