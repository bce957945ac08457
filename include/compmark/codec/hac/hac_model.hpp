// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// HacModel, the entropy model of HAC in training (Chen et al., ECCV 2024; docs/spec/compression.md, 1). From an
// anchor's place in a binary hash grid, a network predicts its attributes and its quantizer steps, q = Q0 (1 + tanh r).
// The attributes carry the noise of these steps, and their bits are a loss,
//   lambda (bits / scalar + bits of the grid / (N (D + 6 + 3 K))) + 5e-4 mean(sigmoid(mask logits)),
// estimated on a random twentieth of all anchors (HAC++; HAC itself: of the visible unmasked ones, times their share).
// Before the context begins the noise is that of Q0. Anchors whose rate is not counted in an iteration need only their
// steps, 3 of 175 outputs. Rows outside the visible list whose rate is counted have their gradients directly in the
// arena, in the blocks "anchor.feature", "anchor.scaling" and "anchor.offset", found by name when the parameters are
// added; without these blocks only listed rows are sampled. Everything runs in fixed panels of 64 anchors: same bits at
// any thread count. Cost at n visible anchors: n 86 random numbers, n (576 + 9.7 k) multiply-adds forward and, of those
// with a gradient (Settings::step_share), twice that backward; memory 1.2 KB a visible anchor. Longer than 300 lines:
// both ways of both kinds of panels share one layout.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "compmark/codec/hac/hac_entries.hpp"
#include "compmark/codec/hac/hac_parameters.hpp"
#include "compmark/codec/hac/hash_grid.hpp"
#include "compmark/codec/rate/anchor_rate_model.hpp"
#include "compmark/codec/rate/concept.hpp"
#include "compmark/codec/rate/context_network.hpp"
#include "compmark/codec/rate/mask_penalty.hpp"
#include "compmark/codec/rate/rate.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

template <class T, int feature_dim = 50, int offsets = 10, HashGridShape grid_shape = HashGridShape{},
          class Quantizer = AdaptiveQuantizer<T>>
class HacModel : public AnchorRateModel<T, feature_dim, offsets, HacHandles, Quantizer> {
  using Base = AnchorRateModel<T, feature_dim, offsets, HacHandles, Quantizer>;
  using typename Base::EntryTables;
  using typename Base::RowScratch;

 public:
  using typename Base::Attributes;
  using typename Base::Handles;
  /// The same model with the recipe's quantizer.
  template <class Other>
    requires has_coded_steps<Other>
  using WithQuantizer = HacModel<T, feature_dim, offsets, grid_shape, Other>;
  using Grid = HashGrid<T, grid_shape>;
  static constexpr HashGridShape shape = grid_shape;
  static constexpr int hidden = 100;
  using Network = ContextNetwork<T, grid_shape.channels(), hidden, Attributes::outputs, 3>;

  struct Settings : AnchorRateSettings {
    double sample = 0.05;    ///< share of the anchors whose rate is counted in an iteration
    bool sample_all = true;  ///< of all anchors, else of the visible ones
    /// Share of the light anchors that have a gradient for their steps in an iteration, with the weight 1 / share.
    /// Published: 1. With a third of them an iteration costs 1.43 to 1.48 plain ones, 1.37 to 1.42 at 100,000 anchors,
    /// for 0.2 and 0.8 % of the bytes of two short runs; the quality is the same
    /// (docs/notebook/compression_experiments.md).
    double step_share = 1.0 / 3;
  };

  struct Scratch : RowScratch {
    alignas(64) T output[static_cast<std::size_t>(Network::panel * Network::output_row)];
    alignas(64) T tail[static_cast<std::size_t>(Network::panel * Network::tail_row)];
    alignas(64) T input[static_cast<std::size_t>(Network::panel * Network::input_row)];
    alignas(64) T hidden[static_cast<std::size_t>(Network::panel * Network::hidden_row)];
    alignas(64) T d_hidden[static_cast<std::size_t>(Network::panel * Network::hidden_row)];
    alignas(64) T d_input[static_cast<std::size_t>(Network::panel * Network::input_row)];
  };
  /// Compact tables, a row an entry (hac_entries.hpp).
  struct Context : EntryTables {
    HacEntries entries;
    double hash_weight = 0;  ///< loss of one bit of the grid
    Buffer<T> position;      ///< [3] in the box
    // The backward pass takes only those light entries that have a gradient: of those that are seen,
    // Settings::step_share.
    Buffer<std::uint32_t> back;  ///< light entries with one
    Buffer<T> back_position;     ///< [3] of these, to whole panels, then of the full ones
    Buffer<T> d_grid;            ///< by the network's inputs, level-major, rows as back_position
    Buffer<double> partial;
    Buffer<T> packed, chunk_gradients;
    PerWorker<Scratch> scratch;
    typename Grid::Context grid;
  };

