// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An embedder of nothing but names would hide nothing.
// message: Recipe: Embedder lacks target, add_parameters
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
  using Embedder = Empty;
#else
  using Embedder = ResidualFeature<float>;
#endif
};

Pipeline<Mine> pipeline;
