// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/core/tbb_executor.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <string>

#include "compmark/testing/executor_laws.hpp"

TEST_CASE("core/tbb_executor: obeys E1 to E4") {
  const std::string broken =
      compmark::testing::executor_laws([](std::size_t threads) { return compmark::TbbExecutor(threads); });
  CHECK_MESSAGE(broken.empty(), broken);
}
