// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/io/owner_claim.hpp>
#include <filesystem>
#include <string>

#include "support/scene_files.hpp"

using namespace compmark;
using testing::TemporaryFolder;
namespace fs = std::filesystem;

namespace owner_claim_test {
namespace {

std::string digits(char c) { return std::string(64, c); }

}  // namespace

TEST_CASE("io/owner_claim: one line that names what is claimed, and its digest is that of the file") {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "owner.claim";
  for (const OwnerClaim& claim :
       {OwnerClaim{digits('1'), digits('a'), digits('c'), digits('d')}, OwnerClaim{digits('1'), digits('a'), "", ""}}) {
    REQUIRE(write_claim(path, claim).ok());
    const Result<OwnerClaim> read = read_claim(path);
    REQUIRE(read.ok());
    CHECK(read->key == claim.key);
    CHECK(read->decoder == claim.decoder);
    CHECK(read->unmarked == claim.unmarked);
    CHECK(read->interference == claim.interference);
    const auto bytes = *read_file(path);
    CHECK(Sha256{}.update(bytes).hex() == to_hex(claim.digest()));
    CHECK(std::count(bytes.begin(), bytes.end(), std::byte{'\n'}) == 1);
  }
}

TEST_CASE("io/owner_claim: a file that differs in one byte is another claim or none") {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "owner.claim";
  const OwnerClaim claim{digits('1'), digits('a'), digits('c'), ""};
  const std::string text = claim.text();
  int other = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    for (const char c : {'0', 'A', ' ', '\n', '\0'}) {
      std::string changed = text;
      changed[i] = c;
      if (changed == text) continue;
      REQUIRE(write_file(path, changed).ok());
      const Result<OwnerClaim> read = read_claim(path);
      if (read) {
        ++other;
        CHECK(read->digest() != claim.digest());
      } else {
        CHECK(read.error().file == path.string());
      }
    }
  }
  CHECK(other == 3 * 64);  // a digit became 0
  for (const std::string& wrong : {text + "\n", text.substr(0, 100), std::string(), "{}" + text, text + text}) {
    REQUIRE(write_file(path, wrong).ok());
    CHECK_FALSE(read_claim(path).ok());
  }
  REQUIRE(write_file(path, std::string(5000, 'x')).ok());
  CHECK_FALSE(read_claim(path).ok());
  CHECK_FALSE(read_claim(folder.path() / "none.claim").ok());
}

}  // namespace owner_claim_test
