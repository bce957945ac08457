// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Between structure of arrays (lanes are Gaussians) and array of structures (one cache line a Gaussian): a W x W
// transposition in registers, log2 W rounds of W shuffles, where W is 16 or 8; plain loops elsewhere.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "compmark/math/pack.hpp"

namespace compmark::detail {

/// One butterfly round: exchanges the blocks of `half` lanes that lie off the diagonal, between rows i and i + half.
template <std::size_t half, class P, std::size_t... lane>
COMPMARK_INLINE void transpose_round(std::array<P, P::width>& rows, std::index_sequence<lane...>) {
  constexpr std::size_t W = P::width;
  for (std::size_t i = 0; i < W; ++i) {
    if ((i & half) != 0) continue;
    const typename P::Native a = rows[i].native, b = rows[i + half].native;
    rows[i] = P::from_native(__builtin_shufflevector(a, b, ((lane & half) == 0 ? lane : lane - half + W)...));
    rows[i + half] = P::from_native(__builtin_shufflevector(a, b, ((lane & half) == 0 ? lane + half : lane + W)...));
  }
}

/// rows[i].lane(j) <-> rows[j].lane(i).
template <class P>
COMPMARK_INLINE void transpose(std::array<P, P::width>& rows) {
  constexpr int W = P::width;
  using Lanes = std::make_index_sequence<P::width>;
  if constexpr (W >= 16) transpose_round<8>(rows, Lanes{});
  if constexpr (W >= 8) transpose_round<4>(rows, Lanes{});
  if constexpr (W >= 4) transpose_round<2>(rows, Lanes{});
  if constexpr (W >= 2) transpose_round<1>(rows, Lanes{});
}

/// fields[k].lane(i) becomes element k of the 16-element record i; records whose pointer is null are not written.
/// `streaming` writes past the caches: records aligned to the pack, and streaming_fence() at the end.
template <class P, bool streaming = false>
COMPMARK_INLINE void store_records(const std::array<P, 16>& fields,
                                   const std::array<typename P::Scalar*, P::width>& record) {
  constexpr std::size_t W = P::width;
  static_assert(16 % W == 0, "a record has 16 elements");
  for (std::size_t part = 0; part < 16 / W; ++part) {
    std::array<P, W> block;
    for (std::size_t k = 0; k < W; ++k) block[k] = fields[part * W + k];
    transpose(block);
    for (std::size_t i = 0; i < W; ++i) {
      if (record[i] == nullptr) continue;
      if constexpr (streaming) {
        block[i].store_streaming(record[i] + part * W);
      } else {
        block[i].store(record[i] + part * W);
      }
    }
  }
}

/// The inverse: every pointer must be readable for 16 elements.
template <class P>
[[nodiscard]] COMPMARK_INLINE std::array<P, 16> load_records(
    const std::array<const typename P::Scalar*, P::width>& record) {
  constexpr std::size_t W = P::width;
  std::array<P, 16> fields;
  for (std::size_t part = 0; part < 16 / W; ++part) {
    std::array<P, W> block;
    for (std::size_t i = 0; i < W; ++i) block[i] = P::load(record[i] + part * W);
    transpose(block);
    for (std::size_t k = 0; k < W; ++k) fields[part * W + k] = block[k];
  }
  return fields;
}

}  // namespace compmark::detail
