// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <sys/stat.h>

#include <compmark/io/owner_key.hpp>
#include <filesystem>
#include <functional>
#include <string>

#include "support/scene_files.hpp"

using namespace compmark;
using testing::TemporaryFolder;
namespace fs = std::filesystem;

namespace {

Digest256 some_secret() {
  Digest256 secret{};
  for (std::size_t i = 0; i < secret.size(); ++i) secret[i] = static_cast<std::byte>(7 * i + 1);
  return secret;
}
OwnerKey some_key(std::size_t bits = 48) { return *make_key(some_secret(), "2026-01-31T23:59:59Z", bits); }

}  // namespace

TEST_CASE("io/owner_key: what is written is read, by its owner only, and never overwritten") {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "owner.key";
  const OwnerKey key = some_key();
  const ::mode_t before = ::umask(0);  // the mode does not rely on the user's mask
  REQUIRE(write_key(path, key).ok());
  ::umask(before);
  CHECK((fs::status(path).permissions() & fs::perms::all) == (fs::perms::owner_read | fs::perms::owner_write));
  CHECK(key_file_is_private(path));
  const Result<OwnerKey> read = read_key(path, 48);
  REQUIRE(read.ok());
  CHECK(read->secret == key.secret);
  CHECK(read->created == key.created);
  CHECK(read->bits == 48);
  CHECK(read->commitment() == key.commitment());
  const auto bytes = *read_file(path);
  const Result<Done> again = write_key(path, some_key(32));
  REQUIRE_FALSE(again.ok());
  CHECK(*read_file(path) == bytes);
  CHECK_FALSE(fs::exists(folder.path() / "owner.key.partial"));
  CHECK_FALSE(write_key(folder.path() / "none" / "x.key", key).ok());
  fs::permissions(path, fs::perms::others_read, fs::perm_options::add);
  CHECK_FALSE(key_file_is_private(path));
}

TEST_CASE("io/owner_key: a note is kept and binds nothing") {
  const TemporaryFolder folder;
  const OwnerKey key = *make_key(some_secret(), "2026-01-31T23:59:59Z", 48, "for the \"museum\", 2026");
  REQUIRE(write_key(folder.path() / "noted.key", key).ok());
  const Result<OwnerKey> read = read_key(folder.path() / "noted.key");
  REQUIRE(read.ok());
  CHECK(read->note == key.note);
  CHECK(read->commitment() == some_key().commitment());
}

TEST_CASE("io/owner_key: a payload is kept and bound by the commitment") {
  const TemporaryFolder folder;
  OwnerKey key = some_key();
  key.payload = "5eed";
  key.corrects = 4;
  REQUIRE(write_key(folder.path() / "payload.key", key).ok());
  const Result<OwnerKey> read = read_key(folder.path() / "payload.key");
  REQUIRE(read.ok());
  CHECK(read->payload == "5eed");
  CHECK(read->corrects == 4);
  CHECK(read->commitment() != some_key().commitment());
  const nlohmann::json good = *read_json(folder.path() / "payload.key");
  for (const auto& [name, value] : {std::pair<const char*, nlohmann::json>{"hex", "5eee"},
                                    {"hex", ""},
                                    {"hex", std::string(33, '0')},
                                    {"hex", 5},
                                    {"corrects", 5},
                                    {"corrects", 0},
                                    {"corrects", -1}}) {
    nlohmann::json bad = good;
    bad["payload"][name] = value;
    REQUIRE(write_json(folder.path() / "bad.key", bad).ok());
    CHECK_FALSE(read_key(folder.path() / "bad.key").ok());
  }
  nlohmann::json bad = good;
  bad.erase("payload");
  REQUIRE(write_json(folder.path() / "bad.key", bad).ok());
  CHECK_FALSE(read_key(folder.path() / "bad.key").ok());
}

TEST_CASE("io/owner_key: the commitment is the hash that the documentation says, and binds every field") {
  const OwnerKey key = some_key();
  std::string text = "compmark/commitment/v1";
  for (const std::byte value : some_secret()) text += static_cast<char>(value);
  text += std::string("\0\0\0\x30", 4) + "2026-01-31T23:59:59Z";
  CHECK(key.commitment() == Sha256{}.update(bytes_of(text)).hex());
  CHECK(key.id() == key.commitment().substr(0, 16));
  OwnerKey other = key;
  other.secret[31] ^= std::byte{1};
  CHECK(other.commitment() != key.commitment());
  CHECK(some_key(49).commitment() != key.commitment());
  other = key;
  other.created[0] = '3';
  CHECK(other.commitment() != key.commitment());
}

