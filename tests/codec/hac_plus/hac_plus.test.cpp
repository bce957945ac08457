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
using testing::decoded;
using testing::encoded;
using testing::make_codec_model;
using testing::make_correlated_model;
using testing::same;

const testing::CodecModelShape larger{.anchors = 1500, .feature_dim = 12, .chunk_anchors = 512, .hidden = 12};

CodecModel without_intra(CodecModel model) {
  model.intra.reset();
  return model;
}

TEST_CASE("hac_plus/hac_plus: the decoded model is that of a HAC file, to the last bit, in fewer bytes") {
  const CodecModel model = make_correlated_model(1, larger);
  const CodecEncoded plus = encoded(model), hac = encoded(without_intra(model));
  CHECK(plus.report.profile == ContainerProfile::hac_plus);
  CHECK(same(decoded(plus.bytes).model, decoded(hac.bytes).model));
  CHECK(decoded(plus.bytes).model.intra == plus.model.intra);
  // The number that moves twelve features has 11 of their 12 deviations in common.
  CHECK(plus.report.ideal_bits[0] < 0.85 * hac.report.ideal_bits[0]);
  CHECK(plus.bytes.size() < 0.95 * static_cast<double>(hac.bytes.size()));
  CHECK(plus.report.bytes_of(HacPlusFormat::intra) > 50);
  // A chunk has 25 bytes of its own, and there are three.
  CHECK(std::abs(static_cast<double>(plus.report.total_bytes) - plus.report.estimated_bytes()) < 3 * 26);
  MESSAGE("hac ", hac.bytes.size(), " bytes, hac_plus ", plus.bytes.size(), ", INTR ",
          plus.report.bytes_of(HacPlusFormat::intra));
}

TEST_CASE("hac_plus/hac_plus: a context that would cost more than it saves is left out, and costs a section") {
  CodecModel model = make_codec_model(2);
  const CodecEncoded hac = encoded(model);
  model.intra.emplace();
  const CodecEncoded plus = encoded(model);
  CHECK(plus.model.intra == IntraContext::none(model.heads().channels()));
  CHECK(plus.report.bytes_of(HacPlusFormat::intra) == 1);
  CHECK(plus.report.bytes_of(HacPlusFormat::stream) == hac.report.bytes_of(HacFormat::stream));
  CHECK(plus.bytes.size() <= hac.bytes.size() + 1 + 8 + ContainerFormat::entry_size);
  CHECK(same(decoded(plus.bytes).model, decoded(hac.bytes).model));
}

TEST_CASE("hac_plus/hac_plus: encoding what was decoded gives the same bytes") {
  for (const std::uint64_t seed : {2u, 3u})
    testing::check_round_trip(make_correlated_model(seed, {.anchors = 150 * seed}));
  testing::check_round_trip(make_correlated_model(4, larger));
}

TEST_CASE("hac_plus/hac_plus: bytes and model are the same at any number of threads") {
  testing::check_any_threads(make_correlated_model(5, {.anchors = 700}));
}

TEST_CASE("hac_plus/hac_plus: no anchors, one anchor, a value far out, published sizes") {
  CHECK(decoded(encoded(make_correlated_model(7, {.anchors = 0})).bytes).model.anchors() == 0);
  const CodecModel one = make_correlated_model(10, {.anchors = 1});
  CHECK(same(decoded(encoded(one).bytes).model, encoded(one).model));
  CodecModel model = make_correlated_model(11);
  std::size_t row = 0;
  while (model.mask[row] == 0) ++row;
  model.feature[row * 6] = 3e9f;
  const CodecEncoded held = encoded(model);
  CHECK(held.report.clamped[0] == 1);
  CHECK(same(decoded(held.bytes).model, held.model));
  testing::check_round_trip(make_correlated_model(12, testing::full_codec_model(300)));
}

TEST_CASE("hac_plus/hac_plus: a model that was trained for another codec is refused") {
  CodecModel model = make_correlated_model(13);
  model.trained.reset();
  SerialExecutor executor;
  const auto refused = encode_cmk(model, {}, executor);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "context");
  model = make_correlated_model(13);
  model.intra = IntraContext::none(7);
  const auto other = encode_cmk(model, {}, executor);
  REQUIRE_FALSE(other.ok());
  CHECK(other.error().problem.find("other attributes") != std::string::npos);
}

std::string digest(const CodecModel& model) {
  Sha256 hash;
  hash.update(std::as_bytes(std::span(model.voxels))).update(std::as_bytes(std::span(model.mask)));
  hash.update(std::as_bytes(std::span(model.feature))).update(std::as_bytes(std::span(model.scale)));
  hash.update(std::as_bytes(std::span(model.offset)));
  return hash.hex();
}

// As container/golden.test.cpp: written once (COMPMARK_WRITE_GOLDEN=<folder>), read for ever.
TEST_CASE("hac_plus/hac_plus: a file of the first day decodes to what it was, and encodes to itself") {
  const std::filesystem::path path = "tests/golden/codec/hac_plus_small.cmk";
  if (const char* write = std::getenv("COMPMARK_WRITE_GOLDEN"); write != nullptr) {
    const CodecEncoded made = encoded(make_correlated_model(107, {.anchors = 400}));
    REQUIRE(write_file(std::filesystem::path(write) / path.filename(), made.bytes).ok());
  }
  const auto bytes = read_file(path);
  REQUIRE(bytes.ok());
  const CodecDecoded read = decoded(*bytes);
  CHECK(read.verified);
  CHECK(read.model.intra != IntraContext::none(read.model.heads().channels()));
  CHECK(digest(read.model) == "c5b5a8954a32b3d2cc3a399c1bbaa4695bbf3e7965a8b06990b785e385fdd237");
  CHECK(encoded(read.model).bytes == *bytes);
  const auto info = inspect_cmk(*bytes, "a.cmk");
  REQUIRE(info.ok());
  CHECK(std::string(codec_name(info->header.profile)) == "hac_plus");
}

}  // namespace
