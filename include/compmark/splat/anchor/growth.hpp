// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// DensityControl of Scaffold-GS (docs/spec/method.md, 4.1 to 4.4): where the screen-space gradient of a Gaussian stays
// high, an anchor is put into its cell; anchors whose Gaussians stay transparent go. Three levels of cells, coarse to
// fine, with thresholds and keep probabilities rising. Deterministic: random numbers are keyed by (seed, iteration,
// level, slot), new anchors are ordered by level and then by cell.
//
// Growing and pruning are one row edit (the published loop makes one for each level and one more): every decision reads
// the old rows, as it does there, because pruning judges old anchors only. Cost: a few nanoseconds an anchor and level,
// once in 100 iterations.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/splat/anchor/cells.hpp"
#include "compmark/splat/anchor/density_control.hpp"
#include "compmark/splat/anchor/growth_statistics.hpp"
#include "compmark/splat/anchor/new_anchors.hpp"
#include "compmark/splat/anchor/no_growth.hpp"
#include "compmark/splat/anchor/prune.hpp"
#include "compmark/splat/anchor/table.hpp"

namespace compmark {

template <class T>
class GradientGrowth {
 public:
  using Scalar = T;

  /// Defaults are Scaffold-GS's.
  struct Settings {
    int offsets = 10;             ///< K, Gaussians an anchor
    std::int64_t interval = 100;  ///< iterations between adjustments: what counts are compared with
    /// Anchors are judged above interval * success_threshold visits, Gaussians above half of that.
    double success_threshold = 0.8;
    double gradient_threshold = 0.0002;  ///< of the coarsest level; doubles from level to level at hierarchy factor 4
    double min_opacity = 0.005;          ///< sum over K of positive opacities, a visit
    int update_depth = 3;                ///< levels
    int hierarchy_factor = 4;            ///< cells shrink by this from level to level
    /// Coarsest cell in voxels. Blender scenes take 4: the third level would have cells of size zero and is left out.
    int init_factor = 16;
    /// 0: no limit. Else the new anchors of highest gradient are taken, coarse levels first.
    std::size_t max_anchors = 0;
    double base_scale_log_limit = 0.05;  ///< see limit_base_scale; infinity: none
  };

  /// `statistics` is what a checkpoint saves; the rest is work space without meaning between two calls.
  struct State {
    GrowthStatistics<T> statistics;
    struct Scratch {
      struct Hot {
        std::uint32_t slot;
        T gradient;
      };
      std::vector<Hot> hot;  // judged Gaussians at or above the lowest threshold

      // of one level
      CellSet cells;                                  // that candidates fall into
      std::vector<T> cell_gradient;                   // the highest of a cell's candidates
      std::vector<std::uint8_t> occupied;             // a cell that has an anchor already
      std::vector<std::uint32_t> chosen;              // cells that get an anchor
      std::vector<std::uint32_t> new_anchor_of_cell;  // … and which one
      std::vector<std::uint32_t> candidate_slot, candidate_cell;

      NewAnchors<T> new_anchors;
      std::vector<std::uint32_t> kept;
    } scratch;
  };

  GradientGrowth() = default;
  explicit GradientGrowth(Settings settings) : settings_(settings) {}
  [[nodiscard]] const Settings& settings() const { return settings_; }

  void prepare(std::size_t anchors, State& state) const { state.statistics.prepare(anchors, offsets()); }

  /// A Gaussian counts where gaussian_visible is not 0; a policy that looks at parts of the image alone passes its own
  /// mask.
  template <Executor E>
  void observe(const DecodedStatistics<T>& decoded, std::span<const std::uint8_t> gaussian_visible,
               std::span<const T> gradient_norm, State& state, E& executor) const {
    state.statistics.add_view(decoded, gaussian_visible, gradient_norm, executor);
  }

