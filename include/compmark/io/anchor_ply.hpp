// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The anchor PLY of the Scaffold-GS family (docs/spec/formats.md, 2): one element `vertex`, floats,
//   x y z nx ny nz f_offset_0..(3 K - 1) f_anchor_feat_0..(D - 1) opacity scale_0..5 rot_0..3
// There f_offset is axis-major, index axis * K + k; our table has 3 k + axis. opacity and rot of an anchor are never
// trained and never rendered: the published initial values are written, and nothing is read. The networks are in other
// files (model.safetensors).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/ply.hpp"
#include "compmark/splat/anchor/concept.hpp"

namespace compmark {

/// An anchor table read from a file, in the library's order of columns.
struct AnchorPly {
  std::size_t rows = 0;
  std::size_t offsets = 0;      ///< K
  std::size_t feature_dim = 0;  ///< D
  std::vector<float> position;  ///< [rows, 3]
  std::vector<float> offset;    ///< [rows, 3 K], column 3 k + axis
  std::vector<float> scaling;   ///< [rows, 6], log
  std::vector<float> feature;   ///< [rows, D]

  [[nodiscard]] AnchorColumns<const float> columns() const {
    return {{position.data(), rows, 3},
            {offset.data(), rows, 3 * offsets},
            {scaling.data(), rows, 6},
            {feature.data(), rows, feature_dim}};
  }
};

/// Logit of the opacity 0.1 that published anchors start with and keep.
inline constexpr float published_anchor_opacity = -2.1972246f;

/// Writes the table. Cost: one pass; 4 (17 + 3 K + D) bytes an anchor.
[[nodiscard]] inline Result<Done> write_anchor_ply(const std::filesystem::path& path,
                                                   const AnchorColumns<const float>& anchors,
                                                   std::span<const std::string> comments = {}) {
  static constexpr float zero = 0, one = 1;
  const std::size_t k_count = anchors.offset.columns / 3;
  std::vector<PlyFloatColumn> columns;
  const auto add = [&](std::string name, const MatrixView<const float>& matrix, std::size_t column) {
    columns.push_back({std::move(name), matrix.data + column, matrix.columns});
  };
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (std::size_t axis = 0; axis < 3; ++axis) add(axes[axis], anchors.position, axis);
  for (const char* normal : {"nx", "ny", "nz"}) columns.push_back({normal, &zero, 0});
  for (std::size_t i = 0; i < 3 * k_count; ++i)
    add("f_offset_" + std::to_string(i), anchors.offset, 3 * (i % k_count) + i / k_count);
  for (std::size_t i = 0; i < anchors.feature.columns; ++i)
    add("f_anchor_feat_" + std::to_string(i), anchors.feature, i);
  columns.push_back({"opacity", &published_anchor_opacity, 0});
  for (std::size_t i = 0; i < 6; ++i) add("scale_" + std::to_string(i), anchors.scaling, i);
  for (std::size_t i = 0; i < 4; ++i) columns.push_back({"rot_" + std::to_string(i), i == 0 ? &one : &zero, 0});
  return write_ply(path, anchors.rows(), columns, comments);
}

/// Reads a table; K and D follow from the header. Every value must be finite.
[[nodiscard]] inline Result<AnchorPly> read_anchor_ply(const std::filesystem::path& path) {
  const Result<PlyFile> file = read_ply(path);
  if (!file) return file.error();
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, path.string(), std::move(field), std::move(problem), std::move(remedy)};
  };
  const PlyElement* vertex = file->find("vertex");
  if (vertex == nullptr)
    return fail(ErrorKind::malformed, "vertex", "there is no such element", "check that this is an anchor file");
  const auto count_of = [&](const std::string& prefix) {
    std::size_t count = 0;
    while (vertex->find(prefix + std::to_string(count)) != nullptr) ++count;
    return count;
  };
  AnchorPly result;
  result.rows = vertex->count;
  result.feature_dim = count_of("f_anchor_feat_");
  const std::size_t offsets = count_of("f_offset_");
  result.offsets = offsets / 3;
  if (result.feature_dim == 0 || offsets == 0) {
    return fail(ErrorKind::malformed, offsets == 0 ? "f_offset_0" : "f_anchor_feat_0",
                "is missing: this is not an anchor table of the Scaffold-GS family",
                "check that this is the right file");
  }
  if (offsets % 3 != 0) {
    return fail(ErrorKind::malformed, "f_offset", "has " + std::to_string(offsets) + " columns, not a multiple of 3",
                "export the file again");
  }
  result.position.resize(result.rows * 3);
  result.offset.resize(result.rows * offsets);
  result.scaling.resize(result.rows * 6);
  result.feature.resize(result.rows * result.feature_dim);
  std::vector<std::pair<std::string, std::pair<float*, std::size_t>>> targets;  // name, first value, stride
  const std::array<const char*, 3> axes{"x", "y", "z"};
  for (std::size_t axis = 0; axis < 3; ++axis) targets.push_back({axes[axis], {result.position.data() + axis, 3}});
  for (std::size_t i = 0; i < offsets; ++i) {
    targets.push_back({"f_offset_" + std::to_string(i),
                       {result.offset.data() + 3 * (i % result.offsets) + i / result.offsets, offsets}});
  }
  for (std::size_t i = 0; i < 6; ++i) targets.push_back({"scale_" + std::to_string(i), {result.scaling.data() + i, 6}});
  for (std::size_t i = 0; i < result.feature_dim; ++i) {
    targets.push_back({"f_anchor_feat_" + std::to_string(i), {result.feature.data() + i, result.feature_dim}});
  }
  for (const auto& [name, target] : targets) {
    if (vertex->find(name) == nullptr) return fail(ErrorKind::malformed, name, "is missing", "export the file again");
    const std::vector<float> column = vertex->column<float>(name);
    for (std::size_t row = 0; row < column.size(); ++row) {
      if (!std::isfinite(column[row])) {
        return fail(ErrorKind::invalid, name, "row " + std::to_string(row) + " is not finite",
                    "remove the anchor or export the file again");
      }
      target.first[row * target.second] = column[row];
    }
  }
  return result;
}

}  // namespace compmark
