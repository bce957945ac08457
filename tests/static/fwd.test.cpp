// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// fwd.hpp declares what the headers define: in this order a wrong class-key or parameter list does not compile.
#include "compmark/fwd.hpp"

#include <doctest/doctest.h>

#include "compmark/compmark.hpp"

TEST_CASE("static/fwd: forward declarations match the definitions, and the version is one") {
  CHECK(compmark::version_major == 0);
  CHECK(std::string(compmark::version) == std::to_string(compmark::version_major) + "." +
                                              std::to_string(compmark::version_minor) + "." +
                                              std::to_string(compmark::version_patch));
}
