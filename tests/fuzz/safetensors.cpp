// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as a safetensors file; every tensor of an accepted one is read.
#include <compmark/io/safetensors_reader.hpp>

#include <cstdint>
#include <cstdlib>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span<const std::uint8_t>(data, size));
  const auto file = compmark::parse_safetensors(std::vector<std::byte>(bytes.begin(), bytes.end()), "fuzz");
  if (!file) {
    if (file.error().problem.empty()) std::abort();
    return 0;
  }
  for (const auto& [name, tensor] : file->tensors) {
    static_cast<void>(file->values<float>(name));
    static_cast<void>(file->values<std::int64_t>(name));
  }
  return 0;
}
