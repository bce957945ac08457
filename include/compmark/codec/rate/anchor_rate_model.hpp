// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The common part of HacModel and ContextGsModel. An anchor's attributes get the noise of the steps that a network
// predicts; their bits under the predicted Gaussians are counted for a sample of the anchors; and the gradients of both
// go back to the attributes, the steps and the masks. The two models differ in the inputs of their networks. `entry`
// numbers the anchors that a model evaluates in an iteration, `rated` those of them whose rate counts; data for the
// backward pass is kept in tables with a row each.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>

#include "compmark/codec/hac/hac_attributes.hpp"
#include "compmark/codec/rate/offset_mask.hpp"
#include "compmark/codec/rate/rate.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/quantizer/adaptive_quantizer.hpp"
#include "compmark/splat/quantizer/uniform_quantizer.hpp"

namespace compmark {

struct AnchorRateSettings {
  double lambda = 0.001;
  double mask_weight = 5e-4;
  bool anchor_mask = true;  ///< bits of features, scales and z weigh by the straight-through mask of the anchor
  double feature_step = 1, scaling_step = 0.001, offset_step = 0.2;  ///< Q0; that of scales in world units
  double least_scale = 1e-6;                                         ///< a distorted scale stays above it, world units
};

/// Quantizers whose steps a file can hold, as network outputs r of q = 2 Q0 sigmoid(2 r): the adaptive one, and the
/// uniform one as r = 0.
template <class Q>
inline constexpr bool has_coded_steps = false;
template <class T>
inline constexpr bool has_coded_steps<AdaptiveQuantizer<T>> = true;
template <class T>
inline constexpr bool has_coded_steps<UniformQuantizer<T>> = true;

template <class T, int feature_dim, int offsets, class ModelHandles, class CodedQuantizer = AdaptiveQuantizer<T>>
class AnchorRateModel {
  static_assert(has_coded_steps<CodedQuantizer>);

 public:
  static constexpr bool is_absent = false;
  using Scalar = T;
  using Phase = RatePhase;
  using Report = RateReport;
  using Handles = ModelHandles;
  static constexpr int feature_channels = feature_dim;  ///< the anchors have the same number: check_recipe compares
  static constexpr int anchor_offsets = offsets;        ///< likewise
  using Attributes = HacAttributes<T, feature_dim, offsets>;
  /// Whether every step is its base step: what the network says of steps is neither read nor learned, and a file has
  /// zeros there.
  static constexpr bool base_steps_alone = std::is_same_v<CodedQuantizer, UniformQuantizer<T>>;

  /// Sets the opacity to 0 where an offset is masked; see offset_mask.hpp.
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

 protected:
  static constexpr std::size_t noise_row = static_cast<std::size_t>(Attributes::row);
  static constexpr std::size_t mask_row = static_cast<std::size_t>(offsets);
  static constexpr std::size_t scalars = static_cast<std::size_t>(Attributes::scalars);
  static constexpr std::size_t step_output = static_cast<std::size_t>(Attributes::outputs - 3);
  static constexpr std::size_t most_chunks = 16;

  /// The three tables of attributes, or of their gradients.
  template <class U>
  struct Tables {
    MatrixView<U> feature, scaling, offset;
  };
  /// The attributes of one anchor that no table lists.
  struct RowScratch {
    alignas(64) T feature[static_cast<std::size_t>(feature_dim)];
    alignas(64) T scaling[6];
    alignas(64) T offset[static_cast<std::size_t>(3 * offsets)];
    typename Attributes::Scratch rate;

    void read(const Tables<const T>& from, std::size_t row) {
      std::copy_n(from.feature.row(row), from.feature.columns, feature);
      std::copy_n(from.scaling.row(row), from.scaling.columns, scaling);
      std::copy_n(from.offset.row(row), from.offset.columns, offset);
    }
    void clear() {
      std::fill(std::begin(feature), std::end(feature), T(0));
      std::fill(std::begin(scaling), std::end(scaling), T(0));
      std::fill(std::begin(offset), std::end(offset), T(0));
    }
    void add_to(const Tables<T>& to, std::size_t row) const {
      for (std::size_t c = 0; c < to.feature.columns; ++c) to.feature(row, c) += feature[c];
      for (std::size_t c = 0; c < to.scaling.columns; ++c) to.scaling(row, c) += scaling[c];
      for (std::size_t c = 0; c < to.offset.columns; ++c) to.offset(row, c) += offset[c];
    }
  };
  struct EntryTables {
    RatePhase phase;
    double unit = 0;                                          ///< loss of one bit of the sample
    Buffer<T> step;                                           ///< [entry, 3] q
    Buffer<T> noise, scales;                                  ///< of entries, as Attributes wants them
    Buffer<T> d_step;                                         ///< [entry, 3] by the raw steps
    Buffer<T> rate_value, rate_output, rate_step, rate_mask;  ///< of rated entries: gradients of the rate

