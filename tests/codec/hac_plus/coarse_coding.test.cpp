// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "codec/hac_plus/correlated_model.hpp"
#include "compmark/codec/container/inspect.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/read_file.hpp"
#include "compmark/io/sha256.hpp"
#include "support/cmk_file.hpp"
#include "support/codec_model.hpp"

namespace {

using namespace compmark;
using testing::decode;
using testing::decoded;
using testing::encoded;
using testing::make_correlated_model;
using testing::same;
using File = testing::CmkFile;

constexpr CoarseSteps nines{{2, 2, 2}};

CodecModel coarse_model_of(CodecModel model, const CoarseSteps& steps = nines) {
  model.first_level = steps;
  return model;
}
/// Of what one level has of a model: the same context, so that the two files hold the same symbols.
CodecModel with_level(const CodecEncoded& one_level, const CoarseSteps& steps) {
  return coarse_model_of(one_level.model, steps);
}
std::vector<CodecLevel> levels_of(const std::vector<std::byte>& bytes) {
  const auto container = parse_container(bytes, "");
  REQUIRE(container.ok());
  return codec_levels(*container);
}
CodecDecoded first_level(const std::vector<std::byte>& bytes) {
  const std::size_t there = levels_of(bytes)[0].end;
  const auto begun = decode(std::span<const std::byte>(bytes).first(there), {.partial = true});
  REQUIRE_MESSAGE(begun.ok(), (begun.ok() ? "" : begun.error().line()));
  return *begun;
}

TEST_CASE("hac_plus/coarse_coding: the whole file is that of one level to the last bit, its beginning a coarse model") {
  const testing::CodecModelShape shape{.anchors = 1500, .feature_dim = 12, .chunk_anchors = 512, .hidden = 12};
  const CodecEncoded one = encoded(make_correlated_model(1, shape));
  CHECK(levels_of(one.bytes).size() == 1);
  double before = 0;
  for (const CoarseSteps& steps : {CoarseSteps{{1, 1, 1}}, nines, CoarseSteps{{3, 3, 3}}, CoarseSteps{{2, 0, 1}}}) {
    const CodecEncoded file = encoded(with_level(one, steps));
    const CodecDecoded whole = decoded(file.bytes);
    CHECK(whole.verified);
    CHECK(whole.levels == 2);
    CHECK(whole.file_levels == 2);
    CHECK(same(whole.model, one.model));
    CHECK(whole.model.first_level == steps);
    CHECK(encoded(whole.model).bytes == file.bytes);
    CHECK(std::abs(static_cast<double>(file.report.total_bytes) - file.report.estimated_bytes()) < 3 * 32);
    CHECK(static_cast<double>(file.bytes.size()) < 1.06 * static_cast<double>(one.bytes.size()));

    const std::vector<CodecLevel> levels = levels_of(file.bytes);
    REQUIRE(levels.size() == 2);
    CHECK(levels[0].end < levels[1].end);
    const CodecDecoded coarse = first_level(file.bytes);
    CHECK(!coarse.verified);
    CHECK(coarse.levels == 1);
    CHECK(coarse.coarse_anchors == one.model.anchors());
    CHECK(coarse.model.mask == one.model.mask);
    // Each value lies in the coarse bin of the fine one; a step is at most twice Q0.
    double off = 0;
    const double most = (0.5 * steps.width(0) + 0.5) * 2 * one.model.base_step[0];
    for (std::size_t i = 0; i < one.model.feature.size(); ++i)
      off = std::max(off, static_cast<double>(std::abs(coarse.model.feature[i] - one.model.feature[i])));
    CHECK(off < most);
    CHECK(off > 0);
    CHECK(*std::min_element(coarse.model.scale.begin(), coarse.model.scale.end()) >= 0);
    if (steps.thirds[1] == 0) CHECK(same(coarse.model.scale, one.model.scale));
    if (steps.thirds[0] == steps.thirds[2]) {  // the coarser, the fewer bytes
      if (before > 0) CHECK(static_cast<double>(levels[0].end) < before);
      before = static_cast<double>(levels[0].end);
    }
  }
}

TEST_CASE("hac_plus/coarse_coding: chunks that have arrived are fine, and too short a beginning is refused") {
  const testing::CodecModelShape shape{.anchors = 300, .chunk_anchors = 64};
  const CodecEncoded one = encoded(make_correlated_model(4, shape));
  const CodecEncoded file = encoded(with_level(one, nines));
  const auto container = parse_container(file.bytes, "");
  REQUIRE(container.ok());
  const std::size_t first = levels_of(file.bytes)[0].end;
  const auto begun = [&](std::size_t there) {
    return decode(std::span<const std::byte>(file.bytes).first(there), {.partial = true});
  };
  CHECK(!begun(first - 1).ok());
  std::size_t fine = one.model.anchors();
  for (std::uint32_t chunk = 5; chunk-- > 0;) {
    const SectionEntry* entry = container->find(HacPlusFormat::stream, 0, chunk);
    if (entry == nullptr) continue;
    const auto with = begun(static_cast<std::size_t>(entry->offset + entry->size));
    const auto without = begun(static_cast<std::size_t>(entry->offset + entry->size) - 1);
    REQUIRE(with.ok());
    REQUIRE(without.ok());
    const std::size_t begin = 64 * chunk, of_chunk = std::min<std::size_t>(64, one.model.anchors() - begin);
    CHECK(with->coarse_anchors == one.model.anchors() - fine);
    CHECK(without->coarse_anchors == with->coarse_anchors + of_chunk);
    fine -= of_chunk;
    const auto d = static_cast<std::ptrdiff_t>(one.model.feature_dim) * static_cast<std::ptrdiff_t>(begin);
    CHECK(std::equal(one.model.feature.begin(), one.model.feature.begin() + d, without->model.feature.begin()));
    CHECK(with->verified == false);  // without DIGS
  }
  CHECK(fine == 0);
  CHECK(same(begun(file.bytes.size())->model, one.model));
  CHECK(begun(file.bytes.size())->verified);
}

TEST_CASE("hac_plus/coarse_coding: bytes and both levels are the same at any number of threads") {
  const CodecModel model = coarse_model_of(make_correlated_model(5, {.anchors = 700}));
  testing::check_any_threads(model);
  testing::check_round_trip(model);
  testing::check_round_trip(coarse_model_of(make_correlated_model(7, {.anchors = 0})));
  testing::check_round_trip(coarse_model_of(make_correlated_model(10, {.anchors = 1})));
  testing::check_round_trip(coarse_model_of(make_correlated_model(12, testing::full_codec_model(300)), {{3, 1, 2}}));
  CodecModel far = coarse_model_of(make_correlated_model(11), {{3, 3, 3}});
  std::size_t row = 0;
  while (far.mask[row] == 0) ++row;
  far.feature[row * 6] = 3e9f;
  far.feature[row * 6 + 1] = -3e9f;
  CHECK(encoded(far).report.clamped[0] == 2);
  testing::check_round_trip(far);
  const std::vector<std::byte> bytes = encoded(model).bytes;
  const CodecDecoded alone = first_level(bytes);
  ThreadExecutor executor(3);
  const auto others = decode_cmk(std::span<const std::byte>(bytes).first(levels_of(bytes)[0].end), "a.cmk",
                                 {.partial = true}, executor);
  REQUIRE(others.ok());
  CHECK(same(others->model, alone.model));
}

const std::vector<std::byte>& good_coarse() {
  static const testing::CodecModelShape tiny{
      150,  4, 2,
      40,   5, HashGridShape{.volume_levels = 1, .volume_cap_log2 = 5, .plane_levels = 1, .plane_cap_log2 = 6},
      false};
  static const std::vector<std::byte> bytes = encoded(coarse_model_of(make_correlated_model(21, tiny, 5))).bytes;
  return bytes;
}

TEST_CASE("hac_plus/coarse_coding: every flipped bit, every truncation and random payloads are found") {
  testing::check_flipped_bits(good_coarse(), 9, true);
  testing::check_truncations(good_coarse());
  testing::check_random_payloads(good_coarse(), 150);
  testing::check_digests(good_coarse());
}

TEST_CASE("hac_plus/coarse_coding: a beginning with a flipped bit is refused, or coarse where the bit is") {
  const std::size_t first = levels_of(good_coarse())[0].end;
  for (std::size_t i = 0; i < first; i += 7) {
    std::vector<std::byte> damaged(good_coarse().begin(),
                                   good_coarse().begin() + static_cast<std::ptrdiff_t>(first) + 5);
    damaged[i] ^= std::byte{8};
    REQUIRE(!decode(damaged, {.partial = true}).ok());
  }
}

TEST_CASE("hac_plus/coarse_coding: what is rescued of a file still has its coarse model, and is written with it") {
  const auto container = parse_container(good_coarse(), "");
  REQUIRE(container.ok());
  const SectionEntry* const entry = container->find(HacPlusFormat::stream, 0, 1);
  REQUIRE(entry != nullptr);
  std::vector<std::byte> bytes = good_coarse();
  bytes[static_cast<std::size_t>(entry->offset)] ^= std::byte{16};
  const auto rescued = decode(bytes, {.salvage = true});
  REQUIRE(rescued.ok());
  CHECK(rescued->lost_anchors > 0);
  CHECK(rescued->model.first_level == decode(good_coarse())->model.first_level);
  REQUIRE(rescued->model.first_level.has_value());
  CHECK(levels_of(encoded(rescued->model).bytes).size() == 2);
}

TEST_CASE("hac_plus/coarse_coding: steps that are none, and sections that are missing") {
  const auto step_error = [](std::vector<std::byte> bytes) {
    return testing::error_of_forged(good_coarse(), [&](File& file) { file.of(HacPlusFormat::step).bytes = bytes; });
  };
  CHECK(step_error({}).field == "STEP");
  CHECK(step_error({std::byte{0}, std::byte{0}, std::byte{0}}).field == "STEP");
  CHECK(step_error({std::byte{2}, std::byte{2}, std::byte{4}}).field == "STEP");
  CHECK(step_error({std::byte{2}, std::byte{2}}).field == "STEP");
  CHECK(step_error({std::byte{2}, std::byte{2}, std::byte{1}}).field != "STEP");  // well formed, of other symbols
  for (const std::uint32_t kind : HacPlusFormat::known_with_level) {
    CAPTURE(section_name(kind));
    (void)testing::error_of_forged(good_coarse(), [&](File& file) {
      for (std::size_t i = 0; i < file.sections.size(); ++i) {
        if (file.sections[i].entry.kind == kind) {
          file.sections.erase(file.sections.begin() + static_cast<std::ptrdiff_t>(i));
          return;
        }
      }
    });
  }
  SerialExecutor executor;
  const auto refused = encode_cmk(coarse_model_of(make_correlated_model(3), {{4, 1, 1}}), {}, executor);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "first_level");
  CHECK_FALSE(encode_cmk(coarse_model_of(make_correlated_model(3), {{0, 0, 0}}), {}, executor).ok());
}

