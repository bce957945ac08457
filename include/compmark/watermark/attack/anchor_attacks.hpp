// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on the anchors of a model (attack_list.hpp): they are thrown away by what renders say of them, cut out,
// merged with a neighbour, or have their features overwritten by those around them. ModelAttacks (model_attacks.hpp)
// has them in its list. Neighbours are those along a Morton curve, which costs a sort and no search. Cost: a sort of
// the anchors, a copy of the model.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/morton.hpp"
#include "compmark/splat/anchor/nearest_rows.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/watermark/attack/attack_list.hpp"

namespace compmark {

namespace detail {
[[nodiscard]] inline std::size_t anchor_rows(const ArenaLayout& layout) {
  std::size_t rows = 0;
  for (const ArenaLayout::Block& block : layout.blocks()) {
    if (block.kind == RowKind::anchor) rows = std::max(rows, block.rows);
  }
  return rows;
}

/// Throws away floor(share * anchors) of the anchors, those of the least `score`, of equal ones the first; never all.
[[nodiscard]] inline Result<Done> prune_least(ParameterArena<float>& arena, double share,
                                              std::span<const double> score) {
  const std::size_t rows = anchor_rows(arena.layout());
  if (score.size() != rows) {
    return Error{ErrorKind::invalid,
                 {},
                 "attack",
                 "has evidence of " + std::to_string(score.size()) + " anchors for a model of " + std::to_string(rows),
                 "gather it from this model, after the attacks before this one"};
  }
  std::vector<std::uint32_t> order(rows);
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return score[a] < score[b]; });
  const auto gone = static_cast<std::ptrdiff_t>(share * static_cast<double>(rows));
  std::vector<std::uint32_t> kept(order.begin() + std::min(gone, std::max<std::ptrdiff_t>(0, std::ssize(order) - 1)),
                                  order.end());
  std::sort(kept.begin(), kept.end());
  arena.edit_rows({kept, 0});
  return Done{};
}

/// Rows along a Morton curve through 2^20 cells an axis.
[[nodiscard]] inline std::vector<std::uint32_t> along_curve(MatrixView<const float> position) {
  std::array<double, 3> least{}, cells{};
  double side = 0;
  for (std::size_t axis = 0; axis < 3 && position.rows > 0; ++axis) {
    double low = static_cast<double>(position(0, axis)), high = low;
    for (std::size_t row = 1; row < position.rows; ++row) {
      low = std::min(low, static_cast<double>(position(row, axis)));
      high = std::max(high, static_cast<double>(position(row, axis)));
    }
    least[axis] = low;
    side = std::max(side, high - low);
  }
  cells.fill(side > 0 && std::isfinite(side) ? 1048575 / side : 0);
  std::vector<std::pair<MortonCode, std::uint32_t>> codes;
  codes.reserve(position.rows);
  for (std::size_t row = 0; row < position.rows; ++row) {
    const auto cell = [&](std::size_t axis) {
      return static_cast<std::uint32_t>((static_cast<double>(position(row, axis)) - least[axis]) * cells[axis]);
    };
    codes.emplace_back(morton_code(cell(0), cell(1), cell(2)), static_cast<std::uint32_t>(row));
  }
  std::sort(codes.begin(), codes.end());
  std::vector<std::uint32_t> order;
  order.reserve(codes.size());
  for (const auto& [code, row] : codes) order.push_back(row);
  return order;
}
}  // namespace detail

/// LightGaussian's global significance (Fan et al., NeurIPS 2024): hits * opacity * transmittance * volume^beta.
struct LightGaussianAttack {
  static constexpr std::string_view name = "lightgaussian";
  static constexpr AttackAmount amount{0.66, 0, 0.99, "the share of the anchors, the least significant, that goes"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double share, std::uint64_t /*seed*/,
                                          const AnchorEvidence& evidence) {
    return detail::prune_least(arena, share, evidence.significance);
  }
};
struct OpacityPruneAttack {
  static constexpr std::string_view name = "prune_opacity";
  static constexpr AttackAmount amount{0.3, 0, 0.99, "the share of the anchors, the most transparent, that goes"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double share, std::uint64_t /*seed*/,
                                          const AnchorEvidence& evidence) {
    return detail::prune_least(arena, share, evidence.opacity);
  }
};

