// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The standard 3DGS PLY, which viewers open (docs/spec/formats.md, 1): one element `vertex`, floats,
//   x y z nx ny nz f_dc_0..2 f_rest_0..(3 K - 1) opacity scale_0..2 rot_0..3        K = 0, 3, 8, 15 for degree 0 … 3
// f_rest is planar by channel (all red coefficients first), opacity a logit, scale a natural logarithm, rot w x y z.
// Writing is strict (that order, zero normals, no NaN, no comments unless asked for); reading goes by property name and
// takes any order, any scalar type, files without normals or f_rest, and red green blue (bytes) in place of f_dc.
// read_splat (io/splat/read_splat.hpp) reads every format, this one too, and refuses what this one drops.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <locale>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/ply.hpp"
#include "compmark/io/splat/compressed_ply.hpp"
#include "compmark/io/splat/splat_file.hpp"
#include "compmark/math/spherical_harmonics.hpp"
#include "compmark/scene/splat_table.hpp"

namespace compmark {

/// A file read, and what had to be left out of it.
struct SplatPly {
  SplatTable table;
  std::size_t dropped = 0;            ///< rows with a NaN, an infinite position or a quaternion of norm zero
  std::vector<std::string> comments;  ///< of the header ("SplatRenderMode: mip", for instance)
};

namespace detail {

/// What else a PLY may be, in words; nothing for a file that looks like splats.
[[nodiscard]] inline std::optional<Error> not_splats(const PlyElement& vertex, const std::string& file) {
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, file, std::move(field), std::move(problem), std::move(remedy)};
  };
  if (vertex.find("packed_position") != nullptr) {
    return fail(ErrorKind::unsupported, "packed_position", "this is a compressed PLY of SuperSplat",
                "read it with read_splat, or export it as a plain PLY");
  }
  if (vertex.find("f_anchor_feat_0") != nullptr) {
    return fail(ErrorKind::unsupported, "f_anchor_feat_0", "this is an anchor table, whose Gaussians need its networks",
                "export the model it belongs to as a standard 3DGS PLY");
  }
  for (const char* name : {"x", "y", "z"}) {
    if (vertex.find(name) == nullptr) return fail(ErrorKind::malformed, name, "is missing", "export the file again");
  }
  if (vertex.find("opacity") == nullptr && vertex.find("scale_0") == nullptr && vertex.find("rot_0") == nullptr) {
    return fail(ErrorKind::malformed, "opacity", "is missing: this is a point cloud, not a splat",
                "train a model from it first");
  }
  if (vertex.find("scale_0") != nullptr && vertex.find("scale_1") != nullptr && vertex.find("scale_2") == nullptr) {
    return fail(ErrorKind::unsupported, "scale_2", "is missing: these are 2D Gaussians (surfels)",
                "export the model as 3D Gaussians");
  }
  return std::nullopt;
}

/// All rows of a standard PLY, as they are; `name` is for the messages.
[[nodiscard]] inline Result<SplatTable> standard_ply_rows(const PlyFile& file, const std::string& name) {
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, name, std::move(field), std::move(problem), std::move(remedy)};
  };
  const PlyElement* vertex = file.find("vertex");
  if (vertex == nullptr)
    return fail(ErrorKind::malformed, "vertex", "there is no such element", "check that this is a splat file");
  if (std::optional<Error> other = not_splats(*vertex, name)) return std::move(*other);
  if (vertex->count == 0) return fail(ErrorKind::invalid, "vertex", "has no rows", "export the file again");
  const std::size_t rest = rest_columns(*vertex);
  const int degree = degree_of_rest(rest);
  if (degree < 0) {
    return fail(ErrorKind::unsupported, "f_rest", "has " + std::to_string(rest) + " columns, expected 0, 9, 24 or 45",
                "export with at most degree 3");
  }
  SplatTable table;
  table.resize(vertex->count, degree);
  const std::array<const char*, 3> colors{"red", "green", "blue"};
  std::optional<Error> failure;
  for_each_splat_column(table, [&](const std::string& property, std::vector<float>& column) {
    if (failure) return;
    if (vertex->find(property) != nullptr) {
      column = vertex->column<float>(property);
      return;
    }
    const char* const color = property.starts_with("f_dc_") ? colors[static_cast<std::size_t>(property[5] - '0')] : "";
    const PlyProperty* const bytes = vertex->find(color);
    if (bytes == nullptr || bytes->declared != PlyType::uint8) {
      failure = fail(ErrorKind::malformed, property, "is missing", "export the file again");
      return;
    }
    column = vertex->column<float>(color);
    for (float& value : column) value = dc_of_color(static_cast<double>(value) / 255);
  });
  if (failure) return *failure;
  return table;
}

}  // namespace detail

/// A comment of a splat PLY that says which direction, of length 1, is up, so that who reads it looks at it upright.
[[nodiscard]] inline std::string splat_up_comment(const std::array<double, 3>& up) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text.precision(9);
  text << "compmark up";
  for (const double x : up) text << ' ' << std::round(1e9 * x) / 1e9 + 0.0;  // an axis without its rounding, and no -0
  return text.str();
}

/// Writes the table. Cost: one pass; 4 (14 + 3 (degree + 1)^2) bytes a Gaussian.
[[nodiscard]] inline Result<Done> write_splat_ply(const std::filesystem::path& path, const SplatTable& table,
                                                  std::span<const std::string> comments = {}) {
  std::vector<PlyFloatColumn> columns;
  std::optional<Error> failure;
  const float zero = 0;
  detail::for_each_splat_column(table, [&](std::string name, const std::vector<float>& column) {
    for (std::size_t i = 0; i < column.size() && !failure; ++i) {
      if (std::isnan(column[i])) {
        failure = Error{ErrorKind::invalid, path.string(), name, "row " + std::to_string(i) + " is NaN",
                        "remove it before writing"};
      }
    }
    columns.push_back({std::move(name), column.data(), 1});
    if (columns.size() == 3) {
      for (const char* normal : {"nx", "ny", "nz"}) columns.push_back({normal, &zero, 0});
    }
  });
  if (failure) return *failure;
  return write_ply(path, table.count, columns, comments);
}

/// Reads a standard 3DGS PLY; rows that cannot be drawn are left out and counted.
[[nodiscard]] inline Result<SplatPly> read_splat_ply(const std::filesystem::path& path) {
  Result<PlyFile> file = read_ply(path);
  if (!file) return file.error();
  Result<SplatTable> rows = detail::standard_ply_rows(*file, path.string());
  if (!rows) return rows.error();
  SplatPly result;
  result.comments = std::move(file->comments);
  result.table = std::move(*rows);

  SplatTable& table = result.table;
  std::vector<std::size_t> kept;
  for (std::size_t row = 0; row < table.count; ++row) {
    bool usable = true;
    table.for_each_column([&](const std::vector<float>& column) { usable = usable && !std::isnan(column[row]); });
    for (const std::vector<float>& column : table.mean) usable = usable && std::isfinite(column[row]);
    float norm = 0;
    for (const std::vector<float>& column : table.rotation) norm += std::abs(column[row]);
    if (usable && norm > 0 && std::isfinite(norm)) kept.push_back(row);
  }
  result.dropped = table.count - kept.size();
  if (result.dropped != 0) {
    table.for_each_column([&](std::vector<float>& column) {
      for (std::size_t row = 0; row < kept.size(); ++row) column[row] = column[kept[row]];
      column.resize(kept.size());
    });
    table.count = kept.size();
  }
  return result;
}

}  // namespace compmark
