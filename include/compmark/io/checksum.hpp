// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The checksum that our files carry of their own content: of tensors with their names, types and shapes and all
// metadata (safetensors), of all fields (keys). It is of the content, not of the bytes: a file that another program
// stores again, unchanged, stays right. Files of before have none and are read as they are; a checksum whose name was
// damaged is recognised by its value.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/io/xxh64.hpp"

namespace compmark {

inline constexpr std::string_view checksum_key = "checksum";
inline constexpr std::string_view checksum_prefix = "xxh64:";

[[nodiscard]] inline std::string checksum_text(std::uint64_t digest) {
  std::string text(checksum_prefix);
  for (int shift = 60; shift >= 0; shift -= 4) text += "0123456789abcdef"[digest >> shift & 15u];
  return text;
}
/// True for a text that looks as a checksum does, whatever its name: one or two of its letters may be damaged.
[[nodiscard]] inline bool looks_like_checksum(std::string_view text) {
  if (text.size() != checksum_prefix.size() + 16) return false;
  int wrong = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool right = i < checksum_prefix.size()
                           ? text[i] == checksum_prefix[i]
                           : std::string_view("0123456789abcdef").find(text[i]) != std::string_view::npos;
    wrong += right ? 0 : 1;
  }
  return wrong <= 2;
}

/// Of metadata (without the checksum itself) and tensors; both are taken in the order of their names.
class TensorsChecksum {
 public:
  explicit TensorsChecksum(const std::map<std::string, std::string>& metadata) {
    hash_.number(metadata.size() - metadata.count(std::string(checksum_key)));
    for (const auto& [key, value] : metadata) {
      if (key != checksum_key) hash_.text(key).text(value);
    }
  }
  void add(std::string_view name, std::string_view dtype, std::span<const std::int64_t> shape,
           std::span<const std::byte> data) {
    hash_.text(name).text(dtype).number(shape.size());
    for (const std::int64_t extent : shape) hash_.number(static_cast<std::uint64_t>(extent));
    hash_.number(data.size()).update(data);
  }
  [[nodiscard]] std::string text() const { return checksum_text(hash_.digest()); }

 private:
  Xxh64 hash_;
};

}  // namespace compmark
