// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A trained model as one small file, and the way back, damaged files included. The codec is the one that the model was
// trained for, or that the file names. What codec/container/cmk.hpp does on any executor is here compiled once, on
// threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compiled.hpp"
#include "compmark/codec/container/decoding.hpp"
#include "compmark/codec/container/encoding.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"

namespace compmark {

/// In memory; its `model` is what a reader of the bytes has.
[[nodiscard]] Result<CodecEncoded> encode_model(const CodecModel& model, ThreadExecutor& executor);
/// As a .cmk, replaced whole or not at all.
[[nodiscard]] Result<CodecEncoded> write_coded(const std::filesystem::path& out, const CodecModel& model,
                                               ThreadExecutor& executor);
[[nodiscard]] Result<CodecDecoded> read_coded(const std::filesystem::path& path, const CodecDecodeSettings& settings,
                                              ThreadExecutor& executor);
/// `name` is for messages.
[[nodiscard]] Result<CodecDecoded> decode_model(std::span<const std::byte> bytes, const std::string& name,
                                                const CodecDecodeSettings& settings, ThreadExecutor& executor);

/// Compresses a model file into `out`, a .cmk. Error: it is compressed already, its recipe does not train for
/// compression, or its context never began. The file is the same for any number of threads. Cost: the model and its
/// file in memory; about a second for 100,000 anchors.
[[nodiscard]] Result<CodecReport> compress_file(const std::filesystem::path& model, const std::filesystem::path& out,
                                                const CodedModelSettings& settings, ThreadExecutor& executor);

/// What came out of a .cmk: what was missing or lost is there with salvage or partial alone.
struct Decompressed {
  std::size_t anchors = 0;
  CodecDecoded decoded;  ///< without its model
};
/// Writes the model of a .cmk as model.safetensors. Errors are those of read_coded, and a recipe that is none of the
/// shipped ones.
[[nodiscard]] Result<Decompressed> decompress_file(const std::filesystem::path& file, const std::filesystem::path& out,
                                                   const CodecDecodeSettings& settings, ThreadExecutor& executor);

/// Bytes of a file by what they are for, largest first; they add up to the file.
using SectionBytes = std::vector<std::pair<std::string, std::uint64_t>>;
[[nodiscard]] SectionBytes coded_sections(const CodecReport& report);
/// The same of a file that is there. Nothing of it is decoded; its checksums are looked at.
struct CodedFile {
  std::string codec;
  SectionBytes sections;
};
[[nodiscard]] Result<CodedFile> coded_file(const std::filesystem::path& path);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/compress.hpp"
#endif
