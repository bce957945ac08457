// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An owner's key and its file. One secret of 256 bits gives everything by HKDF under a label of its purpose
// (watermark/proof/key.hpp), so that a message that becomes known says nothing about the carriers. Of keys of version 2
// scrypt comes first, 0.6 s and 128 MiB a key: of others, millions a second can be tried until one fits a picture
// (docs/threat_model.md). The commitment binds secret, creation time and message length, in version 2 hardness and
// payload too, and reveals none: published before a model is, it shows later that the key is not one made to fit
// (docs/spec/watermark.md, 5). The file is JSON, readable by its owner only, never overwritten: a lost key cannot be
// made again. The caller gives the time.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "compmark/core/result.hpp"
#include "compmark/io/checksum.hpp"
#include "compmark/io/hmac_sha256.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/scrypt.hpp"

namespace compmark {

struct OwnerKey {
  static constexpr std::string_view format = "compmark-key";
  static constexpr std::int64_t newest_version = 2;
  static constexpr unsigned least_hardness = 10, usual_hardness = 17, largest_hardness = 20;
  static constexpr std::size_t bits_limit = 128;
  static constexpr std::size_t note_limit = 1000;

  Digest256 secret{};
  std::string created;       ///< UTC, "2026-01-31T23:59:59Z"
  std::size_t bits = 0;      ///< length of the message
  std::string note{};        ///< for the owner, no part of the commitment
  std::string payload{};     ///< payload of the message, hexadecimal (watermark/proof/key.hpp); empty: none
  std::size_t corrects = 0;  ///< wrong bits that the code of the payload corrects; 0: no payload
  unsigned hardness = 0;     ///< log2 of scrypt's N, by which keys of version 2 derive; 0: a key of version 1
  Digest256 root{};          ///< of scrypt, in keys of version 2 (make_hard_key)

