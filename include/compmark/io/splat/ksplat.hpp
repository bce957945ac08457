// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The .ksplat file of GaussianSplats3D, version 0.1 (docs/splat_formats.md): a header of 4096 bytes, a header of 1024
// bytes for each section, then the sections: lengths of the buckets that are not full (u32), centres of all buckets
// (floats), splats. A splat: centre, scale (lengths), rotation w x y z, r g b a (bytes), harmonics.
//   level   centre                       scale, rotation   harmonics
//   0       floats                       floats            floats
//   1       16 bits within the bucket    halves            halves
//   2       16 bits within the bucket    halves            bytes within the header's range
// Harmonics are stored degree by degree, in each all of red, then green, then blue.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/io/bytes.hpp"
#include "compmark/io/half.hpp"
#include "compmark/io/splat/splat_file.hpp"

namespace compmark {

namespace detail {

inline constexpr std::size_t ksplat_header_bytes = 4096, ksplat_section_bytes = 1024;

struct KsplatHeader {
  std::uint8_t major = 0, minor = 0;
  std::uint32_t most_sections = 0, sections = 0, most_splats = 0, splats = 0;
  std::uint16_t level = 0;
  float least_harmonic = 0, most_harmonic = 0;  ///< of level 2
};
[[nodiscard]] inline KsplatHeader ksplat_header(std::span<const std::byte> bytes) {
  ByteReader reader(bytes);
  KsplatHeader header;
  header.major = reader.get<std::uint8_t>();
  header.minor = reader.get<std::uint8_t>();
  static_cast<void>(reader.take(2));
  for (std::uint32_t* value : {&header.most_sections, &header.sections, &header.most_splats, &header.splats})
    *value = reader.get<std::uint32_t>();
  header.level = reader.get<std::uint16_t>();
  static_cast<void>(reader.take(14));  // the scene's centre
  header.least_harmonic = reader.get<float>();
  header.most_harmonic = reader.get<float>();
  if (header.least_harmonic == 0) header.least_harmonic = -1.5f;  // files of before there was a range
  if (header.most_harmonic == 0) header.most_harmonic = 1.5f;
  return header;
}

/// A section's header, and where its parts lie once they were found to lie in the file.
struct KsplatSection {
  std::uint32_t splats = 0, most_splats = 0, bucket_size = 0, buckets = 0;
  float block = 0;  ///< side of a bucket, world units
  std::uint16_t bucket_bytes = 0;
  std::uint32_t range = 0;  ///< stored centres go from 0 to twice this
  std::uint32_t full_buckets = 0, partial_buckets = 0;
  std::uint16_t degree = 0;
  std::span<const std::byte> partial_lengths, centers, rows;
};

class KsplatParser {
 public:
  KsplatParser(std::span<const std::byte> bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  [[nodiscard]] Result<SplatTable> parse() {
    if (bytes_.size() < ksplat_header_bytes)
      return error(ErrorKind::truncated, "header", "has less than its 4096 bytes");
    header_ = ksplat_header(bytes_);
    if (header_.major != 0 || header_.minor != 1) {
      return error(ErrorKind::unsupported, "version",
                   "is " + std::to_string(header_.major) + "." + std::to_string(header_.minor) + ", not 0.1");
    }
    if (header_.level > 2)
      return error(ErrorKind::unsupported, "compression level", "is " + std::to_string(header_.level) + ", above 2");
    if (!std::isfinite(header_.least_harmonic) || !std::isfinite(header_.most_harmonic))
      return error(ErrorKind::invalid, "range of harmonics", "is not finite");
    const std::size_t left = bytes_.size() - ksplat_header_bytes;
    if (header_.most_sections > left / ksplat_section_bytes)
      return error(ErrorKind::truncated, "sections",
                   "are " + std::to_string(header_.most_sections) + ", more than the file has room for");
    std::size_t at = ksplat_header_bytes + header_.most_sections * ksplat_section_bytes;
    std::vector<KsplatSection> sections;
    std::uint64_t total = 0;
    int degree = 0;
    for (std::size_t i = 0; i < header_.most_sections; ++i) {
      Result<KsplatSection> section = find_section(i, at);
      if (!section) return section.error();
      total += section->splats;
      if (section->splats != 0) degree = std::max(degree, static_cast<int>(section->degree));
      sections.push_back(*section);
    }
    if (total == 0) return error(ErrorKind::invalid, "splats", "there are none");
    if (total != header_.splats) {
      return error(
          ErrorKind::malformed, "splats",
          "are " + std::to_string(total) + " in the sections and " + std::to_string(header_.splats) + " in the header");
    }
    SplatTable table;
    table.resize(static_cast<std::size_t>(total), degree);
    std::size_t row = 0;
    for (const KsplatSection& section : sections) {
      if (Result<Done> read = read_section(section, table, row); !read) return read.error();
    }
    return table;
  }

  [[nodiscard]] const KsplatHeader& header() const { return header_; }

 private:
  [[nodiscard]] Error error(ErrorKind kind, std::string field, std::string problem) const {
    return splat_error(kind, name_, std::move(field), std::move(problem));
  }
  [[nodiscard]] std::size_t splat_bytes(int degree) const {
    const std::size_t rest = 3 * (sh_count(degree) - 1);
    return header_.level == 0 ? 44 + 4 * rest : 24 + rest * (header_.level == 1 ? 2 : 1);
  }

  /// Reads a section's header and finds its parts, which begin at `at`; afterwards that is behind them.
  [[nodiscard]] Result<KsplatSection> find_section(std::size_t index, std::size_t& at) const {
    const std::string field = "section " + std::to_string(index);
    ByteReader reader(bytes_.subspan(ksplat_header_bytes + index * ksplat_section_bytes, ksplat_section_bytes));
    KsplatSection section;
    for (std::uint32_t* value : {&section.splats, &section.most_splats, &section.bucket_size, &section.buckets})
      *value = reader.get<std::uint32_t>();
    section.block = reader.get<float>();
    section.bucket_bytes = reader.get<std::uint16_t>();
    static_cast<void>(reader.take(2));
    section.range = reader.get<std::uint32_t>();
    static_cast<void>(reader.take(4));  // its own bytes, which follow from the counts
    section.full_buckets = reader.get<std::uint32_t>();
    section.partial_buckets = reader.get<std::uint32_t>();
    section.degree = reader.get<std::uint16_t>();
    if (section.range == 0) section.range = header_.level == 0 ? 1 : 32767;
    if (section.degree > max_sh_degree)
      return error(ErrorKind::unsupported, field, "has harmonics of degree " + std::to_string(section.degree));
    if (section.splats > section.most_splats)
      return error(ErrorKind::malformed, field, "holds more splats than it has room for");
    // Counts of 32 bits times at most 65535 bytes each: none of these sums overflows 64 bits.
    const std::uint64_t lengths = std::uint64_t{4} * section.partial_buckets;
    const std::uint64_t centers = std::uint64_t{section.bucket_bytes} * section.buckets;
    const std::uint64_t rows = std::uint64_t{section.most_splats} * splat_bytes(section.degree);
    if (lengths + centers + rows > bytes_.size() - at) {
      return error(ErrorKind::truncated, field,
                   "promises " + std::to_string(lengths + centers + rows) + " bytes, and " +
                       std::to_string(bytes_.size() - at) + " follow");
    }
    if (header_.level > 0 && section.splats > 0) {
      if (section.bucket_bytes < 12) return error(ErrorKind::malformed, field, "has no centres of its buckets");
      if (!std::isfinite(section.block)) return error(ErrorKind::invalid, field, "has buckets of no finite size");
      if (std::uint64_t{section.full_buckets} + section.partial_buckets > section.buckets)
        return error(ErrorKind::malformed, field, "has more full and partial buckets than buckets");
    }
    section.partial_lengths = bytes_.subspan(at, static_cast<std::size_t>(lengths));
    section.centers = bytes_.subspan(at + section.partial_lengths.size(), static_cast<std::size_t>(centers));
    section.rows = bytes_.subspan(at + static_cast<std::size_t>(lengths + centers), static_cast<std::size_t>(rows));
    at += static_cast<std::size_t>(lengths + centers + rows);
    return section;
  }

  [[nodiscard]] float number(ByteReader& reader) const {
    return header_.level == 0 ? reader.get<float>() : half_to_float(reader.get<std::uint16_t>());
  }
  [[nodiscard]] float harmonic(ByteReader& reader) const {
    if (header_.level < 2) return number(reader);
    const float place = static_cast<float>(reader.get<std::uint8_t>()) / 255;
    return header_.least_harmonic + place * (header_.most_harmonic - header_.least_harmonic);
  }

  [[nodiscard]] Result<Done> read_section(const KsplatSection& section, SplatTable& table, std::size_t& row) const {
    const std::array<float, 256> logit = byte_logits();
    const double step = static_cast<double>(section.block) / 2 / section.range;
    const std::uint64_t in_full = std::uint64_t{section.full_buckets} * section.bucket_size;
    ByteReader rows(section.rows), lengths(section.partial_lengths);
    std::uint64_t bucket = section.full_buckets, bucket_end = in_full;  // of those that are not full
    for (std::uint64_t i = 0; i < section.splats; ++i, ++row) {
      std::array<double, 3> mean{};
      if (header_.level == 0) {
        for (double& x : mean) x = static_cast<double>(rows.get<float>());
      } else {
        std::uint64_t in = 0;
        if (i < in_full) {
          in = i / section.bucket_size;
        } else {
          if (bucket == section.full_buckets && bucket_end == in_full) bucket_end += lengths.get<std::uint32_t>();
          while (i >= bucket_end && !lengths.failed()) {
            ++bucket;
            bucket_end += lengths.get<std::uint32_t>();
          }
          in = bucket;
        }
        if (lengths.failed() || in >= section.buckets)
          return error(ErrorKind::malformed, "splat " + std::to_string(row), "lies in no bucket");
        ByteReader center(section.centers.subspan(static_cast<std::size_t>(in) * section.bucket_bytes, 12));
        for (double& x : mean) {
          x = (static_cast<double>(rows.get<std::uint16_t>()) - section.range) * step;
          x += static_cast<double>(center.get<float>());
        }
      }
      for (std::size_t axis = 0; axis < 3; ++axis) table.mean[axis][row] = static_cast<float>(mean[axis]);
      for (std::size_t axis = 0; axis < 3; ++axis) table.log_scale[axis][row] = std::log(number(rows));
      for (std::size_t k = 0; k < 4; ++k) table.rotation[k][row] = number(rows);
      for (std::size_t channel = 0; channel < 3; ++channel)
        table.color(channel, 0)[row] = dc_of_color(static_cast<double>(rows.get<std::uint8_t>()) / 255);
      table.opacity[row] = logit[rows.get<std::uint8_t>()];
      for (int degree = 1; degree <= section.degree; ++degree) {
        for (std::size_t channel = 0; channel < 3; ++channel) {
          for (std::size_t k = sh_count(degree - 1); k < sh_count(degree); ++k)
            table.color(channel, k)[row] = harmonic(rows);
        }
      }
    }
    return Done{};
  }

  std::span<const std::byte> bytes_;
  std::string name_;
  KsplatHeader header_;
};

}  // namespace detail

/// Whether bytes begin as such a file does; `size` is that of the whole file.
[[nodiscard]] inline bool looks_like_ksplat(std::span<const std::byte> head, std::uintmax_t size) {
  if (head.size() < 44 || size < detail::ksplat_header_bytes + detail::ksplat_section_bytes) return false;
  const detail::KsplatHeader header = detail::ksplat_header(head);
  return header.major == 0 && header.minor == 1 && header.level <= 2 && header.sections >= 1 &&
         header.sections <= header.most_sections && header.splats >= 1 && header.splats <= header.most_splats &&
         header.most_sections <= size / detail::ksplat_section_bytes && header.splats <= size / 24;
}

/// Reads a whole file; `name` is for the messages, `level` its compression level. Every count is checked against the
/// bytes before memory is taken. Cost: a pass over the bytes.
[[nodiscard]] inline Result<SplatTable> parse_ksplat(std::span<const std::byte> bytes, const std::string& name,
                                                     int* level = nullptr) {
  detail::KsplatParser parser(bytes, name);
  Result<SplatTable> table = parser.parse();
  if (!table) return table;
  if (level != nullptr) *level = parser.header().level;
  if (const Result<Done> usable = detail::finish_splats(*table, name); !usable) return usable.error();
  return table;
}

}  // namespace compmark
