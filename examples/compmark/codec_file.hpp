// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The codecs, compiled once for all commands: codec/cmk.hpp on this tool's executor.
#pragma once

#include <compmark/codec/decoding.hpp>
#include <compmark/codec/encoding.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

namespace tool {

/// Encodes in memory. The `model` of the result is the one that a reader of the bytes gets.
compmark::Result<compmark::CodecEncoded> encode_codec(const compmark::CodecModel& model,
                                                      compmark::ThreadExecutor& executor);
compmark::Result<compmark::CodecEncoded> write_codec_file(const std::filesystem::path& path,
                                                          const compmark::CodecModel& model,
                                                          compmark::ThreadExecutor& executor);
compmark::Result<compmark::CodecDecoded> read_codec_file(const std::filesystem::path& path,
                                                         const compmark::CodecDecodeSettings& settings,
                                                         compmark::ThreadExecutor& executor);
/// `name` is for messages.
compmark::Result<compmark::CodecDecoded> decode_codec_file(std::span<const std::byte> bytes, const std::string& name,
                                                           compmark::ThreadExecutor& executor);

/// The name of a codec, as recipes begin with it.
const char* codec_file_name(compmark::ContainerProfile profile);

}  // namespace tool
