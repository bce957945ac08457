// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/xxh64.hpp"

#include <doctest/doctest.h>

#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace compmark;

std::uint64_t hash_of(std::string_view text) {
  return Xxh64{}.update(std::as_bytes(std::span<const char>(text.data(), text.size()))).digest();
}

TEST_CASE("io/xxh64: published values") {
  CHECK(hash_of("") == 0xEF46DB3751D8E999u);
  CHECK(hash_of("a") == 0xD24EC4F1A98C6E5Bu);
  CHECK(hash_of("abc") == 0x44BC2CF5AD770999u);
  CHECK(hash_of("Nobody inspects the spammish repetition") == 0xFBCEA83C8A378BF1u);
}

TEST_CASE("io/xxh64: pieces do not matter, every bit and the length do") {
  std::string text(150, '\0');
  for (std::size_t i = 0; i < text.size(); ++i) text[i] = static_cast<char>(7 * i + i * i);
  const auto bytes = std::as_bytes(std::span<const char>(text.data(), text.size()));
  for (std::size_t cut = 0; cut <= text.size(); ++cut)
    CHECK(Xxh64{}.update(bytes.first(cut)).update({}).update(bytes.subspan(cut)).digest() == hash_of(text));
  std::set<std::uint64_t> seen{hash_of(text)};
  for (std::size_t bit = 0; bit < 8 * text.size(); ++bit) {
    std::string changed = text;
    changed[bit / 8] = static_cast<char>(changed[bit / 8] ^ (1 << bit % 8));
    seen.insert(hash_of(changed));
  }
  for (std::size_t size = 0; size < text.size(); ++size) seen.insert(hash_of(std::string_view(text).substr(0, size)));
  CHECK(seen.size() == 1 + 8 * text.size() + text.size());
  CHECK(Xxh64{}.text("ab").text("c").digest() != Xxh64{}.text("a").text("bc").digest());
}

}  // namespace
