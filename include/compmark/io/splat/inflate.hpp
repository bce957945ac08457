// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Decompression of what splat files are packed in: gzip (RFC 1952) by stb_image's inflate, Zstandard by libzstd where
// the program was built with it (COMPMARK_WITH_ZSTD). The unpacked size is known and bounded before memory is taken
// for it, and the output never grows beyond it: a small file cannot ask for much.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/io/bytes.hpp"
#include "compmark/io/detail/stb.hpp"
#include "compmark/io/splat/splat_file.hpp"
#include "compmark/io/zip.hpp"

#if defined(COMPMARK_WITH_ZSTD)
#include <zstd.h>
#endif

namespace compmark {

/// A byte of deflate stands for at most 1032 (a copy of 258 bytes takes two bits); no writer of splats comes near it
/// with Zstandard either.
inline constexpr std::uint64_t most_unpacked_of_byte = 1032;

/// Whether this program reads Zstandard (SPZ version 4).
#if defined(COMPMARK_WITH_ZSTD)
inline constexpr bool reads_zstd = true;
#else
inline constexpr bool reads_zstd = false;
#endif

namespace detail {

/// Where the deflate stream of a gzip member begins; 0 where `bytes` do not begin with a whole header.
[[nodiscard]] inline std::size_t gzip_body(std::span<const std::byte> bytes) {
  ByteReader reader(bytes);
  if (reader.get<std::uint16_t>() != 0x8b1f || reader.get<std::uint8_t>() != 8) return 0;
  const std::uint8_t flags = reader.get<std::uint8_t>();
  static_cast<void>(reader.take(6));  // time, kind of deflate, system
  if ((flags & 4) != 0) static_cast<void>(reader.take(reader.get<std::uint16_t>()));
  for (const int texts : {8, 16}) {  // the name, a comment
    while ((flags & texts) != 0 && !reader.failed() && reader.get<std::uint8_t>() != 0) {
    }
  }
  if ((flags & 2) != 0) static_cast<void>(reader.take(2));
  return reader.failed() || (flags & 0xe0) != 0 ? 0 : reader.position();
}

/// Unpacks the one member that a gzip file has; its checksum and size are compared. Files below 2 GiB on either side.
[[nodiscard]] inline Result<std::vector<std::byte>> gunzip(std::span<const std::byte> bytes, const std::string& name) {
  const auto fail = [&](std::string problem) {
    return splat_error(ErrorKind::malformed, name, "gzip", std::move(problem));
  };
  const std::size_t body = gzip_body(bytes);
  constexpr std::size_t trailer = 8;
  if (body == 0 || bytes.size() < body + trailer) return fail("has no whole header");
  ByteReader end(bytes.last(trailer));
  const std::uint32_t checksum = end.get<std::uint32_t>(), size = end.get<std::uint32_t>();
  // With the trailer: stb reads ahead, and takes the end of its input for one of the stream.
  const std::span<const std::byte> packed = bytes.subspan(body);
  constexpr std::size_t most = std::numeric_limits<int>::max();
  if (size > most_unpacked_of_byte * packed.size() || size > most || packed.size() > most)
    return fail("says that it holds " + std::to_string(size) + " bytes, which it cannot");
  std::vector<std::byte> unpacked(size);
  std::byte none{};
  const int found = stb::stbi_zlib_decode_noheader_buffer(
      reinterpret_cast<char*>(size == 0 ? &none : unpacked.data()), static_cast<int>(size),
      reinterpret_cast<const char*>(packed.data()), static_cast<int>(packed.size()));
  if (found != static_cast<int>(size)) return fail("is damaged: it cannot be unpacked");
  if (zip_checksum(unpacked) != checksum) return fail("is damaged: it has another checksum than its end says");
  return unpacked;
}

/// Unpacks one Zstandard frame of `size` bytes, which the caller has bounded.
[[nodiscard]] inline Result<std::vector<std::byte>> unzstd([[maybe_unused]] std::span<const std::byte> bytes,
                                                           [[maybe_unused]] std::size_t size, const std::string& name,
                                                           const std::string& field) {
#if defined(COMPMARK_WITH_ZSTD)
  std::vector<std::byte> unpacked(size);
  const std::size_t found = ZSTD_decompress(unpacked.data(), unpacked.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(found) != 0 || found != size)
    return splat_error(ErrorKind::malformed, name, field, "is damaged: its Zstandard frame cannot be unpacked");
  return unpacked;
#else
  return splat_error(ErrorKind::unsupported, name, field, "is packed with Zstandard, which this program does not read",
                     "build it with libzstd (Debian, Ubuntu: libzstd-dev), or export the file as SPZ version 3");
#endif
}

}  // namespace detail

}  // namespace compmark
