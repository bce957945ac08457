// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/effect/alpha_loss.hpp"

#include <doctest/doctest.h>

#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"

namespace {
using namespace compmark;
static_assert(AlphaLoss<L1AlphaLoss<float>> && AlphaLoss<NoAlphaLoss> && !present<NoAlphaLoss>);
}  // namespace

TEST_CASE("effect/alpha_loss: mean absolute difference, its slope, and 0 where they agree") {
  std::vector<double> alpha, target;
  const Random random(3, 0, random_stage("alpha test"));
  for (std::size_t i = 0; i < 20001; ++i) {
    alpha.push_back(random.uniform(i));
    target.push_back(i % 3 == 0 ? alpha.back() : random.uniform(i + 100000));
  }
  L1AlphaLoss<double>::Context context;
  for (const std::size_t threads : {1u, 3u}) {
    ThreadExecutor executor(threads);
    const double value = L1AlphaLoss<double>::forward_backward(alpha, target, nullptr, 0.5, context, executor);
    double expected = 0;
    for (std::size_t i = 0; i < alpha.size(); ++i) expected += std::abs(alpha[i] - target[i]) / 20001;
    CHECK(value == doctest::Approx(expected).epsilon(1e-12));
    for (std::size_t i = 0; i < alpha.size(); ++i) {
      const double sign = alpha[i] > target[i] ? 1 : (alpha[i] < target[i] ? -1 : 0);
      CHECK(context.d_alpha[i] == 0.5 / 20001 * sign);
    }
  }
}

TEST_CASE("effect/alpha_loss: pixels that do not count have no gradient, and the others are averaged over themselves") {
  const std::vector<double> alpha{0.9, 0.2, 0.6, 0.1}, target{0.4, 0.3, 0.0, 0.1}, counts{1, 0, 0.5, 1};
  L1AlphaLoss<double>::Context context;
  SerialExecutor serial;
  const double value = L1AlphaLoss<double>::forward_backward(alpha, target, counts.data(), 1.0, context, serial);
  CHECK(value == doctest::Approx((0.5 + 0.5 * 0.6) / 2.5).epsilon(1e-14));
  CHECK(context.d_alpha[0] == doctest::Approx(1 / 2.5));
  CHECK(context.d_alpha[1] == 0);
  CHECK(context.d_alpha[2] == doctest::Approx(0.5 / 2.5));
  const std::vector<double> none(4, 0.0);
  CHECK(L1AlphaLoss<double>::forward_backward(alpha, target, none.data(), 1.0, context, serial) == 0);
  for (const double d : context.d_alpha.span()) CHECK(d == 0);
}
