// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Writes splats in the format that the ending of a name says, or that is asked for (docs/splat_formats.md):
//   .ply  3DGS PLY      .compressed.ply  compressed PLY      .spz      .splat      .sog      .glb
// Whole or not at all; a number that no renderer can use is refused with its column and its splat.
//   const Result<SplatWritten> file = write_splat("scene.spz", table);   // file->bytes, file->notes
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/splat/read_splat.hpp"
#include "compmark/io/splat/splat_rounding.hpp"
#include "compmark/io/splat/write_antimatter_splat.hpp"
#include "compmark/io/splat/write_compressed_ply.hpp"
#include "compmark/io/splat/write_glb.hpp"
#include "compmark/io/splat/write_sog.hpp"
#include "compmark/io/splat/write_spz.hpp"
#include "compmark/io/splat_ply.hpp"

namespace compmark {

struct SplatEnding {
  std::string_view ending;  ///< of a file's name
  std::string_view word;    ///< as an option names the format
  SplatFormat format;
};
/// The formats that are written; an ending before those that it ends in.
inline constexpr std::array<SplatEnding, 6> splat_endings{
    {{".compressed.ply", "compressed-ply", SplatFormat::compressed_ply},
     {".ply", "ply", SplatFormat::ply},
     {".splat", "antimatter-splat", SplatFormat::splat},
     {".spz", "spz", SplatFormat::spz},
     {".sog", "sog", SplatFormat::sog},
     {".glb", "glb", SplatFormat::glb}}};

/// The format that a name asks for: PLY without an ending (a pipe, a device). Error: another ending.
[[nodiscard]] inline Result<SplatFormat> splat_format_of_name(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::string endings;
  for (const SplatEnding& known : splat_endings) {
    if (detail::name_ends_with(name, known.ending)) return known.format;
    endings += (endings.empty() ? "" : ", ") + std::string(known.ending);
  }
  if (path.extension().empty()) return SplatFormat::ply;
  return Error{ErrorKind::unsupported,
               name,
               {},
               "ends in " + path.extension().string() + ", which no splats are written as",
               "end the name in one of " + endings + ", or name the format"};
}

namespace detail {

template <class Json, Executor E>
[[nodiscard]] Result<EncodedSplats> encode_splats(const SplatTable& table, SplatFormat format,
                                                  const SplatWriteSettings& settings, const std::string& name,
                                                  E& executor) {
  if (const Result<Done> usable = check_splats(table, name); !usable) return usable.error();
  if (table.count == 0)
    return splat_error(ErrorKind::invalid, name, "splats",
                       "are none, which " + std::string(splat_format_name(format)) + " cannot say",
                       "export a model with splats, or a PLY");
  if (table.count > std::uint64_t{0xffffffff})
    return splat_error(ErrorKind::exhausted, name, "splats", "are more than 4,294,967,295", "export a PLY");
  switch (format) {
    case SplatFormat::compressed_ply:
      return compressed_ply_bytes_of(table, settings);
    case SplatFormat::splat:
      return antimatter_splat_bytes_of(table);
    case SplatFormat::spz:
      return spz_bytes_of(table, settings, name);
    case SplatFormat::sog:
      return sog_bytes_of<Json>(table, settings, name, executor);
    case SplatFormat::glb:
      return glb_bytes_of<Json>(table, name);
    case SplatFormat::ply:
    case SplatFormat::ksplat:
      break;
  }
  return splat_error(ErrorKind::unsupported, name, "format",
                     "is " + std::string(splat_format_name(format)) + ", which is not written", "choose another one");
}

}  // namespace detail

/// Writes a file. Error: a number that is NaN or infinite, no splats in a format that cannot say so, a place that SPZ
/// does not hold, a version that this program does not write, an output that cannot be. Memory: the file, but for a
/// plain PLY.
template <class Json = nlohmann::ordered_json, Executor E>
[[nodiscard]] Result<SplatWritten> write_splat(const std::filesystem::path& path, const SplatTable& table,
                                               const SplatWriteSettings& settings, E& executor) {
  SplatWritten written;
  if (settings.format) {
    written.format = *settings.format;
  } else {
    const Result<SplatFormat> named = splat_format_of_name(path);
    if (!named) return named.error();
    written.format = *named;
  }
  if (written.format == SplatFormat::ply) {
    if (const Result<Done> done = write_splat_ply(path, table, settings.comments); !done) return done.error();
    std::error_code status;
    if (std::filesystem::is_regular_file(path, status)) written.bytes = std::filesystem::file_size(path, status);
    return written;
  }
  Result<EncodedSplats> encoded = detail::encode_splats<Json>(table, written.format, settings, path.string(), executor);
  if (!encoded) return encoded.error();
  Result<AtomicFile> file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(encoded->bytes);
  written.bytes = file->is_stream() ? 0 : encoded->bytes.size();
  if (const Result<Done> done = file->commit(); !done) return done.error();
  written.version = encoded->version;
  written.fractional_bits = encoded->fractional_bits;
  written.notes = std::move(encoded->notes);
  return written;
}
template <class Json = nlohmann::ordered_json>
[[nodiscard]] Result<SplatWritten> write_splat(const std::filesystem::path& path, const SplatTable& table,
                                               const SplatWriteSettings& settings = {}) {
  SerialExecutor executor;
  return write_splat<Json>(path, table, settings, executor);
}

}  // namespace compmark
