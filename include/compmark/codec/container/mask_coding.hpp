// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Offset masks, K bits an anchor, by adaptive bits (docs/spec/compression.md, 1.5 and 4.2; HAC stores them at one
// common probability). The context of a bit is its place, the number of unmasked offsets before it in the anchor, and
// the number in the anchors before. If an anchor has no unmasked offset yet, its last bit is not written, because every
// coded anchor has at least one. One chunk is one stream and decodes alone.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/coder/bits.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

namespace detail {

template <class Bits>
void code_masks(Bits& bits, int count, std::span<std::uint32_t> masks) {
  const auto k = static_cast<std::size_t>(count);
  constexpr std::size_t fillings = 5;
  std::vector<BinaryContext> contexts(k * k * fillings);
  std::size_t full = k;  // unmasked of the two anchors before, halved
  for (std::uint32_t& mask : masks) {
    std::size_t unmasked = 0;
    std::uint32_t result = 0;
    const std::size_t filling = full * (fillings - 1) / k;
    for (std::size_t i = 0; i < k; ++i) {
      const bool implied = i + 1 == k && unmasked == 0;
      const bool bit = implied || bits(contexts[(filling * k + i) * k + unmasked], (mask >> i & 1u) != 0);
      result |= (bit ? 1u : 0u) << i;
      unmasked += bit ? 1 : 0;
    }
    if constexpr (!Bits::writes) mask = result;
    full = (full + unmasked + 1) / 2;
  }
}

}  // namespace detail

/// Masks of `count` <= 32 offsets, none of them zero.
[[nodiscard]] inline std::vector<std::byte> encode_masks(std::span<const std::uint32_t> masks, int count) {
  detail::BitsOut bits;
  std::vector<std::uint32_t> copy(masks.begin(), masks.end());
  detail::code_masks(bits, count, copy);
  return bits.finish();
}

[[nodiscard]] inline Result<Done> decode_masks(std::span<const std::byte> payload, int count,
                                               std::span<std::uint32_t> masks) {
  detail::BitsIn bits(payload);
  detail::code_masks(bits, count, masks);
  if (!bits.complete()) {
    return Error{ErrorKind::malformed, "", "MASK", "the masks do not end where their bytes do", "copy the file again"};
  }
  return Done{};
}

}  // namespace compmark
