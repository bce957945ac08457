// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The compressed PLY of SuperSplat (docs/splat_formats.md): element `chunk`, one row for every 256 splats, holds the
// ranges min_x … max_scale_z (floats; scales are logarithms) and, in newer files, min_r … max_b; element `vertex` four
// numbers of 32 bits a splat; element `sh` (not always there) f_rest as bytes.
//   packed_position  x 11 bits, y 10, z 11, x highest: a place in the chunk's range
//   packed_scale     the same
//   packed_rotation  2 bits: the largest of w x y z; the others in 10 bits each, 0 … 1023 for -1/sqrt 2 … 1/sqrt 2
//   packed_color     r g b a, 8 bits each, r highest: colours in the chunk's range or in [0, 1], a is the opacity
//   f_rest_i         (byte + 1/2) / 32 - 4; 0 is -4 and 255 is 4
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "compmark/io/ply.hpp"
#include "compmark/io/splat/splat_file.hpp"

namespace compmark {

namespace detail {

/// True for the vertices of such a file.
[[nodiscard]] inline bool is_compressed_ply(const PlyElement& vertex) {
  return vertex.find("packed_position") != nullptr;
}

/// The degree whose three channels have `columns` coefficients beside the constant; -1 for no degree up to 3.
[[nodiscard]] inline int degree_of_rest(std::size_t columns) {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    if (3 * (sh_count(degree) - 1) == columns) return degree;
  }
  return -1;
}
/// Number of properties f_rest_0, f_rest_1, … of an element.
[[nodiscard]] inline std::size_t rest_columns(const PlyElement& element) {
  std::size_t count = 0;
  while (element.find("f_rest_" + std::to_string(count)) != nullptr) ++count;
  return count;
}

/// Ranges of one quantity in every chunk: `low` and `high` of each of three components.
struct ChunkRanges {
  std::array<std::vector<float>, 3> low, high;
  [[nodiscard]] float at(std::size_t component, std::size_t chunk, double place) const {
    const double from = static_cast<double>(low[component][chunk]), to = static_cast<double>(high[component][chunk]);
    return static_cast<float>(from * (1 - place) + to * place);
  }
};

class CompressedPly {
 public:
  CompressedPly(const PlyFile& file, std::string name) : file_(file), name_(std::move(name)) {}

  /// All splats, not yet checked for infinities of the ranges.
  [[nodiscard]] Result<SplatTable> table() {
    const PlyElement* const vertex = file_.find("vertex");
    const PlyElement* const chunk = file_.find("chunk");
    if (vertex == nullptr || chunk == nullptr)
      return error("chunk", "there is no such element, which the packed numbers need");
    if (vertex->count == 0) return error("vertex", "has no rows");
    if (chunk->count != (vertex->count + 255) / 256) {
      return error("chunk", "has " + std::to_string(chunk->count) + " rows for " + std::to_string(vertex->count) +
                                " splats, expected one for each 256");
    }
    Result<ChunkRanges> mean = ranges(*chunk, {"x", "y", "z"});
    if (!mean) return mean.error();
    Result<ChunkRanges> scale = ranges(*chunk, {"scale_x", "scale_y", "scale_z"});
    if (!scale) return scale.error();
    ChunkRanges color;
    const bool has_color = chunk->find("min_r") != nullptr;
    if (has_color) {
      Result<ChunkRanges> found = ranges(*chunk, {"r", "g", "b"});
      if (!found) return found.error();
      color = std::move(*found);
    }
    for (const char* name : {"packed_position", "packed_rotation", "packed_scale", "packed_color"}) {
      if (Result<Done> there = expect(*vertex, name, PlyType::uint32); !there) return there.error();
    }
    const PlyElement* const sh = file_.find("sh");
    const std::size_t rest = sh == nullptr ? 0 : rest_columns(*sh);
    const int degree = degree_of_rest(rest);
    if (degree < 0) return error("f_rest", "has " + std::to_string(rest) + " columns, expected 9, 24 or 45");
    if (sh != nullptr && sh->count != vertex->count)
      return error("sh", "has another number of rows than element vertex");
    for (std::size_t i = 0; i < rest; ++i) {
      if (Result<Done> there = expect(*sh, "f_rest_" + std::to_string(i), PlyType::uint8); !there) return there.error();
    }

    SplatTable table;
    table.resize(vertex->count, degree);
    unpack(*vertex, *mean, *scale, has_color ? &color : nullptr, table);
    for (std::size_t i = 0; i < rest; ++i) {
      const std::vector<std::uint8_t> bytes = sh->column<std::uint8_t>("f_rest_" + std::to_string(i));
      std::vector<float>& column = table.color(i / (rest / 3), 1 + i % (rest / 3));
      for (std::size_t row = 0; row < table.count; ++row) column[row] = harmonic(bytes[row]);
    }
    return table;
  }