/// The anchors nearest to one that the seed chooses are kept: a ball cut out of the scene. A model without places stays
/// as it is. To put it into another scene: app/model_attack.hpp.
struct CutOutAttack {
  static constexpr std::string_view name = "cutout";
  static constexpr AttackAmount amount{0.3, 0.001, 1, "the share of the anchors, a ball, that is kept"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double share, std::uint64_t seed) {
    const AnchorHandles handles = find_anchor_blocks(arena.layout());
    if (!handles.position.valid()) return Done{};
    const MatrixView<const float> position = std::as_const(arena).values(handles.position);
    if (position.rows == 0) return Done{};
    const Random random(seed, 0, random_stage("attack/cutout"));
    const auto middle =
        std::min(position.rows - 1, static_cast<std::size_t>(random.uniform(0) * static_cast<double>(position.rows)));
    std::vector<double> nearness(position.rows);
    for (std::size_t row = 0; row < position.rows; ++row) nearness[row] = -squared_distance(position, row, middle);
    return detail::prune_least(arena, 1 - share, nearness);
  }
};

/// Pairs of neighbours, the nearest first, become one anchor, whose every number is the mean of theirs.
struct MergeAttack {
  static constexpr std::string_view name = "merge";
  static constexpr AttackAmount amount{0.1, 0, 0.4, "the share of the anchors that is merged into a neighbour"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double share, std::uint64_t /*seed*/) {
    const AnchorHandles handles = find_anchor_blocks(arena.layout());
    if (!handles.position.valid()) return Done{};
    const MatrixView<const float> position = std::as_const(arena).values(handles.position);
    const std::vector<std::uint32_t> curve = detail::along_curve(position);
    std::vector<std::pair<double, std::size_t>> pairs;  // distance, place along the curve
    for (std::size_t i = 0; i + 1 < curve.size(); ++i)
      pairs.emplace_back(squared_distance(position, curve[i], curve[i + 1]), i);
    std::sort(pairs.begin(), pairs.end());
    auto left = static_cast<std::size_t>(share * static_cast<double>(position.rows));
    std::vector<std::uint8_t> taken(position.rows, 0), gone(position.rows, 0);
    for (const auto& [distance, i] : pairs) {
      if (left == 0) break;
      const std::uint32_t stays = std::min(curve[i], curve[i + 1]), goes = std::max(curve[i], curve[i + 1]);
      if (taken[stays] != 0 || taken[goes] != 0) continue;
      taken[stays] = taken[goes] = gone[goes] = 1;
      --left;
      for (const ArenaLayout::Block& block : arena.layout().blocks()) {
        if (block.kind != RowKind::anchor || block.role != BlockRole::rendering) continue;
        float* const values = arena.all_values().data() + block.offset;
        for (std::size_t k = 0; k < block.columns; ++k) {
          float& mean = values[stays * block.columns + k];
          mean = 0.5f * mean + 0.5f * values[goes * block.columns + k];
        }
      }
    }
    std::vector<std::uint32_t> kept;
    for (std::uint32_t row = 0; row < gone.size(); ++row) {
      if (gone[row] == 0) kept.push_back(row);
    }
    arena.edit_rows({kept, 0});
    return Done{};
  }
};

/// Features are overwritten by the mean of the eight anchors beside each along the curve, wholly at 1.
struct SmoothFeaturesAttack {
  static constexpr std::string_view name = "smooth_features";
  static constexpr AttackAmount amount{0.5, 0, 1, "how far features are moved to the mean of their neighbours'"};
  static constexpr std::size_t beside = 4;  ///< neighbours on either side
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double share, std::uint64_t /*seed*/) {
    const AnchorHandles handles = find_anchor_blocks(arena.layout());
    if (!handles.position.valid() || !handles.feature.valid() || share == 0) return Done{};
    const std::vector<std::uint32_t> curve = detail::along_curve(std::as_const(arena).values(handles.position));
    const MatrixView<float> feature = arena.values(handles.feature);
    const std::vector<float> before(feature.data, feature.data + feature.size());
    for (std::size_t i = 0; i < curve.size(); ++i) {
      const std::size_t begin = i - std::min(i, beside), end = std::min(curve.size(), i + beside + 1);
      if (end - begin < 2) continue;
      for (std::size_t k = 0; k < feature.columns; ++k) {
        double mean = 0;
        for (std::size_t n = begin; n < end; ++n)
          mean += n == i ? 0 : static_cast<double>(before[curve[n] * feature.columns + k]);
        mean /= static_cast<double>(end - begin - 1);
        float& value = feature(curve[i], k);
        value = static_cast<float>((1 - share) * static_cast<double>(value) + share * mean);
      }
    }
    return Done{};
  }
};

}  // namespace compmark
