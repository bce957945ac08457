// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The bits that are hidden: 1 to 128 of them, with the texts they are written in and the ways they are drawn. A logit z
// reads as the bit z > 0 (docs/spec/method.md, 5.4). A message for real use is drawn from an owner's key (key.hpp); the
// published seeds are here to compare with published models, their messages are public and prove nothing
// (docs/spec/watermark.md, 8.1). 24 bytes, no allocation.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

/// Lengths a message can have.
inline constexpr std::size_t message_bits_limit = 128;

namespace detail {
/// MT19937 (Matsumoto, Nishimura 1998): the published messages come from it; nothing else in the library does.
class PublishedGenerator {
 public:
  explicit PublishedGenerator(std::uint32_t seed) {
    state_[0] = seed;
    for (std::uint32_t i = 1; i < 624; ++i) state_[i] = 1812433253u * (state_[i - 1] ^ (state_[i - 1] >> 30)) + i;
  }
  std::uint32_t operator()() {
    if (next_ == 624) refill();
    std::uint32_t y = state_[next_++];
    y ^= y >> 11;
    y ^= (y << 7) & 0x9D2C5680u;
    y ^= (y << 15) & 0xEFC60000u;
    return y ^ (y >> 18);
  }

 private:
  void refill() {
    for (std::size_t i = 0; i < 624; ++i) {
      const std::uint32_t y = (state_[i] & 0x80000000u) | (state_[(i + 1) % 624] & 0x7FFFFFFFu);
      state_[i] = state_[(i + 397) % 624] ^ (y >> 1) ^ ((y & 1u) != 0 ? 0x9908B0DFu : 0u);
    }
    next_ = 0;
  }
  std::array<std::uint32_t, 624> state_{};
  std::size_t next_ = 624;
};
}  // namespace detail

class Message {
 public:
  Message() = default;
  /// All zero.
  explicit Message(std::size_t bits) : size_(bits) {
    COMPMARK_ASSERT(bits >= 1 && bits <= message_bits_limit, "Message: 1 to 128 bits");
  }

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool operator[](std::size_t i) const { return (words_[i / 64] >> (i % 64) & 1u) != 0; }
  void set(std::size_t i, bool value) {
    COMPMARK_ASSERT(i < size_, "Message: bit out of range");
    const std::uint64_t one = std::uint64_t{1} << (i % 64);
    words_[i / 64] = value ? words_[i / 64] | one : words_[i / 64] & ~one;
  }
  void flip(std::size_t i) { set(i, !(*this)[i]); }

  [[nodiscard]] std::size_t ones() const {
    return static_cast<std::size_t>(std::popcount(words_[0]) + std::popcount(words_[1]));
  }
  /// Number of equal bits. Both messages have the same length.
  [[nodiscard]] std::size_t matches(const Message& other) const { return size_ - (*this ^ other).ones(); }
  /// Share of equal bits, 1/2 for a message that has nothing to do with this one.
  [[nodiscard]] double bit_accuracy(const Message& other) const {
    return static_cast<double>(matches(other)) / static_cast<double>(size_);
  }
  [[nodiscard]] Message operator^(const Message& other) const {
    COMPMARK_ASSERT(size_ == other.size_, "Message: two messages of one length");
    Message result = *this;
    for (std::size_t w = 0; w < words_.size(); ++w) result.words_[w] ^= other.words_[w];
    return result;
  }
  [[nodiscard]] bool operator==(const Message&) const = default;

  /// '0' and '1', bit 0 first, as the published messages are written.
  [[nodiscard]] std::string binary() const {
    std::string text(size_, '0');
    for (std::size_t i = 0; i < size_; ++i) text[i] = (*this)[i] ? '1' : '0';
    return text;
  }
  /// Bit 0 is the highest of the first digit; the last digit is filled up with zeros.
  [[nodiscard]] std::string hex() const {
    std::string text;
    for (std::size_t i = 0; i < size_; i += 4) {
      unsigned digit = 0;
      for (std::size_t k = 0; k < 4; ++k) digit = 2 * digit + (i + k < size_ && (*this)[i + k] ? 1u : 0u);
      text += "0123456789abcdef"[digit];
    }
    return text;
  }

