// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/container/container.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

std::vector<std::byte> text_bytes(const std::string& text) {
  const auto bytes = std::as_bytes(std::span<const char>(text.data(), text.size()));
  return {bytes.begin(), bytes.end()};
}
Section section(const char (&kind)[5], const std::string& text, std::uint32_t chunk = 0) {
  Section result;
  result.entry.kind = four_characters(kind);
  result.entry.chunk = chunk;
  result.entry.items = text.size();
  result.bytes = text_bytes(text);
  return result;
}
std::vector<Section> three() {
  return {section("META", "numbers"), section("STRM", "", 0), section("STRM", "symbols", 1)};
}

/// Writes a number into a file and repairs the checksums of header and table: what a clever damage, not a random one,
/// looks like.
template <class T>
std::vector<std::byte> forged(std::vector<std::byte> file, std::size_t offset, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i)
    file[offset + i] = static_cast<std::byte>(static_cast<std::uint64_t>(value) >> (8 * i) & 255u);
  const auto repair = [&](std::size_t begin, std::size_t size) {
    if (begin + size + 4 > file.size()) return;
    const std::uint32_t crc = crc32c(std::span<const std::byte>(file).subspan(begin, size));
    for (std::size_t i = 0; i < 4; ++i) file[begin + size + i] = static_cast<std::byte>(crc >> (8 * i) & 255u);
  };
  repair(64, 3 * 48);
  repair(0, 60);
  return file;
}

TEST_CASE("container/container: what is written is read") {
  ContainerHeader header;
  header.profile = ContainerProfile::context_gs;
  header.numeric_spec = 7;
  header.flags = 5;
  header.digest = 0x0123456789ABCDEFull;
  const std::vector<std::byte> file = write_container(header, three());
  CHECK(file.size() == 64 + 3 * 48 + 4 + 7 + 0 + 7);
  const auto read = parse_container(file, "a.cmk");
  REQUIRE(read.ok());
  CHECK(read->header.profile == ContainerProfile::context_gs);
  CHECK(read->header.numeric_spec == 7);
  CHECK(read->header.flags == 5);
  CHECK(read->header.digest == 0x0123456789ABCDEFull);
  REQUIRE(read->sections.size() == 3);
  CHECK(read->sections[2].items == 7);
  const SectionEntry* entry = read->find(four_characters("STRM"), 0, 1);
  REQUIRE(entry != nullptr);
  const auto payload = read->payload(*entry);
  REQUIRE(payload.ok());
  CHECK(std::memcmp(payload->data(), "symbols", 7) == 0);
  CHECK(read->all(four_characters("STRM")).size() == 2);
  CHECK(read->find(four_characters("GEOM")) == nullptr);
  const auto empty = parse_container(write_container(header, {}), "a.cmk");
  REQUIRE(empty.ok());
  CHECK(empty->sections.empty());
}

TEST_CASE("container/container: the first bytes are those of the format") {
  const std::vector<std::byte> file = write_container({}, three());
  const unsigned char expected[] = {0x89, 'C', 'M', 'K', 0x0D, 0x0A, 0x1A, 0x0A, 1, 0, 0, 0, 64, 0, 0, 0};
  CHECK(std::memcmp(file.data(), expected, sizeof(expected)) == 0);
}

TEST_CASE("container/container: every flipped bit is found before a payload is believed") {
  const std::vector<std::byte> file = write_container({}, three());
  for (std::size_t i = 0; i < file.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::vector<std::byte> damaged = file;
      damaged[i] ^= static_cast<std::byte>(1 << bit);
      const auto read = parse_container(damaged, "a.cmk");
      bool found = !read.ok();
      if (read) {
        for (const SectionEntry& entry : read->sections) found = found || !read->payload(entry).ok();
      }
      REQUIRE(found);
    }
  }
}

