// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the coded anchors next to an anchor deviated from the hash grid's predictions by: the mean of the three nearest
// of the 64 before it in its chunk. Anchors are coded along the Morton curve, so these are in its surroundings; a chunk
// still decodes alone. Distances are sums over the axes, which no voxels overflow; of equal ones the later anchor is
// nearer. Cost: ~0.1 us an anchor, 12 KB.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "compmark/codec/integer/integer_functions.hpp"
#include "compmark/math/morton.hpp"

namespace compmark {

class NearAnchors {
 public:
  static constexpr std::size_t remembered = 64, averaged = 3;

  explicit NearAnchors(std::size_t channels)
      : channels_(channels),
        deviation_(remembered * channels),
        near_(channels) {}

  /// The next anchor of the chunk. All that keep() was told of the one before it is remembered.
  void begin(const Voxel& voxel) {
    std::array<std::int64_t, averaged> distance{};
    std::array<std::size_t, averaged> place{};
    found_ = 0;
    for (std::size_t back = 1; back <= std::min(count_, remembered); ++back) {
      const std::size_t at = (count_ - back) % remembered;
      std::int64_t far = 0;
      for (std::size_t axis = 0; axis < 3; ++axis)
        far += std::abs(std::int64_t{voxel[axis]} - std::int64_t{voxel_[at][axis]});
      if (found_ == averaged && far >= distance[averaged - 1]) continue;
      std::size_t i = found_ < averaged ? found_++ : averaged - 1;
      for (; i > 0 && far < distance[i - 1]; --i) {
        distance[i] = distance[i - 1];
        place[i] = place[i - 1];
      }
      distance[i] = far;
      place[i] = at;
    }
    constexpr std::array<std::int32_t, averaged + 1> share{0, 1 << 16, 1 << 15, 21'845};
    for (std::size_t c = 0; c < channels_; ++c) {
      std::int32_t sum = 0;
      for (std::size_t i = 0; i < found_; ++i) sum += deviation_[place[i] * channels_ + c];
      near_[c] = static_cast<std::int16_t>(round_shift(std::int64_t{sum} * share[found_], 16));
    }
    now_ = count_++ % remembered;
    voxel_[now_] = voxel;
    std::fill_n(deviation_.begin() + static_cast<std::ptrdiff_t>(now_ * channels_), channels_, std::int16_t{0});
  }
  /// This anchor's deviation in a channel, Q9; one that is not coded counts as none.
  void keep(std::size_t channel, std::int32_t deviation) {
    deviation_[now_ * channels_ + channel] = static_cast<std::int16_t>(deviation);
  }
  /// The mean deviations of the near anchors by channel, Q9; empty for the first anchor of a chunk.
  [[nodiscard]] std::span<const std::int16_t> near() const {
    return std::span<const std::int16_t>(near_).first(found_ == 0 ? 0 : channels_);
  }

 private:
  std::size_t channels_, count_ = 0, now_ = 0, found_ = 0;
  std::array<Voxel, remembered> voxel_{};
  std::vector<std::int16_t> deviation_, near_;
};

}  // namespace compmark
