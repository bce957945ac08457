// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/loss/message.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;

std::vector<std::uint8_t> alternating(std::size_t n) {
  std::vector<std::uint8_t> bits;
  for (std::size_t i = 0; i < n; ++i) bits.push_back(i % 3 == 0 ? 1 : 0);
  return bits;
}

/// The textbook form, without any care.
template <class T>
T naive_cross_entropy(T x, bool one) {
  const T p = T(1) / (T(1) + std::exp(-x));
  return -(one ? T(1) : T(0)) * std::log(p) - (one ? T(0) : T(1)) * std::log(T(1) - p);
}

TEST_CASE("loss/message: ln 2 a bit at z = 0 and a gradient of 5 / L a bit, whatever the message") {
  for (const std::size_t n : {1u, 16u, 48u, 64u}) {
    const std::vector<double> z(n, 0.0);
    for (const bool inverted : {false, true}) {
      std::vector<std::uint8_t> bits = alternating(n);
      if (inverted) {
        for (std::uint8_t& b : bits) b = 1 - b;
      }
      std::vector<double> d(n, 0.0);
      const MessageLoss<double> loss;
      const MessageReport report = loss.forward_backward(z, bits, 1.0, d);
      CHECK(report.loss == doctest::Approx(std::log(2.0)).epsilon(1e-15));
      for (std::size_t i = 0; i < n; ++i)
        CHECK(d[i] == doctest::Approx((bits[i] != 0 ? -5.0 : 5.0) / static_cast<double>(n)).epsilon(1e-15));
      MessageLoss<double>::Settings paper;
      paper.logit_scale = 1;
      paper.reduction = MessageReduction::sum;
      CHECK(MessageLoss<double>(paper).forward(z, bits).loss ==
            doctest::Approx(static_cast<double>(n) * std::log(2.0)).epsilon(1e-14));
    }
  }
}

TEST_CASE("loss/message: gradient law of both rules and both reductions, and the gradient is added") {
  std::vector<double> z;
  const Random random(3, 0, random_stage("test"));
  const std::vector<std::uint8_t> bits = alternating(48);
  for (std::size_t i = 0; i < 48; ++i) z.push_back(static_cast<double>(random.centered(i)));
  struct Rule {
    MessageRule rule;
    double power;
  };
  const std::vector<Rule> rules{
      {MessageRule::cross_entropy, 1}, {MessageRule::hinge, 1}, {MessageRule::hinge, 2}, {MessageRule::hinge, 2.5}};
  for (const Rule& rule : rules) {
    for (const MessageReduction reduction : {MessageReduction::mean, MessageReduction::sum}) {
      MessageLoss<double>::Settings settings;
      settings.rule = rule.rule;
      settings.power = rule.power;
      settings.reduction = reduction;
      settings.margin = 1.7;
      const MessageLoss<double> loss(settings);
      std::vector<double> d(48, 0.0), shifted(48, 2.0);
      loss.forward_backward(z, bits, 0.45, d);
      CHECK(testing::gradient_law([&] { return 0.45 * loss.forward(z, bits).loss; }, z, d, 1e-7) == std::string());
      loss.forward_backward(z, bits, 0.45, shifted);
      for (std::size_t i = 0; i < 48; ++i) CHECK(shifted[i] - 2 == doctest::Approx(d[i]).epsilon(1e-12));
      for (double& g : d) g *= 1.01;  // control: the law sees one per cent
      CHECK(testing::gradient_law([&] { return 0.45 * loss.forward(z, bits).loss; }, z, d, 1e-7) != std::string());
    }
  }
}

TEST_CASE("loss/message: x = +-1e4 costs |x| or nothing, without NaN (LS8); the textbook form fails") {
  MessageLoss<float>::Settings settings;
  settings.logit_scale = 1;
  const MessageLoss<float> loss(settings);
  const std::vector<std::uint8_t> one{1}, zero{0};
  for (const float x : {1e4f, 50.0f, 1e30f}) {
    std::vector<float> d{0.0f};
    CHECK(loss.forward_backward(std::vector<float>{x}, zero, 1.0f, d).loss == static_cast<double>(x));
    CHECK(d[0] == 1.0f);
    d[0] = 0;
    CHECK(loss.forward_backward(std::vector<float>{-x}, one, 1.0f, d).loss == static_cast<double>(x));
    CHECK(d[0] == -1.0f);
    CHECK(loss.forward(std::vector<float>{x}, one).loss <= 2e-22);
    CHECK(!std::isfinite(naive_cross_entropy(x, true) + naive_cross_entropy(x, false)));
  }
}

