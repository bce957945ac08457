// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/observer.hpp>
#include <cstddef>

TEST_CASE("app/observer: nobody need watch, and who says stop is obeyed as a cancelled call") {
  using namespace compmark;
  CHECK(detail::tell({}, 1, 2).ok());
  std::size_t seen = 0;
  const WorkObserver half = [&](std::size_t done, std::size_t total) {
    seen = done;
    return 2 * done <= total;
  };
  CHECK(detail::tell(half, 5, 10).ok());
  const Result<Done> stopped = detail::tell(half, 6, 10);
  CHECK(seen == 6);
  REQUIRE_FALSE(stopped.ok());
  CHECK(stopped.error().kind == ErrorKind::cancelled);
}
