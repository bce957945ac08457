// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concepts of the quant room, two faces of one step: a Quantizer rounds, a DistortionLayer adds the noise that stands
// in for rounding while training. Here are the concepts and the absent types, so that every recipe names them.
#pragma once

#include "compmark/core/absent.hpp"

namespace compmark {

/// No noise in training: costs nothing and leaves no trace.
struct NoDistortion : Absent<NoDistortion> {};
/// Attributes are stored as they are.
struct NoQuantizer : Absent<NoQuantizer> {};

template <class Q>
concept Quantizer = Q::is_absent || requires {
  typename Q::Settings;
};
template <class D>
concept DistortionLayer = D::is_absent || requires {
  typename D::Settings;
};

}  // namespace compmark
