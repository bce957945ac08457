// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// For the tests of both codecs: models compared to the bit, files taken apart and forged (with right checksums: they
// stand for a program that writes nonsense, which no checksum finds), and the laws that hold for a file of either
// codec.
#pragma once

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/container/cmk.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

namespace compmark::testing {

/// Bits, so that -0 is not 0.
[[nodiscard]] inline bool same(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), 4 * a.size()) == 0);
}
[[nodiscard]] inline bool same(const CodecModel& a, const CodecModel& b) {
  return a.voxel_size == b.voxel_size && a.feature_dim == b.feature_dim && a.offset_count == b.offset_count &&
         a.base_step == b.base_step && a.chunk_anchors == b.chunk_anchors && a.voxels == b.voxels && a.mask == b.mask &&
         same(a.feature, b.feature) && same(a.scale, b.scale) && same(a.offset, b.offset) &&
         a.hyperprior == b.hyperprior && a.networks == b.networks && a.metadata == b.metadata &&
         a.context.has_value() == b.context.has_value() && (!a.context || a.context->network == b.context->network) &&
         a.context_gs == b.context_gs;
}

[[nodiscard]] inline CodecEncoded encoded(const CodecModel& model, const CodecEncodeSettings& settings = {}) {
  SerialExecutor executor;
  auto result = encode_cmk(model, settings, executor);
  REQUIRE_MESSAGE(result.ok(), (result.ok() ? "" : result.error().line()));
  return std::move(*result);
}
/// The tables are built once for all files.
[[nodiscard]] inline Result<CodecDecoded> decode(std::span<const std::byte> bytes, CodecDecodeSettings settings = {}) {
  static const GaussianTables tables;
  settings.tables = &tables;
  SerialExecutor executor;
  return decode_cmk(bytes, "a.cmk", settings, executor);
}
[[nodiscard]] inline CodecDecoded decoded(std::span<const std::byte> bytes) {
  auto result = decode(bytes);
  REQUIRE_MESSAGE(result.ok(), (result.ok() ? "" : result.error().line()));
  return std::move(*result);
}

/// A file in its parts.
struct CmkFile {
  ContainerHeader header;
  std::vector<Section> sections;

  explicit CmkFile(std::span<const std::byte> bytes) {
    const auto container = parse_container(bytes, "");
    REQUIRE(container.ok());
    header = container->header;
    for (const SectionEntry& entry : container->sections) {
      const auto raw = container->raw(entry);
      sections.push_back({entry, {raw.begin(), raw.end()}});
    }
  }
  [[nodiscard]] std::vector<std::byte> bytes() const { return write_container(header, sections); }
  [[nodiscard]] Section& of(std::uint32_t kind, std::uint32_t part = 0, std::uint32_t chunk = 0) {
    for (Section& section : sections) {
      if (section.entry.kind == kind && section.entry.part == part && section.entry.chunk == chunk) return section;
    }
    FAIL("no such section");
    return sections[0];
  }
};

template <class T>
void put(std::vector<std::byte>& bytes, std::size_t offset, T value) {
  REQUIRE(offset + sizeof(T) <= bytes.size());
  std::memcpy(bytes.data() + offset, &value, sizeof(T));
}

/// The error of a forged file; it names file and remedy.
template <class Change>
Error error_of_forged(std::span<const std::byte> good, const Change& change) {
  CmkFile file(good);
  change(file);
  const auto result = decode(file.bytes());
  REQUIRE(!result.ok());
  CHECK(result.error().file == "a.cmk");
  CHECK(!result.error().problem.empty());
  CHECK(!result.error().remedy.empty());
  return result.error();
}

