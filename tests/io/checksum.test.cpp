// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// No damage of a file of ours is read as if nothing had happened.
#include "compmark/io/checksum.hpp"

#include <doctest/doctest.h>

#include <cstring>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "compmark/io/owner_key.hpp"
#include "compmark/io/safetensors.hpp"
#include "support/damage.hpp"
#include "support/scene_files.hpp"

namespace {

using namespace compmark;
using testing::TemporaryFolder;

using Bytes = testing::FileBytes;

SafetensorsWriter example(const std::vector<float>& a, const std::vector<float>& b) {
  SafetensorsWriter writer;
  writer.metadata = {{"format", "compmark decoder"}, {"note", "a text"}};
  writer.add_values("a", {static_cast<std::int64_t>(a.size())}, std::span<const float>(a));
  writer.add_values("b", {static_cast<std::int64_t>(b.size())}, std::span<const float>(b));
  return writer;
}

TEST_CASE("io/checksum: of tensor files no random damage is accepted, and much of it would be without the checksum") {
  const TemporaryFolder folder;
  const auto path = folder.path() / "t.safetensors";
  std::vector<float> a(50), b(50);
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i] = static_cast<float>(i);
    b[i] = -static_cast<float>(i);
  }
  REQUIRE(example(a, b).write(path).ok());
  const auto whole = read_safetensors(path);
  REQUIRE(whole.ok());
  CHECK(!whole->metadata.contains("checksum"));  // the file's, not the reader's
  CHECK(whole->metadata.size() == 2);
  // Two damages may make it a file of another format, which no reader of ours takes.
  testing::check_tensor_damage("a tensor file", *read_file(path), [](const SafetensorsFile& file, const Bytes&) {
    const auto format = file.metadata.find("format");
    return format != file.metadata.end() && format->second == "compmark decoder";
  });
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
  const auto meant = json_from(text);
  testing::check_damage("a key", good, 0, [&](const Bytes& bytes) {
    testing::put_raw(bad, bytes);
    const auto read = read_key(bad);
    if (!read) return testing::Reading::refused;
    // Only what is between the fields may differ: blanks.
    const bool same = json_from({reinterpret_cast<const char*>(bytes.data()), bytes.size()}) == meant &&
                      read->secret == key.secret && read->note == key.note && read->payload == key.payload;
    return same ? testing::Reading::same : testing::Reading::other;
  });
  auto before = json_from(text);
  before.erase("checksum");
  REQUIRE(write_json(bad, before).ok());
  CHECK(read_key(bad).ok());
  before["note"] = "another";  // nothing protected it
  REQUIRE(write_json(bad, before).ok());
  CHECK(read_key(bad).ok());
}

}  // namespace