TEST_CASE("loss/message: a float keeps its relative digits where a bit is safely right; sigmoid minus one does not") {
  MessageLoss<float>::Settings settings;
  settings.logit_scale = 1;
  const MessageLoss<float> loss(settings);
  double worst = 0, worst_naive = 0;
  for (float x = 0.0f; x < 80.0f; x += 0.37f) {
    std::vector<float> d{0.0f};
    const double value = loss.forward_backward(std::vector<float>{x}, std::vector<std::uint8_t>{1}, 1.0f, d).loss;
    const double e = std::exp(-static_cast<double>(x));
    worst = std::max(
        {worst, std::abs(value / std::log1p(e) - 1), std::abs(static_cast<double>(d[0]) / (-e / (1 + e)) - 1)});
    const float naive = 1.0f / (1.0f + std::exp(-x)) - 1.0f;
    worst_naive = std::max(worst_naive, std::abs(static_cast<double>(naive) / (-e / (1 + e)) - 1));
  }
  CHECK(worst < 4e-7);  // measured 1.9e-7
  CHECK(worst_naive == 1);
}

TEST_CASE("loss/message: a hinge does not pull a bit that is right by the margin") {
  MessageLoss<double>::Settings settings;
  settings.rule = MessageRule::hinge;
  settings.logit_scale = 1;
  const MessageLoss<double> loss(settings);
  std::vector<double> d(4, 0.0);
  const MessageReport report =
      loss.forward_backward(std::vector<double>{5.0, 7.0, 4.0, 1.0}, std::vector<std::uint8_t>{1, 1, 1, 0}, 1.0, d);
  CHECK(report.loss == doctest::Approx((0 + 0 + 1 + 6) / 4.0));
  CHECK(d == std::vector<double>{0, 0, -0.25, 0.25});
}

TEST_CASE("loss/message: a power of the hinge costs the margin where nothing is said, and pulls a bit as it needs") {
  MessageLoss<double>::Settings settings;
  settings.rule = MessageRule::hinge;
  settings.logit_scale = 1;
  settings.margin = 4;
  const std::vector<double> z{4.0, 9.0, 2.0, 0.0,
                              4.0};  // right by the margin, by more, by half of it, by nothing, wrong
  const std::vector<std::uint8_t> bits{1, 1, 1, 1, 0};
  std::vector<double> linear(5, 0.0), squared(5, 0.0);
  CHECK(MessageLoss<double>(settings).forward_backward(z, bits, 5.0, linear).loss ==
        doctest::Approx((2 + 4 + 8) / 5.0));
  settings.power = 2;
  CHECK(MessageLoss<double>(settings).forward_backward(z, bits, 5.0, squared).loss ==
        doctest::Approx((1 + 4 + 16) / 5.0));
  CHECK(linear == std::vector<double>{0, 0, -1, -1, 1});
  CHECK(squared == std::vector<double>{0, 0, -1, -2, 4});
  // a logit that is no number stays one, whatever the power
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double power : {1.0, 2.0, 2.5}) {
    settings.power = power;
    CHECK(
        std::isnan(MessageLoss<double>(settings).forward(std::vector<double>{nan}, std::vector<std::uint8_t>{1}).loss));
  }
  // far off in float: what is right costs nothing, what is wrong (1e4 + 4) / 4 times as much as what says nothing,
  // squared
  MessageLoss<float>::Settings single;
  single.rule = MessageRule::hinge;
  single.logit_scale = 1;
  single.margin = 4;
  single.power = 2;
  std::vector<float> pulls(2, 0.0F);
  const std::vector<float> far{1e4F, -1e4F};
  const double cost =
      MessageLoss<float>(single).forward_backward(far, std::vector<std::uint8_t>{1, 1}, 2.0F, pulls).loss;
  CHECK(cost == doctest::Approx(0.5 * 4 * 2501.0 * 2501.0).epsilon(1e-6));
  CHECK(pulls[0] == 0);
  CHECK(pulls[1] == doctest::Approx(-2 * 2501.0).epsilon(1e-6));
}

TEST_CASE("loss/message: matches, margins, no bits, and NaN") {
  const MessageLoss<double> loss;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  MessageReport report = loss.forward(std::vector<double>{0.2, -0.1, 0.0, 0.3}, std::vector<std::uint8_t>{1, 0, 0, 0});
  CHECK(report.matches == 3);
  CHECK(report.accuracy() == 0.75);
  CHECK(report.smallest_margin == -0.3);
  // 0 reads zero, so it is wrong where a one is expected
  CHECK(loss.forward(std::vector<double>{0.0}, std::vector<std::uint8_t>{1}).matches == 0);
  report = loss.forward(std::vector<double>{nan, 0.1}, std::vector<std::uint8_t>{0, 1});
  CHECK(report.matches == 1);
  CHECK(std::isnan(report.loss));
  CHECK(std::isnan(report.smallest_margin));
  CHECK(loss.forward(std::vector<double>{nan}, std::vector<std::uint8_t>{1}).matches == 0);
  CHECK(loss.forward({}, {}).loss == 0);
  CHECK(loss.forward({}, {}).accuracy() == 0);
}

}  // namespace
