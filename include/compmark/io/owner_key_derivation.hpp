// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An owner's key: what its secret gives, and its commitment. One secret of 256 bits gives everything by HKDF under a
// label of its purpose (watermark/proof/key.hpp), so that a message that becomes known says nothing about the carriers.
// From version 2 on scrypt comes first, 0.6 s and 128 MiB a key: of others, millions a second can be tried until one
// fits a picture (docs/threat_model.md). A key of version 3 is bound to the file of one decoder: its SHA-256 goes into
// scrypt with the secret, so that nobody can make a decoder that says the key's message: another file, another message.
// A key of version 4 has recipients, whose copies have messages of their own (watermark/proof/recipient_code.hpp), and is
// bound to a decoder or not.
// The commitment binds secret, creation time and message length, from version 2 on hardness and payload too, in version
// 3 the decoder, in version 4 the number of recipients, and reveals no secret: published before a model is, it shows
// later that the key is not one made to fit (docs/spec/watermark.md, 5). The file of a key is io/owner_key.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "compmark/core/result.hpp"
#include "compmark/io/hmac_sha256.hpp"
#include "compmark/io/scrypt.hpp"

namespace compmark {

struct OwnerKey {
  static constexpr std::string_view format = "compmark-key";
  static constexpr std::int64_t newest_version = 4;
  static constexpr unsigned least_hardness = 10, usual_hardness = 17, largest_hardness = 20;
  static constexpr std::size_t bits_limit = 128;
  static constexpr std::size_t note_limit = 1000;
  static constexpr std::size_t recipients_limit = 100'000;  ///< fewer with short messages (recipient_code.hpp)

  Digest256 secret{};
  std::string created;         ///< UTC, "2026-01-31T23:59:59Z"
  std::size_t bits = 0;        ///< length of the message
  std::string note{};          ///< for the owner, no part of the commitment
  std::string payload{};       ///< payload of the message, hexadecimal (watermark/proof/key.hpp); empty: none
  std::size_t corrects = 0;    ///< wrong bits that the code of the payload corrects; 0: no payload
  unsigned hardness = 0;       ///< log2 of scrypt's N, by which keys from version 2 on derive; 0: a key of version 1
  Digest256 root{};            ///< of scrypt, in keys from version 2 on (make_hard_key, make_bound_key)
  std::string decoder{};       ///< SHA-256 of the decoder's file that the key is bound to (version 3 or 4), 64 digits
  std::size_t recipients = 0;  ///< how many copies have messages of their own; 0: one message, and no recipients
  std::size_t recipient = 0;   ///< whose copy is meant, 1 to recipients; 0: nobody's. No part of the file

  [[nodiscard]] std::int64_t version() const {
    return recipients != 0 ? 4 : hardness == 0 ? 1 : decoder.empty() ? 2 : 3;
  }
  /// SHA-256 of a label, the secret, the message length (4 bytes, highest first) and the creation time; with a payload,
  /// of another label, secret, length, `corrects` (4 bytes), the creation time and the payload's digits. Of a key of
  /// version 2: a third label, secret, length, `corrects`, `hardness` (4 bytes), creation time and digits. Of version 3:
  /// a fourth label, the same, and the decoder's 64 digits before the creation time. Of version 4: a fifth label, secret,
  /// length, `corrects`, `hardness`, `recipients` (4 bytes), the decoder's digits if there is one, creation time and
  /// digits. May be published.
  [[nodiscard]] std::string commitment() const {
    const auto number = [](std::size_t value) {
      std::array<std::byte, 4> bytes{};
      for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<std::byte>(value >> (24 - 8 * i) & 0xFFu);
      return bytes;
    };
    const std::array<std::byte, 4> length = number(bits), errors = number(corrects);
    if (version() == 4) {
      return to_hex(sha256_digest({bytes_of("compmark/commitment/v4"), secret, length, errors, number(hardness),
                                   number(recipients), bytes_of(decoder), bytes_of(created), bytes_of(payload)}));
    }
    if (version() == 3) {
      return to_hex(sha256_digest({bytes_of("compmark/commitment/v3"), secret, length, errors, number(hardness),
                                   bytes_of(decoder), bytes_of(created), bytes_of(payload)}));
    }
    if (hardness != 0) {
      return to_hex(sha256_digest({bytes_of("compmark/commitment/v2"), secret, length, errors, number(hardness),
                                   bytes_of(created), bytes_of(payload)}));
    }
    if (corrects == 0)
      return to_hex(sha256_digest({bytes_of("compmark/commitment/v1"), secret, length, bytes_of(created)}));
    return to_hex(sha256_digest(
        {bytes_of("compmark/commitment/payload/v1"), secret, length, errors, bytes_of(created), bytes_of(payload)}));
  }
  /// The first 16 digits of the commitment: a name for reports and registers.
  [[nodiscard]] std::string id() const { return commitment().substr(0, 16); }
  /// Bytes for one purpose, named by its label.
  void derive(std::string_view label, std::span<std::byte> out) const {
    hkdf_sha256(hardness == 0 ? secret : root, bytes_of("compmark"), bytes_of(label), out);
  }
};

namespace detail {
/// "dddd-dd-ddTdd:dd:ddZ"
[[nodiscard]] inline bool is_utc_time(std::string_view text) {
  constexpr std::string_view shape = "0000-00-00T00:00:00Z";
  if (text.size() != shape.size()) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool digit = text[i] >= '0' && text[i] <= '9';
    if (shape[i] == '0' ? !digit : text[i] != shape[i]) return false;
  }
  return true;
}
}  // namespace detail

