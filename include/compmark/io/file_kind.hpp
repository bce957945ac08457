// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recognises the kind of a file by its first bytes, so that an error can name the kind of a wrong file and the command
// that takes it. The name of a file matters only where formats share their beginning (an .spz is a gzip file) or have
// none (.splat). Nothing is decoded, so a damaged file still has its kind. Cost: one read of at most 64 KiB.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/detail/file_kind_names.hpp"
#include "compmark/io/read_file.hpp"
#include "compmark/io/utf8.hpp"

namespace compmark {

/// As many first bytes of a file are looked at.
inline constexpr std::size_t file_kind_head = std::size_t{1} << 16;

namespace detail {

struct FileMagic {
  FileKind kind;
  std::string_view bytes;
  std::size_t offset = 0;
};
using std::string_view_literals::operator""sv;  // "\0" counts
inline constexpr std::array<FileMagic, 37> file_magics{{
    {FileKind::cmk,
     "\x89"
     "CMK"sv},
    {FileKind::png, "\x89PNG"sv},
    {FileKind::jpeg, "\xFF\xD8\xFF"sv},
    {FileKind::gif, "GIF8"sv},
    {FileKind::webp, "WEBP"sv, 8},
    {FileKind::tiff, "MM\0*"sv},
    {FileKind::tiff, "II*\0"sv},
    {FileKind::tiff, "MM\0+"sv},
    {FileKind::tiff, "II+\0"sv},
    {FileKind::bmp, "\0\0\0\0"sv, 6},
    {FileKind::exr, "\x76\x2f\x31\x01"sv},
    {FileKind::heif, "ftyphei"sv, 4},
    {FileKind::heif, "ftypmif1"sv, 4},
    {FileKind::heif, "ftypavif"sv, 4},
    {FileKind::video, "ftyp"sv, 4},
    {FileKind::video, "\x1a\x45\xdf\xa3"sv},
    {FileKind::video, "AVI "sv, 8},
    {FileKind::pdf, "%PDF-"sv},
    {FileKind::program, "MZ\x90\0"sv},
    {FileKind::zip, "PK\3\4"sv},
    {FileKind::zip, "PK\5\6"sv},
    {FileKind::gzip, "\x1f\x8b"sv},
    {FileKind::spz, "NGSP"sv},
    {FileKind::glb, "glTF"sv},
    {FileKind::zstd, "\x28\xb5\x2f\xfd"sv},
    {FileKind::hdf5, "\x89HDF\r\n"sv},
    {FileKind::npy, "\x93NUMPY"sv},
    {FileKind::program,
     "\x7f"
     "ELF"sv},
    {FileKind::program, "\xcf\xfa\xed\xfe"sv},
    {FileKind::pickle, "\x80\x02}"sv},
    {FileKind::pickle, "\x80\x02\x8a"sv},
    {FileKind::pickle, "\x80\x03}"sv},
    {FileKind::pickle, "\x80\x04\x95"sv},
    {FileKind::ply, "ply\n"sv},
    {FileKind::ply, "ply\r"sv},
    {FileKind::ply, "\xEF\xBB\xBFply\n"sv},
    {FileKind::ply, "\xEF\xBB\xBFply\r"sv},
}};

/// The text of a JSON field: of `"key" : "value"` in the first bytes of a file the value, also where a quote within a
/// text is escaped.
[[nodiscard]] inline std::string_view json_text_at(std::string_view json, std::string_view key) {
  constexpr std::string_view space = " \t\r\n";
  for (std::size_t at = json.find(key); at != std::string_view::npos; at = json.find(key, at + 1)) {
    const std::size_t end = at + key.size();
    if (at == 0 || json[at - 1] != '"' || (at > 1 && json[at - 2] == '\\') || end >= json.size() || json[end] != '"')
      continue;
    std::size_t colon = json.find_first_not_of(space, end + 1);
    if (colon == std::string_view::npos || json[colon] != ':') continue;
    const std::size_t quote = json.find_first_not_of(space, colon + 1);
    if (quote == std::string_view::npos || json[quote] != '"') return json.substr(colon + 1, 0);  // there, and no text
    return json.substr(quote + 1, json.find('"', quote + 1) - quote - 1);
  }
  return {};
}
[[nodiscard]] inline bool json_names(std::string_view json, std::string_view key) {
  return json_text_at(json, key).data() != nullptr;
}

/// True for an archive whose first entry is called as one of a SOG file.
[[nodiscard]] inline bool begins_as_sog(std::string_view archive) {
  const std::string_view name = archive.substr(std::min<std::size_t>(30, archive.size()));
  for (const std::string_view known : {"meta.json"sv, "means_l."sv, "means_u."sv, "quats."sv, "scales."sv, "sh0."sv}) {
    if (name.starts_with(known)) return true;
  }
  return false;
}

[[nodiscard]] inline FileKind kind_of_format(std::string_view format) {
  if (format == "compmark.model") return FileKind::model;
  if (format == "compmark decoder") return FileKind::decoder;
  if (format == "compmark.checkpoint") return FileKind::checkpoint;
  if (format == "compmark decoder training") return FileKind::decoder_training;
  if (format == "compmark cover interference") return FileKind::interference;
  return FileKind::safetensors;
}
[[nodiscard]] inline FileKind safetensors_kind(std::string_view header) {
  const FileKind kind = kind_of_format(json_text_at(header, "format"));
  return kind == FileKind::safetensors && json_names(header, "lin0.weight") ? FileKind::lpips : kind;
}

[[nodiscard]] inline FileKind json_kind(std::string_view json) {
  if (json_text_at(json, "format") == "compmark-key") return FileKind::owner_key;
  for (const char* key : {"frames", "transform_matrix", "camera_angle_x", "fl_x"}) {
    if (json_names(json, key)) return FileKind::capture;
  }
  if (json_text_at(json, "schema").starts_with("compmark.")) return FileKind::report;
  if (json_names(json, "schema") && (json_names(json, "recipe") || json_names(json, "decoder")))
    return FileKind::report;
  if (json_names(json, "iteration") && json_names(json, "total")) return FileKind::log;
  return FileKind::json;
}

/// The kind of a text, or unknown for bytes that are no text (other control characters than those of lines).
[[nodiscard]] inline FileKind text_kind(std::string_view text) {
  const bool utf16 = text.starts_with("\xFF\xFE"sv) || text.starts_with("\xFE\xFF"sv);
  if (utf16) return FileKind::text;
  if (text.starts_with("\xEF\xBB\xBF"sv)) text.remove_prefix(3);
  std::size_t foreign = 0;
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code == 0x7F || (code < 0x20 && c != '\n' && c != '\r' && c != '\t' && c != '\f')) return FileKind::unknown;
    foreign += code >= 0x80 ? 1 : 0;
  }
  // UTF-8, or letters of another encoding here and there.
  if (4 * foreign > text.size() && !is_utf8(text.substr(0, text.find_last_of("\n ") + 1)) && !is_utf8(text))
    return FileKind::unknown;
  const std::size_t begin = text.find_first_not_of(" \t\r\n");
  if (begin == std::string_view::npos) return FileKind::text;
  text.remove_prefix(begin);
  if (text[0] == '{' || text[0] == '[') {
    const std::size_t next = text.find_first_not_of(" \t\r\n", 1);
    const char follows = next == std::string_view::npos ? '"' : text[next];
    const bool object = text[0] == '{' && (follows == '"' || follows == '}');
    const bool array =
        text[0] == '[' && std::string_view("[]{\"-0123456789tfn").find(follows) != std::string_view::npos;
    return object || array ? json_kind(text) : FileKind::text;
  }
  return text.starts_with("<!doctype"sv) || text.starts_with("<!DOCTYPE"sv) || text.starts_with("<html"sv)
             ? FileKind::html
             : FileKind::text;
}

