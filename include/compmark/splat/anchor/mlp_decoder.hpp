// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// MlpDecoder, the GaussianDecoder of Scaffold-GS (docs/spec/method.md, 1.3, 1.5, 1.6): from each visible anchor's
// feature and view direction three small networks give the opacity, shape and colour of K Gaussians; those with
// positive opacity are handed to the rasterizer.
//   mean = x + O exp(S[0:3]),  scale = exp(S[3:6]) sigmoid(u[0:3]),  rotation = u[3:7] / |u[3:7]|,  opacity = tanh(…),
//     color = sigmoid(…)
// This file wires the fused kernels (mlp_decoder_forward.hpp, mlp_decoder_backward.hpp); ReferenceDecoder is the same
// in plain loops.
// Longer than 300 lines: forward, backward and the packed layout they share are one thing to read.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/splat/anchor/mlp_decoder_backward.hpp"
#include "compmark/splat/anchor/mlp_decoder_forward.hpp"

namespace compmark {

/// Fused decoder. T: scalar; W: lanes. Nothing allocates once the Context has seen the largest view.
/// Memory of the Context for n visible anchors and P Gaussians: 4.2 n K + 8 P bytes (float) and at most 64 partial
/// gradients of the heads.
template <class T, DecoderShape decoder_shape = DecoderShape{}, int W = native_width<T>>
class MlpDecoder {
 public:
  using Scalar = T;
  static constexpr DecoderShape shape = decoder_shape;
  using Handles = DecoderHandles<shape>;
  template <class U>
  using ParamsOf = DecoderParams<U, shape>;
  using Params = ParamsOf<T>;

  struct Settings {
    double min_distance =
        1e-12;  ///< world units; an anchor nearer to the camera has no direction and gets (0, 0, 1) (case PR9)
  };

  /// What forward leaves for backward and statistics. `visible` and `decoded` are views of the caller's list and batch:
  /// both must stay as they are until backward (a batch of colours, scales and rotations is not worth copying: 40 bytes
  /// a Gaussian, written and read).
  struct Context {
    std::span<const std::uint32_t> visible;
    GaussianColumns<const T> decoded;
    std::size_t gaussians = 0;
    std::size_t non_finite_anchors =
        0;  ///< visible anchors with a NaN or infinity among their inputs: they gave no Gaussians
    Buffer<T> opacity, opacity_sum, inverse_norm, color_bias1, bank, packed, chunk_gradients, total_gradients;
    Buffer<std::uint16_t> mask;
    Buffer<std::uint32_t> block_count, block_bad, block_row, slot;
    PerWorker<detail::DecodeForwardScratch<T, W, shape>> forward_scratch;
    PerWorker<detail::DecodeBackwardScratch<T, W, shape>> backward_scratch;
    [[nodiscard]] std::size_t memory_bytes() const {
      return opacity.capacity_bytes() + opacity_sum.capacity_bytes() + inverse_norm.capacity_bytes() +
             color_bias1.capacity_bytes() + bank.capacity_bytes() + packed.capacity_bytes() +
             chunk_gradients.capacity_bytes() + total_gradients.capacity_bytes() + mask.capacity_bytes() +
             block_count.capacity_bytes() + block_bad.capacity_bytes() + block_row.capacity_bytes() +
             slot.capacity_bytes() + forward_scratch.capacity_bytes() + backward_scratch.capacity_bytes();
    }
  };

  MlpDecoder() = default;
  explicit MlpDecoder(const Settings& settings) : settings_(settings) {}

  /// Blocks "mlp_opacity.0.weight" … of the arena; train_views sizes the appearance table where the shape has one.
  static Handles add_parameters(ParameterArena<T>& arena, std::size_t train_views) {
    return add_decoder_blocks<shape>(arena, train_views);
  }
  /// PyTorch's default initialisation of Linear, keyed by seed and block name.
  static void initialise(ParameterArena<T>& arena, const Handles& handles, std::uint64_t seed) {
    initialise_decoder<shape>(arena, handles, seed);
  }
  [[nodiscard]] static ParamsOf<const T> values(const ParameterArena<T>& arena, const Handles& handles) {
    return decoder_values<shape>(arena, handles);
  }

