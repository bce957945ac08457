// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/io/ply.hpp>

#include <algorithm>
#include <cstring>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

Result<PlyFile> parsed_ply(const std::string& text) {
  return parse_ply(std::as_bytes(std::span<const char>(text)), "test.ply");
}

/// The bytes of a value in the given order.
template <class T>
std::string raw(T value, bool big) {
  std::string text(sizeof(T), '\0');
  std::memcpy(text.data(), &value, sizeof(T));
  if (big) std::reverse(text.begin(), text.end());
  return text;
}

/// Two vertices with every scalar type, a list in between, and one face before them.
std::string every_type(bool big) {
  std::string text = std::string("ply\r\nformat ") + (big ? "binary_big_endian" : "binary_little_endian") +
                     " 1.0\r\ncomment made by hand\r\nobj_info ignored\r\nelement face 1\r\nproperty list uchar int "
                     "vertex_indices\r\nelement vertex 2\r\n"
                     "property char a\r\nproperty uint8 b\r\nproperty short c\r\nproperty list ushort float "
                     "extra\r\nproperty uint16 d\r\nproperty int e\r\n"
                     "property uint32 f\r\nproperty float x\r\nproperty float64 y\r\nend_header\r\n";
  text += raw(std::uint8_t{3}, big) + raw(0, big) + raw(1, big) + raw(2, big);
  for (int i = 0; i < 2; ++i) {
    text += raw(static_cast<std::int8_t>(-5 - i), big) + raw(static_cast<std::uint8_t>(250 + i), big) +
            raw(static_cast<std::int16_t>(-300 - i), big);
    text += raw(static_cast<std::uint16_t>(i), big);
    for (int k = 0; k < i; ++k) text += raw(9.5f, big);
    text += raw(static_cast<std::uint16_t>(65000 + i), big) + raw(-100000 - i, big) +
            raw(4000000000u + static_cast<unsigned>(i), big);
    text += raw(1.5f + static_cast<float>(i), big) + raw(1e-300 * (i + 1), big);
  }
  return text;
}

void check_every_type(const PlyFile& file) {
  const PlyElement* vertex = file.find("vertex");
  REQUIRE(vertex != nullptr);
  CHECK(vertex->count == 2);
  CHECK(file.find("face")->count == 1);
  CHECK(file.find("nothing") == nullptr);
  CHECK(vertex->find("extra") == nullptr);  // lists are skipped
  CHECK(vertex->column<int>("a") == std::vector<int>{-5, -6});
  CHECK(vertex->column<int>("b") == std::vector<int>{250, 251});
  CHECK(vertex->column<int>("c") == std::vector<int>{-300, -301});
  CHECK(vertex->column<int>("d") == std::vector<int>{65000, 65001});
  CHECK(vertex->column<int>("e") == std::vector<int>{-100000, -100001});
  CHECK(vertex->column<unsigned>("f") == std::vector<unsigned>{4000000000u, 4000000001u});
  CHECK(vertex->column<float>("x") == std::vector<float>{1.5f, 2.5f});
  CHECK(vertex->column<double>("y") == std::vector<double>{1e-300, 2e-300});
}

}  // namespace

TEST_CASE("io/ply: every scalar type in both byte orders, lists skipped, CRLF and comments accepted") {
  for (const bool big : {false, true}) {
    CAPTURE(big);
    const Result<PlyFile> file = parsed_ply(every_type(big));
    REQUIRE(file.ok());
    check_every_type(*file);
    CHECK(file->comments == std::vector<std::string>{"made by hand"});
  }
}

TEST_CASE("io/ply: ASCII with the same content reads the same") {
  const Result<PlyFile> file = parsed_ply(
      "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nelement vertex 2\nproperty char "
      "a\nproperty uint8 b\n"
      "property short c\nproperty list ushort float extra\nproperty uint16 d\nproperty int e\nproperty uint32 "
      "f\nproperty float x\nproperty float64 y\n"
      "end_header\n3 0 1 2\n-5 250 -300 0 65000 -100000 4000000000 1.5 1e-300\n\n  -6 251 -301 1 9.5 65001\t-100001 "
      "4000000001 +2.5 2e-300");
  REQUIRE(file.ok());
  check_every_type(*file);
}

