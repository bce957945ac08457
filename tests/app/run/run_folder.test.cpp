// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/files.hpp>
#include <compmark/app/run/run_folder.hpp>
#include <filesystem>
#include <string>

#include "support/scene_files.hpp"
#include "support/tool.hpp"

TEST_CASE("app/run/run_folder: one run in a folder, and what is finished is replaced only on request") {
  using namespace compmark;
  const testing::ScratchFolder folder("compmark-run-folder");
  const std::filesystem::path run = folder.path / "a/b";
  {
    const auto held = hold_folder(run);
    REQUIRE(held.ok());
    CHECK(std::filesystem::is_directory(run));
    CHECK_FALSE(hold_folder(run).ok());
    CHECK(hold_folder(folder.path / "a/c").ok());
  }
  CHECK(hold_folder(run).ok());
  CHECK(check_unfinished(run, false).ok());
  testing::put(run / "results.json", "{}");
  CHECK_FALSE(check_unfinished(run, false).ok());
  CHECK(check_unfinished(run, true).ok());
  testing::put(folder.path / "file", "");
  CHECK_FALSE(make_folder(folder.path / "file").ok());

  const std::filesystem::path decoder = run / "decoder.safetensors";
  std::string said;
  const auto note = [&](const std::string& sentence) { said = sentence; };
  CHECK(check_no_decoder(decoder, false).ok());
  REQUIRE(move_decoder_aside(decoder, note).ok());
  CHECK(said.empty());
  testing::put(decoder, "numbers");
  const std::string digest = *file_sha256(decoder);
  CHECK_FALSE(check_no_decoder(decoder, false).ok());
  REQUIRE(move_decoder_aside(decoder, note).ok());
  CHECK_FALSE(std::filesystem::exists(decoder));
  CHECK(*file_sha256(decoder.string() + "." + digest.substr(0, 16) + ".old") == digest);
  CHECK(said.find(".old") != std::string::npos);
}
