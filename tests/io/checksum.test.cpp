// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// No damage of a file of ours is read as if nothing had happened.
#include "compmark/io/checksum.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "compmark/io/owner_key.hpp"
#include "compmark/io/safetensors.hpp"
#include "support/scene_files.hpp"

namespace {

using namespace compmark;
using testing::TemporaryFolder;

using Bytes = std::vector<std::byte>;

/// One random damage: a bit, a byte, a run of bytes, an end cut off, bytes doubled, two blocks exchanged.
Bytes damaged(Bytes bytes, std::mt19937& random) {
  const Bytes before = bytes;
  const auto any = [&] { return random() % bytes.size(); };
  while (bytes == before) {
    const std::size_t at = any();
    switch (random() % 6) {
      case 0:
        bytes[at] ^= static_cast<std::byte>(1u << random() % 8);
        break;
      case 1:
        bytes[at] = static_cast<std::byte>(random());
        break;
      case 2:
        for (std::size_t i = at; i < std::min(bytes.size(), at + 1 + random() % 16); ++i)
          bytes[i] = static_cast<std::byte>(random());
        break;
      case 3:
        bytes.resize(at);
        break;
      case 4:
        bytes.insert(bytes.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(1 + random() % 8));
        break;
      default: {
        const std::size_t size = std::min<std::size_t>(std::size_t{4} << random() % 4, bytes.size() / 2),
                          other = random() % (bytes.size() - size + 1);
        const std::size_t first = std::min(at, bytes.size() - size);
        if (first + size <= other || other + size <= first)
          std::swap_ranges(bytes.begin() + static_cast<std::ptrdiff_t>(first),
                           bytes.begin() + static_cast<std::ptrdiff_t>(first + size),
                           bytes.begin() + static_cast<std::ptrdiff_t>(other));
      }
    }
    if (bytes.empty()) bytes = before;
  }
  return bytes;
}

/// How often: COMPMARK_CORRUPTIONS, for a campaign, or 500.
int corruptions() {
  const char* text = std::getenv("COMPMARK_CORRUPTIONS");
  return text != nullptr ? std::atoi(text) : 500;
}

SafetensorsWriter example(const std::vector<float>& a, const std::vector<float>& b) {
  SafetensorsWriter writer;
  writer.metadata = {{"format", "compmark decoder"}, {"note", "a text"}};
  writer.add_values("a", {static_cast<std::int64_t>(a.size())}, std::span<const float>(a));
  writer.add_values("b", {static_cast<std::int64_t>(b.size())}, std::span<const float>(b));
  return writer;
}

bool same_content(const SafetensorsFile& a, const SafetensorsFile& b) {
  if (a.metadata != b.metadata || a.tensors.size() != b.tensors.size()) return false;
  for (const auto& [name, tensor] : a.tensors) {
    const auto other = b.tensors.find(name);
    if (other == b.tensors.end() || other->second.dtype != tensor.dtype || other->second.shape != tensor.shape ||
        !std::equal(tensor.data.begin(), tensor.data.end(), other->second.data.begin(), other->second.data.end()))
      return false;
  }
  return true;
}

TEST_CASE(
    "io/checksum: of tensor files no random damage is accepted, and nearly all of it would be without the checksum") {
  const TemporaryFolder folder;
  const auto path = folder.path() / "t.safetensors";
  std::vector<float> a(50), b(50);
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i] = static_cast<float>(i);
    b[i] = -static_cast<float>(i);
  }
  REQUIRE(example(a, b).write(path).ok());
  const Bytes good = *read_file(path);
  const auto whole = read_safetensors(path);
  REQUIRE(whole.ok());
  CHECK(!whole->metadata.contains("checksum"));  // the file's, not the reader's
  CHECK(whole->metadata.size() == 2);
  std::mt19937 random(7);
  int accepted = 0;
  for (int i = 0; i < corruptions(); ++i) {
    CAPTURE(i);
    const Bytes bytes = damaged(good, random);
    const auto read = parse_safetensors(bytes, "t");
    // Blanks may have moved; or two damages made it a file of another format, which no reader of ours takes.
    if (read.ok() && read->metadata.at("format") == whole->metadata.at("format")) CHECK(same_content(*read, *whole));
    accepted += read.ok() ? 1 : 0;
  }
  CHECK(accepted <= corruptions() / 100);
  // Without the checksum damage of the data is not seen: what this file was like before.
  Bytes bare = good;
  const std::string text(reinterpret_cast<const char*>(bare.data()), bare.size());
  const std::size_t at = text.find("\"checksum\":\"xxh64:");
  REQUIRE(at != std::string::npos);
  const std::string blank = "\"checkless\":\"none" + std::string(18, '.');
  std::memcpy(bare.data() + at, blank.data(), 34);
  CHECK(parse_safetensors(bare, "t").ok());
  bare.back() ^= std::byte{1};
  CHECK(parse_safetensors(bare, "t").ok());
}

