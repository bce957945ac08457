// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A loss of nothing but names would be 0.
// message: Recipe: HsvLoss lacks forward
#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/splat/training/pipeline.hpp"

using namespace compmark;

struct Empty {
  static constexpr bool is_absent = false;
  using Scalar = float;
  struct Settings {};
  struct Handles {};
  struct Context {};
};
struct Mine : recipes::Scaffold {
#ifdef COMPMARK_MUST_FAIL
  using HsvLoss = Empty;
#else
  using HsvLoss = compmark::HsvLoss<float>;
#endif
};

Pipeline<Mine> pipeline;
