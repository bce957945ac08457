// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/atomic_file.hpp"

#include <doctest/doctest.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

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

// Runs `body` in a child process, whose exit status it gives: limits and signals concern nobody else.
template <class Body>
int in_child(const Body& body) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(body());
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

TEST_CASE("io/atomic_file: a size limit is an error that leaves the old file, with the signal's default action too") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.txt";
  REQUIRE(write_file(path, std::string_view("old")).ok());
  for (const std::size_t size : {std::size_t{5000}, std::size_t{500000}}) {  // through the buffer and past it
    const int status = in_child([&] {
      const rlimit limit{1000, 1000};
      ::setrlimit(RLIMIT_FSIZE, &limit);
      const auto result = write_file(path, std::string(size, 'x'));
      if (result.ok()) return 1;
      return result.error().problem.find("too large") != std::string::npos && !result.error().remedy.empty() ? 0 : 2;
    });
    CHECK(status == 0);
    CHECK(read_back(path) == "old");
    CHECK(files_in(folder) == 1);
  }
}

TEST_CASE("io/atomic_file: two writers of one target never mix; the last one to finish wins, whole") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.txt";
  auto first = AtomicFile::create(path), second = AtomicFile::create(path);
  REQUIRE(first.ok());
  REQUIRE(second.ok());
  first->write(std::string(100000, '1'));
  second->write(std::string_view("2"));
  CHECK(files_in(folder) == 2);
  REQUIRE(second->commit().ok());
  CHECK(read_back(path) == "2");
  REQUIRE(first->commit().ok());
  CHECK(read_back(path) == std::string(100000, '1'));
  CHECK(files_in(folder) == 1);
}

TEST_CASE("io/atomic_file: of two writers of a new file, the first to finish has it, and the other is told") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.txt";
  auto first = AtomicFile::create(path), second = AtomicFile::create(path);
  REQUIRE(first.ok());
  REQUIRE(second.ok());
  first->write(std::string_view("1"));
  second->write(std::string_view("2"));
  REQUIRE(second->commit_new().ok());
  const Result<Done> late = first->commit_new();
  REQUIRE_FALSE(late.ok());
  CHECK(late.error().problem.find("exists") != std::string::npos);
  CHECK(read_back(path) == "2");
  CHECK(files_in(folder) == 1);
}

TEST_CASE("io/atomic_file: many processes at once leave one whole file of one of them") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.txt";
  std::vector<pid_t> children;
  for (char name = 'a'; name < 'g'; ++name) {
    const pid_t child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      int failures = 0;
      for (int i = 0; i < 40; ++i) failures += write_file(path, std::string(70000, name)).ok() ? 0 : 1;
      ::_exit(failures);
    }
    children.push_back(child);
  }
  for (const pid_t child : children) {
    int status = -1;
    ::waitpid(child, &status, 0);
    CHECK(status == 0);
  }
  const std::string text = read_back(path);
  CHECK(text == std::string(70000, text.at(0)));
  CHECK(files_in(folder) == 1);
}

TEST_CASE("io/atomic_file: what a killed writer left is removed by the next one, what a living one holds is not") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.txt";
  const auto killed = [&] {
    return in_child([&] {
      auto file = AtomicFile::create(path);
      file->write(std::string(100000, 'x'));
      return ::kill(::getpid(), SIGKILL);
    });
  };
  for (int i = 0; i < 3; ++i) {
    CHECK(killed() == 128 + SIGKILL);
    CHECK(files_in(folder) == 1);  // not one more each time
    CHECK(std::filesystem::exists(path.string() + ".partial-1"));
  }
  CHECK(!std::filesystem::exists(path));
  auto living = AtomicFile::create(path);
  REQUIRE(living.ok());
  CHECK(killed() == 128 + SIGKILL);
  CHECK(files_in(folder) == 2);
  living->write(std::string_view("whole"));
  CHECK(living->commit().ok());
  CHECK(read_back(path) == "whole");
  REQUIRE(write_file(path, std::string_view("again")).ok());
  // A file of somebody else's that bears such a name (here a folder and a link) is left alone.
  std::filesystem::remove(path.string() + ".partial-2");
  std::filesystem::create_directory(path.string() + ".partial-1");
  std::filesystem::create_symlink(path, path.string() + ".partial-2");
  REQUIRE(write_file(path, std::string_view("third")).ok());
  CHECK(read_back(path) == "third");
  CHECK(files_in(folder) == 3);
}

TEST_CASE("io/atomic_file: a replaced file keeps its mode, a new one follows the request and the umask") {
  const TemporaryFolder folder;
  const auto mode = [&](const char* name) {
    return static_cast<unsigned>(std::filesystem::status(folder.path() / name).permissions());
  };
  const mode_t before = ::umask(027);
  REQUIRE(write_file(folder.path() / "new", std::string_view("x")).ok());
  REQUIRE(write_file(folder.path() / "key", std::string_view("x"), 0600).ok());
  ::umask(before);
  CHECK(mode("new") == 0640);
  CHECK(mode("key") == 0600);
  for (const auto kept : {0604u, 0444u, 0755u}) {
    std::filesystem::permissions(folder.path() / "new", static_cast<std::filesystem::perms>(kept));
    REQUIRE(write_file(folder.path() / "new", std::string_view("y")).ok());
    CHECK(mode("new") == kept);
  }
}

