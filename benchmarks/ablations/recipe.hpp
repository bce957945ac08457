// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The recipe of the ablations: HAC as the base, with everything that the method adds and every part of it switched at
// run time, so that one type a target attribute is compiled. What remains of a training is a model of the base recipe,
// which the codec writes and reads.
#pragma once

#include "ablations/switched_noise.hpp"
#include "compmark/codec/hac/hash_grid_layout.hpp"
#include "compmark/recipes/hac.hpp"
#include "compmark/splat/anchor/frequency_growth.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/embed/residual.hpp"
#include "compmark/watermark/loss/frequency.hpp"
#include "compmark/watermark/loss/hsv.hpp"

namespace ablation {

/// A fifth of the published grid: scenes of a few thousand anchors.
inline constexpr compmark::HashGridShape grid{.volume_levels = 8,
                                              .volume_cap_log2 = 12,
                                              .plane_resolution = {66, 130, 258, 514},
                                              .plane_levels = 2,
                                              .plane_cap_log2 = 13};

using Plain = compmark::recipes::WithShape<compmark::recipes::Scaffold, compmark::recipes::coded_shape>;
struct Base : compmark::recipes::Hac<Plain, grid> {};
using Decoder = compmark::LatticeDecoder<float>;

template <compmark::AnchorAttribute target>
struct Ablated : Base {
  using Base = ablation::Base;
  using EntropyModel = SwitchedNoise<ablation::Base::EntropyModel>;
  using DensityControl = compmark::FrequencyGrowth<float>;
  using Embedder = compmark::BoundedResidual<float, target>;
  using MessageDecoder = Decoder;
  using HsvLoss = compmark::HsvLoss<float>;
  using FrequencyLoss = compmark::FrequencyLoss<float>;
};

}  // namespace ablation
