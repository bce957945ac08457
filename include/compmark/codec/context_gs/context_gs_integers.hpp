// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The context of ContextGS in whole numbers, as coding has it: what context_gs_parameters.hpp says of inputs and
// outputs, with 10 fraction bits an input, held in +-32767. With v the voxel, k a symbol, T the ratio of its step
// (Q24):
//   level 2        box: ((t + 2^20) >> 21) - 1024, t the place in the box (VoxelBox, Q32) held in 0 … 2^32; then 1024 z
//   levels 1, 0    place: floor((2048 (v - v of the parent) + edge) / (2 edge)), edge of the parent's cell;
//                  seen: of each feature and scale of the parent round((k T - 2^12 mean) factor / 2^shift), the
//                    difference held in +-2^46;
//                  then 1024 z
// Nothing overflows and no sum has an order. Cost: 0.9 us an anchor, 0.1 us more for those that are parents.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/context_gs/anchor_levels.hpp"
#include "compmark/codec/context_gs/context_gs_prior.hpp"
#include "compmark/codec/integer/integer_context.hpp"
#include "compmark/codec/integer/integer_functions.hpp"
#include "compmark/codec/integer/integer_network.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

/// (value - mean) / deviation of a channel, for symbols: mean in units of 2^-12 Q0; factor 2^-shift is 2^-14 Q0 /
/// deviation.
struct SeenScale {
  std::int32_t mean = 0;
  std::uint16_t factor = 0;
  std::uint8_t shift = 1;  ///< 1 … 62

  static constexpr std::int32_t greatest_mean = 1 << 30;
  [[nodiscard]] bool valid() const {
    return shift >= 1 && shift <= 62 && mean >= -greatest_mean && mean <= greatest_mean;
  }
  friend bool operator==(const SeenScale&, const SeenScale&) = default;
};
/// Of training's numbers, which a file keeps.
[[nodiscard]] inline SeenScale seen_scale(double mean, double deviation, double base_step) {
  SeenScale scale;
  constexpr double most = SeenScale::greatest_mean;
  scale.mean = static_cast<std::int32_t>(std::clamp(std::nearbyint(mean / base_step * 4096), -most, most));
  int exponent = 0;
  const double fraction = std::frexp(std::ldexp(base_step / deviation, -14), &exponent);
  const int shift = std::clamp(16 - exponent, 1, 62);
  const double factor = std::nearbyint(std::ldexp(fraction, shift + exponent));
  scale.shift = static_cast<std::uint8_t>(shift);
  scale.factor = static_cast<std::uint16_t>(std::clamp(factor, 0.0, 65535.0));
  return scale;
}

/// What a file stores of its context.
struct IntegerContextGs {
  static constexpr int input_bits = 10;
  static constexpr std::int32_t most_input = 32767;
  static constexpr std::size_t levels = AnchorLevels::levels;

  ContextHeads heads;
  std::size_t channels = 12;  ///< of z
  AnchorCells cells;
  VoxelBox box;
  std::vector<SeenScale> seen;                 ///< [D + 6]
  std::vector<std::uint16_t> prior;            ///< [channels][31] frequencies
  std::array<IntegerNetwork, levels> network;  ///< of level i

  [[nodiscard]] static std::size_t inputs(std::size_t level, const ContextHeads& heads, std::size_t channels) {
    return 3 + channels + (level == 2 ? 0 : heads.width(0) + heads.width(1));
  }
  [[nodiscard]] std::size_t inputs(std::size_t level) const { return inputs(level, heads, channels); }
  [[nodiscard]] std::size_t geometry() const { return heads.width(0) + heads.width(1); }

  [[nodiscard]] Result<Done> check() const {
    const auto fail = [](const char* section, std::string problem) {
      return Error{ErrorKind::invalid, "", section, std::move(problem), "encode the model again"};
    };
    if (cells.fine < 1 || cells.coarse < 1) return fail("LVLS", "an edge of the cells is not positive");
    if (!box.valid()) return fail("LVLS", "the context's box is not finite, inverted or too far away");
    if (seen.size() != geometry()) return fail("LVLS", "does not have a factor for every feature and scale");
    for (const SeenScale& scale : seen) {
      if (!scale.valid()) return fail("LVLS", "a scale is out of range");
    }
    if (channels < 1 || channels > HyperpriorFormat::most_channels ||
        prior.size() != channels * HyperpriorFormat::slots) {
      return fail("PRIO", "the prior does not have 31 frequencies for each of 1 to 64 channels");
    }
    for (std::size_t c = 0; c < channels; ++c) {
      std::uint32_t sum = 0;
      for (std::size_t i = 0; i < HyperpriorFormat::slots; ++i) {
        const std::uint32_t frequency = prior[c * HyperpriorFormat::slots + i];
        if (frequency == 0) return fail("PRIO", "a frequency is 0");
        sum += frequency;
      }
      if (sum >= HyperpriorFormat::total) return fail("PRIO", "leaves nothing for the escape");
    }
    for (std::size_t level = 0; level < levels; ++level) {
      Result<Done> checked = network[level].check(inputs(level), heads, most_input);
      if (checked) continue;
      Error error = checked.error();
      error.problem = "level " + std::to_string(level) + ": " + error.problem;
      return error;
    }
    return Done{};
  }
  friend bool operator==(const IntegerContextGs& a, const IntegerContextGs& b) {
    return a.channels == b.channels && a.cells == b.cells && a.box == b.box && a.seen == b.seen && a.prior == b.prior &&
           a.network == b.network;
  }
};

