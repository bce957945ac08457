// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The HAC codec as files: what encode_hac and decode_hac do with bytes, with a `.cmk` on disk, replaced whole or not at all.
#pragma once

#include <cstddef>
#include <filesystem>
#include <utility>
#include <vector>

#include "compmark/codec/hac_decoder.hpp"
#include "compmark/codec/hac_encoder.hpp"
#include "compmark/io/atomic_file.hpp"

namespace compmark::inline v0 {

template <Executor E>
[[nodiscard]] Result<CodecEncoded> write_hac(const std::filesystem::path& path, const CodecModel& model,
                                             const CodecEncodeSettings& settings, E& executor) {
  Result<CodecEncoded> encoded = encode_hac(model, settings, executor);
  if (!encoded) return encoded.error();
  const Result<Done> written = write_file(path, encoded->bytes);
  if (!written) return written.error();
  return encoded;
}

template <Executor E>
[[nodiscard]] Result<CodecDecoded> read_hac(const std::filesystem::path& path, const CodecDecodeSettings& settings,
                                            E& executor) {
  const Result<std::vector<std::byte>> bytes = read_file(path, settings.memory_limit);
  if (!bytes) return bytes.error();
  return decode_hac(*bytes, path.string(), settings, executor);
}

}  // namespace compmark::inline v0
