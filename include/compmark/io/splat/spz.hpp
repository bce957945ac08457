// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// SPZ files of Niantic, versions 2 to 4 (docs/splat_formats.md). Little-endian. Version 2 and 3: one gzip stream (or
// its content as it is) of a header of 16 bytes and one block a quantity. Version 4: a header of 32 bytes, extension
// records, a table of packed and unpacked sizes, and one Zstandard frame a quantity. The quantities, in their order:
//   positions  3 x 24 bits, signed, in units of 2^-fractional bits
//   alphas     opacity in a byte            colors  127.5 + 255 * 0.15 f_dc in a byte
//   scales     16 (log scale + 10)          harmonics  128 + 128 f in a byte, coefficients outside, channels inside
//   rotations  2: x y z as 127.5 + 127.5 q, w >= 0; 3, 4: 2 bits, the largest of x y z w, then of the others sign and
//              9 bits of |q| sqrt 2
// Places are in the frame right, up, back unless an extension says otherwise: they are turned to that of training.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/io/bytes.hpp"
#include "compmark/io/splat/inflate.hpp"
#include "compmark/io/splat/splat_file.hpp"

namespace compmark {

namespace detail {

inline constexpr std::uint32_t spz_magic = 0x5053474e;  // "NGSP"

struct SpzHeader {
  std::uint32_t magic = 0, version = 0, splats = 0;
  std::uint8_t degree = 0, fractional_bits = 0, flags = 0, streams = 0;
};
[[nodiscard]] inline SpzHeader spz_header(ByteReader& reader) {
  SpzHeader header;
  for (std::uint32_t* value : {&header.magic, &header.version, &header.splats}) *value = reader.get<std::uint32_t>();
  for (std::uint8_t* value : {&header.degree, &header.fractional_bits, &header.flags, &header.streams})
    *value = reader.get<std::uint8_t>();
  return header;
}

class SpzParser {
 public:
  SpzParser(std::span<const std::byte> bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  [[nodiscard]] Result<SplatFile> parse() {
    ByteReader reader(bytes_);
    header_ = spz_header(reader);
    if (reader.failed() || header_.magic != spz_magic)
      return error(ErrorKind::malformed, "header", "does not begin with NGSP", "give an SPZ file");
    if (header_.version < 2 || header_.version > 4) {
      return error(ErrorKind::unsupported, "version", "is " + std::to_string(header_.version) + ", not 2, 3 or 4",
                   "export it again with a newer program, as version 3");
    }
    if (header_.degree > 4 || (header_.degree == 4 && header_.version < 4))
      return error(ErrorKind::unsupported, "degree", "of the harmonics is " + std::to_string(header_.degree));
    if ((header_.flags & 0x80) != 0)
      return error(ErrorKind::unsupported, "flags", "say that it holds a tree of levels of detail",
                   "export it without levels of detail");
    if (header_.fractional_bits > 24)
      return error(ErrorKind::invalid, "fractional bits",
                   "are " + std::to_string(header_.fractional_bits) + " of the 24 that a position has");
    if (header_.splats == 0) return error(ErrorKind::invalid, "points", "are none");
    const std::array<std::uint64_t, streams> bytes_of_splat{
        9, 1, 3, 3, header_.version == 2 ? 3u : 4u, std::uint64_t{3} * (sh_count(header_.degree) - 1)};
    for (std::size_t i = 0; i < streams; ++i) sizes_[i] = header_.splats * bytes_of_splat[i];
    if (const Result<Done> found = header_.version == 4 ? frames(reader) : blocks(reader); !found) return found.error();

    SplatFile file;
    file.format = SplatFormat::spz;
    file.version = static_cast<int>(header_.version);
    file.antialiased = (header_.flags & 1) != 0;
    if (header_.degree == 4) file.notes.emplace_back("its harmonics of degree 4 are left out: models have 3 degrees");
    decode(file.table);
    change_axes(file.table, signs_);
    if (const Result<Done> usable = finish_splats(file.table, name_); !usable) return usable.error();
    return file;
  }

 private:
  static constexpr std::size_t streams = 6;
  enum Stream : std::size_t { positions, alphas, colors, scales, rotations, harmonics };

  [[nodiscard]] Error error(ErrorKind kind, std::string field, std::string problem,
                            std::string remedy = "copy or export it again") const {
    return splat_error(kind, name_, std::move(field), std::move(problem), std::move(remedy));
  }

  /// Versions 2 and 3: the blocks follow the header.
  [[nodiscard]] Result<Done> blocks(ByteReader& reader) {
    std::uint64_t whole = 0;
    for (const std::uint64_t size : sizes_) whole += size;
    if (whole > reader.left()) {
      return error(ErrorKind::truncated, "points",
                   "are " + std::to_string(header_.splats) + ", which take " + std::to_string(whole) + " bytes, and " +
                       std::to_string(reader.left()) + " follow");
    }
    for (std::size_t i = 0; i < streams; ++i) data_[i] = reader.take(sizes_[i]);
    if ((header_.flags & 2) != 0) return extensions(reader.take(reader.left()));
    if (reader.left() != 0)
      return error(ErrorKind::malformed, "end", "has " + std::to_string(reader.left()) + " bytes behind the splats");
    return Done{};
  }

  /// Version 4: a table of frames. An empty quantity has none.
  [[nodiscard]] Result<Done> frames(ByteReader& reader) {
    const std::size_t table = reader.get<std::uint32_t>();
    constexpr std::size_t header = 32, entry = 16;
    const std::size_t count = header_.degree == 0 ? streams - 1 : streams;
    if (header_.streams != count) {
      return error(ErrorKind::malformed, "streams",
                   "are " + std::to_string(header_.streams) + ", expected " + std::to_string(count));
    }
    if (bytes_.size() < header || table < header || table > bytes_.size() || bytes_.size() - table < count * entry)
      return error(ErrorKind::truncated, "table of streams", "lies outside of the file");
    if ((header_.flags & 2) != 0) {
      if (const Result<Done> known = extensions(bytes_.subspan(header, table - header)); !known) return known.error();
    }
    ByteReader rows(bytes_.subspan(table));
    std::array<std::uint64_t, streams> packed{};
    std::uint64_t all_packed = 0, all = 0;
    for (std::size_t i = 0; i < count; ++i) {
      packed[i] = rows.get<std::uint64_t>();
      if (rows.get<std::uint64_t>() != sizes_[i])
        return error(ErrorKind::malformed, "stream " + std::to_string(i), "has not the size of the points");
      if (packed[i] > bytes_.size())
        return error(ErrorKind::truncated, "stream " + std::to_string(i), "is longer than the file");
      all_packed += packed[i];
      all += sizes_[i];
    }
    if (all_packed != bytes_.size() - table - count * entry)
      return error(ErrorKind::truncated, "streams", "do not end where the file does");
    if (all > most_unpacked_of_byte * all_packed)
      return error(
          ErrorKind::exhausted, "points",
          "are " + std::to_string(header_.splats) + ", more than " + std::to_string(all_packed) + " bytes can hold");
    for (std::size_t i = 0; i < count; ++i) {
      Result<std::vector<std::byte>> stream =
          unzstd(rows.take(packed[i]), static_cast<std::size_t>(sizes_[i]), name_, "stream " + std::to_string(i));
      if (!stream) return stream.error();
      unpacked_[i] = std::move(*stream);
      data_[i] = unpacked_[i];
    }
    return Done{};
  }

  /// Records of a type, a length and as many bytes. Those that change what the numbers mean are followed or refused.
  [[nodiscard]] Result<Done> extensions(std::span<const std::byte> bytes) {
    ByteReader reader(bytes);
    while (reader.left() > 0) {
      const std::uint32_t type = reader.get<std::uint32_t>();
      const std::span<const std::byte> content = reader.take(reader.get<std::uint32_t>());
      if (reader.failed()) return error(ErrorKind::truncated, "extensions", "end within a record");
      if (type == 0xadbe0001 && header_.degree > 0)
        return error(ErrorKind::unsupported, "extension 0xADBE0001", "scales the harmonics in a way of its own",
                     "export it without that extension");
      if (type != 0xadbe0003) continue;
      const std::uint32_t frame = ByteReader(content).get<std::uint32_t>();
      if (content.size() != 4 || frame > 8)
        return error(ErrorKind::unsupported, "extension 0xADBE0003", "names no frame that is known");
      if (frame == 0) continue;
      // 1 … 8 are LDB RDB LUB RUB LDF RDF LUF RUF; training's is RDF.
      const std::uint32_t bits = frame - 1;
      signs_ = {(bits & 1) != 0 ? 1 : -1, (bits & 2) != 0 ? -1 : 1, (bits & 4) != 0 ? 1 : -1};
    }
    return Done{};
  }

  [[nodiscard]] std::uint32_t byte(Stream stream, std::size_t i) const {
    return std::to_integer<std::uint32_t>(data_[stream][i]);
  }

  [[nodiscard]] std::array<double, 4> rotation(std::size_t row) const {  // x y z w
    if (header_.version == 2) {
      std::array<double, 3> xyz{};
      for (std::size_t k = 0; k < 3; ++k) xyz[k] = static_cast<double>(byte(rotations, 3 * row + k)) / 127.5 - 1;
      return with_largest(3, xyz);
    }
    std::uint32_t word = 0;
    for (std::size_t k = 4; k-- > 0;) word = word << 8 | byte(rotations, 4 * row + k);
    std::array<double, 3> others{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t field = word >> (20 - 10 * k) & 1023;
      const double magnitude = static_cast<double>(field & 511) / 511 * std::sqrt(0.5);
      others[k] = (field & 512) != 0 ? -magnitude : magnitude;
    }
    return with_largest(word >> 30, others);
  }

  void decode(SplatTable& table) const {
    table.resize(header_.splats, std::min<int>(header_.degree, max_sh_degree));
    const std::size_t stored = 3 * (sh_count(header_.degree) - 1);
    const double unit = std::ldexp(1.0, -static_cast<int>(header_.fractional_bits));
    const std::array<float, 256> logit = byte_logits();
    for (std::size_t row = 0; row < table.count; ++row) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t at = 3 * row + axis;
        std::int32_t fixed = static_cast<std::int32_t>(byte(positions, 3 * at) | byte(positions, 3 * at + 1) << 8 |
                                                       byte(positions, 3 * at + 2) << 16);
        if (fixed >= 1 << 23) fixed -= 1 << 24;
        table.mean[axis][row] = static_cast<float>(fixed * unit);
        table.log_scale[axis][row] = static_cast<float>(byte(scales, at)) / 16 - 10;
        table.color(axis, 0)[row] = static_cast<float>((static_cast<double>(byte(colors, at)) / 255 - 0.5) / 0.15);
        for (std::size_t k = 1; k < table.coefficients(); ++k) {
          const std::uint32_t value = byte(harmonics, stored * row + 3 * (k - 1) + axis);
          table.color(axis, k)[row] = (static_cast<float>(value) - 128) / 128;
        }
      }
      table.opacity[row] = logit[byte(alphas, row)];
      const std::array<double, 4> q = rotation(row);
      for (std::size_t k = 0; k < 4; ++k) table.rotation[k][row] = static_cast<float>(q[(k + 3) % 4]);
    }
  }

  std::span<const std::byte> bytes_;
  std::string name_;
  SpzHeader header_;
  AxisSigns signs_{1, -1, -1};  ///< of right, up, back
  std::array<std::uint64_t, streams> sizes_{};
  std::array<std::span<const std::byte>, streams> data_;
  std::array<std::vector<std::byte>, streams> unpacked_;
};

}  // namespace detail

/// Reads a whole file, packed or not; `name` is for the messages. Every size is checked against the bytes before memory
/// is taken. Cost: unpacking and a pass over the values.
[[nodiscard]] inline Result<SplatFile> parse_spz(std::span<const std::byte> bytes, const std::string& name) {
  if (detail::gzip_body(bytes) == 0) return detail::SpzParser(bytes, name).parse();
  const Result<std::vector<std::byte>> unpacked = detail::gunzip(bytes, name);
  if (!unpacked) return unpacked.error();
  return detail::SpzParser(*unpacked, name).parse();
}

}  // namespace compmark
