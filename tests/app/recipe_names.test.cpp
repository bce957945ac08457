// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/recipe_names.hpp>
#include <string>

using namespace compmark;

TEST_CASE("app/recipe_names: the codec of a recipe is told by the head of its name") {
  CHECK(std::string(recipe_codec("hac+fitted+mask")) == "hac");
  CHECK(std::string(recipe_codec("context_gs")) == "context_gs");
  CHECK(std::string(recipe_codec("scaffold+exposure")) == "none");
  CHECK(std::string(recipe_codec("hackney")) == "none");  // a head is a whole word
  CHECK(is_coded_recipe("context_gs+alpha"));
  CHECK_FALSE(is_coded_recipe("compmark-host"));
}

TEST_CASE("app/recipe_names: what training alone needs is no part of the recipe that a model is read as") {
  CHECK(reading_recipe("scaffold+antialiasing+mask") == "scaffold+antialiasing");
  CHECK(reading_recipe("hac+alpha") == "hac");
  CHECK(reading_recipe("scaffold+exposure") == "scaffold+exposure");
  CHECK(marking_recipe("hac+fitted+exposure") == "hac+fitted");
}

TEST_CASE("app/recipe_names: a message is hidden in plain models and in those of the codecs") {
  for (const char* name :
       {"scaffold", "scaffold+mask", "scaffold+exposure", "hac", "hac+fitted", "context_gs+fitted+mask"})
    CHECK_MESSAGE(is_markable_recipe(name), name);
  for (const char* name : {"scaffold+lens", "scaffold+farfield", "compmark-host", "hac+lens", ""})
    CHECK_MESSAGE(!is_markable_recipe(name), name);
}
