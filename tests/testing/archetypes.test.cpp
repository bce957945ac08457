// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/testing/archetypes.hpp"

#include <doctest/doctest.h>

#include <string>

#include "compmark/testing/executor_laws.hpp"

using namespace compmark;

static_assert(Executor<testing::ExecutorArchetype>, "the archetype meets its concept");
static_assert(Rasterizer<testing::RasterizerArchetype<float>>, "the archetype meets its concept");
static_assert(Rasterizer<testing::RasterizerArchetype<double>>, "the archetype meets its concept");
static_assert(ImageLoss<testing::ImageLossArchetype<float>>, "the archetype meets its concept");
static_assert(Optimizer<testing::OptimizerArchetype<float>>, "the archetype meets its concept");

TEST_CASE("testing/archetypes: the executor archetype obeys E1 to E4") {
  const std::string broken = testing::executor_laws([](std::size_t) { return testing::ExecutorArchetype{}; });
  CHECK_MESSAGE(broken.empty(), broken);
}
