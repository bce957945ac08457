// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/run/differences.hpp>

TEST_CASE("app/run/differences: values are compared as values, and what differs is named with both") {
  using Json = compmark::Differences::Json;
  compmark::Differences differences;
  differences.values("--iterations", 30, 30);
  differences.values("--lambda", 0.5, Json::parse("5e-1"));
  differences.files("--key", Json(), Json());
  CHECK(differences.none());
  differences.values("--seed", 1, 2);
  differences.values("--background", Json(), "white");
  differences.files("--unmarked", "ab", Json());
  CHECK_FALSE(differences.none());
  CHECK(differences.text() == "--seed was 1 and is 2, --background was not set and is white, --unmarked was given");
}
