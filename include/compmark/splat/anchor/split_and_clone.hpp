// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// SplitAndClone, the DensityControl of explicit Gaussians (Kerbl et al., SIGGRAPH 2023, 5.2): where the gradient on the
// screen is high, a small Gaussian is doubled and a large one becomes two smaller ones, drawn from it; transparent ones
// go. Two differences: after a doubling both have the opacity 1 - sqrt(1 - a), so that together they cover what the one
// did (Bulo et al., ECCV 2024, 3.3; as published they cover more), and opacities are never reset. "Small" is a share of
// the anchors' ball, which a far point does not move. Cost: a pass over the statistics and one over the table.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/splat/anchor/density_control.hpp"
#include "compmark/splat/anchor/explicit_decoder.hpp"
#include "compmark/splat/anchor/growth_statistics.hpp"
#include "compmark/splat/anchor/prune.hpp"
#include "compmark/splat/anchor/table.hpp"

namespace compmark {

/// For tables of ExplicitDecoder.
template <class T>
class SplitAndClone {
 public:
  using Scalar = T;
  struct Settings {
    std::int64_t interval = 100;         ///< iterations between adjustments
    double success_threshold = 0.8;      ///< a Gaussian is judged after interval * success_threshold visits
    double gradient_threshold = 0.0002;  ///< mean norm of the gradient of its place on the screen
    double min_opacity = 0.005;          ///< pruned below this
    double small = 0.01;                 ///< of the ball's radius: Gaussians of at most this scale are doubled
    double shrink = 1.6;                 ///< a half of a split Gaussian is smaller by this
    std::size_t max_anchors = 0;         ///< 0: no limit; else the highest gradients come first
  };
  struct State {
    GrowthStatistics<T> statistics;
    struct Scratch {
      std::vector<std::pair<T, std::uint32_t>> hot;  // gradient, row
      std::vector<std::uint32_t> kept;
      std::vector<std::uint8_t> leaves;    // rows that are split or pruned
      std::vector<std::uint32_t> parents;  // of each new row
      std::vector<T> rows;                 // values of the new rows, all anchor blocks side by side
    } scratch;
  };

  SplitAndClone() = default;
  explicit SplitAndClone(const Settings& settings) : settings_(settings) {}
  [[nodiscard]] const Settings& settings() const { return settings_; }

  void prepare(std::size_t anchors, State& state) const { state.statistics.prepare(anchors, 1); }

  template <Executor E>
  void observe(const DecodedStatistics<T>& decoded, std::span<const std::uint8_t> gaussian_visible,
               std::span<const T> gradient_norm, State& state, E& executor) const {
    state.statistics.add_view(decoded, gaussian_visible, gradient_norm, executor);
  }

  template <class OnEdit, class Inputs = AdjustmentInputs>
  GrowthReport adapt(ParameterArena<T>& arena, const AnchorHandles& handles, State& state, const Inputs& inputs,
                     OnEdit&& on_edit) const {
    const AnchorColumns<T> columns = anchor_values(arena, handles);
    COMPMARK_ASSERT(state.statistics.anchors() == columns.rows() && state.statistics.slots() == columns.rows(),
                    "SplitAndClone: statistics of another table");
    typename State::Scratch& scratch = state.scratch;
    GrowthReport report;
    report.non_finite = detail::drop_non_finite(state.statistics);
    prune_by_opacity(state.statistics, prune_settings(), scratch.kept);
    report.pruned = columns.rows() - scratch.kept.size();
    if (scratch.kept.empty() && columns.rows() != 0) {
      scratch.kept.push_back(most_opaque_anchor(state.statistics));
      --report.pruned;
      report.kept_last = true;
    }
    scratch.leaves.assign(columns.rows(), 1);
    for (const std::uint32_t row : scratch.kept) scratch.leaves[row] = 0;
    find_hot(state.statistics, inputs, columns, scratch, report);
    add_rows(arena, handles, columns, inputs, scratch);
    std::erase_if(scratch.kept, [&](std::uint32_t row) { return scratch.leaves[row] != 0; });
    report.grown = scratch.kept.size() + scratch.parents.size() + report.pruned - columns.rows();
    detail::reset_judged(state.statistics, prune_settings());
    if (!scratch.parents.empty() || report.pruned != 0) {
      const RowEdit edit{scratch.kept, scratch.parents.size()};
      const ArenaLayout old_layout = arena.layout();
      arena.edit_rows(edit);
      state.statistics.edit_rows(edit);
      write_rows(arena, scratch);
      on_edit(edit, old_layout);
      report.edited = true;
    }
    return report;
  }

