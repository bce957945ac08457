// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// DIGS, the digests that a decoder must arrive at (docs/spec/compression.md, 4.3). Checksums show that the bytes
// survived; digests show that this decoder made the same model from them. There is a hash of symbols and masks for each
// chunk, and one SHA-256 over everything that the file decodes to.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/container/file_format.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/bytes.hpp"
#include "compmark/io/sha256.hpp"

namespace compmark::detail {

using Sha256Bytes = std::array<std::byte, 32>;

/// 128 bits that change with any 32-bit word of an array and with their order: eight sums side by side, 10 GB/s.
/// SHA-256 of every array would take longer than all the rest of decoding; it takes these instead.
[[nodiscard]] inline std::array<std::uint64_t, 2> digest_words(std::span<const std::byte> bytes) {
  constexpr std::size_t lanes = 8;
  constexpr std::uint64_t factor = 0x9E3779B97F4A7C15ull;
  const std::size_t count = bytes.size() / 4;
  std::array<std::uint64_t, lanes> sums{};
  const auto add = [&](std::size_t i, std::size_t lane) {
    std::uint32_t word;
    std::memcpy(&word, bytes.data() + 4 * i, 4);
    sums[lane] = (sums[lane] + word + 1) * factor;
  };
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    for (std::size_t lane = 0; lane < lanes; ++lane) add(i + lane, lane);
  }
  for (std::size_t lane = 0; i < count; ++i, ++lane) add(i, lane);
  std::array<std::uint64_t, 2> digest{count, ~std::uint64_t{count}};
  for (const std::uint64_t sum : sums) {
    digest[0] = mix_bits(digest[0] ^ sum);
    digest[1] = mix_bits(digest[1] + sum);
  }
  return digest;
}
/// Of voxels, masks, features, scales, offsets and, where there are any, symbols of z: two numbers each.
using ChunkDigest = std::vector<std::uint64_t>;

/// What decoding must arrive at: a hash of the symbols and masks of each chunk, and one over all arrays.
struct CodecDigests {
  std::vector<std::uint64_t> symbols;
  Sha256Bytes model{};
};
/// DIGS: u64 a chunk, then 32 bytes.
[[nodiscard]] inline std::vector<std::byte> encode_digests(const CodecDigests& digests) {
  ByteWriter writer;
  for (const std::uint64_t value : digests.symbols) writer.put(value);
  writer.put(std::span<const std::byte>(digests.model));
  return writer.take();
}
[[nodiscard]] inline Result<CodecDigests> decode_digests(std::span<const std::byte> payload, std::size_t chunks) {
  if (payload.size() != 8 * std::uint64_t{chunks} + 32)
    return bad_section("DIGS", "does not hold a digest for each chunk");
  ByteReader reader(payload);
  CodecDigests digests;
  for (std::size_t i = 0; i < chunks; ++i) digests.symbols.push_back(reader.get<std::uint64_t>());
  const std::span<const std::byte> model = reader.take(32);
  std::copy(model.begin(), model.end(), digests.model.begin());
  return digests;
}

/// SHA-256 over META, the bytes of `payloads` (the sections of the context and the networks), the digests of the chunks
/// in order, and the tensors that render as they have been read: what the file names its model by. A file with one
/// other digit in any section is another model.
[[nodiscard]] inline Sha256Bytes model_digest(std::span<const ChunkDigest> chunks, const CodecModel& model,
                                              std::uint64_t anchors,
                                              std::span<const std::span<const std::byte>> payloads) {
  Sha256 hash;
  hash.update(encode_meta(model, anchors));
  for (const std::span<const std::byte> payload : payloads) hash.update(payload);
  ByteWriter rest;
  for (const ChunkDigest& chunk : chunks) {
    for (const std::uint64_t word : chunk) rest.put(word);
  }
  for (const CodecTensor& tensor : model.networks) {
    for (const float value : tensor.values) rest.put(value);
  }
  hash.update(rest.bytes());
  return hash.digest();
}
[[nodiscard]] inline std::uint64_t short_digest(const Sha256Bytes& digest) {
  return ByteReader(digest).get<std::uint64_t>();
}

}  // namespace compmark::detail
