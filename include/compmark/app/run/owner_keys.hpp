// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Files of owners' keys: 256 random bits of the operating system, a message that follows from them, and, where it is
// wanted, a payload in the message. A key that exists is never lost: it is moved aside.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "compmark/app/compiled.hpp"
#include "compmark/app/observer.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/owner_key.hpp"

namespace compmark {

/// Errors name these fields as the tool's options do ("--from").
struct KeySettings {
  std::filesystem::path out;
  std::size_t bits = 48;          ///< length of the message, 1 to OwnerKey::bits_limit
  std::string note;               ///< to recognise the key; no part of the commitment
  std::string created;            ///< when, as in "2026-01-31T23:59:59Z"; the library has no clock
  std::string payload;            ///< identifier in the message, hexadecimal digits; may be empty
  std::size_t corrects = 4;       ///< wrong bits that the code of the payload corrects
  std::size_t recipients = 0;     ///< copies with messages of their own (recipient_code.hpp); 0: one message
  std::filesystem::path from;     ///< key whose secret is used again, for another payload or more recipients; or empty
  std::filesystem::path decoder;  ///< file of the decoder that the key is bound to (make_bound_key); empty: none
  unsigned hardness = OwnerKey::usual_hardness;  ///< of scrypt (make_hard_key); 0: a key of version 1
  bool force = false;                            ///< move a key that is there to FILE.<id>.old
};

struct MadeKey {
  OwnerKey key;
  std::filesystem::path moved;  ///< where the key that was there is now; empty: none was
};

/// Writes a new key, readable by its owner alone. Error: one is there, or it cannot be written; then a key that was
/// moved aside is back in its place. Warns if others may read `from`.
[[nodiscard]] Result<MadeKey> make_key_file(const KeySettings& settings, const SentenceSink& warn = {});

/// open_key, and a warning if others may read the file.
[[nodiscard]] Result<OwnerKey> open_private_key(const std::filesystem::path& path, const SentenceSink& warn);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/owner_keys.hpp"
#endif
