// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/watermark/proof/verify.hpp>
#include <limits>
#include <string>
#include <vector>

#include "watermark/proof/drawn_message.hpp"

using namespace compmark;
using testing::drawn_message;

namespace {

const Random verify_stream(11, 0, random_stage("test/verify"));

/// Logits that agree with `message` but for the first `wrong` bits.
ViewLogits view_of(const Message& message, std::size_t wrong, double scale = 1) {
  ViewLogits view{"view", "", {}};
  for (std::size_t i = 0; i < message.size(); ++i) view.logits.push_back(message[i] != (i < wrong) ? scale : -scale);
  return view;
}

}  // namespace

TEST_CASE("proof/verify: the table of thresholds (docs/spec/watermark.md, 5)") {
  struct Row {
    std::size_t bits;
    int at[6];  // 1e-2 1e-3 1e-4 1e-6 1e-9 1e-12; 0: impossible
  };
  const double rates[6]{1e-2, 1e-3, 1e-4, 1e-6, 1e-9, 1e-12};
  const Row table[]{{16, {14, 15, 16, 0, 0, 0}},    {32, {24, 26, 27, 30, 32, 0}},  {48, {33, 36, 38, 41, 44, 47}},
                    {64, {42, 45, 48, 51, 56, 59}}, {96, {60, 64, 67, 72, 77, 82}}, {128, {78, 82, 86, 92, 98, 103}}};
  for (const Row& row : table) {
    for (int i = 0; i < 6; ++i) {
      const std::optional<std::size_t> threshold = match_threshold(row.bits, rates[i]);
      CAPTURE(row.bits);
      CAPTURE(rates[i]);
      CHECK((threshold ? static_cast<int>(*threshold) : 0) == row.at[i]);
    }
  }
  CHECK(match_threshold(100, 1e-6) == 74);
  CHECK(match_threshold(100, 1e-12) == 85);
  CHECK(binomial_tail(30, 32) == doctest::Approx(1.2e-7).epsilon(0.05));
  CHECK(binomial_tail(41, 48) == doctest::Approx(3.1e-7).epsilon(0.02));
  CHECK(binomial_tail(51, 64) == doctest::Approx(9.4e-7).epsilon(0.02));
  // Identification among M keys.
  CHECK(match_threshold(48, rate_per_try(1e-6, 1000)) == 44);
  CHECK(match_threshold(48, rate_per_try(1e-6, 1000000)) == 47);
  CHECK(match_threshold(32, rate_per_try(1e-6, 1000)) == 32);
  CHECK_FALSE(match_threshold(32, rate_per_try(1e-6, 1000000)));
  CHECK(match_threshold(64, rate_per_try(1e-6, 1000)) == 56);
  CHECK(match_threshold(64, rate_per_try(1e-6, 1000000)) == 59);
  CHECK(match_threshold(64, rate_per_try(1e-6, 1000000000)) == 62);
}

TEST_CASE("proof/verify: power and the gain of views (docs/spec/watermark.md, 5)") {
  const auto power = [](std::size_t bits, double accuracy) { return detection_power(bits, accuracy, 1e-6); };
  CHECK(power(48, 0.80) == doctest::Approx(0.23).epsilon(0.03));
  CHECK(power(48, 0.85) == doctest::Approx(0.57).epsilon(0.01));
  CHECK(power(48, 0.90) == doctest::Approx(0.90).epsilon(0.01));
  CHECK(power(48, 0.95) == doctest::Approx(0.998).epsilon(0.001));
  CHECK(power(48, 0.9595) == doctest::Approx(0.9994).epsilon(0.0002));
  CHECK(power(32, 0.90) == doctest::Approx(0.37).epsilon(0.02));
  CHECK(power(32, 0.95) == doctest::Approx(0.79).epsilon(0.01));
  CHECK(power(64, 0.80) == doctest::Approx(0.60).epsilon(0.01));
  CHECK(power(64, 0.85) == doctest::Approx(0.91).epsilon(0.01));
  CHECK(power(64, 0.90) == doctest::Approx(0.996).epsilon(0.001));
  CHECK(power(48, 0.5) == doctest::Approx(binomial_tail(41, 48)).epsilon(1e-9));
  CHECK(detection_power(32, 1.0, 1e-6, 1000000) == 0);
  struct Gain {
    std::size_t views;
    double correlation, accuracy;
  };
  for (const Gain& g : {Gain{10, 0, 0.951}, Gain{25, 0, 0.996}, Gain{10, 0.1, 0.886}, Gain{25, 0.1, 0.923},
                        Gain{10, 0.3, 0.806}, Gain{25, 0.3, 0.820}}) {
    CHECK(std::abs(fused_accuracy(0.70, g.views, g.correlation) - g.accuracy) < 1e-3);
  }
  CHECK(fused_accuracy(0.7, 1, 0.5) == doctest::Approx(0.7).epsilon(1e-9));
}

