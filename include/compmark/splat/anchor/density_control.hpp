// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept DensityControl: which anchors are born and which die.
//
//   expression                                            meaning                                                cost
//   typename D::Scalar, D::Settings, D::State             number type, run-time numbers, statistics (go to
//                                                         checkpoints)
//   d.prepare(anchors, state)                             statistics of that many anchors, all zero              O(N K)
//   d.observe(decoded, gaussian_visible, gradient_norm,   adds the statistics of one rendered view               O(P)
//   state, e)
//   d.adapt(arena, handles, state, inputs, on_edit)       edits the rows of the arena; after each edit calls     O(N K)
//                                                         on_edit(edit, old_layout), so that moments follow;
//                                                         GrowthReport
//
// Laws: D1 kept rows keep every bit of their values, but for clamps the policy states; D2 the arena, the statistics and
// whatever follows on_edit have the same rows afterwards; D3 a fixed number of anchors is never exceeded and the last
// one never removed; D4 adapt is a function of its arguments: same bits at any thread count, order of new rows
// included; D5 no Gaussian beyond the reach gives birth.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/math/robust_ball.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/space.hpp"
#include "compmark/splat/anchor/table.hpp"

namespace compmark {

/// What an adjustment needs to know beside the anchors and their statistics.
struct AdjustmentInputs {
  std::uint64_t seed = 0;
  std::uint64_t iteration = 0;  ///< with the seed, the key of its random numbers
  double voxel_size = 0.001;    ///< world units: the finest cell
  std::span<const BlockHandle> pooled =
      {};                ///< anchor blocks beside the feature whose new rows are the maximum over their parents
  RobustBall ball = {};  ///< of the anchors (math/robust_ball.hpp), for
  double reach =
      std::numeric_limits<double>::infinity();  ///< Gaussians farther from its centre give no birth, world units
};

/// The same for a scene whose cells are not cubes of the world (splat/anchor/space.hpp). A policy that knows of no
/// space takes the base.
template <class S>
struct SpaceAdjustmentInputs : AdjustmentInputs {
  [[no_unique_address]] S space;
};

/// What an adjustment did. Nothing is repaired silently.
struct GrowthReport {
  std::size_t grown = 0;              ///< anchors added
  std::size_t pruned = 0;             ///< anchors removed
  std::size_t candidates = 0;         ///< Gaussians that asked for an anchor, summed over the levels
  std::size_t dropped_by_budget = 0;  ///< anchors that would have been added but for the limit
  /// statistics that were NaN or infinite: not used, and reset (docs/spec/numerics.md, AN5)
  std::size_t non_finite = 0;
  /// Candidates that are put nowhere: not finite, 2^31 cells away, or beyond AdjustmentInputs::reach.
  std::size_t out_of_range = 0;
  bool kept_last = false;  ///< every anchor was to go: the one of highest opacity was kept
  bool edited = false;     ///< rows were edited, so gradients of anchor blocks are zero now
};

namespace detail {
/// The space of a SpaceAdjustmentInputs, that of the world of an AdjustmentInputs.
inline constexpr EuclideanSpace euclidean_space{};
template <class Inputs>
[[nodiscard]] constexpr const auto& space_of(const Inputs& inputs) {
  if constexpr (requires { inputs.space; }) {
    return inputs.space;
  } else {
    return euclidean_space;
  }
}
struct AnyRowEditReceiver {
  void operator()(const RowEdit& /*edit*/, const ArenaLayout& /*old_layout*/) const {}
};
}  // namespace detail

template <class D>
concept DensityControl = requires(const D& control, ParameterArena<typename D::Scalar>& arena,
                                  const AnchorHandles& handles, typename D::State& state,
                                  const DecodedStatistics<typename D::Scalar>& decoded,
                                  std::span<const std::uint8_t> visible,
                                  std::span<const typename D::Scalar> gradient_norm, const AdjustmentInputs& inputs,
                                  SerialExecutor& executor, std::size_t anchors) {
  typename D::Settings;
  control.prepare(anchors, state);
  control.observe(decoded, visible, gradient_norm, state, executor);
  { control.adapt(arena, handles, state, inputs, detail::AnyRowEditReceiver{}) } -> std::same_as<GrowthReport>;
};

}  // namespace compmark
