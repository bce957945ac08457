// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An owner's key: what its secret gives, and its commitment. One secret of 256 bits gives everything by HKDF under a
// label of its purpose (watermark/proof/key.hpp), so that a message that becomes known says nothing about the carriers.
// From version 2 on scrypt comes first, 0.6 s and 128 MiB a key: of others, millions a second can be tried until one
// fits a picture (docs/threat_model.md). A key of version 3 is bound to the file of one decoder: its SHA-256 goes into
// scrypt with the secret, so that nobody can make a decoder that says the key's message: another file, another message.
// A key of version 4 has recipients, whose copies have messages of their own (watermark/proof/recipient_code.hpp), and is
// bound to a decoder or not. In version 5, which is what is made today, the message length, the code of the payload and
// whether there are recipients go into scrypt too: in versions 2 to 4 one derivation gives the messages of all lengths and
// codes, of which a cheat could choose the one that fits (watermark/proof/standing.hpp counts them).
// The commitment binds secret, creation time and message length, from version 2 on hardness and payload too, and, where
// there are any, the decoder and the number of recipients, and reveals no secret: published before a model is, it shows
// later that the key is not one made to fit (docs/spec/watermark.md, 5). The file of a key is io/owner_key.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/hmac_sha256.hpp"
#include "compmark/io/scrypt.hpp"

namespace compmark {

class OwnerKey {
 public:
  static constexpr std::string_view format = "compmark-key";
  static constexpr std::int64_t newest_version = 5;
  static constexpr unsigned least_hardness = 10, usual_hardness = 17, largest_hardness = 20;
  static constexpr std::size_t bits_limit = 128;
  static constexpr std::size_t note_limit = 1000;
  static constexpr std::size_t recipients_limit = 100'000;  ///< fewer with short messages (recipient_code.hpp)

  Digest256 secret{};
  std::string created{};       ///< UTC, "2026-01-31T23:59:59Z"
  std::size_t bits = 0;        ///< length of the message
  std::string note{};          ///< for the owner, no part of the commitment
  std::string payload{};       ///< payload of the message, hexadecimal (watermark/proof/key.hpp); empty: none
  std::size_t corrects = 0;    ///< wrong bits that the code of the payload corrects; 0: no payload
  unsigned hardness = 0;       ///< log2 of scrypt's N, by which keys from version 2 on derive; 0: a quick key, without
  std::string decoder{};       ///< SHA-256 of the decoder's file that the key is bound to, 64 digits; empty: none
  std::size_t recipients = 0;  ///< how many copies have messages of their own; 0: one message, and no recipients
  std::size_t recipient = 0;   ///< whose copy is meant, 1 to recipients; 0: nobody's. No part of the file
  bool before_version_5 = false;  ///< derives as versions 2 to 4 do: any length, code and recipients from one root

  [[nodiscard]] std::int64_t version() const {
    if (hardness == 0) return recipients != 0 ? 4 : 1;
    if (!before_version_5) return 5;
    return recipients != 0 ? 4 : decoder.empty() ? 2 : 3;
  }
  /// SHA-256 of a label, the secret, the message length (4 bytes, highest first) and the creation time; with a payload,
  /// of another label, secret, length, `corrects` (4 bytes), the creation time and the payload's digits. Of a key of
  /// version 2: a third label, secret, length, `corrects`, `hardness` (4 bytes), creation time and digits. Of version 3:
  /// a fourth label, the same, and the decoder's 64 digits before the creation time. Of versions 4 and 5: a fifth and a
  /// sixth label, secret, length, `corrects`, `hardness`, `recipients` (4 bytes), the decoder's digits if there is one,
  /// creation time and digits. May be published.
  [[nodiscard]] std::string commitment() const {
    const std::array<std::byte, 4> length = four_bytes(bits), errors = four_bytes(corrects),
                                   hard = four_bytes(hardness);
    switch (version()) {
      case 5:
      case 4:
        return to_hex(sha256_digest({bytes_of(version() == 5 ? "compmark/commitment/v5" : "compmark/commitment/v4"),
                                     secret, length, errors, hard, four_bytes(recipients), bytes_of(decoder),
                                     bytes_of(created), bytes_of(payload)}));
      case 3:
        return to_hex(sha256_digest({bytes_of("compmark/commitment/v3"), secret, length, errors, hard,
                                     bytes_of(decoder), bytes_of(created), bytes_of(payload)}));
      case 2:
        return to_hex(sha256_digest(
            {bytes_of("compmark/commitment/v2"), secret, length, errors, hard, bytes_of(created), bytes_of(payload)}));
      default:
        break;
    }
    if (corrects == 0)
      return to_hex(sha256_digest({bytes_of("compmark/commitment/v1"), secret, length, bytes_of(created)}));
    return to_hex(sha256_digest(
        {bytes_of("compmark/commitment/payload/v1"), secret, length, errors, bytes_of(created), bytes_of(payload)}));
  }
  /// The first 16 digits of the commitment: a name for reports and registers.
  [[nodiscard]] std::string id() const { return commitment().substr(0, 16); }

  /// What everything derives from: the secret, of a key from version 2 on scrypt of what the key is. It takes 0.6 s and
  /// 128 MiB at the usual hardness unless settle() was called since a field was changed that goes into it; makers and
  /// read_key call it.
  [[nodiscard]] Digest256 root() const {
    if (hardness == 0) return secret;
    const RootInput input = root_input();
    return settled_for_ == input.digest() ? root_ : input.root();
  }
  /// Derives the root once, for every later call.
  void settle() {
    if (hardness == 0) return;
    const RootInput input = root_input();
    if (const Digest256 digest = input.digest(); settled_for_ != digest) {
      root_ = input.root();
      settled_for_ = digest;
    }
  }
  /// Bytes for one purpose, named by its label.
  void derive(std::string_view label, std::span<std::byte> out) const {
    hkdf_sha256(root(), bytes_of("compmark"), bytes_of(label), out);
  }

