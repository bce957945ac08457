// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/image_pairing.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/image_pairing: what is there as written is taken first, and no file is given twice") {
  const TemporaryFolder folder;
  for (const char* name : {"a.png", "b.PNG", "c/d.png", "e.jpg"}) put(folder.path() / name, "x");
  const std::vector<std::string> names{"a.png", "b.png", "c/d.tif", "e.png", "a.PNG"};
  detail::FoundImages found = detail::images_as_written(folder.path(), names);
  CHECK(found.missing == 3);
  CHECK(found.paths[0] == folder.path() / "a.png");
  CHECK(found.paths[1] == folder.path() / "b.PNG");
  CHECK(found.paths[4].empty());  // a.png is another image's own
  const std::vector<std::string> files{"a.png", "b.PNG", "c/d.png", "e.jpg"};
  detail::pair_the_missing(names, files, files, folder.path(), {}, found);
  CHECK(found.missing == 1);
  CHECK(found.paths[2] == folder.path() / "c/d.png");
  CHECK(found.paths[3] == folder.path() / "e.jpg");
  CHECK(found.paths[4].empty());
  REQUIRE(found.notes.size() >= 1);
  CHECK(found.notes[0].find("2 of 5 images have other paths") != std::string::npos);
  CHECK(found.notes[0].find("c/d.tif is c/d.png") != std::string::npos);
}

TEST_CASE("scene/image_pairing: what cannot be decided is said with its number, and order is") {
  const TemporaryFolder folder;
  const auto paired = [&](const std::vector<std::string>& names, const std::vector<std::string>& files) {
    detail::FoundImages found = detail::images_as_written(folder.path(), names);
    detail::pair_the_missing(names, files, files, folder.path(), {true}, found);
    return found;
  };
  const detail::FoundImages two = paired({"1.tif", "2.tif"}, {"u/1.png", "u/2.png", "v/1.jpg", "v/2.jpg"});
  CHECK(two.missing == 2);
  REQUIRE(two.notes.size() == 1);
  CHECK(two.notes[0].find("\"1.tif\" and 1 others") != std::string::npos);
  const detail::FoundImages order = paired({"p", "q"}, {"1.png", "2.png"});
  CHECK(order.missing == 0);
  REQUIRE(order.notes.size() == 1);
  CHECK(order.notes[0].find("the i-th name in sorted order is taken (p is 1.png)") != std::string::npos);
  CHECK(detail::and_others("a", 1) == "\"a\"");
}