TEST_CASE(
    "io/checksum: tensors exchanged, metadata changed, the checksum renamed or spoilt are damage; another layout is "
    "none") {
  const TemporaryFolder folder;
  const auto path = folder.path() / "t.safetensors";
  const std::vector<float> a(40, 1.0f), b(40, 2.0f);
  REQUIRE(example(a, b).write(path).ok());
  const Bytes good = *read_file(path);
  const std::string text(reinterpret_cast<const char*>(good.data()), good.size());
  const auto with = [&](const std::string& old, const std::string& now) {
    REQUIRE(old.size() == now.size());
    std::string changed = text;
    const std::size_t at = changed.find(old);
    REQUIRE(at != std::string::npos);
    changed.replace(at, old.size(), now);
    const auto bytes = std::as_bytes(std::span<const char>(changed.data(), changed.size()));
    return parse_safetensors(Bytes(bytes.begin(), bytes.end()), "t");
  };
  CHECK(with("a text", "a text").ok());
  for (const auto& change : std::vector<std::pair<std::string, std::string>>{{"a text", "a test"},
                                                                             {"\"note\"", "\"nose\""},
                                                                             {"\"b\":{", "\"c\":{"},
                                                                             {"[40]", "[20]"},
                                                                             {"\"F32\"", "\"I32\""},
                                                                             {"checksum", "checksun"},
                                                                             {"xxh64:", "xxh65:"}}) {
    CAPTURE(change.second);
    CHECK(!with(change.first, change.second).ok());
  }
  const auto error = with("a text", "a test").error();
  CHECK(error.field.find("checksum") != std::string::npos);
  CHECK(error.problem.find("damaged") != std::string::npos);
  // Stored again with more room behind the header: the same content.
  Bytes wider = good;
  std::uint64_t header = 0;
  std::memcpy(&header, wider.data(), 8);
  wider.insert(wider.begin() + static_cast<std::ptrdiff_t>(8 + header), 64, std::byte{' '});
  header += 64;
  std::memcpy(wider.data(), &header, 8);
  CHECK(parse_safetensors(wider, "t").ok());
}

TEST_CASE("io/checksum: of keys no random damage changes anything that is read; keys of before are read") {
  const TemporaryFolder folder;
  const auto path = folder.path() / "owner.key", bad = folder.path() / "bad.key";
  Digest256 secret{};
  secret[5] = std::byte{9};
  OwnerKey key = *make_key(secret, "2026-01-31T23:59:59Z", 48, "a note");
  key.payload = "0123ab";
  key.corrects = 3;
  REQUIRE(write_key(path, key).ok());
  REQUIRE(read_key(path).ok());
  const Bytes good = *read_file(path);
  const std::string text(reinterpret_cast<const char*>(good.data()), good.size());
  std::mt19937 random(8);
  for (int i = 0; i < corruptions(); ++i) {
    CAPTURE(i);
    const Bytes bytes = damaged(good, random);
    REQUIRE(write_file(bad, std::span<const std::byte>(bytes)).ok());
    const auto read = read_key(bad);
    if (!read) continue;
    // Only what is between the fields may differ: blanks.
    const auto meant = json_from({text.data(), text.size()});
    CHECK(json_from({reinterpret_cast<const char*>(bytes.data()), bytes.size()}) == meant);
  }
  auto before = json_from(text);
  before.erase("checksum");
  REQUIRE(write_json(bad, before).ok());
  CHECK(read_key(bad).ok());
  before["note"] = "another";  // nothing protected it
  REQUIRE(write_json(bad, before).ok());
  CHECK(read_key(bad).ok());
}

}  // namespace
