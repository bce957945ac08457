// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// ContextGsModel, the entropy model of ContextGS in training (Wang et al., NeurIPS 2024; docs/spec/compression.md, 2).
// It has no hash grid: a network predicts an anchor's attributes and quantizer steps from its parent, the anchor of its
// cell that was coded before it (anchor_levels.hpp), and from a hyperprior z of 12 numbers an anchor, which is coded
// first under a factorised prior. Inputs and outputs: context_gs_parameters.hpp. Parents are read as a decoder has
// them: with the noise of their own steps, or rounded. The loss is
//   lambda (bits of f, l, o and z) / scalars of f, l, o + 5e-4 mean(sigmoid(mask logits)),
// estimated on a random 15 % of all anchors, of which masked ones cost nothing, as HacModel has it with `anchor_mask`
// (published: of the unmasked ones, times their share); z counts for every unmasked anchor. Parents get gradients
// through their children's inputs. Noise is a function of (seed, iteration, row, scalar): an anchor has one value in an
// iteration for all its readers. Masked rows pass unchanged. Rows that are evaluated without being listed are read from
// the blocks "anchor.feature", "anchor.scaling" and "anchor.offset" and have their gradients there; where an Embedder
// marks features, its table holds every row and is read instead (Context::all_features). Everything runs in panels of
// 64 anchors, level by level, sums in fixed order: same bits at any thread count. Cost of an anchor that is evaluated:
// 7.1 k multiply-adds forward and 14 k backward, 17.5 k and 35 k more and 12 scalars of the prior where its rate
// counts; memory 2.2 KB. Longer than 300 lines: both ways of both kinds of panels share one layout.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "compmark/codec/context_gs/context_gs_levels.hpp"
#include "compmark/codec/context_gs/context_gs_parameters.hpp"
#include "compmark/codec/context_gs/context_gs_plan.hpp"
#include "compmark/codec/rate/anchor_rate_model.hpp"
#include "compmark/codec/rate/concept.hpp"
#include "compmark/codec/rate/context_network.hpp"
#include "compmark/codec/rate/factorised_prior.hpp"
#include "compmark/codec/rate/mask_penalty.hpp"
#include "compmark/codec/rate/rate.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

template <class T, int feature_dim = 50, int offsets = 10, int hyper_dim = 12, class Quantizer = AdaptiveQuantizer<T>>
class ContextGsModel : public AnchorRateModel<T, feature_dim, offsets, ContextGsHandles, Quantizer> {
  using Base = AnchorRateModel<T, feature_dim, offsets, ContextGsHandles, Quantizer>;
  using typename Base::EntryTables;
  using typename Base::RowScratch;
  template <class U>
  using Tables = typename Base::template Tables<U>;

 public:
  using typename Base::Attributes;
  using typename Base::Handles;
  /// The same model with the recipe's quantizer.
  template <class Other>
    requires has_coded_steps<Other>
  using WithQuantizer = ContextGsModel<T, feature_dim, offsets, hyper_dim, Other>;
  using Prior = FactorisedPrior<T, hyper_dim>;
  static constexpr int hidden = 100;
  static constexpr int geometry = feature_dim + 6;  ///< scalars of a parent that its children read
  using Root = ContextNetwork<T, 3 + hyper_dim, hidden, Attributes::outputs, 3>;              ///< of level 2
  using Child = ContextNetwork<T, 3 + geometry + hyper_dim, hidden, Attributes::outputs, 3>;  ///< of levels 1 and 0

  struct Settings : AnchorRateSettings {
    double sample = 0.15;   ///< share of the anchors whose rate is counted in an iteration
    double step_share = 1;  ///< as HacModel has it; half of them save nothing here (1.71 and 1.70 plain iterations)
  };

