// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The standard 3DGS PLY, which viewers open (docs/spec/formats.md, 1): one element `vertex`, floats,
//   x y z nx ny nz f_dc_0..2 f_rest_0..(3 K - 1) opacity scale_0..2 rot_0..3        K = 0, 3, 8, 15 for degree 0 … 3
// f_rest is planar by channel (all red coefficients first), opacity a logit, scale a natural logarithm, rot w x y z.
// Writing is strict (that order, zero normals, no NaN, no comments unless asked for); reading goes by property name and
// takes any order, any scalar type, and files without normals or f_rest.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/ply.hpp"
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

/// The columns of a table beside their names in the file's order; normals are missing here.
template <class Table, class F>
void for_each_splat_column(Table& table, const F& f) {
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (std::size_t i = 0; i < 3; ++i) f(axes[i], table.mean[i]);
  for (std::size_t c = 0; c < 3; ++c) f("f_dc_" + std::to_string(c), table.color(c, 0));
  const std::size_t rest = table.coefficients() - 1;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < rest; ++i) f("f_rest_" + std::to_string(c * rest + i), table.color(c, i + 1));
  }
  f("opacity", table.opacity);
  for (std::size_t i = 0; i < 3; ++i) f("scale_" + std::to_string(i), table.log_scale[i]);
  for (std::size_t i = 0; i < 4; ++i) f("rot_" + std::to_string(i), table.rotation[i]);
}

/// What else a PLY may be, in words; nothing for a file that looks like splats.
[[nodiscard]] inline std::optional<Error> not_splats(const PlyElement& vertex, const std::string& file) {
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, file, std::move(field), std::move(problem), std::move(remedy)};
  };
  if (vertex.find("packed_position") != nullptr) {
    return fail(ErrorKind::unsupported, "packed_position", "this is a compressed PLY of SuperSplat",
                "export it as a plain PLY");
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

}  // namespace detail

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

/// Reads a standard 3DGS PLY.
[[nodiscard]] inline Result<SplatPly> read_splat_ply(const std::filesystem::path& path) {
  Result<PlyFile> file = read_ply(path);
  if (!file) return file.error();
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, path.string(), std::move(field), std::move(problem), std::move(remedy)};
  };
  const PlyElement* vertex = file->find("vertex");
  if (vertex == nullptr)
    return fail(ErrorKind::malformed, "vertex", "there is no such element", "check that this is a splat file");
  if (std::optional<Error> other = detail::not_splats(*vertex, path.string())) return std::move(*other);
  if (vertex->count == 0) return fail(ErrorKind::invalid, "vertex", "has no rows", "export the file again");
  std::size_t rest = 0;
  while (vertex->find("f_rest_" + std::to_string(rest)) != nullptr) ++rest;
  int degree = 0;
  while (degree <= max_sh_degree && 3 * (sh_count(degree) - 1) != rest) ++degree;
  if (degree > max_sh_degree) {
    return fail(ErrorKind::unsupported, "f_rest", "has " + std::to_string(rest) + " columns, expected 0, 9, 24 or 45",
                "export with at most degree 3");
  }
  SplatPly result;
  result.comments = std::move(file->comments);
  result.table.resize(vertex->count, degree);
  std::optional<Error> failure;
  detail::for_each_splat_column(result.table, [&](const std::string& name, std::vector<float>& column) {
    if (failure) return;
    if (vertex->find(name) == nullptr) {
      failure = fail(ErrorKind::malformed, name, "is missing", "export the file again");
    } else {
      column = vertex->column<float>(name);
    }
  });
  if (failure) return *failure;

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
