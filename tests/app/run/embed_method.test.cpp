// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/app/run/embed_method.hpp"

#include <doctest/doctest.h>

#include <set>
#include <string>

using namespace compmark;

TEST_CASE("app/run/embed_method: a name is one method's, and no other word is a name") {
  std::set<EmbedMethod> methods;
  for (const std::string_view name : embed_method_names) {
    const auto method = embed_method(name);
    REQUIRE(method.has_value());
    CHECK(name_of(*method) == name);
    methods.insert(*method);
  }
  CHECK(methods.size() == embed_method_names.size());
  CHECK(name_of(EmbedMethod::compmark) == "compmark");
  CHECK(name_of(EmbedMethod::guardsplat) == "guardsplat");
  CHECK(name_of(EmbedMethod::gaussianmarker) == "gaussianmarker");
  CHECK(name_of(EmbedMethod::threedgsw) == "3dgsw");
  for (const char* word : {"", "WateRF", "waterf ", "compmar"}) CHECK_FALSE(embed_method(word).has_value());
}
