// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concepts of the mark room: an Embedder adds the watermark feature to the anchor feature, a MessageDecoder reads the bits from a render.
// The stages come with the watermark issue; here are the door and the absent types.
#pragma once

#include "compmark/core/absent.hpp"

namespace compmark::inline v0 {

/// The anchor feature goes to the decoder as it is.
struct NoEmbedder : Absent<NoEmbedder> {};
/// Nothing is read from the render.
struct NoMessageDecoder : Absent<NoMessageDecoder> {};

template <class D>
concept MessageDecoder = D::is_absent || requires {
  D::bits;
};
template <class D>
concept Embedder = D::is_absent || requires {
  typename D::Settings;
};

}  // namespace compmark::inline v0