/// The anchors of a file in the order of coding, level 2 first, as all its chunks read them.
struct ContextGsRows {
  std::span<const Voxel> voxels;
  std::span<const std::uint32_t> parent;     ///< rows; AnchorLevels::none at level 2
  std::span<const std::int32_t> hyperprior;  ///< [rows][channels]
  std::span<std::int16_t> seen;              ///< [rows of levels 2 and 1][D + 6]: what children read of their parent
};

/// Evaluates panels of one level; one object a chunk.
class ContextGsEvaluator : public PanelModels {
 public:
  using Packed = std::array<IntegerNetwork::Packed, IntegerContextGs::levels>;

  /// Anchors are counted from row `begin` on. Everything must outlive this.
  ContextGsEvaluator(const IntegerContextGs& context, const Packed& packed, const ContextGsRows& rows,
                     std::size_t level, std::size_t begin)
      : PanelModels(context.heads),
        context_(&context),
        packed_(&packed[level]),
        rows_(&rows),
        level_(level),
        begin_(begin) {
    panel_.input.resize((context.inputs(level) + 1) / 2 * 2 * integer_panel);
  }

  /// Up to `integer_panel` anchors. Their z, and all symbols of their parents, must be known.
  void look(std::size_t first, std::size_t count) {
    std::fill(panel_.input.begin(), panel_.input.end(), std::int16_t{0});
    const std::size_t geometry = context_->geometry(), channels = context_->channels;
    for (std::size_t lane = 0; lane < count; ++lane) {
      const std::size_t row = begin_ + first + lane;
      std::int16_t* const out = panel_.input.data() + 2 * lane;
      std::size_t next = 0;
      const auto put = [&](std::int32_t value) {
        out[next / 2 * 2 * integer_panel + next % 2] = static_cast<std::int16_t>(value);
        ++next;
      };
      const Voxel& voxel = rows_->voxels[row];
      if (level_ == 2) {
        for (std::size_t axis = 0; axis < 3; ++axis) put(box_input(voxel[axis], axis));
      } else {
        const std::size_t parent = rows_->parent[row];
        const Voxel& from = rows_->voxels[parent];
        const std::int64_t edge = level_ == 1 ? context_->cells.coarse : context_->cells.fine;
        for (std::size_t axis = 0; axis < 3; ++axis) put(place_input(std::int64_t{voxel[axis]} - from[axis], edge));
        const std::int16_t* const seen = rows_->seen.data() + parent * geometry;
        for (std::size_t c = 0; c < geometry; ++c) put(seen[c]);
      }
      const std::int32_t* const z = rows_->hyperprior.data() + row * channels;
      for (std::size_t c = 0; c < channels; ++c) put(hyper_input(z[c]));
    }
    run(context_->network[level_], *packed_, count);
  }
  /// Takes a symbol of an anchor that has just been coded, of a feature (channel < D) or a scale, with its step
  /// index. The anchor's children read it.
  void tell(std::size_t anchor, std::size_t channel, std::int32_t symbol, int index) {
    if (level_ == 0) return;
    rows_->seen[(begin_ + anchor) * context_->geometry() + channel] =
        seen_input(context_->seen[channel], symbol, index);
  }

  [[nodiscard]] static std::int16_t seen_input(const SeenScale& scale, std::int32_t symbol, int index) {
    constexpr std::int64_t most = std::int64_t{1} << 46;
    const std::int64_t difference =
        std::clamp(symbol * step_ratio(index) - std::int64_t{scale.mean} * 4096, -most, most);
    return static_cast<std::int16_t>(
        std::clamp<std::int64_t>(round_shift(difference * scale.factor, scale.shift), -held, held));
  }

 private:
  static constexpr std::int32_t held = IntegerContextGs::most_input;

  [[nodiscard]] static std::int32_t hyper_input(std::int32_t z) {
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(std::int64_t{z} * 1024, -held, held));
  }
  [[nodiscard]] std::int32_t box_input(std::int32_t coordinate, std::size_t axis) const {
    const VoxelBox& box = context_->box;
    const std::int64_t t = (std::int64_t{box.scale[axis]} * coordinate + box.offset[axis]) >> (box.fraction[axis] - 32);
    const std::int64_t place = std::clamp<std::int64_t>(t, 0, std::int64_t{1} << 32);
    return static_cast<std::int32_t>((place + (std::int64_t{1} << 20)) >> 21) - 1024;
  }
  [[nodiscard]] static std::int32_t place_input(std::int64_t difference, std::int64_t edge) {
    const std::int64_t n = 2048 * difference + edge, d = 2 * edge;
    return static_cast<std::int32_t>(std::clamp<std::int64_t>(n / d - (n % d < 0 ? 1 : 0), -held, held));
  }

  const IntegerContextGs* context_;
  const IntegerNetwork::Packed* packed_;
  const ContextGsRows* rows_;
  std::size_t level_, begin_;
};

}  // namespace compmark
