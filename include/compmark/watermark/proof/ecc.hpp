// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An error-correcting code for payloads: binary BCH codes of length 2^m - 1 (Bose, Ray-Chaudhuri 1960; Hocquenghem
// 1959), shortened to the length of the message, with a CRC over the data. Decoding is Berlekamp and Massey's, roots by
// Chien search. A word with more errors than the code corrects is refused, unless it lies by chance near another code
// word (1.3 % of random words for (48, 24, 4)). The CRC misses one in 2^8 or 2^16 of those. A code reads an unknown
// payload; whether a known message is there is decided by verify.hpp on the raw bits, never by a successful decoding
// (docs/spec/watermark.md, 5). Cost: ~1 us a word, no allocation.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/math/binomial.hpp"
#include "compmark/watermark/proof/message.hpp"

namespace compmark {

class BchCode {
 public:
  struct Decoded {
    Message payload;
    std::size_t corrected = 0;  ///< bits that were wrong
  };

  /// The code of `length` bits (8 to 127) that corrects `correctable` wrong ones, of the shortest field that holds it.
  [[nodiscard]] static Result<BchCode> make(std::size_t length, std::size_t correctable) {
    const auto refuse = [&](std::string problem) {
      return Error{ErrorKind::invalid, "", "code", std::move(problem), "choose a longer message or correct fewer bits"};
    };
    if (length < 8 || length > 127) return refuse("there is none of " + std::to_string(length) + " bits (8 to 127)");
    if (correctable < 1 || correctable > most_correctable)
      return refuse("none corrects " + std::to_string(correctable) + " bits (1 to 15)");
    BchCode code;
    code.length_ = length;
    code.correctable_ = correctable;
    unsigned degree = 4;
    while ((std::size_t{1} << degree) - 1 < length) ++degree;
    code.make_field(degree);
    code.make_generator();
    if (code.parity_ >= length) {
      return refuse(std::to_string(length) + " bits leave no payload beside the parity that corrects " +
                    std::to_string(correctable));
    }
    return code;
  }

  [[nodiscard]] std::size_t length() const { return length_; }
  [[nodiscard]] std::size_t payload_bits() const { return length_ - parity_; }
  [[nodiscard]] std::size_t correctable() const { return correctable_; }

  /// Payload first, parity after it.
  [[nodiscard]] Message encode(const Message& payload) const {
    COMPMARK_ASSERT(payload.size() == payload_bits(), "BchCode::encode: a payload of payload_bits()");
    Polynomial rest = 0;
    const Polynomial mask = (Polynomial{1} << parity_) - 1;
    Message word(length_);
    for (std::size_t i = 0; i < payload.size(); ++i) {
      word.set(i, payload[i]);
      const bool feedback = payload[i] != ((rest >> (parity_ - 1) & 1u) != 0);
      rest = rest << 1 & mask;
      if (feedback) rest ^= generator_ & mask;
    }
    for (std::size_t i = 0; i < parity_; ++i) word.set(payload.size() + i, (rest >> (parity_ - 1 - i) & 1u) != 0);
    return word;
  }

  /// The payload of the code word within correctable() bits; empty if there is none.
  [[nodiscard]] std::optional<Decoded> decode(Message word) const {
    COMPMARK_ASSERT(word.size() == length_, "BchCode::decode: a word of length()");
    const std::size_t checks = 2 * correctable_;
    std::array<std::uint8_t, 2 * most_correctable> syndrome{};
    bool clean = true;
    for (std::size_t j = 0; j < checks; ++j) {
      for (std::size_t i = 0; i < length_; ++i) {
        if (word[i]) syndrome[j] ^= power((j + 1) * (length_ - 1 - i));
      }
      clean = clean && syndrome[j] == 0;
    }
    std::size_t errors = 0;
    if (!clean) {
      Locator locator{};
      errors = locate(syndrome, locator);
      if (errors > correctable_) return std::nullopt;
      std::size_t found = 0;
      for (std::size_t place = 0; place < length_; ++place) {  // the root alpha^-place is an error at x^place
        std::uint8_t value = locator[0];
        for (std::size_t k = 1; k <= errors; ++k) {
          if (locator[k] != 0) value ^= power(log_[locator[k]] + k * (order_ - place % order_));
        }
        if (value == 0) {
          word.flip(length_ - 1 - place);
          ++found;
        }
      }
      if (found != errors) return std::nullopt;  // roots in the part that was shortened away, or repeated
    }
    Decoded result{Message(payload_bits()), errors};
    for (std::size_t i = 0; i < result.payload.size(); ++i) result.payload.set(i, word[i]);
    return result;
  }

