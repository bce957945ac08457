// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <compmark/scene/point_file.hpp>
#include <cstdint>
#include <string>

#include "support/scene_files.hpp"

using namespace compmark;
using testing::TemporaryFolder;

TEST_CASE("scene/point_file: colours are bytes where the header says so, and shares of 1 where all of them are") {
  const TemporaryFolder folder;
  const auto colors = [&](const std::string& type, const std::string& rows) {
    const std::filesystem::path path = folder.path() / "points.ply";
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
    for (const char* name : {"red", "green", "blue"}) text += "property " + type + " " + name + "\n";
    REQUIRE(write_file(path, text + "end_header\n" + rows).ok());
    const Result<PrecisePoints> points = read_precise_points(path);
    REQUIRE(points.ok());
    return points->color;
  };
  using Colors = std::vector<std::array<std::uint8_t, 3>>;
  // A channel that is nearly black decided for all three once, and every colour was white.
  CHECK(colors("uchar", "0 0 0 200 40 0\n1 1 1 90 10 1\n") == Colors{{200, 40, 0}, {90, 10, 1}});
  CHECK(colors("float", "0 0 0 200 40 0\n1 1 1 90 10 1\n") == Colors{{200, 40, 0}, {90, 10, 1}});
  CHECK(colors("float", "0 0 0 1 0.5 0\n1 1 1 0.2 0 1\n") == Colors{{255, 128, 0}, {51, 0, 255}});
}