/// True for the binary cameras or images of a COLMAP model: counts, identifiers and sizes, or rotations, that make
/// sense.
[[nodiscard]] inline bool begins_as_colmap(std::span<const std::byte> head, std::uintmax_t size) {
  const auto number = [&](std::size_t at, auto value) {
    std::memcpy(&value, head.data() + at, sizeof(value));
    return value;
  };
  if (head.size() < 72) return false;
  const std::uint64_t count = number(0, std::uint64_t{});
  if (count == 0 || count > size / 40) return false;
  const std::uint64_t width = number(16, std::uint64_t{}), height = number(24, std::uint64_t{});
  constexpr std::uint64_t side_limit = 1 << 17;
  constexpr std::uint32_t models = 32, identifiers = 1u << 31;
  if (number(8, std::uint32_t{}) < identifiers && number(12, std::uint32_t{}) < models && width > 0 && height > 0 &&
      width < side_limit && height < side_limit) {
    return true;  // cameras.bin
  }
  double norm = 0;
  for (std::size_t i = 0; i < 4; ++i) norm += std::pow(number(12 + 8 * i, 0.0), 2);
  return std::abs(norm - 1) < 1e-3;  // images.bin
}

}  // namespace detail

/// The kind of a file that begins with `head` (file_kind_head bytes, or all of a smaller file) and has `size` bytes.
[[nodiscard]] inline FileKind identify_bytes(std::span<const std::byte> head, std::uintmax_t size) {
  if (size == 0) return FileKind::empty;
  head = head.first(std::min(head.size(), file_kind_head));
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  if (text.size() > 8) {
    std::uint64_t header = 0;
    std::memcpy(&header, text.data(), 8);
    if (header >= 2 && header <= 100'000'000 && text[8] == '{') return detail::safetensors_kind(text.substr(8));
  }
  for (const detail::FileMagic& magic : detail::file_magics) {
    if (text.substr(std::min(magic.offset, text.size()), magic.bytes.size()) != magic.bytes) continue;
    if (magic.kind == FileKind::bmp && !text.starts_with("BM")) continue;
    if ((magic.bytes == "WEBP" || magic.bytes == "AVI ") && !text.starts_with("RIFF")) continue;
    if (magic.bytes == "PK\3\4" &&
        text.substr(std::min<std::size_t>(30, text.size()), 64).find(".npy") != std::string_view::npos)
      return FileKind::npz;
    if (magic.bytes == "PK\3\4" && detail::begins_as_sog(text)) return FileKind::sog;
    return magic.kind;
  }
  if (const FileKind kind = detail::text_kind(text); kind != FileKind::unknown) return kind;
  return detail::begins_as_colmap(head, size) ? FileKind::colmap : FileKind::unknown;
}