 private:
  using Layout = ExplicitLayout<0>;  // opacity and rotation lie at the same places for every degree

  [[nodiscard]] PruneSettings prune_settings() const {
    return {static_cast<double>(settings_.interval) * settings_.success_threshold, settings_.min_opacity};
  }

  /// The rows that are split or doubled, ascending; as many as the limit has room for, the highest gradients first.
  void find_hot(const GrowthStatistics<T>& statistics, const AdjustmentInputs& inputs, const AnchorColumns<T>& columns,
                typename State::Scratch& scratch, GrowthReport& report) const {
    scratch.hot.clear();
    for (const std::uint32_t row : scratch.kept) {
      if (!detail::eligible(statistics, row, prune_settings())) continue;
      const T gradient = statistics.gradient_sum[row] / statistics.gradient_count[row];
      if (!(gradient >= static_cast<T>(settings_.gradient_threshold))) continue;
      ++report.candidates;
      const std::array<T, 3> at = mean(columns, row);
      if (!(inputs.ball.distance(at.data()) <= inputs.reach)) {
        ++report.out_of_range;
        continue;
      }
      scratch.hot.emplace_back(gradient, row);
    }
    const std::size_t room =
        settings_.max_anchors > scratch.kept.size() ? settings_.max_anchors - scratch.kept.size() : 0;
    if (settings_.max_anchors != 0 && scratch.hot.size() > room) {
      std::sort(scratch.hot.begin(), scratch.hot.end(), [](const auto& a, const auto& b) {
        return a.first != b.first ? a.first > b.first : a.second < b.second;
      });
      report.dropped_by_budget = scratch.hot.size() - room;
      scratch.hot.resize(room);
    }
    std::sort(scratch.hot.begin(), scratch.hot.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  }

  [[nodiscard]] static std::array<T, 3> mean(const AnchorColumns<T>& columns, std::size_t row) {
    std::array<T, 3> at{};
    for (std::size_t axis = 0; axis < 3; ++axis)
      at[axis] = columns.position(row, axis) + columns.offset(row, axis) * std::exp(columns.scaling(row, axis));
    return at;
  }

  /// Copies of the hot rows, changed: one for a doubled Gaussian, whose own row changes too, two for a split one, whose
  /// row leaves.
  void add_rows(ParameterArena<T>& arena, const AnchorHandles& handles, const AnchorColumns<T>& columns,
                const AdjustmentInputs& inputs, typename State::Scratch& scratch) const {
    scratch.parents.clear();
    scratch.rows.clear();
    const Random random(inputs.seed, inputs.iteration, random_stage("split gaussians"));
    const double small = settings_.small * inputs.ball.wide;
    for (const auto& [gradient, row] : scratch.hot) {
      const T* const scale = columns.scaling.row(row) + 3;
      const double largest = std::exp(static_cast<double>(std::max({scale[0], scale[1], scale[2]})));
      if (largest <= small) {
        T& opacity = columns.feature(row, Layout::opacity);
        opacity = shared(opacity);
        copy_row(arena, row, scratch);
      } else {
        scratch.leaves[row] = 1;
        for (std::uint64_t half = 0; half < 2; ++half) {
          const std::size_t first = copy_row(arena, row, scratch);
          move_half(arena.layout(), handles, random, 2 * std::uint64_t{row} + half, columns, row,
                    scratch.rows.data() + first);
        }
      }
    }
  }

  /// The stored opacity of each of two that cover what one did: a' = 1 - sqrt(1 - a). With l the logit, 1 - a' =
  /// (1 + e^l)^(-1/2), so l' = ln((1 + e^l)^(1/2) - 1), written without the cancellation at small opacities.
  [[nodiscard]] static T shared(T stored) {
    const double logit = Layout::opacity_unit * static_cast<double>(stored) + Layout::opacity_zero;
    const double half = 0.5 * (logit > 30 ? logit : std::log1p(std::exp(logit)));  // ln sqrt(1 + e^l)
    return static_cast<T>((half + std::log(-std::expm1(-half)) - Layout::opacity_zero) / Layout::opacity_unit);
  }

  /// Appends the values of all anchor blocks of a row; returns where they begin.
  static std::size_t copy_row(const ParameterArena<T>& arena, std::uint32_t row, typename State::Scratch& scratch) {
    const std::size_t first = scratch.rows.size();
    for_each_anchor_block(arena.layout(), [&](BlockHandle block) {
      const MatrixView<const T> values = arena.values(block);
      scratch.rows.insert(scratch.rows.end(), values.row(row), values.row(row) + values.columns);
    });
    scratch.parents.push_back(row);
    return first;
  }

  /// Moves a copied row to a place drawn from the Gaussian and shrinks it.
  void move_half(const ArenaLayout& layout, const AnchorHandles& handles, const Random& random, std::uint64_t key,
                 const AnchorColumns<T>& columns, std::uint32_t row, T* copy) const {
    std::array<T, 4> q{};
    T square = T(0);
    for (std::size_t k = 0; k < 4; ++k) {
      q[k] = static_cast<T>(Layout::rotation_unit) * columns.feature(row, Layout::rotation + k) + T(k == 0 ? 1 : 0);
      square += q[k] * q[k];
    }
    if (!(square > T(0))) q = {T(1)}, square = T(1);
    std::array<T, 3> local{};
    for (std::size_t axis = 0; axis < 3; ++axis)
      local[axis] = std::exp(columns.scaling(row, 3 + axis)) * static_cast<T>(random.normal(3 * key + axis));
    // v' = v + 2 (w u x v + u x (u x v)) / |q|^2, u the vector part
    const auto cross = [](const std::array<T, 3>& a, const std::array<T, 3>& b) {
      return std::array<T, 3>{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    };
    const std::array<T, 3> u{q[1], q[2], q[3]}, once = cross(u, local), twice = cross(u, once);
    const std::array<T, 3> center = mean(columns, row);
    for_each_anchor_block(layout, [&](BlockHandle block) {
      const std::size_t width = layout.block(block).columns;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (block.index == handles.position.index)
          copy[axis] = center[axis] + local[axis] + T(2) * (q[0] * once[axis] + twice[axis]) / square;
        if (block.index == handles.offset.index) copy[axis] = T(0);
        if (block.index == handles.scaling.index) copy[3 + axis] -= static_cast<T>(std::log(settings_.shrink));
      }
      copy += width;
    });
  }

  static void write_rows(ParameterArena<T>& arena, const typename State::Scratch& scratch) {
    const T* source = scratch.rows.data();
    for (std::size_t i = 0; i < scratch.parents.size(); ++i) {
      for_each_anchor_block(arena.layout(), [&](BlockHandle block) {
        const MatrixView<T> values = arena.values(block);
        std::copy_n(source, values.columns, values.row(scratch.kept.size() + i));
        source += values.columns;
      });
    }
  }

  template <class F>
  static void for_each_anchor_block(const ArenaLayout& layout, F&& f) {
    for (std::size_t b = 0; b < layout.blocks().size(); ++b) {
      if (layout.blocks()[b].kind == RowKind::anchor) f(BlockHandle{b});
    }
  }

  Settings settings_;
};

static_assert(DensityControl<SplitAndClone<float>>);

}  // namespace compmark