 private:
  [[nodiscard]] static std::array<std::byte, 4> four_bytes(std::size_t value) {
    std::array<std::byte, 4> bytes{};
    for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<std::byte>(value >> (24 - 8 * i) & 0xFFu);
    return bytes;
  }
  /// What goes into scrypt: the secret and, of a bound key, the decoder's 32 bytes, so that each decoder that is tried with
  /// a secret costs what a secret does; as salt a label and, from version 5 on, message length, `corrects` (4 bytes each)
  /// and whether there are recipients (1 byte), so that each of those costs as much.
  struct RootInput {
    std::array<std::byte, 64> secret_bytes{};
    std::array<std::byte, 32> salt_bytes{};
    std::size_t secret_size = 0, salt_size = 0;
    unsigned hardness = 0;

    void add_secret(ByteSpan bytes) { add(secret_bytes, secret_size, bytes); }
    void add_salt(ByteSpan bytes) { add(salt_bytes, salt_size, bytes); }
    [[nodiscard]] ByteSpan secret() const { return ByteSpan(secret_bytes).first(secret_size); }
    [[nodiscard]] ByteSpan salt() const { return ByteSpan(salt_bytes).first(salt_size); }
    [[nodiscard]] Digest256 digest() const {
      return sha256_digest({four_bytes(hardness), four_bytes(secret_size), secret(), salt()});
    }
    [[nodiscard]] Digest256 root() const {
      Digest256 root{};
      scrypt(secret(), salt(), ScryptCost{hardness, 8, 1}, root);
      return root;
    }

   private:
    static void add(std::span<std::byte> to, std::size_t& size, ByteSpan bytes) {
      std::copy(bytes.begin(), bytes.end(), to.begin() + static_cast<std::ptrdiff_t>(size));
      size += bytes.size();
    }
  };
  [[nodiscard]] RootInput root_input() const {
    RootInput input;
    input.hardness = hardness;
    input.add_secret(secret);
    if (!decoder.empty()) {
      Digest256 digest{};
      const bool known = from_hex(decoder, digest);
      COMPMARK_ASSERT(known, "OwnerKey: the decoder is the 64 digits of a SHA-256");
      // Other text than digits, where nothing asserts: another root, and that of no decoder.
      if (!known) digest = sha256_digest({bytes_of(decoder)});
      input.add_secret(digest);
    }
    if (before_version_5) {
      input.add_salt(bytes_of(decoder.empty() ? "compmark/key/v2" : "compmark/key/v3"));
    } else {
      input.add_salt(bytes_of("compmark/key/v5"));
      input.add_salt(four_bytes(bits));
      input.add_salt(four_bytes(corrects));
      input.add_salt(std::array<std::byte, 1>{std::byte{recipients != 0}});
    }
    return input;
  }

  Digest256 root_{}, settled_for_{};  // scrypt's output, and what it is of: nothing that is stale is ever used
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
  OwnerKey key;
  key.secret = secret;
  key.created = std::move(created);
  key.bits = bits;
  key.note = std::move(note);
  return key;
}

namespace detail {
[[nodiscard]] inline Result<Done> check_hardness(unsigned hardness) {
  if (hardness >= OwnerKey::least_hardness && hardness <= OwnerKey::largest_hardness) return Done{};
  return Error{ErrorKind::invalid, "", "hardness", std::to_string(hardness) + " is out of range",
               "give log2 of scrypt's N, " + std::to_string(OwnerKey::least_hardness) + " to " +
                   std::to_string(OwnerKey::largest_hardness)};
}
}  // namespace detail

/// The same of version 5, which takes 0.6 s and 128 MiB at the usual hardness. `hardness` is log2 of scrypt's N, 10 to
/// 20; each step doubles time and memory. Who gives it a payload or recipients afterwards calls settle() once more.
[[nodiscard]] inline Result<OwnerKey> make_hard_key(const Digest256& secret, std::string created, std::size_t bits,
                                                    std::string note = {},
                                                    unsigned hardness = OwnerKey::usual_hardness) {
  Result<OwnerKey> key = make_key(secret, std::move(created), bits, std::move(note));
  if (!key) return key;
  if (Result<Done> range = detail::check_hardness(hardness); !range) return range.error();
  key->hardness = hardness;
  key->settle();
  return key;
}

namespace detail {
/// 64 hexadecimal digits with small letters.
[[nodiscard]] inline bool is_sha256_text(std::string_view digits) {
  Digest256 digest{};
  return digits.size() == 64 && from_hex(digits, digest) && to_hex(digest) == digits;
}
}  // namespace detail

/// The same, bound to the decoder whose file has this SHA-256 (64 digits, small letters): message and carriers follow
/// from it too, and marks of this key are read with this file alone.
[[nodiscard]] inline Result<OwnerKey> make_bound_key(const Digest256& secret, std::string decoder, std::string created,
                                                     std::size_t bits, std::string note = {},
                                                     unsigned hardness = OwnerKey::usual_hardness) {
  if (!detail::is_sha256_text(decoder)) {
    return Error{ErrorKind::invalid, "", "decoder", "\"" + decoder.substr(0, 64) + "\" is no SHA-256",
                 "give the 64 hexadecimal digits of the decoder's file"};
  }
  Result<OwnerKey> key = make_key(secret, std::move(created), bits, std::move(note));
  if (!key) return key;
  if (Result<Done> range = detail::check_hardness(hardness); !range) return range.error();
  key->hardness = hardness;
  key->decoder = std::move(decoder);
  key->settle();
  return key;
}

}  // namespace compmark
