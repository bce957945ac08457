// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/training/checkpoint_parts.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "support/tool.hpp"

using namespace compmark;

TEST_CASE(
    "training/checkpoint_parts: a loop's own column is read, left out where it says nothing, or refused by name") {
  const testing::ScratchFolder folder("compmark-checkpoint-parts-test");
  const auto read = [&](std::vector<double> kept, std::size_t count, std::vector<double>& column) {
    SafetensorsWriter writer;
    writer.add_values<double>("own", {static_cast<std::int64_t>(kept.size())}, kept);
    const auto path = folder.path / "column.safetensors";
    REQUIRE(writer.write(path).ok());
    const Result<SafetensorsFile> file = read_safetensors(path);
    REQUIRE(file.ok());
    return detail::read_own_column(*file, "own", column, count, -1.0);
  };
  std::vector<double> column;
  REQUIRE(read({1, -1, 3}, 3, column).ok());
  CHECK(column == std::vector<double>{1, -1, 3});
  REQUIRE(read({-1, -1, -1}, 3, column).ok());
  CHECK(column.empty());
  const Result<Done> longer = read({1, 2, 3, 4}, 3, column);
  REQUIRE_FALSE(longer.ok());
  CHECK(longer.error().field == "own");
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    const Result<Done> wrong = read({1, bad, 3}, 3, column);
    REQUIRE_FALSE(wrong.ok());
    CHECK(wrong.error().field == "own");
  }
}

TEST_CASE(
    "training/checkpoint_parts: views are compared by name, split, camera and lens, and the first other one is told") {
  std::vector<StoredView> before(3);
  for (std::size_t i = 0; i < before.size(); ++i) {
    before[i].name = "view" + std::to_string(i);
    before[i].camera.width = before[i].camera.height = 8;
  }
  const auto changed = [&](auto&& change) {
    std::vector<StoredView> now = before;
    change(now[1]);
    const std::optional<OtherView> other = other_view(before, now);
    return other ? other->field + " " + other->name : std::string();
  };
  CHECK(changed([](StoredView&) {}).empty());
  CHECK(changed([](StoredView& view) { view.test = true; }) == "views 1 (view1)");
  CHECK(changed([](StoredView& view) { view.name = "another"; }) == "views 1 (another)");
  CHECK(changed([](StoredView& view) { view.camera.fx += 1e-12; }) == "views 1 (view1)");
  CHECK(changed([](StoredView& view) { view.camera.center_world[2] = 1; }) == "views 1 (view1)");
}
