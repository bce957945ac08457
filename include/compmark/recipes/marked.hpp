// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recipes with a watermark: any recipe, and the stages that put a message into its anchors. The model that is stored is the host's: the mark
// is baked into the features, and who reads the file needs no recipe of this page (baked_host).
//
//   Marked<Host, Decoder>            f^w = f + tanh f', message read by Decoder, loss of saturated colours
//   MarkedForCompression<…>          the same with the noise of quantization while training, so that the message survives a codec
#pragma once

#include <algorithm>
#include <cstddef>

#include "compmark/loss/hsv.hpp"
#include "compmark/mark/residual.hpp"
#include "compmark/pipeline/model.hpp"
#include "compmark/quant/adaptive_quantizer.hpp"
#include "compmark/quant/distortion.hpp"
#include "compmark/recipes/scaffold.hpp"

namespace compmark::inline v0 {

namespace recipes {

/// CompMarkGS on `HostRecipe`, without its distortion layer.
template <class HostRecipe, class Decoder>
struct Marked : HostRecipe {
  using Host = HostRecipe;
  using Embedder = ResidualFeature<typename HostRecipe::Scalar>;
  using MessageDecoder = Decoder;
  using HsvLoss = compmark::HsvLoss<typename HostRecipe::Scalar>;
};

/// CompMarkGS on `HostRecipe`.
template <class HostRecipe, class Decoder, DistortionOptions distortion_options = DistortionOptions{}>
struct MarkedForCompression : Marked<HostRecipe, Decoder> {
  using Quantizer = AdaptiveQuantizer<typename HostRecipe::Scalar>;
  using DistortionLayer = QuantizationNoise<typename HostRecipe::Scalar, HostRecipe::AnchorModel::shape.feature_dim,
                                            distortion_options, Quantizer>;
};

}  // namespace recipes

/// The model of the host alone, without the mark: where the residual trained beside it (MarkNumbers::fidelity), what a run without a mark ends with.
template <Recipe R>
[[nodiscard]] Model<typename R::Host> host_alone(const Model<R>& marked) {
  using Scalar = typename R::Scalar;
  Model<typename R::Host> host;
  host.create(marked.anchor_count(), marked.train_views);
  host.render = marked.render;
  host.voxel_size = marked.voxel_size;
  for (const ArenaLayout::Block& block : host.arena.layout().blocks()) {
    const BlockHandle source = marked.arena.layout().find(block.name);
    COMPMARK_ASSERT(source.valid() && marked.arena.layout().block(source).size() == block.size(),
                    "host_alone: the host has a block that the marked model has not");
    const MatrixView<const Scalar> values = marked.arena.values(source);
    std::copy_n(values.data, block.size(), host.arena.all_values().data() + block.offset);
  }
  return host;
}

/// The model of the host with the mark baked into its anchors: it renders the same bits as `marked` does outside of training.
template <Recipe R>
[[nodiscard]] Model<typename R::Host> baked_host(const Model<R>& marked) {
  Model<R> baked = marked;
  Model<R>::Road::bake(baked.arena, baked.anchors, baked.road);
  return host_alone(baked);
}

/// The other way: a finished model of the host with room for a mark (zero yet) and fresh networks of the stages, to be trained on.
template <Recipe R>
[[nodiscard]] Model<R> with_room_for_mark(const Model<typename R::Host>& host, std::uint64_t seed) {
  using Scalar = typename R::Scalar;
  Model<R> marked;
  marked.create(host.anchor_count(), host.train_views);
  marked.render = host.render;
  marked.voxel_size = host.voxel_size;
  Model<R>::Road::initialise(marked.arena, marked.road, seed);
  for (const ArenaLayout::Block& block : host.arena.layout().blocks()) {
    const MatrixView<Scalar> values = marked.arena.values(marked.arena.layout().find(block.name));
    std::copy_n(host.arena.all_values().data() + block.offset, block.size(), values.data);
  }
  return marked;
}

}  // namespace compmark::inline v0