TEST_CASE("proof/verify: the verdict follows its rules at every number of matches") {
  const Message message = drawn_message(verify_stream, 0, 48);
  for (std::size_t wrong = 0; wrong <= 48; ++wrong) {
    const std::vector<ViewLogits> views{view_of(message, wrong)};
    const Result<Verification> result = verify_message(message, views);
    REQUIRE(result.ok());
    CHECK(result->evidence.matches == 48 - wrong);
    CHECK(result->threshold == 41);
    // 41 matches: 3.1e-7; 33: 6.6e-3; 32: 1.5e-2
    const Verdict expected = wrong <= 7    ? Verdict::detected
                             : wrong <= 15 ? Verdict::inconclusive
                                           : Verdict::not_detected;
    CHECK(result->verdict == expected);
    CHECK(result->views[0].p_value == result->evidence.p_value);
  }
  VerifySettings many;
  many.tries = 1000;
  const std::vector<ViewLogits> good{view_of(message, 5)};  // 43 matches: 44 are needed
  const Result<Verification> corrected = verify_message(message, good, many);
  REQUIRE(corrected.ok());
  CHECK(corrected->verdict == Verdict::inconclusive);
  CHECK(corrected->p_corrected == doctest::Approx(1000 * binomial_tail(43, 48)));
  // 16 bits can never reach 1e-6: not an answer, however good the match.
  const Message brief = drawn_message(verify_stream, 1, 16);
  const std::vector<ViewLogits> perfect{view_of(brief, 0)};
  const Result<Verification> impossible = verify_message(brief, perfect);
  REQUIRE(impossible.ok());
  CHECK_FALSE(impossible->threshold);
  CHECK(impossible->verdict == Verdict::inconclusive);
}

TEST_CASE("proof/verify: fusion weighs views, not their scales") {
  const Message message = drawn_message(verify_stream, 2, 48);
  // One loud wrong view against two quiet right ones.
  const std::vector<ViewLogits> views{view_of(message, 48, 1000), view_of(message, 0, 0.01),
                                      view_of(message, 0, 1e-200)};
  for (const FusionRule rule : {FusionRule::scaled, FusionRule::tanh, FusionRule::majority}) {
    VerifySettings settings;
    settings.fusion = rule;
    const Result<Verification> result = verify_message(message, views, settings);
    REQUIRE(result.ok());
    CHECK(result->evidence.matches == 48);
    CHECK(result->read == message);
    CHECK(result->views[0].matches == 0);
  }
  double plain = 0;  // control: the plain sum of logits follows the loud view
  for (const ViewLogits& view : views) plain += view.logits[0];
  CHECK((plain > 0) != message[0]);

  // Independent noise of 70 % accuracy: ten views fuse to 95 % (fused_accuracy), softly better than by majority.
  double right_soft = 0, right_majority = 0;
  const std::size_t trials = 200;
  for (std::size_t trial = 0; trial < trials; ++trial) {
    std::vector<ViewLogits> noisy(10);
    for (std::size_t v = 0; v < 10; ++v) {
      for (std::size_t i = 0; i < 48; ++i) {
        const double noise = verify_stream.normal(100000 + 480 * trial + 48 * v + i);
        noisy[v].logits.push_back((message[i] ? 0.5244 : -0.5244) + noise);  // Phi(0.5244) = 0.70
      }
    }
    std::vector<double> fused(48);
    fuse_logits(noisy, FusionRule::scaled, fused);
    right_soft += static_cast<double>(matches<double>(message, fused));
    fuse_logits(noisy, FusionRule::majority, fused);
    right_majority += static_cast<double>(matches<double>(message, fused));
  }
  // 9600 bits: standard error 0.0022
  CHECK(std::abs(right_soft / (48 * trials) - 0.951) < 0.009);
  CHECK(right_majority < right_soft);
}

