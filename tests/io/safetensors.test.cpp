// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/safetensors.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

std::vector<std::byte> file_of(const std::string& header, std::size_t data_bytes,
                               std::size_t announced = std::string::npos) {
  const std::uint64_t size = announced == std::string::npos ? header.size() : announced;
  std::vector<std::byte> bytes(8 + header.size() + data_bytes);
  std::memcpy(bytes.data(), &size, 8);
  std::memcpy(bytes.data() + 8, header.data(), header.size());
  return bytes;
}

std::filesystem::path scratch_file(const char* name) {
  return std::filesystem::temp_directory_path() / (std::string("compmark_safetensors_") + name);
}

TEST_CASE("io/safetensors: what is written is read back, whatever the type; tensors are aligned to their element") {
  const std::array<float, 6> weights{1, -2, 3.5f, 0, std::numeric_limits<float>::infinity(), 1e-40f};
  const std::array<std::uint8_t, 3> mask{0, 7, 255};
  const std::array<std::int64_t, 2> counts{-5, std::numeric_limits<std::int64_t>::max()};
  SafetensorsWriter writer;
  writer.metadata = {{"kind", "test"}, {"json", "{\"a\": [1, \"\\u00e4\"]}"}};
  writer.add_values<std::uint8_t>("mask", {3}, mask);
  writer.add_values<float>("layer.weight", {2, 3}, weights);
  writer.add_copy<std::int64_t>("counts", {2}, std::vector<std::int64_t>(counts.begin(), counts.end()));
  writer.add_values<float>("empty", {0, 4}, std::span<const float>());
  writer.add_copy<double>("scalar", {}, std::array<double, 1>{0.1});
  const std::filesystem::path path = scratch_file("roundtrip");
  REQUIRE(writer.write(path).ok());
  const auto file = read_safetensors(path);
  REQUIRE(file.ok());
  CHECK(file->metadata == writer.metadata);
  CHECK(file->tensors.size() == 5);
  CHECK(file->floats("layer.weight", {2, 3}).value() == std::vector<float>(weights.begin(), weights.end()));
  CHECK(file->values<std::uint8_t>("mask").value() == std::vector<std::uint8_t>(mask.begin(), mask.end()));
  CHECK(file->values<std::int64_t>("counts").value() == std::vector<std::int64_t>(counts.begin(), counts.end()));
  CHECK(file->floats("empty").value().empty());
  CHECK(file->tensor("empty")->shape == std::vector<std::int64_t>{0, 4});
  CHECK(file->floats("scalar").value().at(0) == 0.1f);
  for (const auto& [name, tensor] : file->tensors) {
    if (tensor.data.empty()) continue;
    const auto offset = static_cast<std::size_t>(tensor.data.data() - file->tensors.at("counts").data.data());
    CHECK(offset % safetensors_element_size(tensor.dtype) == 0);
  }
  CHECK(!std::filesystem::exists(path.string() + ".partial"));
  std::filesystem::remove(path);
}

TEST_CASE("io/safetensors: same content, same bytes, in any order of adding") {
  const std::array<float, 2> a{1, 2};
  const std::array<std::int32_t, 1> b{3};
  SafetensorsWriter first, second;
  first.metadata = second.metadata = {{"z", "1"}, {"a", "2"}};
  first.add_values<float>("a", {2}, a);
  first.add_values<std::int32_t>("b", {1}, b);
  second.add_values<std::int32_t>("b", {1}, b);
  second.add_values<float>("a", {2}, a);
  REQUIRE(first.write(scratch_file("one")).ok());
  REQUIRE(second.write(scratch_file("two")).ok());
  CHECK(read_file(scratch_file("one")).value() == read_file(scratch_file("two")).value());
  CHECK(std::filesystem::file_size(scratch_file("one")) % 4 == 0);
  std::filesystem::remove(scratch_file("one"));
  std::filesystem::remove(scratch_file("two"));
}

