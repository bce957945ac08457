// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Splat files of every format as bytes, written from their specifications (docs/splat_formats.md) for the tests of the
// readers. `drop` bits of every rounded number are lost: 0 is the format, 1 must exceed the bounds of its rounding.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/io/bytes.hpp>
#include <compmark/io/npz.hpp>
#include <compmark/io/splat/splat_file.hpp>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "compmark/io/detail/stb.hpp"

#if defined(COMPMARK_WITH_ZSTD)
#include <zstd.h>
#endif

namespace compmark::testing::splats {

using SplatBytes = std::vector<std::byte>;

/// Gaussians within what every format can hold: places in a cube of side 8, scales of e^-8 to e^-1, unit rotations,
/// f_dc within 1.6, harmonics within 0.9.
inline SplatTable random_splats(std::size_t count, int degree, std::uint64_t seed = 3) {
  SplatTable table;
  table.resize(count, degree);
  const Random random(seed, 0, random_stage("splat formats test"));
  std::uint64_t index = 0;
  const auto between = [&](double low, double high) {
    return static_cast<float>(low + (high - low) * random.uniform(index++));
  };
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      table.mean[axis][i] = between(-4, 4);
      table.log_scale[axis][i] = between(-8, -1);
      table.color(axis, 0)[i] = between(-1.6, 1.6);
      for (std::size_t k = 1; k < table.coefficients(); ++k) table.color(axis, k)[i] = between(-0.9, 0.9);
    }
    double norm = 0;
    std::array<double, 4> q{};
    for (double& x : q) {
      x = random.normal(index++);
      norm += x * x;
    }
    for (std::size_t k = 0; k < 4; ++k) table.rotation[k][i] = static_cast<float>(q[k] / std::sqrt(norm));
    table.opacity[i] = between(-4, 4);
  }
  return table;
}

/// x in [low, high] as a number of `bits` bits, rounded.
inline std::uint32_t quantised(double x, double low, double high, int bits, int drop = 0) {
  const double most = static_cast<double>((1u << (bits - drop)) - 1);
  const double place = std::clamp((x - low) / (high - low), 0.0, 1.0);
  const double step = std::round(place * most) / most;  // of the coarser grid, then on the format's own
  return static_cast<std::uint32_t>(std::round(step * static_cast<double>((1u << bits) - 1)));
}
inline double sigmoid(float logit) { return 1 / (1 + std::exp(-static_cast<double>(logit))); }
inline double color_of_dc(float f) { return 0.5 + sh_constant * static_cast<double>(f); }

/// The largest of four, and the others with the sign that makes it positive, in their order.
struct SmallestThree {
  std::size_t largest = 0;
  std::array<double, 3> others{};
};
inline SmallestThree smallest_three(const std::array<double, 4>& q) {
  SmallestThree found;
  for (std::size_t k = 1; k < 4; ++k) {
    if (std::abs(q[k]) > std::abs(q[found.largest])) found.largest = k;
  }
  for (std::size_t k = 0, n = 0; k < 4; ++k) {
    if (k != found.largest) found.others[n++] = q[found.largest] < 0 ? -q[k] : q[k];
  }
  return found;
}
/// w x y z of a row.
inline std::array<double, 4> rotation_of(const SplatTable& table, std::size_t row) {
  std::array<double, 4> q{};
  for (std::size_t k = 0; k < 4; ++k) q[k] = static_cast<double>(table.rotation[k][row]);
  return q;
}

/// float to binary16, rounded to nearest; `drop` bits of the mantissa are lost.
inline std::uint16_t half_of(double x, int drop = 0) {
  if (x == 0) return 0;
  int exponent = 0;
  std::frexp(x, &exponent);
  exponent = std::max(exponent, -13);  // below 2^-14 the step stays that of subnormal numbers
  const double step = std::ldexp(1.0, exponent - 11 + drop);
  const double rounded = std::round(std::abs(x) / step) * step;
  std::frexp(rounded, &exponent);
  const std::uint16_t sign = x < 0 ? 0x8000 : 0;
  if (rounded < std::ldexp(1.0, -14))
    return static_cast<std::uint16_t>(sign | static_cast<int>(std::ldexp(rounded, 24)));
  const int mantissa = static_cast<int>(std::ldexp(rounded, 11 - exponent)) - 1024;
  return static_cast<std::uint16_t>(sign | (exponent + 14) << 10 | mantissa);
}

