// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// --resume where nothing is left to do: the run that is there is said to be finished and stays as it is, and options that are others are named.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/folder_lock.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <cstddef>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tool/running.hpp"

namespace resume_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::Outcome;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-resume-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// Every file below a folder, with its bytes and when it was written.
std::map<std::string, std::pair<std::vector<std::byte>, fs::file_time_type>> all_of(const fs::path& folder) {
  std::map<std::string, std::pair<std::vector<std::byte>, fs::file_time_type>> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file())
      files[entry.path().string()] = {testing::file_bytes(entry.path()), entry.last_write_time()};
  }
  return files;
}

void make_scene() {
  static const Outcome made = done("scene --out " + at("scene") + " --width 40 --height 40 --train 6 --test 2");
}
std::string train(const std::string& out, int iterations = 3) {
  make_scene();
  return "train --threads 1 --voxel-size 0.2 --iterations " + std::to_string(iterations) + " --data " + at("scene") +
         " --out " + at(out);
}

/// With the words of a finished run, and with each of `others` beside them; what must be named for it.
void check_finished(const std::string& command, const std::string& out,
                    const std::map<std::string, std::string>& others) {
  INFO(command);
  const auto before = all_of(out);
  const Outcome same = tool(command + " --resume");
  CHECK_MESSAGE(same.code == 0, same.text);
  CHECK(same.text.find("is finished, with these options") != std::string::npos);
  for (const auto& other : others) {
    const std::string &words = other.first, &named = other.second;
    INFO(words);
    const Outcome refused = tool(command + " " + words + " --resume");
    check_refused(refused, {out, "is finished (results.json), and ", named, "choose another --out"});
    // Another key or codec is another work: nobody is told to replace that one by it.
    const bool replaces = words.rfind("--codec", 0) != 0 && words.rfind("--key", 0) != 0;
    CHECK((refused.text.find("--force") != std::string::npos) == replaces);
  }
  CHECK(all_of(out) == before);
  // Nor is there anything that would become another with leave to replace it.
  CHECK(done(command + " --resume --force").text.find("is finished") != std::string::npos);
  for (const auto& [path, file] : all_of(out)) CHECK(file.first == before.at(path).first);
}

}  // namespace

TEST_CASE("tool: a finished training that is resumed is left alone, and says which options are others") {
  const std::string run = train("run");
  done(run + " --seed 4");
  make_scene();
  done("scene --out " + at("other_scene") + " --width 40 --height 40 --train 6 --test 2 --seed 1");
  const std::string again = run + " --seed 4";
  check_finished(again, at("run"),
                 {{"--max-anchors 100", "--max-anchors was 0 and is 100"},
                  {"--coarse-to-fine 2:0.5", "--coarse-to-fine was not set and is [[2,0.5]]"},
                  {"--downscale 2", "--downscale (an image's size) was 40 x 40 and is 20 x 20"},
                  {"--background white", "--background was [0.0,0.0,0.0] and is [1.0,1.0,1.0]"},
                  {"--recipe scaffold", "--recipe"},
                  {"--codec hac", "and --codec was none and is hac; give --codec none again"}});
  const auto before = all_of(at("run"));
  check_refused(tool(run + " --seed 5 --resume"), {"--seed was 4 and is 5"});
  check_refused(tool(train("run", 4) + " --resume"), {"--iterations was 3 and is 4, --seed was 4 and is 0"});
  check_refused(tool("train --threads 1 --voxel-size 0.2 --iterations 3 --seed 4 --resume --data " + at("other_scene") +
                     " --out " + at("run")),
                {"--data"});
  CHECK(all_of(at("run")) == before);

  // What is not whole is not finished: it is made again, to the same bits.
  const std::string digest = json_of(at("run/results.json"))["model_sha256"];
  REQUIRE(write_file(at("run/model.safetensors"), std::string_view("cut")).ok());
  done(again + " --resume");
  CHECK(json_of(at("run/results.json"))["model_sha256"] == digest);
  CHECK(testing::file_bytes(at("run/model.safetensors")) == before.at(at("run/model.safetensors")).first);
  // Results of before the settings were in them tell seed and length.
  nlohmann::json old = json_of(at("run/results.json"));
  old.erase("run");
  REQUIRE(write_json(at("run/results.json"), old).ok());
  CHECK(done(again + " --resume").text.find("is finished") != std::string::npos);
  check_refused(tool(run + " --seed 5 --resume"), {"--seed was 4 and is 5"});
  // Who says so replaces it.
  done(run + " --seed 5 --resume --force");
  CHECK(json_of(at("run/results.json"))["seed"] == 5);
  CHECK(json_of(at("run/results.json"))["model_sha256"] != digest);
}

