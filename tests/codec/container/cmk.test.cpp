// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/container/cmk.hpp"

#include <doctest/doctest.h>

#include <filesystem>

#include "compmark/codec/container/inspect.hpp"
#include "support/cmk_file.hpp"
#include "support/codec_model.hpp"
#include "support/context_gs_model.hpp"

namespace {

using namespace compmark;

TEST_CASE("container/cmk: the codec is that of the model, and that of the file; on disk, replaced whole") {
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "compmark_cmk_test.cmk";
  SerialExecutor executor;
  const CodecModel gs = testing::make_context_gs_model(13), hac = testing::make_codec_model(13);
  for (const CodecModel* model : {&gs, &hac}) {
    const auto written = write_cmk(path, *model, {}, executor);
    REQUIRE(written.ok());
    CHECK(written->report.profile == model->profile());
    CHECK(std::filesystem::file_size(path) == written->bytes.size());
    const auto back = read_cmk(path, {}, executor);
    REQUIRE(back.ok());
    CHECK(testing::same(back->model, written->model));
    CHECK(back->model.profile() == model->profile());
    const auto info = inspect_cmk(written->bytes, "a.cmk");
    REQUIRE(info.ok());
    CHECK(info->header.profile == model->profile());
    CHECK(info->anchors == written->report.anchors);
    CHECK(info->damaged.empty());
    // What cannot be coded leaves the file as it was.
    CHECK(!write_cmk(path, CodecModel{}, {}, executor).ok());
    CHECK(std::filesystem::file_size(path) == written->bytes.size());
  }
  std::filesystem::remove(path);
  CHECK(read_cmk(path, {}, executor).error().kind == ErrorKind::not_found);
}

TEST_CASE("container/cmk: a decoder of one codec names the other where it gets its file") {
  SerialExecutor executor;
  const auto hac = testing::encoded(testing::make_codec_model(14, {.anchors = 40}));
  const auto gs = testing::encoded(testing::make_context_gs_model(14, {.anchors = 40}));
  const auto one = decode_context_gs(hac.bytes, "a.cmk", {}, executor);
  REQUIRE(!one.ok());
  CHECK(one.error().problem.find("ContextGS") != std::string::npos);
  const auto other = decode_hac(gs.bytes, "a.cmk", {}, executor);
  REQUIRE(!other.ok());
  CHECK(other.error().problem.find("HAC") != std::string::npos);
}

}  // namespace
