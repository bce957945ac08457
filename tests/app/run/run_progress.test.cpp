// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/run/run_progress.hpp>

TEST_CASE("app/run/run_progress: what an iteration does not have is not there") {
  const compmark::RunProgress progress;
  CHECK(progress.iteration == 0);
  CHECK_FALSE(progress.bits_per_scalar.has_value());
  CHECK_FALSE(progress.bit_accuracy.has_value());
}
