// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Files of the first release, which decode for ever, to the same bits with every compiler, flag and number of threads
// (tests/golden/codec). The digests here are taken of the decoded arrays by this file's own hand, not by the codec. To
// write files for a new format version, run with COMPMARK_WRITE_GOLDEN=<folder>: the old ones stay.
#include <doctest/doctest.h>

#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "compmark/codec/container/cmk.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/sha256.hpp"
#include "support/codec_model.hpp"
#include "support/context_gs_model.hpp"

namespace {

using namespace compmark;

struct Golden {
  const char* name;
  std::uint64_t seed;
  testing::CodecModelShape shape;
  std::size_t anchors;
  const char* sha256;
  bool context_gs = false;
};

std::vector<Golden> golden_files() {
  testing::CodecModelShape small, published = testing::full_codec_model(120), wide, attributes = published, levels;
  attributes.anchors = 400;
  attributes.chunk_anchors = 64;
  attributes.hidden = 40;
  levels.anchors = 900;
  levels.feature_dim = 3;
  levels.offset_count = 32;
  levels.networks = false;
  published.chunk_anchors = 64;
  wide.feature_dim = 1;
  wide.offset_count = 32;
  wide.grid.volume_levels = 0;
  wide.networks = false;
  return {{"hac_small.cmk", 101, small, 243, "37a7748f87da924791a1dd6801b2cf100e193f4e5689a62a17d34d8b27faa022"},
          {"hac_published_sizes.cmk", 102, published, 119,
           "27436a6668ba8cb491acabd23bff619db8bcba7109e2a17c393faaae66bddb3d"},
          {"hac_32_offsets.cmk", 103, wide, 300, "663c63a2613a82b67d26fcd3f50bb1159f9bee0fc06b2f8445984cb751f92f61"},
          {"context_gs_small.cmk", 104, small, 249, "820da9000c94cf0115f32167588ce92789df7e9680fc7e5ebe8abb2880d92e94",
           true},
          {"context_gs_published_attributes.cmk", 105, attributes, 391,
           "49ccd62f8f2bbeb6776c99be88b111640922b9b67addb140ea2ebbd03d900c5e", true},
          {"context_gs_levels.cmk", 106, levels, 900,
           "41fa22f29fef9402756e3c841ea560d022869d201b9410e6046534cedeb827f1", true}};
}

std::string digest(const CodecModel& model) {
  Sha256 hash;
  hash.update(std::as_bytes(std::span(model.voxels))).update(std::as_bytes(std::span(model.mask)));
  hash.update(std::as_bytes(std::span(model.feature))).update(std::as_bytes(std::span(model.scale)));
  hash.update(std::as_bytes(std::span(model.offset)));
  hash.update(std::as_bytes(std::span(model.hyperprior)));
  for (const CodecTensor& tensor : model.networks) {
    hash.update(std::as_bytes(std::span(tensor.name.data(), tensor.name.size())));
    hash.update(std::as_bytes(std::span(tensor.values)));
  }
  return hash.hex();
}

TEST_CASE(
    "container/golden: files of the first release decode to what they were, at any number of threads, and encode to "
    "themselves") {
  const std::filesystem::path folder = "tests/golden/codec";
  for (const Golden& golden : golden_files()) {
    const std::string name = golden.name;
    CAPTURE(name);
    if (const char* write = std::getenv("COMPMARK_WRITE_GOLDEN"); write != nullptr) {
      SerialExecutor executor;
      const auto written = write_cmk(std::filesystem::path(write) / golden.name,
                                     golden.context_gs ? testing::make_context_gs_model(golden.seed, golden.shape)
                                                       : testing::make_codec_model(golden.seed, golden.shape),
                                     {}, executor);
      REQUIRE(written.ok());
      MESSAGE(std::string(golden.name), ": ", written->bytes.size(), " bytes, ", written->model.anchors(), " anchors, ",
              digest(written->model));
      continue;
    }
    const auto bytes = read_file(folder / golden.name);
    REQUIRE_MESSAGE(bytes.ok(), "run from the project's root");
    CHECK(bytes->size() < 50'000);
    for (const std::size_t threads : {1u, 2u, 8u}) {
      ThreadExecutor executor(threads);
      const auto decoded = decode_cmk(*bytes, golden.name, {}, executor);
      REQUIRE_MESSAGE(decoded.ok(), (decoded.ok() ? "" : decoded.error().line()));
      CHECK(decoded->verified);
      CHECK((decoded->model.profile() == ContainerProfile::context_gs) == golden.context_gs);
      CHECK(decoded->model.anchors() == golden.anchors);
      CHECK(digest(decoded->model) == golden.sha256);
      const auto again = encode_cmk(decoded->model, {}, executor);
      REQUIRE(again.ok());
      CHECK(again->bytes == *bytes);
    }
  }
}

}  // namespace
