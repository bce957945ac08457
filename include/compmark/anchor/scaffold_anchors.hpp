// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// AnchorModel policy of Scaffold-GS: per anchor a position, K offsets, a log scaling of six and a feature of D numbers
// (docs/spec/method.md, 1.1). The published rotation and opacity of an anchor never receive a gradient and are not
// stored. Cost: 4 (9 + 3 K + D) bytes an anchor, 284 at K = 10, D = 32; twice that again for the gradient, three times
// with Adam's moments.
#pragma once

#include <type_traits>

#include "compmark/anchor/decoder_shape.hpp"

namespace compmark {

template <class T = float, DecoderShape decoder_shape = DecoderShape{}>
struct ScaffoldAnchors {
  using Scalar = T;
  static constexpr DecoderShape shape = decoder_shape;
};

template <class A>
concept AnchorModel = requires {
  typename A::Scalar;
}
&&std::is_same_v<std::remove_cvref_t<decltype(A::shape)>, DecoderShape>;

}  // namespace compmark
