// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept AnchorModel, and the anchors of Scaffold-GS: per anchor a position, K offsets, a log scaling of six and a
// feature of D numbers (docs/spec/method.md, 1.1). The published rotation and opacity of an anchor never receive a
// gradient and are not stored. Cost: 4 (9 + 3 K + D) bytes an anchor, 284 at K = 10, D = 32; twice that again for the
// gradient, three times with Adam's moments.
//
//   expression                                    meaning                                              cost
//   typename A::Scalar, A::shape                  number type; features and offsets of an anchor       -
//   A::add_parameters(arena, rows)                the blocks of so many anchors: AnchorHandles         once
//   A::find_visible(columns, camera, lens,        fills `visible` with the rows, ascending, that a     O(rows)
//     settings, visible, workspace, executor)     view decodes; the others get no gradient from it
//
// Laws: N1 rows ascend, none twice, none beyond the table; N2 an anchor that is left out changes no bit of the others;
// N3 same list at any thread count; N4 a NaN position is not visible.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/lens_policy.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/decoder_shape.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/anchor/visibility.hpp"

namespace compmark {

template <class T = float, DecoderShape decoder_shape = DecoderShape{}>
struct ScaffoldAnchors {
  using Scalar = T;
  static constexpr DecoderShape shape = decoder_shape;

  [[nodiscard]] static AnchorHandles add_parameters(ParameterArena<T>& arena, std::size_t rows) {
    return add_anchor_blocks(arena, rows, shape);
  }
  /// The anchors whose ellipsoid of offsets meets the image; see splat/anchor/visibility.hpp.
  template <class Lens, Executor E>
  static COMPMARK_INLINE void find_visible(const AnchorColumns<const T>& columns, const Camera<T>& camera,
                                           const Lens& lens, const VisibilitySettings& settings,
                                           Buffer<std::uint32_t>& visible, VisibilityWorkspace& workspace,
                                           E& executor) {
    visible_anchors(columns, camera, settings, visible, workspace, executor, lens);
  }
};

template <class A>
concept AnchorModel = std::is_same_v<std::remove_cvref_t<decltype(A::shape)>, DecoderShape> &&
    requires(ParameterArena<typename A::Scalar>& arena, const AnchorColumns<const typename A::Scalar>& columns,
             const Camera<typename A::Scalar>& camera, const PinholeLens& lens, const VisibilitySettings& settings,
             Buffer<std::uint32_t>& visible, VisibilityWorkspace& workspace, SerialExecutor& executor) {
  { A::add_parameters(arena, std::size_t{}) } -> std::same_as<AnchorHandles>;
  A::find_visible(columns, camera, lens, settings, visible, workspace, executor);
};

}  // namespace compmark
