// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the codec does with ContextGS files that are not as they were written (docs/spec/compression.md, 4.4, case by
// case): as hac_damage.test.cpp has them, and what is its own: levels that are not those of the anchors, a prior
// without an escape, chunks whose parents are lost.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/container/inspect.hpp"
#include "support/cmk_file.hpp"
#include "support/context_gs_model.hpp"

namespace {

using namespace compmark;
using testing::decode;
using testing::put;
using F = ContextGsFormat;
using File = testing::CmkFile;

/// Levels of 8 to 60 anchors, chunks of 16.
CodecModel tiny_model() {
  testing::CodecModelShape shape;
  shape.anchors = 140;
  shape.feature_dim = 4;
  shape.offset_count = 2;
  shape.chunk_anchors = 16;
  shape.hidden = 5;
  CodecModel model = testing::make_context_gs_model(21, shape, 3);
  model.networks.pop_back();
  return model;
}

const std::vector<std::byte>& good_context_gs() {
  static const std::vector<std::byte> bytes = testing::encoded(tiny_model()).bytes;
  return bytes;
}
template <class Change>
Error context_gs_error(const Change& change) {
  return testing::error_of_forged(good_context_gs(), change);
}

TEST_CASE("context_gs/context_gs_damage: every flipped bit of a file is found, with and without salvage") {
  testing::check_flipped_bits(good_context_gs(), 19, false);
}

TEST_CASE("context_gs/context_gs_damage: every truncation and every appended byte is found") {
  testing::check_truncations(good_context_gs());
}

TEST_CASE(
    "context_gs/context_gs_damage: a file that ends too early gives the levels that are whole, and nothing of the "
    "next") {
  const std::vector<std::byte>& good = good_context_gs();
  const auto whole = decode(good);
  REQUIRE(whole.ok());
  CHECK(whole->levels == 3);
  const auto container = parse_container(good, "");
  REQUIRE(container.ok());
  const std::vector<CodecLevel> levels = codec_levels(*container);
  REQUIRE(levels.size() == 3);
  CHECK(levels[0].anchors + levels[1].anchors + levels[2].anchors == whole->model.anchors());
  for (std::size_t n = 0; n < good.size(); ++n) {
    std::size_t arrived = 0, anchors = 0;
    while (arrived < 3 && levels[arrived].end <= n) anchors += levels[arrived++].anchors;
    const auto cut = decode(std::span<const std::byte>(good).first(n), {.partial = true});
    REQUIRE(cut.ok() == (arrived > 0));
    if (!cut) {
      REQUIRE(cut.error().kind == ErrorKind::truncated);
      continue;
    }
    REQUIRE(cut->levels == arrived);
    REQUIRE(cut->file_levels == 3);
    REQUIRE(!cut->verified);
    REQUIRE(cut->model.anchors() == anchors);
    REQUIRE(cut->absent_anchors == whole->model.anchors() - anchors);
    REQUIRE(std::equal(cut->model.voxels.begin(), cut->model.voxels.end(), whole->model.voxels.begin()));
    REQUIRE(std::equal(cut->model.mask.begin(), cut->model.mask.end(), whole->model.mask.begin()));
    REQUIRE(std::equal(cut->model.feature.begin(), cut->model.feature.end(), whole->model.feature.begin()));
    REQUIRE(std::equal(cut->model.scale.begin(), cut->model.scale.end(), whole->model.scale.begin()));
    REQUIRE(std::equal(cut->model.offset.begin(), cut->model.offset.end(), whole->model.offset.begin()));
    REQUIRE(std::equal(cut->model.hyperprior.begin(), cut->model.hyperprior.end(), whole->model.hyperprior.begin()));
    REQUIRE(cut->model.hyperprior.size() == anchors * 3);
    REQUIRE(cut->model.networks == whole->model.networks);
    REQUIRE(cut->model.metadata == whole->model.metadata);
    REQUIRE(cut->model.context_gs == whole->model.context_gs);
    REQUIRE(cut->absent_bytes == good.size() - n);
  }
  const auto all = decode(good, {.partial = true});
  REQUIRE(all.ok());
  CHECK(all->verified);
  CHECK(all->absent_bytes == 0);
  std::vector<std::byte> longer = good;
  longer.push_back(std::byte{0});
  CHECK(!decode(longer, {.partial = true}).ok());
  // What has arrived is as strict as ever, and is a model that can be written.
  const std::span<const std::byte> first = std::span<const std::byte>(good).first(levels[0].end);
  for (std::size_t i = 0; i < first.size(); ++i) {
    std::vector<std::byte> damaged(first.begin(), first.end());
    damaged[i] ^= std::byte{32};
    REQUIRE(!decode(damaged, {.partial = true}).ok());
  }
  SerialExecutor executor;
  const auto again = encode_cmk(decode(first, {.partial = true})->model, {}, executor);
  REQUIRE(again.ok());
  CHECK(again->report.level_anchors == std::array<std::uint64_t, 3>{0, 0, levels[0].anchors});
  CHECK(decode(again->bytes)->verified);
}

TEST_CASE(
    "context_gs/context_gs_damage: partial files of other shapes: unknown and missing sections, damage, empty levels") {
  Section unknown;
  unknown.entry.kind = four_characters("XTRA");
  unknown.entry.flags = 0;
  unknown.bytes = std::vector<std::byte>(9, std::byte{42});
  File file(good_context_gs());
  file.sections.push_back(unknown);
  std::vector<std::byte> bytes = file.bytes();
  const auto without = decode(std::span<const std::byte>(bytes).first(bytes.size() - 1), {.partial = true});
  REQUIRE(without.ok());  // DIGS is there, what nobody knows is not
  CHECK(without->verified);
  CHECK(without->lost_sections.empty());
  CHECK(without->model.extra.empty());
  CHECK(without->absent_bytes == 1);
  // Arrived, but another model than the header names: DIGS is not needed to find that.
  file = File(good_context_gs());
  file.header.digest ^= 1;
  bytes = file.bytes();
  CHECK(decode(std::span<const std::byte>(bytes).first(bytes.size() - 1), {.partial = true}).error().field == "DIGS");
  // No DIGS in the table is not one that has not arrived.
  file = File(good_context_gs());
  file.sections.pop_back();
  CHECK(!decode(file.bytes(), {.partial = true}).ok());
  // A chunk of the level that has not arrived may be damaged, one of a whole level may not; salvage leaves it out.
  file = File(good_context_gs());
  bytes = file.bytes();
  const auto container = parse_container(bytes, "");
  REQUIRE(container.ok());
  const std::vector<CodecLevel> levels = codec_levels(*container);
  const std::span<const std::byte> cut = std::span<const std::byte>(bytes).first(bytes.size() - 200);
  REQUIRE(cut.size() > levels[1].end);
  REQUIRE(cut.size() < levels[2].end);
  const auto flip = [&](std::uint32_t part) {
    bytes[static_cast<std::size_t>(container->find(F::stream, part, 0)->offset)] ^= std::byte{4};
  };
  flip(1);
  CHECK(!decode(cut, {.partial = true}).ok());
  const auto salvaged = decode(cut, {.salvage = true, .partial = true});
  REQUIRE(salvaged.ok());
  CHECK(salvaged->levels == 2);
  CHECK(salvaged->lost_anchors == container->find(F::mask, 1, 0)->items);
  CHECK(salvaged->model.anchors() == levels[0].anchors + levels[1].anchors - salvaged->lost_anchors);
  CHECK(salvaged->absent_anchors == levels[2].anchors);
  flip(1);
  REQUIRE(decode(bytes).ok());
  // Nothing is kept for anchors that have not arrived; 12 bytes a symbol are for the chunk that is decoded.
  REQUIRE(container->find(F::stream, 0, 1) == nullptr);
  const std::uint64_t needed =
      4 * (3 + 1 + 4 + 6 + 6 + 3) * levels[0].anchors + 12 * std::uint64_t{container->find(F::stream, 0, 0)->items};
  const std::span<const std::byte> coarse = std::span<const std::byte>(bytes).first(levels[0].end);
  CHECK(decode(coarse, {.partial = true, .memory_limit = needed}).ok());
  CHECK(decode(coarse, {.partial = true, .memory_limit = needed - 1}).error().kind == ErrorKind::exhausted);
  // Cells that hold one anchor each: all of level 2, and that is the whole of it.
  CodecModel lonely = decode(good_context_gs())->model;
  lonely.context_gs->cells = {1, 1};
  const std::vector<std::byte> one = testing::encoded(lonely).bytes;
  const auto parsed = parse_container(one, "");
  REQUIRE(parsed.ok());
  const std::vector<CodecLevel> single = codec_levels(*parsed);
  REQUIRE(single.size() == 3);
  CHECK(single[0].end == single[2].end);
  const auto first = decode(std::span<const std::byte>(one).first(single[0].end), {.partial = true});
  REQUIRE(first.ok());
  CHECK(first->levels == 3);
  CHECK(first->absent_anchors == 0);
}

TEST_CASE(
    "context_gs/context_gs_damage: random bytes in place of a payload, checksums right: an error, never a model") {
  testing::check_random_payloads(good_context_gs(), 300);
}

TEST_CASE("context_gs/context_gs_damage: another profile, numeric specification or version is refused") {
  CHECK(context_gs_error([](File& file) { file.header.profile = ContainerProfile::hac; }).kind ==
        ErrorKind::unsupported);
  CHECK(context_gs_error([](File& file) { file.header.profile = static_cast<ContainerProfile>(3); }).kind ==
        ErrorKind::unsupported);
  CHECK(context_gs_error([](File& file) { file.header.numeric_spec = 77; }).problem.find("has 1") != std::string::npos);
  CHECK(context_gs_error([](File& file) { file.of(F::tables).bytes[3] ^= std::byte{1}; }).kind ==
        ErrorKind::unsupported);
  CHECK(context_gs_error([](File& file) { file.of(F::levels).entry.version = 2; }).kind == ErrorKind::unsupported);
}

TEST_CASE("context_gs/context_gs_damage: counts that the file cannot hold are refused before memory is taken") {
  for (const std::uint64_t anchors : {std::uint64_t{1}, std::uint64_t{61}, std::uint64_t{1} << 28,
                                      std::uint64_t{1} << 29, std::numeric_limits<std::uint64_t>::max()}) {
    (void)context_gs_error([&](File& file) { put(file.of(F::meta).bytes, 0, anchors); });
    for (const std::size_t offset : {47u, 55u, 63u}) {  // anchors of a level
      (void)context_gs_error([&](File& file) { put(file.of(F::levels).bytes, offset, anchors); });
    }
  }
  // Cells that make other levels.
  CHECK(context_gs_error([](File& file) {
          std::int32_t fine = 0;
          std::memcpy(&fine, file.of(F::levels).bytes.data(), 4);
          put(file.of(F::levels).bytes, 0, 2 * fine);
        }).problem.find("levels are not") != std::string::npos);
  CHECK(decode(good_context_gs(), {.memory_limit = 100}).error().kind == ErrorKind::exhausted);
  for (const std::uint64_t items : {std::uint64_t{0}, std::uint64_t{1} << 40}) {
    (void)context_gs_error([&](File& file) { file.of(F::stream, 0, 1).entry.items = items; });
    (void)context_gs_error([&](File& file) { file.of(F::hyperprior, 1, 0).entry.items = items; });
  }
}

TEST_CASE("context_gs/context_gs_damage: levels, scales, priors and networks out of range are refused at load") {
  for (const std::int32_t edge : {0, -1, std::numeric_limits<std::int32_t>::min()}) {
    (void)context_gs_error([&](File& file) { put(file.of(F::levels).bytes, 0, edge); });
    (void)context_gs_error([&](File& file) { put(file.of(F::levels).bytes, 4, edge); });
  }
  (void)context_gs_error([](File& file) { put(file.of(F::levels).bytes, 8, std::int32_t{-4}); });        // scale of x
  (void)context_gs_error([](File& file) { put(file.of(F::levels).bytes, 12, std::uint8_t{63}); });       // its fraction
  (void)context_gs_error([](File& file) { put(file.of(F::levels).bytes, 13, std::int64_t{1} << 62); });  // its offset
  (void)context_gs_error([](File& file) { put(file.of(F::levels).bytes, 71 + 6, std::uint8_t{63}); });   // a shift
  (void)context_gs_error([](File& file) { put(file.of(F::levels).bytes, 71, (std::int32_t{1} << 30) + 1); });  // a mean
  (void)context_gs_error([](File& file) { file.of(F::levels).bytes.push_back(std::byte{0}); });
  (void)context_gs_error([](File& file) { put(file.of(F::prior).bytes, 0, std::uint8_t{0}); });
  (void)context_gs_error([](File& file) { put(file.of(F::prior).bytes, 0, std::uint8_t{65}); });
  // A prior that leaves nothing for the escape.
  IntegerContextGs full;
  full.channels = 3;
  full.prior.assign(3 * HyperpriorFormat::slots, 65'000);
  CHECK(context_gs_error([&](File& file) {
          file.of(F::prior).bytes = detail::encode_prior(full);
        }).problem.find("escape") != std::string::npos);
  for (std::uint32_t level = 0; level < 3; ++level) {
    (void)context_gs_error([&](File& file) { put(file.of(F::context, level).bytes, 0, 0u); });
    (void)context_gs_error([&](File& file) { put(file.of(F::context, level).bytes, 4, std::int8_t{-3}); });
    CHECK(context_gs_error([&](File& file) {
            put(file.of(F::context, level).bytes, 4 + 5, 0x7FFFFFFF);
          }).problem.find("overflow") != std::string::npos);
  }
}

TEST_CASE("context_gs/context_gs_damage: missing, superfluous and unknown sections") {
  for (const std::uint32_t kind : F::known) {
    (void)context_gs_error([&](File& file) {
      const auto at = std::find_if(file.sections.begin(), file.sections.end(),
                                   [&](const Section& section) { return section.entry.kind == kind; });
      file.sections.erase(at);
    });
  }
  (void)context_gs_error([](File& file) { file.of(F::context, 2).entry.part = 3; });
  (void)context_gs_error([](File& file) { file.of(F::levels).entry.part = 1; });
  (void)context_gs_error([](File& file) { file.of(F::mask, 0, 1).entry.chunk = 70; });
  (void)context_gs_error([](File& file) {  // a level's chunks under another level's name
    std::swap(file.of(F::stream, 0, 0).entry.part, file.of(F::stream, 1, 0).entry.part);
  });
  Section unknown;
  unknown.entry.kind = four_characters("HASH");  // of HAC
  unknown.bytes = std::vector<std::byte>(9, std::byte{42});
  CHECK(context_gs_error([&](File& file) { file.sections.push_back(unknown); }).kind == ErrorKind::unsupported);
  unknown.entry.flags = 0;
  File file(good_context_gs());
  file.sections.push_back(unknown);
  const auto read = decode(file.bytes());
  REQUIRE(read.ok());
  CHECK(read->verified);
  SerialExecutor executor;
  const auto again = encode_cmk(read->model, {}, executor);
  REQUIRE(again.ok());
  CHECK(again->bytes == file.bytes());
}

TEST_CASE(
    "context_gs/context_gs_damage: salvage leaves out a damaged chunk and every chunk with an anchor that it "
    "predicts") {
  const std::vector<std::byte>& good = good_context_gs();
  const auto whole = decode(good);
  REQUIRE(whole.ok());
  const CodecModel& model = whole->model;
  // Who is whose child, by the levels alone.
  std::vector<Voxel> curve = model.voxels;
  const std::vector<std::uint32_t> along = morton_order(curve, voxel_range(curve));
  for (std::size_t i = 0; i < along.size(); ++i) curve[i] = model.voxels[along[i]];
  const detail::ContextGsOrder order = detail::context_gs_order(curve, model.context_gs->cells);
  const std::vector<detail::ChunkPlace> places = detail::chunk_places(order.ranges(), 16);
  const auto container = parse_container(good, "");
  REQUIRE(container.ok());
  REQUIRE(places.size() > 6);
  std::size_t most = 0, least = 1000;
  for (const std::uint32_t kind : F::chunked) {
    for (std::size_t hit = 0; hit < places.size(); ++hit) {
      std::set<std::size_t> expected{hit};
      for (std::size_t c = 0; c < places.size(); ++c) {  // parents come before children
        for (std::size_t i = places[c].begin; i < places[c].end; ++i) {
          if (order.parent[i] == AnchorLevels::none) continue;
          for (const std::size_t lost : std::set<std::size_t>(expected)) {
            if (order.parent[i] >= places[lost].begin && order.parent[i] < places[lost].end) expected.insert(c);
          }
        }
      }
      const SectionEntry* entry = container->find(kind, places[hit].part, places[hit].chunk);
      REQUIRE(entry != nullptr);
      std::vector<std::byte> bytes = good;
      bytes[static_cast<std::size_t>(entry->offset)] ^= std::byte{16};
      const auto refused = decode(bytes);
      REQUIRE(!refused.ok());
      CHECK(refused.error().problem.find("checksum") != std::string::npos);
      const auto rescued = decode(bytes, {.salvage = true});
      REQUIRE(rescued.ok());
      CHECK(!rescued->verified);
      std::set<std::size_t> lost;
      for (const auto& [chunk, error] : rescued->damaged) lost.insert(chunk);
      CHECK(lost == expected);
      most = std::max(most, lost.size());
      least = std::min(least, lost.size());
      // What is left is what it was, in its order.
      std::size_t at = 0;
      for (std::size_t c = 0; c < places.size(); ++c) {
        for (std::size_t i = places[c].begin; lost.count(c) == 0 && i < places[c].end; ++i, ++at) {
          REQUIRE(rescued->model.voxels[at] == model.voxels[i]);
          REQUIRE(std::equal(model.feature.begin() + static_cast<std::ptrdiff_t>(4 * i),
                             model.feature.begin() + static_cast<std::ptrdiff_t>(4 * i + 4),
                             rescued->model.feature.begin() + static_cast<std::ptrdiff_t>(4 * at)));
        }
      }
      CHECK(at == rescued->model.anchors());
      CHECK(rescued->lost_anchors == model.anchors() - at);
      SerialExecutor executor;
      const auto again = encode_cmk(rescued->model, {}, executor);
      REQUIRE(again.ok());
      CHECK(decode(again->bytes).ok());
    }
  }
  CHECK(least == 1);
  CHECK(most > 3);
}

TEST_CASE("context_gs/context_gs_damage: a stream that does not end as it must, exchanged chunks: desynchronised") {
  for (const std::uint32_t kind : F::chunked) {
    (void)context_gs_error([&](File& file) { file.of(kind, 1).bytes.push_back(std::byte{0}); });
    (void)context_gs_error([&](File& file) { file.of(kind, 1).bytes.clear(); });
    (void)context_gs_error([&](File& file) { std::swap(file.of(kind, 0, 0).bytes, file.of(kind, 0, 1).bytes); });
  }
  (void)context_gs_error([](File& file) { file.of(F::prior).bytes.push_back(std::byte{0}); });
  (void)context_gs_error([](File& file) { file.of(F::context, 1).bytes.push_back(std::byte{0}); });
  // Other symbols of z, as whole as they were: the networks that read them predict another stream.
  const Error error = context_gs_error([](File& file) {
    const auto whole = decode(good_context_gs());
    REQUIRE(whole.ok());
    const std::size_t begin = static_cast<std::size_t>(file.of(F::mask, 2).entry.items);
    std::vector<std::int32_t> z(whole->model.hyperprior.begin() + static_cast<std::ptrdiff_t>(3 * begin),
                                whole->model.hyperprior.begin() + static_cast<std::ptrdiff_t>(3 * (begin + 16)));
    z[5] += 3;
    const HyperpriorTables tables(whole->model.context_gs->prior);
    (void)detail::encode_hyperprior(tables, z, file.of(F::hyperprior, 1).bytes);
  });
  CHECK(error.field.find("chunk") != std::string::npos);
  // … and a symbol beyond the greatest.
  CHECK(context_gs_error([](File& file) {
          const auto whole = decode(good_context_gs());
          const HyperpriorTables tables(whole->model.context_gs->prior);
          std::vector<std::int32_t> z(static_cast<std::size_t>(3 * file.of(F::mask, 2).entry.items), 0);
          z[1] = HyperpriorFormat::greatest + 1;
          (void)detail::encode_hyperprior(tables, z, file.of(F::hyperprior, 2).bytes);
        }).problem.find("greatest") != std::string::npos);
}

TEST_CASE(
    "context_gs/context_gs_damage: whole bytes that decode to another model are a fault of the codec, and said to be "
    "one") {
  testing::check_digests(good_context_gs());
}

}  // namespace
