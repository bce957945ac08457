// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Random damage of compressed models of all codecs, those of the golden files: an error, whatever it is.
#include <doctest/doctest.h>

#include <filesystem>
#include <string>

#include "compmark/io/read_file.hpp"
#include "support/cmk_file.hpp"
#include "support/damage.hpp"

namespace {

using namespace compmark;
using testing::Reading;

TEST_CASE("container/damage: of compressed models of all codecs no damage is accepted") {
  for (const char* name : {"hac_small", "context_gs_small", "hac_plus_small"}) {
    const auto bytes = read_file(std::filesystem::path("tests/golden/codec") / (std::string(name) + ".cmk"));
    REQUIRE(bytes.ok());
    const auto whole = testing::decoded(*bytes);
    const auto container = parse_container(*bytes, "");
    REQUIRE(container.ok());
    testing::check_damage(
        name, *bytes, 64 + 48 * container->sections.size() + 4, [&](const testing::FileBytes& damaged) {
          const auto read = testing::decode(damaged);
          if (!read) return Reading::refused;
          return read->verified && testing::same(read->model, whole.model) ? Reading::same : Reading::other;
        });
    // The control: with the sections' checksums made right, some damage of a payload is noticed by the digest of the
    // model alone, which is one more.
    testing::CmkFile file(*bytes);
    file.sections.back().bytes.back() ^= std::byte{1};
    CHECK(!testing::decode(file.bytes()).ok());
  }
}

}  // namespace
