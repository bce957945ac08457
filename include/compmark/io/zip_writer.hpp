// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Writing ZIP archives whose entries are stored, not compressed: .npz files and SOG files. Below 4 GiB and 65,535
// entries, no ZIP64. The bytes depend on names and contents alone: every entry has the date of 1 January 1980.
// Cost: the checksum's table look-up a byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/zip.hpp"

namespace compmark {

namespace detail {

class ZipWriter {
 public:
  void number(std::uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) bytes_.push_back(static_cast<std::byte>(value >> (8 * i) & 255));
  }
  void add(std::span<const std::byte> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  void add(std::string_view text) { add(std::as_bytes(std::span<const char>(text))); }
  /// What local and central header share: version to extract, UTF-8 names, stored, no date, checksum, sizes, lengths.
  void description(std::uint32_t checksum, std::size_t size, std::size_t name) {
    for (const std::uint32_t value : {20U, 0x800U, 0U, 0U, 0x21U}) number(value, 2);  // 0x21: the first of January 1980
    number(checksum, 4);
    number(static_cast<std::uint32_t>(size), 4);
    number(static_cast<std::uint32_t>(size), 4);
    number(static_cast<std::uint32_t>(name), 2);
    number(0, 2);
  }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace detail

/// The archive of some entries, in their order; `kind` and `what` are for the message. Error: it would be larger than
/// 4 GiB, or a name longer than 65,000 bytes.
[[nodiscard]] inline Result<std::vector<std::byte>> zip_bytes(std::span<const ZipEntry> entries,
                                                              const std::string& kind = "a ZIP archive",
                                                              const std::string& what = "entries") {
  constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
  std::uint64_t total = detail::zip_end_size;
  for (const ZipEntry& entry : entries) {
    if (entry.name.size() > 65000)
      return Error{ErrorKind::invalid, {}, "name", "is too long for " + kind, "shorten it"};
    total += detail::zip_local_size + detail::zip_central_size + 2 * entry.name.size() + entry.content.size();
  }
  if (total > most || entries.size() > 65534) {
    return Error{ErrorKind::exhausted, {}, what, "are more than " + kind + " of 4 GiB holds", "write several files"};
  }
  detail::ZipWriter file, directory;
  for (const ZipEntry& entry : entries) {
    const std::uint32_t checksum = detail::zip_checksum(entry.content);
    directory.number(detail::zip_central, 4);
    directory.number(20, 2);
    directory.description(checksum, entry.content.size(), entry.name.size());
    for (int i = 0; i < 5; ++i) directory.number(0, 2);  // no comment, the first disk, no attributes
    directory.number(static_cast<std::uint32_t>(file.size()), 4);
    directory.add(entry.name);
    file.number(detail::zip_local, 4);
    file.description(checksum, entry.content.size(), entry.name.size());
    file.add(entry.name);
    file.add(entry.content);
  }
  const std::size_t begin = file.size();
  const std::vector<std::byte> names = directory.take();
  file.add(names);
  file.number(detail::zip_end, 4);
  file.number(0, 4);
  for (int i = 0; i < 2; ++i) file.number(static_cast<std::uint32_t>(entries.size()), 2);
  file.number(static_cast<std::uint32_t>(names.size()), 4);
  file.number(static_cast<std::uint32_t>(begin), 4);
  file.number(0, 2);
  return file.take();
}

}  // namespace compmark
