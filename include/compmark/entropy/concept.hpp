// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concepts of the entropy room: an EntropyModel says how probable the symbols of an anchor are, in floating point while
// training and in whole numbers while coding. Everything that decides a symbol of a file is an integer
// (docs/spec/numerics.md, EN6); floats only choose which one.
#pragma once

#include "compmark/core/absent.hpp"

namespace compmark {

/// No rate in the loss, and nothing that could be coded: what a plain training has.
struct NoEntropyModel : Absent<NoEntropyModel> {};

template <class E>
concept EntropyModel = E::is_absent || requires {
  typename E::Settings;
};

}  // namespace compmark