  struct Scratch : RowScratch {
    alignas(64) T output[static_cast<std::size_t>(Child::panel * Child::output_row)];
    alignas(64) T tail[static_cast<std::size_t>(Child::panel * Child::tail_row)];
    alignas(64) T d_hidden[static_cast<std::size_t>(Child::panel * Child::hidden_row)];
    alignas(64) T z[static_cast<std::size_t>(Child::panel * hyper_dim)],
        d_z[static_cast<std::size_t>(Child::panel * hyper_dim)];
    alignas(64) T weight[static_cast<std::size_t>(Child::panel)], z_bits[static_cast<std::size_t>(Child::panel)];
    alignas(64) T d_value[static_cast<std::size_t>(Attributes::row)];
    alignas(64) T input[static_cast<std::size_t>(Child::panel * Child::input_row)];
    alignas(64) T d_input[static_cast<std::size_t>(Child::panel * Child::input_row)];
    alignas(64) T hidden[static_cast<std::size_t>(Child::panel * Child::hidden_row)];
  };
  struct Context : EntryTables {
    bool all_features = false;  ///< the caller's: the table of features holds every row, not the listed ones alone
    ContextGsLevels<T> levels;
    ContextGsPlan plan;
    Buffer<T> input;   ///< of the networks, by entry; rows of `input_row`
    Buffer<T> hidden;  ///< by entry
    // The backward pass takes only those light entries that have a gradient.
    Buffer<T> d_seen;             ///< by entry: gradients by what it read of its parent
    Buffer<std::uint8_t> active;  ///< by entry: whether it has
    Buffer<std::uint32_t> back;   ///< light entries of a level that have
    Buffer<T> seen;               ///< [coarse, geometry] a parent as its children see it
    Buffer<T> inverse;            ///< of the deviations
    Buffer<T> rate_hyper;         ///< of rated entries: gradients of the rate by z
    Buffer<T> prior, prior_sums;
    Buffer<double> partial;
    std::array<Buffer<T>, 3> packed;
    Buffer<T> chunk_gradients;
    PerWorker<Scratch> scratch;
  };

  ContextGsModel() = default;
  explicit ContextGsModel(const Settings& settings) : settings_(settings) {}

  [[nodiscard]] static Handles add_parameters(ParameterArena<T>& arena, std::size_t anchor_rows) {
    return add_context_gs_blocks<T, Root, Child, Attributes, Prior>(arena, anchor_rows, mask_row);
  }
  static void initialise(ParameterArena<T>& arena, const Handles& handles, std::uint64_t seed) {
    initialise_context_gs<Prior>(arena, handles, seed);
  }
  /// Box, statistics and cells from all anchors as they are: call before the first iteration with context.
  static void begin_context(ParameterArena<T>& arena, const Handles& handles, MatrixView<const T> position,
                            MatrixView<const T> feature, MatrixView<const T> scaling, MatrixView<const T> offset,
                            double voxel_size) {
    begin_context_gs<Attributes>(arena, handles, position, feature, scaling, offset, voxel_size);
  }
  /// New cells for the same voxels' grid: when growing has ended.
  static void choose_cells(ParameterArena<T>& arena, const Handles& handles, MatrixView<const T> position) {
    choose_context_gs_cells(arena, handles, position);
  }
  /// Distorts the listed rows of the three tables in place; `position` is the whole table. Ancestors that are not
  /// listed are read from the arena; with Context::all_features their features from `feature`, and their gradients go
  /// to its.
  template <Executor E>
  RateReport forward(const ParameterArena<T>& arena, const Handles& handles, std::span<const std::uint32_t> rows,
                     const RatePhase& phase, MatrixView<const T> position, MatrixView<T> feature, MatrixView<T> scaling,
                     MatrixView<T> offset, Context& context, E& executor) const {
    context.phase = phase;
    const Tables<T> to{feature, scaling, offset};
    RateReport report;
    if (!phase.context) {
      base_noise(rows, to, context, executor);
      return report;
    }
    const MatrixView<const T> cells = arena.values(handles.cells);
    COMPMARK_ASSERT(anchor_voxel_size<T>(cells) > 0 && handles.feature.valid(),
                    "ContextGsModel: begin_context comes first, and the anchors are in the arena");
    context.levels.update(position, arena.values(handles.mask), anchor_cells<T>(cells), anchor_voxel_size<T>(cells),
                          executor);
    ContextGsPlan& plan = context.plan;
    plan.build(context.levels.levels(), rows, Random(phase.seed, phase.iteration, random_stage("context gs sample")),
               phase.counts ? settings_.sample : 0);
    context.unit = plan.drawn == 0 ? 0 : settings_.lambda / static_cast<double>(plan.drawn * scalars);
    prepare(arena, handles, context, executor.concurrency());
    executor.for_chunks(most_chunks, 1, [&](std::size_t chunk, std::size_t, std::size_t) {
      std::fill_n(context.prior_sums.data() + chunk * Prior::count, Prior::count, T(0));
    });
    Tables<const T> raw = Base::template tables<const T>(arena, handles);
    if (context.all_features) raw.feature = feature;
    const Forward state{arena, handles, position, to, raw, context};
    level_forward<Root>(2, state, executor);
    level_forward<Child>(1, state, executor);
    level_forward<Child>(0, state, executor);
    total(arena, handles, position.rows, context, report, executor);
    return report;
  }

