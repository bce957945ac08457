// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Whether there is a file, as a question that never throws: where a name is too long or a folder may not be read, there
// is none that this program could use.
#pragma once

#include <filesystem>
#include <system_error>

namespace compmark::detail {

/// A file, a folder or anything else of this name.
[[nodiscard]] inline bool file_exists(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}
[[nodiscard]] inline bool folder_exists(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

}  // namespace compmark::detail
