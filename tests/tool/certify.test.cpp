// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark spread, verify --images --unmarked and certify, as an owner meets them with one model: a picture of unknown
// camera is proof, what is subtracted has to be claimed, and a record has all that somebody else needs, and no more.
#include <doctest/doctest.h>

#include <compmark/app/files.hpp>
#include <compmark/io/owner_key.hpp>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "tool/running.hpp"

namespace certify_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::Outcome;
using testing::text_of;
using testing::tool;

}  // namespace

TEST_CASE("tool: one picture read with the unmarked model is proof where the claim names it, and its record says all") {
  const testing::ScratchFolder folder("compmark-certify-test");
  const auto at = [&](const std::string& name) { return (folder.path / name).string(); };
  done("scene --out " + at("scene") + " --width 160 --height 128 --train 16 --test 3");
  done("train --voxel-size 0.1 --effects none --iterations 400 --data " + at("scene") + " --out " + at("run"));
  const std::string unmarked = at("run/model.safetensors");
  REQUIRE(write_key(at("owner.key"), testing::fixed_key(3, 48)).ok());
  const Outcome spread =
      done("spread --psnr 36 --model " + unmarked + " --key " + at("owner.key") + " --out " + at("marked.safetensors"));
  CHECK(spread.text.find("next: compmark claim --key " + at("owner.key") + " --unmarked " + unmarked + " --out " +
                         unmarked + ".claim\n") != std::string::npos);
  CHECK(spread.text.find("then: compmark verify --images PICTURES --key " + at("owner.key") + " --unmarked " +
                         unmarked + " --claim " + unmarked + ".claim\n") != std::string::npos);
  done("render --model " + at("marked.safetensors") + " --out " + at("renders"));
  done("render --model " + unmarked + " --out " + at("plain"));
  const std::string picture = (*fs::directory_iterator(at("renders"))).path().string();
  const std::string words = " --key " + at("owner.key") + " --images " + picture + " --unmarked " + unmarked;

  // The message is not there, the spread mark is; the text speaks of each by itself.
  const Outcome alone = tool("verify" + words + " --json " + at("alone.json"));
  INFO(alone.text);
  CHECK(alone.code == 3);
  CHECK(alone.text.find("NOT A PROOF: the mark is read, but what is subtracted could have been made") !=
        std::string::npos);
  const nlohmann::json said = json_of(at("alone.json"));
  CHECK(said["verdict"] == "detected");
  CHECK(said["informed"]["message"]["verdict"] != "detected");
  CHECK(said["p_corrected"].get<double>() == 2 * said["informed"]["spread"]["p_value"].get<double>());
  CHECK(alone.text.find("together    ") != std::string::npos);

  const std::string claim = testing::claimed(at("owner.key"), {}, " --unmarked " + unmarked);
  // What is printed beside a claim of the unmarked model marks that, and reads with it.
  fs::remove(at("owner.key.claim"));
  const Outcome said_next =
      done("claim --key " + at("owner.key") + " --unmarked " + unmarked + " --out " + at("owner.key.claim"));
  CHECK(said_next.text.find("next: unless it is marked already, compmark embed --model " + unmarked +
                            " --data SCENE --out RUN --key ") != std::string::npos);
  CHECK(said_next.text.find(" --unmarked " + unmarked + " --claim " + at("owner.key.claim")) != std::string::npos);
  const Outcome proof = tool("verify" + words + claim);
  INFO(proof.text);
  CHECK(proof.code == 0);
  CHECK(proof.text.find("DETECTED, conditionally") != std::string::npos);
  // Unmarked pictures are none, whatever is claimed.
  const Outcome none =
      tool("verify --key " + at("owner.key") + " --images " + at("plain") + " --unmarked " + unmarked + claim);
  CHECK((none.code == 1 || none.code == 3));
  CHECK(none.text.find("\nDETECTED") == std::string::npos);
  CHECK(none.text.find("NOT A PROOF") == std::string::npos);

  const Outcome made = tool("certify" + words + claim + " --out " + at("record"));
  INFO(made.text);
  CHECK(made.code == 0);
  const nlohmann::json record = json_of(at("record/record.json"));
  CHECK(record["verdict"] == "detected");
  CHECK(record["proof"]["standing"] == "conditional");
  // The line runs as it is, once the files are there which the record does not have: the reader has the decoder.
  const std::string repeat = record["repeat"].get<std::string>();
  CHECK(repeat.rfind("compmark verify --key owner.key --images images --unmarked model.safetensors", 0) == 0);
  CHECK(record["repeat_needs"] == nlohmann::json{"owner.key", "model.safetensors"});
  CHECK(record["limits"].count("claim") == 0);
  CHECK(record["limits"]["when"].get<std::string>().find("Nothing here dates the claim") == 0);
  const std::string page = text_of(at("record/record.html"));
  CHECK(page.find("owner.key, model.safetensors") != std::string::npos);
  CHECK(page.find("Record of a verification") != std::string::npos);
  CHECK(page.find("the unmarked model at the camera that was found") != std::string::npos);
  CHECK(testing::times_in(page, "data:image/png;base64,") == 3);  // the picture, the render, their difference
  CHECK_FALSE(fs::exists(at("record/soft_binding.cbor")));        // nobody hid a message: its bits are chance
  // Everything that is there is listed with its SHA-256, and is what was given.
  const std::string sums = text_of(at("record/SHA256SUMS"));
  std::size_t files = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(at("record"))) {
    if (!entry.is_regular_file() || entry.path().filename() == "SHA256SUMS") continue;
    ++files;
    const std::string line =
        *file_sha256(entry.path()) + "  " + fs::relative(entry.path(), at("record")).string() + "\n";
    CAPTURE(line);
    CHECK(sums.find(line) != std::string::npos);
  }
  CHECK(files == 4);  // page, report, picture, claim
  CHECK(*file_sha256(fs::path(at("record/images")) / ("0001_" + fs::path(picture).filename().string())) ==
        *file_sha256(picture));
  {
    const fs::path there = folder.path / "their copy";
    fs::copy(at("record"), there, fs::copy_options::recursive);
    for (const std::string& file : {at("owner.key"), unmarked}) fs::copy(file, there / fs::path(file).filename());
    const std::string words_of_it = repeat.substr(std::string("compmark ").size());
    const Outcome repeated =
        testing::run_tool(fs::absolute(COMPMARK_TOOL).string(), words_of_it, "cd '" + there.string() + "' && ");
    INFO(repeated.text);
    CHECK(repeated.code == 0);
    CHECK(repeated.text.find("DETECTED, conditionally") != std::string::npos);
  }
  // Nothing secret of the key.
  const std::string secret = json_of(at("owner.key"))["secret"];
  CHECK(page.find(secret.substr(0, 16)) == std::string::npos);
  CHECK(record.dump().find(secret.substr(0, 16)) == std::string::npos);

  // A record is never replaced.
  check_refused(tool("certify" + words + claim + " --out " + at("record")), {"record", "--out", "not empty"});
  CHECK(text_of(at("record/SHA256SUMS")) == sums);
  const Outcome blind = tool("certify --key " + at("owner.key") + " --images " + at("plain") + " --out " + at("blind"));
  CHECK((blind.code == 1 || blind.code == 3));
  CHECK(json_of(at("blind/record.json"))["limits"].count("claim") == 1);
  CHECK(std::distance(fs::directory_iterator(at("blind/images")), fs::directory_iterator()) == 3);
  CHECK_FALSE(fs::exists(at("blind/soft_binding.cbor")));
  CHECK_FALSE(fs::exists(at("blind/owner.claim")));
}

}  // namespace certify_test