  [[nodiscard]] std::int64_t version() const { return hardness == 0 ? 1 : 2; }
  /// SHA-256 of a label, the secret, the message length (4 bytes, highest first) and the creation time; with a payload,
  /// of another label, secret, length, `corrects` (4 bytes), the creation time and the payload's digits. Of a key of
  /// version 2: a third label, secret, length, `corrects`, `hardness` (4 bytes), creation time and digits. May be
  /// published.
  [[nodiscard]] std::string commitment() const {
    const auto number = [](std::size_t value) {
      std::array<std::byte, 4> bytes{};
      for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<std::byte>(value >> (24 - 8 * i) & 0xFFu);
      return bytes;
    };
    const std::array<std::byte, 4> length = number(bits), errors = number(corrects);
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

/// The same of version 2, which takes 0.6 s and 128 MiB at the usual hardness. `hardness` is log2 of scrypt's N, 10 to
/// 20; each step doubles time and memory.
[[nodiscard]] inline Result<OwnerKey> make_hard_key(const Digest256& secret, std::string created, std::size_t bits,
                                                    std::string note = {},
                                                    unsigned hardness = OwnerKey::usual_hardness) {
  Result<OwnerKey> key = make_key(secret, std::move(created), bits, std::move(note));
  if (!key) return key;
  if (hardness < OwnerKey::least_hardness || hardness > OwnerKey::largest_hardness) {
    return Error{ErrorKind::invalid, "", "hardness", std::to_string(hardness) + " is out of range",
                 "give log2 of scrypt's N, " + std::to_string(OwnerKey::least_hardness) + " to " +
                     std::to_string(OwnerKey::largest_hardness)};
  }
  key->hardness = hardness;
  scrypt(secret, bytes_of("compmark/key/v2"), ScryptCost{hardness, 8, 1}, key->root);
  return key;
}

namespace detail {
/// All but the checksum. Another name is one that was damaged.
inline constexpr std::array<std::string_view, 11> key_fields{
    "format", "version", "id", "created", "bits", "derivation", "hardness", "commitment", "secret", "note", "payload"};

/// The checksum of all fields of a JSON object but its own, whatever their order and layout.
template <class Json>
[[nodiscard]] std::string fields_checksum(const Json& object) {
  std::map<std::string, std::string> fields;
  for (const auto& [name, value] : object.items()) {
    if (name == checksum_key) continue;
    // Through a type that sorts, so that fields of fields have one order too.
    const auto sorted = json_from<nlohmann::json>(value.dump(-1, ' ', false, Json::error_handler_t::replace));
    fields.emplace(name, sorted.dump());
  }
  return TensorsChecksum(fields).text();
}
}  // namespace detail

/// Writes a key file that only its owner may read (POSIX systems). An existing file is left alone.
template <class Json = nlohmann::ordered_json>
[[nodiscard]] Result<Done> write_key(const std::filesystem::path& path, const OwnerKey& key) {
  const auto fail = [&](std::string problem, std::string remedy) {
    return Error{ErrorKind::unwritable, path.string(), "", std::move(problem), std::move(remedy)};
  };
  std::error_code status;
  if (std::filesystem::exists(path, status))
    return fail("exists already, a key is never overwritten", "choose another name");
  Json json{
      {"format", OwnerKey::format},
      {"version", key.version()},
      {"id", key.id()},
      {"created", key.created},
      {"bits", key.bits},
      {"derivation", key.hardness == 0 ? "HKDF-SHA-256, salt \"compmark\", info = label of the purpose"
                                       : "scrypt (RFC 7914), salt \"compmark/key/v2\", N = 2^hardness, r = 8, p "
                                         "= 1; then HKDF-SHA-256, salt \"compmark\", info = label of the purpose"},
      {"commitment", key.commitment()},
      {"secret", to_hex(key.secret)}};
  if (key.hardness != 0) json["hardness"] = key.hardness;
  if (!key.note.empty()) json["note"] = key.note;
  if (key.corrects != 0) json["payload"] = {{"hex", key.payload}, {"corrects", key.corrects}};
  json[std::string(checksum_key)] = detail::fields_checksum(json);
  constexpr unsigned owner_only = 0600;  // from the moment the file exists: no other user can open it in between
  return write_json(path, json, owner_only);
}

/// Reads a key file; `bits` other than 0 is the message length that is asked for. Messages never contain the secret.
template <class Json = nlohmann::json>
[[nodiscard]] Result<OwnerKey> read_key(const std::filesystem::path& path, std::size_t bits = 0) {
  const std::string file = path.string();
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, file, std::move(field), std::move(problem), std::move(remedy)};
  };
  const FileKind kind = identify_file(path);
  if (tells_kind(kind) && kind != FileKind::owner_key && kind != FileKind::text && kind != FileKind::json)
    return wrong_kind(kind, file, "an owner's key");
  std::error_code status;
  if (std::filesystem::is_regular_file(path, status) && std::filesystem::file_size(path, status) > 65536)
    return fail(ErrorKind::malformed, "", "is too large to be a key file", "give the file that keygen wrote");
  const Result<Json> json = read_json<Json>(path, "an owner's key");
  if (!json) return json.error();
  const Result<std::string> format = json_field<std::string>(*json, "format", file);
  if (!format || *format != OwnerKey::format)
    return fail(ErrorKind::malformed, "format", "is not that of a key file", "give the file that keygen wrote");
  const Result<std::int64_t> version = json_field<std::int64_t>(*json, "version", file);
  if (!version) return version.error();
  if (*version < 1 || *version > OwnerKey::newest_version) {
    return fail(ErrorKind::unsupported, "version", "is " + std::to_string(*version) + ", this program reads 1 and 2",
                "use the program that wrote it, or a newer one");
  }
  std::size_t hardness = 0;
  if (*version == 2) {
    const Result<std::size_t> number = json_field<std::size_t>(*json, "hardness", file);
    if (!number) return number.error();
    if (*number < OwnerKey::least_hardness || *number > OwnerKey::largest_hardness)
      return fail(ErrorKind::invalid, "hardness", "is out of range", "restore the file from a copy");
    hardness = *number;
  } else if (json->contains("hardness")) {
    return fail(ErrorKind::malformed, "hardness", "is no field of a key of version 1", "restore the file from a copy");
  }
  const Result<std::string> secret = json_field<std::string>(*json, "secret", file);
  if (!secret) return secret.error();
  Digest256 bytes{};
  if (secret->size() != 2 * bytes.size()) {
    return fail(ErrorKind::invalid, "secret", "has " + std::to_string(secret->size()) + " digits instead of 64",
                "restore the file from a copy");
  }
  if (!from_hex(*secret, bytes))
    return fail(ErrorKind::malformed, "secret", "is not hexadecimal", "restore the file from a copy");
  const Result<std::string> created = json_field<std::string>(*json, "created", file);
  if (!created) return created.error();
  const Result<std::size_t> length = json_field<std::size_t>(*json, "bits", file);
  if (!length) return length.error();
  std::string note;
  if (json->contains("note")) {
    const Result<std::string> text = json_field<std::string>(*json, "note", file);
    if (!text) return text.error();
    note = *text;
  }
  Result<OwnerKey> key = make_key(bytes, *created, *length, std::move(note));
  if (!key) {
    Error error = key.error();
    error.file = file;
    error.remedy = "restore the file from a copy";
    return error;
  }
  if (json->contains("payload")) {
    const Json& payload = (*json)["payload"];
    const Result<std::string> hex = json_field<std::string>(payload, "hex", file, "payload");
    if (!hex) return hex.error();
    const Result<std::size_t> corrects = json_field<std::size_t>(payload, "corrects", file, "payload");
    if (!corrects) return corrects.error();
    if (hex->empty() || hex->size() > OwnerKey::bits_limit / 4 || *corrects < 1 || *corrects > OwnerKey::bits_limit)
      return fail(ErrorKind::invalid, "payload", "is out of range", "restore the file from a copy");
    key->payload = *hex;
    key->corrects = *corrects;
  }
  key->hardness = static_cast<unsigned>(hardness);
  for (const auto& [name, expected] : {std::pair<std::string, std::string>{"commitment", key->commitment()},
                                       std::pair<std::string, std::string>{"id", key->id()}}) {
    const Result<std::string> stored = json_field<std::string>(*json, name, file);
    if (!stored) return stored.error();
    if (*stored != expected) {
      return fail(ErrorKind::invalid, name, "does not belong to the secret, creation time and length in this file",
                  "restore the file from a copy: something in it was changed");
    }
  }
  // Last: what is wrong with one field is said before that something is.
  for (const auto& [name, value] : json->items()) {
    const bool known =
        std::find(detail::key_fields.begin(), detail::key_fields.end(), name) != detail::key_fields.end();
    if (known || (name == checksum_key && value == detail::fields_checksum(*json))) continue;
    return fail(ErrorKind::malformed, name == checksum_key ? name : name.substr(0, 40),
                name == checksum_key ? "does not belong to the fields of this file" : "is no field of a key file",
                "restore the file from a copy: something in it was changed");
  }
  if (bits != 0 && key->bits != bits) {
    return fail(
        ErrorKind::invalid, "bits",
        "the key is for messages of " + std::to_string(key->bits) + " bits, " + std::to_string(bits) + " are asked for",
        "use a key and a decoder of one message length");
  }
  if (hardness != 0)  // last: a damaged file costs no derivation
    scrypt(key->secret, bytes_of("compmark/key/v2"), ScryptCost{key->hardness, 8, 1}, key->root);
  return key;
}

/// False if others than the owner may read the file: a tool should warn.
[[nodiscard]] inline bool key_file_is_private(const std::filesystem::path& path) {
  std::error_code status;
  const auto mode = std::filesystem::status(path, status).permissions();
  using std::filesystem::perms;
  return status || (mode & (perms::group_all | perms::others_all)) == perms::none;
}

}  // namespace compmark
