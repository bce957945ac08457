// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/folder_lock.hpp"

#include <doctest/doctest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <optional>
#include <utility>

#include "support/scene_files.hpp"

namespace {

using namespace compmark;
using testing::TemporaryFolder;
namespace fs = std::filesystem;

TEST_CASE("io/folder_lock: one holder at a time, and no trace afterwards") {
  const TemporaryFolder folder;
  {
    auto first = FolderLock::acquire(folder.path());
    REQUIRE(first.ok());
    CHECK(first->held());
    const auto second = FolderLock::acquire(folder.path());
    REQUIRE(!second.ok());
    CHECK(second.error().kind == ErrorKind::unwritable);
    CHECK(second.error().file == folder.path().string());
    CHECK(second.error().problem.find("another run") != std::string::npos);
    CHECK(second.error().remedy.find("--out") != std::string::npos);
    FolderLock moved = std::move(*first);
    CHECK(!FolderLock::acquire(folder.path()).ok());
    const TemporaryFolder other;
    CHECK(FolderLock::acquire(other.path()).ok());
  }
  CHECK(fs::is_empty(folder.path()));
  CHECK(FolderLock::acquire(folder.path()).ok());
  const auto absent = FolderLock::acquire(folder.path() / "none"),
             within = FolderLock::beside(folder.path() / "none/a");
  for (const auto* refused : {&absent, &within}) {  // it is the folder that has to be made
    REQUIRE(!refused->ok());
    CHECK(refused->error().file == (folder.path() / "none").string());
    CHECK(refused->error().remedy.find("create this folder") != std::string::npos);
  }
}

TEST_CASE("io/folder_lock: the place of one file, through links; streams are not locked") {
  const TemporaryFolder folder;
  fs::create_symlink("out", folder.path() / "link");
  {
    const auto first = FolderLock::beside(folder.path() / "out");
    REQUIRE(first.ok());
    CHECK(!FolderLock::beside(folder.path() / "link").ok());
    CHECK(FolderLock::beside(folder.path() / "other").ok());
  }
  CHECK(FolderLock::beside(folder.path() / "link").ok());
  const auto one = FolderLock::beside("/dev/null"), two = FolderLock::beside("/dev/null");
  CHECK(one.ok());
  CHECK(two.ok());
  CHECK(!one->held());
}

TEST_CASE("io/folder_lock: a killed holder does not stand in the way") {
  const TemporaryFolder folder;
  int ready[2];
  REQUIRE(::pipe(ready) == 0);
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    const auto lock = FolderLock::acquire(folder.path());
    const char answer = lock.ok() ? 'y' : 'n';
    if (::write(ready[1], &answer, 1) != 1) ::_exit(1);
    for (;;) ::pause();
  }
  char answer = 0;
  REQUIRE(::read(ready[0], &answer, 1) == 1);
  REQUIRE(answer == 'y');
  CHECK(!FolderLock::acquire(folder.path()).ok());
  REQUIRE(::kill(child, SIGKILL) == 0);
  ::waitpid(child, nullptr, 0);
  CHECK(!fs::is_empty(folder.path()));  // its file is still there, and says nothing
  CHECK(FolderLock::acquire(folder.path()).ok());
  CHECK(fs::is_empty(folder.path()));
  ::close(ready[0]);
  ::close(ready[1]);
}

}  // namespace
