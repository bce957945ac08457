// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as a file of any kind: it is named the same way twice, from memory and from disk, and no reader takes what
// is named as another's.
#include <compmark/io/file_kind.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/npy.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/ply.hpp>
#include <compmark/io/safetensors.hpp>

#include "any_tensors.hpp"

using namespace compmark;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path = testing::fuzz_folder() / "file";
  const auto bytes = std::as_bytes(std::span<const std::uint8_t>(data, size));
  const FileKind kind = identify_bytes(bytes, bytes.size());
  if (file_kind_name(kind).empty() || (size == 0) != (kind == FileKind::empty)) std::abort();
  // As the beginning of a larger file: whatever it is, an answer.
  static_cast<void>(identify_bytes(bytes, bytes.size() + (std::uintmax_t{1} << 40)));
  testing::put_bytes(path, bytes);
  if (identify_file(path) != kind) std::abort();

  const auto judge = [&](const auto& read, bool fits) {
    if (!read) testing::require_words(read.error());
    if (read.ok() && !fits && tells_kind(kind)) std::abort();
  };
  judge(read_safetensors(path), is_safetensors(kind));
  judge(read_safetensors(path, FileKind::model), is_safetensors(kind));
  judge(read_json(path), is_json(kind));
  judge(read_key(path), is_json(kind));
  judge(read_ply(path), kind == FileKind::ply);
  judge(read_npy(path), kind == FileKind::npy);
  judge(read_image_info(path), kind == FileKind::png || kind == FileKind::jpeg);
  return 0;
}
