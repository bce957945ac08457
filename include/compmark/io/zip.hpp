// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Reading ZIP archives whose entries are stored, not compressed, as NumPy's .npz files are. Entries below
// 4 GiB, no ZIP64. No size is believed before the bytes are there, entries may not share bytes, and every checksum is
// compared. Cost: the checksum's table look-up a byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"

namespace compmark {

/// An entry of an archive that was parsed.
struct ZipEntry {
  std::string name;
  std::span<const std::byte> content;  ///< within the archive's bytes
};

/// How a kind of archive is called in errors, and how it is written rightly.
struct ZipWords {
  std::string kind;    ///< "an .npz file"
  std::string again;   ///< how to write it
  std::string packed;  ///< how to write it without compression
};

namespace detail {

/// CRC-32 of ZIP (polynomial 0xEDB88320).
[[nodiscard]] inline std::uint32_t zip_checksum(std::span<const std::byte> bytes) {
  static constexpr auto table = [] {
    std::array<std::uint32_t, 256> values{};
    for (std::uint32_t i = 0; i < 256; ++i) {
      std::uint32_t value = i;
      for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ ((value & 1) != 0 ? 0xEDB88320U : 0U);
      values[i] = value;
    }
    return values;
  }();
  std::uint32_t checksum = ~0U;
  for (const std::byte byte : bytes)
    checksum = table[(checksum ^ std::to_integer<std::uint32_t>(byte)) & 255] ^ (checksum >> 8);
  return ~checksum;
}

inline constexpr std::uint32_t zip_local = 0x04034b50, zip_central = 0x02014b50, zip_end = 0x06054b50;
inline constexpr std::size_t zip_local_size = 30, zip_central_size = 46, zip_end_size = 22;

[[nodiscard]] inline std::size_t zip_number(std::span<const std::byte> bytes, std::size_t at, int count) {
  std::size_t value = 0;
  for (int i = count; i-- > 0;)
    value = value << 8 | std::to_integer<std::size_t>(bytes[at + static_cast<std::size_t>(i)]);
  return value;
}

}  // namespace detail

/// The entries of a whole archive, in the order of its directory; `name` is for the messages.
[[nodiscard]] inline Result<std::vector<ZipEntry>> parse_zip(std::span<const std::byte> bytes, const std::string& name,
                                                             const ZipWords& words) {
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, name, std::move(field), std::move(problem), std::move(remedy)};
  };
  const auto number = [&](std::size_t at, int count) { return detail::zip_number(bytes, at, count); };
  if (bytes.size() < detail::zip_end_size)
    return fail(ErrorKind::truncated, "byte 0", "is too short to be " + words.kind, words.again);
  std::size_t end = bytes.size() - detail::zip_end_size;  // before a comment, which has at most 65,535 bytes
  const std::size_t last = end > 65535 ? end - 65535 : 0;
  while (number(end, 4) != detail::zip_end) {
    if (end == last)
      return fail(ErrorKind::malformed, "directory", "is not there; the file is cut off or no archive",
                  "copy it again");
    --end;
  }
  const std::size_t count = number(end + 10, 2), size = number(end + 12, 4);
  std::size_t at = number(end + 16, 4);
  if (count == 65535 || at > end || size > end - at)
    return fail(ErrorKind::unsupported, "directory", "lies outside of the file, or is one of ZIP64", words.again);
  const std::size_t behind = at + size;
  std::vector<ZipEntry> entries;
  std::size_t total = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string field = "entry " + std::to_string(i + 1);
    if (behind - at < detail::zip_central_size || number(at, 4) != detail::zip_central)
      return fail(ErrorKind::malformed, field, "has no place in the directory", "copy the file again");
    const std::size_t flags = number(at + 8, 2), method = number(at + 10, 2), checksum = number(at + 16, 4);
    const std::size_t stored = number(at + 20, 4), whole = number(at + 24, 4), begin = number(at + 42, 4);
    const std::size_t name_size = number(at + 28, 2), more = number(at + 30, 2) + number(at + 32, 2);
    if (name_size + more > behind - at - detail::zip_central_size)
      return fail(ErrorKind::truncated, field, "has a name that the directory does not hold", "copy the file again");
    std::string entry(reinterpret_cast<const char*>(bytes.data()) + at + detail::zip_central_size, name_size);
    at += detail::zip_central_size + name_size + more;
    if (method != 0 || (flags & 1) != 0 || stored != whole)
      return fail(ErrorKind::unsupported, field, "is compressed or encrypted", words.packed);
    if (begin > bytes.size() || bytes.size() - begin < detail::zip_local_size || number(begin, 4) != detail::zip_local)
      return fail(ErrorKind::malformed, field, "is not where the directory says", "copy the file again");
    const std::size_t head = detail::zip_local_size + number(begin + 26, 2) + number(begin + 28, 2);
    if (head > bytes.size() - begin || stored > bytes.size() - begin - head)
      return fail(ErrorKind::truncated, field, "promises more bytes than the file holds", "copy the file again");
    total += stored;
    if (total > bytes.size())  // entries that share their bytes would take more memory than the file
      return fail(ErrorKind::malformed, field, "lies where another entry does", "copy the file again");
    const std::span<const std::byte> body = bytes.subspan(begin + head, stored);
    if (detail::zip_checksum(body) != checksum)
      return fail(ErrorKind::malformed, field, "has another checksum than the directory says", "copy the file again");
    entries.push_back({std::move(entry), body});
  }
  return entries;
}

}  // namespace compmark
