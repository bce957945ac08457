// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the watermark takes from an owner's key (io/owner_key.hpp): the message, the seed of the carriers and the mask of a payload, each under
// a label of its own, so that no one of them tells another. A key that gives bytes is anything with derive(label, out) and bits.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "compmark/mark/message.hpp"

namespace compmark::inline v0 {

template <class K>
concept SecretKey = requires(const K& key, std::string_view label, std::span<std::byte> out) {
  key.derive(label, out);
  { key.bits } -> std::convertible_to<std::size_t>;
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

/// The message of a key.
template <SecretKey K>
[[nodiscard]] Message message_of(const K& key) {
  return detail::derived_bits(key, message_label);
}

/// Bits that are added to a code word (ecc.hpp) before it is embedded: the embedded message is then as random as one without a payload, and
/// its p-value as exact.
template <SecretKey K>
[[nodiscard]] Message payload_mask(const K& key) {
  return detail::derived_bits(key, payload_label);
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

}  // namespace compmark::inline v0