  /// With a SpaceAdjustmentInputs the cells are those of its space.
  template <class OnEdit, class Inputs = AdjustmentInputs>
  GrowthReport adapt(ParameterArena<T>& arena, const AnchorHandles& handles, State& state, const Inputs& inputs,
                     OnEdit&& on_edit) const {
    const AnchorColumns<T> columns = anchor_values(arena, handles);
    COMPMARK_ASSERT(state.statistics.anchors() == columns.rows(),
                    "GradientGrowth: statistics and table differ in anchors");
    COMPMARK_ASSERT(columns.offset.columns == 3 * offsets(), "GradientGrowth: Settings::offsets is not the table's");
    typename State::Scratch& scratch = state.scratch;
    GrowthReport report;
    report.non_finite = detail::drop_non_finite(state.statistics);
    find_hot(state.statistics, scratch);

    prune_by_opacity(state.statistics, prune_settings(), scratch.kept);
    report.pruned = columns.rows() - scratch.kept.size();
    grow(arena, handles, columns, inputs, scratch, report);
    if (scratch.kept.empty() && scratch.new_anchors.size() == 0 && columns.rows() != 0) {
      scratch.kept.push_back(most_opaque_anchor(state.statistics));
      report.pruned -= 1;
      report.kept_last = true;
    }
    report.grown = scratch.new_anchors.size();
    detail::reset_judged(state.statistics, prune_settings());
    if (report.grown != 0 || report.pruned != 0) {
      const RowEdit edit{scratch.kept, scratch.new_anchors.size()};
      const ArenaLayout old_layout = arena.layout();
      arena.edit_rows(edit);
      state.statistics.edit_rows(edit);
      scratch.new_anchors.write(arena, handles, scratch.kept.size());
      on_edit(edit, old_layout);
      report.edited = true;
    }
    const MatrixView<T> scaling = arena.values(handles.scaling);
    if constexpr (present<std::remove_cvref_t<decltype(detail::space_of(inputs))>>) {
      limit_base_scale(scaling, std::as_const(arena).values(handles.position), detail::space_of(inputs),
                       settings_.base_scale_log_limit);
    } else {
      limit_base_scale(scaling, settings_.base_scale_log_limit);
    }
    return report;
  }

 private:
  [[nodiscard]] std::size_t offsets() const { return static_cast<std::size_t>(settings_.offsets); }
  /// 100 * 0.8: more than 80 visits of an anchor, more than 40 of a Gaussian.
  [[nodiscard]] double enough_visits() const {
    return static_cast<double>(settings_.interval) * settings_.success_threshold;
  }
  [[nodiscard]] PruneSettings prune_settings() const { return {enough_visits(), settings_.min_opacity}; }
  /// Judged Gaussians at or above the lowest threshold. What was never on screen (0 / 0) is not judged.
  void find_hot(const GrowthStatistics<T>& statistics, typename State::Scratch& scratch) const {
    scratch.hot.clear();
    for (std::size_t slot = 0; slot < statistics.slots(); ++slot) {
      if (!detail::eligible(statistics, slot, prune_settings())) continue;
      const T gradient = statistics.gradient_sum[slot] / statistics.gradient_count[slot];
      if (gradient >= static_cast<T>(settings_.gradient_threshold))
        scratch.hot.push_back({static_cast<std::uint32_t>(slot), gradient});
    }
  }

  template <class Inputs>
  void grow(const ParameterArena<T>& arena, const AnchorHandles& handles, const AnchorColumns<T>& columns,
            const Inputs& inputs, typename State::Scratch& scratch, GrowthReport& report) const {
    COMPMARK_ASSERT(settings_.hierarchy_factor >= 2, "GradientGrowth: hierarchy_factor is 2 or more");
    scratch.new_anchors.clear(arena, handles.feature, inputs.pooled);
    int factor = settings_.init_factor;
    double threshold = settings_.gradient_threshold;
    for (int level = 0; level < settings_.update_depth && factor > 0; ++level) {
      if (level > 0 && scratch.new_anchors.size() == 0)
        break;  // as published: finer levels need an anchor of a coarser one
      grow_level(arena, columns, inputs, level, inputs.voxel_size * factor, static_cast<T>(threshold), scratch, report);
      factor /= settings_.hierarchy_factor;
      threshold *= settings_.hierarchy_factor / 2;
    }
  }

  template <class Inputs>
  void grow_level(const ParameterArena<T>& arena, const AnchorColumns<T>& columns, const Inputs& inputs, int level,
                  double size, T threshold, typename State::Scratch& scratch, GrowthReport& report) const {
    find_candidates(columns, inputs, level, size, threshold, scratch, report);
    if (scratch.cells.size() == 0) return;
    scratch.occupied.assign(scratch.cells.size(), 0);
    const auto occupy = [&](const T* position) {
      Cell cell;
      if (!detail::space_of(inputs).cell_of(position, size, cell)) return;
      if (const std::uint32_t number = scratch.cells.find(cell); number != CellSet::none) scratch.occupied[number] = 1;
    };
    for (std::size_t a = 0; a < columns.rows(); ++a) occupy(columns.position.row(a));
    for (std::size_t i = 0; i < scratch.new_anchors.size(); ++i) occupy(scratch.new_anchors.position(i).data());
    choose_cells(scratch, report);
    add_new_anchors(arena, detail::space_of(inputs), size, scratch);
  }

