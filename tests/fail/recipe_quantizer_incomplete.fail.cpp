// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A quantizer without steps would never be called.
// message: Recipe: Quantizer lacks step
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
  using Quantizer = Empty;
#else
  using Quantizer = AdaptiveQuantizer<float>;
#endif
};

Pipeline<Mine> pipeline;
