// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on the numbers of a model (attack_list.hpp): noise on them, fewer bits of each, places that are shaken, and
// the colour network's last biases, which change all colours and cost a thief nothing. ModelAttacks (model_attacks.hpp)
// has them in its list. Cost: a pass or two over what they change.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/half.hpp"
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
/// use(block, values) for each block that a render reads; values [rows, columns] may be changed.
template <class Use>
void each_rendered(ParameterArena<float>& arena, const Use& use) {
  for (const ArenaLayout::Block& block : arena.layout().blocks()) {
    if (block.role == BlockRole::rendering && block.size() > 0)
      use(block, MatrixView<float>{arena.all_values().data() + block.offset, block.rows, block.columns});
  }
}
/// Adds normal numbers, a stream a block; what would not be finite stays.
inline void add_noise(const ArenaLayout::Block& block, MatrixView<float> values, double deviation, std::uint64_t seed) {
  const Random random(seed, 0, random_stage(block.name));
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float there = values.data[i] + static_cast<float>(deviation * random.normal(i));
    if (std::isfinite(there)) values.data[i] = there;
  }
}
/// Of the values from their mean.
[[nodiscard]] inline double deviation_of(MatrixView<const float> values) {
  const double count = static_cast<double>(values.size());
  double mean = 0, squares = 0;
  for (std::size_t i = 0; i < values.size(); ++i) mean += static_cast<double>(values.data[i]) / count;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double d = static_cast<double>(values.data[i]) - mean;
    squares += d * d / count;
  }
  return std::sqrt(squares);
}
/// With `lost` of the 23 bits of its mantissa rounded away, to the nearest, ties to even; 0 to 23.
[[nodiscard]] inline float rounded_mantissa(float value, std::uint32_t lost) {
  if (lost == 0) return value;
  auto word = std::bit_cast<std::uint32_t>(value);
  word += (std::uint32_t{1} << (lost - 1)) - 1 + (word >> lost & 1u);
  return std::bit_cast<float>(word >> lost << lost);
}
/// IEEE binary16 of a number, with its subnormal numbers; what it cannot hold is held at its largest.
[[nodiscard]] inline float rounded_to_half(float value) {
  return half_to_float(float_to_half(std::clamp(value, -65504.0f, 65504.0f)));
}
/// `count` numbers, `stride` apart, to 16 levels between the least and the greatest, zero among them, as Int8Quantizer
/// rounds to 256.
inline void round_to_16_levels(float* values, std::size_t count, std::size_t stride) {
  double low = 0, high = 0;
  for (std::size_t i = 0; i < count; ++i) {
    low = std::min(low, static_cast<double>(values[i * stride]));
    high = std::max(high, static_cast<double>(values[i * stride]));
  }
  const double scale = std::max((high - low) / 15, 0x1p-23);
  const double zero = std::clamp(-8 - std::nearbyint(low / scale), -8.0, 7.0);
  for (std::size_t i = 0; i < count; ++i) {
    float& value = values[i * stride];
    value = static_cast<float>(
        (std::clamp(std::nearbyint(static_cast<double>(value) / scale) + zero, -8.0, 7.0) - zero) * scale);
  }
}
}  // namespace detail

/// Noise on what anchors hold, in units of the deviation of each tensor from its mean.
struct AnchorNoiseAttack {
  static constexpr std::string_view name = "noise";
  static constexpr AttackAmount amount{0.01, 0, 1, "the deviation of the noise, as a share of a tensor's own"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double share, std::uint64_t seed) {
    detail::each_rendered(arena, [&](const ArenaLayout::Block& block, MatrixView<float> values) {
      if (block.kind == RowKind::anchor) detail::add_noise(block, values, share * detail::deviation_of(values), seed);
    });
    return Done{};
  }
};

/// The paper's "Gaussian noise with sigma = 0.005 on all model parameters": the same for positions, features and
/// weights of networks, whatever their size.
struct ParameterNoiseAttack {
  static constexpr std::string_view name = "parameter_noise";
  static constexpr AttackAmount amount{0.005, 0, 1, "the deviation of the noise on every number that renders read"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double deviation, std::uint64_t seed) {
    detail::each_rendered(arena, [&](const ArenaLayout::Block& block, MatrixView<float> values) {
      detail::add_noise(block, values, deviation, seed);
    });
    return Done{};
  }
};

/// Features alone, which carry the mark: what a thief does who would overwrite it.
struct FeatureNoiseAttack {
  static constexpr std::string_view name = "feature_noise";
  static constexpr AttackAmount amount{0.1, 0, 2, "the deviation of the noise, as a share of the features' own"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double share, std::uint64_t seed) {
    const BlockHandle feature = find_anchor_blocks(arena.layout()).feature;
    if (!feature.valid() || arena.values(feature).size() == 0) return Done{};
    const MatrixView<float> values = arena.values(feature);
    detail::add_noise(arena.layout().block(feature), values, share * detail::deviation_of(values), seed);
    return Done{};
  }
};

/// Every number that renders read in 16 levels, between the least and the greatest of a tensor or of a channel.
struct Int4Attack {
  static constexpr std::string_view name = "int4";
  static constexpr AttackAmount amount{0, 0, 1, "0 for a scale a tensor, or 1 for a scale a channel", 1};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double channels, std::uint64_t /*seed*/) {
    detail::each_rendered(arena, [&](const ArenaLayout::Block& block, MatrixView<float> values) {
      if (channels < 0.5) {
        detail::round_to_16_levels(values.data, values.size(), 1);
      } else if (block.kind == RowKind::anchor) {
        for (std::size_t k = 0; k < values.columns; ++k)
          detail::round_to_16_levels(values.data + k, values.rows, values.columns);
      } else {
        for (std::size_t row = 0; row < values.rows; ++row)
          detail::round_to_16_levels(values.row(row), values.columns, 1);
      }
    });
    return Done{};
  }
};

/// Half precision, exponents and all.
struct Float16Attack {
  static constexpr std::string_view name = "float16";
  static constexpr AttackAmount amount{1, 0, 1, "1, or 0 to leave the model as it is", 1};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double on, std::uint64_t /*seed*/) {
    if (on < 0.5) return Done{};
    detail::each_rendered(arena, [](const ArenaLayout::Block& /*block*/, MatrixView<float> values) {
      for (float& value : values.flat()) value = detail::rounded_to_half(value);
    });
    return Done{};
  }
};

/// Half precision keeps 10 bits, bfloat16 keeps 7; exponents stay as they are. To the nearest, ties to even.
struct MantissaAttack {
  static constexpr std::string_view name = "mantissa";
  static constexpr AttackAmount amount{10, 0, 23, "the bits of the mantissa that are kept, a whole number", 1};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double bits, std::uint64_t /*seed*/) {
    const auto lost = static_cast<std::uint32_t>(23 - std::lround(bits));
    detail::each_rendered(arena, [lost](const ArenaLayout::Block& /*block*/, MatrixView<float> values) {
      for (float& value : values.flat()) {
        const float rounded = detail::rounded_mantissa(value, lost);
        if (std::isfinite(rounded)) value = rounded;
      }
    });
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
