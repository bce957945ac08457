// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on a model (attack_list.hpp): what a thief does to its numbers. They change what renders read and leave the
// rest, as quantize_model.hpp does. To add one: its type here, and its name in the list ModelAttacks. Cost: a few
// passes over the model.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/splat/quantizer/int8_quantizer.hpp"
#include "compmark/watermark/attack/anchor_attacks.hpp"
#include "compmark/watermark/attack/attack_list.hpp"
#include "compmark/watermark/attack/neighbour_smoothing.hpp"
#include "compmark/watermark/attack/number_attacks.hpp"
#include "compmark/watermark/attack/quantize_model.hpp"

namespace compmark {

/// The general quantization of the paper: every number that a render reads in 8 bits.
struct Int8Attack {
  static constexpr std::string_view name = "int8";
  static constexpr AttackAmount amount{0, 0, 1, "0 for a scale a tensor, or 1 for a scale a channel", 1};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double channels, std::uint64_t /*seed*/) {
    using Quantizer = Int8Quantizer<float>;
    const bool each = channels >= 0.5;
    const Result<Quantizer> anchors =
        Quantizer::create({Int8Scheme::affine, each ? Int8Channels::columns : Int8Channels::tensor});
    const Result<Quantizer> networks =
        Quantizer::create({Int8Scheme::affine, each ? Int8Channels::rows : Int8Channels::tensor});
    if (!anchors) return anchors.error();
    if (!networks) return networks.error();
    const auto report = quantize_model(arena, *anchors, *networks);
    return report ? Result<Done>(Done{}) : report.error();
  }
};

/// Anchors are thrown away at random.
struct PruneAttack {
  static constexpr std::string_view name = "prune";
  static constexpr AttackAmount amount{0.1, 0, 0.99, "the share of the anchors that is thrown away"};
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double share, std::uint64_t seed) {
    const std::size_t rows = detail::anchor_rows(arena.layout());
    const Random random(seed, 0, random_stage("attack/prune"));
    std::vector<std::uint32_t> kept;
    for (std::uint32_t row = 0; row < rows; ++row) {
      if (random.uniform(row) >= share) kept.push_back(row);
    }
    if (kept.empty() && rows > 0) kept.push_back(0);  // a model without anchors is none
    arena.edit_rows({kept, 0});
    return Done{};
  }
};

/// Anchors are doubled at random, as densification doubles them: the copy has every number of its anchor and lies a
/// tenth of the anchor's extent, exp(scaling[0:3]), beside it, in deviations along each axis. Its opacity is that of
/// the anchor, not the half that would look as before, since published tests of robustness duplicate primitives as they
/// are; so what is doubled also becomes more opaque. Originals keep their rows and their numbers, copies come behind.
struct CloneAttack {
  static constexpr std::string_view name = "clone";
  static constexpr AttackAmount amount{0.5, 0, 1, "the share of the anchors that is doubled"};
  static constexpr double moved = 0.1;  ///< the copy's distance along an axis, in deviations, per extent of its anchor
  [[nodiscard]] static Result<Done> apply(ParameterArena<float>& arena, double share, std::uint64_t seed) {
    const std::size_t rows = detail::anchor_rows(arena.layout());
    const Random random(seed, 0, random_stage("attack/clone"));
    std::vector<std::uint32_t> kept(rows), parents;
    for (std::uint32_t row = 0; row < rows; ++row) {
      kept[row] = row;
      if (random.uniform(row) < share) parents.push_back(row);
    }
    arena.edit_rows({kept, parents.size()});
    for (const ArenaLayout::Block& block : arena.layout().blocks()) {
      if (block.kind != RowKind::anchor) continue;
      float* const values = arena.all_values().data() + block.offset;
      for (std::size_t i = 0; i < parents.size(); ++i)
        std::copy_n(values + parents[i] * block.columns, block.columns, values + (rows + i) * block.columns);
    }
    detail::move_anchors(arena, rows, moved, Random(seed, 0, random_stage("attack/clone/beside")));
    return Done{};
  }
};

/// All that are shipped.
using ModelAttacks =
    AttackList<Int8Attack, AnchorNoiseAttack, PruneAttack, CloneAttack, MantissaAttack, JitterAttack, ColourBiasAttack,
               ParameterNoiseAttack, FeatureNoiseAttack, Float16Attack, Int4Attack, LightGaussianAttack,
               OpacityPruneAttack, CutOutAttack, MergeAttack, SmoothFeaturesAttack, NeighbourSmoothingAttack>;

}  // namespace compmark
