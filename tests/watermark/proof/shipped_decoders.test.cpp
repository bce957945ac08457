// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/io/read_file.hpp>
#include <compmark/io/sha256.hpp>
#include <compmark/watermark/proof/shipped_decoders.hpp>
#include <filesystem>
#include <set>
#include <string>

using namespace compmark;

TEST_CASE("watermark/proof/shipped_decoders: every decoder in weights/ is in the list under its name, and no other") {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator("weights")) {
    if (entry.path().extension() != ".safetensors") continue;
    const std::string digest = Sha256{}.update(*read_file(entry.path())).hex();
    CAPTURE(entry.path().string());
    const auto shipped = shipped_decoder_of(digest);
    REQUIRE(shipped.has_value());
    CHECK(shipped->name == entry.path().stem().string());
    names.emplace(shipped->name);
  }
  CHECK(names.size() == 5);
  std::set<std::string_view> digests;
  for (const ShippedDecoder& decoder : shipped_decoders) {
    CHECK(decoder.sha256.size() == 64);
    digests.insert(decoder.sha256);
  }
  CHECK(digests.size() == shipped_decoders.size());
  CHECK_FALSE(shipped_decoder_of(std::string(64, '0')).has_value());
  CHECK_FALSE(shipped_decoder_of("").has_value());
}
