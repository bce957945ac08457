// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concepts of anchors: AnchorColumns is the table every policy reads; GaussianDecoder turns visible anchors
// into Gaussians; DensityControl decides which anchors are born and die.
//
//   AnchorColumns                     position [N, 3], offset [N, 3 K] (K triples x y z), scaling [N, 6] (log),
//                                     feature [N, D]; N rows are anchors
//
//   GaussianDecoder                   meaning                                                              cost
//   typename D::Scalar, D::shape      number type; the DecoderShape of the anchors that it reads           -
//   typename D::Handles, D::Context   its blocks; what forward leaves for backward, and scratch            -
//   D::add_parameters(arena, views)   its blocks; D::initialise(arena, blocks, seed)                       once
//   d.forward(anchors, visible,       fills `batch` with the Gaussians of the rows `visible` whose         O(n K D)
//     center, view, arena, blocks,    opacity is positive, and returns how many; `center` is the camera's,
//     batch, context, executor)       `view` the photograph that is rendered, or unseen_view
//   d.backward(anchors, visible,      ADDS into rows `visible` of the gradient columns, and into the       twice
//     center, view, arena, blocks,    gradients of its blocks, after forward with the same arguments       forward
//     d_gaussians, d_anchors,
//     context, executor)
//   d.statistics(context)             DecodedStatistics of the last forward pass                           O(1)
//
// Laws: A1 gradient law in double; A2 an anchor that is not in `visible` gets exactly zero gradient; A3 same bits at
// any thread count; A4 the count of Gaussians equals the count of positive opacities, and gaussian_slot names each
// once; A5 keep and append move all columns and moments in step.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// Views of the anchor table (or of its gradients). All four have the same number of rows.
template <class T>
struct AnchorColumns {
  MatrixView<T> position;  // [N, 3]     world units
  MatrixView<T> offset;    // [N, 3 K]   in units of exp(scaling[0:3]); component (k, axis) is column 3 k + axis
  MatrixView<T>
      // [N, 6] log; first three: scale of the offsets and of the prefilter ellipsoid; last three: base scale
      scaling;
  MatrixView<T> feature;  // [N, D]

  [[nodiscard]] std::size_t rows() const { return position.rows; }
  constexpr operator AnchorColumns<const T>()
      const  // NOLINT(google-explicit-constructor): a view to const is always safe
      requires(!std::is_const_v<T>) {
    return {position, offset, scaling, feature};
  }
};

/// An attribute of an anchor. Scaling is the stored logarithm; offsets are in units of the base scale.
enum class AnchorAttribute : std::uint8_t { feature, position, scaling, offset };

/// What growth needs to know of one rendered view (the published statistics: docs/spec/method.md, 4.1).
template <class T>
struct DecodedStatistics {
  std::span<const std::uint32_t> visible;        ///< anchor rows that were decoded, n of them
  std::span<const T> opacity_sum;                ///< [n] sum over K of max(opacity, 0)
  std::span<const std::uint32_t> gaussian_slot;  ///< [P] anchor row * K + k of each Gaussian of the batch
};

template <class D>
concept GaussianDecoder = requires(const D& decoder, ParameterArena<typename D::Scalar>& arena,
                                   const ParameterArena<typename D::Scalar>& read, const typename D::Handles& blocks,
                                   const AnchorColumns<const typename D::Scalar>& anchors,
                                   const AnchorColumns<typename D::Scalar>& d_anchors,
                                   std::span<const std::uint32_t> visible, const std::array<double, 3>& center,
                                   GaussianBatch<typename D::Scalar>& batch,
                                   const GaussianColumns<const typename D::Scalar>& d_gaussians,
                                   typename D::Context& context, SerialExecutor& executor) {
  D::shape;
  { D::add_parameters(arena, std::size_t{}) } -> std::same_as<typename D::Handles>;
  D::initialise(arena, blocks, std::uint64_t{});
  {
    decoder.forward(anchors, visible, center, std::size_t{}, read, blocks, batch, context, executor)
    } -> std::convertible_to<std::size_t>;
  decoder.backward(anchors, visible, center, std::size_t{}, arena, blocks, d_gaussians, d_anchors, context, executor);
  { decoder.statistics(context) } -> std::same_as<DecodedStatistics<typename D::Scalar>>;
};

}  // namespace compmark
