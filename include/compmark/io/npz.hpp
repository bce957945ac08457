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
#include "compmark/io/zip_writer.hpp"

namespace compmark {

/// An array of an archive, as the bytes of its .npy file (npy_bytes).
struct NpzEntry {
  std::string name;  ///< as numpy.load has it, without ".npy"
  std::vector<std::byte> npy;
};

/// The file of some arrays, in their order. Error: it would be larger than 4 GiB, or a name longer than 65,000 bytes.
[[nodiscard]] inline Result<std::vector<std::byte>> npz_bytes(std::span<const NpzEntry> entries) {
  std::vector<ZipEntry> files;
  for (const NpzEntry& entry : entries) files.push_back({entry.name + ".npy", entry.npy});
  return zip_bytes(files, "an .npz file", "arrays");
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
