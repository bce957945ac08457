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
#include <set>
#include <string>
#include <vector>

#include "watermark/proof/colluded_copies.hpp"

using namespace compmark;
using testing::colluded_logits;
using testing::Mixing;

namespace {

OwnerKey recipients_key(std::uint64_t number, std::size_t bits = 48, std::size_t recipients = 10) {
  Digest256 secret{};
  secret[0] = std::byte{7};
  for (std::size_t i = 0; i < 8; ++i) secret[31 - i] = static_cast<std::byte>(number >> (8 * i) & 0xFF);
  OwnerKey key{secret, "2026-01-31T23:59:59Z", bits};
  key.recipients = recipients;
  return key;
}
Message copy_of(OwnerKey key, std::size_t recipient) {
  key.recipient = recipient;
  return message_of(key);
}
std::vector<Message> copies_of(const OwnerKey& key, std::size_t count) {
  std::vector<Message> copies;
  for (std::size_t j = 1; j <= count; ++j) copies.push_back(copy_of(key, j));
  return copies;
}
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

TEST_CASE("proof/recipient_code: half of the bits are in every copy, the others differ as random ones do") {
  for (const std::size_t bits : {32u, 48u, 64u, 127u}) {
    const OwnerKey key = recipients_key(3, bits, 40);
    const RecipientCode code(key);
    CHECK(code.shared().size() == bits / 2);
    CHECK(code.shared().size() + code.naming().size() == bits);
    std::set<std::size_t> places(code.shared().begin(), code.shared().end());
    places.insert(code.naming().begin(), code.naming().end());
    CHECK(places.size() == bits);
    CHECK(*places.rbegin() == bits - 1);
    const std::vector<Message> copies = copies_of(key, 40);
    double equal = 0, pairs = 0;
    for (std::size_t i = 0; i < copies.size(); ++i) {
      for (const std::size_t place : code.shared()) CHECK(copies[i][place] == copies[0][place]);
      for (std::size_t j = 0; j < i; ++j) {
        for (const std::size_t place : code.naming()) equal += copies[i][place] == copies[j][place] ? 1 : 0;
        pairs += 1;
      }
    }
    const double naming = static_cast<double>(code.naming().size());
    CHECK(std::abs(equal / pairs - naming / 2) < 4 * std::sqrt(naming / 4 / pairs) + 0.01);
  }
}

TEST_CASE("proof/recipient_code: messages are fixed for ever, whatever the number of recipients") {
  const OwnerKey key = recipients_key(1);
  CHECK(copy_of(key, 1).hex() == "285fcd108f98");
  CHECK(copy_of(key, 2).hex() == "09b85e10af48");
  CHECK(copy_of(key, 10).hex() == "2b7f4b109fd8");
  OwnerKey larger = key;
  larger.recipients = 5000;
  for (std::size_t j = 1; j <= 10; ++j) CHECK(copy_of(larger, j) == copy_of(key, j));
  CHECK(larger.commitment() != key.commitment());
  OwnerKey without = key;
  without.recipients = 0;
  CHECK(message_of(without) != copy_of(key, 0));
}

TEST_CASE("proof/recipient_code: each copy's message is a random one over random keys") {
  // Bits of 3000 keys are 1 half of the time, the shared ones too; and two copies agree in 36 of 48 bits, not in 24.
  constexpr std::size_t keys = 3000;
  std::vector<std::size_t> ones(48);
  double equal = 0;
  for (std::size_t i = 0; i < keys; ++i) {
    const OwnerKey key = recipients_key(i);
    const Message first = copy_of(key, 1), second = copy_of(key, 2);
    for (std::size_t b = 0; b < 48; ++b) ones[b] += first[b] ? 1 : 0;
    equal += static_cast<double>(first.matches(second));
  }
  for (const std::size_t count : ones)
    CHECK(std::abs(static_cast<double>(count) - keys / 2.0) < 4.5 * std::sqrt(keys / 4.0));
  CHECK(equal / keys == doctest::Approx(36).epsilon(0.01));
}

TEST_CASE("proof/recipient_code: how many recipients a message tells apart, and what is said of more") {
  CHECK(most_recipients(16) == 0);
  CHECK(most_recipients(32) == 65);
  CHECK(most_recipients(48) == 16777);
  CHECK(most_recipients(64) == recipients_limit);
  CHECK(recipients_limit == OwnerKey::recipients_limit);
  for (const auto& [bits, recipients, word] : {std::tuple<std::size_t, std::size_t, const char*>{16, 2, "48 or 64"},
                                               {48, 1, "number of copies"},
                                               {48, 16778, "16777"},
                                               {64, 100001, "100000"}}) {
    const Result<Done> refused = check_recipients(bits, recipients);
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.error().remedy.find(word) != std::string::npos);
    CHECK_FALSE(verify_key(recipients_key(1, bits, recipients), {}).ok());
  }
  CHECK(check_recipients(48, 16777).ok());
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
