// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concepts of anchors: AnchorColumns is the table every policy reads; GaussianDecoder turns visible anchors
// into Gaussians; DensityControl decides which anchors are born and die.
//
//   AnchorColumns  position [N, 3], offset [N, 3 K] (K triples x y z), scaling [N, 6] (log), feature [N, D]; N rows are
//                  anchors
//   d.forward(…)   reads rows `visible` of the table, fills a GaussianBatch with the Gaussians whose opacity is
//                  positive, in the order (block of 16 visible anchors, offset k, anchor); fills Context  O(n K D)
//   d.backward(…)  ADDS into the gradient columns (rows `visible` only) and into the networks' gradients
//
// Laws: A1 gradient law in double; A2 an anchor that is not in `visible` gets exactly zero gradient; A3 same bits at
// any thread count; A4 the count of Gaussians equals the count of positive opacities; A5 keep and append move all
// columns and moments in step.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "compmark/core/views.hpp"

namespace compmark {

/// Views of the anchor table (or of its gradients). All four have the same number of rows.
template <class T>
struct AnchorColumns {
  MatrixView<T> position;  // [N, 3]     world units
  MatrixView<T> offset;    // [N, 3 K]   in units of exp(scaling[0:3]); component (k, axis) is column 3 k + axis
  MatrixView<T>
      // [N, 6] log; first three: extent of the offsets and of the prefilter ellipsoid; last three: base scale
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

}  // namespace compmark
