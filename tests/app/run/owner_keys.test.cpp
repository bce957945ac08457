// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/files.hpp>
#include <compmark/app/reading.hpp>
#include <compmark/app/run/owner_keys.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "support/tool.hpp"

TEST_CASE("app/run/owner_keys: a key is made once, moved aside on request, and its secret may be used again") {
  using namespace compmark;
  const testing::ScratchFolder folder("compmark-run-keys");
  std::vector<std::string> told;
  const auto warn = [&](const std::string& sentence) { told.push_back(sentence); };
  KeySettings settings;
  settings.out = folder.path / "owner.key";
  settings.created = "2026-01-31T23:59:59Z";
  const Result<MadeKey> first = make_key_file(settings, warn);
  REQUIRE(first.ok());
  CHECK(first->moved.empty());
  CHECK(open_key(settings.out)->commitment() == first->key.commitment());
  CHECK(first->key.created == settings.created);
  CHECK(key_file_is_private(settings.out));

  const Result<MadeKey> kept = make_key_file(settings, warn);
  REQUIRE_FALSE(kept.ok());
  CHECK(kept.error().remedy.find("--force") != std::string::npos);
  CHECK(open_key(settings.out)->commitment() == first->key.commitment());
  settings.force = true;
  const Result<MadeKey> second = make_key_file(settings, warn);
  REQUIRE(second.ok());
  CHECK(second->key.commitment() != first->key.commitment());
  CHECK(open_key(second->moved)->commitment() == first->key.commitment());

  KeySettings derived;
  derived.out = folder.path / "buyer.key";
  derived.created = settings.created;
  derived.from = second->moved;
  const Result<MadeKey> same = make_key_file(derived, warn);
  REQUIRE_FALSE(same.ok());
  CHECK(same.error().field == "--from");
  derived.payload = "5eed";
  // A key without a payload shares nothing with it.
  const Result<MadeKey> alone = make_key_file(derived, warn);
  REQUIRE_FALSE(alone.ok());
  CHECK(alone.error().field == "--from");
  KeySettings buyer = settings;
  buyer.out = folder.path / "first_buyer.key";
  buyer.payload = "0001";
  const Result<MadeKey> one = make_key_file(buyer, warn);
  REQUIRE(one.ok());
  derived.from = buyer.out;
  derived.corrects = one->key.corrects + 1;
  CHECK(make_key_file(derived, warn).error().field == "--corrects");
  derived.corrects = one->key.corrects;
  const Result<MadeKey> with_payload = make_key_file(derived, warn);
  REQUIRE(with_payload.ok());
  CHECK(with_payload->key.secret == one->key.secret);
  const PayloadCode::Reading said = read_payload(one->key, message_of(with_payload->key));
  REQUIRE(said.outcome == PayloadCode::Outcome::read);
  CHECK(said.data.hex() == "5eed");
  derived.payload = "not hexadecimal";
  derived.out = folder.path / "none.key";
  CHECK_FALSE(make_key_file(derived, warn).ok());
  CHECK_FALSE(std::filesystem::exists(derived.out));

  // Bound to a decoder, which must be one, and read as many bits as the message has.
  KeySettings bound;
  bound.out = folder.path / "bound.key";
  bound.created = settings.created;
  bound.hardness = 10;
  bound.decoder = "weights/lattice_48.safetensors";
  bound.payload = "0001";
  const Result<MadeKey> tied = make_key_file(bound, warn);
  REQUIRE(tied.ok());
  CHECK(tied->key.version() == 5);
  CHECK(tied->key.decoder == *file_sha256(bound.decoder));
  CHECK(open_decoder(bound.decoder, &tied->key).ok());
  const Result<FileDecoder> other = open_decoder("weights/universal3_64.safetensors", &tied->key);
  REQUIRE_FALSE(other.ok());
  CHECK(other.error().problem.find("not the decoder that this key is bound to") != std::string::npos);
  derived = KeySettings{};
  derived.created = settings.created;
  derived.from = bound.out;
  derived.payload = "5eed";
  derived.out = folder.path / "copy.key";
  derived.decoder = "weights/universal3_64.safetensors";
  CHECK_FALSE(make_key_file(derived, warn).ok());
  derived.decoder.clear();
  const Result<MadeKey> copy = make_key_file(derived, warn);
  REQUIRE(copy.ok());
  CHECK(copy->key.decoder == tied->key.decoder);
  CHECK(copy->key.root() == tied->key.root());
  bound.payload.clear();
  bound.out = folder.path / "none.key";
  for (const auto& wrong : {std::pair<std::size_t, std::filesystem::path>{32, bound.decoder},
                            {48, settings.out},
                            {48, folder.path / "missing.safetensors"}}) {
    bound.bits = wrong.first;
    bound.decoder = wrong.second;
    CHECK_FALSE(make_key_file(bound, warn).ok());
  }
  bound.bits = 48;
  bound.decoder = "weights/lattice_48.safetensors";
  bound.hardness = 0;
  const Result<MadeKey> quick = make_key_file(bound, warn);
  REQUIRE_FALSE(quick.ok());
  CHECK(quick.error().field == "--decoder");
  CHECK_FALSE(std::filesystem::exists(bound.out));

  CHECK(told.empty());
  std::filesystem::permissions(settings.out, std::filesystem::perms::others_read, std::filesystem::perm_options::add);
  REQUIRE(open_private_key(settings.out, warn).ok());
  REQUIRE(told.size() == 1);
  CHECK(told[0].find("chmod 600") != std::string::npos);
}

