// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The container of compressed models, `.cmk` (docs/spec/compression.md, 4; docs/container.md has every byte): a header
// of 64 bytes, a table of contents, and sections that tile the rest of the file. Every byte is covered by exactly one
// CRC-32C, which is checked before what it covers is parsed. This file knows nothing of what is inside a section.
// Reading costs one pass over the bytes; nothing is copied. The table of contents comes first, so that the beginning of
// a file says what of it has arrived.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/bytes.hpp"
#include "compmark/io/crc32c.hpp"

namespace compmark {

/// Four characters as the number they are stored as.
[[nodiscard]] constexpr std::uint32_t four_characters(const char (&text)[5]) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value |= static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])) << (8 * i);
  return value;
}

/// The name of a section; characters that are no letters or digits show as "?".
[[nodiscard]] inline std::string section_name(std::uint32_t kind) {
  std::string name;
  for (int shift = 0; shift < 32; shift += 8) {
    const char c = static_cast<char>(kind >> shift & 127u);
    name += (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') ? c : '?';
  }
  return name;
}

enum class ContainerProfile : std::uint32_t { hac = 1, context_gs = 2, hac_plus = 3 };

struct ContainerFormat {
  static constexpr std::array<std::uint8_t, 8> magic{0x89, 'C', 'M', 'K', 0x0D, 0x0A, 0x1A, 0x0A};
  static constexpr std::uint16_t major = 1, minor = 0;
  static constexpr std::size_t header_size = 64, entry_size = 48;
  static constexpr std::uint32_t section_limit = 65'536;
  static constexpr std::uint32_t flag_reserved = 1, flag_networks = 2, flag_salvageable = 4;
};

/// Fields of the header that are not about byte positions.
struct ContainerHeader {
  ContainerProfile profile = ContainerProfile::hac;
  std::uint32_t numeric_spec = 0;  ///< version of the integer arithmetic: another number is another decoder
  std::uint32_t flags = 0;
  std::uint64_t digest = 0;  ///< of the decoded model
  std::uint16_t major = ContainerFormat::major, minor = ContainerFormat::minor;
};

/// One line of the table of contents.
struct SectionEntry {
  static constexpr std::uint16_t flag_critical = 1;

  std::uint32_t kind = 0;  ///< four characters
  std::uint16_t version = 1;
  std::uint16_t flags = flag_critical;
  std::uint32_t part = 0;    ///< level or attribute
  std::uint32_t chunk = 0;   ///< number within (kind, part)
  std::uint64_t offset = 0;  ///< from the start of the file
  std::uint64_t size = 0;    ///< stored bytes
  std::uint64_t items = 0;   ///< what they expand to, in the section's own unit
  std::uint32_t crc = 0;
  std::uint32_t method = 0;  ///< coding of the payload

  [[nodiscard]] bool critical() const { return (flags & flag_critical) != 0; }
  [[nodiscard]] std::string name() const {
    return section_name(kind) +
           (part == 0 && chunk == 0 ? "" : " " + std::to_string(part) + "." + std::to_string(chunk));
  }
};

/// A section with its bytes, on the way into a file. `offset`, `size` and `crc` of the entry are computed.
struct Section {
  SectionEntry entry;
  std::vector<std::byte> bytes;
};

/// The whole file.
[[nodiscard]] inline std::vector<std::byte> write_container(const ContainerHeader& header,
                                                            std::span<const Section> sections) {
  const std::size_t table_size = sections.size() * ContainerFormat::entry_size + 4;
  std::uint64_t offset = ContainerFormat::header_size + table_size;
  ByteWriter table;
  for (const Section& section : sections) {
    const SectionEntry& e = section.entry;
    table.put(e.kind).put(e.version).put(e.flags).put(e.part).put(e.chunk).put(offset);
    table.put(std::uint64_t{section.bytes.size()}).put(e.items).put(crc32c(section.bytes)).put(e.method);
    offset += section.bytes.size();
  }
  table.put(crc32c(table.bytes()));

  ByteWriter file;
  for (const std::uint8_t byte : ContainerFormat::magic) file.put(byte);
  file.put(header.major).put(header.minor).put(static_cast<std::uint32_t>(ContainerFormat::header_size)).put(offset);
  file.put(static_cast<std::uint32_t>(header.profile)).put(static_cast<std::uint32_t>(sections.size()));
  file.put(std::uint64_t{ContainerFormat::header_size}).put(header.numeric_spec).put(header.flags).put(header.digest);
  file.put(std::uint32_t{0}).put(crc32c(file.bytes()));
  file.put(table.bytes());
  for (const Section& section : sections) file.put(section.bytes);
  return file.take();
}

/// A file whose header and table of contents have been checked; payloads have not, `payload` does that. Refers to the
/// bytes it was parsed from.
class Container {
 public:
  ContainerHeader header;
  std::vector<SectionEntry> sections;  ///< in the order of the file

  /// Bytes that a truncated file lacks; 0 for a file that was parsed whole.
  [[nodiscard]] std::uint64_t absent_bytes() const {
    return sections.empty() ? 0 : sections.back().offset + sections.back().size - bytes_.size();
  }
  /// Whether a truncated file has all bytes of a section.
  [[nodiscard]] bool arrived(const SectionEntry& entry) const { return entry.offset + entry.size <= bytes_.size(); }
  /// The bytes of a section, once their CRC is right.
  [[nodiscard]] Result<std::span<const std::byte>> payload(const SectionEntry& entry) const {
    if (!arrived(entry)) {
      return error(ErrorKind::truncated, entry.name(),
                   "ends at byte " + std::to_string(entry.offset + entry.size) + ", " + std::to_string(bytes_.size()) +
                       " bytes of the file are there",
                   "wait for the rest of it, or copy the file again");
    }
    const std::span<const std::byte> bytes = raw(entry);
    if (crc32c(bytes) != entry.crc) {
      return error(ErrorKind::malformed, entry.name(),
                   "its checksum is wrong: the " + std::to_string(entry.size) + " bytes from " +
                       std::to_string(entry.offset) + " on are damaged",
                   "copy the file again");
    }
    return bytes;
  }
  /// The bytes of a complete section, without a check of their CRC.
  [[nodiscard]] std::span<const std::byte> raw(const SectionEntry& entry) const {
    return bytes_.subspan(static_cast<std::size_t>(entry.offset), static_cast<std::size_t>(entry.size));
  }
  [[nodiscard]] const SectionEntry* find(std::uint32_t kind, std::uint32_t part = 0, std::uint32_t chunk = 0) const {
    for (const SectionEntry& e : sections) {
      if (e.kind == kind && e.part == part && e.chunk == chunk) return &e;
    }
    return nullptr;
  }
  /// All sections of a kind, in order; parsed files have each (kind, part, chunk) once.
  [[nodiscard]] std::vector<SectionEntry> all(std::uint32_t kind) const {
    std::vector<SectionEntry> found;
    for (const SectionEntry& e : sections) {
      if (e.kind == kind) found.push_back(e);
    }
    return found;
  }
  [[nodiscard]] Error error(ErrorKind kind, std::string field, std::string problem, std::string remedy) const {
    return {kind, path, std::move(field), std::move(problem), std::move(remedy)};
  }

  std::string path;  ///< for messages

 private:
  friend Result<Container> parse_container(std::span<const std::byte> bytes, std::string path, bool partial);
  std::span<const std::byte> bytes_;
};

/// Checks header and table of contents. `bytes` must outlive the container. `partial`: the file may end anywhere behind
/// its table of contents; without it a file that ends too early is refused.
[[nodiscard]] inline Result<Container> parse_container(std::span<const std::byte> bytes, std::string path,
                                                       bool partial = false) {
  Container container;
  container.path = std::move(path);
  container.bytes_ = bytes;
  const std::string copy_again = "copy the file again";
  const auto fail = [&](ErrorKind kind, const char* field, std::string problem) {
    return container.error(kind, field, std::move(problem), copy_again);
  };
  const auto number = [](std::uint64_t value) { return std::to_string(value); };

  const std::size_t seen = std::min(bytes.size(), ContainerFormat::magic.size());
  for (std::size_t i = 0; i < seen; ++i) {
    if (std::to_integer<std::uint8_t>(bytes[i]) != ContainerFormat::magic[i]) {
      const bool named = i >= 4;  // the rest of the magic tells what a text-mode copy does
      return container.error(ErrorKind::malformed, "magic",
                             named ? "line ends were changed on the way (copied as text)"
                                   : "not a .cmk file: it does not begin with 89 'C' 'M' 'K'",
                             named ? "copy it as binary" : "give the name of a .cmk file");
    }
  }
  if (bytes.size() < ContainerFormat::header_size) {
    return fail(ErrorKind::truncated, "header", "the file has " + number(bytes.size()) + " bytes, fewer than 64");
  }
  ByteReader reader(bytes.first(ContainerFormat::header_size));
  (void)reader.take(8);
  container.header.major = reader.get<std::uint16_t>();
  container.header.minor = reader.get<std::uint16_t>();
  const auto header_size = reader.get<std::uint32_t>();
  const auto file_size = reader.get<std::uint64_t>();
  container.header.profile = static_cast<ContainerProfile>(reader.get<std::uint32_t>());
  const auto count = reader.get<std::uint32_t>();
  const auto table_offset = reader.get<std::uint64_t>();
  container.header.numeric_spec = reader.get<std::uint32_t>();
  container.header.flags = reader.get<std::uint32_t>();
  container.header.digest = reader.get<std::uint64_t>();
  const auto reserved = reader.get<std::uint32_t>();
  const auto header_crc = reader.get<std::uint32_t>();
  if (header_crc != crc32c(bytes.first(60))) return fail(ErrorKind::malformed, "header", "its checksum is wrong");
  if (container.header.major != ContainerFormat::major) {
    return container.error(
        ErrorKind::unsupported, "version",
        "format " + number(container.header.major) + "." + number(container.header.minor) + ", this program reads 1.x",
        "use a program of that version");
  }
  if (header_size != ContainerFormat::header_size || table_offset != ContainerFormat::header_size || reserved != 0) {
    return fail(ErrorKind::malformed, "header", "sizes or reserved bytes are not those of format 1");
  }
  if (partial ? file_size < bytes.size() : file_size != bytes.size()) {
    const bool begun = file_size > bytes.size();
    return container.error(
        begun ? ErrorKind::truncated : ErrorKind::malformed, "file size",
        "the file has " + number(bytes.size()) + " bytes, its header says " + number(file_size),
        begun ? "copy the file again, or ask for what has arrived (decompress --partial)" : copy_again);
  }
  if (count > ContainerFormat::section_limit) {
    return fail(ErrorKind::malformed, "section count", number(count) + " is above the limit of 65536");
  }
  const std::size_t table_size = count * ContainerFormat::entry_size;
  if (table_size + 4 > bytes.size() - ContainerFormat::header_size) {
    return fail(ErrorKind::truncated, "table of contents", number(count) + " sections do not fit into the file");
  }
  const std::span<const std::byte> table = bytes.subspan(ContainerFormat::header_size, table_size + 4);
  ByteReader rows(table);
  ByteReader last(table.subspan(table_size));
  if (last.get<std::uint32_t>() != crc32c(table.first(table_size))) {
    return fail(ErrorKind::malformed, "table of contents", "its checksum is wrong");
  }
  std::uint64_t reached = ContainerFormat::header_size + table_size + 4;
  std::set<std::array<std::uint32_t, 3>> names;
  for (std::uint32_t i = 0; i < count; ++i) {
    SectionEntry e;
    e.kind = rows.get<std::uint32_t>();
    e.version = rows.get<std::uint16_t>();
    e.flags = rows.get<std::uint16_t>();
    e.part = rows.get<std::uint32_t>();
    e.chunk = rows.get<std::uint32_t>();
    e.offset = rows.get<std::uint64_t>();
    e.size = rows.get<std::uint64_t>();
    e.items = rows.get<std::uint64_t>();
    e.crc = rows.get<std::uint32_t>();
    e.method = rows.get<std::uint32_t>();
    if (e.offset != reached) {
      return container.error(
          ErrorKind::malformed, e.name(),
          "begins at byte " + number(e.offset) + ", the section before it ends at " + number(reached), copy_again);
    }
    if (e.size > file_size - reached) {
      return container.error(ErrorKind::malformed, e.name(), "its " + number(e.size) + " bytes end behind the file",
                             copy_again);
    }
    if (!names.insert({e.kind, e.part, e.chunk}).second) {
      return container.error(ErrorKind::malformed, e.name(), "appears twice in the table of contents", copy_again);
    }
    reached += e.size;
    container.sections.push_back(e);
  }
  if (reached != file_size) {
    return fail(ErrorKind::malformed, "file size", number(file_size - reached) + " bytes behind the last section");
  }
  return container;
}

}  // namespace compmark
