// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Keys with recipients, by number, and the messages of their copies.
#pragma once

#include <compmark/io/owner_key.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <compmark/watermark/proof/message.hpp>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace compmark::testing {

inline OwnerKey recipients_key(std::uint64_t number, std::size_t bits = 48, std::size_t recipients = 10) {
  Digest256 secret{};
  secret[0] = std::byte{7};
  for (std::size_t i = 0; i < 8; ++i) secret[31 - i] = static_cast<std::byte>(number >> (8 * i) & 0xFF);
  OwnerKey key = *make_key(secret, "2026-01-31T23:59:59Z", bits);
  key.recipients = recipients;
  return key;
}
inline Message copy_of(OwnerKey key, std::size_t recipient) {
  key.recipient = recipient;
  return message_of(key);
}
inline std::vector<Message> copies_of(const OwnerKey& key, std::size_t count) {
  std::vector<Message> copies;
  for (std::size_t j = 1; j <= count; ++j) copies.push_back(copy_of(key, j));
  return copies;
}

}  // namespace compmark::testing
