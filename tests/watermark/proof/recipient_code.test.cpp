// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/io/owner_key.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <compmark/watermark/proof/recipient_code.hpp>
#include <cstddef>
#include <set>
#include <tuple>
#include <vector>

#include "watermark/proof/recipients_key.hpp"

using namespace compmark;
using testing::copies_of;
using testing::copy_of;
using testing::recipients_key;

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
  }
  CHECK(check_recipients(48, 16777).ok());
}
