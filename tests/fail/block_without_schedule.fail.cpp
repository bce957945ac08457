// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A block whose learning rate nobody declared would stay what it is, in silence.
// message: ParameterArena: a block is declared with its BlockRole and its LearningSchedule
#include "compmark/core/parameters.hpp"

using namespace compmark;

BlockHandle declare(ParameterArena<float>& arena) {
#ifdef COMPMARK_MUST_FAIL
  return arena.add("my.residual", 10, 32, RowKind::anchor);
#else
  return arena.add("my.residual", 10, 32, RowKind::anchor, BlockRole::rendering, LearningSchedule::constant(0.002));
#endif
}
