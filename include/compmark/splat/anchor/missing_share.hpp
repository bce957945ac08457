// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Gaussians that stand in for others that are gone. A model that lost a share s of its anchors at random lets light
// through from behind. What is left is drawn on 1 / (1 - s) times the area and as 1 / (1 - s) times as many layers of
// itself, so that together it covers what the whole did:
//   scale' = scale (1 - s)^-1/2        opacity' = 1 - (1 - opacity)^(1 / (1 - s))
// A message is read better from such renders of a pruned model (docs/verification.md). No picture is repaired by it: it
// is blurred where nothing was lost. There is no backward pass: a mark that was learned with what is left enlarged was read no
// better (docs/notebook/watermark_experiments.md).
// Cost: a power a Gaussian.
#pragma once

#include <cmath>
#include <cstddef>

#include "compmark/core/gaussians.hpp"

namespace compmark {

/// Changes scale and opacity as above; `share` in [0, 1), 0 changes no bit. Rows that are not drawn stay so.
template <class T>
void make_up_for_missing(const GaussianColumns<T>& gaussians, double share) {
  if (!(share > 0)) return;
  const T larger = static_cast<T>(1 / std::sqrt(1 - share)), layers = static_cast<T>(1 / (1 - share));
  for (T* const scale : gaussians.scale) {
    for (std::size_t p = 0; p < gaussians.count; ++p) scale[p] *= larger;
  }
  for (std::size_t p = 0; p < gaussians.count; ++p) {
    T& opacity = gaussians.opacity[p];
    // log1p: 1 - opacity loses the last bits of small opacities, which are most.
    if (opacity > T(0)) opacity = opacity < T(1) ? -std::expm1(layers * std::log1p(-opacity)) : T(1);
  }
}

}  // namespace compmark