TEST_CASE("tool: a finished embedding and a fitted codec that are resumed are left alone") {
  done(train("plain") + " --recipe scaffold");
  done(train("other_plain") + " --recipe scaffold --seed 9");
  REQUIRE(write_key(at("owner.key"), testing::fixed_key(1, 16)).ok());
  REQUIRE(write_key(at("other.key"), testing::fixed_key(2, 16)).ok());
  const fs::path decoder = at("decoder.safetensors"), other = at("other.safetensors");
  REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_lattice(16, 32, 2), "a test", decoder).ok());
  REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_lattice(16, 32, 3), "a test", other).ok());
  const std::string from = " --threads 1 --iterations 3 --data " + at("scene"), plain = at("plain/model.safetensors"),
                    other_plain = at("other_plain/model.safetensors");
  // Their last word is one that can be said once more, or otherwise.
  const auto embed = [&](const std::string& model, const std::string& key, const fs::path& reader) {
    return "embed" + from + " --out " + at("marked") + " --model " + model + " --key " + key + " --decoder " +
           reader.string();
  };
  const std::string marked = embed(plain, at("owner.key"), decoder);
  done(marked);
  check_finished(marked, at("marked"),
                 {{"--seed 3", "--seed was 0 and is 3"},
                  {"--fidelity 7", "--fidelity was"},
                  {"--message-weight 3", "--message-weight was"},
                  {"--for-compression", "--for-compression"},
                  {"--unmarked " + other_plain, "--unmarked differs"}});
  {  // results.json of a version that called the unmarked model otherwise
    const fs::path results = at("marked/results.json");
    const std::vector<std::byte> bytes = testing::file_bytes(results);
    const std::string now(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    std::string then = now;
    for (std::size_t k; (k = then.find("\"--unmarked\":")) != std::string::npos;) then.replace(k, 13, "\"--twin\":");
    CHECK(then != now);
    REQUIRE(write_file(results, then).ok());
    CHECK(done(marked + " --resume").text.find("is finished, with these options") != std::string::npos);
    REQUIRE(write_file(results, now).ok());
  }
  const auto before = all_of(at("marked"));
  check_refused(tool(embed(other_plain, at("owner.key"), decoder) + " --resume"), {"--model differs"});
  check_refused(tool(embed(plain, at("other.key"), decoder) + " --resume"), {"--key differs"});
  check_refused(tool(embed(plain, at("owner.key"), other) + " --resume"), {"--decoder differs"});
  CHECK(all_of(at("marked")) == before);

  const std::string fitted = "fit-codec" + from + " --out " + at("fitted") + " --model " + plain;
  done(fitted);
  check_finished(
      fitted, at("fitted"),
      {{"--lambda 0.002", "--lambda was 0.001 and is 0.002"},
       {"--touch-up", "--touch-up"},
       {"--codec context_gs", "and --codec was hac and is context_gs; give"},
       {"--key " + at("owner.key") + " --decoder " + decoder.string(), "and was made without --key; leave --key out"}});
  // A model of a codec: what stands beside the marked file is not written anew either.
  const std::string small = "embed" + from + " --out " + at("small") + " --key " + at("owner.key") + " --decoder " +
                            decoder.string() + " --model ";
  done(small + at("fitted/model.safetensors"));
  check_finished(small + at("fitted/model.safetensors"), at("small"),
                 {{"--seed 3", "--seed was 0 and is 3"}, {"--distortion none", "--distortion was"}});
  fs::copy(at("small/unmarked.cmk"), at("unmarked.cmk"));
  done("fit-codec" + from + " --seed 5 --out " + at("other_fitted") + " --model " + plain);
  check_refused(tool(small + at("other_fitted/model.safetensors") + " --resume"), {"--model differs"});
  CHECK(testing::file_bytes(at("small/unmarked.cmk")) == testing::file_bytes(at("unmarked.cmk")));
}

TEST_CASE("tool: a decoder that is trained is not trained again, nor replaced by another") {
  fs::create_directory(at("trained"));
  const std::string tiny = "pretrain --threads 1 --features 16 --steps 20 --crop 32 --measure 1 --out " +
                           at("trained/d.safetensors"),
                    bits = " --bits 8", steps = " --measure-steps 2";
  done(tiny + bits + steps);
  const auto before = all_of(at("trained"));
  CHECK(done(tiny + bits + steps + " --resume").text.find("is finished, with these options") != std::string::npos);
  check_refused(tool(tiny + " --bits 9" + steps + " --resume --seed 3"),
                {"d.safetensors", "--bits was 8 and is 9, --seed was 1 and is 3", "--force"});
  check_refused(tool(tiny + bits + " --measure-steps 3 --resume"), {"--measure-steps was 2 and is 3"});
  fs::rename(at("trained/d.json"), at("aside.json"));  // nothing says what it was trained with
  check_refused(tool(tiny + bits + steps + " --resume"), {"d.safetensors", "--force"});
  fs::rename(at("aside.json"), at("trained/d.json"));
  CHECK(all_of(at("trained")) == before);
  done(tiny + bits + steps + " --resume --force --seed 3");
  CHECK(json_of(at("trained/d.json"))["seed"] == 3);
}

