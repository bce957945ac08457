// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/io/npz.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

using namespace compmark;

namespace {

std::vector<NpzEntry> two_arrays() {
  const std::array<std::size_t, 2> shape{2, 3};
  const std::array<float, 6> values{1, 2, 3, 4, 5, -6.5f};
  const std::array<std::size_t, 1> bytes_shape{4};
  const std::array<std::uint8_t, 4> bytes{0, 1, 127, 255};
  return {{"render", npy_bytes<float>(shape, values)}, {"mask of view 2", npy_bytes<std::uint8_t>(bytes_shape, bytes)}};
}

}  // namespace

TEST_CASE("io/npz: arrays come back by name, and the checksum is that of ZIP") {
  const std::string digits = "123456789";  // the check value of this CRC
  CHECK(detail::zip_checksum(std::as_bytes(std::span<const char>(digits.data(), digits.size()))) == 0xCBF43926U);
  const auto path = std::filesystem::temp_directory_path() / "compmark_test_arrays.npz";
  REQUIRE(write_npz(path, two_arrays()).ok());
  const auto read = read_npz(path);
  REQUIRE_MESSAGE(read.ok(), read.error().line());
  REQUIRE(read->size() == 2);
  CHECK((*read)[0].name == "render");
  CHECK((*read)[0].array.shape == std::vector<std::size_t>{2, 3});
  CHECK((*read)[0].array.values == std::vector<double>{1, 2, 3, 4, 5, -6.5});
  CHECK((*read)[1].name == "mask of view 2");
  CHECK((*read)[1].array.values == std::vector<double>{0, 1, 127, 255});
  std::filesystem::remove(path);
  const auto none = npz_bytes({});
  REQUIRE(none.ok());
  CHECK(parse_npz(*none, "none")->empty());
}

TEST_CASE("io/npz: every cut and every wrong bit is refused or changes nothing") {
  const std::vector<std::byte> good = *npz_bytes(two_arrays());
  for (std::size_t size = 0; size < good.size(); ++size)
    CHECK_FALSE(parse_npz(std::span<const std::byte>(good).first(size), "cut").ok());
  std::size_t refused = 0;
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    std::vector<std::byte> bad = good;
    bad[bit / 8] ^= std::byte{1} << (bit % 8);
    const auto read = parse_npz(bad, "bad");
    refused += read.ok() ? 0 : 1;
    if (!read.ok()) continue;
    // What is not looked at: dates, versions, names. The numbers are what they were.
    for (const NpzArray& one : *read) {
      const bool first = one.array.shape.size() == 2;
      CHECK(one.array.values ==
            (first ? std::vector<double>{1, 2, 3, 4, 5, -6.5} : std::vector<double>{0, 1, 127, 255}));
    }
  }
  CHECK(refused > 8 * good.size() / 2);
  std::vector<std::byte> packed = good;  // as numpy.savez_compressed
  for (std::size_t i = 0; i + 4 < packed.size(); ++i) {
    if (detail::zip_number(packed, i, 4) == detail::zip_central) packed[i + 10] = std::byte{8};
  }
  const auto compressed = parse_npz(packed, "packed.npz");
  REQUIRE(!compressed.ok());
  CHECK(compressed.error().line() ==
        "packed.npz: entry 1: is compressed or encrypted; save the arrays with numpy.savez, not savez_compressed");
}

TEST_CASE("io/npz: entries that share their bytes are refused: they would take more memory than the file") {
  const std::array<std::size_t, 1> shape{500};
  const std::vector<double> values(500, 1.5);
  const std::vector<std::byte> one = *npz_bytes(std::vector<NpzEntry>{{"a", npy_bytes<double>(shape, values)}});
  const std::size_t end = one.size() - detail::zip_end_size, begin = detail::zip_number(one, end + 16, 4);
  REQUIRE(parse_npz(one, "one.npz").ok());  // the control
  std::vector<std::byte> twice(one.begin(), one.begin() + static_cast<std::ptrdiff_t>(end));
  twice.insert(twice.end(), one.begin() + static_cast<std::ptrdiff_t>(begin), one.end());
  const std::size_t at = twice.size() - detail::zip_end_size, size = 2 * (end - begin);
  twice[at + 8] = twice[at + 10] = std::byte{2};
  twice[at + 12] = static_cast<std::byte>(size & 255);
  twice[at + 13] = static_cast<std::byte>(size >> 8);
  const auto shared = parse_npz(twice, "twice.npz");
  REQUIRE(!shared.ok());
  CHECK(shared.error().line() == "twice.npz: entry 2: lies where another entry does; copy the file again");
}