TEST_CASE("app/run/owner_keys: a key with recipients, more of them under its secret, and whose copy is meant") {
  using namespace compmark;
  const testing::ScratchFolder folder("compmark-run-recipients");
  KeySettings settings;
  settings.out = folder.path / "ten.key";
  settings.created = "2026-01-31T23:59:59Z";
  settings.hardness = 10;
  settings.recipients = 10;
  const Result<MadeKey> ten = make_key_file(settings);
  REQUIRE(ten.ok());
  CHECK(ten->key.recipients == 10);
  const Result<OwnerKey> read = open_key(settings.out);
  REQUIRE(read.ok());
  CHECK(read->recipients == 10);
  const Result<OwnerKey> fourth = for_recipient(*read, settings.out, 4);
  REQUIRE(fourth.ok());
  CHECK(fourth->recipient == 4);
  for (const std::size_t none : {0u, 11u}) {
    const Result<OwnerKey> wrong = for_recipient(*read, settings.out, none);
    REQUIRE_FALSE(wrong.ok());
    CHECK(wrong.error().field == "--recipient");
    CHECK(wrong.error().file == settings.out.string());
    CHECK(wrong.error().remedy.find("1 to 10") != std::string::npos);
  }
  KeySettings more = settings;
  more.from = settings.out;
  more.out = folder.path / "more.key";
  more.recipients = 50;
  const Result<MadeKey> fifty = make_key_file(more);
  REQUIRE(fifty.ok());
  OwnerKey before = *fourth, after = fifty->key;
  after.recipient = 4;
  CHECK(message_of(after) == message_of(before));
  CHECK(after.commitment() != before.commitment());

  KeySettings plain = settings;
  plain.out = folder.path / "plain.key";
  plain.recipients = 0;
  const Result<MadeKey> without = make_key_file(plain);
  REQUIRE(without.ok());
  CHECK(for_recipient(without->key, plain.out, 0).ok());
  CHECK_FALSE(for_recipient(without->key, plain.out, 1).ok());
  const auto refused = [&](const char* field, KeySettings wrong) {
    wrong.out = folder.path / "none.key";
    const Result<MadeKey> made = make_key_file(wrong);
    REQUIRE_FALSE(made.ok());
    CHECK(made.error().field == field);
    CHECK_FALSE(std::filesystem::exists(wrong.out));
  };
  KeySettings wrong = settings;
  wrong.bits = 16;
  refused("--recipients", wrong);
  wrong = settings;
  wrong.recipients = 16778;
  refused("--recipients", wrong);
  wrong = settings;
  wrong.payload = "5eed";
  refused("--payload", wrong);
  wrong = more;
  wrong.recipients = 10;  // as many as there are
  refused("--from", wrong);
  wrong.recipients = 0;
  refused("--from", wrong);
  wrong.recipients = 50;
  wrong.bits = 64;
  refused("--bits", wrong);
  wrong.bits = 48;
  wrong.from = plain.out;
  refused("--from", wrong);
}
