// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/read_file.hpp"

#include <doctest/doctest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include "support/scene_files.hpp"

namespace {

using namespace compmark;
using testing::put;
using testing::TemporaryFolder;
namespace fs = std::filesystem;

TEST_CASE("io/read_file: only regular files are read, and the reason says what is wrong") {
  const TemporaryFolder folder;
  const auto error = [](const fs::path& path) { return read_file(path).error(); };
  CHECK(error(folder.path() / "none").problem == "no such file");
  CHECK(error(folder.path()).problem.find("folder") != std::string::npos);
  REQUIRE(::mkfifo((folder.path() / "pipe").c_str(), 0600) == 0);
  CHECK(error(folder.path() / "pipe").problem.find("pipe") != std::string::npos);  // and it does not hang
  CHECK(error("/dev/zero").problem.find("device") != std::string::npos);
  // Not "no such file": the system's reason.
  const Error long_name = error(folder.path() / std::string(300, 'n'));
  CHECK(long_name.kind == ErrorKind::unreadable);
  CHECK(long_name.problem.find("too long") != std::string::npos);
  fs::create_symlink("b", folder.path() / "a");
  fs::create_symlink("a", folder.path() / "b");
  CHECK(error(folder.path() / "a").problem.find("cannot be looked at") != std::string::npos);
}

TEST_CASE("io/read_file: a size that changes while it is read is noticed") {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "file";
  for (const int change : {-1, 0, 1}) {
    put(path, "0123456789");
    auto file = InputFile::open(path);
    REQUIRE(file.ok());
    fs::resize_file(path, static_cast<std::uintmax_t>(10 + change));
    std::vector<std::byte> bytes;
    REQUIRE(file->append(bytes, 4).ok());
    CHECK(bytes.size() == 4);
    CHECK(file->left() == 6);
    const auto rest = file->append_rest(bytes);
    CHECK(rest.ok() == (change == 0));
    if (change < 0) CHECK(rest.error().kind == ErrorKind::truncated);
    if (change > 0) CHECK(rest.error().problem.find("grew") != std::string::npos);
    if (change == 0) CHECK(std::to_integer<char>(bytes[9]) == '9');
  }
}

TEST_CASE("io/read_file: the first bytes are looked at before memory is taken for the rest") {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "huge";
  put(path, "head");
  fs::resize_file(path, std::uintmax_t{1} << 38);  // a hole: more than there is memory
  std::uintmax_t seen = 0;
  const auto refused = read_file(path, std::uintmax_t{1} << 40, 8, [&](std::span<const std::byte> head, auto size) {
    seen = size;
    CHECK(head.size() == 8);
    return Result<Done>(Error{ErrorKind::malformed, "", "", "wrong magic", ""});
  });
  REQUIRE(!refused.ok());
  CHECK(refused.error().problem == "wrong magic");
  CHECK(seen == std::uintmax_t{1} << 38);
  CHECK(read_file(path, std::uintmax_t{1} << 30).error().kind == ErrorKind::exhausted);
  put(path, "abc");
  const auto whole = read_file(path, 100, 8, [](auto head, auto) {
    CHECK(head.size() == 3);
    return Result<Done>(Done{});
  });
  REQUIRE(whole.ok());
  CHECK(whole->size() == 3);
}

}  // namespace
