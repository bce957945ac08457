// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The form of a JSON text, before a parser takes memory for it: how deeply it is nested and which names its outermost
// object has. One pass, no memory but for the names; a text that is no JSON has some form too, and is the parser's to
// refuse.
#pragma once

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>

namespace compmark {

/// More nesting than any file of ours or of a capture has; a parser's memory for brackets alone stays small.
inline constexpr std::size_t json_depth_limit = 100;

struct JsonShape {
  std::size_t depth = 0;  ///< of brackets and braces; counted up to one beyond json_depth_limit
  std::size_t keys = 0;   ///< of the outermost object
  std::string repeated;   ///< one of its names that appears twice, as it is written
};

/// Cost: one pass.
[[nodiscard]] inline JsonShape json_shape(std::string_view text) {
  JsonShape shape;
  std::set<std::string_view> names;
  std::size_t depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"') {
      const std::size_t begin = i + 1;
      for (++i; i < text.size() && text[i] != '"'; ++i) i += text[i] == '\\' ? 1 : 0;
      if (depth != 1) continue;
      const std::size_t next = text.find_first_not_of(" \t\r\n", std::min(i + 1, text.size()));
      if (next == std::string_view::npos || text[next] != ':') continue;
      ++shape.keys;
      const std::string_view name = text.substr(begin, std::min(i, text.size()) - begin);
      if (!names.insert(name).second && shape.repeated.empty()) shape.repeated = name;
    } else if (c == '[' || c == '{') {
      shape.depth = std::max(shape.depth, ++depth);
      if (depth > json_depth_limit) return shape;
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return shape;
}

/// Parses a text; a discarded value if it is not JSON or nested too deeply. All of the library parses from one type of
/// pointer, so that a program has one parser.
template <class Json = nlohmann::json>
[[nodiscard]] Json json_from(std::string_view text) {
  if (json_shape(text).depth > json_depth_limit) return Json(Json::value_t::discarded);
  return Json::parse(text.data(), text.data() + text.size(), nullptr, false);
}

}  // namespace compmark
