// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Trained parameters of the Gaussian decoder: three heads Linear -> ReLU -> Linear (docs/spec/method.md, 1.3) and, if
// the shape has them, the feature bank's network and the table of appearance embeddings. Blocks of the arena are named
// as PyTorch's Sequential names them.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>

#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/splat/anchor/appearance.hpp"
#include "compmark/splat/anchor/decoder_shape.hpp"
#include "compmark/splat/anchor/feature_bank.hpp"

namespace compmark {

/// Linear -> ReLU -> Linear: "NAME.0.weight" [D, in], "NAME.0.bias" [1, D], "NAME.2.weight" [out, D], "NAME.2.bias" [1,
/// out].
struct HeadHandles {
  BlockHandle weight1, bias1, weight2, bias2;
};
template <class T>
struct HeadViews {
  MatrixView<T> weight1, bias1, weight2, bias2;
};

namespace detail {
struct NoBankHandles {};
struct NoEmbeddingHandle {};
}  // namespace detail

/// Blocks of a decoder of this shape.
template <DecoderShape shape>
struct DecoderHandles {
  HeadHandles opacity;     ///< "mlp_opacity"     out K, tanh
  HeadHandles covariance;  ///< "mlp_covariance"  out 7 K, linear; row 7 k + (0–2 scale logits, 3–6 quaternion w x y z)
  HeadHandles color;       ///< "mlp_color"       out 3 K, sigmoid
  [[no_unique_address]] std::conditional_t<shape.feature_bank, HeadHandles, detail::NoBankHandles>
      feature_bank;  ///< "feature_bank"
  [[no_unique_address]] std::conditional_t<shape.appearance_dim != 0, BlockHandle, detail::NoEmbeddingHandle>
      appearance;  ///< [views, A]
};

/// The same as views: of values (T const) or gradients.
template <class T, DecoderShape shape>
struct DecoderParams {
  HeadViews<T> opacity, covariance, color;
  [[no_unique_address]] std::conditional_t<shape.feature_bank, HeadViews<T>, detail::NoBankHandles> feature_bank;
  [[no_unique_address]] std::conditional_t<shape.appearance_dim != 0, MatrixView<T>, detail::NoEmbeddingHandle>
      appearance;
};

namespace detail {

template <class T>
HeadHandles add_head(ParameterArena<T>& arena, const std::string& name, int inputs, int hidden, int outputs,
                     const LearningSchedule& schedule) {
  const auto size = [](int n) { return static_cast<std::size_t>(n); };
  HeadHandles head;
  head.weight1 =
      arena.add(name + ".0.weight", size(hidden), size(inputs), RowKind::fixed, BlockRole::rendering, schedule);
  head.bias1 = arena.add(name + ".0.bias", 1, size(hidden), RowKind::fixed, BlockRole::rendering, schedule);
  head.weight2 =
      arena.add(name + ".2.weight", size(outputs), size(hidden), RowKind::fixed, BlockRole::rendering, schedule);
  head.bias2 = arena.add(name + ".2.bias", 1, size(outputs), RowKind::fixed, BlockRole::rendering, schedule);
  return head;
}

/// PyTorch's default for Linear: weights and biases uniform in +-1 / sqrt(fan_in). `iteration` is above 0 where a head
/// begins anew.
template <class T>
void initialise_head(ParameterArena<T>& arena, const HeadHandles& head, std::uint64_t seed,
                     std::uint64_t iteration = 0) {
  const auto fill = [&](BlockHandle handle, std::size_t fan_in) {
    const double bound = 1 / std::sqrt(static_cast<double>(fan_in));
    const Random random(seed, iteration, random_stage(arena.layout().block(handle).name));
    std::size_t index = 0;
    for (T& value : arena.values(handle).flat()) value = static_cast<T>(bound * (2 * random.uniform(index++) - 1));
  };
  const std::size_t inputs = arena.layout().block(head.weight1).columns;
  const std::size_t hidden = arena.layout().block(head.weight2).columns;
  fill(head.weight1, inputs);
  fill(head.bias1, inputs);
  fill(head.weight2, hidden);
  fill(head.bias2, hidden);
}

template <class U, DecoderShape shape, class Pick>
DecoderParams<U, shape> decoder_views(const DecoderHandles<shape>& handles, const Pick& pick) {
  const auto head = [&](const HeadHandles& h) {
    return HeadViews<U>{pick(h.weight1), pick(h.bias1), pick(h.weight2), pick(h.bias2)};
  };
  DecoderParams<U, shape> params;
  params.opacity = head(handles.opacity);
  params.covariance = head(handles.covariance);
  params.color = head(handles.color);
  if constexpr (shape.feature_bank) params.feature_bank = head(handles.feature_bank);
  if constexpr (shape.appearance_dim != 0) params.appearance = pick(handles.appearance);
  return params;
}

}  // namespace detail

/// Adds all blocks of a decoder; train_views is the number of rows of the appearance table (unused without it).
template <DecoderShape shape, class T>
DecoderHandles<shape> add_decoder_blocks(ParameterArena<T>& arena, [[maybe_unused]] std::size_t train_views) {
  static_assert(shape.valid(), "DecoderShape: widths are positive and a feature bank needs feature_dim divisible by 4");
  DecoderHandles<shape> handles;
  const int d = shape.feature_dim;
  handles.opacity = detail::add_head(arena, "mlp_opacity", shape.head_inputs(), d, shape.offsets, {0.002, 0.00002});
  handles.covariance = detail::add_head(arena, "mlp_covariance", shape.head_inputs(), d, 7 * shape.offsets,
                                        LearningSchedule::constant(0.004));
  handles.color = detail::add_head(arena, "mlp_color", shape.color_inputs(), d, 3 * shape.offsets, {0.008, 0.00005});
  if constexpr (shape.feature_bank)
    handles.feature_bank = detail::add_head(arena, "feature_bank", 4, d, 3, {0.01, 0.00001});
  if constexpr (shape.appearance_dim != 0) {
    COMPMARK_ASSERT(train_views > 0, "add_decoder_blocks: an appearance embedding needs at least one view");
    handles.appearance = arena.add("appearance", train_views, static_cast<std::size_t>(shape.appearance_dim),
                                   RowKind::fixed, BlockRole::rendering, {0.05, 0.0005});
  }
  return handles;
}

/// PyTorch's default initialisation; embeddings standard normal. A pure function of the seed and the block's name.
template <DecoderShape shape, class T>
void initialise_decoder(ParameterArena<T>& arena, const DecoderHandles<shape>& handles, std::uint64_t seed) {
  detail::initialise_head(arena, handles.opacity, seed);
  detail::initialise_head(arena, handles.covariance, seed);
  detail::initialise_head(arena, handles.color, seed);
  if constexpr (shape.feature_bank) detail::initialise_head(arena, handles.feature_bank, seed);
  if constexpr (shape.appearance_dim != 0) {
    const Random random(seed, 0, random_stage("appearance"));
    std::size_t index = 0;
    for (T& value : arena.values(handles.appearance).flat()) value = static_cast<T>(random.normal(index++));
  }
}

template <DecoderShape shape, class T>
[[nodiscard]] DecoderParams<const T, shape> decoder_values(const ParameterArena<T>& arena,
                                                           const DecoderHandles<shape>& handles) {
  return detail::decoder_views<const T, shape>(handles, [&](BlockHandle handle) { return arena.values(handle); });
}
template <DecoderShape shape, class T>
[[nodiscard]] DecoderParams<T, shape> decoder_gradients(ParameterArena<T>& arena,
                                                        const DecoderHandles<shape>& handles) {
  return detail::decoder_views<T, shape>(handles, [&](BlockHandle handle) { return arena.gradients(handle); });
}

}  // namespace compmark
