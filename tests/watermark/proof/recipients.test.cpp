// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Copies for recipients: what one leaked copy, and copies that their recipients mixed, say of the owner and of them. The
// law is that nobody who had no part is named above the rate, whatever the mixing.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/math/binomial.hpp>
#include <compmark/watermark/proof/recipients.hpp>
#include <compmark/watermark/proof/report.hpp>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "watermark/proof/colluded_copies.hpp"
#include "watermark/proof/recipients_key.hpp"

using namespace compmark;
using testing::colluded_logits;
using testing::copies_of;
using testing::copy_of;
using testing::Mixing;
using testing::recipients_key;

namespace {

Verification verified(const OwnerKey& key, std::vector<double> logits, const VerifySettings& settings = {}) {
  const std::vector<ViewLogits> views{{"view", "", std::move(logits)}};
  const Result<Verification> result = verify_key(key, views, settings);
  REQUIRE(result.ok());
  return *result;
}
Random noise_of(std::uint64_t number) { return {23, number, random_stage("test/recipients")}; }

/// How many of `named` are not among the first `colluders` recipients.
std::size_t innocents(const RecipientTrace& trace, std::size_t colluders) {
  return static_cast<std::size_t>(std::count_if(trace.named.begin(), trace.named.end(),
                                                [&](const RecipientEvidence& one) { return one.number > colluders; }));
}

}  // namespace

TEST_CASE("proof/recipients: what no key can have, and a rate that is none, are refused") {
  for (const auto& [bits, recipients] :
       {std::pair<std::size_t, std::size_t>{16, 2}, {48, 1}, {48, 16778}, {64, 100001}})
    CHECK_FALSE(verify_key(recipients_key(1, bits, recipients), {}).ok());
  VerifySettings settings;
  settings.recipient_rate = 0;
  const std::vector<ViewLogits> views{{"view", "", std::vector<double>(48, 1.0)}};
  CHECK_FALSE(verify_key(recipients_key(1), views, settings).ok());
}

TEST_CASE("proof/recipients: a leaked copy proves the owner and names its recipient, another key neither") {
  const OwnerKey key = recipients_key(11);
  const Verification found = verified(key, colluded_logits({copy_of(key, 4)}, Mixing::average, 0.3, noise_of(1)));
  REQUIRE(found.recipients);
  CHECK(found.verdict == Verdict::detected);
  CHECK(found.bits == 48);
  CHECK(found.evidence.matches == 48);
  CHECK(found.recipients->shared_matches == 24);
  CHECK(found.recipients->shared_p_value == std::ldexp(1.0, -24));
  CHECK(found.evidence.p_value < 1e-12);
  REQUIRE(found.recipients->named.size() == 1);
  CHECK(found.recipients->named[0].number == 4);
  CHECK(found.recipients->named[0].matches == 24);
  CHECK(found.recipients->named[0].p_value < 1e-6);
  CHECK(found.recipients->named[0].p_corrected == doctest::Approx(10 * found.recipients->named[0].p_value));
  const std::string text = report_text(found);
  CHECK(text.find("24 of the 24 bits that all copies share") != std::string::npos);
  CHECK(text.find("recipient   4: 24 of the 24 bits") != std::string::npos);
  const auto json = report_json<nlohmann::ordered_json>({{},
                                                         {},
                                                         {48,
                                                          {},
                                                          found.fused,
                                                          found.read,
                                                          found.evidence,
                                                          found.p_corrected,
                                                          found.threshold,
                                                          found.verdict,
                                                          found.settings,
                                                          found.recipients}});
  CHECK(json["recipients"]["number"] == 10);
  CHECK(json["recipients"]["shared"]["bits"] == 24);
  CHECK(json["recipients"]["named"][0]["recipient"] == 4);
  // What each view says of the nearest of ten copies is chosen among them.
  CHECK(found.views[0].p_value == doctest::Approx(10 * std::ldexp(1.0, -48)));
  // Where even all bits would not do, nothing is said against the key.
  VerifySettings many;
  many.tries = 1'000'000'000'000;
  CHECK(verified(key, found.fused, many).verdict == Verdict::inconclusive);
  CHECK(verified(recipients_key(12), found.fused, many).verdict == Verdict::inconclusive);
  many.tries = 1000;
  CHECK(verified(recipients_key(12), found.fused, many).verdict == Verdict::not_detected);
  // A copy whose message is read too badly to prove the owner: its recipient is named once a spread mark proves him.
  std::vector<double> weak = colluded_logits({copy_of(key, 4)}, Mixing::average, 0.3, noise_of(1));
  for (std::size_t i = 0; i < 48; i += 5) weak[i] = -weak[i];
  Verification both = verified(key, weak);
  CHECK(both.verdict != Verdict::detected);
  CHECK_FALSE(both.recipients->owner_proven);
  CHECK(report_text(both).find("nobody is named") != std::string::npos);
  both.recipients->owner_proven = true;
  CHECK(report_text(both).find("nobody is named") == std::string::npos);
  // Another key's: nothing is proven, and nobody is named.
  const Verification other = verified(recipients_key(12), found.fused);
  CHECK(other.verdict == Verdict::not_detected);
  CHECK(other.recipients->named.empty());
  CHECK(report_text(other).find("nobody is named") != std::string::npos);
  // A key without recipients is what it was.
  OwnerKey plain = key;
  plain.recipients = 0;
  const Verification usual = verified(plain, colluded_logits({message_of(plain)}, Mixing::average, 0.3, noise_of(2)));
  CHECK_FALSE(usual.recipients);
  CHECK(usual.evidence.p_value == std::ldexp(1.0, -48));
  CHECK_FALSE(report_json<nlohmann::ordered_json>({{}, {}, usual}).contains("recipients"));
}

