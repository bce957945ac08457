// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concepts of the mark room: an Embedder adds the watermark feature to the anchor feature, a MessageDecoder reads the
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
#pragma once

#include <concepts>
#include <span>

#include "compmark/core/absent.hpp"
#include "compmark/core/executor.hpp"
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
template <class D>
concept Embedder = D::is_absent || requires {
  typename D::Settings;
};

}  // namespace compmark
