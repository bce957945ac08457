// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// HacModel, the entropy model of HAC while training (Chen et al., ECCV 2024; compression sheet, 1): a binary hash grid says where an anchor is, a
// network what its attributes are likely to be and how finely they are quantized, q = Q0 (1 + tanh r); the attributes carry the noise of
// these steps, and the bits they would take are a loss,
//   lambda (bits / scalar + bits of the grid / (N (D + 6 + 3 K))) + 5e-4 mean(sigmoid(mask logits)),
// estimated on a random twentieth of all anchors (HAC++; HAC itself: of the visible live ones, times their live share). Before the context
// begins the noise is that of Q0. Anchors whose rate is not counted in an iteration need only their steps, 3 of 175 outputs.
// Rows outside the visible list whose rate is counted get it straight into the arena's gradients of the blocks "anchor.feature",
// "anchor.scaling" and "anchor.offset", found by name when the parameters are added; without these blocks only listed rows are sampled.
// Everything runs in fixed panels of 64 anchors: same bits at any thread count. Cost at n visible anchors: n 86 random numbers,
// n (576 + 9.7 k) multiply-adds forward and twice that backward; memory 1.2 KB a visible anchor.
// Longer than 300 lines: both ways of both kinds of panels share one layout.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/entropy/concept.hpp"
#include "compmark/entropy/context_network.hpp"
#include "compmark/entropy/hac_attributes.hpp"
#include "compmark/entropy/hac_entries.hpp"
#include "compmark/entropy/hac_parameters.hpp"
#include "compmark/entropy/hash_grid.hpp"
#include "compmark/entropy/mask_penalty.hpp"
#include "compmark/entropy/offset_mask.hpp"
#include "compmark/entropy/rate.hpp"

namespace compmark::inline v0 {

template <class T, int feature_dim = 50, int offsets = 10, HashGridShape grid_shape = HashGridShape{}>
class HacModel {
 public:
  static constexpr bool is_absent = false;
  using Scalar = T;
  using Phase = RatePhase;
  using Report = RateReport;
  using Handles = HacHandles;
  using Attributes = HacAttributes<T, feature_dim, offsets>;
  using Grid = HashGrid<T, grid_shape>;
  static constexpr HashGridShape shape = grid_shape;
  static constexpr int hidden = 100;
  using Network = ContextNetwork<T, grid_shape.channels(), hidden, Attributes::outputs, 3>;

  struct Settings {
    double lambda = 0.001;
    double mask_weight = 5e-4;
    double sample = 0.05;    ///< share of the anchors whose rate is counted in an iteration
    bool sample_all = true;  ///< of all anchors, else of the visible ones
    /// Share of the light anchors that teach their steps in an iteration, at 1 / share the weight: the same mean, less work, more noise. At
    /// a quarter, 15 % of an iteration is saved and the noise costs the grid's own bits (twice as many in a short run).
    double step_share = 1;
    bool anchor_mask = true;  ///< bits of features and extents weigh by the straight-through mask of the anchor
    double feature_step = 1, scaling_step = 0.001, offset_step = 0.2;  ///< Q0; that of extents in world units
    double least_extent = 1e-6;  ///< a distorted extent stays above it, world units
  };