TEST_CASE("io/safetensors: half and bfloat16 become the float they stand for, all 65536 halves") {
  std::size_t wrong = 0;
  for (std::uint32_t bits = 0; bits < 65536; ++bits) {
    const int exponent = static_cast<int>(bits >> 10 & 31u);
    const double mantissa = static_cast<double>(bits & 1023u);
    const double magnitude = exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
    const float value = detail::half_to_float(static_cast<std::uint16_t>(bits));
    if (exponent == 31) {
      wrong += mantissa == 0 ? !std::isinf(value) : !std::isnan(value);
    } else {
      wrong += static_cast<double>(value) != (bits >= 32768 ? -magnitude : magnitude);
    }
    wrong += std::signbit(value) != (bits >= 32768);
  }
  CHECK(wrong == 0);
  auto bytes = file_of(R"({"h":{"dtype":"BF16","shape":[1],"data_offsets":[0,2]}})", 2);
  bytes[bytes.size() - 2] = std::byte{0x80};
  bytes[bytes.size() - 1] = std::byte{0x3F};
  CHECK(parse_safetensors(bytes, "x")->floats("h").value().at(0) == 1.0f);
}

TEST_CASE("io/safetensors: every wrong count is one clear error") {
  struct Case {
    const char* header;
    std::size_t data;
    ErrorKind kind;
    const char* field;
  };
  const std::vector<Case> cases{
      {R"({"t":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}})", 7, ErrorKind::truncated, "t.data_offsets"},
      {R"({"t":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}})", 9, ErrorKind::malformed, "data_offsets"},
      {R"({"t":{"dtype":"F32","shape":[3],"data_offsets":[0,8]}})", 8, ErrorKind::malformed, "t.shape"},
      {R"({"t":{"dtype":"F32","shape":[-2],"data_offsets":[0,8]}})", 8, ErrorKind::malformed, "t.shape"},
      {R"({"t":{"dtype":"F32","shape":[4611686018427387904,4],"data_offsets":[0,8]}})", 8, ErrorKind::malformed,
       "t.shape"},
      {R"({"t":{"dtype":"F32","shape":[4611686018427387905,4],"data_offsets":[0,16]}})", 16, ErrorKind::malformed,
       "t.shape"},
      {R"({"t":{"dtype":"F32","shape":[1.5],"data_offsets":[0,8]}})", 8, ErrorKind::malformed, "t.shape"},
      {R"({"t":{"dtype":"F32","shape":2,"data_offsets":[0,8]}})", 8, ErrorKind::malformed, "t.shape"},
      {R"({"t":{"dtype":"F33","shape":[2],"data_offsets":[0,8]}})", 8, ErrorKind::unsupported, "t.dtype"},
      {R"({"t":{"dtype":[[[]]],"shape":[2],"data_offsets":[0,8]}})", 8, ErrorKind::unsupported, "t.dtype"},
      {R"({"t":{"dtype":"F32","shape":[2],"data_offsets":[8,0]}})", 8, ErrorKind::malformed, "t.data_offsets"},
      {R"({"t":{"dtype":"F32","shape":[2],"data_offsets":[-8,0]}})", 8, ErrorKind::malformed, "t.data_offsets"},
      {R"({"t":{"dtype":"F32","shape":[2],"data_offsets":[0]}})", 8, ErrorKind::malformed, "t.data_offsets"},
      {R"({"t":{"dtype":"F32","shape":[2]}})", 8, ErrorKind::malformed, "t"},
      {R"({"t":{"dtype":"F32","shape":[1],"data_offsets":[0,4]},"u":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}})",
       4, ErrorKind::malformed, "data_offsets"},
      {R"({"t":{"dtype":"F32","shape":[1],"data_offsets":[0,4]},"u":{"dtype":"F32","shape":[1],"data_offsets":[8,12]}})",
       12, ErrorKind::malformed, "data_offsets"},
      {R"({"t":{"dtype":"U8","shape":[1],"data_offsets":[0,1]},"t":{"dtype":"U8","shape":[1],"data_offsets":[0,1]}})",
       1, ErrorKind::malformed, "t"},
      {R"({"__metadata__":{"a":1}})", 0, ErrorKind::malformed, "__metadata__.a"},
      {R"({"__metadata__":[]})", 0, ErrorKind::malformed, "__metadata__"},
      {"[1]", 0, ErrorKind::malformed, "header"},
      {"{", 0, ErrorKind::malformed, "header"},
  };
  for (const Case& c : cases) {
    const auto result = parse_safetensors(file_of(c.header, c.data), "model.safetensors");
    CAPTURE(c.header);
    REQUIRE(!result.ok());
    CHECK(result.error().kind == c.kind);
    CHECK(result.error().field == c.field);
    CHECK(result.error().file == "model.safetensors");
    CHECK(!result.error().remedy.empty());
  }
  CHECK(parse_safetensors(file_of("{}", 0), "x").ok());
  CHECK(parse_safetensors(std::vector<std::byte>(7), "x").error().kind == ErrorKind::truncated);
  CHECK(parse_safetensors(file_of("{}", 0, 3), "x").error().kind == ErrorKind::truncated);
  CHECK(parse_safetensors(file_of("{}", 0, std::string::npos - 1), "x").error().kind == ErrorKind::malformed);
  CHECK(read_safetensors(scratch_file("nowhere")).error().kind == ErrorKind::not_found);
}