inline SplatBytes compressed_ply_bytes(const SplatTable& table, bool color_ranges, int drop = 0) {
  const std::size_t chunks = (table.count + 255) / 256, rest = 3 * (table.coefficients() - 1);
  std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment of a test\nelement chunk " + std::to_string(chunks) + "\n";
  const std::vector<std::string> names =
      color_ranges ? std::vector<std::string>{"", "scale_", "c"} : std::vector<std::string>{"", "scale_"};
  for (const std::string& quantity : names) {
    for (const char* side : {"min_", "max_"}) {
      for (const char axis : std::string(quantity == "c" ? "rgb" : "xyz"))
        header += "property float " + std::string(side) + (quantity == "c" ? "" : quantity) + axis + "\n";
    }
  }
  header += "element vertex " + std::to_string(table.count) + "\n";
  for (const char* name : {"position", "rotation", "scale", "color"})
    header += "property uint packed_" + std::string(name) + "\n";
  if (rest != 0) header += "element sh " + std::to_string(table.count) + "\n";
  for (std::size_t i = 0; i < rest; ++i) header += "property uchar f_rest_" + std::to_string(i) + "\n";
  ByteWriter out;
  out.put(std::string_view(header + "end_header\n"));

  const auto value = [&](std::size_t quantity, std::size_t axis, std::size_t row) {
    return quantity == 0   ? static_cast<double>(table.mean[axis][row])
           : quantity == 1 ? static_cast<double>(table.log_scale[axis][row])
                           : color_of_dc(table.color(axis, 0)[row]);
  };
  std::vector<std::array<std::array<double, 2>, 9>> range(chunks);
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    for (std::size_t i = 0; i < 9; ++i) {
      range[chunk][i] = {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
      for (std::size_t row = 256 * chunk; row < std::min(table.count, 256 * (chunk + 1)); ++row) {
        range[chunk][i][0] = std::min(range[chunk][i][0], value(i / 3, i % 3, row));
        range[chunk][i][1] = std::max(range[chunk][i][1], value(i / 3, i % 3, row));
      }
      if (i >= 6 && !color_ranges) range[chunk][i] = {0, 1};
    }
    for (std::size_t quantity = 0; quantity < names.size(); ++quantity) {
      for (const std::size_t side : {0u, 1u}) {
        for (std::size_t axis = 0; axis < 3; ++axis)
          out.put(static_cast<float>(range[chunk][3 * quantity + axis][side]));
      }
    }
  }
  for (std::size_t row = 0; row < table.count; ++row) {
    const auto part = [&](std::size_t quantity, std::size_t axis, int bits) {
      const std::array<double, 2>& of = range[row / 256][3 * quantity + axis];
      return quantised(value(quantity, axis, row), of[0], of[1], bits, drop);
    };
    const auto three = [&](std::size_t quantity) {
      return part(quantity, 0, 11) << 21 | part(quantity, 1, 10) << 11 | part(quantity, 2, 11);
    };
    const SmallestThree q = smallest_three(rotation_of(table, row));
    std::uint32_t rotation = static_cast<std::uint32_t>(q.largest);
    for (const double x : q.others) rotation = rotation << 10 | quantised(x, -std::sqrt(0.5), std::sqrt(0.5), 10, drop);
    out.put(three(0)).put(rotation).put(three(1));
    out.put(part(2, 0, 8) << 24 | part(2, 1, 8) << 16 | part(2, 2, 8) << 8 |
            quantised(sigmoid(table.opacity[row]), 0, 1, 8, drop));
  }
  for (std::size_t row = 0; row < table.count; ++row) {
    for (std::size_t i = 0; i < rest; ++i) {
      const double x = static_cast<double>(table.color(i / (rest / 3), 1 + i % (rest / 3))[row]);
      const int byte = static_cast<int>(std::floor((x / 8 + 0.5) * 256));
      out.put(static_cast<std::uint8_t>(std::clamp(drop == 0 ? byte : byte & ~1, 0, 255)));
    }
  }
  return out.take();
}