TEST_CASE("tool: what was cut at the end of a log or of a key's record is no line, and the next one is whole") {
  make_scene();
  std::string run = train("killed", 60);
  run.resize(run.rfind(" --out "));
  testing::killed(run, at("killed"));
  const fs::path log = at("killed/log.jsonl");
  std::string text = testing::text_of(log);
  text.resize(text.rfind('\n') + 1);
  REQUIRE(write_file(log, text + "{\"iteration\":4").ok());
  done(run + " --resume --out " + at("killed"));
  std::istringstream lines(testing::text_of(log));
  const auto lines_before = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  std::vector<nlohmann::json> logged;
  for (std::string line; std::getline(lines, line);) {
    logged.push_back(nlohmann::json::parse(line, nullptr, false));
    INFO(line);
    REQUIRE(logged.back().is_object());
  }
  CHECK(logged.back()["iteration"] == 60);
  // The time until the checkpoint counts on, and does not begin anew.
  REQUIRE(logged.size() > lines_before);
  for (std::size_t i = 0; i < lines_before; ++i) {
    if (logged[i]["iteration"] < logged[lines_before]["iteration"])
      CHECK(logged[i]["seconds"] <= logged[lines_before]["seconds"]);
  }

  // A record that has room for a part of a line alone.
  REQUIRE(write_key(at("full.key"), testing::fixed_key(1, 16)).ok());
  const fs::path decoder = at("full_decoder.safetensors");
  REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_lattice(16, 32, 2), "a test", decoder).ok());
  const std::string before((std::size_t{1} << 22) - 100, '\n');
  REQUIRE(write_file(at("full.key.record"), before).ok());
  const std::string embed = "embed --threads 1 --iterations 3 --data " + at("scene") + " --model " +
                            at("killed/model.safetensors") + " --key " + at("full.key") + " --decoder " +
                            decoder.string() + " --out ";
  const Outcome limited = tool(embed + at("limited"), "ulimit -c 0; ulimit -f 8192; ");
  INFO(limited.text);
  CHECK(limited.code == 0);
  CHECK(limited.text.find("full.key.record cannot be written") != std::string::npos);
  CHECK(testing::text_of(at("full.key.record")) == before);
  done(embed + at("unlimited"));
  CHECK(testing::times_in(testing::text_of(at("full.key.record")), "compmark.mark.1") == 1);
}

TEST_CASE("tool: who comes second is told before anything of the first is moved, and files are held as folders are") {
  make_scene();
  const std::string run = train("held");
  done(run);
  REQUIRE(write_key(at("held.key"), testing::fixed_key(1, 16)).ok());
  const fs::path decoder = at("held/decoder.safetensors");
  REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_lattice(16, 32, 2), "a test", decoder).ok());
  const auto before = all_of(at("held"));
  const std::string plain = at("held_plain.safetensors");
  fs::copy(at("held/model.safetensors"), plain);
  {
    const Result<FolderLock> other = FolderLock::acquire(at("held"));
    REQUIRE(other.ok());
    for (const std::string& command : {run + " --force", run + " --resume", run + " --force --key " + at("held.key"),
                                       "embed --threads 1 --force --data " + at("scene") + " --out " + at("held") +
                                           " --key " + at("held.key") + " --model " + plain}) {
      INFO(command);
      check_refused(tool(command), {at("held"), "another run writes into this folder"});
    }
  }
  CHECK(all_of(at("held")) == before);
  done("fit-codec --threads 1 --iterations 3 --data " + at("scene") + " --out " + at("coded") + " --model " + plain);
  for (const auto& written :
       std::map<std::string, std::string>{{"m.cmk", "compress --model " + at("coded/model.safetensors")},
                                          {"m.safetensors", "decompress --model " + at("coded/model.cmk")},
                                          {"m.ply", "export --refine 0 --compare 0 --model " + plain},
                                          {"rounded.safetensors", "attack --int8 tensor --model " + plain}}) {
    const std::string name = written.first, words = written.second + " --out " + at(name);
    INFO(name);
    {
      const Result<FolderLock> other = FolderLock::beside(at(name));
      REQUIRE(other.ok());
      check_refused(tool(words), {name, "another run writes this file"});
    }
    CHECK_FALSE(fs::exists(at(name)));
    done(words);
    CHECK(fs::exists(at(name)));
    CHECK_FALSE(fs::exists(at(name + ".lock")));
  }
  // A name that leaves no room for the lock's ending.
  done("decompress --model " + at("coded/model.cmk") + " --out " + at(std::string(243, 'n') + ".safetensors"));
}

}  // namespace resume_test
