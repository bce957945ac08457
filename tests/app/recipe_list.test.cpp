// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/recipe_list.hpp>
#include <compmark/core/absent.hpp>
#include <string>
#include <type_traits>

#include "small_models.hpp"

namespace {

using namespace compmark;

/// What a name's type is: whether it has an entropy model, and D.
struct Kind {
  bool coded = false;
  int features = 0;
  bool operator==(const Kind&) const = default;
};
const auto kind_of = [](auto tag) -> Result<Kind> {
  using R = typename decltype(tag)::Recipe;
  return Kind{present<typename R::EntropyModel>, R::AnchorModel::shape.feature_dim};
};

}  // namespace

TEST_CASE("app/recipe_list: every name that models are read as has a type, and the codec in the name is the type's") {
  for (const std::string name : testing::read_recipes) {
    CAPTURE(name);
    const Result<Kind> kind = with_reading_recipe(name, OrError(kind_of));
    REQUIRE(kind.ok());
    CHECK(kind->coded == is_coded_recipe(name));
    CHECK(kind->features ==
          (name.find("compmark") == 0 || (kind->coded && name.find("fitted") == std::string::npos) ? 50 : 32));
  }
}

TEST_CASE("app/recipe_list: a recipe that trains is read as one that renders the same") {
  for (const std::string name :
       {"scaffold+mask", "scaffold+alpha", "scaffold+antialiasing+mask", "scaffold+alpha+antialiasing",
        "scaffold+exposure+mask", "scaffold+exposure+farfield", "compmark-paper-host"}) {
    CAPTURE(name);
    const Result<Kind> trained = with_recipe(name, OrError(kind_of)),
                       read = with_reading_recipe(name, OrError(kind_of));
    REQUIRE(trained.ok());
    REQUIRE(read.ok());
    CHECK(*trained == *read);
  }
  for (const std::string effect : {"+mask", "+alpha", "+exposure", "+exposure+mask", "+fitted", "+fitted+mask",
                                   "+fitted+exposure", "+fitted+exposure+mask"}) {
    CAPTURE(effect);
    CHECK(with_hac_recipe("hac" + effect, OrError(kind_of)).ok());
    CHECK(with_context_gs_recipe("context_gs" + effect, OrError(kind_of)).ok());
    CHECK(with_reading_recipe("context_gs" + effect, OrError(kind_of)).ok());
  }
}

TEST_CASE("app/recipe_list: a name that nobody ships is refused, and what is shipped is named") {
  for (const std::string name : {"", "scaffolds", "scaffold+fitted", "hac+lens", "Scaffold"}) {
    CAPTURE(name);
    const Result<Kind> kind = with_reading_recipe(name, OrError(kind_of));
    REQUIRE_FALSE(kind.ok());
    CHECK(kind.error().problem.find("\"" + name + "\"") != std::string::npos);
    CHECK(kind.error().remedy.find("hac") != std::string::npos);
    CHECK_FALSE(with_recipe(name, OrError(kind_of)).ok());
  }
  CHECK_FALSE(with_hac_recipe("context_gs", OrError(kind_of)).ok());
  CHECK_FALSE(with_context_gs_recipe("hac", OrError(kind_of)).ok());
}
