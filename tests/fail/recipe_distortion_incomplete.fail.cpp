// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A distortion layer of nothing but names would distort nothing.
// message: Recipe: DistortionLayer lacks add_parameters
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
  using Quantizer = AdaptiveQuantizer<float>;
#ifdef COMPMARK_MUST_FAIL
  using DistortionLayer = Empty;
#else
  using DistortionLayer = QuantizationNoise<float, 32>;
#endif
};

Pipeline<Mine> pipeline;
