// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept of an EntropyModel: it predicts the probabilities of an anchor's symbols, in floating point while training
// and in whole numbers while coding. Everything that decides a symbol of a file is an integer (docs/spec/numerics.md,
// EN6); floats only choose these integers.
#pragma once

#include "compmark/core/absent.hpp"

namespace compmark {

/// No entropy model: no rate in the loss, and nothing that can be coded. A plain training has this.
struct NoEntropyModel : Absent<NoEntropyModel> {};

template <class E>
concept EntropyModel = E::is_absent || requires {
  typename E::Settings;
};

}  // namespace compmark