/// Every flipped bit of a file is found; with salvage (tried at every `stride`-th byte: it reads the rest, a
/// millisecond each) what comes back is never called whole. `alone`: no chunk needs another, so that one bit costs one
/// chunk.
inline void check_flipped_bits(const std::vector<std::byte>& good, std::size_t stride, bool alone) {
  REQUIRE(decode(good).ok());
  MESSAGE("the file has ", good.size(), " bytes");
  CHECK(good.size() < 10'000);
  std::size_t salvaged = 0;
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::vector<std::byte> damaged = good;
      damaged[i] ^= static_cast<std::byte>(1 << bit);
      REQUIRE(!decode(damaged).ok());
      if (bit != 3 || i % stride != 0) continue;
      const auto rescued = decode(damaged, {.salvage = true});
      if (!rescued) continue;
      ++salvaged;
      REQUIRE(!rescued->verified);
      REQUIRE(!rescued->damaged.empty());
      if (alone) REQUIRE(rescued->damaged.size() == 1);
      REQUIRE(rescued->lost_anchors > 0);
    }
  }
  CHECK(salvaged > 20);
}

/// Every truncation and an appended byte are found.
inline void check_truncations(std::vector<std::byte> bytes) {
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    const std::span<const std::byte> cut = std::span<const std::byte>(bytes).first(n);
    REQUIRE(!decode(cut).ok());
    REQUIRE(!decode(cut, {.salvage = true}).ok());
  }
  bytes.push_back(std::byte{0});
  CHECK(!decode(bytes).ok());
}

/// Random bytes in place of a payload, or some of it, checksums right: an error, never a model.
inline void check_random_payloads(const std::vector<std::byte>& good, std::uint64_t rounds) {
  const CmkFile whole(good);
  for (std::uint64_t i = 0; i < rounds; ++i) {
    const Random random(3, i, random_stage("codec damage"));
    CmkFile file = whole;
    std::vector<std::byte>& bytes = file.sections[i % whole.sections.size()].bytes;
    if (i % 3 == 0) bytes.resize(random.bits(0) % 200);
    for (std::size_t b = 0; b < bytes.size(); ++b) {
      if (i % 3 == 0 || random.bits(b + 1) % bytes.size() < 4)
        bytes[b] = static_cast<std::byte>(random.bits(b + 1000) & 255u);
    }
    if (bytes == whole.sections[i % whole.sections.size()].bytes) continue;
    REQUIRE(!decode(file.bytes()).ok());
    (void)decode(file.bytes(), {.salvage = true});
  }
}

/// Whole bytes that decode to another model are a fault of the codec, and said to be one.
inline void check_digests(const std::vector<std::byte>& good) {
  Error error = error_of_forged(good, [](CmkFile& file) { file.of(CodecFormat::digests).bytes[2] ^= std::byte{1}; });
  CHECK(error.problem.find("whole") != std::string::npos);
  error = error_of_forged(good, [](CmkFile& file) { file.of(CodecFormat::digests).bytes.back() ^= std::byte{1}; });
  CHECK(error.problem.find("whole") != std::string::npos);
  // Nothing but the header's word for the model is another.
  error = error_of_forged(good, [](CmkFile& file) { file.header.digest ^= 1; });
  CHECK(error.field == "DIGS");
}

/// A model's file decodes to the encoder's own quantised model to the last bit, and that encodes to the same bytes.
inline void check_round_trip(const CodecModel& model) {
  const CodecEncoded file = encoded(model);
  const CodecDecoded back = decoded(file.bytes);
  CHECK(back.verified);
  CHECK(same(back.model, file.model));
  const CodecEncoded again = encoded(back.model);
  CHECK(again.bytes == file.bytes);
  CHECK(same(again.model, back.model));
}

/// Bytes and model are the same at any number of threads.
inline void check_any_threads(const CodecModel& model) {
  const CodecEncoded file = encoded(model);
  for (const std::size_t threads : {2u, 3u, 8u}) {
    ThreadExecutor executor(threads);
    const auto other = encode_cmk(model, {}, executor);
    REQUIRE(other.ok());
    CHECK(other->bytes == file.bytes);
    const auto back = decode_cmk(file.bytes, "a.cmk", {}, executor);
    REQUIRE(back.ok());
    CHECK(same(back->model, file.model));
  }
}

}  // namespace compmark::testing