  /// Turns the gradients by the distorted rows into those by the rows before (in place), adds the rate's and the
  /// children's, and ADDS those of masks, hyperprior, networks and prior (and of looked at rows that were not listed)
  /// into the arena.
  template <Executor E>
  void backward(ParameterArena<T>& arena, const Handles& handles, std::span<const std::uint32_t> rows,
                MatrixView<T> d_feature, MatrixView<T> d_scaling, MatrixView<T> d_offset, Context& context,
                E& executor) const {
    const Tables<T> d_rows{d_feature, d_scaling, d_offset};
    if (!context.phase.context) {
      executor.for_chunks(rows.size(), panel, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t e = begin; e < end; ++e) Base::pull_back(e, rows[e], nullptr, d_rows, context);
      });
      return;
    }
    context.d_seen.resize(context.plan.capacity * seen_row);
    context.d_step.resize(context.plan.capacity * 3);
    context.active.resize(context.plan.capacity);
    context.back.resize(context.plan.capacity);
    context.chunk_gradients.resize(most_chunks * Child::gradient_count);
    Tables<T> outside = Base::template tables<T>(arena, handles);
    if (context.all_features) outside.feature = d_feature;
    const Backward state{arena, handles, d_rows, outside, context};
    level_backward<Child>(0, state, executor);
    level_backward<Child>(1, state, executor);
    level_backward<Root>(2, state, executor);
    if (!context.phase.counts) return;
    T* const sums = context.prior_sums.data();
    for (std::size_t chunk = 1; chunk < most_chunks; ++chunk) {
      for (std::size_t i = 0; i < Prior::count; ++i) sums[i] += sums[chunk * Prior::count + i];
    }
    Prior::add_gradients(std::as_const(arena).values(handles.prior), context.prior.data(), sums,
                         arena.gradients(handles.prior));
    mask_penalty_backward<T>(std::as_const(arena).values(handles.mask), settings_.mask_weight,
                             arena.gradients(handles.mask), executor);
  }

  [[nodiscard]] const Settings& settings() const { return settings_; }

 private:
  struct Forward {
    const ParameterArena<T>& arena;
    const Handles& handles;
    MatrixView<const T> position;
    Tables<T> to;
    Tables<const T> raw;
    Context& context;
  };
  struct Backward {
    ParameterArena<T>& arena;
    const Handles& handles;
    Tables<T> d_rows, outside;
    Context& context;
  };
  static constexpr std::size_t panel = ContextGsPlan::panel;
  static_assert(panel == static_cast<std::size_t>(Root::panel) && panel == static_cast<std::size_t>(Child::panel));
  static constexpr std::size_t input_row = static_cast<std::size_t>(Child::input_row);
  static constexpr std::size_t hidden_row = static_cast<std::size_t>(Child::hidden_row);
  static constexpr std::size_t output_row = static_cast<std::size_t>(Child::output_row);
  static constexpr std::size_t tail_row = static_cast<std::size_t>(Child::tail_row);
  using Base::mask_row, Base::most_chunks, Base::noise_row, Base::scalars, Base::step_output;
  static constexpr std::size_t hyper_row = static_cast<std::size_t>(hyper_dim);
  static constexpr std::size_t seen_row = static_cast<std::size_t>(geometry);
  static constexpr std::size_t partials =
      8;  // weighted bits of three groups, of z, steps of three groups, unmasked offsets

  [[nodiscard]] static typename Child::template Views<const T> network(const ParameterArena<T>& arena,
                                                                       const ContextGsHandles::Network& n) {
    return {arena.values(n.weight1), arena.values(n.bias1), arena.values(n.weight2), arena.values(n.bias2)};
  }
  template <Executor E>
  void base_noise(std::span<const std::uint32_t> rows, const Tables<T>& to, Context& context, E& executor) const {
    context.resize_noise(rows.size());
    const Random random = noise_of(context.phase);
    executor.for_chunks(rows.size(), panel, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t e = begin; e < end; ++e) {
        Base::distort(settings_, random, Base::base_steps(settings_), e, rows[e], to, nullptr, context);
      }
    });
  }
  [[nodiscard]] static Random noise_of(const RatePhase& phase) {
    return {phase.seed, phase.iteration, random_stage("context gs noise")};
  }

  /// Memory and what is computed once an iteration.
  static void prepare(const ParameterArena<T>& arena, const Handles& handles, Context& context, std::size_t workers) {
    const ContextGsPlan& plan = context.plan;
    context.scratch.resize(workers);
    context.input.resize(plan.capacity * input_row);
    context.hidden.resize(plan.capacity * hidden_row);
    context.step.resize(plan.capacity * 3);
    context.resize_noise(plan.capacity);
    context.seen.resize(plan.coarse * seen_row);
    context.resize_rates(plan.rates, output_row);
    context.rate_hyper.resize(plan.rates * hyper_row);
    context.partial.resize(plan.capacity / panel * partials, 0.0);
    for (std::size_t level = 0; level < 2; ++level) {
      Child::pack(network(arena, handles.network[level]), context.packed[level]);
    }
    const auto root = network(arena, handles.network[2]);
    Root::pack({root.weight1, root.bias1, root.weight2, root.bias2}, context.packed[2]);
    context.prior.resize(Prior::count);
    context.prior_sums.resize(most_chunks * Prior::count);
    Prior::prepare(arena.values(handles.prior), context.prior.data());
    const MatrixView<const T> statistics = arena.values(handles.statistics);
    context.inverse.resize(seen_row);
    for (std::size_t c = 0; c < seen_row; ++c) context.inverse[c] = 1 / statistics(1, c);
  }

  /// Panels of a level, dealt to fixed chunks: light and full ones evenly.
  template <class Net, Executor E>
  void level_forward(std::size_t level, const Forward& state, E& executor) const {
    const std::size_t panels = state.context.plan.panels(level);
    executor.for_chunks(most_chunks, 1, [&](std::size_t chunk, std::size_t, std::size_t worker) {
      for (std::size_t p = chunk; p < panels; p += most_chunks) {
        panel_forward<Net>(level, p, state, state.context.scratch[worker],
                           state.context.prior_sums.data() + chunk * Prior::count);
      }
    });
  }

  /// The network's inputs for the entries of a panel.
  template <class Net>
  void see(std::size_t level, const ContextGsPlan::Section& at, const Forward& state) const {
    Context& context = state.context;
    const ContextGsPlan& plan = context.plan;
    T* const input = context.input.data() + at.first * input_row;
    constexpr std::size_t row_size = static_cast<std::size_t>(Net::input_row);
    constexpr std::size_t z_begin = static_cast<std::size_t>(Net::inputs - hyper_dim);
    std::fill_n(input, panel * row_size, T(0));
    const MatrixView<const T> hyperprior = state.arena.values(state.handles.hyperprior);
    const MatrixView<const T> box = state.arena.values(state.handles.box);
    const Random random(context.phase.seed, context.phase.iteration, random_stage("context gs hyperprior"));
    const std::span<const Voxel> voxels = context.levels.voxels();
    const AnchorCells cells = context.levels.cells();
    const T inverse_edge = 1 / static_cast<T>(level == 1 ? cells.coarse : cells.fine);
    for (std::size_t i = 0; i < at.count; ++i) {
      const std::size_t e = at.first + i, row = plan.row[e];
      T* const to = input + i * row_size;
      if constexpr (Net::inputs == Root::inputs) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const T extent = box(1, axis) - box(0, axis);
          const T unit = (state.position(row, axis) - box(0, axis)) / (extent > T(0) ? extent : T(1));
          to[axis] = std::min(std::max(T(-1), 2 * unit - 1), T(1));  // a NaN is -1
        }
      } else {
        const std::size_t parent = plan.parent[e];
        const Voxel &v = voxels[row], &from = voxels[plan.row[parent]];
        for (std::size_t axis = 0; axis < 3; ++axis) {
          to[axis] = static_cast<T>(std::int64_t{v[axis]} - from[axis]) * inverse_edge;
        }
        std::copy_n(context.seen.data() + parent * seen_row, seen_row, to + 3);
      }
      const std::uint64_t start = random.bits(row);
      for (std::size_t c = 0; c < hyper_row; ++c) {
        const T kept = hyperprior(row, c), z = std::abs(kept) < T(1e6) ? kept : T(0);  // a NaN is 0
        const auto bits = static_cast<std::int32_t>(mix_bits(start + c * 0x9E3779B97F4A7C15ull) >> 41);
        const float u = (static_cast<float>(bits) + 0.5f) * 0x1p-23f - 0.5f;
        to[z_begin + c] = context.phase.round ? std::nearbyint(z) : z + static_cast<T>(u);
      }
    }
  }

  template <class Net>
  void panel_forward(std::size_t level, std::size_t p, const Forward& state, Scratch& s, T* prior_sums) const {
    Context& context = state.context;
    const ContextGsPlan& plan = context.plan;
    const ContextGsPlan::Section at = plan.panel_at(level, p);
    const bool full = plan.is_full(level, p);
    const T* const packed = context.packed[level].data();
    T* const hidden_units = context.hidden.data() + at.first * hidden_row;
    see<Net>(level, at, state);
    Net::hidden_layer(packed, context.input.data() + at.first * input_row, hidden_units);
    if (full) {
      Net::all_outputs(packed, hidden_units, s.output);
      Attributes::load_statistics(state.arena.values(state.handles.statistics), s.rate);
      rate_hyper<Net>(at, s, prior_sums, context);
    } else {
      Net::tail_outputs(packed, hidden_units, s.tail);
    }
    const Random random = noise_of(context.phase);
    const MatrixView<const T> statistics = state.arena.values(state.handles.statistics);
    double* const partial = context.partial.data() + at.first / panel * partials;
    for (std::size_t i = 0; i < at.count; ++i) {
      const std::size_t e = at.first + i, row = plan.row[e];
      const T* const raw_step = full ? s.output + i * output_row + step_output : s.tail + i * tail_row;
      const std::array<T, 3> q = Base::take_steps(settings_, raw_step, e, context);
      bool good = false;
      if ((plan.mark[row] & ContextGsPlan::visible) != 0) {
        good = Base::distort(settings_, random, q, e, plan.row[e], state.to, s.rate.values, context);
        for (std::size_t g = 0; g < 3; ++g) partial[4 + g] += static_cast<double>(q[g]);
      } else {
        good = Base::distort_copy(settings_, random, q, e, plan.row[e], state.raw, s, context);
      }
      if (level > 0) {
        T* const seen = context.seen.data() + e * seen_row;
        for (std::size_t c = 0; c < seen_row; ++c) {
          seen[c] = good ? (s.rate.values[c] - statistics(0, c)) * context.inverse[c] : T(0);
        }
      }
      if (!full) continue;
      if (!good) Base::leave_unrated(s);
      rate_entry(plan.rate_of(level, e), i, q, state.arena.values(state.handles.mask).row(row), partial, s, context);
    }
  }
  /// Bits of z of a panel and their gradients, for rate_entry.
  template <class Net>
  void rate_hyper(const ContextGsPlan::Section& at, Scratch& s, T* prior_sums, Context& context) const {
    constexpr std::size_t row_size = static_cast<std::size_t>(Net::input_row);
    const T* const input = context.input.data() + at.first * input_row + (Net::inputs - hyper_dim);
    for (std::size_t i = 0; i < panel; ++i) {
      for (std::size_t c = 0; c < hyper_row; ++c) s.z[c * panel + i] = input[i * row_size + c];
      s.weight[i] = i < at.count ? static_cast<T>(context.unit) : T(0);
      s.z_bits[i] = 0;
    }
    Prior::bits(context.prior.data(), s.z, panel, s.weight, s.z_bits, s.d_z, prior_sums);
  }
  /// Bits of the i-th entry of a panel and their gradients; f is its place among full entries.
  void rate_entry(std::size_t f, std::size_t i, const std::array<T, 3>& q, const T* mask, double* partial, Scratch& s,
                  Context& context) const {
    const typename Attributes::Bits bits =
        Base::rate(settings_, s.output + i * output_row, output_row, q, mask, f, s, context);
    for (std::size_t c = 0; c < hyper_row; ++c) context.rate_hyper[f * hyper_row + c] = s.d_z[c * panel + i];
    if (settings_.anchor_mask) {
      T* const d_mask = context.rate_mask.data() + f * mask_row;
      for (std::size_t k = 0; k < mask_row; ++k) {
        d_mask[k] += static_cast<T>(context.unit) * s.z_bits[i] / static_cast<T>(mask_row);
      }
    }
    for (std::size_t g = 0; g < 3; ++g) partial[g] += bits.weighted[g];
    partial[3] += static_cast<double>(s.z_bits[i]);
    partial[7] += bits.unmasked;
  }

  template <Executor E>
  void total(const ParameterArena<T>& arena, const Handles& handles, std::size_t anchors, Context& context,
             RateReport& report, E& executor) const {
    const ContextGsPlan& plan = context.plan;
    std::array<double, partials> sums{};
    for (std::size_t p = 0; p < plan.capacity / panel; ++p) {
      for (std::size_t i = 0; i < partials; ++i) sums[i] += context.partial[p * partials + i];
    }
    Base::report_steps(sums.data() + 4, static_cast<double>(std::max<std::size_t>(1, plan.visible_unmasked)), report);
    if (!context.phase.counts) return;
    const double drawn = static_cast<double>(std::max<std::size_t>(1, plan.drawn));
    report.sampled = plan.drawn;
    report.unmasked_share = static_cast<double>(plan.drawn_unmasked) / drawn;
    const double bits = Base::report_bits(sums.data(), drawn, sums[7], report);
    report.hash_bits = sums[3] / drawn * static_cast<double>(anchors);
    // Contracted by hand: a compiler may do it for one executor and not for another.
    const double penalty = mask_penalty<T>(arena.values(handles.mask), context.partial, executor);
    report.loss = std::fma(settings_.mask_weight, penalty, context.unit * (bits + sums[3]));
  }

  /// Where an entry's row of inputs begins: rows of a panel are as wide as its network's.
  template <class Net>
  [[nodiscard]] static std::size_t input_of(std::size_t e) {
    return e / panel * panel * input_row + e % panel * static_cast<std::size_t>(Net::input_row);
  }
  /// Chunks of sums that a level's panels are dealt to: as many as keep the sums from costing more than the panels.
  [[nodiscard]] static std::size_t chunks_of(std::size_t panels) {
    return std::clamp<std::size_t>(panels / 8, 1, most_chunks);
  }
  template <class Net, Executor E>
  void level_backward(std::size_t level, const Backward& state, E& executor) const {
    Context& context = state.context;
    const std::size_t light = pull_light(level, state, executor);
    const std::size_t light_panels = chunk_count(light, panel);
    const std::size_t panels = light_panels + context.plan.full[level].panels();
    if (panels == 0) return;
    constexpr std::size_t count = Net::gradient_count;
    const std::size_t chunks = chunks_of(panels);
    T* const sums = context.chunk_gradients.data();
    executor.for_chunks(chunks, 1, [&](std::size_t chunk, std::size_t, std::size_t worker) {
      std::fill_n(sums + chunk * count, count, T(0));
      Scratch& s = context.scratch[worker];
      for (std::size_t p = chunk; p < panels; p += chunks) {
        if (p < light_panels) {
          light_panel_backward<Net>(level, p * panel, std::min(light, (p + 1) * panel), state, s, sums + chunk * count);
        } else {
          full_panel_backward<Net>(level, p - light_panels, state, s, sums + chunk * count);
        }
      }
    });
    executor.for_chunks(count, 2048, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t chunk = 1; chunk < chunks; ++chunk) {
        for (std::size_t i = begin; i < end; ++i) sums[i] += sums[chunk * count + i];
      }
    });
    const ContextGsHandles::Network& n = state.handles.network[level];
    Net::add_gradients(sums, {state.arena.gradients(n.weight1), state.arena.gradients(n.bias1),
                              state.arena.gradients(n.weight2), state.arena.gradients(n.bias2)});
  }
  /// Carries a level's light entries' gradients back to their rows; lists those whose steps have one and are drawn.
  /// Returns how many.
  template <Executor E>
  std::size_t pull_light(std::size_t level, const Backward& state, E& executor) const {
    Context& context = state.context;
    const ContextGsPlan::Section& section = context.plan.light[level];
    const Random random(context.phase.seed, context.phase.iteration, random_stage("context gs steps"));
    executor.for_chunks(section.count, panel, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      for (std::size_t e = section.first + begin; e < section.first + end; ++e) {
        const std::array<T, 3> d_step = pull_entry(level, e, nullptr, state, context.scratch[worker]);
        context.active[e] =
            Base::pull_drawn_steps(settings_, settings_.step_share, random, e, context.plan.row[e], d_step, context)
                ? 1
                : 0;
      }
    });
    std::size_t active = 0;
    for (std::size_t e = section.first; e < section.first + section.count; ++e) {
      context.back[active] = static_cast<std::uint32_t>(e);
      active += context.active[e];
    }
    return active;
  }
  /// Of the light entries back[begin] … back[end - 1].
  template <class Net>
  void light_panel_backward(std::size_t level, std::size_t begin, std::size_t end, const Backward& state, Scratch& s,
                            T* sums) const {
    Context& context = state.context;
    constexpr std::size_t row_size = static_cast<std::size_t>(Net::input_row);
    std::fill(std::begin(s.tail), std::end(s.tail), T(0));
    std::fill_n(s.input + (end - begin) * row_size, (begin + panel - end) * row_size, T(0));
    std::fill_n(s.hidden + (end - begin) * hidden_row, (begin + panel - end) * hidden_row, T(0));
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t e = context.back[i], lane = i - begin;
      std::copy_n(context.input.data() + input_of<Net>(e), row_size, s.input + lane * row_size);
      std::copy_n(context.hidden.data() + e * hidden_row, hidden_row, s.hidden + lane * hidden_row);
      std::copy_n(context.d_step.data() + 3 * e, 3, s.tail + lane * tail_row);
    }
    Net::backward_tail(context.packed[level].data(), s.input, s.hidden, s.tail, s.d_hidden, s.d_input, sums);
    for (std::size_t i = begin; i < end; ++i) {
      hand_back<Net>(context.back[i], s.d_input + (i - begin) * row_size, nullptr, state);
    }
  }
  /// Of the p-th panel of full entries of a level.
  template <class Net>
  void full_panel_backward(std::size_t level, std::size_t p, const Backward& state, Scratch& s, T* sums) const {
    Context& context = state.context;
    const ContextGsPlan& plan = context.plan;
    const ContextGsPlan::Section at = plan.panel_at(level, plan.light[level].panels() + p);
    const MatrixView<const T> mask = std::as_const(state.arena).values(state.handles.mask);
    const MatrixView<T> d_mask = state.arena.gradients(state.handles.mask);
    std::fill(std::begin(s.output), std::end(s.output), T(0));
    for (std::size_t i = 0; i < at.count; ++i) {
      const std::size_t e = at.first + i, row = plan.row[e], f = plan.rate_of(level, e);
      const std::array<T, 3> d_step = pull_entry(level, e, context.rate_value.data() + f * noise_row, state, s);
      Base::pull_outputs(settings_, e, f, d_step, s.output + i * output_row, output_row, mask.row(row), d_mask.row(row),
                         context);
      context.active[e] = 1;
    }
    Net::backward_all(context.packed[level].data(), context.input.data() + at.first * input_row,
                      context.hidden.data() + at.first * hidden_row, s.output, s.d_hidden, s.d_input, sums);
    for (std::size_t i = 0; i < at.count; ++i) {
      hand_back<Net>(at.first + i, s.d_input + i * static_cast<std::size_t>(Net::input_row),
                     context.rate_hyper.data() + plan.rate_of(level, at.first + i) * hyper_row, state);
    }
  }
  /// Gradients by what an entry's network read: to its z, and kept for its parent.
  template <class Net>
  static void hand_back(std::size_t e, const T* d_input, const T* rate, const Backward& state) {
    const MatrixView<T> d_hyper = state.arena.gradients(state.handles.hyperprior);
    const T* const d_z = d_input + (Net::inputs - hyper_dim);
    T* const to = d_hyper.row(state.context.plan.row[e]);
    for (std::size_t c = 0; c < hyper_row; ++c) to[c] += d_z[c] + (rate != nullptr ? rate[c] : T(0));
    if constexpr (Net::inputs != Root::inputs) {
      std::copy_n(d_input + 3, seen_row, state.context.d_seen.data() + e * seen_row);
    }
  }
  /// Gradients of the three tables by one entry's row, from those by what came of it: the render's, the rate's and the
  /// children's.
  static std::array<T, 3> pull_entry(std::size_t level, std::size_t e, const T* rate, const Backward& state,
                                     Scratch& s) {
    Context& context = state.context;
    const ContextGsPlan& plan = context.plan;
    if (level > 0 && plan.child_begin[e] != plan.child_begin[e + 1]) {
      T* const d = s.d_value;
      std::fill_n(d, noise_row, T(0));
      for (std::uint32_t at = plan.child_begin[e]; at < plan.child_begin[e + 1]; ++at) {
        if (context.active[plan.child[at]] == 0) continue;
        const T* const from = context.d_seen.data() + plan.child[at] * seen_row;
        for (std::size_t c = 0; c < seen_row; ++c) d[c] += from[c];
      }
      for (std::size_t c = 0; c < seen_row; ++c) d[c] *= context.inverse[c];
      if (rate != nullptr) {
        for (std::size_t c = 0; c < scalars; ++c) d[c] += rate[c];
      }
      rate = d;
    }
    const std::size_t row = plan.row[e];
    if ((plan.mark[row] & ContextGsPlan::visible) != 0) return Base::pull_back(e, row, rate, state.d_rows, context);
    return Base::pull_back_copy(e, row, rate, state.outside, s, context);
  }

  Settings settings_{};
};

}  // namespace compmark
