// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as a .cmk file: an answer, never a crash; and as the header and table of contents of one whose checksums
// are right, because a fuzzer does not guess checksums. What is accepted lies inside the file and tiles it.
#include <compmark/codec/container/inspect.hpp>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace {

void look(std::span<const std::byte> bytes) {
  const auto file = compmark::parse_container(bytes, "fuzz");
  if (!file) {
    if (file.error().problem.empty() || file.error().remedy.empty()) std::abort();
  } else {
    std::uint64_t reached = 64 + 48 * file->sections.size() + 4;
    for (const compmark::SectionEntry& entry : file->sections) {
      if (entry.offset != reached) std::abort();
      reached += entry.size;
      (void)file->payload(entry);
    }
    if (reached != bytes.size()) std::abort();
  }
  // Accepted as the beginning of a file: what has arrived lies inside the bytes.
  const auto begun = compmark::parse_container(bytes.first(bytes.size() - bytes.size() / 4), "fuzz", true);
  for (std::size_t i = 0; begun && i < begun->sections.size(); ++i) (void)begun->payload(begun->sections[i]);
  const auto info = compmark::inspect_cmk(bytes, "fuzz");
  if (!info && (info.error().problem.empty() || info.error().remedy.empty())) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span<const std::byte> bytes = std::as_bytes(std::span<const std::uint8_t>(data, size));
  look(bytes);
  if (size < 64) return 0;
  std::vector<std::byte> repaired(bytes.begin(), bytes.end());
  const auto repair = [&](std::size_t begin, std::size_t count) {
    if (begin > repaired.size() || count > repaired.size() - begin || repaired.size() - begin - count < 4) return;
    const std::uint32_t crc = compmark::crc32c(std::span<const std::byte>(repaired).subspan(begin, count));
    for (std::size_t i = 0; i < 4; ++i) repaired[begin + count + i] = static_cast<std::byte>(crc >> (8 * i) & 255u);
  };
  const std::size_t sections = data[28] | static_cast<std::size_t>(data[29]) << 8;
  repair(64, 48 * sections);
  repair(0, 60);
  look(repaired);
  return 0;
}
