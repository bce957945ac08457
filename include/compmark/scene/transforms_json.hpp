// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Parsing of transforms*.json: numbers that Python wrote as NaN, poses as 4 x 4 or 3 x 4 matrices. Every Error names the field by its path
// in the file.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"

namespace compmark::inline v0 {
namespace detail {

/// Python writes NaN and Infinity, which JSON does not have: outside strings they become null, so that the field that holds one can be
/// named instead of a line and column.
[[nodiscard]] inline std::string without_nan(const std::string& text) {
  std::string result;
  result.reserve(text.size());
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (in_string && text[i] == '\\' && i + 1 < text.size()) {
      result.append(text, i++, 2);
      continue;
    }
    if (text[i] == '"') in_string = !in_string;
    bool replaced = false;
    for (const std::string word : {"NaN", "nan", "-nan", "Infinity", "-Infinity", "inf", "-inf"}) {
      if (!in_string && !replaced && text.compare(i, word.size(), word) == 0) {
        result += "null";
        i += word.size() - 1;
        replaced = true;
      }
    }
    if (!replaced) result += text[i];
  }
  return result;
}

/// Parses the contents of a transforms file; `name` is for the message.
template <class Json = nlohmann::json>
[[nodiscard]] Result<Json> parse_transforms(std::span<const std::byte> bytes, const std::string& name) {
  if (bytes.empty()) return Error{ErrorKind::truncated, name, "", "the file is empty", "create the dataset again"};
  const std::string text = without_nan(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  try {
    return Json::parse(text.data(), text.data() + text.size());
  } catch (const typename Json::exception& mistake) {
    std::string reason = mistake.what();
    if (const std::size_t end = reason.find("] "); end != std::string::npos) reason.erase(0, end + 2);
    return Error{ErrorKind::malformed, name, "", "is not valid JSON: " + reason,
                 "correct it or create the dataset again"};
  }
}

template <class Json = nlohmann::json>
[[nodiscard]] Result<Json> read_transforms(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = read_file(path, std::uintmax_t{1} << 30);
  if (!bytes) return bytes.error();
  return parse_transforms<Json>(*bytes, path.string());
}

/// A finite number, or nothing.
template <class Json>
[[nodiscard]] std::optional<double> finite_number(const Json& value) {
  if (!value.is_number()) return std::nullopt;
  const double number = value.template get<double>();
  return std::isfinite(number) ? std::optional<double>(number) : std::nullopt;
}

/// False, 0 or null: a field that says that there is nothing.
template <class Json>
[[nodiscard]] bool switched_off(const Json& value) {
  if (value.is_boolean()) return !value.template get<bool>();
  return value.is_null() || (value.is_number() && value.template get<double>() == 0);
}

/// Row-major 4 x 4 (a 3 x 4 is completed); the Error names the entry.
template <class Json>
[[nodiscard]] Result<std::array<double, 16>> read_matrix(const Json& frame, const std::string& file,
                                                         const std::string& where) {
  const std::string field = where + ".transform_matrix";
  const auto fail = [&](ErrorKind kind, const std::string& entry, std::string problem) {
    return Error{kind, file, field + entry, std::move(problem), "correct the pose or remove the frame"};
  };
  if (!frame.is_object() || !frame.contains("transform_matrix"))
    return fail(ErrorKind::malformed, "", "is missing, so the image has no pose");
  const Json& rows = frame["transform_matrix"];
  if (!rows.is_array() || (rows.size() != 4 && rows.size() != 3))
    return fail(ErrorKind::malformed, "", "is not a 4 x 4 matrix");
  std::array<double, 16> matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].is_array() || rows[i].size() != 4)
      return fail(ErrorKind::malformed, "[" + std::to_string(i) + "]", "does not have 4 entries");
    for (std::size_t j = 0; j < 4; ++j) {
      const std::optional<double> value = finite_number(rows[i][j]);
      if (!value) {
        return fail(ErrorKind::invalid, "[" + std::to_string(i) + "][" + std::to_string(j) + "]",
                    "is not a finite number (NaN, infinite or no number)");
      }
      matrix[4 * i + j] = *value;
    }
  }
  return matrix;
}

}  // namespace detail
}  // namespace compmark::inline v0