inline SplatBytes antimatter_bytes(const SplatTable& table, int drop = 0) {
  ByteWriter out;
  for (std::size_t row = 0; row < table.count; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) out.put(table.mean[axis][row]);
    for (std::size_t axis = 0; axis < 3; ++axis) out.put(std::exp(table.log_scale[axis][row]));
    for (std::size_t axis = 0; axis < 3; ++axis)
      out.put(static_cast<std::uint8_t>(quantised(color_of_dc(table.color(axis, 0)[row]), 0, 1, 8, drop)));
    out.put(static_cast<std::uint8_t>(quantised(sigmoid(table.opacity[row]), 0, 1, 8, drop)));
    for (const double x : rotation_of(table, row)) {
      const double step = drop == 0 ? 1 : 2;
      out.put(static_cast<std::uint8_t>(std::clamp(std::round((x * 128 + 128) / step) * step, 0.0, 255.0)));
    }
  }
  return out.take();
}

/// Side of the buckets of ksplat_bytes: a splat within random_splats lies within half of it of their centre.
inline constexpr double ksplat_block = 9;

/// One section; of level 1 and 2 with a full bucket and one that is not, whatever the place of a splat.
inline SplatBytes ksplat_bytes(const SplatTable& table, int level, int drop = 0) {
  const std::size_t bucket = std::max<std::size_t>(1, 2 * table.count / 3), rest = 3 * (table.coefficients() - 1);
  const std::uint32_t full = static_cast<std::uint32_t>(table.count / bucket);
  const std::uint32_t partial = table.count % bucket != 0 ? 1 : 0, count = static_cast<std::uint32_t>(table.count);
  ByteWriter out;
  const auto zeros = [&](std::size_t until) {
    while (out.size() < until) out.put(std::uint8_t{0});
  };
  out.put(std::uint16_t{0x0100}).put(std::uint16_t{0});
  for (const std::uint32_t value : {1u, 1u, count, count}) out.put(value);
  out.put(static_cast<std::uint16_t>(level)).put(std::uint16_t{0});
  for (int i = 0; i < 3; ++i) out.put(0.0f);
  out.put(-1.0f).put(1.0f);  // range of harmonics in bytes
  zeros(4096);
  for (const std::uint32_t value : {count, count, static_cast<std::uint32_t>(bucket), full + partial}) out.put(value);
  out.put(static_cast<float>(ksplat_block)).put(std::uint16_t{12}).put(std::uint16_t{0});
  out.put(std::uint32_t{level == 0 ? 1u : 32767u}).put(std::uint32_t{0}).put(full).put(partial);
  out.put(static_cast<std::uint16_t>(table.degree));
  zeros(4096 + 1024);
  for (std::uint32_t i = 0; i < partial; ++i) out.put(static_cast<std::uint32_t>(table.count % bucket));
  for (std::uint32_t i = 0; i < full + partial; ++i) out.put(0.25f).put(-0.25f).put(0.0f);
  const std::array<double, 3> center{0.25, -0.25, 0};
  const auto number = [&](double x) {
    if (level == 0) {
      out.put(static_cast<float>(x));
    } else {
      out.put(half_of(x, drop));
    }
  };
  for (std::size_t row = 0; row < table.count; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = static_cast<double>(table.mean[axis][row]);
      if (level == 0) {
        out.put(static_cast<float>(x));
        continue;
      }
      const double step = drop == 0 ? 1 : 2;
      const double place = std::round((x - center[axis]) / (ksplat_block / 2) * 32767 / step) * step + 32767;
      out.put(static_cast<std::uint16_t>(std::clamp(place, 0.0, 65535.0)));
    }
    for (std::size_t axis = 0; axis < 3; ++axis) number(std::exp(static_cast<double>(table.log_scale[axis][row])));
    for (const double x : rotation_of(table, row)) number(x);
    for (std::size_t c = 0; c < 3; ++c)
      out.put(static_cast<std::uint8_t>(quantised(color_of_dc(table.color(c, 0)[row]), 0, 1, 8, drop)));
    out.put(static_cast<std::uint8_t>(quantised(sigmoid(table.opacity[row]), 0, 1, 8, drop)));
    for (std::size_t i = 0; i < rest; ++i) {  // degree by degree: 3 x 3, 3 x 5, 3 x 7
      const std::size_t band = i < 9 ? 3 : i < 24 ? 5 : 7, begin = i < 9 ? 0 : i < 24 ? 9 : 24;
      const std::size_t k = (i < 9 ? 1 : i < 24 ? 4 : 9) + (i - begin) % band;
      const double x = static_cast<double>(table.color((i - begin) / band, k)[row]);
      if (level == 2) {
        out.put(static_cast<std::uint8_t>(quantised(x, -1, 1, 8, drop)));
      } else {
        number(x);
      }
    }
  }
  return out.take();
}