TEST_CASE("io/ply: written columns read back bit for bit, strided or not") {
  const TemporaryFolder folder;
  std::vector<float> table(3 * 5000);
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = 1.0f / static_cast<float>(i + 1);
  const std::vector<PlyFloatColumn> columns{
      {"x", table.data(), 3}, {"second", table.data() + 1, 3}, {"flat", table.data(), 1}};
  const std::vector<std::string> comments{"SplatRenderMode: default"};
  REQUIRE(write_ply(folder.path() / "out.ply", 5000, columns, comments).ok());
  const Result<PlyFile> file = read_ply(folder.path() / "out.ply");
  REQUIRE(file.ok());
  CHECK(file->comments == comments);
  const PlyElement& vertex = file->elements.at(0);
  CHECK(vertex.stride == 12);
  const std::vector<float> x = vertex.column<float>("x");
  const std::vector<float> second = vertex.column<float>("second");
  const std::vector<float> flat = vertex.column<float>("flat");
  for (std::size_t i = 0; i < 5000; ++i) {
    CHECK(x[i] == table[3 * i]);
    CHECK(second[i] == table[3 * i + 1]);
    CHECK(flat[i] == table[i]);
  }
}

TEST_CASE("io/ply: a file cut anywhere is an error") {
  for (const bool big : {false, true}) {
    const std::string text = every_type(big);
    for (std::size_t length = 0; length < text.size(); ++length) {
      CAPTURE(length);
      const Result<PlyFile> file = parsed_ply(text.substr(0, length));
      REQUIRE(!file.ok());
      CHECK(!file.error().remedy.empty());
      CHECK(file.error().file == "test.ply");
    }
  }
}

TEST_CASE("io/ply: no count is believed, and each mistake of a header is named by its line") {
  const std::string start = "ply\nformat binary_little_endian 1.0\n";
  const auto error = [](const std::string& text) {
    const Result<PlyFile> file = parsed_ply(text);
    REQUIRE(!file.ok());
    return file.error();
  };
  CHECK(names(error("pla\n"), "test.ply", "line 1", "PLY file"));
  CHECK(names(error("ply\nend_header\n"), "test.ply", "header line 2", "export"));
  CHECK(names(error("ply\nformat binary_middle_endian 1.0\n"), "test.ply", "header line 2", "export"));
  CHECK(names(error(start + "property float x\n"), "test.ply", "header line 3", "export"));
  CHECK(names(error(start + "element vertex many\n"), "test.ply", "header line 3", "export"));
  CHECK(names(error(start + "element vertex -1\n"), "test.ply", "header line 3", "export"));
  CHECK(names(error(start + "element vertex 1\nproperty quad x\n"), "test.ply", "header line 4", "export"));
  CHECK(names(error(start + "element vertex 1\nproperty list float int x\n"), "test.ply", "header line 4", "export"));
  CHECK(names(error(start + "hello\n"), "test.ply", "header line 3", "export"));
  CHECK(names(error(start + "element vertex 1\n"), "test.ply", "header", "export"));
  // 2^60 rows of 4 bytes, of no bytes, and a list of 2^32 - 1 items: refused before any memory is taken.
  CHECK(names(error(start + "element vertex 1152921504606846976\nproperty float x\nend_header\n1234"), "test.ply",
              "vertex", "export"));
  CHECK(names(error(start + "element vertex 1152921504606846976\nend_header\n"), "test.ply", "vertex", "export"));
  CHECK(names(error(start + "element vertex 1\nproperty list uint double x\nend_header\n\xff\xff\xff\xff" + "12345678"),
              "test.ply", "vertex", "export"));
  const std::string ascii = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nend_header\n";
  CHECK(names(error(ascii + "1 2\n3   \n"), "test.ply", "row 1", "correct the line"));
  CHECK(names(error(ascii + "1 2\n3 four\n"), "test.ply", "row 1", "correct the line"));
  CHECK(names(error(ascii + "1 2\n"), "test.ply", "vertex", "export"));
}
