// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Parsing of transforms*.json: numbers that Python wrote as NaN, poses as 4 x 4 or 3 x 4 matrices. Every Error names
// the field by its path in the file.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/scene/text_bytes.hpp"

namespace compmark {
namespace detail {

/// Python writes NaN and Infinity, which JSON does not have: outside strings they become null, so that the field that
/// holds one can be named instead of a line and column. Empty if brackets are nested deeper than `deepest`, which no
/// capture needs: a parser would take memory for each level.
[[nodiscard]] inline std::optional<std::string> without_nan(std::span<const std::byte> bytes, int deepest = 64) {
  static constexpr std::array<std::string_view, 7> words{"NaN", "nan", "-nan", "Infinity", "-Infinity", "inf", "-inf"};
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::string result;
  result.reserve(text.size());
  bool in_string = false;
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string && c == '\\' && i + 1 < text.size()) {
      result.append(text, i++, 2);
      continue;
    }
    if (c == '"') in_string = !in_string;
    if (!in_string && (c == '[' || c == '{') && ++depth > deepest) return std::nullopt;
    if (!in_string && (c == ']' || c == '}')) --depth;
    std::string_view found;
    if (!in_string && (c == 'N' || c == 'n' || c == '-' || c == 'I' || c == 'i')) {
      for (const std::string_view word : words) found = text.substr(i, word.size()) == word ? word : found;
    }
    if (found.empty()) {
      result += c;
    } else {
      result += "null";
      i += found.size() - 1;
    }
  }
  return result;
}

/// Parses the contents of a transforms file; `name` is for the message.
template <class Json = nlohmann::json>
[[nodiscard]] Result<Json> parse_transforms(std::span<const std::byte> bytes, const std::string& name) {
  if (bytes.empty()) return Error{ErrorKind::truncated, name, "", "the file is empty", "create the dataset again"};
  const std::optional<std::string> text = without_nan(bytes);
  if (!text) {
    return Error{ErrorKind::malformed, name, "", "is nested deeper than 64 levels",
                 "correct it or create the dataset again"};
  }
  std::vector<std::set<std::string>> open;  // the keys of the objects that are being read
  std::string twice;
  const auto look = [&](int, typename Json::parse_event_t event, Json& value) {
    using Event = typename Json::parse_event_t;
    if (event == Event::object_start) open.emplace_back();
    if (event == Event::object_end) open.pop_back();
    if (event == Event::key && !open.back().insert(value.template get<std::string>()).second && twice.empty())
      twice = value.template get<std::string>();
    return true;
  };
  try {
    Json json = Json::parse(text->data(), text->data() + text->size(), look);
    if (twice.empty()) return json;
    return Error{ErrorKind::malformed, name, twice,
                 "is there twice in one object, so which of the two is meant cannot be known", "remove one of them"};
  } catch (const typename Json::exception& mistake) {
    std::string reason = mistake.what();
    if (const std::size_t end = reason.find("] "); end != std::string::npos) reason.erase(0, end + 2);
    return Error{ErrorKind::malformed, name, "", "is not valid JSON: " + reason,
                 "correct it or create the dataset again"};
  }
}

template <class Json = nlohmann::json>
[[nodiscard]] Result<Json> read_transforms(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = read_text(path, std::uintmax_t{1} << 30);
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

/// What is wrong with the last row of a pose, which is 0 0 0 1; empty if nothing is. Written by columns, the
/// translation lies in it.
[[nodiscard]] inline std::string last_row_problem(const std::array<double, 16>& m) {
  // 1e-6: rows that went through float32 and a product or two are off by less.
  const auto is = [](double value, double expected) { return std::abs(value - expected) <= 1e-6; };
  if (is(m[12], 0) && is(m[13], 0) && is(m[14], 0) && is(m[15], 1)) return {};
  if (is(m[3], 0) && is(m[7], 0) && is(m[11], 0) && is(m[15], 1))
    return "is stored by columns: its last column is 0 0 0 1, and the camera's place is in its last row";
  return "has a last row that is not 0 0 0 1";
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
  if (const std::string problem = last_row_problem(matrix); !problem.empty()) {
    Error error = fail(ErrorKind::invalid, "", problem);
    error.remedy =
        "write camera-to-world matrices by rows, with 0 0 0 1 as the last one (transpose those that are not)";
    return error;
  }
  return matrix;
}

}  // namespace detail
}  // namespace compmark