/// A key of version 1 from 32 random bytes (io/os_random.hpp), a time and a message length of 1 to 128: derived in a
/// microsecond, for experiments, tests and keys of before. Its marks are a proof only with a claim that was published.
[[nodiscard]] inline Result<OwnerKey> make_key(const Digest256& secret, std::string created, std::size_t bits,
                                               std::string note = {}) {
  if (bits < 1 || bits > OwnerKey::bits_limit) {
    return Error{ErrorKind::invalid, "", "bits", std::to_string(bits) + " is not a message length",
                 "a message has 1 to " + std::to_string(OwnerKey::bits_limit) + " bits"};
  }
  if (!detail::is_utc_time(created)) {
    return Error{ErrorKind::invalid, "", "created", "\"" + created + "\" is not a time",
                 "write it as 2026-01-31T23:59:59Z"};
  }
  if (secret == Digest256{}) {
    return Error{ErrorKind::invalid, "", "secret", "is all zeros", "draw 32 random bytes"};
  }
  if (note.size() > OwnerKey::note_limit) {
    return Error{ErrorKind::invalid, "", "note", "has " + std::to_string(note.size()) + " bytes",
                 "keep it below " + std::to_string(OwnerKey::note_limit)};
  }
  return OwnerKey{secret, std::move(created), bits, std::move(note)};
}

namespace detail {
[[nodiscard]] inline Result<Done> check_hardness(unsigned hardness) {
  if (hardness >= OwnerKey::least_hardness && hardness <= OwnerKey::largest_hardness) return Done{};
  return Error{ErrorKind::invalid, "", "hardness", std::to_string(hardness) + " is out of range",
               "give log2 of scrypt's N, " + std::to_string(OwnerKey::least_hardness) + " to " +
                   std::to_string(OwnerKey::largest_hardness)};
}
}  // namespace detail

/// The same of version 2, which takes 0.6 s and 128 MiB at the usual hardness. `hardness` is log2 of scrypt's N, 10 to
/// 20; each step doubles time and memory.
[[nodiscard]] inline Result<OwnerKey> make_hard_key(const Digest256& secret, std::string created, std::size_t bits,
                                                    std::string note = {},
                                                    unsigned hardness = OwnerKey::usual_hardness) {
  Result<OwnerKey> key = make_key(secret, std::move(created), bits, std::move(note));
  if (!key) return key;
  if (Result<Done> range = detail::check_hardness(hardness); !range) return range.error();
  key->hardness = hardness;
  scrypt(secret, bytes_of("compmark/key/v2"), ScryptCost{hardness, 8, 1}, key->root);
  return key;
}

namespace detail {
/// The root of a key of version 3: scrypt of the secret and the decoder's 32 bytes, so that each decoder that is tried
/// with a secret costs what a secret does.
inline void derive_bound_root(OwnerKey& key, const Digest256& decoder) {
  std::array<std::byte, 64> both{};
  std::copy(key.secret.begin(), key.secret.end(), both.begin());
  std::copy(decoder.begin(), decoder.end(), both.begin() + 32);
  scrypt(both, bytes_of("compmark/key/v3"), ScryptCost{key.hardness, 8, 1}, key.root);
}
[[nodiscard]] inline Error no_decoder_digest(const std::string& digits) {
  return Error{ErrorKind::invalid, "", "decoder", "\"" + digits.substr(0, 64) + "\" is no SHA-256",
               "give the 64 hexadecimal digits of the decoder's file"};
}
}  // namespace detail

/// The same of version 3, bound to the decoder whose file has this SHA-256 (64 digits, small letters): message and
/// carriers follow from it too, and marks of this key are read with this file alone.
[[nodiscard]] inline Result<OwnerKey> make_bound_key(const Digest256& secret, std::string decoder, std::string created,
                                                     std::size_t bits, std::string note = {},
                                                     unsigned hardness = OwnerKey::usual_hardness) {
  Digest256 digest{};
  if (decoder.size() != 64 || !from_hex(decoder, digest) || to_hex(digest) != decoder)
    return detail::no_decoder_digest(decoder);
  Result<OwnerKey> key = make_key(secret, std::move(created), bits, std::move(note));
  if (!key) return key;
  if (Result<Done> range = detail::check_hardness(hardness); !range) return range.error();
  key->hardness = hardness;
  key->decoder = std::move(decoder);
  detail::derive_bound_root(*key, digest);
  return key;
}

}  // namespace compmark
