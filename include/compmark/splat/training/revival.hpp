// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A training that dies, and how it is brought back (docs/numerics.md, "A training can die"). A Gaussian whose opacity
// is 0 or less is not drawn and gets no gradient. Where the first steps make all of them transparent, nothing changes
// any more once the optimiser's momentum is spent. Then the head of the opacities begins anew: first values keyed by
// seed and iteration, with every other output's bias above 0, so that half of the Gaussians are drawn again, and no
// moments. What was learned of colour and shape stays, and is why the second beginning is gentler than the first. Cost
// of the check: a comparison an iteration.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "compmark/core/parameters.hpp"
#include "compmark/splat/anchor/decoder_parameters.hpp"

namespace compmark {

/// How near to death a training is. Part of its state: a resumed run counts on.
struct Revival {
  std::int64_t empty = 0;     ///< renders in a row in which no Gaussian was drawn, of views that see anchors
  std::int64_t revivals = 0;  ///< so often opacities were set anew

  /// After so many the training is dead: Adam's first moment has lost 96 % of the last gradient (0.9^30), and what it
  /// still moves brings nothing back.
  static constexpr std::int64_t patience = 30;

  /// Counts a render and says whether the training is dead.
  bool count(std::size_t visible_anchors, std::size_t gaussians) {
    if (gaussians != 0) {
      empty = 0;
    } else if (visible_anchors != 0) {
      ++empty;
    }
    return empty >= patience;
  }

  friend bool operator==(const Revival&, const Revival&) = default;
};

/// Whether a decoder has opacities that can be set anew. Those that are never 0 (ExplicitDecoder) need it not.
template <class Handles>
inline constexpr bool has_opacity_head = requires(const Handles& handles) {
  handles.opacity.weight1;
  handles.opacity.bias2;
};

/// Sets the opacities anew: first values of iteration t, and moments of an optimiser that can forget a block. Cost: the
/// head's parameters.
template <class T, class Handles, class OptimizerState>
void renew_opacities(ParameterArena<T>& arena, const Handles& handles, OptimizerState& optimizer, std::uint64_t seed,
                     std::int64_t t) requires(has_opacity_head<Handles>) {
  const HeadHandles& head = handles.opacity;
  detail::initialise_head(arena, head, seed, static_cast<std::uint64_t>(t));
  std::size_t output = 0;
  for (T& bias : arena.values(head.bias2).flat()) bias = std::copysign(bias, output++ % 2 == 0 ? T(1) : T(-1));
  if constexpr (requires { forget_block(arena.layout(), head.weight1, optimizer); }) {
    for (const BlockHandle block : {head.weight1, head.bias1, head.weight2, head.bias2})
      forget_block(arena.layout(), block, optimizer);
  }
}

}  // namespace compmark
