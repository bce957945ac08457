// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Splats of other programs, by the tool: marked without photographs, adopted, and looked at the right way up. Whether a
// mark is read is the business of longer runs (docs/foreign_splats.md, tests/app/run/embed.test.cpp).
#include <doctest/doctest.h>

#include <compmark/app/files.hpp>
#include <compmark/io/owner_claim.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/splat/read_splat.hpp>
#include <filesystem>
#include <string>

#include "io/splat_writers.hpp"
#include "support/damage.hpp"
#include "tool/running.hpp"

namespace splats_test {

using namespace compmark;
using testing::done;
using testing::Outcome;
using testing::tool;

struct Splats {
  testing::ScratchFolder folder;
  std::filesystem::path ply = folder.path / "scene.ply";
  std::string key = (folder.path / "owner.key").string();

  explicit Splats(const std::string& name) : folder(name) {
    testing::put_raw(ply, testing::splats::permuted_ply_bytes(testing::splats::random_splats(400, 1), 1));
    REQUIRE(write_key(key, testing::fixed_key(1, 48)).ok());
  }
  [[nodiscard]] std::string at(const std::string& name) const { return (folder.path / name).string(); }
};

TEST_CASE("splats: a file of another program is marked without photographs, and its like comes out") {
  const Splats splats("compmark-splats-test");
  const std::string embed = "embed --model " + splats.ply.string() + " --key " + splats.key + " --downscale 6 ";
  const Outcome marked = done(embed + "--iterations 20 --up z --out " + splats.at("run"));
  CHECK(marked.text.find("dB between the renders") != std::string::npos);
  CHECK(marked.text.find("dB lost") == std::string::npos);  // to photographs, and there are none
  CHECK(marked.text.find("next: compmark export --model " + splats.at("run/marked.ply") + " --out ") !=
        std::string::npos);
  // An owner whose mark is not read is told what to do about it, not how a judge would find.
  CHECK(marked.text.find("NOT DETECTED") == std::string::npos);
  CHECK((marked.text.find("DETECTED: these images") == std::string::npos) ==
        (marked.text.find("the mark cannot be read yet: more --mark-iterations") != std::string::npos));
  const nlohmann::json results = testing::json_of(splats.at("run/results.json"));
  CHECK(results["dataset"] == "scene.ply");
  CHECK(results["recipe"] == "explicit");
  CHECK(results["psnr_cost_vs_unmarked"].is_null());
  CHECK(results["psnr_marked_vs_unmarked"].get<double>() > 30);
  const Result<SplatFile> written = read_splat(splats.at("run/marked.ply"));
  REQUIRE_MESSAGE(written.ok(), written.error().line());
  CHECK(written->table.count == 400);
  CHECK(written->up == std::array<double, 3>{0, 0, 1});
  // What was written is read like any other file, the right way up.
  CHECK(done("info " + splats.at("run/marked.ply")).text.find("400") != std::string::npos);
  const Outcome page = done("export --model " + splats.at("run/marked.ply") + " --out " + splats.at("page.html"));
  CHECK(page.text.find("a page of 400 Gaussians") != std::string::npos);
  CHECK(testing::text_of(splats.at("page.html")).rfind("<!doctype html>", 0) == 0);
  const int read = tool("verify --model " + splats.at("run/marked.ply") + " --key " + splats.key).code;
  CHECK((read == 0 || read == 1 || read == 3));
  CHECK(done(embed + "--iterations 20 --up z --resume --out " + splats.at("run")).text.find("nothing is left to do") !=
        std::string::npos);

  testing::check_refused(tool(embed + "--iterations 20 --up sideways --out " + splats.at("no")), {"--up"});
  testing::check_refused(tool("embed --model " + splats.at("run/model.safetensors") + " --key " + splats.key +
                              " --iterations 20 --out " + splats.at("no")),
                         {"--data"});
  testing::check_refused(tool(embed + "--iterations 20 --fidelity 0 --out " + splats.at("no")), {"explicit"});
  testing::check_refused(tool(embed + "--iterations 20 --spread 50 --out " + splats.at("no")),
                         {"--spread",
                          "with compmark spread --out OUT, and then the message, with compmark embed --model "
                          "OUT --data " +
                              splats.ply.string()});
  CHECK_FALSE(std::filesystem::exists(splats.at("no")));
}

TEST_CASE("splats: a mark that single pictures prove is hidden in a splat file too") {
  const Splats splats("compmark-splats-spread-test");
  const Outcome spread = done("spread --model " + splats.ply.string() + " --key " + splats.key + " --out " +
                              splats.at("marked.safetensors"));
  CHECK(spread.text.find("dB between renders") != std::string::npos);
  // The next step that is printed: a claim that names the splat file.
  const std::string claim = splats.at("spread.claim");
  done("claim --key " + splats.key + " --unmarked " + splats.ply.string() + " --out " + claim);
  CHECK(read_claim(claim)->unmarked == *file_sha256(splats.ply));
  // A name that says splats would be given to a model.
  for (const char* name : {"wrong.ply", "wrong.SPZ", "wrong.html", "wrong.cmk"}) {
    testing::check_refused(
        tool("spread --model " + splats.ply.string() + " --key " + splats.key + " --out " + splats.at(name)),
        {name, "--out: ends in .", "but this command writes a model; end it in .safetensors, and export it"});
    CHECK_FALSE(std::filesystem::exists(splats.at(name)));
  }
  done("export --model " + splats.at("marked.safetensors") + " --out " + splats.at("marked.ply") + " --compare 0");
  const Result<SplatFile> written = read_splat(splats.at("marked.ply"));
  REQUIRE(written.ok());
  CHECK(written->table.count == 400);
}

TEST_CASE("splats: a model of ours is trained from the renders of a splat file") {
  const Splats splats("compmark-splats-adopt-test");
  const Outcome adopted =
      done("adopt --splat " + splats.ply.string() + " --downscale 16 --iterations 30 --out " + splats.at("run"));
  CHECK(adopted.text.find("test PSNR") != std::string::npos);
  const nlohmann::json results = testing::json_of(splats.at("run/results.json"));
  CHECK(results["test"]["views"] == 16);
  CHECK(results["recipe"] == "scaffold");
  // Which way is up was guessed: it is not written down as if somebody had said it.
  done("export --model " + splats.at("run/model.safetensors") + " --out " + splats.at("adopted.ply") + " --compare 0");
  CHECK_FALSE(read_splat(splats.at("adopted.ply"))->up.has_value());
  // It is evaluated against the same splats, from the same cameras.
  done("evaluate --model " + splats.at("run/model.safetensors") + " --data " + splats.ply.string() + " --downscale 16");
  testing::check_refused(tool("adopt --splat " + splats.folder.path.string() + " --out " + splats.at("no")),
                         {"--splat", "is a folder, not a splat file"});
  testing::check_refused(tool("probe --data " + splats.ply.string()),
                         {"--data", "no photographs whose effects", "adopt --splat"});
  CHECK_FALSE(std::filesystem::exists(splats.at("no")));
}

}  // namespace splats_test