  /// Probability that a word is decoded whose bits are wrong independently with probability `error_rate`.
  [[nodiscard]] double decode_probability(double error_rate) const {
    return 1 - binomial_tail(correctable_ + 1, length_, error_rate);
  }
  /// Share of random words that lie near some code word, and so decode although nothing is there (before the CRC).
  [[nodiscard]] double random_decode_rate() const {
    return binomial_tail(length_ - correctable_, length_) * std::ldexp(1.0, static_cast<int>(payload_bits()));
  }

 private:
  static constexpr std::size_t most_correctable = 15;
  __extension__ using Polynomial = unsigned __int128;  // over GF(2), bit i is the coefficient of x^i
  using Locator = std::array<std::uint8_t, 2 * most_correctable + 1>;

  BchCode() = default;
  [[nodiscard]] std::uint8_t power(std::size_t exponent) const { return power_[exponent % order_]; }
  [[nodiscard]] std::uint8_t product(std::uint8_t a, std::uint8_t b) const {
    return a == 0 || b == 0 ? std::uint8_t{0} : power(std::size_t{log_[a]} + log_[b]);
  }
  [[nodiscard]] std::uint8_t quotient(std::uint8_t a, std::uint8_t b) const {
    return a == 0 ? std::uint8_t{0} : power(std::size_t{log_[a]} + order_ - log_[b]);
  }

  /// GF(2^degree), degree 4 to 7, by the primitive polynomials of lowest weight.
  void make_field(unsigned degree) {
    constexpr std::array<unsigned, 4> primitive{0x13, 0x25, 0x43, 0x89};
    order_ = (std::size_t{1} << degree) - 1;
    unsigned value = 1;
    for (std::size_t i = 0; i < order_; ++i) {
      power_[i] = static_cast<std::uint8_t>(value);
      log_[value] = static_cast<std::uint8_t>(i);
      value <<= 1;
      if (value > order_) value ^= primitive[degree - 4];
    }
  }

  /// Product of (x - alpha^j) over all conjugates of alpha, alpha^3, ..., alpha^(2t - 1): its coefficients are 0 and 1.
  void make_generator() {
    std::array<bool, 127> root{};
    for (std::size_t i = 1; i < 2 * correctable_; i += 2) {
      for (std::size_t j = i % order_; !root[j]; j = 2 * j % order_) root[j] = true;
    }
    std::array<std::uint8_t, 128> coefficient{1};
    parity_ = 0;
    for (std::size_t j = 0; j < order_; ++j) {
      if (!root[j]) continue;
      ++parity_;
      for (std::size_t k = parity_; k > 0; --k)
        coefficient[k] = static_cast<std::uint8_t>(coefficient[k - 1] ^ product(coefficient[k], power_[j]));
      coefficient[0] = product(coefficient[0], power_[j]);
    }
    for (std::size_t k = 0; k <= parity_; ++k) {
      if (coefficient[k] != 0) generator_ |= Polynomial{1} << k;
    }
  }

  /// Berlekamp and Massey: the shortest recurrence that makes the syndromes; returns its length.
  std::size_t locate(const std::array<std::uint8_t, 2 * most_correctable>& syndrome, Locator& locator) const {
    Locator previous{};
    locator[0] = previous[0] = 1;
    std::size_t length = 0, gap = 1;
    std::uint8_t previous_discrepancy = 1;
    for (std::size_t n = 0; n < 2 * correctable_; ++n, ++gap) {
      std::uint8_t discrepancy = syndrome[n];
      for (std::size_t k = 1; k <= length; ++k) discrepancy ^= product(locator[k], syndrome[n - k]);
      if (discrepancy == 0) continue;
      const Locator kept = locator;
      const std::uint8_t factor = quotient(discrepancy, previous_discrepancy);
      for (std::size_t k = 0; k + gap < locator.size(); ++k) locator[k + gap] ^= product(factor, previous[k]);
      if (2 * length <= n) {
        length = n + 1 - length;
        previous = kept;
        previous_discrepancy = discrepancy;
        gap = 0;
      }
    }
    return length;
  }

