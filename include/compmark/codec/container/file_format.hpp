// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the files of all codecs have in common (docs/container.md): names of sections, META, what a decoder must know
// first and what the owner wants to find again, TABL, which names the numbers of the tables, and what a table of
// contents may promise. Each reader checks every count before it believes it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "compmark/codec/coder/gaussian_tables.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/container/container.hpp"
#include "compmark/codec/integer/integer_functions.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/bytes.hpp"

namespace compmark {

struct CodecFormat {
  static constexpr std::uint32_t numeric_spec = 1;  ///< of everything that decides a symbol
  static constexpr std::uint32_t meta = four_characters("META"), geometry = four_characters("GEOM"),
                                 mask = four_characters("MASK"), context = four_characters("NETC"),
                                 networks = four_characters("NETR"), tables = four_characters("TABL"),
                                 stream = four_characters("STRM"), digests = four_characters("DIGS");
};

/// The sections of one codec.
struct CodecSections {
  ContainerProfile profile = ContainerProfile::hac;
  const char* name = "HAC";
  std::span<const std::uint32_t> known;    ///< all of them
  std::span<const std::uint32_t> chunked;  ///< one of each a chunk: without it the chunk is lost, and nothing else
  std::span<const std::uint32_t> parted;   ///< one a level, without chunks
  std::uint32_t parts = 1;                 ///< levels
  std::uint32_t coarse = 0;                ///< one of `chunked`: all symbols coarsely, which STRM then refines