  /// Gaussians above the level's threshold that win the draw (keep probability 1/2, 3/4, 7/8, …), and the set of their
  /// cells.
  template <class Inputs>
  void find_candidates(const AnchorColumns<T>& columns, const Inputs& inputs, int level, double size, T threshold,
                       typename State::Scratch& scratch, GrowthReport& report) const {
    const Random random(inputs.seed, inputs.iteration, random_stage("growth candidate"));
    const double skip_probability = std::ldexp(1.0, -(level + 1));
    scratch.cells.reset(scratch.hot.size());
    scratch.candidate_slot.clear();
    scratch.candidate_cell.clear();
    scratch.cell_gradient.clear();
    for (const typename State::Scratch::Hot& hot : scratch.hot) {
      if (!(hot.gradient >= threshold)) continue;
      if (!(random.uniform(static_cast<std::uint64_t>(level) << 40 | hot.slot) > skip_probability)) continue;
      ++report.candidates;
      const std::size_t anchor = hot.slot / offsets(), k = hot.slot % offsets();
      std::array<T, 3> position;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        position[axis] = columns.position(anchor, axis) +
                         columns.offset(anchor, 3 * k + axis) * std::exp(columns.scaling(anchor, axis));
      }
      Cell cell;
      if (!detail::space_of(inputs).cell_of(position.data(), size, cell) ||
          !detail::space_of(inputs).in_range(cell, size) || inputs.ball.distance(position.data()) > inputs.reach) {
        ++report.out_of_range;
        continue;
      }
      const std::uint32_t number = scratch.cells.insert(cell);
      scratch.candidate_slot.push_back(hot.slot);
      scratch.candidate_cell.push_back(number);
      if (number == scratch.cell_gradient.size()) scratch.cell_gradient.push_back(hot.gradient);
      scratch.cell_gradient[number] = std::max(scratch.cell_gradient[number], hot.gradient);
    }
  }

  /// Free cells in the order of their coordinates; under a budget those of highest gradient.
  void choose_cells(typename State::Scratch& scratch, GrowthReport& report) const {
    const std::span<const Cell> cells = scratch.cells.cells();
    scratch.chosen.clear();
    for (std::uint32_t number = 0; number < cells.size(); ++number) {
      if (scratch.occupied[number] == 0) scratch.chosen.push_back(number);
    }
    const auto by_cell = [&](std::uint32_t a, std::uint32_t b) { return cells[a] < cells[b]; };
    if (settings_.max_anchors != 0) {
      const std::size_t taken = scratch.kept.size() + scratch.new_anchors.size();
      const std::size_t room = settings_.max_anchors > taken ? settings_.max_anchors - taken : 0;
      if (scratch.chosen.size() > room) {
        const std::vector<T>& gradient = scratch.cell_gradient;
        std::sort(scratch.chosen.begin(), scratch.chosen.end(), [&](std::uint32_t a, std::uint32_t b) {
          return gradient[a] != gradient[b] ? gradient[a] > gradient[b] : by_cell(a, b);
        });
        report.dropped_by_budget += scratch.chosen.size() - room;
        scratch.chosen.resize(room);
      }
    }
    std::sort(scratch.chosen.begin(), scratch.chosen.end(), by_cell);
  }

  /// Each chosen cell becomes an anchor; its parents are the anchors of all candidates in the cell.
  template <Space S>
  void add_new_anchors(const ParameterArena<T>& arena, const S& space, double size,
                       typename State::Scratch& scratch) const {
    scratch.new_anchor_of_cell.assign(scratch.cells.size(), CellSet::none);
    for (const std::uint32_t cell : scratch.chosen) {
      const std::array<double, 3> center = space.center(scratch.cells.cells()[cell], size);
      scratch.new_anchor_of_cell[cell] = scratch.new_anchors.add(center, size * space.stretch(center.data()));
    }
    for (std::size_t i = 0; i < scratch.candidate_slot.size(); ++i) {
      const std::uint32_t number = scratch.new_anchor_of_cell[scratch.candidate_cell[i]];
      if (number != CellSet::none) scratch.new_anchors.pool(arena, number, scratch.candidate_slot[i] / offsets());
    }
  }

  Settings settings_;
};

static_assert(DensityControl<GradientGrowth<float>>);

}  // namespace compmark
