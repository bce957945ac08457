// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A loop whose index is a constant: arrays of packs indexed by it stay in registers at any optimisation level.
#pragma once

#include <type_traits>
#include <utility>

#include "compmark/core/config.hpp"

namespace compmark {
namespace detail {

/// f(integral_constant 0), …, f(integral_constant N - 1).
template <int N, class F>
COMPMARK_INLINE void unroll(const F& f) {
  [&]<int... I>(std::integer_sequence<int, I...>) __attribute__((always_inline)) {
    (f(std::integral_constant<int, I>{}), ...);
  }
  (std::make_integer_sequence<int, N>{});
}

}  // namespace detail
}  // namespace compmark
