// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any splat file, told by its content (docs/splat_formats.md): 3DGS PLY, compressed PLY, SPZ, SOG, .glb, .ksplat,
// .splat. The ending of a name is asked only where the bytes do not say: a .splat file has no sign of its own.
//   const Result<SplatFile> file = read_splat("scene.spz");   // file->table, file->format
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <locale>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/io/file_kind.hpp"
#include "compmark/io/ply.hpp"
#include "compmark/io/read_file.hpp"
#include "compmark/io/sha256.hpp"
#include "compmark/io/splat/antimatter_splat.hpp"
#include "compmark/io/splat/compressed_ply.hpp"
#include "compmark/io/splat/glb.hpp"
#include "compmark/io/splat/ksplat.hpp"
#include "compmark/io/splat/sog.hpp"
#include "compmark/io/splat/splat_file.hpp"
#include "compmark/io/splat/spz.hpp"
#include "compmark/io/splat_ply.hpp"

namespace compmark {

/// What is read, for errors about other files.
inline constexpr std::string_view read_splat_formats =
    "a splat file (read are 3DGS PLY, compressed PLY, SPZ 2 to 4, SOG 2, .glb, .ksplat and .splat)";

namespace detail {

[[nodiscard]] inline bool name_ends_with(const std::string& name, std::string_view ending) {
  return name.size() >= ending.size() &&
         std::equal(ending.begin(), ending.end(), name.end() - static_cast<std::ptrdiff_t>(ending.size()),
                    [](char a, char b) { return a == (b >= 'A' && b <= 'Z' ? static_cast<char>(b - 'A' + 'a') : b); });
}

/// The format of a file that begins with `head` and has `size` bytes; nothing for a file of another kind. PLY is
/// SplatFormat::ply whatever it holds, and a gzip file SplatFormat::spz.
[[nodiscard]] inline std::optional<SplatFormat> splat_format(std::span<const std::byte> head, std::uintmax_t size,
                                                             const std::string& name) {
  head = head.first(std::min(head.size(), file_kind_head));
  const FileKind kind = identify_bytes(head, size);
  if (kind == FileKind::ply) return SplatFormat::ply;
  if (kind == FileKind::gzip || kind == FileKind::spz) return SplatFormat::spz;
  if (kind == FileKind::sog || (kind == FileKind::zip && name_ends_with(name, ".sog"))) return SplatFormat::sog;
  if (kind == FileKind::glb) return SplatFormat::glb;
  if (tells_kind(kind) || kind == FileKind::empty) return std::nullopt;
  if (looks_like_ksplat(head, size) || name_ends_with(name, ".ksplat")) return SplatFormat::ksplat;
  const std::size_t whole = head.size() - head.size() % antimatter_splat_bytes;
  if (name_ends_with(name, ".splat")) return SplatFormat::splat;
  if (size % antimatter_splat_bytes == 0 && looks_like_antimatter_splat(head.first(whole))) return SplatFormat::splat;
  return std::nullopt;
}

/// Comments of trainers that say so: Brush ("SplatRenderMode: mip") and Postshot ("antialiased 1").
[[nodiscard]] inline bool says_antialiased(const std::vector<std::string>& comments) {
  return std::any_of(comments.begin(), comments.end(), [](const std::string& comment) {
    return comment.find("SplatRenderMode: mip") != std::string::npos ||
           comment.find("antialiased 1") != std::string::npos;
  });
}

/// The direction that a comment of splat_up_comment names.
[[nodiscard]] inline std::optional<std::array<double, 3>> said_up(const std::vector<std::string>& comments) {
  constexpr std::string_view head = "compmark up ";
  for (const std::string& comment : comments) {
    if (!comment.starts_with(head)) continue;
    std::istringstream words(comment.substr(head.size()));
    words.imbue(std::locale::classic());
    std::array<double, 3> up{};
    words >> up[0] >> up[1] >> up[2];
    if (words && std::abs(std::hypot(up[0], up[1], up[2]) - 1) < 1e-6) return up;
  }
  return std::nullopt;
}

[[nodiscard]] inline Result<SplatFile> parse_ply_splats(std::span<const std::byte> bytes, const std::string& name) {
  const Result<PlyFile> ply = parse_ply(bytes, name);
  if (!ply) return ply.error();
  SplatFile file;
  file.antialiased = says_antialiased(ply->comments);
  file.up = said_up(ply->comments);
  const PlyElement* const vertex = ply->find("vertex");
  const bool compressed = vertex != nullptr && is_compressed_ply(*vertex);
  file.format = compressed ? SplatFormat::compressed_ply : SplatFormat::ply;
  Result<SplatTable> table = compressed ? compressed_ply_splats(*ply, name) : standard_ply_rows(*ply, name);
  if (!table) return table.error();
  file.table = std::move(*table);
  if (compressed) return file;
  if (const Result<Done> usable = finish_splats(file.table, name); !usable) return usable.error();
  return file;
}

[[nodiscard]] inline Error no_splats(std::span<const std::byte> head, std::uintmax_t size, const std::string& name) {
  Error error = wrong_kind(identify_bytes(head, size), name, read_splat_formats);
  if (error.remedy.starts_with("give")) error.remedy = "export it as PLY, which every program writes";
  return error;
}

}  // namespace detail

/// A whole file in memory; `name` is its name, for the messages and the ending. Error: the kind of another file, or
/// what is damaged, with its field.
template <class Json = nlohmann::json>
[[nodiscard]] Result<SplatFile> parse_splat(std::span<const std::byte> bytes, const std::string& name) {
  const std::optional<SplatFormat> format = detail::splat_format(bytes, bytes.size(), name);
  if (!format) return detail::no_splats(bytes, bytes.size(), name);
  if (*format == SplatFormat::ply) return detail::parse_ply_splats(bytes, name);
  if (*format == SplatFormat::spz) return parse_spz(bytes, name);
  if (*format == SplatFormat::sog) return parse_sog<Json>(bytes, name);
  if (*format == SplatFormat::glb) return parse_glb<Json>(bytes, name);
  SplatFile file;
  file.format = *format;
  Result<SplatTable> table =
      *format == SplatFormat::ksplat ? parse_ksplat(bytes, name, &file.version) : parse_antimatter_splat(bytes, name);
  if (!table) return table.error();
  file.table = std::move(*table);
  return file;
}

/// Whether a file may hold splats, by its first 64 KiB; false for one that cannot be read.
[[nodiscard]] inline bool is_splat_file(const std::filesystem::path& path) {
  Result<InputFile> file = InputFile::open(path);
  std::vector<std::byte> head;
  return file && file->append(head, file_kind_head) &&
         detail::splat_format(head, file->size(), path.string()).has_value();
}

/// Reads a file; one of another kind is not read whole. `sha256`, if any, is set to that of the bytes that were read, 64
/// digits. Memory: the file, its unpacked content and the table.
template <class Json = nlohmann::json>
[[nodiscard]] Result<SplatFile> read_splat(const std::filesystem::path& path, std::string* sha256 = nullptr) {
  const std::string name = path.string();
  const Result<std::vector<std::byte>> bytes =
      read_file(path, std::uintmax_t{1} << 40, file_kind_head,
                [&](std::span<const std::byte> head, std::uintmax_t size) -> Result<Done> {
                  if (detail::splat_format(head, size, name)) return Done{};
                  return detail::no_splats(head, size, name);
                });
  if (!bytes) return bytes.error();
  if (sha256 != nullptr) *sha256 = Sha256{}.update(*bytes).hex();
  return parse_splat<Json>(*bytes, name);
}

}  // namespace compmark