  [[nodiscard]] static float harmonic(std::uint8_t byte) {
    if (byte == 0 || byte == 255) return byte == 0 ? -4.0f : 4.0f;
    return (static_cast<float>(byte) + 0.5f) / 32 - 4;
  }

 private:
  [[nodiscard]] Error error(std::string field, std::string problem) const {
    return splat_error(ErrorKind::malformed, name_, std::move(field), std::move(problem),
                       "export it again, compressed or as a plain PLY");
  }
  [[nodiscard]] Result<Done> expect(const PlyElement& element, const std::string& property, PlyType type) const {
    const PlyProperty* const found = element.find(property);
    if (found == nullptr) return error(property, "is missing in element " + element.name);
    if (found->type != type) return error(property, "has another type than that of a compressed PLY");
    return Done{};
  }
  [[nodiscard]] Result<ChunkRanges> ranges(const PlyElement& chunk, const std::array<const char*, 3>& names) const {
    ChunkRanges found;
    for (std::size_t i = 0; i < 3; ++i) {
      for (const bool high : {false, true}) {
        const std::string property = (high ? "max_" : "min_") + std::string(names[i]);
        if (Result<Done> there = expect(chunk, property, PlyType::float32); !there) return there.error();
        (high ? found.high : found.low)[i] = chunk.column<float>(property);
      }
    }
    return found;
  }

  static void unpack(const PlyElement& vertex, const ChunkRanges& mean, const ChunkRanges& scale,
                     const ChunkRanges* color, SplatTable& table) {
    const auto part = [](std::uint32_t word, int shift, int bits) {
      const std::uint32_t most = (1u << bits) - 1;
      return static_cast<double>(word >> shift & most) / static_cast<double>(most);
    };
    const std::vector<std::uint32_t> position = vertex.column<std::uint32_t>("packed_position"),
                                     rotation = vertex.column<std::uint32_t>("packed_rotation"),
                                     size = vertex.column<std::uint32_t>("packed_scale"),
                                     rgba = vertex.column<std::uint32_t>("packed_color");
    const std::array<float, 256> logit = byte_logits();
    constexpr std::array<int, 3> shift{21, 11, 0}, bits{11, 10, 11};
    for (std::size_t i = 0; i < table.count; ++i) {
      const std::size_t chunk = i / 256;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        table.mean[axis][i] = mean.at(axis, chunk, part(position[i], shift[axis], bits[axis]));
        table.log_scale[axis][i] = scale.at(axis, chunk, part(size[i], shift[axis], bits[axis]));
        const double value = part(rgba[i], 24 - 8 * static_cast<int>(axis), 8);
        table.color(axis, 0)[i] =
            dc_of_color(color != nullptr ? static_cast<double>(color->at(axis, chunk, value)) : value);
      }
      std::array<double, 3> others{};
      for (std::size_t k = 0; k < 3; ++k)
        others[k] = (part(rotation[i], 20 - 10 * static_cast<int>(k), 10) - 0.5) * std::sqrt(2.0);
      const std::array<double, 4> q = with_largest(rotation[i] >> 30, others);
      for (std::size_t k = 0; k < 4; ++k) table.rotation[k][i] = static_cast<float>(q[k]);
      table.opacity[i] = logit[rgba[i] & 255u];
    }
  }

  const PlyFile& file_;
  std::string name_;
};

}  // namespace detail

/// The table of a compressed PLY that was parsed; `name` is for the messages. Cost: a pass over the values.
[[nodiscard]] inline Result<SplatTable> compressed_ply_splats(const PlyFile& file, const std::string& name) {
  Result<SplatTable> table = detail::CompressedPly(file, name).table();
  if (!table) return table;
  if (const Result<Done> usable = detail::finish_splats(*table, name); !usable) return usable.error();
  return table;
}

}  // namespace compmark