  /// Decodes rows `visible` of the table into `out` (resized); returns the number of Gaussians. view_index picks the
  /// embedding.
  template <Executor E>
  std::size_t forward(const AnchorColumns<const T>& anchors, std::span<const std::uint32_t> visible,
                      const std::array<double, 3>& camera_center, [[maybe_unused]] std::size_t view_index,
                      const ParameterArena<T>& arena, const Handles& handles, GaussianBatch<T>& out, Context& context,
                      E& executor) const {
    check(anchors);
    const std::size_t blocks = chunk_count(visible.size(), Layout::block);
    const auto k = static_cast<std::size_t>(shape.offsets);
    COMPMARK_ASSERT(visible.size() * k < (std::size_t{1} << 32), "MlpDecoder: more than 2^32 candidate Gaussians");
    context.visible = visible;
    context.opacity.resize(blocks * k * 16);
    context.opacity_sum.resize(blocks * 16);
    context.mask.resize(blocks * k);
    context.block_count.resize(blocks);
    context.block_bad.resize(blocks);
    context.block_row.resize(blocks + 1);
    context.forward_scratch.resize(executor.concurrency());

    detail::ForwardArguments<T, shape> arguments{};
    arguments.anchors = anchors;
    arguments.visible = visible;
    arguments.from = view_point(camera_center);
    arguments.params = values(arena, handles);
    prepare_options(arguments.params, view_index, context);
    arguments.color_bias1 = context.color_bias1.data();
    arguments.bank = context.bank.data();
    arguments.opacity = context.opacity.data();
    arguments.mask = context.mask.data();
    arguments.opacity_sum = context.opacity_sum.data();
    arguments.block_count = context.block_count.data();
    arguments.block_bad = context.block_bad.data();
    executor.for_chunks(blocks, forward_grain, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      Forward::find_gaussians(arguments, begin, end, context.forward_scratch[worker]);
    });

