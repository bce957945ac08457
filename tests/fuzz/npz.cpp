// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as an .npz file: an answer, never a crash, and never more numbers than bytes.
#include <compmark/io/npz.hpp>

#include <cstddef>
#include <cstdint>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto arrays = compmark::parse_npz(std::as_bytes(std::span<const std::uint8_t>(data, size)), "fuzz");
  std::size_t numbers = 0;
  if (arrays) {
    for (const compmark::NpzArray& one : *arrays) numbers += one.array.values.size();
  }
  if (numbers > size) std::abort();
  if (!arrays && (arrays.error().problem.empty() || arrays.error().remedy.empty())) std::abort();
  return 0;
}
