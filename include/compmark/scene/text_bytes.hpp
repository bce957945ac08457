// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Reads text as editors and other systems write it: with a byte order mark, in UTF-16, with zero bytes at its end.
// Every text file of a capture is read through this file, so that an invisible mark neither becomes part of the first
// word nor makes a line unreadable. Cost: one pass over the first bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/file_kind.hpp"

namespace compmark {
namespace detail {

/// The bytes of a text without the byte order mark of UTF-8 and without zero bytes at the end; UTF-16 and UTF-32 are an
/// Error that names them.
[[nodiscard]] inline Result<std::vector<std::byte>> plain_text(std::vector<std::byte> bytes, const std::string& name) {
  const auto at = [&](std::size_t i) { return i < bytes.size() ? std::to_integer<unsigned>(bytes[i]) : 256u; };
  const bool marked = (at(0) == 0xFF && at(1) == 0xFE) || (at(0) == 0xFE && at(1) == 0xFF);
  // Without a mark: every other byte of the first two letters is zero.
  const bool wide = bytes.size() >= 4 && ((at(0) == 0 && at(2) == 0 && at(1) != 0 && at(3) != 0) ||
                                          (at(1) == 0 && at(3) == 0 && at(0) != 0 && at(2) != 0));
  if (marked || wide) return Error{ErrorKind::unsupported, name, "", "is text in UTF-16 or UTF-32", "save it as UTF-8"};
  while (!bytes.empty() && bytes.back() == std::byte{0}) bytes.pop_back();
  if (at(0) == 0xEF && at(1) == 0xBB && at(2) == 0xBF) bytes.erase(bytes.begin(), bytes.begin() + 3);
  return bytes;
}

/// The text of a file of at most `limit` bytes. A large one that does not begin as a text is refused before the rest of
/// it is read.
[[nodiscard]] inline Result<std::vector<std::byte>> read_text(const std::filesystem::path& path,
                                                              std::uintmax_t limit = std::uintmax_t{1} << 40) {
  Result<std::vector<std::byte>> bytes =
      read_file(path, limit, file_kind_head, [&](std::span<const std::byte> head, std::uintmax_t size) {
        const auto text = plain_text({head.begin(), head.end()}, path.string());  // without the zeros of a file system
        if (!text) return Result<Done>(text.error());
        const FileKind kind = text->empty() ? FileKind::unknown : identify_bytes(*text, size);
        if (size <= file_kind_head || (kind >= FileKind::text && kind <= FileKind::owner_key))
          return Result<Done>(Done{});
        return Result<Done>(wrong_kind(kind, path.string(), "a text file"));
      });
  if (!bytes) return bytes;
  return plain_text(std::move(*bytes), path.string());
}

}  // namespace detail
}  // namespace compmark
