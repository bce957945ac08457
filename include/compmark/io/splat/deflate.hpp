// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Compression for the writers of splat files, the other side of inflate.hpp: gzip (RFC 1952) by stb_image_write's
// deflate, Zstandard by libzstd where the program was built with it (COMPMARK_WITH_ZSTD). The bytes depend on the
// content alone: a gzip file has no name and no time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/bytes.hpp"
#include "compmark/io/detail/stb.hpp"
#include "compmark/io/splat/inflate.hpp"
#include "compmark/io/splat/splat_file.hpp"
#include "compmark/io/zip.hpp"

namespace compmark {

namespace detail {

/// A gzip file of one member; `name` is for the message. Error: more than 2 GiB, which stb does not count.
[[nodiscard]] inline Result<std::vector<std::byte>> gzipped(std::span<const std::byte> content,
                                                            const std::string& name) {
  constexpr std::size_t most = std::numeric_limits<int>::max() / 2;
  struct Free {
    void operator()(unsigned char* bytes) const { std::free(bytes); }
  };
  int size = 0;
  std::unique_ptr<unsigned char, Free> zlib;
  if (content.size() <= most) {
    std::vector<unsigned char> input(content.size() + 1);  // stb takes no const pointer, and no null one
    for (std::size_t i = 0; i < content.size(); ++i) input[i] = std::to_integer<unsigned char>(content[i]);
    zlib.reset(stb::stbi_zlib_compress(input.data(), static_cast<int>(content.size()), &size, 8));
  }
  constexpr int frame = 6;  // the two bytes and the checksum of zlib's own frame, which gzip has not
  if (!zlib || size < frame) {
    return splat_error(ErrorKind::exhausted, name, "gzip",
                       "cannot hold " + std::to_string(content.size()) + " bytes of splats",
                       "build the program with libzstd and write SPZ version 4, or export a PLY");
  }
  ByteWriter out;
  // Deflate, no flags, no time, no level, no system.
  out.put(std::uint32_t{0x00088b1f}).put(std::uint32_t{0}).put(std::uint16_t{0xff00});
  out.put(std::as_bytes(std::span<const unsigned char>(zlib.get() + 2, static_cast<std::size_t>(size - frame))));
  out.put(zip_checksum(content)).put(static_cast<std::uint32_t>(content.size()));
  return out.take();
}

/// One Zstandard frame; `name` is for the message.
[[nodiscard]] inline Result<std::vector<std::byte>> zstandard([[maybe_unused]] std::span<const std::byte> content,
                                                              const std::string& name) {
#if defined(COMPMARK_WITH_ZSTD)
  constexpr int level = 12;
  std::vector<std::byte> packed(ZSTD_compressBound(content.size()));
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), content.data(), content.size(), level);
  if (ZSTD_isError(size) == 0) {
    packed.resize(size);
    return packed;
  }
  return splat_error(ErrorKind::exhausted, name, "Zstandard", "has no memory to pack the splats", "write version 3");
#else
  return splat_error(ErrorKind::unsupported, name, "version", "is 4, which this program does not write",
                     "build it with libzstd (Debian, Ubuntu: libzstd-dev), or write version 3");
#endif
}

}  // namespace detail

}  // namespace compmark
