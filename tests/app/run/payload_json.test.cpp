// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/run/payload_json.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <cstddef>

TEST_CASE("app/run/payload_json: a payload is read from its message, with few wrong bits too, and not with many") {
  using namespace compmark;
  Digest256 secret{};
  secret[5] = std::byte{9};
  OwnerKey key = *make_key(secret, "2026-01-31T23:59:59Z", 48);
  key.payload = "5eed";
  key.corrects = 4;
  REQUIRE(check_payload(key).ok());
  Message message = message_of(key);
  CHECK(payload_json(key, message)["outcome"] == "read");
  CHECK(payload_json(key, message)["hex"] == "5eed");
  for (std::size_t i = 0; i < 3; ++i) message.set(7 * i, !message[7 * i]);
  CHECK(payload_json(key, message)["corrected"] == 3);
  for (std::size_t i = 0; i < message.size(); i += 2) message.set(i, !message[i]);
  CHECK(payload_json(key, message)["outcome"] != "read");
  CHECK(payload_json(key, message)["hex"].is_null());
  CHECK(payload_json(key, message)["chance"].get<double>() < 0.5);
}