TEST_CASE(
    "io/atomic_file: a symbolic link stays and its file is replaced; a hard link's other name keeps the old file") {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "file", link = folder.path() / "link";
  REQUIRE(write_file(file, std::string_view("old")).ok());
  std::filesystem::create_symlink("file", link);
  std::filesystem::create_hard_link(file, folder.path() / "other");
  REQUIRE(write_file(link, std::string_view("new")).ok());
  CHECK(std::filesystem::is_symlink(link));
  CHECK(read_back(file) == "new");
  CHECK(read_back(folder.path() / "other") == "old");
  std::filesystem::create_symlink("later", folder.path() / "dangling");
  REQUIRE(write_file(folder.path() / "dangling", std::string_view("made")).ok());
  CHECK(std::filesystem::is_symlink(folder.path() / "dangling"));
  CHECK(read_back(folder.path() / "later") == "made");
}

TEST_CASE("io/atomic_file: devices and pipes are written through and stay what they are") {
  const TemporaryFolder folder;
  REQUIRE(write_file("/dev/null", std::string_view("x")).ok());
  CHECK(std::filesystem::is_character_file("/dev/null"));
  const auto full = write_file("/dev/full", std::string_view("x"));
  REQUIRE(!full.ok());
  CHECK(full.error().problem.find("No space") != std::string::npos);
  const std::filesystem::path pipe = folder.path() / "pipe";
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  const std::string text(300000, 'x');  // more than a pipe holds: the writer waits
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    const int reader = ::open(pipe.c_str(), O_RDONLY);
    std::vector<char> buffer(text.size() + 1);
    std::size_t got = 0;
    for (ssize_t n = 1; n > 0; got += static_cast<std::size_t>(n)) n = ::read(reader, buffer.data(), buffer.size());
    ::_exit(got == text.size() ? 0 : 1);
  }
  CHECK(check_writable(pipe).ok());  // asking does not open it
  auto file = AtomicFile::create(pipe);
  REQUIRE(file.ok());
  CHECK(file->is_stream());
  file->write(text);
  CHECK(file->commit().ok());
  int status = -1;
  ::waitpid(child, &status, 0);
  CHECK(status == 0);
  CHECK(std::filesystem::is_fifo(pipe));
  CHECK(files_in(folder) == 1);
}

TEST_CASE(
    "io/atomic_file: a pipe without a reader, or whose reader has gone, is an error, with the signal's default action "
    "too") {
  const TemporaryFolder folder;
  const std::filesystem::path pipe = folder.path() / "pipe";
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  const auto nobody = write_file(pipe, std::string_view("x"));
  REQUIRE(!nobody.ok());
  CHECK(nobody.error().problem.find("nobody reads") != std::string::npos);
  int ends[2];
  REQUIRE(::pipe(ends) == 0);
  const std::filesystem::path name = "/dev/fd/" + std::to_string(ends[1]);
  CHECK(write_file(name, std::string_view("x")).ok());  // the pipe's buffer takes it
  ::close(ends[0]);
  const int status = in_child([&] {
    const auto gone = write_file(name, std::string_view("x"));
    return !gone.ok() && gone.error().problem.find("reader has gone") != std::string::npos ? 0 : 1;
  });
  CHECK(status == 0);
  ::close(ends[1]);
}

TEST_CASE("io/atomic_file: a descriptor is written at its own place") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.txt";
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT, 0600);
  REQUIRE(::write(descriptor, "one ", 4) == 4);
  REQUIRE(write_file("/dev/fd/" + std::to_string(descriptor), std::string_view("two ")).ok());
  REQUIRE(::write(descriptor, "three", 5) == 5);
  ::close(descriptor);
  CHECK(read_back(path) == "one two three");
  CHECK(!write_file("/dev/fd/" + std::to_string(descriptor), std::string_view("x")).ok());  // closed
}

TEST_CASE("io/atomic_file: a name near the limit of the file system has a partial file all the same") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / std::string(255, 'n');
  REQUIRE(write_file(path, std::string_view("x")).ok());
  CHECK(read_back(path) == "x");
}

TEST_CASE("io/atomic_file: whether a place can be written is asked without a trace") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "a.txt";
  CHECK(check_writable(path).ok());
  CHECK(files_in(folder) == 0);
  REQUIRE(write_file(path, std::string_view("old")).ok());
  CHECK(check_writable(path).ok());
  CHECK(read_back(path) == "old");
  CHECK(!check_writable(folder.path()).ok());
  CHECK(!check_writable(folder.path() / "none" / "a").ok());
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