  std::size_t length_ = 0, parity_ = 0, correctable_ = 0, order_ = 0;
  Polynomial generator_ = 0;
  std::array<std::uint8_t, 127> power_{};  ///< alpha^i
  std::array<std::uint8_t, 128> log_{};
};

/// Check bits behind the data: CRC-8/AUTOSAR or CRC-16/CCITT-FALSE (of the bits, highest first). Neither takes zeros
/// for valid.
enum class CrcKind : std::uint8_t { none = 0, crc8 = 8, crc16 = 16 };

[[nodiscard]] inline unsigned crc_of(const Message& data, CrcKind kind) {
  if (kind == CrcKind::none) return 0;
  const unsigned width = static_cast<unsigned>(kind), top = 1u << (width - 1), mask = 2 * top - 1;
  const unsigned polynomial = kind == CrcKind::crc8 ? 0x2F : 0x1021;
  unsigned crc = mask;
  for (std::size_t i = 0; i < data.size(); ++i) {
    const bool feedback = ((crc & top) != 0) != data[i];
    crc = (crc << 1 & mask) ^ (feedback ? polynomial : 0u);
  }
  return kind == CrcKind::crc8 ? crc ^ mask : crc;
}

/// Data, CRC and parity in one message.
struct PayloadCode {
  BchCode code;
  CrcKind crc = CrcKind::crc8;

  enum class Outcome : std::uint8_t { read, crc_failed, too_many_errors };
  struct Reading {
    Outcome outcome = Outcome::too_many_errors;
    Message data;               ///< valid only if read
    std::size_t corrected = 0;  ///< wrong bits of the message; valid unless too_many_errors
  };

  /// A message of `length` bits that corrects `correctable`; an Error if no bit of data is left.
  [[nodiscard]] static Result<PayloadCode> make(std::size_t length, std::size_t correctable,
                                                CrcKind crc = CrcKind::crc8) {
    Result<BchCode> code = BchCode::make(length, correctable);
    if (!code) return code.error();
    if (code->payload_bits() <= static_cast<std::size_t>(crc)) {
      return Error{ErrorKind::invalid, "", "code",
                   std::to_string(code->payload_bits()) + " payload bits leave no data beside the CRC",
                   "choose a longer message, a shorter CRC, or correct fewer bits"};
    }
    return PayloadCode{*code, crc};
  }

  [[nodiscard]] std::size_t data_bits() const { return code.payload_bits() - static_cast<std::size_t>(crc); }
  [[nodiscard]] Message encode(const Message& data) const {
    COMPMARK_ASSERT(data.size() == data_bits(), "PayloadCode::encode: data of data_bits()");
    Message payload(code.payload_bits());
    for (std::size_t i = 0; i < data.size(); ++i) payload.set(i, data[i]);
    const unsigned check = crc_of(data, crc);
    const std::size_t width = static_cast<std::size_t>(crc);
    for (std::size_t i = 0; i < width; ++i) payload.set(data.size() + i, (check >> (width - 1 - i) & 1u) != 0);
    return code.encode(payload);
  }
  [[nodiscard]] Reading decode(const Message& word) const {
    const std::optional<BchCode::Decoded> decoded = code.decode(word);
    if (!decoded) return {};
    Reading reading{Outcome::read, Message(data_bits()), decoded->corrected};
    for (std::size_t i = 0; i < reading.data.size(); ++i) reading.data.set(i, decoded->payload[i]);
    unsigned stored = 0;
    for (std::size_t i = reading.data.size(); i < decoded->payload.size(); ++i)
      stored = 2 * stored + (decoded->payload[i] ? 1u : 0u);
    if (stored != crc_of(reading.data, crc)) reading.outcome = Outcome::crc_failed;
    return reading;
  }
};

}  // namespace compmark