    void resize_noise(std::size_t entries) {
      noise.resize(entries * noise_row);
      scales.resize(entries * 12);
    }
    void resize_rates(std::size_t rated, std::size_t output_row) {
      rate_value.resize(rated * noise_row);
      rate_output.resize(rated * output_row);
      rate_step.resize(rated * 3);
      rate_mask.resize(rated * mask_row);
    }
    [[nodiscard]] bool rounds() const { return phase.context && phase.round; }
  };

  /// Values (T const) or gradients of the anchors' own blocks; empty where the arena has none.
  template <class U, class Arena>
  [[nodiscard]] static Tables<U> tables(Arena& arena, const Handles& handles) {
    if (!handles.feature.valid()) return {};
    if constexpr (std::is_const_v<U>) {
      return {arena.values(handles.feature), arena.values(handles.scaling), arena.values(handles.offset)};
    } else {
      return {arena.gradients(handles.feature), arena.gradients(handles.scaling), arena.gradients(handles.offset)};
    }
  }
  [[nodiscard]] static std::array<T, 3> base_steps(const AnchorRateSettings& settings) {
    return {static_cast<T>(settings.feature_step), static_cast<T>(settings.scaling_step),
            static_cast<T>(settings.offset_step)};
  }
  /// An entry's steps from the raw outputs of its network, which may be read past their end; the steps are kept.
  static std::array<T, 3> take_steps(const AnchorRateSettings& settings, const T* raw, std::size_t entry,
                                     EntryTables& kept) {
    T q[3 + Attributes::W];
    if constexpr (base_steps_alone)
      std::copy_n(base_steps(settings).data(), 3, q);
    else if (kept.rounds())
      Attributes::coded_steps(raw, base_steps(settings), q);
    else
      Attributes::steps(raw, base_steps(settings), q);
    std::copy_n(q, 3, kept.step.data() + 3 * entry);
    return {q[0], q[1], q[2]};
  }
  /// False for an anchor with a NaN or infinity among its attributes: it stays as it is.
  static bool distort(const AnchorRateSettings& settings, const Random& random, const std::array<T, 3>& q,
                      std::size_t entry, std::uint32_t row, T* feature, T* scaling, T* offset, T* values,
                      EntryTables& kept) {
    T* const noise = kept.noise.data() + entry * noise_row;
    T* const scales = kept.scales.data() + entry * 12;
    if (!Attributes::finite(feature, scaling, offset)) {
      Attributes::leave(noise, scales);
      return false;
    }
    if (!kept.rounds()) Attributes::draw(random, row, noise);
    Attributes::distort(kept.rounds(), q, static_cast<T>(settings.least_scale), feature, scaling, offset, noise, scales,
                        values);
    return true;
  }
  /// … of a listed row, in place.
  static bool distort(const AnchorRateSettings& settings, const Random& random, const std::array<T, 3>& q,
                      std::size_t entry, std::uint32_t row, const Tables<T>& to, T* values, EntryTables& kept) {
    return distort(settings, random, q, entry, row, to.feature.row(row), to.scaling.row(row), to.offset.row(row),
                   values, kept);
  }
  /// … of a row that is not listed: a copy in the scratch.
  static bool distort_copy(const AnchorRateSettings& settings, const Random& random, const std::array<T, 3>& q,
                           std::size_t entry, std::uint32_t row, const Tables<const T>& from, RowScratch& s,
                           EntryTables& kept) {
    s.read(from, row);
    return distort(settings, random, q, entry, row, s.feature, s.scaling, s.offset, s.rate.values, kept);
  }
  /// Attributes::rate() drops an anchor whose values are not finite.
  static void leave_unrated(RowScratch& s) {
    std::fill(std::begin(s.rate.values), std::end(s.rate.values), std::numeric_limits<T>::quiet_NaN());
  }
  /// Bits of an entry, whose values are in the scratch, and their gradients.
  static typename Attributes::Bits rate(const AnchorRateSettings& settings, const T* output, std::size_t output_row,
                                        const std::array<T, 3>& q, const T* mask, std::size_t rated, RowScratch& s,
                                        EntryTables& kept) {
    std::array<T, 3> d_step{};
    const typename Attributes::Bits bits =
        Attributes::rate(output, q, mask, settings.anchor_mask, static_cast<T>(kept.unit), s.rate,
                         kept.rate_value.data() + rated * noise_row, kept.rate_output.data() + rated * output_row,
                         d_step, kept.rate_mask.data() + rated * mask_row);
    std::copy_n(d_step.data(), 3, kept.rate_step.data() + 3 * rated);
    return bits;
  }

