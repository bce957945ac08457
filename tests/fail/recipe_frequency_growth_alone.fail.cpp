// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Growing that looks at the frequency loss' error map needs the loss.
// message: Recipe: this DensityControl looks at the error map of a FrequencyLoss
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/anchor/frequency_growth.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/watermark/loss/frequency.hpp"

using namespace compmark;

struct Mine : recipes::Scaffold {
  using DensityControl = FrequencyGrowth<float>;
#ifndef COMPMARK_MUST_FAIL
  using FrequencyLoss = compmark::FrequencyLoss<float>;
#endif
};

Pipeline<Mine> pipeline;