inline SplatBytes gzip_bytes(const SplatBytes& content) {
  int size = 0;
  unsigned char* const zlib = detail::stb::stbi_zlib_compress(
      const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(content.data())),
      static_cast<int>(content.size()), &size, 8);
  ByteWriter out;
  out.put(std::uint32_t{0x00088b1f}).put(std::uint32_t{0}).put(std::uint16_t{0xff00});
  // Without the two bytes and the checksum of zlib's own frame.
  out.put(std::as_bytes(std::span<const unsigned char>(zlib + 2, static_cast<std::size_t>(size) - 6)));
  std::free(zlib);
  out.put(detail::zip_checksum(content)).put(static_cast<std::uint32_t>(content.size()));
  return out.take();
}

/// The blocks of an SPZ file, in its frame: right, up, back.
struct SpzParts {
  std::array<SplatBytes, 6> streams;  ///< positions, alphas, colours, scales, rotations, harmonics
};
inline SpzParts spz_parts(const SplatTable& table, int version, int fractional_bits, int drop = 0) {
  std::array<ByteWriter, 6> out;
  const std::array<double, 16> parity{1, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1};
  const double step = drop == 0 ? 1 : 2;
  const auto byte = [&](double x) {
    return static_cast<std::uint8_t>(std::clamp(std::round(x / step) * step, 0.0, 255.0));
  };
  for (std::size_t row = 0; row < table.count; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = (axis == 0 ? 1 : -1) * static_cast<double>(table.mean[axis][row]);
      const auto fixed = static_cast<std::int32_t>(std::round(std::ldexp(x, fractional_bits) / step) * step);
      for (int shift = 0; shift < 24; shift += 8) out[0].put(static_cast<std::uint8_t>(fixed >> shift & 255));
      out[2].put(byte(127.5 + 255 * 0.15 * static_cast<double>(table.color(axis, 0)[row])));
      out[3].put(byte(16 * (static_cast<double>(table.log_scale[axis][row]) + 10)));
    }
    out[1].put(byte(255 * sigmoid(table.opacity[row])));
    for (std::size_t k = 1; k < table.coefficients(); ++k) {
      for (std::size_t c = 0; c < 3; ++c)
        out[5].put(byte(128 + 128 * parity[k] * static_cast<double>(table.color(c, k)[row])));
    }
    const std::array<double, 4> wxyz = rotation_of(table, row);
    const std::array<double, 4> q{wxyz[1], -wxyz[2], -wxyz[3], wxyz[0]};
    if (version == 2) {
      for (std::size_t k = 0; k < 3; ++k) out[4].put(byte(127.5 + 127.5 * (q[3] < 0 ? -q[k] : q[k])));
      continue;
    }
    const SmallestThree three = smallest_three(q);
    std::uint32_t word = static_cast<std::uint32_t>(three.largest);
    for (const double x : three.others) {
      const auto magnitude = static_cast<std::uint32_t>(std::round(std::abs(x) * std::sqrt(2.0) * 511 / step) * step);
      word = word << 10 | (x < 0 ? 512u : 0u) | std::min(511u, magnitude);
    }
    out[4].put(word);
  }
  SpzParts parts;
  for (std::size_t i = 0; i < 6; ++i) parts.streams[i] = out[i].take();
  return parts;
}
inline void put_spz_header(ByteWriter& out, const SplatTable& table, int version, int fractional_bits, int flags,
                           int streams) {
  out.put(std::string_view("NGSP")).put(static_cast<std::uint32_t>(version));
  out.put(static_cast<std::uint32_t>(table.count));
  for (const int value : {table.degree, fractional_bits, flags, streams}) out.put(static_cast<std::uint8_t>(value));
}
/// Version 2 or 3, before gzip.
inline SplatBytes spz_content(const SplatTable& table, int version, int fractional_bits = 12, int drop = 0,
                              int flags = 0) {
  ByteWriter out;
  put_spz_header(out, table, version, fractional_bits, flags, 0);
  for (const SplatBytes& stream : spz_parts(table, version, fractional_bits, drop).streams) out.put(stream);
  return out.take();
}
#if defined(COMPMARK_WITH_ZSTD)
inline SplatBytes spz4_bytes(const SplatTable& table, int drop = 0, const SplatBytes& extensions = {}) {
  const SpzParts parts = spz_parts(table, 4, 12, drop);
  const int streams = table.degree == 0 ? 5 : 6;
  ByteWriter out, frames;
  put_spz_header(out, table, 4, 12, extensions.empty() ? 1 : 3, streams);
  out.put(static_cast<std::uint32_t>(32 + extensions.size()));
  for (int i = 0; i < 3; ++i) out.put(std::uint32_t{0});
  out.put(extensions);
  for (int i = 0; i < streams; ++i) {
    const SplatBytes& stream = parts.streams[static_cast<std::size_t>(i)];
    SplatBytes frame(ZSTD_compressBound(stream.size()));
    frame.resize(ZSTD_compress(frame.data(), frame.size(), stream.data(), stream.size(), 3));
    out.put(std::uint64_t{frame.size()}).put(std::uint64_t{stream.size()});
    frames.put(frame);
  }
  out.put(frames.take());
  return out.take();
}
#endif

