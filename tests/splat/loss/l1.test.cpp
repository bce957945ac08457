// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/loss/l1.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;

TEST_CASE("loss/l1: value and subgradient, sign(0) = 0 (LS9), added, same bits at any thread count") {
  for (const int width : {1, 15, 16, 17, 333}) {
    const int height = 101;
    std::vector<float> x(3 * static_cast<std::size_t>(height * width)), y(x.size()), d(x.size(), 5.0f);
    const Random random(9, 0, random_stage("test"));
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] = static_cast<float>(random.uniform(i));
      y[i] = i % 3 == 0 ? x[i] : static_cast<float>(random.uniform(i + 1000000));
      sum += std::abs(static_cast<double>(x[i]) - static_cast<double>(y[i]));
    }
    L1Loss<float> loss;
    L1Loss<float>::Context context;
    SerialExecutor executor;
    const ImageView<const float> a{x.data(), 3, height, width}, b{y.data(), 3, height, width};
    const double value =
        loss.forward_backward(a, b, 2.0f, ImageView<float>{d.data(), 3, height, width}, context, executor).loss;
    CHECK(value == doctest::Approx(sum / static_cast<double>(x.size())).epsilon(1e-6));
    const float slope = 2.0f / static_cast<float>(x.size());
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < x.size(); ++i)
      wrong += d[i] != 5.0f + (x[i] > y[i] ? slope : (x[i] < y[i] ? -slope : 0.0f)) ? 1 : 0;
    CHECK(wrong == 0);
    ThreadExecutor threads(3);
    CHECK(loss.forward(a, b, context, threads).loss == value);
    CHECK(loss.forward(a, a, context, threads).loss == 0);
  }
}

}  // namespace
