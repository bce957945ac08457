// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Absence is a type. A stage that a recipe leaves out is an empty type of its own: no member, no branch, no symbol.
// Each stage derives its own No… type (distinct empty types share an address under [[no_unique_address]]; equal ones do
// not).
#pragma once

#include <type_traits>

namespace compmark {

/// Base of every No… policy: Self is the derived type, which makes the bases of two absent stages distinct types too.
template <class Self>
struct Absent {
  struct Settings {};
  struct Params {};
  struct State {};
  struct Context {};
  static constexpr bool is_absent = true;
};

/// True for a stage that is there. A stage says nothing to be present.
template <class Stage>
inline constexpr bool present = [] {
  if constexpr (requires { Stage::is_absent; }) {
    return !Stage::is_absent;
  } else {
    return true;
  }
}();

}  // namespace compmark
