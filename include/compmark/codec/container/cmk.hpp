// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any `.cmk` file, as bytes or on disk, replaced whole or not at all. When writing, the codec is the one that the model
// was trained for; when reading, the one that the file's header names, of a list of codecs (codecs.hpp) that a program
// may lengthen: encode_cmk<ShippedCodecs::With<MyCodec>>(…). A program that knows its codec includes only that codec's
// encoder or decoder.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/container/codecs.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/file_kind.hpp"
#include "compmark/io/sha256.hpp"

namespace compmark {

/// The name of a codec, as recipes begin with it.
template <class Codecs = ShippedCodecs>
[[nodiscard]] const char* codec_name(ContainerProfile profile) {
  return Codecs::of_profile(profile, []<class C>() { return C::name; });
}

template <class Codecs = ShippedCodecs, Executor E>
[[nodiscard]] Result<CodecEncoded> encode_cmk(const CodecModel& model, const CodecEncodeSettings& settings,
                                              E& executor) {
  return Codecs::of_model(model, [&]<class C>() { return C::encode(model, settings, executor); });
}
/// `path` is for messages.
template <class Codecs = ShippedCodecs, Executor E>
[[nodiscard]] Result<CodecDecoded> decode_cmk(std::span<const std::byte> bytes, const std::string& path,
                                              const CodecDecodeSettings& settings, E& executor) {
  const Result<Container> parsed = parse_container(bytes, path, settings.partial);
  if (!parsed) return parsed.error();
  return Codecs::of_profile(parsed->header.profile,
                            [&]<class C>() { return C::decode(bytes, path, settings, executor); });
}
template <class Codecs = ShippedCodecs, Executor E>
[[nodiscard]] Result<CodecEncoded> write_cmk(const std::filesystem::path& path, const CodecModel& model,
                                             const CodecEncodeSettings& settings, E& executor) {
  Result<CodecEncoded> encoded = encode_cmk<Codecs>(model, settings, executor);
  if (!encoded) return encoded.error();
  const Result<Done> written = write_file(path, encoded->bytes);
  if (!written) return written.error();
  return encoded;
}
/// `sha256`, if any, is set to that of the bytes that were read, 64 digits.
template <class Codecs = ShippedCodecs, Executor E>
[[nodiscard]] Result<CodecDecoded> read_cmk(const std::filesystem::path& path, const CodecDecodeSettings& settings,
                                            E& executor, std::string* sha256 = nullptr) {
  // A nearly right magic may come from a copy in text mode: the parser reports that.
  const auto fits = [](FileKind kind, std::span<const std::byte> head) {
    return kind == FileKind::cmk || (head.size() > 4 && head[1] == std::byte{'C'} && head[2] == std::byte{'M'});
  };
  const Result<std::vector<std::byte>> bytes =
      read_file_of(path, settings.memory_limit, "a compressed model (.cmk)", fits);
  if (!bytes) return bytes.error();
  if (sha256 != nullptr) *sha256 = Sha256{}.update(*bytes).hex();
  return decode_cmk<Codecs>(*bytes, path.string(), settings, executor);
}

}  // namespace compmark