  /// The gradients of one entry, in place. Adds those of `rate` by its values (null: none) and returns those by its
  /// steps.
  static std::array<T, 3> pull_back(std::size_t entry, std::size_t row, const T* rate, const Tables<T>& d,
                                    const EntryTables& kept) {
    return Attributes::pull_back(kept.noise.data() + entry * noise_row, kept.scales.data() + entry * 12, rate,
                                 d.feature.row(row), d.scaling.row(row), d.offset.row(row));
  }
  /// … of a row that is not listed: only the rate's, ADDED to the arena's own gradients.
  static std::array<T, 3> pull_back_copy(std::size_t entry, std::size_t row, const T* rate, const Tables<T>& outside,
                                         RowScratch& s, const EntryTables& kept) {
    s.clear();
    const std::array<T, 3> d_step = Attributes::pull_back(
        kept.noise.data() + entry * noise_row, kept.scales.data() + entry * 12, rate, s.feature, s.scaling, s.offset);
    s.add_to(outside, row);
    return d_step;
  }
  static void pull_steps(const AnchorRateSettings& settings, std::size_t entry, const std::array<T, 3>& d_step, T* to,
                         const EntryTables& kept) {
    if constexpr (base_steps_alone) {
      std::fill_n(to, 3, T(0));
      return;
    }
    const std::array<T, 3> base = base_steps(settings);
    for (std::size_t g = 0; g < 3; ++g) to[g] = Attributes::pull_step(kept.step[3 * entry + g], base[g], d_step[g]);
  }
  /// The backward pass of an entry without a rate, by its raw steps. Only a random `share` of such entries has a
  /// gradient, with the weight 1 / share: the mean stays the same, with less work for the caller and more noise.
  /// Returns whether the entry has a gradient; a NaN is one.
  static bool pull_drawn_steps(const AnchorRateSettings& settings, double share, const Random& random,
                               std::size_t entry, std::uint32_t row, std::array<T, 3> d_step, EntryTables& kept) {
    const bool all = share >= 1;
    const T weight = static_cast<T>(all ? 1 : 1 / share);
    const bool drawn = all || random.uniform(row) < share;
    for (T& value : d_step) value = drawn ? value * weight : T(0);
    T* const d = kept.d_step.data() + 3 * entry;
    pull_steps(settings, entry, d_step, d, kept);
    return !(d[0] == T(0) && d[1] == T(0) && d[2] == T(0));
  }
  /// A rated entry: by its network's outputs and its masks.
  static void pull_outputs(const AnchorRateSettings& settings, std::size_t entry, std::size_t rated,
                           std::array<T, 3> d_step, T* output, std::size_t output_row, const T* mask, T* d_mask,
                           const EntryTables& kept) {
    for (std::size_t g = 0; g < 3; ++g) d_step[g] += kept.rate_step[3 * rated + g];
    std::copy_n(kept.rate_output.data() + rated * output_row, step_output, output);
    pull_steps(settings, entry, d_step, output + step_output, kept);
    for (std::size_t k = 0; k < mask_row; ++k) d_mask[k] += kept.rate_mask[rated * mask_row + k] * mask_slope(mask[k]);
  }

  /// Bits of the groups over `sampled` anchors, as the report has them; returns their sum.
  static double report_bits(const double* bits, double sampled, double unmasked_offsets, RateReport& report) {
    report.bits_feature = bits[0] / (sampled * feature_dim);
    report.bits_scaling = bits[1] / (sampled * 6);
    report.bits_offset = bits[2] / (sampled * 3 * offsets);
    report.unmasked_offsets = unmasked_offsets / (sampled * offsets);
    const double sum = bits[0] + bits[1] + bits[2];
    report.bits_per_scalar = sum / (sampled * static_cast<double>(scalars));
    return sum;
  }
  static void report_steps(const double* steps, double listed, RateReport& report) {
    report.step_feature = steps[0] / listed;
    report.step_scaling = steps[1] / listed;
    report.step_offset = steps[2] / listed;
  }
};

}  // namespace compmark
