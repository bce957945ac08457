// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Growing that looks at the frequency loss' error map needs the loss.
// message: Recipe: this DensityControl looks at the error map of a FrequencyLoss
#include "compmark/anchor/frequency_growth.hpp"
#include "compmark/loss/frequency.hpp"
#include "compmark/pipeline/pipeline.hpp"
#include "compmark/recipes/scaffold.hpp"

using namespace compmark;

struct Mine : recipes::Scaffold {
  using DensityControl = FrequencyGrowth<float>;
#ifndef COMPMARK_MUST_FAIL
  using FrequencyLoss = compmark::FrequencyLoss<float>;
#endif
};

Pipeline<Mine> pipeline;
