// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// ContextGS in a training as a whole: levels, parents and hyperprior give the same bits at any thread count and after a stop, and the rate is a
// loss. Its gradients are proven in tests/entropy, its files are not there yet.
#include <doctest/doctest.h>

#include <compmark/recipes/context_gs.hpp>

#include "coded_training.hpp"

namespace {

using namespace compmark;
struct Small : recipes::ContextGs<DefaultRecipe<float, compmark::testing::coded_test_shape>> {};

}  // namespace

TEST_CASE("pipeline/context_gs: the same bits at any thread count and after a stop, in every phase") {
  compmark::testing::check_reproducible<Small>();
}

TEST_CASE("pipeline/context_gs: the rate is a loss: more weight, fewer bits") {
  const auto bits = [](double lambda) {
    TrainSettings settings = compmark::testing::short_settings(300);
    settings.rate.lambda = lambda;
    settings.rate.sample = 1;
    compmark::testing::BlobViews views;
    ThreadExecutor executor(2);
    Trainer<Small, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    REQUIRE(trainer.initialise(compmark::testing::cloud(300, 7)));
    REQUIRE(trainer.run(views));
    return trainer.rate_report().bits_per_scalar;
  };
  const double free = bits(0), cheap = bits(0.02);
  MESSAGE("bits a scalar: ", free, " at lambda 0, ", cheap, " at 0.02");
  CHECK(cheap < 0.7 * free);
}
