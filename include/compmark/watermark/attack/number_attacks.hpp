// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on the numbers of a model (attack_list.hpp): fewer bits of a mantissa, places that are shaken, and the colour
// network's last biases, which change all colours and cost a thief nothing. ModelAttacks (model_attacks.hpp) has them
// in its list. Cost: a pass over what they change.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/watermark/attack/attack_list.hpp"

namespace compmark {

namespace detail {
/// Moves the anchors from row `first` on by normal numbers of this deviation along each axis, in units of each anchor's
/// extent, exp(scaling[0:3]). What would not be finite stays; so does a model without places or extents.
inline void move_anchors(ParameterArena<float>& arena, std::size_t first, double deviation, const Random& random) {
  const AnchorHandles handles = find_anchor_blocks(arena.layout());
  if (!handles.position.valid() || !handles.scaling.valid()) return;
  const MatrixView<float> position = arena.values(handles.position), scaling = arena.values(handles.scaling);
  for (std::size_t row = first; row < position.rows; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double extent = std::exp(static_cast<double>(scaling(row, axis)));
      const float there = position(row, axis) + static_cast<float>(deviation * extent * random.normal(3 * row + axis));
      if (std::isfinite(there)) position(row, axis) = there;
    }
  }
}
}  // namespace detail

/// Half precision keeps 10 bits, bfloat16 keeps 7; exponents stay as they are. To the nearest, ties to even.
struct MantissaAttack {
  static constexpr std::string_view name = "mantissa";
  static constexpr AttackAmount amount{10, 0, 23, "the bits of the mantissa that are kept, a whole number"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double bits, std::uint64_t /*seed*/) {
    const auto lost = static_cast<std::uint32_t>(23 - std::lround(bits));
    if (lost == 0) return Done{};
    for (const ArenaLayout::Block& block : arena.layout().blocks()) {
      if (block.role != BlockRole::rendering) continue;
      float* const values = arena.all_values().data() + block.offset;
      for (std::size_t i = 0; i < block.size(); ++i) {
        auto word = std::bit_cast<std::uint32_t>(values[i]);
        word += (std::uint32_t{1} << (lost - 1)) - 1 + (word >> lost & 1u);
        const float rounded = std::bit_cast<float>(word >> lost << lost);
        if (std::isfinite(rounded)) values[i] = rounded;
      }
    }
    return Done{};
  }
};

/// Positions of anchors are moved by normal numbers, in units of each anchor's extent, exp(scaling[0:3]).
struct JitterAttack {
  static constexpr std::string_view name = "jitter";
  static constexpr AttackAmount amount{0.05, 0, 10, "the deviation of the moves, in extents of an anchor"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double deviation, std::uint64_t seed) {
    detail::move_anchors(arena, 0, deviation, Random(seed, 0, random_stage("attack/jitter")));
    return Done{};
  }
};

/// The same is added to every last bias of the colour network. A model without one stays as it is.
struct ColourBiasAttack {
  static constexpr std::string_view name = "bias";
  static constexpr AttackAmount amount{0.1, -4, 4, "what is added to the last biases of the colour network"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double added, std::uint64_t /*seed*/) {
    const BlockHandle bias = arena.layout().find("mlp_color.2.bias");
    if (!bias.valid()) return Done{};
    for (float& value : arena.values(bias).flat()) value += static_cast<float>(added);
    return Done{};
  }
};

}  // namespace compmark
