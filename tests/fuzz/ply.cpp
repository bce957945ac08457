// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as a PLY file; what is accepted is read column by column.
#include <compmark/io/ply.hpp>

#include <cstdint>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = compmark::parse_ply(std::as_bytes(std::span<const std::uint8_t>(data, size)), "fuzz");
  if (!file) {
    if (file.error().problem.empty()) std::abort();
    return 0;
  }
  if (const auto* vertex = file->find("vertex")) {
    for (const char* name : {"x", "y", "z", "red"}) {
      if (vertex->find(name) != nullptr && vertex->column<double>(name).size() != vertex->count) std::abort();
    }
  }
  return 0;
}
