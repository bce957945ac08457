// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Adam as its formula reads, one scalar after the other, for any number type: what Adam is tested and timed against.
// Same concept, same state, same guard and flush as Adam; the two differ by rounding only (a few units in the last
// place of the larger operand, because Adam fuses its products). Cost: as Adam without SIMD.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "compmark/splat/optim/adam.hpp"

namespace compmark {

template <class T>
class ReferenceAdam {
 public:
  using Scalar = T;
  using Settings = AdamSettings;
  using State = AdamState<T>;

  ReferenceAdam() = default;
  explicit ReferenceAdam(Settings settings) : settings_(settings) {}

  void prepare(const ArenaLayout& layout, State& state) const { detail::prepare_adam(layout, state); }
  void edit_rows(const RowEdit& edit, const ArenaLayout& old_layout, const ArenaLayout& new_layout,
                 State& state) const {
    detail::edit_adam_rows(edit, old_layout, new_layout, state);
  }

  template <Executor E>
  OptimizerReport step(ParameterArena<T>& arena, std::span<const double> rates, State& state, E& /*executor*/,
                       StepOptions options = {}) const {
    OptimizerReport report;
    const ArenaLayout& layout = arena.layout();
    for (std::size_t b = 0; b < layout.blocks().size(); ++b) {
      const ArenaLayout::Block& block = layout.blocks()[b];
      const std::span<T> g = arena.all_gradients().subspan(block.offset, block.size());
      if (rates[b] != 0 && !(options.skip_anchor_blocks && block.kind == RowKind::anchor)) {
        bool finite = true;
        for (const T x : g) finite = finite && std::isfinite(x * x);
        if (finite) {
          const double t = static_cast<double>(++state.steps[b]);
          step_block(block, 1 - std::pow(settings_.beta1, t), 1 - std::pow(settings_.beta2, t), rates[b], arena, state);
          ++report.stepped_blocks;
        } else {
          if (report.skipped_blocks == 0) report.first_skipped = {b};
          ++report.skipped_blocks;
        }
      }
      if (options.zero_gradients_after) {
        for (T& x : g) x = T{};
      }
    }
    return report;
  }

 private:
  void step_block(const ArenaLayout::Block& block, double correction1, double correction2, double rate,
                  ParameterArena<T>& arena, State& state) const {
    const T beta1 = static_cast<T>(settings_.beta1), weight1 = static_cast<T>(1 - settings_.beta1);
    const T beta2 = static_cast<T>(settings_.beta2), weight2 = static_cast<T>(1 - settings_.beta2);
    const T step_size = static_cast<T>(rate / correction1), root = static_cast<T>(std::sqrt(correction2));
    const T epsilon = static_cast<T>(settings_.epsilon);
    const T tiny = 2 * std::numeric_limits<T>::min(), tiny_first = detail::smallest_first_moment<T>(settings_);
    for (std::size_t i = block.offset; i < block.offset + block.size(); ++i) {
      T& m = state.first_moment[i];
      T& v = state.second_moment[i];
      const T g = arena.all_gradients()[i];
      m = beta1 * m + weight1 * g;
      v = beta2 * v + weight2 * g * g;
      if (std::abs(m) < tiny_first) m = T{};
      if (v < tiny) v = T{};
      arena.all_values()[i] -= step_size * m / (std::sqrt(v) / root + epsilon);
    }
  }

  Settings settings_;
};

}  // namespace compmark