TEST_CASE("io/owner_key: bytes of one purpose are fixed for ever and differ from those of another") {
  std::array<std::byte, 32> message{}, carriers{}, direct{};
  some_key().derive("compmark/message/v1", message);
  some_key().derive("compmark/carriers/v1", carriers);
  hkdf_sha256(some_secret(), bytes_of("compmark"), bytes_of("compmark/message/v1"), direct);
  CHECK(message == direct);
  CHECK(message != carriers);
  CHECK(message != some_secret());
}

TEST_CASE("io/owner_key: damaged files are refused with one line that does not tell the secret") {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "owner.key", bad = folder.path() / "bad.key";
  REQUIRE(write_key(path, some_key()).ok());
  const nlohmann::json good = *read_json(path);
  const std::string secret = good["secret"];
  const auto refused = [&](const std::string& field, const std::function<void(nlohmann::json&)>& damage) {
    nlohmann::json json = good;
    damage(json);
    REQUIRE(write_json(bad, json).ok());
    const Result<OwnerKey> key = read_key(bad);
    CAPTURE(field);
    REQUIRE_FALSE(key.ok());
    CHECK(key.error().file == bad.string());
    CHECK(key.error().field == field);
    CHECK_FALSE(key.error().remedy.empty());
    CHECK(key.error().line().find(secret.substr(0, 12)) == std::string::npos);
  };
  for (const char* field : {"format", "version", "secret", "created", "bits", "commitment", "id"})
    refused(field, [&](nlohmann::json& json) { json.erase(field); });
  refused("format", [](nlohmann::json& json) { json["format"] = "something"; });
  refused("version", [](nlohmann::json& json) { json["version"] = 6; });
  refused("hardness", [](nlohmann::json& json) { json["version"] = 5; });
  refused("recipients", [](nlohmann::json& json) { json["version"] = 4; });
  refused("recipients", [](nlohmann::json& json) { json["recipients"] = 10; });
  refused("version", [](nlohmann::json& json) { json["version"] = 0; });
  refused("hardness", [](nlohmann::json& json) { json["version"] = 2; });
  refused("hardness", [](nlohmann::json& json) { json["hardness"] = 10; });
  refused("secret", [&](nlohmann::json& json) { json["secret"] = secret.substr(2); });
  refused("secret", [&](nlohmann::json& json) { json["secret"] = "zz" + secret.substr(2); });
  refused("secret", [](nlohmann::json& json) { json["secret"] = std::string(64, '0'); });
  refused("secret", [](nlohmann::json& json) { json["secret"] = 5; });
  refused("created", [](nlohmann::json& json) { json["created"] = "yesterday"; });
  refused("bits", [](nlohmann::json& json) { json["bits"] = 0; });
  refused("bits", [](nlohmann::json& json) { json["bits"] = 129; });
  refused("bits", [](nlohmann::json& json) { json["bits"] = -48; });
  refused("commitment", [](nlohmann::json& json) { json["bits"] = 32; });
  refused("commitment", [](nlohmann::json& json) { json["created"] = "2025-01-31T23:59:59Z"; });
  refused("commitment", [&](nlohmann::json& json) { json["secret"] = "ff" + secret.substr(2); });
  refused("id", [](nlohmann::json& json) { json["id"] = "0000000000000000"; });
  refused("note", [](nlohmann::json& json) { json["note"] = 5; });
  refused("note", [](nlohmann::json& json) { json["note"] = std::string(1001, 'x'); });
  refused("format", [](nlohmann::json& json) { json = nlohmann::json::array(); });
  const auto text_refused = [&](const std::string& text) {
    REQUIRE(write_file(bad, text).ok());
    CHECK_FALSE(read_key(bad).ok());
  };
  text_refused("");
  text_refused("not JSON");
  text_refused(good.dump().substr(0, 100));
  text_refused(std::string(100000, ' ') + good.dump());
  CHECK_FALSE(read_key(folder.path() / "missing.key").ok());
  CHECK_FALSE(read_key(folder.path()).ok());
  const Result<OwnerKey> other_length = read_key(path, 32);
  REQUIRE_FALSE(other_length.ok());
  CHECK(other_length.error().field == "bits");
  CHECK_FALSE(make_key(some_secret(), "2026-01-31", 48).ok());
  CHECK_FALSE(make_key(some_secret(), "2026-01-31T23:59:59Z", 0).ok());
}

