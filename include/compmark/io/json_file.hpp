// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// JSON files: reading with the line of the mistake, fields with their path in the message, writing whole or not at all.
// Whatever uses JSON, here and in other modules, is a template on its class with one default: a program pays for the
// instantiation of a JSON library (an eighth of the umbrella header's parse time) where it reads or writes JSON, not
// where it includes a header.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/file_kind.hpp"
#include "compmark/io/json_shape.hpp"

namespace compmark {

/// Parses a whole JSON file (at most 1 GiB). The error names line and column, or what the file is instead of
/// `expected`.
template <class Json = nlohmann::json>
[[nodiscard]] Result<Json> read_json(const std::filesystem::path& path, std::string_view expected = "a JSON file") {
  const Result<std::vector<std::byte>> bytes = read_file_of(
      path, std::uintmax_t{1} << 30, expected, [](FileKind kind, std::span<const std::byte>) { return is_json(kind); });
  if (!bytes) return bytes.error();
  const char* begin = reinterpret_cast<const char*>(bytes->data());
  const char* end = begin + bytes->size();
  if (json_shape({begin, bytes->size()}).depth > json_depth_limit)
    return Error{
        ErrorKind::malformed, path.string(), {}, "is nested too deeply", "correct it or create the file again"};
  try {
    return Json::parse(begin, end);
  } catch (const typename Json::parse_error& mistake) {
    const char* place = begin + std::min<std::size_t>(mistake.byte > 0 ? mistake.byte - 1 : 0, bytes->size());
    const auto line = 1 + std::count(begin, place, '\n');
    const char* line_begin = place;
    while (line_begin != begin && line_begin[-1] != '\n') --line_begin;
    return Error{bytes->empty() ? ErrorKind::truncated : ErrorKind::malformed, path.string(),
                 "line " + std::to_string(line) + " column " + std::to_string(place - line_begin + 1),
                 bytes->empty() ? "the file is empty" : "is not valid JSON", "correct it or create the file again"};
  } catch (const typename Json::exception& mistake) {  // a number outside double's range
    return Error{ErrorKind::invalid, path.string(), {}, mistake.what(), "correct it or create the file again"};
  }
}

/// Writes JSON, indented by two spaces, keys in the object's own order (sorted for nlohmann::json), atomically. Numbers
/// that are not finite become null, as JSON has no other name for them. `mode` as that of AtomicFile::create.
template <class Json>
[[nodiscard]] Result<Done> write_json(const std::filesystem::path& path, const Json& json, unsigned mode = 0666) {
  return write_file(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n", mode);
}

/// Field `key` of an object as T (a finite number, a string, a bool); `file` and `where` (path of the object) are for
/// the message.
template <class T, class Json>
[[nodiscard]] Result<T> json_field(const Json& object, const std::string& key, const std::string& file,
                                   const std::string& where = {}) {
  const std::string field = where.empty() ? key : where + "." + key;
  const auto fail = [&](ErrorKind kind, std::string problem, std::string remedy) {
    return Error{kind, file, field, std::move(problem), std::move(remedy)};
  };
  if (!object.is_object() || !object.contains(key)) return fail(ErrorKind::malformed, "is missing", "add it");
  const Json& value = object[key];
  if constexpr (std::is_same_v<T, bool>) {
    if (!value.is_boolean()) return fail(ErrorKind::malformed, "is not true or false", "correct it");
    return value.template get<bool>();
  } else if constexpr (std::is_integral_v<T>) {
    const bool fits = value.is_number_integer() && (std::is_signed_v<T> || value.is_number_unsigned());
    if (!fits) return fail(ErrorKind::malformed, "is not a whole number", "correct it");
    const bool in_range = value.is_number_unsigned() ? std::in_range<T>(value.template get<std::uint64_t>())
                                                     : std::in_range<T>(value.template get<std::int64_t>());
    if (!in_range) return fail(ErrorKind::invalid, "is out of range", "correct it");
    return value.template get<T>();
  } else if constexpr (std::is_floating_point_v<T>) {
    if (!value.is_number()) return fail(ErrorKind::malformed, "is not a number", "correct it");
    const T number = value.template get<T>();
    if (!std::isfinite(number)) return fail(ErrorKind::invalid, "is not finite", "correct it");
    return number;
  } else {
    if (!value.is_string()) return fail(ErrorKind::malformed, "is not a string", "correct it");
    return value.template get<std::string>();
  }
}

}  // namespace compmark