  HacModel() = default;
  explicit HacModel(const Settings& settings) : settings_(settings) {}

  [[nodiscard]] static Handles add_parameters(ParameterArena<T>& arena, std::size_t anchor_rows) {
    return add_hac_blocks<T, Network, Attributes, grid_shape>(arena, anchor_rows, static_cast<std::size_t>(offsets));
  }
  static void initialise(ParameterArena<T>& arena, const Handles& handles, std::uint64_t seed) {
    initialise_hac(arena, handles, seed);
  }
  /// Box and statistics from all anchors as they are: call before the first iteration with context.
  static void begin_context(ParameterArena<T>& arena, const Handles& handles, MatrixView<const T> position,
                            MatrixView<const T> feature, MatrixView<const T> scaling, MatrixView<const T> offset) {
    begin_hac_context<Attributes>(arena, handles, position, feature, scaling, offset);
  }
  /// Distorts the listed rows of the three tables in place; `position` is the whole table.
  template <Executor E>
  RateReport forward(const ParameterArena<T>& arena, const Handles& handles, std::span<const std::uint32_t> rows,
                     const RatePhase& phase, MatrixView<const T> position, MatrixView<T> feature, MatrixView<T> scaling,
                     MatrixView<T> offset, Context& context, E& executor) const {
    context.phase = phase;
    RateReport report;
    const bool counting = phase.context && phase.counts && settings_.sample > 0;
    const HacSample sample{counting ? settings_.sample : 0, counting && settings_.sample_all && handles.feature.valid(),
                           settings_.anchor_mask};
    context.entries.template draw<T>(rows, sample, phase, arena.values(handles.mask), report);
    set_weights(position.rows, report, context);
    const typename Base::template Tables<T> to{feature, scaling, offset};
    context.resize_noise(context.entries.capacity);
    context.scratch.resize(executor.concurrency());
    const Random random(phase.seed, phase.iteration, random_stage("hac noise"));
    if (!phase.context) {
      executor.for_chunks(context.entries.light, panel, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t e = begin; e < end; ++e) {
          Base::distort(settings_, random, Base::base_steps(settings_), e, context.entries.row[e], to, nullptr,
                        context);
        }
      });
      return report;
    }

    Grid::binarise(arena.values(handles.grid), context.grid, executor);
    Network::pack(network(arena, handles), context.packed);
    context.position.resize(context.entries.capacity * 3);
    context.step.resize(context.entries.capacity * 3);
    context.partial.resize(context.entries.capacity / panel * partials);
    const std::size_t full_rows = context.entries.capacity - context.entries.first_full;
    context.resize_rates(full_rows, output_row);
    const MatrixView<const T> box = arena.values(handles.box);
    executor.for_chunks(context.entries.first_full, panel, [&](std::size_t begin, std::size_t, std::size_t worker) {
      const std::size_t end = std::min(begin + panel, context.entries.light);
      Scratch& s = context.scratch[worker];
      see(box, position, begin, end, s, context);
      Network::tail_outputs(context.packed.data(), s.hidden, s.tail);
      std::array<double, 3> sums{};
      for (std::size_t e = begin; e < end; ++e) {
        const std::array<T, 3> q = Base::take_steps(settings_, s.tail + (e - begin) * tail_row, e, context);
        for (std::size_t g = 0; g < 3; ++g) sums[g] += static_cast<double>(q[g]);
        Base::distort(settings_, random, q, e, context.entries.row[e], to, nullptr, context);
      }
      double* const partial = context.partial.data() + begin / panel * partials;
      std::fill_n(partial, partials, 0.0);
      std::copy_n(sums.data(), 3, partial + 4);
    });
    const typename Base::template Tables<const T> raw = Base::template tables<const T>(arena, handles);
    executor.for_chunks(context.entries.capacity - context.entries.first_full, panel,
                        [&](std::size_t begin, std::size_t, std::size_t worker) {
                          full_panel(arena, handles, context.entries.first_full + begin, box, position, random, to, raw,
                                     context.scratch[worker], context);
                        });
    total(arena, handles, rows.size(), context, report, executor);
    return report;
  }

  /// Turns the gradients by the distorted rows into those by the rows before (in place), adds the rate's, and ADDS
  /// those of masks, grid and network (and of sampled rows that were not listed) into the arena.
  template <Executor E>
  void backward(ParameterArena<T>& arena, const Handles& handles, std::span<const std::uint32_t> rows,
                MatrixView<T> d_feature, MatrixView<T> d_scaling, MatrixView<T> d_offset, Context& context,
                E& executor) const {
    const typename Base::template Tables<T> d_rows{d_feature, d_scaling, d_offset};
    COMPMARK_ASSERT(context.phase.context || rows.size() == context.entries.light,
                    "HacModel: not the rows of the last forward");
    static_cast<void>(rows);
    if (!context.phase.context) {
      executor.for_chunks(context.entries.light, panel, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t e = begin; e < end; ++e) Base::pull_back(e, context.entries.row[e], nullptr, d_rows, context);
      });
      return;
    }
    const std::size_t active = light_gradients(d_rows, context, executor);
    const std::size_t light_panels = chunk_count(active, panel);
    const std::size_t full_rows = context.entries.capacity - context.entries.first_full,
                      full_panels = full_rows / panel;
    const std::size_t back_rows = light_panels * panel + full_rows;
    context.back_position.resize(back_rows * 3);
    context.d_grid.resize(back_rows * Grid::channels);
    std::copy_n(context.position.data() + 3 * context.entries.first_full, 3 * full_rows,
                context.back_position.data() + 3 * light_panels * panel);
    context.chunk_gradients.resize(most_chunks * Network::gradient_count);
    const auto sums_of = [&](std::size_t chunk) {
      return context.chunk_gradients.data() + chunk * Network::gradient_count;
    };
    executor.for_chunks(most_chunks, 1, [&](std::size_t chunk, std::size_t, std::size_t) {
      std::fill_n(sums_of(chunk), Network::gradient_count, T(0));
    });
    const std::size_t light_grain = std::max<std::size_t>(1, chunk_count(light_panels, most_chunks));
    executor.for_chunks(light_panels, light_grain, [&](std::size_t first, std::size_t last, std::size_t worker) {
      for (std::size_t p = first; p < last; ++p) {
        light_panel_backward(p * panel, std::min(active, (p + 1) * panel), back_rows, context.scratch[worker],
                             sums_of(first / light_grain), context);
      }
    });
    const typename Base::template Tables<T> outside = Base::template tables<T>(arena, handles);
    const std::size_t full_grain = std::max<std::size_t>(1, chunk_count(full_panels, most_chunks));
    const MatrixView<const T> mask = std::as_const(arena).values(handles.mask);
    const MatrixView<T> d_mask = arena.gradients(handles.mask);
    executor.for_chunks(full_panels, full_grain, [&](std::size_t first, std::size_t last, std::size_t worker) {
      for (std::size_t p = first; p < last; ++p) {
        Scratch& s = context.scratch[worker];
        full_panel_backward(context.entries.first_full + p * panel, d_rows, outside, mask, d_mask, s,
                            sums_of(first / full_grain), context);
        spread((light_panels + p) * panel, back_rows, s, context);
      }
    });
    const typename Network::template Views<T> gradients{
        arena.gradients(handles.weight1), arena.gradients(handles.bias1), arena.gradients(handles.weight2),
        arena.gradients(handles.bias2)};
    executor.for_chunks(Network::gradient_count, 2048, [&](std::size_t begin, std::size_t end, std::size_t) {
      T* const to = sums_of(0);
      for (std::size_t chunk = 1; chunk < most_chunks; ++chunk) {
        const T* const from = sums_of(chunk);
        for (std::size_t i = begin; i < end; ++i) to[i] += from[i];
      }
    });
    Network::add_gradients(sums_of(0), gradients);
    const MatrixView<T> d_table = arena.gradients(handles.grid);
    Grid::backward(context.grid, context.back_position.data(), back_rows, context.d_grid.data(), back_rows,
                   context.phase.counts ? context.hash_weight : 0.0, d_table, executor);
    if (!context.phase.counts) return;
    mask_penalty_backward<T>(mask, settings_.mask_weight, d_mask, executor);
  }

  [[nodiscard]] const Settings& settings() const { return settings_; }

 private:
  static constexpr std::size_t panel = static_cast<std::size_t>(Network::panel);
  static_assert(panel == HacEntries::panel);
  static constexpr std::size_t input_row = static_cast<std::size_t>(Network::input_row);
  static constexpr std::size_t hidden_row = static_cast<std::size_t>(Network::hidden_row);
  static constexpr std::size_t output_row = static_cast<std::size_t>(Network::output_row);
  static constexpr std::size_t tail_row = static_cast<std::size_t>(Network::tail_row);
  using Base::mask_row, Base::most_chunks, Base::noise_row, Base::scalars, Base::step_output;
  static constexpr std::size_t partials =
      8;  // weighted bits of three groups, unmasked offsets, steps of three groups, and one to spare

  [[nodiscard]] static typename Network::template Views<const T> network(const ParameterArena<T>& arena,
                                                                         const Handles& handles) {
    return {arena.values(handles.weight1), arena.values(handles.bias1), arena.values(handles.weight2),
            arena.values(handles.bias2)};
  }
  void set_weights(std::size_t anchors, const RateReport& report, Context& context) const {
    const double share = settings_.anchor_mask ? 1 : report.unmasked_share;
    const std::size_t full = context.entries.full;
    context.unit = full == 0 ? 0 : settings_.lambda * share / static_cast<double>(full * scalars);
    context.hash_weight = settings_.lambda / static_cast<double>(std::max<std::size_t>(1, anchors) * scalars);
  }
  /// Grid and hidden layer at a panel of positions. Two computations are cheaper than keeping 830 bytes an anchor.
  static void see(const T* unit, Scratch& s, const Context& context) {
    if constexpr (input_row != Grid::channels) std::fill(std::begin(s.input), std::end(s.input), T(0));
    Grid::interpolate(context.grid, unit, panel, s.input, input_row);
    Network::hidden_layer(context.packed.data(), s.input, s.hidden);
  }
  /// … of the entries begin … end - 1, whose panel may reach beyond.
  static void see(MatrixView<const T> box, MatrixView<const T> position, std::size_t begin, std::size_t end, Scratch& s,
                  Context& context) {
    T* const unit = context.position.data() + 3 * begin;
    std::fill_n(unit, 3 * panel, T(-1));  // outside the box
    for (std::size_t e = begin; e < end; ++e) {
      Grid::normalise(box, position.row(context.entries.row[e]), unit + 3 * (e - begin));
    }
    see(unit, s, context);
  }
  void full_panel(const ParameterArena<T>& arena, const Handles& handles, std::size_t begin, MatrixView<const T> box,
                  MatrixView<const T> position, const Random& random, const typename Base::template Tables<T>& to,
                  const typename Base::template Tables<const T>& raw, Scratch& s, Context& context) const {
    const std::size_t end = std::min(begin + panel, context.entries.first_full + context.entries.full);
    see(box, position, begin, end, s, context);
    Network::all_outputs(context.packed.data(), s.hidden, s.output);
    const MatrixView<const T> mask = arena.values(handles.mask);
    Attributes::load_statistics(arena.values(handles.statistics), s.rate);
    double* const partial = context.partial.data() + begin / panel * partials;
    std::fill_n(partial, partials, 0.0);
    for (std::size_t e = begin; e < end; ++e) {
      const std::size_t f = e - context.entries.first_full, row = context.entries.row[e];
      const T* const output = s.output + (e - begin) * output_row;
      const std::array<T, 3> q = Base::take_steps(settings_, output + step_output, e, context);
      bool good = false;
      if (context.entries.visible(e)) {
        good = Base::distort(settings_, random, q, e, context.entries.row[e], to, s.rate.values, context);
        for (std::size_t g = 0; g < 3; ++g) partial[4 + g] += static_cast<double>(q[g]);
      } else {
        good = Base::distort_copy(settings_, random, q, e, context.entries.row[e], raw, s, context);
      }
      if (!good) Base::leave_unrated(s);
      const typename Attributes::Bits bits = Base::rate(settings_, output, output_row, q, mask.row(row), f, s, context);
      for (std::size_t g = 0; g < 3; ++g) partial[g] += bits.weighted[g];
      partial[3] += bits.unmasked;
    }
  }

  /// The report from the panels' sums, and the masks' part of the loss.
  template <Executor E>
  void total(const ParameterArena<T>& arena, const Handles& handles, std::size_t listed, Context& context,
             RateReport& report, E& executor) const {
    std::array<double, partials> sums{};
    for (std::size_t p = 0; p < context.entries.capacity / panel; ++p) {
      for (std::size_t i = 0; i < partials; ++i) sums[i] += context.partial[p * partials + i];
    }
    Base::report_steps(sums.data() + 4, static_cast<double>(std::max<std::size_t>(1, listed)), report);
    if (!context.phase.counts) return;
    const double sampled = static_cast<double>(std::max<std::size_t>(1, context.entries.full));
    const double bits = Base::report_bits(sums.data(), sampled, sums[3], report);
    report.hash_bits = context.grid.bits;
    const double penalty = mask_penalty<T>(arena.values(handles.mask), context.partial, executor);
    // Contracted by hand: a compiler may do it for one executor and not for another.
    report.loss =
        std::fma(settings_.mask_weight, penalty, std::fma(context.hash_weight, context.grid.bits, context.unit * bits));
  }
  /// Carries the light entries' gradients back to their rows; lists those whose steps have one and are drawn. Returns
  /// how many.
  template <Executor E>
  std::size_t light_gradients(const typename Base::template Tables<T>& d, Context& context, E& executor) const {
    context.d_step.resize(context.entries.light * 3);
    const Random random(context.phase.seed, context.phase.iteration, random_stage("hac steps"));
    executor.for_chunks(context.entries.light, panel, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t e = begin; e < end; ++e) {
        const std::uint32_t row = context.entries.row[e];
        Base::pull_drawn_steps(settings_, settings_.step_share, random, e, row,
                               Base::pull_back(e, row, nullptr, d, context), context);
      }
    });
    context.back.resize(context.entries.light);
    std::size_t active = 0;
    for (std::size_t e = 0; e < context.entries.light; ++e) {
      const T* const step = context.d_step.data() + 3 * e;
      context.back[active] = static_cast<std::uint32_t>(e);
      active += step[0] == T(0) && step[1] == T(0) && step[2] == T(0) ? 0 : 1;  // a NaN stays in
    }
    return active;
  }
  void light_panel_backward(std::size_t begin, std::size_t end, std::size_t back_rows, Scratch& s, T* sums,
                            Context& context) const {
    std::fill(std::begin(s.tail), std::end(s.tail), T(0));
    T* const position = context.back_position.data() + 3 * begin;
    std::fill_n(position, 3 * panel, T(-1));  // outside the box
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t e = context.back[i], lane = i - begin;
      std::copy_n(context.position.data() + 3 * e, 3, position + 3 * lane);
      std::copy_n(context.d_step.data() + 3 * e, 3, s.tail + lane * tail_row);
    }
    see(position, s, context);
    Network::backward_tail(context.packed.data(), s.input, s.hidden, s.tail, s.d_hidden, s.d_input, sums);
    spread(begin, back_rows, s, context);
  }
  void full_panel_backward(std::size_t begin, const typename Base::template Tables<T>& d,
                           const typename Base::template Tables<T>& outside, MatrixView<const T> mask,
                           MatrixView<T> d_mask, Scratch& s, T* sums, Context& context) const {
    const std::size_t end = std::min(begin + panel, context.entries.first_full + context.entries.full);
    std::fill(std::begin(s.output), std::end(s.output), T(0));
    for (std::size_t e = begin; e < end; ++e) {
      const std::size_t f = e - context.entries.first_full, row = context.entries.row[e];
      const T* const rate = context.rate_value.data() + f * noise_row;
      const std::array<T, 3> d_step = context.entries.visible(e)
                                          ? Base::pull_back(e, row, rate, d, context)
                                          : Base::pull_back_copy(e, row, rate, outside, s, context);
      Base::pull_outputs(settings_, e, f, d_step, s.output + (e - begin) * output_row, output_row, mask.row(row),
                         d_mask.row(row), context);
    }
    see(context.position.data() + 3 * begin, s, context);
    Network::backward_all(context.packed.data(), s.input, s.hidden, s.output, s.d_hidden, s.d_input, sums);
  }
  /// A panel's gradients by the network's inputs, a level after the other.
  static void spread(std::size_t begin, std::size_t back_rows, const Scratch& s, Context& context) {
    for (std::size_t level = 0; level < Grid::levels; ++level) {
      T* const to = context.d_grid.data() + 4 * (level * back_rows + begin);
      for (std::size_t i = 0; i < panel; ++i) std::copy_n(s.d_input + i * input_row + 4 * level, 4, to + 4 * i);
    }
  }

  Settings settings_{};
};

}  // namespace compmark
