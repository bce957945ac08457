// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/output_target.hpp"

#include <doctest/doctest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <string>

#include "support/scene_files.hpp"

namespace {

using namespace compmark;
using testing::put;
using testing::TemporaryFolder;
namespace fs = std::filesystem;
using Kind = OutputTarget::Kind;

TEST_CASE("io/output_target: files and free names are replaced, through links") {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "file";
  put(file, "x");
  CHECK(output_target(file)->kind == Kind::file);
  CHECK(output_target(file)->exists);
  CHECK(output_target(folder.path() / "new")->kind == Kind::file);
  CHECK(!output_target(folder.path() / "new")->exists);
  fs::create_directory(folder.path() / "sub");
  fs::create_symlink("../file", folder.path() / "sub" / "link");
  fs::create_symlink("sub/link", folder.path() / "link");
  CHECK(fs::equivalent(output_target(folder.path() / "link")->path, file));
  fs::create_symlink("sub/later", folder.path() / "dangling");
  const auto dangling = output_target(folder.path() / "dangling");
  REQUIRE(dangling.ok());
  CHECK(dangling->path == folder.path() / "sub" / "later");
  CHECK(!dangling->exists);
  for (const char* name : {"file", "new", "link", "dangling"}) CHECK(!is_stream_target(folder.path() / name));
}

TEST_CASE("io/output_target: devices, pipes and descriptors are written through") {
  const TemporaryFolder folder;
  CHECK(output_target("/dev/null")->kind == Kind::stream);
  REQUIRE(::mkfifo((folder.path() / "pipe").c_str(), 0600) == 0);
  CHECK(output_target(folder.path() / "pipe")->kind == Kind::stream);
  fs::create_symlink("pipe", folder.path() / "link");
  CHECK(output_target(folder.path() / "link")->kind == Kind::stream);
  CHECK(output_target("/dev/stdout")->descriptor == 1);
  CHECK(output_target("/dev/stderr")->descriptor == 2);
  CHECK(output_target("/dev/fd/7")->descriptor == 7);
  CHECK(output_target("/dev/../dev/fd/7")->descriptor == 7);
  CHECK(output_target("/proc/self/fd/12")->descriptor == 12);
  CHECK(output_target("/proc/" + std::to_string(::getpid()) + "/fd/3")->descriptor == 3);
  CHECK(detail::named_descriptor("/dev/fd/x") == -1);
  CHECK(detail::named_descriptor("/dev/fd/12345678901") == -1);
  CHECK(detail::named_descriptor("fd/1") == -1);
  fs::create_symlink("/dev/stdout", folder.path() / "out");
  CHECK(output_target(folder.path() / "out")->descriptor == 1);
  for (const fs::path& path : {fs::path("/dev/null"), folder.path() / "pipe", fs::path("/dev/fd/1")})
    CHECK(is_stream_target(path));
}

TEST_CASE("io/output_target: what cannot be written is refused by what it is") {
  const TemporaryFolder folder;
  const auto problem = [](const fs::path& path) {
    const auto target = output_target(path);
    REQUIRE(!target.ok());
    CHECK(target.error().kind == ErrorKind::unwritable);
    CHECK(!target.error().remedy.empty());
    return target.error().problem;
  };
  CHECK(problem(folder.path()).find("folder") != std::string::npos);
  CHECK(problem("").find("not the name of a file") != std::string::npos);
  CHECK(problem(folder.path() / "new" / "").find("not the name of a file") != std::string::npos);
  fs::create_symlink("b", folder.path() / "a");
  fs::create_symlink("a", folder.path() / "b");
  CHECK(problem(folder.path() / "a").find("loop") != std::string::npos);
  put(folder.path() / "file", "x");
  CHECK(problem(folder.path() / std::string(300, 'n')).find("cannot be looked at") != std::string::npos);

  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM, 0);
  REQUIRE(descriptor >= 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, (folder.path() / "socket").c_str(), sizeof(address.sun_path) - 1);
  REQUIRE(::bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0);
  CHECK(problem(folder.path() / "socket").find("socket") != std::string::npos);
  CHECK(is_stream_target(folder.path() / "socket"));
  ::close(descriptor);
}

}  // namespace
