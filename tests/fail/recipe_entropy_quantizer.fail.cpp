// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The files of the codecs have no room for steps that come from the extremes of the data.
// message: Recipe: EntropyModel does not quantize by the recipe's Quantizer
#include "compmark/recipes/hac.hpp"
#include "compmark/splat/quantizer/int8_quantizer.hpp"
#include "compmark/splat/training/pipeline.hpp"

using namespace compmark;

struct Mine : recipes::HacScaffold {
#ifdef COMPMARK_MUST_FAIL
  using Quantizer = Int8Quantizer<float>;
#else
  using Quantizer = UniformQuantizer<float>;
#endif
};

Pipeline<Mine> pipeline;
