// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/compress.hpp>
#include <compmark/codec/container/cmk.hpp>
#include <compmark/codec/model/coded_model.hpp>
#include <compmark/io/atomic_file.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "small_models.hpp"
#include "support/tool.hpp"

namespace {

using namespace compmark;
namespace fs = std::filesystem;

template <class R>
void check_both_ways(const std::string& recipe) {
  CAPTURE(recipe);
  const testing::ScratchFolder folder("compmark-app-compress");
  ThreadExecutor executor(2);
  const fs::path trained = folder.path / "model.safetensors", file = folder.path / "model.cmk",
                 back = folder.path / "back.safetensors";
  const auto made = testing::small_model<R>();
  const ModelInfo info = testing::small_info(recipe);
  REQUIRE(write_model(trained, made, info).ok());
  const Result<CodecReport> report = compress_file(trained, file, CodedModelSettings{}, executor);
  if (!report) FAIL(report.error().line());
  CHECK(report->total_bytes == fs::file_size(file));
  CHECK(report->anchors == testing::small_anchors);

  // The same bytes as the codec of the model's own type makes, with one thread.
  ThreadExecutor one(1);
  const Result<CodecModel> coded = coded_model(made, info);
  REQUIRE(coded.ok());
  const Result<CodecEncoded> typed = encode_cmk(*coded, CodecEncodeSettings{}, one);
  REQUIRE(typed.ok());
  CHECK(*read_file(file) == typed->bytes);
  CHECK(encode_model(*coded, executor)->bytes == typed->bytes);

  const Result<Decompressed> decoded = decompress_file(file, back, CodecDecodeSettings{}, executor);
  REQUIRE(decoded.ok());
  CHECK(decoded->anchors == testing::small_anchors);
  CHECK(decoded->decoded.verified);
  Result<AnyModel> a = AnyModel::open(file, executor), b = AnyModel::open(back, executor);
  REQUIRE((a.ok() && b.ok()));
  const auto camera = testing::ring_camera(0, 3, 40, 32);
  const Result<RenderedView> first = a->render(camera, executor), second = b->render(camera, executor);
  REQUIRE((first.ok() && second.ok()));
  CHECK(std::vector<float>(first->image.data, first->image.data + first->image.size()) ==
        std::vector<float>(second->image.data, second->image.data + second->image.size()));
}

}  // namespace

TEST_CASE(
    "app/compress: a model of either codec becomes the file of its type's encoder, and comes back rendering the same") {
  check_both_ways<recipes::HacFitted>("hac+fitted");
  check_both_ways<recipes::ContextGsFitted>("context_gs+fitted");
}

TEST_CASE("app/compress: what cannot be compressed is refused by its file, and nothing is written") {
  const testing::ScratchFolder folder("compmark-app-uncompressed");
  ThreadExecutor executor(1);
  const fs::path plain = folder.path / "model.safetensors", file = folder.path / "model.cmk", out = folder.path / "out";
  REQUIRE(write_model(plain, testing::small_model<recipes::Scaffold>(), testing::small_info("scaffold")).ok());
  const Result<CodecReport> without = compress_file(plain, out, CodedModelSettings{}, executor);
  REQUIRE_FALSE(without.ok());
  CHECK(without.error().file == plain.string());
  REQUIRE(write_model(plain, testing::small_model<recipes::HacFitted>(), testing::small_info("hac+fitted")).ok());
  REQUIRE(compress_file(plain, file, CodedModelSettings{}, executor).ok());  // control
  CHECK(compress_file(file, out, CodedModelSettings{}, executor).error().problem == "is compressed already");
  // What came out of a file has no context any more.
  const fs::path back = folder.path / "back.safetensors";
  REQUIRE(decompress_file(file, back, CodecDecodeSettings{}, executor).ok());
  CHECK(compress_file(back, out, CodedModelSettings{}, executor).error().problem.find("decompressed") !=
        std::string::npos);
  const Result<Decompressed> foreign = decompress_file(plain, out, CodecDecodeSettings{}, executor);
  REQUIRE_FALSE(foreign.ok());
  CHECK(foreign.error().line().find(plain.string()) != std::string::npos);
  CHECK_FALSE(fs::exists(out));
}