TEST_CASE("proof/verify: the p-value is honest for a random key, pooled views are not") {
  // Twenty-five views of one scene read nearly the same biased bits; keys are random.
  const std::size_t bits = 48, count = 25, keys = 4000;
  std::vector<ViewLogits> views(count);
  for (std::size_t v = 0; v < count; ++v) {
    for (std::size_t i = 0; i < bits; ++i)
      views[v].logits.push_back(1 + verify_stream.normal(900000 + i) + 0.1 * verify_stream.normal(910000 + 48 * v + i));
  }
  std::vector<double> fused(bits);
  fuse_logits(views, FusionRule::scaled, fused);
  std::size_t honest = 0, pooled = 0;
  for (std::size_t key = 0; key < keys; ++key) {
    const Message message = drawn_message(verify_stream, 1000 + key, bits);
    if (evidence_of(message, fused).p_value <= 1e-2) ++honest;
    std::size_t total = 0;
    for (const ViewLogits& view : views) total += matches<double>(message, view.logits);
    if (binomial_tail(total, bits * count) <= 1e-2) ++pooled;  // control: 1200 bits as if independent
  }
  const double exact = binomial_tail(33, 48);  // 6.6e-3, the largest attainable below 1e-2
  CHECK(clopper_pearson(honest, keys).contains(exact));
  CHECK(static_cast<double>(pooled) / static_cast<double>(keys) > 0.2);
}

TEST_CASE("proof/verify: a decoder that says the same of everything is detected no more often than chance (ME3)") {
  constexpr std::size_t bits = 48, keys = 4000;
  for (const double constant : {0.0, 1.0, -1.0}) {
    const std::vector<double> logits(bits, constant);
    std::size_t detected = 0, most = 0, better_than_half = 0;
    for (std::size_t key = 0; key < keys; ++key) {
      const Message message = drawn_message(verify_stream, 50000 + key, bits);
      const Evidence evidence = evidence_of(message, logits);
      detected += evidence.p_value <= 1e-2 ? 1 : 0;
      most = std::max(most, evidence.matches);
      better_than_half += 2 * evidence.matches > bits ? 1 : 0;
    }
    CAPTURE(constant);
    CHECK(clopper_pearson(detected, keys).contains(binomial_tail(33, bits)));
    // Negative control: a share of the bits above one half, for nearly every second key, and up to 28 of 48 and more.
    CHECK(better_than_half > keys / 3);
    CHECK(most >= 28);
  }
}

TEST_CASE("proof/verify: bad input is refused") {
  const Message message = drawn_message(verify_stream, 3, 48);
  const std::vector<ViewLogits> one{view_of(message, 0)};
  CHECK_FALSE(verify_message(message, {}).ok());
  CHECK_FALSE(verify_message(drawn_message(verify_stream, 3, 32), one).ok());
  CHECK_FALSE(verify_message(Message(), one).ok());
  VerifySettings settings;
  settings.tries = 0;
  CHECK_FALSE(verify_message(message, one, settings).ok());
  // So many that counting them twice would wrap, and a p-value times them would be a small one again.
  for (const std::uint64_t tries : {largest_tries + 1, ~std::uint64_t{0}}) {
    settings.tries = tries;
    const Result<Verification> many = verify_message(message, one, settings);
    REQUIRE_FALSE(many.ok());
    CHECK(many.error().field == "tries");
    CHECK(many.error().problem == "is above 2^62");
  }
  settings.tries = largest_tries;
  CHECK(verify_message(message, one, settings).ok());
  CHECK(check_settings(settings, 1).ok());
  CHECK_FALSE(check_settings(settings, 2).ok());
  settings.tries = largest_tries / 2;
  CHECK(check_settings(settings, 2).ok());
  for (const double rate : {0.0, 1.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    settings = {};
    settings.false_positive_rate = rate;
    CHECK_FALSE(verify_message(message, one, settings).ok());
  }
  for (const double wrong : {-1e-9, 1.5, std::numeric_limits<double>::quiet_NaN()}) {
    settings = {};
    settings.suspicion = wrong;
    CHECK(verify_message(message, one, settings).error().field == "suspicion");
    settings = {};
    settings.recipient_rate = wrong;
    CHECK(verify_message(message, one, settings).error().field == "recipient rate");
  }
  settings = {};
  settings.false_positive_rate = 0.05;  // above what is called inconclusive: a coarse test is one, too
  CHECK(verify_message(message, one, settings).ok());
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    std::vector<ViewLogits> broken = one;
    broken[0].logits[7] = bad;
    const Result<Verification> result = verify_message(message, broken);
    REQUIRE_FALSE(result.ok());
    CHECK(result.error().field == "view");
  }
}
