// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What is refused before anything is rendered. What is read after an attack is compared with pictures that the tool
// wrote in tests/tool/attack.test.cpp.
#include <doctest/doctest.h>
#include <compmark/app/compare.hpp>
#include <compmark/app/detail/attacked_views.hpp>

TEST_CASE("app/attacked_views: attacks need a key, a name of the list and a strength within its range") {
  using compmark::detail::check_attacks;
  CHECK(check_attacks({}, {}).ok());
  CHECK(check_attacks({"jpeg:50", "chat"}, "owner.key").ok());
  const auto line = [](const char* attack, const char* key) {
    const auto checked = check_attacks({attack}, key);
    return checked ? std::string() : checked.error().line();
  };
  CHECK(line("jpeg:50", "") == "--key: is missing; what is read after an attack needs a key");
  CHECK(line("poster", "owner.key").find("none of crop") != std::string::npos);
  CHECK(line("jpeg:0", "owner.key").find("no strength from 1 to 100") != std::string::npos);
}
