// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/io/file_exists.hpp>
#include <filesystem>
#include <string>

#include "support/scene_files.hpp"

using namespace compmark;

TEST_CASE("io/file_exists: a name that no file can have is no file, and nothing is thrown") {
  const testing::TemporaryFolder folder;
  CHECK(detail::file_exists(folder.path()));
  CHECK(detail::folder_exists(folder.path()));
  CHECK_FALSE(detail::file_exists(folder.path() / "none"));
  CHECK_FALSE(detail::folder_exists(folder.path() / "none"));
  const std::filesystem::path endless = folder.path() / std::string(300, 'a');
  CHECK_THROWS_AS(static_cast<void>(std::filesystem::exists(endless)),
                  std::filesystem::filesystem_error);  // the control
  CHECK_FALSE(detail::file_exists(endless));
  CHECK_FALSE(detail::folder_exists(endless));
}