/// A standard PLY with its properties in another order, others among them, places as doubles.
inline SplatBytes permuted_ply_bytes(const SplatTable& table, std::uint64_t seed) {
  struct Column {
    std::string name;
    const std::vector<float>* values;
  };
  std::vector<Column> columns;
  detail::for_each_splat_column(table, [&](const std::string& name, const std::vector<float>& values) {
    columns.push_back({name, &values});
  });
  columns.push_back({"transform", nullptr});
  columns.push_back({"segment", nullptr});
  const Random random(seed, 0, random_stage("order of properties"));
  for (std::size_t i = columns.size(); i > 1; --i)
    std::swap(columns[i - 1], columns[static_cast<std::size_t>(random.uniform(i) * static_cast<double>(i))]);
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(table.count) + "\n";
  for (const Column& column : columns) {
    const bool place = column.name.size() == 1;
    header += std::string("property ") +
              (column.name == "segment" ? "uchar "
               : place                  ? "double "
                                        : "float ") +
              column.name + "\n";
  }
  ByteWriter out;
  out.put(std::string_view(header + "end_header\n"));
  for (std::size_t row = 0; row < table.count; ++row) {
    for (const Column& column : columns) {
      if (column.name == "segment") {
        out.put(std::uint8_t{7});
      } else if (column.values == nullptr) {
        out.put(1.5f);
      } else if (column.name.size() == 1) {
        out.put(static_cast<double>((*column.values)[row]));
      } else {
        out.put((*column.values)[row]);
      }
    }
  }
  return out.take();
}

}  // namespace compmark::testing::splats
