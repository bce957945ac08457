// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The file of an owner's key (io/owner_key_derivation.hpp): JSON, readable by its owner only, never overwritten, since a
// lost key cannot be made again. The caller gives the time.
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
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/checksum.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/owner_key_derivation.hpp"

namespace compmark {

namespace detail {
/// All but the checksum. Another name is one that was damaged.
inline constexpr std::array<std::string_view, 13> key_fields{"format",     "version",  "id",         "created", "bits",
                                                             "derivation", "hardness", "commitment", "secret",  "note",
                                                             "payload",    "decoder",  "recipients"};

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

namespace detail {
/// For whoever reads the file without this program.
[[nodiscard]] inline std::string derivation_text(const OwnerKey& key) {
  const std::string last = "HKDF-SHA-256, salt \"compmark\", info = label of the purpose";
  if (key.hardness == 0) return last;
  const bool bound = !key.decoder.empty();
  const std::string salt = !key.before_version_5
                               ? "\"compmark/key/v5\", bits and corrects (4 bytes each, highest first; "
                                 "corrects is 0 without a payload), 1 byte: whether there are recipients"
                           : bound ? "\"compmark/key/v3\""
                                   : "\"compmark/key/v2\"";
  return std::string("scrypt (RFC 7914) of the secret") + (bound ? " and the decoder's 32 bytes" : "") + ", salt " +
         salt + ", N = 2^hardness, r = 8, p = 1; then " + last;
}
}  // namespace detail

/// Writes a key file that only its owner may read (POSIX systems). An existing file is left alone.
template <class Json = nlohmann::ordered_json>
[[nodiscard]] Result<Done> write_key(const std::filesystem::path& path, const OwnerKey& key) {
  const auto fail = [&](std::string problem, std::string remedy) {
    return Error{ErrorKind::unwritable, path.string(), "", std::move(problem), std::move(remedy)};
  };
  const auto there = [&] { return fail("exists already, a key is never overwritten", "choose another name"); };
  if (detail::file_exists(path)) return there();
  Json json{{"format", OwnerKey::format},
            {"version", key.version()},
            {"id", key.id()},
            {"created", key.created},
            {"bits", key.bits},
            {"derivation", detail::derivation_text(key)},
            {"commitment", key.commitment()},
            {"secret", to_hex(key.secret)}};
  if (key.hardness != 0) json["hardness"] = key.hardness;
  if (!key.decoder.empty()) json["decoder"] = key.decoder;
  if (key.recipients != 0) json["recipients"] = key.recipients;
  if (!key.note.empty()) json["note"] = key.note;
  if (key.corrects != 0) json["payload"] = {{"hex", key.payload}, {"corrects", key.corrects}};
  json[std::string(checksum_key)] = detail::fields_checksum(json);
  constexpr unsigned owner_only = 0600;  // from the moment the file exists: no other user can open it in between
  Result<AtomicFile> file = AtomicFile::create(path, owner_only);
  if (!file) return file.error();
  file->write(json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  Result<Done> written = file->commit_new();
  if (!written && detail::file_exists(path)) return there();  // of another program, since the look above
  return written;
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
  const Result<std::int64_t> written = json_field<std::int64_t>(*json, "version", file);
  if (!written) return written.error();
  if (*written < 1 || *written > OwnerKey::newest_version) {
    return fail(ErrorKind::unsupported, "version", "is " + std::to_string(*written) + ", this program reads 1 to 5",
                "use the program that wrote it, or a newer one");
  }
  std::size_t hardness = 0;
  if (*written == 2 || *written == 3 || *written == 5 || (*written == 4 && json->contains("hardness"))) {
    const Result<std::size_t> number = json_field<std::size_t>(*json, "hardness", file);
    if (!number) return number.error();
    if (*number < OwnerKey::least_hardness || *number > OwnerKey::largest_hardness)
      return fail(ErrorKind::invalid, "hardness", "is out of range", "restore the file from a copy");
    hardness = *number;
  } else if (json->contains("hardness")) {
    return fail(ErrorKind::malformed, "hardness", "is no field of a key of version 1", "restore the file from a copy");
  }
  std::string decoder;
  if (*written == 3 || (*written >= 4 && json->contains("decoder"))) {
    const Result<std::string> digits = json_field<std::string>(*json, "decoder", file);
    if (!digits) return digits.error();
    if (!detail::is_sha256_text(*digits))
      return fail(ErrorKind::malformed, "decoder", "is no SHA-256", "restore the file from a copy");
    if (hardness == 0)
      return fail(ErrorKind::malformed, "decoder", "is no field of a quick key", "restore the file from a copy");
    decoder = *digits;
  } else if (json->contains("decoder")) {
    return fail(ErrorKind::malformed, "decoder", "is no field of a key below version 3",
                "restore the file from a copy");
  }
  std::size_t recipients = 0;
  if (*written == 4 || (*written == 5 && json->contains("recipients"))) {
    const Result<std::size_t> number = json_field<std::size_t>(*json, "recipients", file);
    if (!number) return number.error();
    if (*number < 2 || *number > OwnerKey::recipients_limit)
      return fail(ErrorKind::invalid, "recipients", "is out of range", "restore the file from a copy");
    if (json->contains("payload"))
      return fail(ErrorKind::malformed, "payload", "is no field of a key of recipients",
                  "restore the file from a copy");
    recipients = *number;
  } else if (json->contains("recipients")) {
    return fail(ErrorKind::malformed, "recipients", "is no field of a key below version 4",
                "restore the file from a copy");
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
  key->before_version_5 = hardness != 0 && *written < 5;
  key->decoder = std::move(decoder);
  key->recipients = recipients;
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
  key->settle();  // last: a damaged file costs no derivation
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