TEST_CASE("proof/recipients: the p-value of the owner's test holds for random keys") {
  // Logits that nobody marked, biased and of any size: what a random key's p-value says must be true of it.
  constexpr std::size_t keys = 4000;
  const Random random = noise_of(77);
  std::vector<double> logits;
  for (std::size_t i = 0; i < 48; ++i) logits.push_back((i % 3 == 0 ? 4 : 1) * (random.normal(i) + 0.7));
  VerifySettings settings;
  settings.suspicion = 0.5;
  for (const double rate : {0.05, 0.01}) {
    settings.false_positive_rate = rate;
    std::size_t detected = 0, uncorrected = 0;
    for (std::size_t i = 0; i < keys; ++i) {
      const Verification found = verified(recipients_key(i + 100), logits, settings);
      detected += found.verdict == Verdict::detected ? 1 : 0;
      uncorrected += found.recipients->copy_p_value <= rate ? 1 : 0;  // the best of ten copies, counted once
    }
    CAPTURE(rate);
    CHECK(clopper_pearson(detected, keys).low <= rate);
    CHECK(detected > 0);
    CHECK(clopper_pearson(uncorrected, keys).low > 2 * rate);
  }
}

TEST_CASE("proof/recipients: whoever had no part is named at most at the rate, however copies were mixed") {
  constexpr std::size_t keys = 200;
  VerifySettings settings;
  settings.recipient_rate = 0.05;
  for (const std::size_t colluders : {1u, 2u, 3u}) {
    for (const Mixing mixing : testing::all_mixings) {
      std::size_t wrong = 0, uncorrected = 0;
      for (std::size_t i = 0; i < keys; ++i) {
        const OwnerKey key = recipients_key(i + 5000);
        const std::vector<double> logits =
            colluded_logits(copies_of(key, colluders), mixing, 0.4, noise_of(i + 1000 * colluders));
        const Verification found = verified(key, logits, settings);
        wrong += innocents(*found.recipients, colluders) > 0 ? 1 : 0;
        const RecipientTrace once = trace_recipients(key, found.fused, 0.05 * 10);  // as if there were one recipient
        uncorrected += innocents(once, colluders) > 0 ? 1 : 0;
      }
      CAPTURE(colluders);
      CAPTURE(static_cast<int>(mixing));
      CHECK(clopper_pearson(wrong, keys).low <= 0.05);
      CHECK(clopper_pearson(uncorrected, keys).low > 0.05);
    }
  }
}

TEST_CASE("proof/recipients: what is proven, and who is named, at the usual rates") {
  // Logits with noise of 0.35 of a copy's; docs/threat_model.md has the table.
  constexpr std::size_t keys = 200;
  struct Row {
    std::size_t bits, colluders;
    double owner, named;  // least shares
  };
  for (const Row& row : {Row{48, 1, 0.99, 0.99}, Row{48, 2, 0.97, 0.35}, Row{64, 1, 0.99, 0.99}, Row{64, 2, 0.99, 0.75},
                         Row{48, 3, 0.9, 0.0}, Row{64, 3, 0.98, 0.2}}) {
    std::size_t proven = 0, named = 0, wrong = 0, plain = 0;
    for (std::size_t i = 0; i < keys; ++i) {
      const OwnerKey key = recipients_key(i + 9000, row.bits);
      const std::vector<double> logits =
          colluded_logits(copies_of(key, row.colluders), Mixing::average, 0.35, noise_of(i + 40000));
      const Verification found = verified(key, logits);
      proven += found.verdict == Verdict::detected ? 1 : 0;
      named += found.recipients->named.size() > innocents(*found.recipients, row.colluders) ? 1 : 0;
      wrong += innocents(*found.recipients, row.colluders);
      // Copies with keys of their own: of the average, the nearest of the messages, which share nothing.
      std::vector<Message> own;
      for (std::size_t c = 0; c < row.colluders; ++c) {
        OwnerKey one = recipients_key(90000 + 10 * i + c, row.bits);
        one.recipients = 0;
        own.push_back(message_of(one));
      }
      const std::vector<double> mixed = colluded_logits(own, Mixing::average, 0.35, noise_of(i + 40000));
      const Message read = Message::from_logits<double>(mixed);
      std::size_t most = 0;
      for (const Message& one : own) most = std::max(most, one.matches(read));
      plain += binomial_tail(most, row.bits) * 10 <= 1e-6 ? 1 : 0;
    }
    CAPTURE(row.bits);
    CAPTURE(row.colluders);
    CAPTURE(proven);
    CAPTURE(named);
    CAPTURE(plain);
    CHECK(static_cast<double>(proven) >= row.owner * keys);
    CHECK(static_cast<double>(named) >= row.named * keys);
    CHECK(clopper_pearson(wrong, keys).low <= 1e-3);
    if (row.colluders > 1) CHECK(plain < keys / 2);  // the mark of either is lost, as it was before
  }
}
