// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "common.hpp"

#include <cstdio>

namespace tool {

int fail(const compmark::Error& error) {
  std::fprintf(stderr, "compmark: error: %s\n", error.line().c_str());
  return failure;
}

void print_warning(const std::string& sentence) { std::fprintf(stderr, "compmark: warning: %s\n", sentence.c_str()); }

void print_note(const std::string& sentence) { std::fprintf(stderr, "compmark: %s\n", sentence.c_str()); }

void tell_threads(const compmark::ThreadExecutor& executor, std::size_t wanted) {
  static bool told = false;
  if (told || executor.concurrency() >= wanted) return;
  told = true;
  std::fprintf(stderr,
               "compmark: warning: the system allows %zu of the %zu threads that --threads asks "
               "for\n",
               executor.concurrency(), wanted);
}

std::string base_name(const std::filesystem::path& path) {
  std::filesystem::path clean = path.lexically_normal();
  if (!clean.has_filename()) clean = clean.parent_path();
  return clean.filename().string();
}

}  // namespace tool
