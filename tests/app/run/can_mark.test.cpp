// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/run/detail/can_mark.hpp>
#include <string>

using namespace compmark;

TEST_CASE("app/run/can_mark: photographs are looked at where they are what renders are to be") {
  for (const char* name :
       {"scaffold", "scaffold+mask", "scaffold+farfield", "scaffold+antialiasing", "hac+mask", "hac"})
    CHECK_MESSAGE(detail::sees_photographs(name), name);
  // None, exposures of their own, and masks that the recipe which marks it does not know.
  for (const char* name : {"explicit", "scaffold+exposure", "hac+exposure+mask", "scaffold+antialiasing+mask"})
    CHECK_MESSAGE(!detail::sees_photographs(name), name);
}

TEST_CASE("app/run/can_mark: what cannot be is refused by the name of its option") {
  const auto refused = [](const std::string& recipe, auto&& change) {
    detail::RunPlan plan;
    plan.recipe = recipe;
    plan.mark.decoder = "a.safetensors";
    change(plan.mark);
    const Result<Done> can = detail::can_mark_finished(plan);
    return can ? std::string() : can.error().field;
  };
  const auto nothing = [](MarkSettings&) {};
  for (const char* name : {"scaffold", "scaffold+lens", "scaffold+exposure+farfield", "hac+exposure+mask"})
    CHECK_MESSAGE(refused(name, nothing).empty(), name);
  CHECK(refused("hac+lens", nothing) == "--recipe");
  CHECK(refused("scaffold+lens", [](MarkSettings& mark) { mark.fidelity = 0; }) == "--recipe");
  CHECK(refused("scaffold+mask", [](MarkSettings& mark) { mark.fidelity = 0; }).empty());
  CHECK(refused("hac", [](MarkSettings& mark) { mark.fidelity = 0; }) == "--fidelity");
  CHECK(refused("scaffold+lens", [](MarkSettings& mark) { mark.decoder.clear(); }) == "--decoder");
  CHECK(refused("scaffold+exposure", [](MarkSettings& mark) { mark.photographs = 0.5; }) == "--photographs");
  CHECK(refused("scaffold+exposure", [](MarkSettings& mark) { mark.photographs = 0; }).empty());
}
