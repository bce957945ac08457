// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A loss of nothing but names would be 0.
// message: Recipe: FrequencyLoss lacks forward
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
  using FrequencyLoss = Empty;
#else
  using FrequencyLoss = compmark::FrequencyLoss<float>;
#endif
};

Pipeline<Mine> pipeline;
