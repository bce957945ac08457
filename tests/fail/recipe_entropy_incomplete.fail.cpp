// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An entropy model of nothing but names would count nothing.
// message: Recipe: EntropyModel lacks Phase
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
  using EntropyModel = Empty;
#else
  using EntropyModel = HacModel<float, 32, 10>;
#endif
};

Pipeline<Mine> pipeline;
