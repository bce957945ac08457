// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "input_files.hpp"

#include <algorithm>
#include <compmark/io/file_identity.hpp>
#include <compmark/io/file_kind.hpp>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <system_error>
#include <vector>

#include "decoder_choice.hpp"

namespace tool {
namespace {

using namespace compmark;

struct Taken {
  const char* name;             ///< what the option takes
  std::vector<FileKind> kinds;  ///< that are taken, or that their reader says more about
};
Taken taken_by(InputKind kind) {
  using K = FileKind;
  switch (kind) {
    case InputKind::model:
      return {"a model or splats",
              {K::model, K::cmk, K::safetensors, K::ply, K::splat, K::spz, K::gzip, K::sog, K::glb}};
    case InputKind::trained_model:
      return {"a model of a training", {K::model, K::cmk, K::safetensors}};
    case InputKind::markable:
      return {"a model of a training, or splats",
              {K::model, K::cmk, K::safetensors, K::ply, K::splat, K::spz, K::gzip, K::sog, K::glb}};
    case InputKind::compressed:
      return {"a compressed model (.cmk)", {K::cmk}};
    case InputKind::decoder:
      return {"a message decoder", {K::decoder, K::safetensors}};
    case InputKind::interference:
      return {"the cover interference of a scene", {K::interference, K::safetensors}};
    case InputKind::key:
      return {"an owner's key", {K::owner_key, K::json}};
    case InputKind::claim:
      return {"an owner's claim", {K::text}};
    case InputKind::time_stamp:
      return {"a time stamp (RFC 3161)", {}};
    case InputKind::images:
      return {"an image (PNG, JPEG), or a folder of them", {K::png, K::jpeg, K::folder}};
    case InputKind::dataset:
      return {"the folder of a capture, or splats",
              {K::folder, K::capture, K::json, K::ply, K::splat, K::spz, K::gzip, K::sog, K::glb}};
    case InputKind::splats:
      return {"a splat file", {K::ply, K::splat, K::spz, K::gzip, K::sog, K::glb}};
    case InputKind::weights:
      return {"LPIPS weights", {K::lpips, K::safetensors}};
    case InputKind::other:
      break;
  }
  return {"", {}};
}

/// The ending of a name that says another kind of file than a model; empty: it says none.
std::string ending_of_another_kind(const std::filesystem::path& path) {
  const std::string ending = detail::lower(path.extension().string());
  for (const char* other : {".ply", ".splat", ".ksplat", ".spz", ".sog", ".glb", ".html", ".cmk"}) {
    if (ending == other) return ending;
  }
  return {};
}

}  // namespace

Result<Done> check_input_kinds(const FileUse& use) {
  for (const UsedFile& read : use.reads) {
    if (read.kind == InputKind::other) continue;
    const FileKind kind = identify_file(read.path);
    const Taken taken = taken_by(read.kind);
    if (!tells_kind(kind) || kind == FileKind::stream) continue;
    if (std::find(taken.kinds.begin(), taken.kinds.end(), kind) != taken.kinds.end()) continue;
    Error error = wrong_kind(kind, read.path.string(), taken.name);
    error.field = read.said;
    return error;
  }
  // Of captures and images the readers say more.
  for (const UsedFile& read : use.reads) {
    if (read.kind == InputKind::other || read.kind == InputKind::images || read.kind == InputKind::dataset) continue;
    std::error_code status;
    if (std::filesystem::status(read.path, status).type() == std::filesystem::file_type::not_found) {
      const bool fit = read.kind == InputKind::decoder && read.path == fitted_decoder_word;  // a word of other commands
      return Error{ErrorKind::not_found, read.path.string(), read.said, "no such file",
                   fit ? "name the file, RUN/decoder.safetensors: this command reads a decoder that is there"
                       : "check the path"};
    }
    if (identify_file(read.path) == FileKind::empty)
      return Error{ErrorKind::truncated, read.path.string(), read.said, "is empty", "copy it again"};
  }
  return Done{};
}

Result<Done> check_output_kinds(const FileUse& use) {
  using K = FileKind;
  for (const UsedFile& output : use.writes) {
    const FileKind there = identify_file(output.path);
    const auto replaces = [&](std::initializer_list<FileKind> own) {
      static const std::vector<FileKind> of_nobody{K::unknown, K::unreadable, K::stream, K::empty,  K::text,
                                                   K::html,    K::csv,        K::json,   K::report, K::log};
      return std::find(of_nobody.begin(), of_nobody.end(), there) != of_nobody.end() ||
             std::find(own.begin(), own.end(), there) != own.end();
    };
    bool right = there != K::owner_key;
    if (output.written == OutputKind::key) right = true;  // keygen never replaces one, and says so
    if (output.written == OutputKind::words) right = replaces({});
    if (output.written == OutputKind::splats) right = replaces({K::ply, K::splat, K::spz, K::gzip, K::sog, K::glb});
    if (output.written == OutputKind::model) right = replaces({K::model});
    if (output.written == OutputKind::compressed) right = replaces({K::cmk});
    if (output.written == OutputKind::decoder) right = replaces({K::decoder});
    if (output.written == OutputKind::interference) right = replaces({K::interference});
    if (right && output.written == OutputKind::model) {
      const std::string ending = ending_of_another_kind(output.path);
      if (ending.empty()) continue;
      return Error{ErrorKind::invalid, output.path.string(), output.said,
                   "ends in " + ending + ", but this command writes a model", "end it in .safetensors, and export it"};
    }
    if (right) continue;
    return Error{
        ErrorKind::unwritable, output.path.string(), output.said,
        "is " + std::string(file_kind_name(there)) + ", and this command would replace it by a file of another kind",
        there == K::owner_key ? "choose another name: a key cannot be made again"
                              : "choose another name, or remove it first"};
  }
  return Done{};
}

}  // namespace tool