  struct Scratch {
    alignas(64) T output[static_cast<std::size_t>(Network::panel * Network::output_row)];
    alignas(64) T tail[static_cast<std::size_t>(Network::panel * Network::tail_row)];
    alignas(64) T input[static_cast<std::size_t>(Network::panel * Network::input_row)];
    alignas(64) T hidden[static_cast<std::size_t>(Network::panel * Network::hidden_row)];
    alignas(64) T d_hidden[static_cast<std::size_t>(Network::panel * Network::hidden_row)];
    alignas(64) T d_input[static_cast<std::size_t>(Network::panel * Network::input_row)];
    alignas(64) T feature[static_cast<std::size_t>(feature_dim)];
    alignas(64) T scaling[6];
    alignas(64) T offset[static_cast<std::size_t>(3 * offsets)];
    typename Attributes::Scratch rate;
  };
  /// Compact tables, a row an entry (hac_entries.hpp).
  struct Context {
    RatePhase phase;
    HacEntries entries;
    double unit = 0;           ///< loss of one bit of the sample
    double hash_weight = 0;    ///< loss of one bit of the grid
    Buffer<T> position;        ///< [3] in the box
    Buffer<T> step;            ///< [3] q
    Buffer<T> noise, extents;  ///< as Attributes wants them
    // The way back takes only those light entries that have a gradient, half of them where half of the anchors are hidden.
    Buffer<T> d_step;            ///< [3] by the raw steps
    Buffer<std::uint32_t> back;  ///< light entries with one
    Buffer<T> back_position;     ///< [3] of these, to whole panels, then of the full ones
    Buffer<T> d_grid;            ///< by the network's inputs, level-major, rows as back_position
    Buffer<T> rate_value, rate_output, rate_step, rate_mask;  ///< full entries: gradients of the rate
    Buffer<double> partial;
    Buffer<T> packed, chunk_gradients;
    Buffer<Scratch> scratch;  ///< one a worker
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
  /// Opacity 0 where an offset's mask is dead; see offset_mask.hpp.
  template <Executor E>
  static void mask_opacity(const ParameterArena<T>& arena, const Handles& handles, std::span<const std::uint32_t> slot,
                           T* opacity, E& executor) {
    compmark::mask_opacity<T>(arena.values(handles.mask), slot, opacity, executor);
  }
  template <Executor E>
  static void mask_opacity_backward(ParameterArena<T>& arena, const Handles& handles,
                                    std::span<const std::uint32_t> slot, const T* opacity, const T* d_opacity,
                                    E& executor) {
    compmark::mask_opacity_backward<T>(std::as_const(arena).values(handles.mask), slot, opacity, d_opacity,
                                       arena.gradients(handles.mask), executor);
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
    context.noise.resize(context.entries.capacity * noise_row);
    context.extents.resize(context.entries.capacity * 12);
    context.scratch.resize(executor.concurrency());
    const Random random(phase.seed, phase.iteration, random_stage("hac noise"));
    if (!phase.context) {
      executor.for_chunks(context.entries.light, panel, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t e = begin; e < end; ++e) {
          distort(random, base_steps(), e, feature, scaling, offset, nullptr, context);
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
    context.rate_value.resize(full_rows * noise_row);
    context.rate_output.resize(full_rows * output_row);
    context.rate_step.resize(full_rows * 3);
    context.rate_mask.resize(full_rows * mask_row);
    const MatrixView<const T> box = arena.values(handles.box);
    executor.for_chunks(context.entries.first_full, panel, [&](std::size_t begin, std::size_t, std::size_t worker) {
      const std::size_t end = std::min(begin + panel, context.entries.light);
      Scratch& s = context.scratch[worker];
      see(box, position, begin, end, s, context);
      Network::tail_outputs(context.packed.data(), s.hidden, s.tail);
      std::array<double, 3> sums{};
      for (std::size_t e = begin; e < end; ++e) {
        const std::array<T, 3> q = steps(s.tail + (e - begin) * tail_row, e, context);
        for (std::size_t g = 0; g < 3; ++g) sums[g] += static_cast<double>(q[g]);
        distort(random, q, e, feature, scaling, offset, nullptr, context);
      }
      double* const partial = context.partial.data() + begin / panel * partials;
      std::fill_n(partial, partials, 0.0);
      std::copy_n(sums.data(), 3, partial + 4);
    });
    const AnchorTables<const T> raw = tables<const T>(arena, handles);
    executor.for_chunks(context.entries.capacity - context.entries.first_full, panel,
                        [&](std::size_t begin, std::size_t, std::size_t worker) {
                          full_panel(arena, handles, context.entries.first_full + begin, box, position, random,
                                     {feature, scaling, offset}, raw, context.scratch[worker], context);
                        });
    total(arena, handles, rows.size(), context, report, executor);
    return report;
  }

  /// Turns the gradients by the distorted rows into those by the rows before (in place), adds the rate's, and ADDS those of masks, grid and
  /// network (and of sampled rows that were not listed) into the arena.
  template <Executor E>
  void backward(ParameterArena<T>& arena, const Handles& handles, std::span<const std::uint32_t> rows,
                MatrixView<T> d_feature, MatrixView<T> d_scaling, MatrixView<T> d_offset, Context& context,
                E& executor) const {
    const AnchorTables<T> d_rows{d_feature, d_scaling, d_offset};
    COMPMARK_ASSERT(context.phase.context || rows.size() == context.entries.light,
                    "HacModel: not the rows of the last forward");
    static_cast<void>(rows);
    if (!context.phase.context) {
      executor.for_chunks(context.entries.light, panel, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t e = begin; e < end; ++e) pull_back(e, nullptr, d_rows, context);
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
    const AnchorTables<T> outside = tables<T>(arena, handles);
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
    Grid::backward(context.grid, context.back_position.data(), back_rows, context.d_grid.data(), back_rows, d_table,
                   executor);
    if (!context.phase.counts) return;
    Grid::bits_backward(context.grid, context.hash_weight, d_table, executor);
    mask_penalty_backward<T>(mask, settings_.mask_weight, d_mask, executor);
  }

  [[nodiscard]] const Settings& settings() const { return settings_; }

 private:
  template <class U>
  struct AnchorTables {
    MatrixView<U> feature, scaling, offset;
  };
  static constexpr std::size_t panel = static_cast<std::size_t>(Network::panel);
  static_assert(panel == HacEntries::panel);
  static constexpr std::size_t input_row = static_cast<std::size_t>(Network::input_row);
  static constexpr std::size_t hidden_row = static_cast<std::size_t>(Network::hidden_row);
  static constexpr std::size_t output_row = static_cast<std::size_t>(Network::output_row);
  static constexpr std::size_t tail_row = static_cast<std::size_t>(Network::tail_row);
  static constexpr std::size_t noise_row = static_cast<std::size_t>(Attributes::row);
  static constexpr std::size_t mask_row = static_cast<std::size_t>(offsets);
  static constexpr std::size_t scalars = static_cast<std::size_t>(Attributes::scalars);
  static constexpr std::size_t step_output = static_cast<std::size_t>(Attributes::outputs - 3);
  static constexpr std::size_t most_chunks = 16;
  static constexpr std::size_t partials =
      8;  // weighted bits of three groups, live offsets, steps of three groups, and one to spare

  [[nodiscard]] static typename Network::template Views<const T> network(const ParameterArena<T>& arena,
                                                                         const Handles& handles) {
    return {arena.values(handles.weight1), arena.values(handles.bias1), arena.values(handles.weight2),
            arena.values(handles.bias2)};
  }
  /// Values (T const) or gradients of the anchors' own blocks; empty where the arena has none.
  template <class U, class Arena>
  [[nodiscard]] static AnchorTables<U> tables(Arena& arena, const Handles& handles) {
    if (!handles.feature.valid()) return {};
    if constexpr (std::is_const_v<U>) {
      return {arena.values(handles.feature), arena.values(handles.scaling), arena.values(handles.offset)};
    } else {
      return {arena.gradients(handles.feature), arena.gradients(handles.scaling), arena.gradients(handles.offset)};
    }
  }
  [[nodiscard]] std::array<T, 3> base_steps() const {
    return {static_cast<T>(settings_.feature_step), static_cast<T>(settings_.scaling_step),
            static_cast<T>(settings_.offset_step)};
  }

  void set_weights(std::size_t anchors, const RateReport& report, Context& context) const {
    const double share = settings_.anchor_mask ? 1 : report.live_share;
    const std::size_t full = context.entries.full;
    context.unit = full == 0 ? 0 : settings_.lambda * share / static_cast<double>(full * scalars);
    context.hash_weight = settings_.lambda / static_cast<double>(std::max<std::size_t>(1, anchors) * scalars);
  }
  /// Grid and hidden layer at a panel of positions. Cheaper twice than kept: 830 bytes an anchor, written and read.
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
  [[nodiscard]] std::array<T, 3> steps(const T* raw, std::size_t entry, Context& context) const {
    T q[3 + native_width<T>];
    if (context.phase.context && context.phase.round)
      Attributes::coded_steps(raw, base_steps(), q);
    else
      Attributes::steps(raw, base_steps(), q);
    std::copy_n(q, 3, context.step.data() + 3 * entry);
    return {q[0], q[1], q[2]};
  }
  /// False for an anchor with a NaN or infinity among its attributes: it stays as it is.
  bool distort(const Random& random, const std::array<T, 3>& q, std::size_t entry, T* feature, T* scaling, T* offset,
               T* values, Context& context) const {
    T* const noise = context.noise.data() + entry * noise_row;
    T* const extents = context.extents.data() + entry * 12;
    if (!Attributes::finite(feature, scaling, offset)) {
      Attributes::leave(noise, extents);
      return false;
    }
    const bool round = context.phase.context && context.phase.round;
    if (!round) Attributes::draw(random, context.entries.row[entry], noise);
    Attributes::distort(round, q, static_cast<T>(settings_.least_extent), feature, scaling, offset, noise, extents,
                        values);
    return true;
  }
  bool distort(const Random& random, const std::array<T, 3>& q, std::size_t entry, MatrixView<T> feature,
               MatrixView<T> scaling, MatrixView<T> offset, T* values, Context& context) const {
    const std::size_t row = context.entries.row[entry];
    return distort(random, q, entry, feature.row(row), scaling.row(row), offset.row(row), values, context);
  }
  void full_panel(const ParameterArena<T>& arena, const Handles& handles, std::size_t begin, MatrixView<const T> box,
                  MatrixView<const T> position, const Random& random, const AnchorTables<T>& to,
                  const AnchorTables<const T>& raw, Scratch& s, Context& context) const {
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
      const std::array<T, 3> q = steps(output + step_output, e, context);
      bool good = false;
      if (context.entries.visible(e)) {
        good = distort(random, q, e, to.feature, to.scaling, to.offset, s.rate.values, context);
        for (std::size_t g = 0; g < 3; ++g) partial[4 + g] += static_cast<double>(q[g]);
      } else {
        std::copy_n(raw.feature.row(row), raw.feature.columns, s.feature);
        std::copy_n(raw.scaling.row(row), raw.scaling.columns, s.scaling);
        std::copy_n(raw.offset.row(row), raw.offset.columns, s.offset);
        good = distort(random, q, e, s.feature, s.scaling, s.offset, s.rate.values, context);
      }
      std::array<T, 3> d_step{};
      if (!good) std::fill(std::begin(s.rate.values), std::end(s.rate.values), std::numeric_limits<T>::quiet_NaN());
      const typename Attributes::Bits bits =
          Attributes::rate(output, q, mask.row(row), settings_.anchor_mask, static_cast<T>(context.unit), s.rate,
                           context.rate_value.data() + f * noise_row, context.rate_output.data() + f * output_row,
                           d_step, context.rate_mask.data() + f * mask_row);
      std::copy_n(d_step.data(), 3, context.rate_step.data() + 3 * f);
      for (std::size_t g = 0; g < 3; ++g) partial[g] += bits.weighted[g];
      partial[3] += bits.live;
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
    const double n = static_cast<double>(std::max<std::size_t>(1, listed));
    report.step_feature = sums[4] / n;
    report.step_scaling = sums[5] / n;
    report.step_offset = sums[6] / n;
    if (!context.phase.counts) return;
    const double sampled = static_cast<double>(std::max<std::size_t>(1, context.entries.full));
    report.live_offsets = sums[3] / (sampled * offsets);
    report.bits_feature = sums[0] / (sampled * feature_dim);
    report.bits_scaling = sums[1] / (sampled * 6);
    report.bits_offset = sums[2] / (sampled * 3 * offsets);
    const double bits = sums[0] + sums[1] + sums[2];
    report.bits_per_scalar = bits / (sampled * static_cast<double>(scalars));
    report.hash_bits = context.grid.bits;
    const double penalty = mask_penalty<T>(arena.values(handles.mask), context.partial, executor);
    // Contracted by hand: a compiler may do it for one executor and not for another.
    report.loss =
        std::fma(settings_.mask_weight, penalty, std::fma(context.hash_weight, context.grid.bits, context.unit * bits));
  }
  /// One entry's gradients, in place; returns those by its steps.
  static std::array<T, 3> pull_back(std::size_t entry, const T* rate, const AnchorTables<T>& d,
                                    const Context& context) {
    const std::size_t row = context.entries.row[entry];
    return Attributes::pull_back(context.noise.data() + entry * noise_row, context.extents.data() + entry * 12, rate,
                                 d.feature.row(row), d.scaling.row(row), d.offset.row(row));
  }
  void pull_steps(std::size_t entry, const std::array<T, 3>& d_step, T* to, const Context& context) const {
    const std::array<T, 3> base = base_steps();
    for (std::size_t g = 0; g < 3; ++g) {
      to[g] = Attributes::pull_step(context.step[3 * entry + g], base[g], d_step[g]);
    }
  }
  /// Carries the light entries' gradients back to their rows; lists those whose steps have one and are drawn. Returns how many.
  template <Executor E>
  std::size_t light_gradients(const AnchorTables<T>& d, Context& context, E& executor) const {
    context.d_step.resize(context.entries.light * 3);
    const Random random(context.phase.seed, context.phase.iteration, random_stage("hac steps"));
    const T weight = static_cast<T>(settings_.step_share >= 1 ? 1 : 1 / settings_.step_share);
    executor.for_chunks(context.entries.light, panel, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t e = begin; e < end; ++e) {
        std::array<T, 3> d_step = pull_back(e, nullptr, d, context);
        const bool drawn = settings_.step_share >= 1 || random.uniform(context.entries.row[e]) < settings_.step_share;
        for (T& value : d_step) value = drawn ? value * weight : T(0);
        pull_steps(e, d_step, context.d_step.data() + 3 * e, context);
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
  void full_panel_backward(std::size_t begin, const AnchorTables<T>& d, const AnchorTables<T>& outside,
                           MatrixView<const T> mask, MatrixView<T> d_mask, Scratch& s, T* sums,
                           Context& context) const {
    const std::size_t end = std::min(begin + panel, context.entries.first_full + context.entries.full);
    std::fill(std::begin(s.output), std::end(s.output), T(0));
    for (std::size_t e = begin; e < end; ++e) {
      const std::size_t f = e - context.entries.first_full, row = context.entries.row[e];
      const T* const rate = context.rate_value.data() + f * noise_row;
      std::array<T, 3> d_step{};
      if (context.entries.visible(e)) {
        d_step = pull_back(e, rate, d, context);
      } else {
        std::fill(std::begin(s.feature), std::end(s.feature), T(0));
        std::fill(std::begin(s.scaling), std::end(s.scaling), T(0));
        std::fill(std::begin(s.offset), std::end(s.offset), T(0));
        d_step = Attributes::pull_back(context.noise.data() + e * noise_row, context.extents.data() + e * 12, rate,
                                       s.feature, s.scaling, s.offset);
        add(s.feature, outside.feature, row);
        add(s.scaling, outside.scaling, row);
        add(s.offset, outside.offset, row);
      }
      for (std::size_t g = 0; g < 3; ++g) d_step[g] += context.rate_step[3 * f + g];
      T* const output = s.output + (e - begin) * output_row;
      std::copy_n(context.rate_output.data() + f * output_row, step_output, output);
      pull_steps(e, d_step, output + step_output, context);
      for (std::size_t k = 0; k < mask_row; ++k) {
        d_mask(row, k) += context.rate_mask[f * mask_row + k] * mask_slope(mask(row, k));
      }
    }
    see(context.position.data() + 3 * begin, s, context);
    Network::backward_all(context.packed.data(), s.input, s.hidden, s.output, s.d_hidden, s.d_input, sums);
  }
  static void add(const T* from, const MatrixView<T>& to, std::size_t row) {
    for (std::size_t c = 0; c < to.columns; ++c) to(row, c) += from[c];
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

}  // namespace compmark::inline v0
