// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/run/effect_choice.hpp>
#include <string>
#include <vector>

TEST_CASE("app/run/effect_choice: the recipe with the most of the effects, and none that is not there") {
  using namespace compmark;
  using Names = std::vector<std::string>;
  const auto chosen = [](const Names& effects, LensTreatment lens = LensTreatment::undistort) {
    return choose_recipe(effects, lens);
  };
  CHECK(chosen({}).recipe == "scaffold");
  CHECK(chosen({"exposure", "masks"}).recipe == "scaffold+exposure+mask");
  CHECK(chosen({"principal_point"}).recipe == "scaffold");
  CHECK(chosen({"principal_point"}).simulated == Names{"principal_point"});
  CHECK(chosen({"lens_distortion"}).recipe == "scaffold+mask");  // what is taken out leaves borders
  CHECK(chosen({"lens_distortion"}, LensTreatment::keep).recipe == "scaffold+lens");
  CHECK(chosen({"lens_distortion"}, LensTreatment::ignore).recipe == "scaffold");
  const EffectChoice two = chosen({"alpha", "far_field"});
  CHECK(two.left_out.size() == 1);
  CHECK(two.simulated.size() == 1);

  CHECK(wanted_effects("none", {})->empty());
  CHECK(*wanted_effects("exposure,masks", {}) == Names{"exposure", "masks"});
  const auto unknown = wanted_effects("exposure,rain", {});
  REQUIRE_FALSE(unknown.ok());
  CHECK(unknown.error().problem.find("rain") != std::string::npos);
}
