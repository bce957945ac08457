// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/app/model_source.hpp>
#include <compmark/codec/container/cmk.hpp>
#include <compmark/codec/model/coded_model.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/read_file.hpp>
#include <compmark/io/sha256.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "io/splat_writers.hpp"
#include "small_models.hpp"
#include "support/damage.hpp"
#include "support/tool.hpp"

namespace {

using namespace compmark;
namespace fs = std::filesystem;

}  // namespace

TEST_CASE("app/model_source: both kinds of file are opened, and loaded as what they were written from") {
  const testing::ScratchFolder folder("compmark-app-source");
  ThreadExecutor executor(1);
  const fs::path path = folder.path / "model.safetensors", file = folder.path / "model.cmk";
  const auto made = testing::small_model<recipes::HacFitted>();
  const ModelInfo info = testing::small_info("hac+fitted+mask");
  REQUIRE(write_model(path, made, info).ok());
  const Result<CodecModel> coded = coded_model(made, info);
  REQUIRE(coded.ok());
  REQUIRE(write_cmk(file, *coded, CodecEncodeSettings{}, executor).ok());
  CHECK_FALSE(is_coded_file(path));
  CHECK(is_coded_file(file));

  const Result<ModelSource> trained = ModelSource::open(path, executor), compressed = ModelSource::open(file, executor);
  REQUIRE(trained.ok());
  REQUIRE(compressed.ok());
  CHECK(trained->recipe == "hac+fitted+mask");
  CHECK(compressed->recipe == "hac+fitted+mask");
  CHECK_FALSE(trained->coded.has_value());
  REQUIRE(compressed->coded.has_value());
  const Result<LoadedModel<recipes::HacFitted>> loaded = trained->load<recipes::HacFitted>();
  REQUIRE(loaded.ok());
  CHECK(std::equal(made.arena.all_values().begin(), made.arena.all_values().end(),
                   loaded->model.arena.all_values().begin(), loaded->model.arena.all_values().end()));
  REQUIRE(compressed->load<recipes::HacFitted>().ok());

  // As another recipe's: refused with the file's name.
  const auto wider = compressed->load<recipes::HacScaffold>();
  REQUIRE_FALSE(wider.ok());
  CHECK(wider.error().file == file.string());
  CHECK(wider.error().field == "META.shape");
  const auto plain = compressed->load<recipes::Scaffold>();
  REQUIRE_FALSE(plain.ok());
  CHECK(plain.error().file == file.string());
}

TEST_CASE("app/model_source: the digest is that of the bytes that were read, of every kind of file") {
  const testing::ScratchFolder folder("compmark-app-source-digest");
  ThreadExecutor executor(1);
  const fs::path path = folder.path / "model.safetensors", file = folder.path / "model.cmk",
                 splats = folder.path / "scene.ply";
  const auto made = testing::small_model<recipes::HacFitted>();
  const ModelInfo info = testing::small_info("hac+fitted");
  REQUIRE(write_model(path, made, info).ok());
  REQUIRE(write_cmk(file, *coded_model(made, info), CodecEncodeSettings{}, executor).ok());
  testing::put_raw(splats, testing::splats::permuted_ply_bytes(testing::splats::random_splats(40, 1), 1));
  std::string last;
  for (const fs::path& of : {path, file, splats}) {
    CAPTURE(of);
    std::string digest;
    REQUIRE(ModelSource::open(of, executor, &digest).ok());
    const Result<std::vector<std::byte>> bytes = read_file(of);
    REQUIRE(bytes.ok());
    CHECK(digest == Sha256{}.update(*bytes).hex());
    CHECK(digest != last);
    last = digest;
  }
  std::string untouched = "none";
  CHECK_FALSE(ModelSource::open(folder.path / "missing.cmk", executor, &untouched).ok());
  CHECK(untouched == "none");
}

TEST_CASE("app/model_source: a damaged .cmk is refused, not taken for another kind of file") {
  const testing::ScratchFolder folder("compmark-app-damage");
  ThreadExecutor executor(1);
  const fs::path file = folder.path / "model.cmk";
  const auto made = testing::small_model<recipes::HacFitted>();
  const Result<CodecModel> coded = coded_model(made, testing::small_info("hac+fitted"));
  REQUIRE(coded.ok());
  const Result<CodecEncoded> encoded = encode_cmk(*coded, CodecEncodeSettings{}, executor);
  REQUIRE(encoded.ok());
  REQUIRE(write_file(file, encoded->bytes).ok());
  REQUIRE(ModelSource::open(file, executor).ok());  // control
  std::vector<std::byte> bytes = encoded->bytes;
  bytes[bytes.size() / 2] ^= std::byte{1};
  REQUIRE(write_file(file, bytes).ok());
  CHECK(is_coded_file(file));
  const Result<ModelSource> damaged = ModelSource::open(file, executor);
  REQUIRE_FALSE(damaged.ok());
  CHECK(damaged.error().kind == ErrorKind::malformed);
  CHECK_FALSE(is_coded_file(folder.path));
  CHECK_FALSE(is_coded_file(folder.path / "nothing"));
}
