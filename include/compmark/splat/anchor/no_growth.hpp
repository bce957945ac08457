// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The anchors stay as they were initialised: no statistics, no adjustment, no byte.
#pragma once

#include <cstddef>

#include "compmark/core/absent.hpp"

namespace compmark {

struct NoGrowth : Absent<NoGrowth> {
  constexpr NoGrowth(Settings /*settings*/ = {}) {
  }  // NOLINT(google-explicit-constructor): as any policy is made from its Settings
  static constexpr void prepare(std::size_t /*anchors*/, State& /*state*/) {}
};

}  // namespace compmark
