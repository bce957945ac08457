// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/run/owner_keys.hpp.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "compmark/app/reading.hpp"
#include "compmark/app/run/owner_keys.hpp"
#include "compmark/app/run/run_folder.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/os_random.hpp"
#include "compmark/watermark/proof/key.hpp"

namespace compmark {
namespace detail {

/// Where an existing key goes: <file>.<id>.old. Whatever else is there is left alone.
inline Result<std::filesystem::path> move_key_aside(const std::filesystem::path& path) {
  const Result<OwnerKey> old = read_key(path);
  if (!old) {
    return Error{ErrorKind::unwritable, path.string(), {}, "exists and is not a whole key file", "choose another name"};
  }
  std::filesystem::path aside = path;
  aside += "." + old->id() + ".old";
  std::error_code status;
  if (!std::filesystem::exists(aside, status)) std::filesystem::rename(path, aside, status);
  if (status || detail::file_exists(path)) {
    return Error{ErrorKind::unwritable,
                 aside.string(),
                 {},
                 "the old key cannot be moved there",
                 "choose another name for the new one"};
  }
  return aside;
}

}  // namespace detail

COMPMARK_APP_INLINE Result<OwnerKey> open_private_key(const std::filesystem::path& path, const SentenceSink& warn) {
  Result<OwnerKey> key = open_key(path);
  if (key && warn && !key_file_is_private(path))
    warn(path.string() + ": others may read this key; run chmod 600 on it");
  return key;
}

COMPMARK_APP_INLINE Result<MadeKey> make_key_file(const KeySettings& settings, const SentenceSink& warn) {
  Digest256 secret{};
  unsigned hardness = settings.hardness;
  bool before_version_5 = false;
  std::string decoder;
  if (!settings.decoder.empty()) {
    if (hardness == 0 && settings.from.empty()) {
      return Error{ErrorKind::invalid, settings.decoder.string(), "--decoder", "cannot be bound to a quick key",
                   "leave --quick out: without scrypt, decoders could be tried by the million"};
    }
    Result<std::string> digest = file_sha256(settings.decoder);
    if (!digest) return digest.error();
    decoder = std::move(*digest);
  }
  if (!settings.from.empty()) {
    const Result<OwnerKey> other = open_private_key(settings.from, warn);
    if (!other) return other.error();
    secret = other->secret;
    hardness = other->hardness;  // the mask of its payloads follows from it, and from the decoder
    before_version_5 = other->before_version_5;
    if (!decoder.empty() && decoder != other->decoder) {
      return Error{ErrorKind::invalid, settings.decoder.string(), "--decoder",
                   other->decoder.empty() ? "is given, and the key of --from is bound to none"
                                          : "is another than the key of --from is bound to",
                   "leave it out: keys that read each other's payloads have one decoder"};
    }
    decoder = other->decoder;
    if (settings.recipients != 0 && other->recipients == 0) {
      return Error{ErrorKind::invalid, settings.from.string(), "--from",
                   "is a key without recipients, whose marks a key with recipients does not read",
                   "leave it out: the new key has a secret of its own"};
    }
    if (settings.recipients != 0 && settings.recipients <= other->recipients) {
      return Error{ErrorKind::invalid, settings.from.string(), "--from",
                   "has " + std::to_string(other->recipients) + " recipients already", "use that key"};
    }
    if (settings.recipients == 0 && other->recipients != 0) {
      return Error{ErrorKind::invalid, settings.from.string(), "--from",
                   "is a key of " + std::to_string(other->recipients) + " recipients",
                   "give --recipients with a larger number: the new key reads their copies too"};
    }
    if (settings.recipients != 0 && settings.bits != other->bits) {
      return Error{ErrorKind::invalid, settings.from.string(), "--bits",
                   "is " + std::to_string(settings.bits) + ", and the key of --from has messages of " +
                       std::to_string(other->bits) + " bits",
                   "give --bits " + std::to_string(other->bits)};
    }
    // The mask of a key of version 5 follows from length and code too.
    if (!settings.payload.empty() && other->version() >= 5) {
      const auto differs = [&](const char* option, const std::string& problem, const std::string& remedy) {
        return Error{ErrorKind::invalid, settings.from.string(), option, problem, remedy};
      };
      if (other->corrects == 0) {
        return differs("--from", "is a key without a payload, which reads no payload of another key",
                       "leave it out, and make the first key with a payload, too");
      }
      if (other->corrects != settings.corrects) {
        return differs("--corrects",
                       "is " + std::to_string(settings.corrects) + ", and the payload of the key of --from corrects " +
                           std::to_string(other->corrects) + " bits",
                       "give --corrects " + std::to_string(other->corrects) +
                           ": keys that read each other's payloads have one code");
      }
      if (other->bits != settings.bits) {
        return differs("--bits",
                       "is " + std::to_string(settings.bits) + ", and the key of --from has messages of " +
                           std::to_string(other->bits) + " bits",
                       "give --bits " + std::to_string(other->bits));
      }
    }
  } else if (Result<Done> drawn = os_random(secret); !drawn) {
    return drawn.error();
  }
  Result<OwnerKey> key = make_key(secret, settings.created, settings.bits, settings.note);
  if (!key) return key.error();
  if (hardness != 0) {
    if (Result<Done> range = detail::check_hardness(hardness); !range) return range.error();
  }
  key->hardness = hardness;
  key->decoder = std::move(decoder);
  key->before_version_5 = before_version_5;
  if (settings.recipients != 0) {
    if (!settings.payload.empty()) {
      return Error{ErrorKind::invalid,
                   {},
                   "--payload",
                   "is given with --recipients, and takes the same bits",
                   "leave one of them out"};
    }
    if (Result<Done> fits = check_recipients(key->bits, settings.recipients); !fits) {
      Error error = fits.error();
      error.field = "--recipients";
      return error;
    }
    key->recipients = settings.recipients;
  } else if (!settings.payload.empty()) {
    key->payload = settings.payload;
    key->corrects = settings.corrects;
    if (const Result<Done> fits = check_payload(*key); !fits) return fits.error();
  } else if (!settings.from.empty()) {
    return Error{ErrorKind::invalid,
                 {},
                 "--from",
                 "would make the same key again",
                 "give the new key a payload of its own with --payload"};
  }
  key->settle();
  if (!settings.decoder.empty()) {  // it is one, and reads as many bits
    if (const Result<FileDecoder> opened = open_decoder(settings.decoder, &*key); !opened) return opened.error();
  }
  // Of two processes that make the same name at once, the second would replace the first's key, which somebody was told
  // of and nobody has.
  const Result<std::shared_ptr<const void>> alone = hold_file(settings.out);
  if (!alone) return alone.error();
  std::filesystem::path aside;
  std::error_code status;
  if (settings.force && std::filesystem::exists(settings.out, status)) {
    const Result<std::filesystem::path> moved = detail::move_key_aside(settings.out);
    if (!moved) return moved.error();
    aside = *moved;
  }
  if (Result<Done> written = write_key(settings.out, *key); !written) {
    if (!aside.empty()) std::filesystem::rename(aside, settings.out, status);
    Error error = written.error();
    if (!settings.force && std::filesystem::exists(settings.out, status))
      error.remedy += ", or move it aside with --force";
    return error;
  }
  return MadeKey{std::move(*key), std::move(aside)};
}

}  // namespace compmark
