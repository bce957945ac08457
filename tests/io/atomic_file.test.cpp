// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/atomic_file.hpp"

#include <doctest/doctest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "support/scene_files.hpp"

namespace {

using namespace compmark;
using testing::TemporaryFolder;

std::size_t files_in(const TemporaryFolder& folder) {
  std::size_t n = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) n += entry.exists() ? 1 : 0;
  return n;
}

std::string read_back(const std::filesystem::path& path) {
  const auto bytes = read_file(path);
  REQUIRE(bytes.ok());
  return {reinterpret_cast<const char*>(bytes->data()), bytes->size()};
}

TEST_CASE("io/atomic_file: nothing shows before commit, all of it after") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.txt";
  REQUIRE(write_file(path, std::string_view("old")).ok());
  {
    auto file = AtomicFile::create(path);
    REQUIRE(file.ok());
    file->write(std::string_view("new"));
    file->write(std::string_view(""));
    file->write(std::string_view(" text"));
    CHECK(read_back(path) == "old");
    CHECK(file->commit().ok());
  }
  CHECK(read_back(path) == "new text");
  CHECK(files_in(folder) == 1);
}

TEST_CASE("io/atomic_file: an abandoned file leaves the old one and no trace") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.txt";
  REQUIRE(write_file(path, std::string_view("old")).ok());
  {
    auto file = AtomicFile::create(path);
    REQUIRE(file.ok());
    file->write(std::string_view("half a"));
    const AtomicFile moved = std::move(*file);
  }
  CHECK(read_back(path) == "old");
  CHECK(files_in(folder) == 1);
}

TEST_CASE("io/atomic_file: a full disk is an error that leaves the old file") {
  const TemporaryFolder folder;
  if (!std::filesystem::exists("/dev/full")) return;
  const std::filesystem::path path = folder.path() / "a.txt";
  REQUIRE(write_file(path, std::string_view("old")).ok());
  std::filesystem::create_symlink(
      "/dev/full",
      folder.path() / "a.txt.partial");  // the device takes every byte and fails at the flush
  const auto result = write_file(path, std::string_view("new"));
  CHECK(!result.ok());
  CHECK(read_back(path) == "old");
  CHECK(files_in(folder) == 1);
}

TEST_CASE("io/atomic_file: errors name file and remedy") {
  const TemporaryFolder folder;
  const auto missing = AtomicFile::create(folder.path() / "none" / "a.txt");
  REQUIRE(!missing.ok());
  CHECK(missing.error().kind == ErrorKind::unwritable);
  CHECK(missing.error().file == (folder.path() / "none" / "a.txt").string());
  CHECK(!missing.error().remedy.empty());
  CHECK(AtomicFile::create(folder.path()).error().kind == ErrorKind::unwritable);
  CHECK(read_file(folder.path() / "b").error().kind == ErrorKind::not_found);
  CHECK(read_file(folder.path()).error().kind == ErrorKind::unreadable);
  REQUIRE(write_file(folder.path() / "c", std::string_view("12345")).ok());
  CHECK(read_file(folder.path() / "c", 4).error().kind == ErrorKind::exhausted);
  CHECK(read_file(folder.path() / "c", 5).ok());
  REQUIRE(write_file(folder.path() / "d", std::string_view("")).ok());
  CHECK(read_file(folder.path() / "d").value().empty());
}

}  // namespace
