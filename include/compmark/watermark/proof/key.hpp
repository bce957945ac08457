// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Secrets that the watermark derives from an owner's key (io/owner_key.hpp): the message, the seed of the carriers and
// the mask of a payload. Each has a label of its own, so that none of them reveals another. A key is anything with
// derive(label, out) and bits. Without a payload, a message is random bits. With one, it is the payload's code word
// (ecc.hpp) plus the mask; the mask is random, so that such a message is as random and its p-value as exact. Keys with
// one secret and different payloads mark copies that any one of these keys can read. But someone who learns one message
// and its payload knows the mask, and so the messages of all copies. Copies for recipients (recipient_code.hpp) do not
// have that weakness.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/watermark/proof/ecc.hpp"
#include "compmark/watermark/proof/message.hpp"
#include "compmark/watermark/proof/recipient_code.hpp"

namespace compmark {

template <class K>
concept SecretKey = requires(const K& key, std::string_view label, std::span<std::byte> out) {
  key.derive(label, out);
  { key.bits } -> std::convertible_to<std::size_t>;
};

/// A key that may have a payload: `payload` in hexadecimal digits, `corrects` wrong bits; 0: no payload.
template <class K>
concept PayloadKey = SecretKey<K> && requires(const K& key) {
  { key.payload } -> std::convertible_to<std::string_view>;
  { key.corrects } -> std::convertible_to<std::size_t>;
};

/// A key that may have recipients: how many, and whose copy message_of is for (recipient_code.hpp); 0: none.
template <class K>
concept RecipientKey = SecretKey<K> && requires(const K& key) {
  { key.recipients } -> std::convertible_to<std::size_t>;
  { key.recipient } -> std::convertible_to<std::size_t>;
};

inline constexpr std::string_view message_label = "compmark/message/v1";
inline constexpr std::string_view carriers_label = "compmark/carriers/v1";
inline constexpr std::string_view payload_label = "compmark/payload/v1";

namespace detail {
template <SecretKey K>
[[nodiscard]] Message derived_bits(const K& key, std::string_view label) {
  std::array<std::byte, message_bits_limit / 8> bytes{};
  key.derive(label, bytes);
  return Message::from_bytes(bytes, key.bits);
}
}  // namespace detail

/// Bits that are added to a code word (ecc.hpp) before it is embedded: the embedded message is then as random as one
/// without a payload, and its p-value as exact.
template <SecretKey K>
[[nodiscard]] Message payload_mask(const K& key) {
  return detail::derived_bits(key, payload_label);
}

/// The code of a key's payload: BCH that corrects key.corrects bits, with an 8-bit CRC.
template <PayloadKey K>
[[nodiscard]] Result<PayloadCode> payload_code(const K& key) {
  return PayloadCode::make(key.bits, key.corrects, CrcKind::crc8);
}

/// One line where a key's payload does not fit its code; keys without one are fine.
template <SecretKey K>
[[nodiscard]] Result<Done> check_payload(const K& key) {
  if constexpr (PayloadKey<K>) {
    if (key.corrects == 0) return Done{};
    const Result<PayloadCode> code = payload_code(key);
    if (!code) return code.error();
    if (const Result<Message> data = Message::from_hex(key.payload, code->data_bits()); !data) {
      Error error = data.error();
      error.field = "payload";
      const std::size_t bits = code->data_bits(), last = 4 - (4 - bits % 4) % 4;  // bits of the last digit
      error.remedy = "this message has room for " + std::to_string(bits) + " bits of payload, " +
                     std::to_string((bits + 3) / 4) + " digits";
      if (last != 4)
        error.remedy += ", the last of which is " + std::string(last == 3   ? "even"
                                                                : last == 2 ? "0, 4, 8 or c"
                                                                            : "0 or 8");
      return error;
    }
  }
  return Done{};
}

/// The message of a key: that of the copy of key.recipient where there are recipients, code word and mask where there is
/// a payload, else random bits. The key passes check_payload.
template <SecretKey K>
[[nodiscard]] Message message_of(const K& key) {
  if constexpr (RecipientKey<K>) {
    if (key.recipients != 0) return RecipientCode(key).message(key, key.recipient);
  }
  if constexpr (PayloadKey<K>) {
    const bool fits = check_payload(key).ok();
    COMPMARK_ASSERT(fits, "message_of: a payload that fits (check_payload), or none");
    if (key.corrects != 0 && fits) {
      const Result<PayloadCode> code = payload_code(key);
      return code->encode(*Message::from_hex(key.payload, code->data_bits())) ^ payload_mask(key);
    }
  }
  return detail::derived_bits(key, message_label);
}

/// The payload of read bits, under the secret of a key; the key's own payload is not used. The key passes check_payload
/// and has corrects > 0.
template <PayloadKey K>
[[nodiscard]] PayloadCode::Reading read_payload(const K& key, const Message& read) {
  const Result<PayloadCode> code = payload_code(key);
  COMPMARK_ASSERT(code.ok() && read.size() == key.bits, "read_payload: a key with a payload, a message of its length");
  return code->decode(read ^ payload_mask(key));
}

/// Seed of the secret carriers, 256 bits.
template <SecretKey K>
[[nodiscard]] std::array<std::uint64_t, 4> carrier_seed(const K& key) {
  std::array<std::byte, 32> bytes{};
  key.derive(carriers_label, bytes);
  std::array<std::uint64_t, 4> seed{};
  for (std::size_t i = 0; i < bytes.size(); ++i)
    seed[i / 8] = seed[i / 8] << 8 | std::to_integer<std::uint64_t>(bytes[i]);
  return seed;
}

}  // namespace compmark