TEST_CASE(
    "io/safetensors: deep nesting, every truncation and random damage end in a value or an error, never in a crash") {
  CHECK(!parse_safetensors(file_of(std::string(200000, '['), 0), "x").ok());
  CHECK(
      !parse_safetensors(file_of("{\"t\":" + std::string(100000, '[') + std::string(100000, ']') + "}", 0), "x").ok());
  SafetensorsWriter writer;
  writer.metadata = {{"a", "b"}};
  const std::array<float, 4> values{1, 2, 3, 4};
  writer.add_values<float>("t", {2, 2}, values);
  writer.add_values<float>("u", {4}, values);
  REQUIRE(writer.write(scratch_file("damage")).ok());
  const std::vector<std::byte> good = read_file(scratch_file("damage")).value();
  std::filesystem::remove(scratch_file("damage"));
  for (std::size_t size = 0; size < good.size(); ++size) {
    CHECK(
        !parse_safetensors(std::vector<std::byte>(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)), "x")
             .ok());
  }
  const Random random(1, 0, random_stage("damage"));
  std::size_t survived = 0;
  for (std::uint64_t round = 0; round < 3000; ++round) {
    std::vector<std::byte> bad = good;
    for (std::uint64_t hit = 0; hit < 1 + round % 4; ++hit)
      bad[random.below(round * 8 + 2 * hit, bad.size())] = static_cast<std::byte>(random.bits(round * 8 + 2 * hit + 1));
    const auto result = parse_safetensors(bad, "x");
    if (!result.ok()) continue;
    for (const auto& [name, tensor] : result->tensors) survived += result->floats(name).ok() ? 1 : 0;
  }
  CHECK(survived > 0);  // damage to values alone is not visible to the format
}

TEST_CASE("io/safetensors: wrong use of a good file is named") {
  SafetensorsWriter writer;
  writer.add_copy<std::uint8_t>("t", {1}, std::array<std::uint8_t, 1>{1});
  REQUIRE(writer.write(scratch_file("use")).ok());
  const auto file = read_safetensors(scratch_file("use"));
  REQUIRE(file.ok());
  CHECK(file->floats("t").error().problem == "has dtype U8, expected a float type");
  CHECK(file->floats("other").error().problem == "no such tensor");
  CHECK(file->floats("t", {2, 3}).error().problem == "has shape [1], expected [2, 3]");
  CHECK(file->values<std::int64_t>("t").error().problem == "has dtype U8, expected I64");
  CHECK(file->text_of("absent").error().field == "__metadata__.absent");
  std::filesystem::remove(scratch_file("use"));
}

TEST_CASE("io/safetensors: the writer refuses contradictions") {
  const std::array<float, 2> values{1, 2};
  SafetensorsWriter shape;
  shape.add_values<float>("t", {3}, values);
  CHECK(shape.write(scratch_file("refused")).error().field == "t");
  SafetensorsWriter twice;
  twice.add_values<float>("t", {2}, values);
  twice.add_values<float>("t", {2}, values);
  CHECK(!twice.write(scratch_file("refused")).ok());
  SafetensorsWriter text;
  text.metadata = {{"a", "\xff"}};
  CHECK(!text.write(scratch_file("refused")).ok());
  CHECK(!std::filesystem::exists(scratch_file("refused")));
}

}  // namespace
