// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/json_shape.hpp"

#include <doctest/doctest.h>

#include <string>

namespace {

using namespace compmark;

std::string nested(std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); }

TEST_CASE("io/json_shape: depth, and names of the outermost object alone") {
  CHECK(json_shape("").depth == 0);
  CHECK(json_shape("{\"a\": [1, {\"b\": []}]}").depth == 4);
  CHECK(json_shape("{\"a]]\": \"[[\\\"[\"}").depth == 1);  // brackets in texts are none
  const JsonShape shape = json_shape("{\"a\": {\"a\": 1, \"x\": 2}, \"b\" : \"a\", \"c\": [\"d\"]}");
  CHECK(shape.keys == 3);
  CHECK(shape.repeated.empty());
  CHECK(json_shape("{\"a\": 1, \"b\": 2, \"a\": 3}").repeated == "a");
  CHECK(json_shape("]]}\"").depth == 0);
  CHECK(json_shape("\"\\").keys == 0);
}

TEST_CASE("io/json_shape: what is nested too deeply is not parsed, and looked at no further") {
  CHECK(!json_from(nested(json_depth_limit)).is_discarded());
  CHECK(json_from(nested(json_depth_limit + 1)).is_discarded());
  CHECK(json_shape(std::string(1000000, '[')).depth == json_depth_limit + 1);
}

}  // namespace