  [[nodiscard]] static bool in(std::span<const std::uint32_t> list, std::uint32_t kind) {
    return std::find(list.begin(), list.end(), kind) != list.end();
  }
  [[nodiscard]] bool knows(std::uint32_t kind) const { return in(known, kind); }
  /// Decoding can go on without it.
  [[nodiscard]] bool can_be_lost(const SectionEntry& entry) const {
    return in(chunked, entry.kind) || !knows(entry.kind);
  }
};

namespace detail {

[[nodiscard]] inline Error bad_section(const char* section, std::string problem) {
  return {ErrorKind::malformed, "", section, std::move(problem), "copy the file again"};
}

/// Checks the entries of the table of contents before any payload is read.
[[nodiscard]] inline Result<Done> check_sections(const Container& file, const CodecSections& format) {
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return file.error(kind, std::move(field), std::move(problem), std::move(remedy));
  };
  if (file.header.profile != format.profile) {
    return fail(ErrorKind::unsupported, "profile",
                std::to_string(static_cast<std::uint32_t>(file.header.profile)) + " is not that of " + format.name +
                    ", " + std::to_string(static_cast<std::uint32_t>(format.profile)),
                "decode it with a program that knows its codec");
  }
  if (file.header.numeric_spec != CodecFormat::numeric_spec) {
    return fail(
        ErrorKind::unsupported, "numeric specification",
        std::to_string(file.header.numeric_spec) + ", this program has " + std::to_string(CodecFormat::numeric_spec),
        "decode it with the version that wrote it");
  }
  for (const SectionEntry& entry : file.sections) {
    const bool known = format.knows(entry.kind);
    if (!known && entry.critical()) {
      return fail(ErrorKind::unsupported, entry.name(), "is needed for decoding, and this program does not know it",
                  "decode it with a newer version");
    }
    if (!known) continue;
    if (entry.version != 1 || entry.method != 0) {
      return fail(ErrorKind::unsupported, entry.name(),
                  "version " + std::to_string(entry.version) + ", method " + std::to_string(entry.method) +
                      "; this program reads 1, 0",
                  "decode it with a newer version");
    }
    const bool chunked = CodecSections::in(format.chunked, entry.kind),
               parted = chunked || CodecSections::in(format.parted, entry.kind);
    if (entry.part >= (parted ? format.parts : 1) || (!chunked && entry.chunk != 0)) {
      return fail(ErrorKind::malformed, entry.name(), "has a number that this section does not have",
                  "copy the file again");
    }
  }
  return Done{};
}

/// META: u64 anchors, u32 K, u32 D, u32 anchors a chunk, f64 voxel size, 3 x f64 base steps, u32 number of values; of
/// each, keys ascending: u8 length of the key, key, u8 type (1 i64, 2 f64, 3 text), value (a text with u32 length).
[[nodiscard]] inline std::vector<std::byte> encode_meta(const CodecModel& model, std::uint64_t anchors) {
  ByteWriter writer;
  writer.put(anchors)
      .put(static_cast<std::uint32_t>(model.offset_count))
      .put(static_cast<std::uint32_t>(model.feature_dim));
  writer.put(static_cast<std::uint32_t>(model.chunk_anchors)).put(model.voxel_size);
  for (const double step : model.base_step) writer.put(step);
  writer.put(static_cast<std::uint32_t>(model.metadata.size()));
  for (const auto& [key, value] : model.metadata) {
    writer.put(static_cast<std::uint8_t>(key.size())).put(std::string_view(key));
    writer.put(static_cast<std::uint8_t>(value.index() + 1));
    if (const auto* integer = std::get_if<std::int64_t>(&value)) writer.put(*integer);
    if (const auto* real = std::get_if<double>(&value)) writer.put(*real);
    if (const auto* text = std::get_if<std::string>(&value)) {
      writer.put(static_cast<std::uint32_t>(text->size())).put(std::string_view(*text));
    }
  }
  return writer.take();
}

/// Fills the model's numbers and metadata; returns the number of anchors.
[[nodiscard]] inline Result<std::uint64_t> decode_meta(std::span<const std::byte> payload, CodecModel& model) {
  ByteReader reader(payload);
  const auto anchors = reader.get<std::uint64_t>();
  const auto k = reader.get<std::uint32_t>(), d = reader.get<std::uint32_t>(), chunk = reader.get<std::uint32_t>();
  model.voxel_size = reader.get<double>();
  for (double& step : model.base_step) step = reader.get<double>();
  constexpr std::uint32_t limit = 1u << 30;
  model.offset_count = static_cast<int>(std::min(k, limit));
  model.feature_dim = static_cast<int>(std::min(d, limit));
  model.chunk_anchors = static_cast<int>(std::min(chunk, limit));
  const std::size_t count = reader.count(3);
  std::string before;
  for (std::size_t i = 0; i < count && !reader.failed(); ++i) {
    std::string key = reader.text(reader.get<std::uint8_t>());
    const auto type = reader.get<std::uint8_t>();
    CodecValue value;
    if (type == 1) {
      value = reader.get<std::int64_t>();
    } else if (type == 2) {
      value = reader.get<double>();
    } else if (type == 3) {
      const auto length = reader.get<std::uint32_t>();
      if (length > CodecLimits::text) return bad_section("META", "a text is longer than 2^20 bytes");
      value = reader.text(length);
    } else {
      return bad_section("META", "a value has the unknown type " + std::to_string(type));
    }
    if (key <= before) return bad_section("META", "keys are empty or not in ascending order");
    before = key;
    model.metadata.emplace(std::move(key), std::move(value));
  }
  if (!reader.complete()) return bad_section("META", "its values do not end where it does");
  const Result<Done> checked = check_codec_numbers(model);
  if (!checked) {
    Error error = checked.error();
    error.field = "META: " + error.field;
    error.remedy = "copy the file again";
    return error;
  }
  if (anchors > CodecLimits::anchors) {
    return Error{ErrorKind::exhausted, "", "META", std::to_string(anchors) + " anchors are more than 2^28",
                 "check the file"};
  }
  return anchors;
}

/// TABL: u64 fingerprint of the Gaussian tables, u64 hash of the step tables.
[[nodiscard]] inline std::vector<std::byte> encode_tables(const GaussianTables& tables) {
  return ByteWriter().put(tables.fingerprint()).put(step_table_hash()).take();
}
[[nodiscard]] inline Result<Done> check_tables(std::span<const std::byte> payload, const GaussianTables& tables) {
  ByteReader reader(payload);
  const auto gaussian = reader.get<std::uint64_t>(), step = reader.get<std::uint64_t>();
  if (!reader.complete()) return bad_section("TABL", "has " + std::to_string(payload.size()) + " bytes, not 16");
  if (gaussian != tables.fingerprint() || step != step_table_hash()) {
    return Error{ErrorKind::unsupported, "", "TABL", "its coding tables are not those of this program",
                 "decode it with the version that wrote it"};
  }
  return Done{};
}

}  // namespace detail

}  // namespace compmark
