// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Where the real data lies, for the tests that need it. They are never part of the repository: where they are missing,
// a test says
//   if (!data) { MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)"); return; }
// and tests/run.sh counts it as skipped, with that line as its reason.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <system_error>

namespace compmark::testing {

/// The data folder: environment variable COMPMARK_DATA_DIR, else ../shared/data of the working directory, which is the
/// project's root in every test; nothing where there is none.
inline std::optional<std::filesystem::path> data_dir() {
  const char* from_environment = std::getenv("COMPMARK_DATA_DIR");
  const std::filesystem::path path = from_environment != nullptr ? from_environment : "../shared/data";
  std::error_code ignored;
  if (path.empty() || !std::filesystem::is_directory(path, ignored)) return std::nullopt;
  return path;
}

}  // namespace compmark::testing
