// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as an .npy file: an answer, never a crash, and never more numbers than bytes.
#include <compmark/io/npy.hpp>

#include <cstdint>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto array = compmark::parse_npy(std::as_bytes(std::span<const std::uint8_t>(data, size)), "fuzz");
  if (array && array->values.size() > size) std::abort();
  if (!array && (array.error().problem.empty() || array.error().remedy.empty())) std::abort();
  return 0;
}
