// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Random damage of files, and the law for files of ours: damage is an error, or changes nothing that is read.
// COMPMARK_CORRUPTIONS says how often each kind is tried, for a campaign (5000); 100 times otherwise.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/io/checksum.hpp>
#include <compmark/io/safetensors.hpp>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <span>
#include <string>
#include <vector>

namespace compmark::testing {

using FileBytes = std::vector<std::byte>;

/// Written as it is, without the care of our own writers: a campaign writes thousands.
inline void put_raw(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  REQUIRE(file.good());
}

inline int corruptions() {
  const char* text = std::getenv("COMPMARK_CORRUPTIONS");
  return text != nullptr ? std::atoi(text) : 100;
}

/// One damage of `good`: a bit, a byte, a run of bytes, the end cut off, bytes behind it, two blocks exchanged, zeros.
/// Half of them lie in the first `header` bytes.
inline FileBytes damaged(const FileBytes& good, std::size_t header, std::mt19937& random) {
  FileBytes bytes = good;
  const auto below = [&](std::size_t limit) { return static_cast<std::size_t>(random()) % limit; };
  const auto from = [&](std::size_t i) { return bytes.begin() + static_cast<std::ptrdiff_t>(i); };
  while (bytes == good || bytes.empty()) {
    bytes = good;
    const std::size_t at = below(header != 0 && random() % 2 == 0 ? header : bytes.size());
    switch (random() % 7) {
      case 0:
        bytes[at] ^= static_cast<std::byte>(1u << random() % 8);
        break;
      case 1:
        bytes[at] = static_cast<std::byte>(random());
        break;
      case 2:
        std::generate(from(at), from(std::min(bytes.size(), at + 1 + below(16))),
                      [&] { return static_cast<std::byte>(random()); });
        break;
      case 3:
        bytes.resize(at);
        break;
      case 4: {
        const std::size_t count = 1 + below(64);
        for (std::size_t i = 0; i < count; ++i)
          bytes.push_back(random() % 2 == 0 ? good[below(good.size())] : static_cast<std::byte>(random()));
        break;
      }
      case 5: {
        const std::size_t size = std::min<std::size_t>(std::size_t{1} << below(10), bytes.size() / 2);
        const std::size_t first = std::min(at, bytes.size() - size), second = below(bytes.size() - size + 1);
        if (first + size <= second || second + size <= first)
          std::swap_ranges(from(first), from(first + size), from(second));
        break;
      }
      default:
        std::fill(from(at), from(std::min(bytes.size(), at + (std::size_t{1} << below(12)))), std::byte{0});
    }
  }
  return bytes;
}

struct DamageCount {
  int refused = 0, same = 0, other = 0;
};
enum class Reading { refused, same, other };

/// What `read(bytes)` (a Reading) says of `count` damages of a file.
template <class Read>
DamageCount count_damage(const FileBytes& good, std::size_t header, int count, const Read& read) {
  std::mt19937 random(static_cast<unsigned>(good.size()));
  DamageCount result;
  for (int i = 0; i < count; ++i) {
    const Reading reading = read(damaged(good, header, random));
    ++(reading == Reading::refused ? result.refused : reading == Reading::same ? result.same : result.other);
  }
  return result;
}

/// The law, with its figures.
template <class Read>
void check_damage(const std::string& kind, const FileBytes& good, std::size_t header, const Read& read) {
  REQUIRE(read(good) == Reading::same);
  const DamageCount count = count_damage(good, header, corruptions(), read);
  MESSAGE(kind << ", " << good.size() << " bytes: " << count.refused << " refused, " << count.same << " read the same, "
               << count.other << " read as another");
  CHECK(count.other == 0);
  CHECK(count.refused + count.same == corruptions());
}

/// The same tensors, types, shapes and metadata.
[[nodiscard]] inline bool same_content(const SafetensorsFile& a, const SafetensorsFile& b) {
  return a.metadata == b.metadata && std::equal(a.tensors.begin(), a.tensors.end(), b.tensors.begin(), b.tensors.end(),
                                                [](const auto& x, const auto& y) {
                                                  return x.first == y.first && x.second.dtype == y.second.dtype &&
                                                         x.second.shape == y.second.shape &&
                                                         std::ranges::equal(x.second.data, y.second.data);
                                                });
}

/// A tensor file as it was before there were checksums: blanks in the place of its own.
[[nodiscard]] inline FileBytes without_checksum(FileBytes bytes) {
  const std::string text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::string name = "\"checksum\":\"";
  const std::size_t begin = text.find(name), end = text.find('"', begin + name.size());
  REQUIRE(begin != std::string::npos);
  std::size_t first = begin, last = end + 1;
  if (text[last] == ',') {
    ++last;
  } else if (text[first - 1] == ',') {
    --first;
  }
  std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(first), bytes.begin() + static_cast<std::ptrdiff_t>(last),
            std::byte{' '});
  return bytes;
}

/// The law for a tensor file that `accepts(file, bytes)`, a reader of its kind, takes; and that without its checksum it
/// does not hold.
template <class Accepts>
void check_tensor_damage(const std::string& kind, const FileBytes& good, const Accepts& accepts) {
  std::uint64_t header = 0;
  std::copy_n(good.begin(), sizeof(header), reinterpret_cast<std::byte*>(&header));
  const auto whole = parse_safetensors(good, "good");
  REQUIRE(whole.ok());
  const auto read = [&](const FileBytes& bytes) {
    const auto file = parse_safetensors(bytes, "damaged");
    if (!file || !accepts(*file, bytes)) return Reading::refused;
    return same_content(*file, *whole) ? Reading::same : Reading::other;
  };
  check_damage(kind, good, 8 + static_cast<std::size_t>(header), read);
  const FileBytes bare = without_checksum(good);
  REQUIRE(read(bare) == Reading::same);
  const DamageCount count = count_damage(bare, 0, 200, read);
  MESSAGE(kind << " without its checksum: " << count.other << " of 200 read as another");
  CHECK(count.other > 20);
}

}  // namespace compmark::testing
