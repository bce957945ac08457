// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The sections of a HAC-plus file: those of a HAC file, and INTR, the context inside an anchor. A file that begins with
// a coarse level has STEP, which says how coarse, and COAR, which holds the level; STRM refines it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/coder/bits.hpp"
#include "compmark/codec/container/network_coding.hpp"
#include "compmark/codec/hac/hac_format.hpp"
#include "compmark/codec/integer/coarse_bins.hpp"
#include "compmark/codec/integer/intra_context.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/bytes.hpp"

namespace compmark {

struct HacPlusFormat : HacFormat {
  static constexpr std::uint32_t intra = four_characters("INTR"), step = four_characters("STEP"),
                                 coarse = four_characters("COAR");
  static constexpr std::array<std::uint32_t, 10> known{meta,  tables,   geometry, hash,   context,
                                                       intra, networks, mask,     stream, digests};
  static constexpr std::array<std::uint32_t, 12> known_with_level{meta, tables,   geometry, hash,   context, intra,
                                                                  step, networks, mask,     coarse, stream,  digests};
  static constexpr std::array<std::uint32_t, 3> chunked_with_level{mask, coarse, stream};
  static constexpr CodecSections one_level{ContainerProfile::hac_plus, "HAC-plus", known, chunked, {}, 1};
  /// Of a file that begins with a coarse level; names the sections of the others too.
  static constexpr CodecSections sections{
      ContainerProfile::hac_plus, "HAC-plus", known_with_level, chunked_with_level, {}, 1, coarse};
};

namespace detail {

/// INTR: u8 0 (all weights are zero) or 1; then the biases of means and of spreads, the weights of near anchors for
/// means and for spreads, and those of scalars for means and for spreads, row by row, as integers in one
/// stream of bits.
[[nodiscard]] inline std::vector<std::byte> encode_intra(const IntraContext& context) {
  ByteWriter writer;
  const bool none = context == IntraContext::none(context.channels);
  writer.put(static_cast<std::uint8_t>(none ? 0 : 1));
  if (none) return writer.take();
  BitsOut bits;
  IntraContext copy = context;
  for (auto* part : IntraContext::parts(copy)) code_integers(bits, std::span<std::int16_t>(*part), 1);
  writer.put(bits.finish());
  return writer.take();
}

[[nodiscard]] inline Result<IntraContext> decode_intra(std::span<const std::byte> payload, std::size_t channels) {
  ByteReader reader(payload);
  const auto kind = reader.get<std::uint8_t>();
  if (reader.failed() || kind > 1) return bad_section("INTR", "does not begin with 0 or 1");
  if (kind == 1 && IntraContext::weights(channels) > (std::size_t{1} << 20) + 64 * reader.left())
    return bad_section("INTR", "has too few bytes for the weights of its anchors");
  IntraContext context = IntraContext::none(channels);
  if (kind == 1) {
    BitsIn bits(reader.take(reader.left()));
    for (auto* part : IntraContext::parts(context)) code_integers(bits, std::span<std::int16_t>(*part), 1);
    if (!bits.complete()) return bad_section("INTR", "its weights do not end where their bytes do");
    for (const auto* part : IntraContext::parts(context)) {
      for (const std::int16_t weight : *part) {
        if (std::abs(int{weight}) > IntraContext::greatest_weight)
          return bad_section("INTR", std::to_string(weight) + " is not a weight of -127 to 127");
      }
    }
    if (context == IntraContext::none(channels)) return bad_section("INTR", "holds no weight that is not zero");
  }
  if (!reader.complete()) return bad_section("INTR", "does not end where it says");
  return context;
}

/// STEP: u8 thirds of features, of scales, of offsets.
[[nodiscard]] inline std::vector<std::byte> encode_coarse_steps(const CoarseSteps& steps) {
  ByteWriter writer;
  for (const std::uint8_t thirds : steps.thirds) writer.put(thirds);
  return writer.take();
}
[[nodiscard]] inline Result<CoarseSteps> decode_coarse_steps(std::span<const std::byte> payload) {
  ByteReader reader(payload);
  const std::uint8_t features = reader.get<std::uint8_t>(), scales = reader.get<std::uint8_t>(),
                     offsets = reader.get<std::uint8_t>();
  const CoarseSteps steps{{features, scales, offsets}};
  if (!reader.complete() || !steps.valid())
    return bad_section("STEP", "does not hold three numbers of 0 to 3 of which one is above 0");
  return steps;
}

}  // namespace detail

}  // namespace compmark
