// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "common.hpp"

#include <compmark/io/atomic_file.hpp>
#include <cstdio>
#include <system_error>

namespace tool {

int fail(const compmark::Error& error) {
  std::fprintf(stderr, "compmark: error: %s\n", error.line().c_str());
  return failure;
}

void tell_threads(const compmark::ThreadExecutor& executor, std::size_t wanted) {
  static bool told = false;
  if (told || executor.concurrency() >= wanted) return;
  told = true;
  std::fprintf(stderr,
               "compmark: warning: the system allows %zu of the %zu threads that --threads asks "
               "for\n",
               executor.concurrency(), wanted);
}

std::string default_recipe(std::string_view profile) {
  if (profile == "official") return "compmark-host";
  if (profile == "paper") return "compmark-paper-host";
  return "scaffold";
}

std::string base_name(const std::filesystem::path& path) {
  std::filesystem::path clean = path.lexically_normal();
  if (!clean.has_filename()) clean = clean.parent_path();
  return clean.filename().string();
}

compmark::Result<compmark::Done> make_folder(const std::filesystem::path& path) {
  std::error_code status;
  std::filesystem::create_directories(path, status);
  if (status || !std::filesystem::is_directory(path)) {
    return compmark::Error{compmark::ErrorKind::unwritable, path.string(), "--out",
                           "the folder cannot be created: " + status.message(), "choose a place you may write to"};
  }
  if (!compmark::AtomicFile::create(path / ".compmark-probe")) {  // never committed: nothing of it stays
    return compmark::Error{compmark::ErrorKind::unwritable, path.string(), "--out",
                           "no file can be written in this folder", "change its permissions or choose another"};
  }
  return compmark::Done{};
}

}  // namespace tool
