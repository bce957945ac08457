// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/reading.hpp>
#include <compmark/app/run/owner_keys.hpp>
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
  const Result<MadeKey> with_payload = make_key_file(derived, warn);
  REQUIRE(with_payload.ok());
  CHECK(with_payload->key.secret == first->key.secret);
  derived.payload = "not hexadecimal";
  derived.out = folder.path / "none.key";
  CHECK_FALSE(make_key_file(derived, warn).ok());
  CHECK_FALSE(std::filesystem::exists(derived.out));

  CHECK(told.empty());
  std::filesystem::permissions(settings.out, std::filesystem::perms::others_read, std::filesystem::perm_options::add);
  REQUIRE(open_private_key(settings.out, warn).ok());
  REQUIRE(told.size() == 1);
  CHECK(told[0].find("chmod 600") != std::string::npos);
}
