// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Whether a stage adds to the gradient it is given or is the first to write it. Adding is the rule, so that losses can
// be stacked; the first stage of a backward pass may set, which saves clearing the memory before and reading it back:
// 112 bytes a Gaussian in that of projection.
#pragma once

namespace compmark {

enum class GradientMode {
  add,  ///< gradient += ...
  set,  ///< gradient = ..., every element is written
};

}  // namespace compmark
