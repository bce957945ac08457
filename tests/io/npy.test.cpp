// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/io/npy.hpp>

#include <string>

#include "scene/cube_dialects.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

Result<NpyArray> parsed_npy(const std::string& text) {
  return parse_npy(std::as_bytes(std::span<const char>(text.data(), text.size())), "a.npy");
}
std::string with_header(const std::string& header, const std::string& body, char version = 1) {
  std::string text("\x93NUMPY", 6);
  text += version;
  text += '\0';
  text += static_cast<char>(header.size() & 255);
  text += static_cast<char>(header.size() >> 8);
  if (version > 1) text += std::string(2, '\0');
  return text + header + body;
}

}  // namespace

TEST_CASE("io/npy: shapes, types and versions") {
  const Result<NpyArray> plain = parsed_npy(npy_text("(2, 3)", {1, 2, 3, 4, 5, -6.5}));
  REQUIRE(plain.ok());
  CHECK(plain->shape == std::vector<std::size_t>{2, 3});
  CHECK(plain->values == std::vector<double>{1, 2, 3, 4, 5, -6.5});
  CHECK(parsed_npy(npy_text("(2,)", {1, 2}))->shape == std::vector<std::size_t>{2});
  CHECK(parsed_npy(npy_text("()", {7}))->values == std::vector<double>{7});
  CHECK(parsed_npy(npy_text("(0, 17)", {}))->values.empty());
  const std::string small = "{'shape': (3,), 'fortran_order': False, 'descr': '|u1'}";
  CHECK(parsed_npy(with_header(small, "\x01\x02\xFF"))->values == std::vector<double>{1, 2, 255});
  CHECK(parsed_npy(with_header(small, "\x01\x02\xFF", 2))->values == std::vector<double>{1, 2, 255});
  const float value = 0.25f;
  std::string four(4, '\0');
  std::memcpy(four.data(), &value, 4);
  CHECK(parsed_npy(with_header("{\"descr\": \"<f4\", \"fortran_order\": False, \"shape\": (1,)}", four))->values[0] ==
        0.25);
}

TEST_CASE("io/npy: what is not right is named, and no count is believed") {
  const auto error = [](const std::string& text) {
    const Result<NpyArray> array = parsed_npy(text);
    REQUIRE(!array.ok());
    return array.error();
  };
  CHECK(names(error(""), "a.npy", "byte 0", "copy"));
  CHECK(names(error("PK\x03\x04 and more"), "a.npy", "byte 0", "numpy.save"));
  CHECK(names(error(with_header("{}", "", 9)), "a.npy", "byte 6", "numpy.save"));
  CHECK(names(error(std::string("\x93NUMPY\x01\0\xFF\xFF{", 11)), "a.npy", "byte 8", "copy"));
  CHECK(names(error(npy_text("(1000000000, 1000000000, 1000000000)", {1})), "a.npy", "shape", "copy"));
  CHECK(names(error(npy_text("(3,)", {1, 2})), "a.npy", "shape", "copy"));
  CHECK(names(error(npy_text("()", {})), "a.npy", "shape", "copy"));  // found by fuzzing: one number that is not there
  CHECK(names(error(npy_text("(x,)", {1, 2})), "a.npy", "shape", "numpy.save"));
  CHECK(names(error(npy_text("(-1,)", {1, 2})), "a.npy", "shape", "numpy.save"));
  CHECK(names(error(npy_text("(1,1,1,1,1,1,1,1,1)", {1, 2})), "a.npy", "shape", "numpy.save"));
  CHECK(names(error(with_header("{'descr': '>f8', 'fortran_order': False, 'shape': (0,)}", "")), "a.npy", "descr",
              "float64"));
  CHECK(names(error(with_header("{'descr': '<f8', 'fortran_order': True, 'shape': (0,)}", "")), "a.npy",
              "fortran_order", "contiguous"));
  CHECK(names(error(with_header("{'descr': '<f8', 'fortran_order': False", "")), "a.npy", "shape", "numpy.save"));
  const std::string whole = npy_text("(2, 3)", {1, 2, 3, 4, 5, 6});
  for (std::size_t length = 0; length < whole.size(); ++length) CHECK(!parsed_npy(whole.substr(0, length)).ok());
}

TEST_CASE("io/npy: what is written is read as it was, in any type and shape, and the numbers begin at 64 bytes") {
  const auto round_trip = [](std::vector<std::size_t> shape, const auto& values) {
    using T = std::remove_cvref_t<decltype(values[0])>;
    const std::vector<std::byte> bytes = npy_bytes<T>(shape, std::span<const T>(values));
    CHECK((bytes.size() - values.size() * sizeof(T)) % 64 == 0);
    const Result<NpyArray> read = parse_npy(bytes, "a.npy");
    REQUIRE(read.ok());
    CHECK(read->shape == shape);
    REQUIRE(read->values.size() == values.size());
    for (std::size_t i = 0; i < values.size(); ++i) CHECK(read->values[i] == static_cast<double>(values[i]));
  };
  round_trip({2, 3}, std::vector<float>{1, -2, 0.1f, 1e30f, 0, 7});
  round_trip({4}, std::vector<double>{0.1, -1e300, 3, 5e-324});
  round_trip({2, 1, 1}, std::vector<std::int32_t>{-5, 1 << 30});
  round_trip({1}, std::vector<std::int64_t>{-(std::int64_t{1} << 52)});
  round_trip({3}, std::vector<std::uint8_t>{0, 128, 255});
  round_trip({}, std::vector<float>{2});
  round_trip({0, 5}, std::vector<float>{});
}
