// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// NumPy's .npz files: several arrays by name, each an .npy file in a ZIP archive that is stored, not compressed, as
// numpy.savez writes it and numpy.load reads it. Arrays of less than 4 GiB, files without ZIP64's directory. No size is
// believed before the bytes are there, and the checksum of every array is compared. Cost: the checksum's table
// look-up a byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/file_kind.hpp"
#include "compmark/io/npy.hpp"
#include "compmark/io/zip.hpp"

namespace compmark {

/// An array of an archive, as the bytes of its .npy file (npy_bytes).
struct NpzEntry {
  std::string name;  ///< as numpy.load has it, without ".npy"
  std::vector<std::byte> npy;
};

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

/// The file of some arrays, in their order. Error: it would be larger than 4 GiB, or a name longer than 65,000 bytes.
[[nodiscard]] inline Result<std::vector<std::byte>> npz_bytes(std::span<const NpzEntry> entries) {
  constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
  std::uint64_t total = detail::zip_end_size;
  for (const NpzEntry& entry : entries) {
    if (entry.name.size() > 65000)
      return Error{ErrorKind::invalid, {}, "name", "is too long for an .npz file", "shorten it"};
    total += detail::zip_local_size + detail::zip_central_size + 2 * (entry.name.size() + 4) + entry.npy.size();
  }
  if (total > most || entries.size() > 65534) {
    return Error{
        ErrorKind::exhausted, {}, "arrays", "are more than an .npz file of 4 GiB holds", "write several files"};
  }
  detail::ZipWriter file, directory;
  for (const NpzEntry& entry : entries) {
    const std::string name = entry.name + ".npy";
    const std::uint32_t checksum = detail::zip_checksum(entry.npy);
    directory.number(detail::zip_central, 4);
    directory.number(20, 2);
    directory.description(checksum, entry.npy.size(), name.size());
    for (int i = 0; i < 5; ++i) directory.number(0, 2);  // no comment, the first disk, no attributes
    directory.number(static_cast<std::uint32_t>(file.size()), 4);
    directory.add(name);
    file.number(detail::zip_local, 4);
    file.description(checksum, entry.npy.size(), name.size());
    file.add(name);
    file.add(entry.npy);
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

/// Writes it, whole or not at all.
[[nodiscard]] inline Result<Done> write_npz(const std::filesystem::path& path, std::span<const NpzEntry> entries) {
  const Result<std::vector<std::byte>> bytes = npz_bytes(entries);
  if (!bytes) return bytes.error();
  return write_file(path, std::span<const std::byte>(*bytes));
}

/// An array of a file that was read.
struct NpzArray {
  std::string name;
  NpyArray array;
};

/// Parses a whole file; `name` is for the message. Entries that are no .npy files are an error.
[[nodiscard]] inline Result<std::vector<NpzArray>> parse_npz(std::span<const std::byte> bytes,
                                                             const std::string& name) {
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, name, std::move(field), std::move(problem), std::move(remedy)};
  };
  const char* const again = "save the arrays with numpy.savez";
  const Result<std::vector<ZipEntry>> entries =
      parse_zip(bytes, name, {"an .npz file", again, "save the arrays with numpy.savez, not savez_compressed"});
  if (!entries) return entries.error();
  std::vector<NpzArray> arrays;
  for (std::size_t i = 0; i < entries->size(); ++i) {
    std::string entry = (*entries)[i].name;
    if (!entry.ends_with(".npy"))
      return fail(ErrorKind::unsupported, "entry " + std::to_string(i + 1), "is no .npy file", again);
    entry.resize(entry.size() - 4);
    Result<NpyArray> array = parse_npy((*entries)[i].content, name + "(" + one_line(entry) + ")");
    if (!array) return array.error();
    arrays.push_back({std::move(entry), std::move(*array)});
  }
  return arrays;
}

[[nodiscard]] inline Result<std::vector<NpzArray>> read_npz(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes =
      read_file_of(path, std::uintmax_t{1} << 32, "NumPy arrays (.npz)",
                   [](FileKind kind, std::span<const std::byte>) { return kind == FileKind::npz; });
  if (!bytes) return bytes.error();
  return parse_npz(*bytes, path.string());
}

}  // namespace compmark
