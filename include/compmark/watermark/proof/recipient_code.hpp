// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Messages for the copies of N recipients under one key. Half of the bits, at places that follow from the secret, are
// the same in every copy: they survive when copies are averaged, and prove the owner. The others name the recipient: a
// Tardos code (recipient_score.hpp) of bias 1/2. Everything is drawn from the key by HKDF, in whole numbers, so that
// any machine finds the same bits from the key file alone, and no word depends on N: a key of more recipients reads the
// copies of before.
//
// The split and the bias are calculated (docs/threat_model.md#copies-for-recipients). With half of 48 bits shared, all
// 24 are less likely than 6e-8 by chance, below the usual rate of 1e-6, and 24 bits tell 16,777 recipients apart at one
// false name in a thousand. Bias 1/2 is the cut-off arcsine law at its end; smaller cut-offs pay off against many
// colluders and hundreds of bits, and with 16 to 32 bits they name a single leak, or one of two, less often.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/watermark/proof/message.hpp"

namespace compmark {

inline constexpr std::string_view recipient_places_label = "compmark/recipients/v1/places";
inline constexpr std::string_view recipient_mask_label = "compmark/recipients/v1/mask";
inline constexpr std::string_view recipient_word_label = "compmark/recipients/v1/word/";  // and the number, decimal

/// Rate of false names that a key's number of recipients is measured by.
inline constexpr double usual_recipient_rate = 1e-3;
/// Words are compared one by one: 5 us each.
inline constexpr std::size_t recipients_limit = 100'000;  // as OwnerKey's

/// How many bits of a message all copies share; the rest names the recipient.
[[nodiscard]] constexpr std::size_t shared_bits(std::size_t bits) { return bits / 2; }

/// The largest number of recipients of whom one can be named at the usual rate where all his bits match:
/// N / 2^(bits that name) <= 1/1000. 65 of 32 bits, 16,777 of 48, and recipients_limit of 64; 0: none.
[[nodiscard]] inline std::size_t most_recipients(std::size_t bits) {
  const double words = std::exp2(static_cast<double>(bits - shared_bits(bits)));
  const auto most = static_cast<std::size_t>(
      std::fmin(static_cast<double>(recipients_limit), std::floor(words * usual_recipient_rate)));
  return most < 2 ? 0 : most;
}

/// An error if messages of so many bits cannot name one of so many recipients.
[[nodiscard]] inline Result<Done> check_recipients(std::size_t bits, std::size_t recipients) {
  const std::size_t most = most_recipients(bits);
  if (recipients >= 2 && recipients <= most) return Done{};
  const std::string asked = "is " + std::to_string(recipients);
  if (most == 0) {
    return Error{ErrorKind::invalid, "", "recipients",
                 asked + ", and " + std::to_string(bits) + " bits are too few to name any recipient",
                 "make the key with 48 or 64 bits"};
  }
  if (recipients < 2) {
    return Error{ErrorKind::invalid, "", "recipients", asked + ", and copies are told apart from two recipients on",
                 "give the number of copies that will be handed out, or leave it out"};
  }
  return Error{ErrorKind::invalid, "", "recipients",
               asked + ", and " + std::to_string(bits) + " bits tell " + std::to_string(most) + " recipients apart",
               bits < 64 ? "make the key with more bits, or give at most " + std::to_string(most)
                         : "give at most " + std::to_string(most) + ", or make a key for each group"};
}

class RecipientCode {
 public:
  /// Of a key of at least 2 bits: anything with derive(label, out) and bits.
  template <class K>
  explicit RecipientCode(const K& key) : mask_(1) {
    const std::size_t bits = key.bits;
    COMPMARK_ASSERT(bits >= 2 && bits <= message_bits_limit, "RecipientCode: 2 to 128 bits");
    std::array<std::byte, 8 * message_bits_limit> bytes{};
    key.derive(recipient_places_label, bytes);
    std::vector<std::pair<std::uint64_t, std::size_t>> order;
    for (std::size_t i = 0; i < bits; ++i) {
      std::uint64_t word = 0;
      for (std::size_t b = 0; b < 8; ++b) word = word << 8 | std::to_integer<std::uint64_t>(bytes[8 * i + b]);
      order.emplace_back(word, i);
    }
    std::sort(order.begin(), order.end());
    for (std::size_t i = 0; i < bits; ++i) (i < shared_bits(bits) ? shared_ : naming_).push_back(order[i].second);
    std::sort(shared_.begin(), shared_.end());
    std::sort(naming_.begin(), naming_.end());
    std::array<std::byte, message_bits_limit / 8> mask{};
    key.derive(recipient_mask_label, mask);
    mask_ = Message::from_bytes(mask, bits);
  }

  /// Places of the bits that all copies share, ascending.
  [[nodiscard]] std::span<const std::size_t> shared() const { return shared_; }
  /// Places of the bits that name the recipient, ascending.
  [[nodiscard]] std::span<const std::size_t> naming() const { return naming_; }
  /// The message of the copy of recipient 1, 2, … of `key`, the one of the constructor. 0 is nobody: the shared bits,
  /// and the mask at the others.
  template <class K>
  [[nodiscard]] Message message(const K& key, std::size_t recipient) const {
    Message message = mask_;
    if (recipient == 0) return message;
    std::array<std::byte, message_bits_limit / 8> bytes{};
    key.derive(std::string(recipient_word_label) + std::to_string(recipient), bytes);
    const Message word = Message::from_bytes(bytes, naming_.size());
    for (std::size_t i = 0; i < naming_.size(); ++i) {
      if (word[i]) message.flip(naming_[i]);
    }
    return message;
  }

 private:
  std::vector<std::size_t> shared_, naming_;
  Message mask_;  ///< makes every copy's message as random as one without recipients, for whoever lacks the secret
};

}  // namespace compmark
