// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/file_identity.hpp"

#include <doctest/doctest.h>
#include <sys/stat.h>

#include <filesystem>

#include "support/scene_files.hpp"

namespace {

using namespace compmark;
using testing::put;
using testing::TemporaryFolder;
namespace fs = std::filesystem;

TEST_CASE("io/file_identity: one file under several names") {
  const TemporaryFolder folder;
  const fs::path a = folder.path() / "a", b = folder.path() / "b", sub = folder.path() / "sub";
  put(a, "same");
  put(b, "same");  // equal bytes are not one file
  fs::create_directory(sub);
  fs::create_hard_link(a, folder.path() / "hard");
  fs::create_symlink("a", folder.path() / "soft");
  fs::create_directory_symlink(folder.path(), sub / "up");
  CHECK(same_file(a, a));
  CHECK(!same_file(a, b));
  CHECK(same_file(a, folder.path() / "hard"));
  CHECK(same_file(a, folder.path() / "soft"));
  CHECK(same_file(a, sub / ".." / "a"));
  CHECK(same_file(a, sub / "up" / "hard"));
  CHECK(same_file("/dev/null", "/dev/../dev/null"));
  CHECK(!same_file("/dev/null", "/dev/zero"));
  CHECK(!same_file("", ""));
  CHECK(!same_file(a, ""));
  CHECK(!same_file(a, folder.path() / "A"));  // here capitals count
}

TEST_CASE("io/file_identity: names of files that are not written yet") {
  const TemporaryFolder folder;
  const fs::path sub = folder.path() / "sub";
  fs::create_directory(sub);
  fs::create_directory_symlink(folder.path(), sub / "up");
  fs::create_symlink("new", folder.path() / "dangling");
  CHECK(same_file(folder.path() / "new", sub / "up" / "." / "new"));
  CHECK(same_file(folder.path() / "new", folder.path() / "dangling"));
  CHECK(same_file(folder.path() / "deep" / "er" / "x", sub / ".." / "deep" / "er" / "x"));
  CHECK(!same_file(folder.path() / "new", folder.path() / "New"));
  CHECK(!same_file(folder.path() / "new", sub / "new"));
  put(folder.path() / "there", "x");
  CHECK(!same_file(folder.path() / "there", folder.path() / "new"));
  const fs::path before = fs::current_path();
  fs::current_path(folder.path());
  CHECK(same_file("new", folder.path() / "new"));
  CHECK(same_file("sub/../new", "./new"));
  fs::current_path(before);
}

TEST_CASE("io/file_identity: what lies in a folder") {
  const TemporaryFolder folder;
  const fs::path sub = folder.path() / "sub", other = folder.path() / "subway";
  fs::create_directories(sub / "deep");
  fs::create_directory(other);
  fs::create_directory_symlink(sub / "deep", folder.path() / "in");
  CHECK(lies_in(sub / "x.png", sub));
  CHECK(lies_in(sub, sub));
  CHECK(lies_in(sub / "deep" / "new" / "x.png", sub));
  CHECK(lies_in(folder.path() / "in" / "x.png", sub));
  CHECK(!lies_in(other / "x.png", sub));
  CHECK(!lies_in(folder.path() / "x.png", sub));
  CHECK(!lies_in(sub / ".." / "x.png", sub));
}

}  // namespace
