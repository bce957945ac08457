// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the codec does with files that are not as they were written; what it shares with HAC is in hac_damage.test.
#include <doctest/doctest.h>

#include <cstdint>
#include <span>
#include <vector>

#include "codec/hac_plus/correlated_model.hpp"
#include "support/cmk_file.hpp"
#include "support/codec_model.hpp"

namespace {

using namespace compmark;
using testing::decode;
using testing::same;
using File = testing::CmkFile;

const std::vector<std::byte>& good_plus() {
  static const testing::CodecModelShape tiny{
      150,  4, 2,
      40,   5, HashGridShape{.volume_levels = 1, .volume_cap_log2 = 5, .plane_levels = 1, .plane_cap_log2 = 6},
      false};
  static const std::vector<std::byte> bytes = testing::encoded(testing::make_correlated_model(21, tiny, 5)).bytes;
  return bytes;
}
template <class Change>
Error plus_error(const Change& change) {
  return testing::error_of_forged(good_plus(), change);
}

TEST_CASE("hac_plus/hac_plus_damage: every flipped bit of a file is found, with and without salvage") {
  REQUIRE(File(good_plus()).of(HacPlusFormat::intra).bytes.size() > 1);  // it has weights
  testing::check_flipped_bits(good_plus(), 9, true);
}

TEST_CASE("hac_plus/hac_plus_damage: every truncation and every appended byte is found") {
  testing::check_truncations(good_plus());
}

TEST_CASE("hac_plus/hac_plus_damage: random bytes in place of a payload, checksums right: an error, never a model") {
  testing::check_random_payloads(good_plus(), 150);
}

TEST_CASE("hac_plus/hac_plus_damage: whole bytes that decode to another model are said to be a fault of the codec") {
  testing::check_digests(good_plus());
}

TEST_CASE("hac_plus/hac_plus_damage: missing sections, and a file of one codec that says it is of the other") {
  for (const std::uint32_t kind : HacPlusFormat::known) {
    (void)plus_error([&](File& file) {
      for (std::size_t i = 0; i < file.sections.size(); ++i) {
        if (file.sections[i].entry.kind == kind) {
          file.sections.erase(file.sections.begin() + static_cast<std::ptrdiff_t>(i));
          return;
        }
      }
    });
  }
  (void)plus_error([](File& file) { file.header.profile = ContainerProfile::hac; });
  (void)plus_error([](File& file) { file.header.profile = ContainerProfile::context_gs; });
}

TEST_CASE("hac_plus/hac_plus_damage: weights that are not those of the encoder are refused") {
  const auto intra_error = [](std::vector<std::byte> bytes) {
    return plus_error([&](File& file) { file.of(HacPlusFormat::intra).bytes = bytes; });
  };
  CHECK(intra_error({}).field == "INTR");
  CHECK(intra_error({std::byte{2}}).field == "INTR");
  CHECK(intra_error({std::byte{1}}).field == "INTR");
  CHECK(intra_error({std::byte{0}, std::byte{0}}).field == "INTR");
  CHECK(intra_error({std::byte{0}}).field != "INTR");  // no weights: well formed, but of other symbols
  // A weight beyond 127, and weights that are all zero where the file says that there are some.
  IntraContext context = IntraContext::none(4 + 6 + 6);
  context.mean[3] = 300;
  CHECK(intra_error(detail::encode_intra(context)).problem.find("300") != std::string::npos);
  context.mean[3] = 0;
  context.mean_bias[0] = 1;
  std::vector<std::byte> bytes = detail::encode_intra(context);
  REQUIRE(bytes[0] == std::byte{1});
  detail::BitsOut bits;
  IntraContext zeros = IntraContext::none(16);
  for (auto* part : IntraContext::parts(zeros)) detail::code_integers(bits, std::span<std::int16_t>(*part), 1);
  bytes = bits.finish();
  bytes.insert(bytes.begin(), std::byte{1});
  CHECK(intra_error(bytes).problem.find("zero") != std::string::npos);
}

TEST_CASE("hac_plus/hac_plus_damage: a damaged chunk costs its anchors with salvage, and the whole file without") {
  const auto whole = decode(good_plus());
  REQUIRE(whole.ok());
  const auto container = parse_container(good_plus(), "");
  REQUIRE(container.ok());
  const SectionEntry* entry = container->find(HacPlusFormat::stream, 0, 1);
  REQUIRE(entry != nullptr);
  std::vector<std::byte> bytes = good_plus();
  bytes[static_cast<std::size_t>(entry->offset)] ^= std::byte{16};
  REQUIRE(!decode(bytes).ok());
  const auto rescued = decode(bytes, {.salvage = true});
  REQUIRE(rescued.ok());
  CHECK(!rescued->verified);
  CHECK(rescued->lost_anchors == 40);
  CHECK(rescued->model.anchors() == whole->model.anchors() - 40);
  CHECK(std::equal(rescued->model.feature.begin(), rescued->model.feature.begin() + 160, whole->model.feature.begin()));
  CHECK(std::equal(rescued->model.feature.begin() + 160, rescued->model.feature.end(),
                   whole->model.feature.begin() + 320));
  SerialExecutor executor;
  CHECK(encode_cmk(rescued->model, {}, executor).ok());
}

}  // namespace
