// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the codec does with files that are not as they were written (docs/spec/compression.md, 4.4, case by case).
#include <doctest/doctest.h>

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/container/inspect.hpp"
#include "support/cmk_file.hpp"
#include "support/codec_model.hpp"

namespace {

using namespace compmark;
using testing::decode;
using testing::make_codec_model;
using testing::put;
using testing::same;
using File = testing::CmkFile;

const testing::CodecModelShape tiny{
    60,  4, 2, 16, 5, HashGridShape{.volume_levels = 1, .volume_cap_log2 = 5, .plane_levels = 1, .plane_cap_log2 = 6},
    true};

const std::vector<std::byte>& good_hac() {
  static const std::vector<std::byte> bytes = testing::encoded(make_codec_model(21, tiny)).bytes;
  return bytes;
}
template <class Change>
Error hac_error(const Change& change) {
  return testing::error_of_forged(good_hac(), change);
}

TEST_CASE("hac/hac_damage: every flipped bit of a file is found, with and without salvage") {
  testing::check_flipped_bits(good_hac(), 9, true);
}

TEST_CASE("hac/hac_damage: every truncation and every appended byte is found") {
  testing::check_truncations(good_hac());
}

TEST_CASE("hac/hac_damage: a file that ends too early has one level, which is whole when all of its chunks are there") {
  const std::vector<std::byte>& good = good_hac();
  const auto container = parse_container(good, "");
  REQUIRE(container.ok());
  REQUIRE(codec_levels(*container).size() == 1);
  const std::size_t end = codec_levels(*container)[0].end;
  REQUIRE(end < good.size());
  for (std::size_t n = 0; n < good.size(); ++n) {
    const auto cut = decode(std::span<const std::byte>(good).first(n), {.partial = true});
    REQUIRE(cut.ok() == (n >= end));
    if (!cut) {
      REQUIRE(cut.error().kind == ErrorKind::truncated);
      continue;
    }
    REQUIRE(!cut->verified);
    REQUIRE(cut->absent_anchors == 0);
    REQUIRE(cut->levels == 1);
    REQUIRE(same(cut->model, decode(good)->model));
  }
}

TEST_CASE("hac/hac_damage: random bytes in place of a payload, checksums right: an error, never a model") {
  testing::check_random_payloads(good_hac(), 150);
}

TEST_CASE("hac/hac_damage: another profile, numeric specification or table is refused, and both sides are named") {
  Error error = hac_error([](File& file) { file.header.profile = ContainerProfile::context_gs; });
  CHECK(error.kind == ErrorKind::unsupported);
  error = hac_error([](File& file) { file.header.numeric_spec = 77; });
  CHECK(error.kind == ErrorKind::unsupported);
  CHECK(error.problem.find("77") != std::string::npos);
  CHECK(error.problem.find("has 1") != std::string::npos);
  error = hac_error([](File& file) { file.of(HacFormat::tables).bytes[3] ^= std::byte{1}; });
  CHECK(error.kind == ErrorKind::unsupported);
  error = hac_error([](File& file) { file.of(HacFormat::geometry).entry.version = 2; });
  CHECK(error.kind == ErrorKind::unsupported);
  error = hac_error([](File& file) { file.of(HacFormat::geometry).entry.method = 1; });
  CHECK(error.kind == ErrorKind::unsupported);
}

TEST_CASE("hac/hac_damage: counts that the file cannot hold are refused before memory is taken") {
  for (const std::uint64_t anchors :
       {std::uint64_t{1}, std::uint64_t{61}, std::uint64_t{1} << 20, std::uint64_t{1} << 28, std::uint64_t{1} << 29,
        std::numeric_limits<std::uint64_t>::max()}) {
    (void)hac_error([&](File& file) { put(file.of(HacFormat::meta).bytes, 0, anchors); });
  }
  for (const std::uint32_t value : {0u, 33u, 0x80000000u, 0xFFFFFFFFu}) {
    (void)hac_error([&](File& file) { put(file.of(HacFormat::meta).bytes, 8, value); });   // K
    (void)hac_error([&](File& file) { put(file.of(HacFormat::meta).bytes, 16, value); });  // anchors a chunk
  }
  for (const std::uint32_t value : {0u, 4097u, 0xFFFFFFFFu}) {
    (void)hac_error([&](File& file) { put(file.of(HacFormat::meta).bytes, 12, value); });  // D
  }
  for (const double value :
       {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300}) {
    (void)hac_error([&](File& file) { put(file.of(HacFormat::meta).bytes, 20, value); });  // voxel size
    (void)hac_error([&](File& file) { put(file.of(HacFormat::meta).bytes, 28, value); });  // base steps
  }
  (void)hac_error([&](File& file) { put(file.of(HacFormat::meta).bytes, 52, 0xFFFFFFFFu); });  // number of values
  CHECK(decode(good_hac(), {.memory_limit = 100}).error().kind == ErrorKind::exhausted);
}

TEST_CASE("hac/hac_damage: missing, superfluous and unknown sections") {
  for (const std::uint32_t kind : HacFormat::known) {
    (void)hac_error([&](File& file) {
      for (std::size_t i = 0; i < file.sections.size(); ++i) {
        if (file.sections[i].entry.kind == kind) {
          file.sections.erase(file.sections.begin() + static_cast<std::ptrdiff_t>(i));
          return;
        }
      }
    });
  }
  (void)hac_error([](File& file) {
    Section more = file.of(HacFormat::stream, 0, 2);
    more.entry.chunk = 3;
    file.sections.push_back(more);
  });
  (void)hac_error([](File& file) { file.of(HacFormat::mask, 0, 2).entry.chunk = 7; });
  (void)hac_error([](File& file) { file.of(HacFormat::meta).entry.part = 1; });
  Section unknown;
  unknown.entry.kind = four_characters("XTRA");
  unknown.bytes = std::vector<std::byte>(9, std::byte{42});
  CHECK(hac_error([&](File& file) { file.sections.push_back(unknown); }).kind == ErrorKind::unsupported);
  // Not critical: skipped, and kept when the model is written again.
  unknown.entry.flags = 0;
  File file(good_hac());
  file.sections.push_back(unknown);
  const std::vector<std::byte> bytes = file.bytes();
  const auto read = decode(bytes);
  REQUIRE(read.ok());
  CHECK(read->verified);
  REQUIRE(read->model.extra.size() == 1);
  SerialExecutor executor;
  const auto again = encode_cmk(read->model, {}, executor);
  REQUIRE(again.ok());
  CHECK(again->bytes == bytes);
  // Damaged: refused, or left out and named.
  std::vector<std::byte> damaged = bytes;
  const auto parsed = parse_container(bytes, "");
  REQUIRE(parsed.ok());
  damaged[parsed->find(unknown.entry.kind)->offset + 4] ^= std::byte{1};
  CHECK_FALSE(decode(damaged).ok());
  const auto rest = decode(damaged, {.salvage = true});
  REQUIRE(rest.ok());
  CHECK(rest->verified);
  REQUIRE(rest->lost_sections.size() == 1);
  CHECK(rest->lost_sections[0].find("XTRA") != std::string::npos);
  CHECK(rest->model.extra.empty());
}

TEST_CASE("hac/hac_damage: more symbols than a chunk's bytes can hold are refused before there is memory for them") {
  for (const std::uint64_t items :
       {std::uint64_t{0}, std::uint64_t{1} << 40, std::numeric_limits<std::uint64_t>::max()}) {
    CHECK(hac_error([&](File& file) { file.of(HacFormat::stream, 0, 1).entry.items = items; }).field.find("STRM") !=
          std::string::npos);
  }
}

TEST_CASE("hac/hac_damage: a damaged chunk costs its anchors with salvage, and the whole file without") {
  const std::vector<std::byte> good = good_hac();
  const auto whole = decode(good);
  REQUIRE(whole.ok());
  const std::size_t n = whole->model.anchors();
  const auto container = parse_container(good, "");
  REQUIRE(container.ok());
  for (const std::uint32_t kind : {HacFormat::mask, HacFormat::stream}) {
    const SectionEntry* entry = container->find(kind, 0, 1);
    REQUIRE(entry != nullptr);
    std::vector<std::byte> bytes = good;
    bytes[static_cast<std::size_t>(entry->offset)] ^= std::byte{16};
    const auto refused = decode(bytes);
    REQUIRE(!refused.ok());
    CHECK(refused.error().problem.find("checksum") != std::string::npos);
    const auto rescued = decode(bytes, {.salvage = true});
    REQUIRE(rescued.ok());
    CHECK(!rescued->verified);
    REQUIRE(rescued->damaged.size() == 1);
    CHECK(rescued->damaged[0].first == 1);
    CHECK(rescued->lost_anchors == 16);
    REQUIRE(rescued->model.anchors() == n - 16);
    // What is left is what it was.
    const auto& a = rescued->model;
    const auto& b = whole->model;
    CHECK(std::equal(a.feature.begin(), a.feature.begin() + 64, b.feature.begin()));
    CHECK(std::equal(a.feature.begin() + 64, a.feature.end(), b.feature.begin() + 128));
    CHECK(std::equal(a.offset.begin() + 96, a.offset.end(), b.offset.begin() + 192));
    CHECK(std::equal(a.voxels.begin() + 16, a.voxels.end(), b.voxels.begin() + 32));
    SerialExecutor executor;
    CHECK(encode_cmk(a, {}, executor).ok());
  }
}

TEST_CASE(
    "hac/hac_damage: a stream that does not end as it must, left-over bytes, exchanged chunks: desynchronised, "
    "whatever the checksum") {
  (void)hac_error([](File& file) { file.of(HacFormat::stream).bytes.push_back(std::byte{0}); });
  (void)hac_error([](File& file) { file.of(HacFormat::stream).bytes.pop_back(); });
  (void)hac_error([](File& file) { file.of(HacFormat::mask).bytes.push_back(std::byte{0}); });
  (void)hac_error([](File& file) { file.of(HacFormat::hash).bytes.push_back(std::byte{0}); });
  (void)hac_error([](File& file) { file.of(HacFormat::context).bytes.push_back(std::byte{0}); });
  (void)hac_error([](File& file) { file.of(HacFormat::networks).bytes.push_back(std::byte{0}); });
  (void)hac_error(
      [](File& file) { std::swap(file.of(HacFormat::stream, 0, 0).bytes, file.of(HacFormat::stream, 0, 1).bytes); });
  (void)hac_error([](File& file) { file.of(HacFormat::stream).bytes.clear(); });
}

TEST_CASE("hac/hac_damage: whole bytes that decode to another model are a fault of the codec, and said to be one") {
  testing::check_digests(good_hac());
}

TEST_CASE("hac/hac_damage: networks that could overflow, have no units or are no numbers are refused at load") {
  (void)hac_error([](File& file) { put(file.of(HacFormat::context).bytes, 0, 0u); });
  (void)hac_error([](File& file) { put(file.of(HacFormat::context).bytes, 0, 0xFFFFFFFFu); });
  (void)hac_error([](File& file) { put(file.of(HacFormat::context).bytes, 4, std::int8_t{-3}); });  // a shift
  const Error error =
      hac_error([](File& file) { put(file.of(HacFormat::context).bytes, 4 + 5, 0x7FFFFFFF); });  // a bias
  CHECK(error.problem.find("overflow") != std::string::npos);
  (void)hac_error([](File& file) {
    CodecTensor tensor{"a", {1}, {std::numeric_limits<float>::quiet_NaN()}, TensorStorage::single};
    file.of(HacFormat::networks).bytes = encode_networks(std::span(&tensor, 1));
  });
}

TEST_CASE("hac/hac_damage: a symbol that would make a scale negative is refused, and so is one beyond the greatest") {
  // Encode such symbols by hand, with the model's own context.
  File file(good_hac());
  const auto whole = decode(good_hac());
  REQUIRE(whole.ok());
  const IntegerContext& context = *whole->model.context;
  const IntegerNetwork::Packed packed = context.network.pack();
  ContextEvaluator evaluator(context, packed);
  evaluator.evaluate(std::span<const Voxel>(whole->model.voxels).first(16));
  std::vector<SymbolModel> models;
  std::vector<std::uint32_t> masks(whole->model.mask.begin(), whole->model.mask.begin() + 16);
  for (std::size_t lane = 0; lane < 16; ++lane)
    detail::append_models(evaluator, context.heads, masks[lane], lane, models);
  const GaussianTables tables;
  for (const std::int32_t wrong : {-1, greatest_symbol + 1}) {
    std::vector<std::int32_t> symbols(models.size(), 0);
    symbols[4] = wrong;
    std::vector<std::uint8_t> stream;
    encode_symbols(tables, models, symbols, stream);
    const auto bytes = std::as_bytes(std::span<const std::uint8_t>(stream));
    file.of(HacFormat::stream).bytes.assign(bytes.begin(), bytes.end());
    const auto result = decode(file.bytes());
    REQUIRE(!result.ok());
    CHECK(result.error().problem.find("negative") != std::string::npos);
  }
}

}  // namespace