    context.block_row[0] = 0;
    context.non_finite_anchors = 0;
    for (std::size_t block = 0; block < blocks; ++block) {
      context.block_row[block + 1] = context.block_row[block] + context.block_count[block];
      context.non_finite_anchors += context.block_bad[block];
    }
    const std::size_t gaussians = context.block_row[blocks];
    context.gaussians = gaussians;
    out.resize(gaussians);
    context.slot.resize(gaussians);
    context.inverse_norm.resize(gaussians);
    context.decoded = std::as_const(out).columns();
    arguments.out = out.columns();
    arguments.inverse_norm = context.inverse_norm.data();
    arguments.slot = context.slot.data();
    arguments.block_row = context.block_row.data();
    executor.for_chunks(blocks, forward_grain, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      Forward::write_gaussians(arguments, begin, end, context.forward_scratch[worker]);
    });
    return gaussians;
  }

  /// Adds the gradients of all that the last forward read: rows `visible` of d_anchors and the gradients of the
  /// networks in the arena.
  template <Executor E>
  void backward(const AnchorColumns<const T>& anchors, std::span<const std::uint32_t> visible,
                const std::array<double, 3>& camera_center, [[maybe_unused]] std::size_t view_index,
                ParameterArena<T>& arena, const Handles& handles, const GaussianColumns<const T>& d_gaussians,
                const AnchorColumns<T>& d_anchors, Context& context, E& executor) const {
    check(anchors);
    COMPMARK_ASSERT(visible.size() == context.visible.size(),
                    "MlpDecoder::backward: not the anchors of the last forward");
    if (context.gaussians == 0) return;
    const std::size_t blocks = chunk_count(visible.size(), Layout::block);
    const std::size_t grain = std::max(least_backward_grain, chunk_count(blocks, most_backward_chunks));
    const std::size_t chunks = chunk_count(blocks, grain);
    const ParamsOf<const T> params = values(arena, handles);
    prepare_options(params, view_index, context);
    pack(params, context);
    context.chunk_gradients.resize(chunks * Layout::gradient_count);
    context.total_gradients.resize(Layout::gradient_count);
    context.backward_scratch.resize(executor.concurrency());

    detail::BackwardArguments<T, shape> arguments{};
    arguments.anchors = anchors;
    arguments.visible = visible;
    arguments.from = view_point(camera_center);
    arguments.packed = context.packed.data();
    arguments.bank = context.bank.data();
    arguments.opacity = context.opacity.data();
    arguments.mask = context.mask.data();
    arguments.block_row = context.block_row.data();
    arguments.gaussians = context.decoded;
    arguments.inverse_norm = context.inverse_norm.data();
    arguments.d_gaussians = d_gaussians;
    arguments.d_anchors = d_anchors;
    executor.for_chunks(blocks, grain, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      Backward::run_chunk(arguments, begin, end,
                          context.chunk_gradients.data() + begin / grain * Layout::gradient_count,
                          context.backward_scratch[worker]);
    });

    T* const total = context.total_gradients.data();
    executor.for_chunks(Layout::gradient_count, 1024, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) total[i] = context.chunk_gradients[i];
      for (std::size_t chunk = 1; chunk < chunks; ++chunk) {
        const T* const part = context.chunk_gradients.data() + chunk * Layout::gradient_count;
        for (std::size_t i = begin; i < end; ++i) total[i] += part[i];
      }
    });
    unpack(total, params, decoder_gradients<shape>(arena, handles), view_index);
  }

  /// What growing reads; valid until the next forward and as long as the list of visible anchors.
  [[nodiscard]] DecodedStatistics<T> statistics(const Context& context) const {
    return {context.visible,
            {context.opacity_sum.data(), context.visible.size()},
            {context.slot.data(), context.gaussians}};
  }

 private:
  using Layout = detail::DecoderLayout<T, W, shape>;
  using Forward = detail::ForwardKernels<T, W, shape>;
  using Backward = detail::BackwardKernels<T, W, shape>;
  static constexpr std::size_t forward_grain = 16;  // blocks: 4 panels
  static constexpr std::size_t least_backward_grain =
      64;  // blocks: 16 panels, so that zeroing and adding a chunk's gradients is small
  static constexpr std::size_t most_backward_chunks = 64;  // bounds the memory of the partial gradients

  static void check([[maybe_unused]] const AnchorColumns<const T>& anchors) {
    COMPMARK_ASSERT(anchors.feature.columns == static_cast<std::size_t>(shape.feature_dim),
                    "MlpDecoder: the table has another feature width");
    COMPMARK_ASSERT(anchors.offset.columns == 3 * static_cast<std::size_t>(shape.offsets),
                    "MlpDecoder: the table has another offset count");
  }
  [[nodiscard]] detail::ViewPoint<T> view_point(const std::array<double, 3>& center) const {
    return {center, settings_.min_distance};
  }

  /// The colour head's first bias with the view's embedding in it, and the feature bank's parameters in one piece.
  static void prepare_options(const ParamsOf<const T>& params, [[maybe_unused]] std::size_t view_index,
                              Context& context) {
    context.color_bias1.resize(static_cast<std::size_t>(shape.feature_dim));
    if constexpr (shape.appearance_dim != 0) {
      AppearanceEmbedding::fold<T>(params.color.weight1, params.color.bias1, params.appearance, view_index,
                                   context.color_bias1.data());
    } else {
      std::copy_n(params.color.bias1.data, context.color_bias1.size(), context.color_bias1.data());
    }
    if constexpr (shape.feature_bank) {
      context.bank.resize(static_cast<std::size_t>(Layout::bank_parameters));
      T* target = context.bank.data();
      for (const MatrixView<const T>& view : {params.feature_bank.weight1, params.feature_bank.bias1,
                                              params.feature_bank.weight2, params.feature_bank.bias2}) {
        target = std::copy_n(view.data, view.size(), target);
      }
    }
  }

  /// The heads in the order of lanes of the backward pass: about 10 k copies a view.
  static void pack(const ParamsOf<const T>& params, Context& context) {
    constexpr auto at = [](int n) { return static_cast<std::size_t>(n); };
    context.packed.resize(at(Layout::packed_count), T(0));
    T* const packed = context.packed.data();
    const HeadViews<const T>* const heads[3] = {&params.opacity, &params.covariance, &params.color};
    for (int head = 0; head < 3; ++head) {
      const HeadViews<const T>& from = *heads[head];
      for (int h = 0; h < Layout::width; ++h) {
        const int column = head * Layout::head_hidden + h;
        for (int i = 0; i < Layout::inputs; ++i) {
          const T weight = from.weight1(at(h), at(i));
          packed[Layout::packed_weight1 + i * Layout::hidden + column] = weight;
          if (i < Layout::width) {
            packed[Layout::packed_feature + column * Layout::feature_row + i] = weight;
          } else {
            packed[Layout::packed_view + (i - Layout::width) * Layout::hidden + column] = weight;
          }
        }
        packed[Layout::packed_weight1 + Layout::inputs * Layout::hidden + column] =
            head == 2 ? context.color_bias1[at(h)] : from.bias1(0, at(h));
        for (int o = 0; o < Layout::output_count(head); ++o) {
          packed[Layout::packed_weight2 + (Layout::output_begin(head) + o) * Layout::head_hidden + h] =
              from.weight2(at(o), at(h));
        }
      }
    }
  }

  /// Adds the sums of all chunks into the gradients of the arena.
  static void unpack(const T* total, [[maybe_unused]] const ParamsOf<const T>& params, const Params& gradients,
                     [[maybe_unused]] std::size_t view_index) {
    constexpr auto at = [](int n) { return static_cast<std::size_t>(n); };
    const HeadViews<T>* const heads[3] = {&gradients.opacity, &gradients.covariance, &gradients.color};
    for (int head = 0; head < 3; ++head) {
      const HeadViews<T>& to = *heads[head];
      const T* const d_bias1 = total + Layout::d_weight1 + Layout::inputs * Layout::hidden + head * Layout::head_hidden;
      for (int h = 0; h < Layout::width; ++h) {
        for (int i = 0; i < Layout::inputs; ++i) {
          to.weight1(at(h), at(i)) += total[Layout::d_weight1 + i * Layout::hidden + head * Layout::head_hidden + h];
        }
        to.bias1(0, at(h)) += d_bias1[h];
      }
      for (int o = 0; o < Layout::output_count(head); ++o) {
        const int row = Layout::output_begin(head) + o;
        for (int h = 0; h < Layout::width; ++h)
          to.weight2(at(o), at(h)) += total[Layout::d_weight2 + row * Layout::head_hidden + h];
        to.bias2(0, at(o)) += total[Layout::d_bias2 + row];
      }
      if constexpr (shape.appearance_dim != 0) {
        if (head == 2) {
          AppearanceEmbedding::backward<T>(params.color.weight1, params.appearance, view_index, d_bias1,
                                           gradients.color.weight1, gradients.appearance);
        }
      }
    }
    if constexpr (shape.feature_bank) {
      const T* source = total + Layout::d_bank;
      for (const MatrixView<T>& view : {gradients.feature_bank.weight1, gradients.feature_bank.bias1,
                                        gradients.feature_bank.weight2, gradients.feature_bank.bias2}) {
        for (T& value : view.flat()) value += *source++;
      }
    }
  }

  Settings settings_{};
};

}  // namespace compmark
