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
  CHECK(reading_recipe("scaffold+exposure+farfield") == "scaffold+exposure");
  CHECK(reading_recipe("scaffold+alpha+antialiasing") == "scaffold+antialiasing");
  CHECK(marking_recipe("hac+fitted+exposure") == "hac+fitted");
}

TEST_CASE("app/recipe_names: a message is hidden in plain models and in those of the codecs") {
  for (const char* name : {"scaffold", "scaffold+mask", "scaffold+exposure+farfield", "hac+exposure+mask", "hac+fitted",
                           "context_gs+fitted+mask", "explicit"}) {
    CHECK_MESSAGE(is_markable_recipe(name), name);
    CHECK_MESSAGE(is_fittable_recipe(name), name);
  }
  for (const char* name : {"scaffold+lens", "scaffold+fisheye", "scaffold+alpha+antialiasing"}) {
    CHECK_MESSAGE(is_markable_recipe(name), name);
    CHECK_MESSAGE(!is_fittable_recipe(name), name);
    CHECK_MESSAGE(!can_be_fitted(name), name);
  }
  for (const char* name : {"compmark-host", "hac+lens", ""}) CHECK_MESSAGE(!is_markable_recipe(name), name);
}

TEST_CASE("app/recipe_names: a codec is fitted to what renders as scaffold does, a far field and its exposures too") {
  for (const char* name : {"scaffold", "scaffold+alpha", "scaffold+exposure+mask", "scaffold+exposure+farfield"})
    CHECK_MESSAGE(can_be_fitted(name), name);
  for (const char* name : {"scaffold+antialiasing", "hac", "hac+fitted", "compmark-host", "explicit"})
    CHECK_MESSAGE(!can_be_fitted(name), name);
}

TEST_CASE("app/recipe_names: a message trains together with three recipes") {
  for (const char* name : {"scaffold", "scaffold+mask", "scaffold+alpha"})
    CHECK_MESSAGE(marks_while_training(name), name);
  for (const char* name : {"scaffold+exposure", "scaffold+farfield", "scaffold+antialiasing", "explicit"})
    CHECK_MESSAGE(!marks_while_training(name), name);
}