TEST_CASE("container/container: every length but the right one is refused") {
  std::vector<std::byte> file = write_container({}, three());
  for (std::size_t n = 0; n < file.size(); ++n) {
    const auto read = parse_container(std::span<const std::byte>(file).first(n), "a.cmk");
    REQUIRE(!read.ok());
    CHECK(!read.error().remedy.empty());
  }
  file.push_back(std::byte{0});
  CHECK(!parse_container(file, "a.cmk").ok());
}

TEST_CASE("container/container: wrong magic, text-mode copies, other versions are named") {
  const std::vector<std::byte> file = write_container({}, three());
  const auto png = parse_container(text_bytes(std::string("\x89PNG\r\n\x1a\n", 8) + std::string(100, 'x')), "a.cmk");
  REQUIRE(!png.ok());
  CHECK(png.error().field == "magic");
  std::vector<std::byte> text_mode;  // CR LF became LF
  for (const std::byte byte : file) {
    if (byte != std::byte{0x0D}) text_mode.push_back(byte);
  }
  const auto copied = parse_container(text_mode, "a.cmk");
  REQUIRE(!copied.ok());
  CHECK(copied.error().problem.find("line ends") != std::string::npos);
  const auto newer = parse_container(forged<std::uint16_t>(file, 8, 2), "a.cmk");
  REQUIRE(!newer.ok());
  CHECK(newer.error().kind == ErrorKind::unsupported);
  CHECK(newer.error().problem.find("2.0") != std::string::npos);
  CHECK(newer.error().problem.find("1.") != std::string::npos);
  CHECK(parse_container(forged<std::uint16_t>(file, 10, 9), "a.cmk").ok());  // a higher minor version is read
}

TEST_CASE("container/container: forged counts and offsets are refused, whatever their checksums say") {
  const std::vector<std::byte> file = write_container({}, three());
  REQUIRE(parse_container(forged<std::uint8_t>(file, 8, 1), "a.cmk").ok());  // the control: forging nothing is no error
  const auto refused = [&](std::size_t offset, auto value) {
    const std::vector<std::byte> bytes = forged(file, offset, value);
    return !parse_container(bytes, "a.cmk").ok() && !parse_container(bytes, "a.cmk", true).ok();
  };
  CHECK(refused(12, std::uint32_t{48}));               // header size
  CHECK(refused(16, std::uint64_t{file.size() + 1}));  // file size
  CHECK(refused(16, ~std::uint64_t{0}));
  CHECK(refused(28, std::uint32_t{2}));  // section count
  CHECK(refused(28, std::uint32_t{65'537}));
  CHECK(refused(28, ~std::uint32_t{0}));
  CHECK(refused(32, std::uint64_t{65}));  // table of contents
  CHECK(refused(56, std::uint32_t{1}));   // reserved
  const std::size_t first = 64;
  CHECK(refused(first + 16, std::uint64_t{211}));  // a gap
  CHECK(refused(first + 16, ~std::uint64_t{0} - 3));
  CHECK(refused(first + 24, std::uint64_t{8}));           // an overlap
  CHECK(refused(first + 24, ~std::uint64_t{0}));          // a length that wraps
  CHECK(refused(first + 2 * 48 + 24, std::uint64_t{8}));  // behind the file
  CHECK(refused(first + 2 * 48 + 24, std::uint64_t{6}));  // a byte that no section covers
  CHECK(refused(first + 2 * 48 + 12, std::uint32_t{0}));  // the same name twice
}

TEST_CASE("container/container: garbage is refused") {
  const Random random(1, 0, random_stage("container test"));
  const std::vector<std::byte> file = write_container({}, three());
  for (std::uint64_t i = 0; i < 3000; ++i) {
    std::vector<std::byte> bytes(random.bits(2 * i) % 300);
    const Random letters(2, i, random_stage("container test"));
    for (std::size_t b = 0; b < bytes.size(); ++b) bytes[b] = static_cast<std::byte>(letters.bits(b) & 255u);
    if (i % 2 == 0) std::copy_n(file.begin(), std::min<std::size_t>(bytes.size(), 8 + i % 60), bytes.begin());
    REQUIRE(!parse_container(bytes, "a.cmk").ok());
  }
}

}  // namespace
