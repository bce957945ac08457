// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The numbers of the anchor model that the compiler needs: widths of the table's columns and of the three heads, and
// which optional inputs exist. A structural type, so that it is a template argument; an option that is off leaves no
// member, parameter or branch.
#pragma once

#include <cstddef>

namespace compmark {

/// Shape of an anchor and of its decoder. Defaults are those of Scaffold-GS (docs/spec/method.md, 1.3 and 8).
struct DecoderShape {
  int feature_dim = 32;       ///< D, also the hidden width of every head
  int offsets = 10;           ///< K, candidate Gaussians of an anchor
  bool distance = false;      ///< the heads also see the distance from camera to anchor (world units)
  bool feature_bank = false;  ///< view-dependent mixture of the feature at three resolutions; needs D divisible by 4
  int appearance_dim = 0;     ///< width of the per-view embedding that the colour head sees; 0: none

  /// Inputs of the opacity and the covariance head: feature, direction, distance.
  [[nodiscard]] constexpr int head_inputs() const { return feature_dim + 3 + (distance ? 1 : 0); }
  /// Inputs of the colour head: those of the others, then the appearance of the view.
  [[nodiscard]] constexpr int color_inputs() const { return head_inputs() + appearance_dim; }
  [[nodiscard]] constexpr bool valid() const {
    return feature_dim > 0 && offsets > 0 && appearance_dim >= 0 && (!feature_bank || feature_dim % 4 == 0);
  }
  friend constexpr bool operator==(const DecoderShape&, const DecoderShape&) = default;
};

}  // namespace compmark
