// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/json_file.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>

namespace {

using namespace compmark;

const std::filesystem::path json_path = std::filesystem::temp_directory_path() / "compmark_json_file.json";

TEST_CASE("io/json_file: what is written is read back, numbers to the last bit, no number that is not finite") {
  const nlohmann::json json{{"b", 0.1}, {"a", {1, 2, 3}}, {"c", "ä"}, {"nan", std::nan("")}};
  REQUIRE(write_json(json_path, json).ok());
  const auto back = read_json(json_path);
  REQUIRE(back.ok());
  CHECK((*back)["b"].get<double>() == 0.1);
  CHECK((*back)["nan"].is_null());
  CHECK((*back)["c"] == "ä");
  std::filesystem::remove(json_path);
}

TEST_CASE("io/json_file: a mistake is named by line and column") {
  REQUIRE(write_file(json_path, std::string_view("{\n  \"a\": 1,\n  \"b\": oops\n}\n")).ok());
  const auto result = read_json(json_path);
  REQUIRE(!result.ok());
  CHECK(result.error().kind == ErrorKind::malformed);
  CHECK(result.error().field == "line 3 column 8");
  CHECK(result.error().file == json_path.string());
  REQUIRE(write_file(json_path, std::string_view("")).ok());
  CHECK(read_json(json_path).error().kind == ErrorKind::truncated);
  REQUIRE(write_file(json_path, std::string_view("{\"a\": [1, 2")).ok());
  CHECK(!read_json(json_path).ok());
  std::filesystem::remove(json_path);
  CHECK(read_json(json_path).error().kind == ErrorKind::not_found);
}

TEST_CASE("io/json_file: fields have the type asked for, or the error names them") {
  const nlohmann::json json{
      {"n", 7}, {"x", 1.5}, {"s", "t"}, {"f", true}, {"big", 1e300}, {"minus", -1}, {"wide", std::uint64_t{1} << 63}};
  CHECK(json_field<int>(json, "n", "f").value() == 7);
  CHECK(json_field<double>(json, "n", "f").value() == 7);
  CHECK(json_field<double>(json, "x", "f").value() == 1.5);
  CHECK(json_field<std::string>(json, "s", "f").value() == "t");
  CHECK(json_field<bool>(json, "f", "f").value());
  CHECK(json_field<std::uint64_t>(json, "wide", "f").value() == std::uint64_t{1} << 63);
  CHECK(json_field<float>(json, "big", "f").error().problem == "is not finite");
  CHECK(!json_field<int>(json, "x", "f").ok());
  CHECK(!json_field<std::uint32_t>(json, "minus", "f").ok());
  CHECK(!json_field<std::int64_t>(json, "wide", "f").ok());
  CHECK(!json_field<bool>(json, "n", "f").ok());
  CHECK(!json_field<double>(json, "s", "f").ok());
  CHECK(json_field<int>(json, "absent", "file.json", "frames[3]").error().field == "frames[3].absent");
  CHECK(!json_field<int>(nlohmann::json::array(), "n", "f").ok());
}

}  // namespace

TEST_CASE("io/json_file: a number no double can hold is an error, not an exception") {
  const std::filesystem::path huge = std::filesystem::temp_directory_path() / "compmark-json-huge.json";
  REQUIRE(compmark::write_file(huge, std::string_view("{\"x\": 1e999}")).ok());
  const auto read = compmark::read_json(huge);
  REQUIRE(!read.ok());
  CHECK(read.error().file == huge.string());
  std::filesystem::remove(huge);
}