std::string arrays_digest(const CodecModel& model) {
  Sha256 hash;
  hash.update(std::as_bytes(std::span(model.voxels))).update(std::as_bytes(std::span(model.mask)));
  hash.update(std::as_bytes(std::span(model.feature))).update(std::as_bytes(std::span(model.scale)));
  hash.update(std::as_bytes(std::span(model.offset)));
  return hash.hex();
}

// As container/golden.test.cpp: written once (COMPMARK_WRITE_GOLDEN=<folder>), read for ever.
TEST_CASE("hac_plus/coarse_coding: a file of the first day decodes to what it was, and so does its beginning") {
  const std::filesystem::path path = "tests/golden/codec/hac_plus_coarse.cmk";
  if (const char* write = std::getenv("COMPMARK_WRITE_GOLDEN"); write != nullptr) {
    const CodecEncoded made = encoded(coarse_model_of(make_correlated_model(108, {.anchors = 400}), {{2, 1, 2}}));
    REQUIRE(write_file(std::filesystem::path(write) / path.filename(), made.bytes).ok());
  }
  const auto bytes = read_file(path);
  REQUIRE(bytes.ok());
  const CodecDecoded read = decoded(*bytes);
  CHECK(read.verified);
  CHECK(arrays_digest(read.model) == "a03510a02233594762305b8d8b478668a67aef56f4e8672c25637c37bada5796");
  CHECK(arrays_digest(first_level(*bytes).model) == "29089524d8834d97a0c35351a5a5fa06d90f367c8d0c58a26a304303406351be");
  CHECK(encoded(read.model).bytes == *bytes);
}

}  // namespace
