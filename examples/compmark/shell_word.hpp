// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A file's name as a word of a shell: the commands that are printed as next steps run as they stand.
#pragma once

#include <cctype>
#include <filesystem>
#include <string>

namespace tool {

/// The path itself where a shell takes each of its characters for what it is, else between single quotes. One that
/// begins like an option gets ./ before it.
[[nodiscard]] inline std::string shell_word(const std::filesystem::path& path) {
  std::string text = path.string();
  if (!text.empty() && text.front() == '-') text.insert(0, "./");
  bool plain = !text.empty();
  for (const char c : text) {
    const unsigned char byte = static_cast<unsigned char>(c);
    // Bytes of UTF-8 above 127 are letters to a shell.
    plain = plain && (byte > 127 || std::isalnum(byte) != 0 || std::string("_-./+,:@%=").find(c) != std::string::npos);
  }
  if (plain) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

}  // namespace tool