/// The kind of a file by its path. Nothing that is no regular file is opened.
[[nodiscard]] inline FileKind identify_file(const std::filesystem::path& path) {
  std::error_code status;
  const std::filesystem::file_type type = std::filesystem::status(path, status).type();
  if (type == std::filesystem::file_type::directory) return FileKind::folder;
  if (type == std::filesystem::file_type::none || type == std::filesystem::file_type::not_found)
    return FileKind::unreadable;
  if (type != std::filesystem::file_type::regular) return FileKind::stream;
  Result<InputFile> file = InputFile::open(path);
  std::vector<std::byte> head;
  if (!file || !file->append(head, file_kind_head)) return FileKind::unreadable;
  const FileKind kind = identify_bytes(head, file->size());
  std::string ending = path.extension().string();
  for (char& c : ending) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (kind == FileKind::gzip && ending == ".spz") return FileKind::spz;
  if (kind == FileKind::zip && ending == ".sog") return FileKind::sog;
  if (kind == FileKind::unknown && (ending == ".splat" || ending == ".ksplat")) return FileKind::splat;
  if (kind == FileKind::text && ending == ".csv") return FileKind::csv;
  return kind;
}

[[nodiscard]] inline bool is_safetensors(FileKind kind) {
  return kind >= FileKind::safetensors && kind <= FileKind::lpips;
}
/// JSON of any kind, or a text that may be meant for it.
[[nodiscard]] inline bool is_json(FileKind kind) {
  return kind == FileKind::text || (kind >= FileKind::json && kind <= FileKind::owner_key);
}

/// "is a PLY file, not a model": the error of a reader of `expected` ("a model (safetensors)") that met a file of
/// another kind.
[[nodiscard]] inline Error wrong_kind(FileKind kind, std::string file, std::string_view expected) {
  const std::string_view use = file_kind_use(kind);
  return {ErrorKind::malformed, std::move(file), "",
          "is " + std::string(file_kind_name(kind)) + ", not " + std::string(expected),
          use.empty() ? "give " + std::string(expected) : std::string(use)};
}
/// The kind of an open tensor file: by what it says of itself, not by how it begins.
template <class TensorFile>
[[nodiscard]] FileKind tensors_kind(const TensorFile& file) {
  const auto format = file.metadata.find("format");
  const FileKind kind = format == file.metadata.end() ? FileKind::safetensors : detail::kind_of_format(format->second);
  return kind == FileKind::safetensors && file.has("lin0.weight") ? FileKind::lpips : kind;
}

/// Checks that an open tensor file has the kind that its reader expects, or no kind; else the error names its kind.
template <class TensorFile>
[[nodiscard]] Result<Done> expect_kind(const TensorFile& file, FileKind expected) {
  const FileKind kind = tensors_kind(file);
  if (kind == expected || kind == FileKind::safetensors) return Done{};
  Error error = wrong_kind(kind, file.path, file_kind_name(expected));
  error.field = "__metadata__.format";
  return error;
}

/// True for kinds that say what a file is; a reader's own message is better for the others.
[[nodiscard]] inline bool tells_kind(FileKind kind) {
  return kind != FileKind::unknown && kind != FileKind::unreadable && kind != FileKind::empty;
}

/// Reads one whole file of at most `limit` bytes whose beginning is right: `fits(kind, head)` judges by the kind and
/// the first bytes. Another kind is an Error that names it, and is not read whole; a small file that tells no kind is
/// left for its parser to refuse.
template <class Fits>
[[nodiscard]] Result<std::vector<std::byte>> read_file_of(const std::filesystem::path& path, std::uintmax_t limit,
                                                          std::string_view expected, const Fits& fits) {
  return read_file(path, limit, file_kind_head, [&](std::span<const std::byte> head, std::uintmax_t size) {
    const FileKind kind = identify_bytes(head, size);
    if (fits(kind, head) || (!tells_kind(kind) && size <= file_kind_head)) return Result<Done>(Done{});
    return Result<Done>(wrong_kind(kind, path.string(), expected));
  });
}

}  // namespace compmark