TEST_CASE("io/owner_key: a key with recipients says how many, and its commitment binds the number") {
  const TemporaryFolder folder;
  const fs::path bad = folder.path() / "bad.key";
  OwnerKey quick = some_key(), hard = *make_hard_key(some_secret(), "2026-01-31T23:59:59Z", 48, "", 10),
           bound = *make_bound_key(some_secret(), std::string(64, 'a'), "2026-01-31T23:59:59Z", 48, "", 10);
  for (OwnerKey* key : {&quick, &hard, &bound}) {
    const std::string before = key->commitment();
    key->before_version_5 = key->hardness != 0;
    key->settle();
    const Digest256 root = key->root();
    key->recipients = 100;
    CHECK(key->version() == 4);
    CHECK(key->commitment() != before);
    const fs::path path = folder.path() / (key->id() + ".key");
    REQUIRE(write_key(path, *key).ok());
    const Result<OwnerKey> read = read_key(path, 48);
    REQUIRE(read.ok());
    CHECK(read->recipients == 100);
    CHECK(read->recipient == 0);
    CHECK(read->root() == root);
    CHECK(read->decoder == key->decoder);
    CHECK(read->commitment() == key->commitment());
    const auto refused = [&](const std::string& field, const std::function<void(nlohmann::json&)>& damage) {
      nlohmann::json json = *read_json(path);
      damage(json);
      REQUIRE(write_json(bad, json).ok());
      const Result<OwnerKey> damaged = read_key(bad);
      CAPTURE(field);
      REQUIRE_FALSE(damaged.ok());
      CHECK(damaged.error().field == field);
      CHECK_FALSE(damaged.error().remedy.empty());
    };
    refused("commitment", [](nlohmann::json& json) { json["recipients"] = 101; });
    refused("recipients", [](nlohmann::json& json) { json["recipients"] = 1; });
    refused("recipients", [](nlohmann::json& json) { json["recipients"] = 100'001; });
    refused("recipients", [](nlohmann::json& json) { json["recipients"] = "many"; });
    refused("recipients", [](nlohmann::json& json) { json.erase("recipients"); });
    refused("payload", [](nlohmann::json& json) { json["payload"] = {{"hex", "5eed"}, {"corrects", 4}}; });
  }
  // The hash that the documentation says.
  std::string text = "compmark/commitment/v4";
  for (const std::byte value : some_secret()) text += static_cast<char>(value);
  text += std::string("\0\0\0\x30\0\0\0\0\0\0\0\x0a\0\0\0\x64", 16) + std::string(64, 'a') + "2026-01-31T23:59:59Z";
  CHECK(bound.commitment() == Sha256{}.update(bytes_of(text)).hex());
}

TEST_CASE("io/owner_key: a key of version 2 derives through scrypt, and is another one at another hardness") {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "hard.key", bad = folder.path() / "bad.key";
  OwnerKey key = *make_hard_key(some_secret(), "2026-01-31T23:59:59Z", 48, "a note", 10);
  key.before_version_5 = true;
  REQUIRE(write_key(path, key).ok());
  const Result<OwnerKey> read = read_key(path, 48);
  REQUIRE(read.ok());
  CHECK(read->version() == 2);
  CHECK(read->hardness == 10);
  CHECK(read->root() == key.root());
  CHECK(read->commitment() == key.commitment());
  // The label of the message over scrypt's output, which RFC 7914's vectors prove (io/scrypt).
  std::array<std::byte, 32> derived{}, direct{}, easy{};
  Digest256 root{};
  scrypt(some_secret(), bytes_of("compmark/key/v2"), {10, 8, 1}, root);
  hkdf_sha256(root, bytes_of("compmark"), bytes_of("compmark/message/v1"), direct);
  read->derive("compmark/message/v1", derived);
  some_key().derive("compmark/message/v1", easy);
  CHECK(derived == direct);
  CHECK(derived != easy);
  const OwnerKey harder = *make_hard_key(some_secret(), "2026-01-31T23:59:59Z", 48, "a note", 11);
  CHECK(harder.root() != key.root());
  CHECK(harder.commitment() != key.commitment());
  CHECK(key.commitment() != some_key().commitment());
  CHECK_FALSE(make_hard_key(some_secret(), "2026-01-31T23:59:59Z", 48, "", 9).ok());
  CHECK_FALSE(make_hard_key(some_secret(), "2026-01-31T23:59:59Z", 48, "", 21).ok());
  const nlohmann::json good = *read_json(path);
  for (const auto& [field, value] : {std::pair<const char*, nlohmann::json>{"hardness", 11},
                                     {"hardness", 30},
                                     {"hardness", -1},
                                     {"hardness", "10"},
                                     {"version", 1}}) {
    nlohmann::json json = good;
    json[field] = value;
    REQUIRE(write_json(bad, json).ok());
    const std::string changed = field;
    CAPTURE(changed);
    CHECK_FALSE(read_key(bad).ok());
  }
}

TEST_CASE("io/owner_key: a bound key keeps its decoder, and a file of which it was changed is refused") {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "bound.key", bad = folder.path() / "bad.key";
  OwnerKey key = *make_bound_key(some_secret(), std::string(64, 'd'), "2026-01-31T23:59:59Z", 48, "", 10);
  key.before_version_5 = true;
  REQUIRE(write_key(path, key).ok());
  const Result<OwnerKey> read = read_key(path, 48);
  REQUIRE(read.ok());
  CHECK(read->version() == 3);
  CHECK(read->decoder == key.decoder);
  CHECK(read->root() == key.root());
  CHECK(read->commitment() == key.commitment());
  const nlohmann::json good = *read_json(path);
  CHECK(good["derivation"].get<std::string>().find("and the decoder's 32 bytes") != std::string::npos);
  for (const auto& [field, value] : {std::pair<const char*, nlohmann::json>{"decoder", std::string(64, 'e')},
                                     {"decoder", std::string(64, 'D')},
                                     {"decoder", std::string(63, 'd')},
                                     {"decoder", ""},
                                     {"decoder", 5},
                                     {"hardness", 11},
                                     {"version", 2},
                                     {"version", 4}}) {
    nlohmann::json json = good;
    json[field] = value;
    REQUIRE(write_json(bad, json).ok());
    const std::string changed = field;
    CAPTURE(changed);
    CHECK_FALSE(read_key(bad).ok());
  }
  nlohmann::json json = good;
  json.erase("decoder");
  REQUIRE(write_json(bad, json).ok());
  CHECK_FALSE(read_key(bad).ok());
}

TEST_CASE(
    "io/owner_key: a key of version 5 is kept, with its decoder, its payload or its recipients, and no change of it") {
  const TemporaryFolder folder;
  const fs::path bad = folder.path() / "bad.key";
  for (int kind = 0; kind < 4; ++kind) {
    CAPTURE(kind);
    OwnerKey key = *make_hard_key(some_secret(), "2026-01-31T23:59:59Z", 48, "a note", 10);
    if (kind == 1) key.decoder = std::string(64, 'd');
    if (kind == 2) key.payload = "5eed", key.corrects = 4;
    if (kind == 3) key.recipients = 100;
    key.settle();
    CHECK(key.version() == 5);
    const fs::path path = folder.path() / (key.id() + ".key");
    REQUIRE(write_key(path, key).ok());
    const Result<OwnerKey> read = read_key(path, 48);
    REQUIRE(read.ok());
    CHECK(read->version() == 5);
    CHECK(read->root() == key.root());
    CHECK(read->commitment() == key.commitment());
    CHECK(read->decoder == key.decoder);
    CHECK(read->payload == key.payload);
    CHECK(read->recipients == key.recipients);
    for (const int earlier : {2, 3, 4}) {  // another derivation
      nlohmann::json json = *read_json(path);
      json.erase("checksum");  // which any change would show
      json["version"] = earlier;
      REQUIRE(write_json(bad, json).ok());
      CHECK_FALSE(read_key(bad).ok());
    }
    for (const auto& [field, value] : {std::pair<const char*, nlohmann::json>{"bits", 32},
                                       {"hardness", 11},
                                       {"recipients", 101},
                                       {"decoder", std::string(64, 'e')},
                                       {"payload", {{"hex", "5eee"}, {"corrects", 4}}}}) {
      nlohmann::json json = *read_json(path);
      json.erase("checksum");
      json[field] = value;
      REQUIRE(write_json(bad, json).ok());
      const std::string changed = field;
      CAPTURE(changed);
      const Result<OwnerKey> other = read_key(bad);
      REQUIRE_FALSE(other.ok());
      const bool both = kind == 2 && changed == "recipients";  // a payload and recipients, or the other way round
      if (!both && !(kind == 3 && changed == "payload")) CHECK(other.error().field == "commitment");
    }
    nlohmann::json whole = *read_json(path);
    whole.erase("checksum");
    REQUIRE(write_json(bad, whole).ok());
    CHECK(read_key(bad).ok());  // the control: it is the change that is refused
  }
}

TEST_CASE(
    "io/owner_key: of two programs that make one key file at once, the second is told, and the first has its key") {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "owner.key";
  // The second program looked, and found nothing, before the first one was done.
  Result<AtomicFile> second = AtomicFile::create(path, 0600);
  REQUIRE(second.ok());
  second->write(std::string_view("{}"));
  REQUIRE(write_key(path, some_key()).ok());
  CHECK_FALSE(second->commit_new().ok());
  CHECK(read_key(path)->commitment() == some_key().commitment());
}
