// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concepts of the watermark: an Embedder adds the watermark feature to the anchor feature, a MessageDecoder reads the
// bits from a render. A decoder is frozen: it has a gradient with respect to the image and none to its own weights.
//
//   MessageDecoder                                    meaning                                                 cost
//   typename D::Scalar, D::Context                    number type; what forward leaves for backward, and      -
//                                                     scratch
//   d.bits()                                          length of the message (static constexpr or a member)    O(1)
//   d.minimum_size()                                  smallest side of an image that it reads                 O(1)
//   d.forward(image, logits, context, executor)       fills bits() logits of an RGB image in [0, 1]; bit i
//                                                     is logit i > 0 a network
//   d.backward(d_logits, d_image, context, executor)  ADDS dL/dimage, after the forward of the same context   a network
//
// Laws (testing/mark_laws.hpp): D1 the gradient agrees with central differences in double; D2 backward adds, and adds
// exact zeros for zero d_logits; D3 same bits at any thread count; D4 a NaN pixel makes every logit NaN or is refused
// by an assertion, never a guess; D5 any image of at least minimum_size() a side is read, odd sizes too; D6 forward
// twice in one context gives the same bits.
//
//   Embedder                                               meaning                                            cost
//   typename E::Scalar, E::Handles, E::Context             number type, its blocks, scratch                   -
//   E::target                                              which attribute of an anchor carries the mark      -
//   E::add_parameters(arena, rows, columns)                its block, as wide as that attribute               once
//   blocks.residual                                        the block                                          -
//   E::forward(plain, residual, rows, marked, context,     fills the listed rows of the marked attribute      a row
//     executor)
//   E::backward(d_marked, rows, d_residual, context,       ADDS the residual's gradient; that of the          a row
//     executor)                                            attribute itself is d_marked
//   E::bake(plain, residual)                               plain becomes marked, to the bit; nothing is left  a table
#pragma once

#include <concepts>
#include <cstddef>
#include <span>

#include "compmark/core/absent.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// No Embedder: the heads read the anchor feature unchanged.
struct NoEmbedder : Absent<NoEmbedder> {};
/// No MessageDecoder: nothing is read from the render.
struct NoMessageDecoder : Absent<NoMessageDecoder> {};

template <class D>
concept MessageDecoder = D::is_absent ||
    requires(const D& decoder, ImageView<const typename D::Scalar> image, std::span<typename D::Scalar> logits,
             std::span<const typename D::Scalar> d_logits, ImageView<typename D::Scalar> d_image,
             typename D::Context& context, SerialExecutor& executor) {
  { decoder.bits() } -> std::convertible_to<int>;
  { decoder.minimum_size() } -> std::convertible_to<int>;
  decoder.forward(image, logits, context, executor);
  decoder.backward(d_logits, d_image, context, executor);
};
template <class E>
concept Embedder = E::is_absent ||
    requires(ParameterArena<typename E::Scalar>& arena, const typename E::Handles& blocks,
             MatrixView<const typename E::Scalar> plain, MatrixView<typename E::Scalar> table,
             std::span<const std::uint32_t> rows, typename E::Context& context, SerialExecutor& executor) {
  E::target;
  { E::add_parameters(arena, std::size_t{}, std::size_t{}) } -> std::same_as<typename E::Handles>;
  { blocks.residual } -> std::convertible_to<BlockHandle>;
  E::forward(plain, plain, rows, table, context, executor);
  E::backward(plain, rows, table, context, executor);
  E::bake(table, table);
};

}  // namespace compmark