  /// Bits from the low ends of two words, for keyed generators. Excess bits are dropped.
  [[nodiscard]] static Message from_words(std::uint64_t low, std::uint64_t high, std::size_t bits) {
    Message message(bits);
    message.words_ = {low, high};
    const std::size_t kept = bits % 64;
    if (bits <= 64) message.words_[1] = 0;
    if (kept != 0) message.words_[bits / 64] &= (std::uint64_t{1} << kept) - 1;
    return message;
  }
  /// The first bits of some bytes, the highest of each byte first. At least bits / 8 bytes, rounded up.
  [[nodiscard]] static Message from_bytes(std::span<const std::byte> bytes, std::size_t bits) {
    COMPMARK_ASSERT(8 * bytes.size() >= bits, "Message::from_bytes: too few bytes");
    Message message(bits);
    for (std::size_t i = 0; i < bits; ++i) {
      message.set(i, (std::to_integer<unsigned>(bytes[i / 8]) >> (7 - i % 8) & 1u) != 0);
    }
    return message;
  }
  /// The bits of logits, z > 0; NaN reads as 0 (verify.hpp refuses it before).
  template <class T>
  [[nodiscard]] static Message from_logits(std::span<const T> logits) {
    Message message(logits.size());
    for (std::size_t i = 0; i < logits.size(); ++i) message.set(i, logits[i] > T(0));
    return message;
  }
  /// The message of published models: the signs of the first normal numbers of their framework's generator after
  /// manual_seed(seed) (docs/spec/method.md, 5.4). MT19937, groups of 16 uniforms of 24 bits, Box and Muller with the
  /// angle in the second eight. Signs of cos and sin are read off the quadrant; at the borders they are those of the
  /// angle rounded to float.
  [[nodiscard]] static Message from_published_seed(std::uint32_t seed, std::size_t bits) {
    constexpr std::uint32_t quarter = 1u << 22;
    detail::PublishedGenerator generator(seed);
    Message message(bits);
    for (std::size_t group = 0; group < bits; group += 16) {
      for (std::size_t j = 0; j < 16; ++j) {
        const std::uint32_t angle = static_cast<std::uint32_t>(generator()) & 0xFFFFFFu;
        if (j < 8) continue;  // the radius has no sign
        const std::size_t i = group + j - 8;
        if (i < bits) message.set(i, angle < quarter || angle >= 3 * quarter);
        if (i + 8 < bits) message.set(i + 8, angle > 0 && angle < 2 * quarter);
      }
    }
    return message;
  }

  /// From a text of '0' and '1'.
  [[nodiscard]] static Result<Message> from_binary(std::string_view text) {
    if (text.empty() || text.size() > message_bits_limit) return wrong_length(text.size());
    Message message(text.size());
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (text[i] != '0' && text[i] != '1') return wrong_character(text[i], i, "0 and 1");
      message.set(i, text[i] == '1');
    }
    return message;
  }
  /// From hexadecimal digits, as hex() writes them: exactly ceil(bits / 4) digits, nothing set beyond the last bit.
  [[nodiscard]] static Result<Message> from_hex(std::string_view text, std::size_t bits) {
    if (bits == 0 || bits > message_bits_limit) return wrong_length(bits);
    if (text.size() != (bits + 3) / 4) {
      return Error{ErrorKind::invalid, "", "message",
                   "has " + std::to_string(text.size()) + " hexadecimal digits, " + std::to_string(bits) +
                       " bits are " + std::to_string((bits + 3) / 4),
                   "give the message of this length"};
    }
    Message message(bits);
    for (std::size_t digit = 0; digit < text.size(); ++digit) {
      const char c = text[digit];
      const bool lower = c >= 'a' && c <= 'f', upper = c >= 'A' && c <= 'F';
      if (!lower && !upper && (c < '0' || c > '9')) return wrong_character(c, digit, "hexadecimal digits");
      const unsigned value = static_cast<unsigned>(c - (lower ? 'a' - 10 : upper ? 'A' - 10 : '0'));
      for (std::size_t k = 0; k < 4; ++k) {
        const bool bit = (value >> (3 - k) & 1u) != 0;
        if (4 * digit + k < bits) {
          message.set(4 * digit + k, bit);
        } else if (bit) {
          return Error{ErrorKind::invalid, "", "message", "has more than " + std::to_string(bits) + " bits",
                       "clear the unused bits of the last digit"};
        }
      }
    }
    return message;
  }

 private:
  [[nodiscard]] static Error wrong_length(std::size_t bits) {
    return {ErrorKind::invalid, "", "message", "has " + std::to_string(bits) + " bits",
            "a message has 1 to " + std::to_string(message_bits_limit)};
  }
  [[nodiscard]] static Error wrong_character(char c, std::size_t at, const std::string& expected) {
    const unsigned code = static_cast<unsigned char>(c);
    return {ErrorKind::malformed, "", "message",
            (code > 32 && code < 127 ? std::string("'") + c + "'" : "byte " + std::to_string(code)) + " at place " +
                std::to_string(at),
            "a message is written with " + expected + " only"};
  }

  std::array<std::uint64_t, 2> words_{};  ///< bit i is bit i % 64 of word i / 64; unused bits are 0
  std::size_t size_ = 0;
};

/// Number of logits whose sign is that of the message's bit.
template <class T>
[[nodiscard]] std::size_t matches(const Message& message, std::span<const T> logits) {
  COMPMARK_ASSERT(message.size() == logits.size(), "matches: one logit a bit");
  std::size_t count = 0;
  for (std::size_t i = 0; i < logits.size(); ++i) count += (logits[i] > T(0)) == message[i] ? 1 : 0;
  return count;
}

}  // namespace compmark
