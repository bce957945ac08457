// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An Error of a function that does not know the file that it works on.
#pragma once

#include <filesystem>

#include "compmark/core/result.hpp"

namespace compmark::detail {

[[nodiscard]] inline Error in_file(Error error, const std::filesystem::path& file) {
  error.file = file.string();
  return error;
}
/// The same of a setting that the tool has an option for.
[[nodiscard]] inline Error in_option(Error error, const char* option) {
  error.field = option;
  return error;
}

}  // namespace compmark::detail
