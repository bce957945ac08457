// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What becomes of outputs where things go wrong: full and closed streams, size limits, pipes, two runs at once, a folder with a finished run, views
// whose names agree, renders among photographs; and the record that says which decoder reads a key's mark.
#include <doctest/doctest.h>

#include <sys/stat.h>

#include <algorithm>
#include <compmark/core/random.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "compmark/view_files.hpp"
#include "tool/running.hpp"

namespace outputs_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::file_bytes;
using testing::json_of;
using testing::Outcome;
using testing::text_of;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-outputs-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// A scene, a model of it that is hardly trained, a key, and a decoder that nobody trained.
struct Setting {
  std::string scene = at("scene"), model = at("model/model.safetensors"), key = at("owner.key"),
              decoder = at("lattice.safetensors"), other = at("other.safetensors");
  Setting() {
    done("scene --out " + scene + " --width 40 --height 40 --train 6 --test 2");
    done(train() + at("model"));
    REQUIRE(write_key(key, testing::fixed_key(1, 16)).ok());
    REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_lattice(16, 32, 2), "a test", fs::path(decoder)).ok());
    REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_lattice(16, 32, 3), "a test", fs::path(other)).ok());
  }
  [[nodiscard]] std::string train(int iterations = 3) const {
    return "train --threads 1 --voxel-size 0.2 --iterations " + std::to_string(iterations) + " --data " + scene +
           " --out ";
  }
  [[nodiscard]] std::string verify() const {
    return "verify --threads 1 --split all --model " + model + " --key " + key + " --decoder " + decoder;
  }
};
const Setting& setting() {
  static const Setting instance;
  return instance;
}

/// The names in a folder, hidden ones too.
std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    names.insert(entry.path().filename().string());
  return names;
}

}  // namespace

TEST_CASE("tool: a verdict that cannot be told is no verdict: full, closed and unread standard output") {
  const std::string verify = setting().verify();
  const int code = tool(verify).code;
  REQUIRE((code == 0 || code == 1 || code == 3));
  // stderr stays where it was: "2>&1" comes first in the helper.
  const std::string program = std::string("\"") + COMPMARK_TOOL + "\" ";
  const auto shell = [&](const std::string& command) { return testing::run_tool("sh", "-c '" + command + "'"); };
  for (const std::string stream : {">/dev/full", ">&-"}) {
    INFO(stream);
    const Outcome outcome = shell(program + verify + " " + stream);
    check_refused(outcome, {"standard output"});
    // Files that are opened do not take the place of a stream that is closed.
    check_refused(shell(program + verify + " --json " + at("verdict.json") + " " + stream), {"standard output"});
    CHECK(json_of(at("verdict.json"))["schema"] == "compmark.verification.1");
    fs::remove(at("verdict.json"));
    check_refused(shell(program + "--help " + stream), {"standard output"});
  }
  // Who reads has left before the first word comes.
  static_cast<void>(shell("(" + program + verify + "; echo $? >" + at("code") + ") | true"));
  CHECK(text_of(at("code")) == "2\n");
}

TEST_CASE("tool: a file-size limit and a full device are errors that leave nothing") {
  const std::string out = at("limited");
  fs::create_directory(out);
  const std::string command = "attack --int8 tensor --model " + setting().model + " --out " + out + "/m.safetensors";
  check_refused(tool(command, "ulimit -c 0; ulimit -f 8; "), {"m.safetensors", "cannot be written"});
  CHECK(names_in(out).empty());
  done(command);  // without the limit there is nothing wrong with it
  CHECK(names_in(out) == std::set<std::string>{"m.safetensors"});
  check_refused(tool(setting().verify() + " --json /dev/full"), {"/dev/full"});
  struct ::stat device {};
  REQUIRE(::stat("/dev/full", &device) == 0);
  CHECK(S_ISCHR(device.st_mode));
}

TEST_CASE("tool: a log that is a pipe is written and never read back") {
  const std::string run = setting().train(20);
  const Outcome piped = tool(run + at("piped") + " --json-log /dev/stdout 2>/dev/null", "timeout 60 ", "| cat");
  CHECK(testing::times_in(piped.text, "\"iteration\":") == 3);  // 1, 10, 20
  CHECK(json_of(at("piped/results.json"))["iterations"] == 20);
  CHECK(names_in(at("piped")).count("log.jsonl") == 0);
  CHECK(text_of(at("piped/report.html")).find("<svg") != std::string::npos);  // it has its curves all the same
  REQUIRE(::mkfifo(at("fifo").c_str(), 0600) == 0);
  const Outcome fifo = tool(run + at("fifo-run") + " --json-log " + at("fifo") + " 2>&1; wait #",
                            "cat " + at("fifo") + " >" + at("heard") + " & timeout 60 ");
  INFO(fifo.text);
  CHECK(fs::is_fifo(at("fifo")));
  CHECK(testing::times_in(text_of(at("heard")), "\"iteration\":") == 3);
  CHECK(fs::exists(at("fifo-run/results.json")));
  // A full disk ends the log, not the run, and is told at the end.
  const Outcome full = tool(run + at("full-log") + " --json-log /dev/full");
  CHECK(full.code == 2);
  CHECK(full.text.find("/dev/full: --json-log: ") != std::string::npos);
  CHECK(fs::exists(at("full-log/results.json")));
}

TEST_CASE("tool: a finished run is not replaced unasked, and two runs do not share a folder") {
  const std::string run = setting().train() + at("finished");
  done(run);
  const std::vector<std::byte> model = file_bytes(at("finished/model.safetensors"));
  check_refused(tool(run + " --seed 7"), {at("finished"), "finished run", "--force"});
  CHECK(file_bytes(at("finished/model.safetensors")) == model);
  done(run + " --seed 7 --force");
  CHECK(file_bytes(at("finished/model.safetensors")) != model);
  check_refused(tool("fit-codec --iterations 5 --model " + setting().model + " --data " + setting().scene + " --out " +
                     at("finished")),
                {"finished run", "--force"});
  check_refused(tool("embed --iterations 5 --model " + setting().model + " --data " + setting().scene + " --out " +
                     at("finished") + " --key " + setting().key + " --decoder " + setting().decoder),
                {"finished run", "--force"});
  // The second of two is told, and the first ends as if it had been alone.
  const std::string both = setting().train(400) + at("both");
  const std::string program = std::string("\"") + COMPMARK_TOOL + "\" ";
  const Outcome two = tool(both + " --seed 2 2>&1; echo second $?; wait $first; echo first $? #",
                           program + both + " --seed 1 >/dev/null 2>&1 & first=$!; while [ ! -f " +
                               at("both/log.jsonl") + " ]; do kill -0 $first || break; sleep 0.01; done; ");
  INFO(two.text);
  CHECK(two.text.find("another run writes into this folder") != std::string::npos);
  CHECK(two.text.find("second 2") != std::string::npos);
  CHECK(two.text.find("first 0") != std::string::npos);
  CHECK(json_of(at("both/results.json"))["seed"] == 1);
  CHECK(names_in(at("both")).count(".compmark-lock") == 0);
}

TEST_CASE("tool: views have as many file names as there are views, the same whichever are rendered") {
  const Random random(5, 0, random_stage("test/view names"));
  std::uint64_t draw = 0;
  const auto pick = [&](const std::vector<std::string>& words) { return words[random.below(draw++, words.size())]; };
  std::size_t numbered = 0;
  for (int trial = 0; trial < 500; ++trial) {
    std::set<std::string> views;
    for (int i = 0; i < 20; ++i) {
      views.insert(pick({"", "left/", "./", "left\\", "C:", "a/"}) +
                   pick({"a", "A", "left_a", "a-2", "10.30.01", "10.30.02", "_"}) +
                   pick({"", ".png", ".jpg", ".JPG", ".0001", ".tiff"}));
    }
    const std::vector<std::string> list(views.begin(), views.end());
    const std::vector<std::string> files = ::tool::view_files(list);
    REQUIRE(files.size() == list.size());
    std::set<std::string> different;
    for (std::size_t i = 0; i < files.size(); ++i) {
      different.insert(detail::lower(files[i]));
      CHECK(files[i].find_first_of("/\\:") == std::string::npos);
      CHECK(files[i].front() != '.');
      numbered += files[i] != ::tool::view_stem(list[i]) + ".png" ? 1u : 0u;
    }
    CHECK(different.size() == list.size());
  }
  CHECK(numbered > 0);
  // What never met another keeps the name it always had.
  CHECK(::tool::view_files({"./train/r_000", "IMG_1.JPG", "b/c.png"}) ==
        std::vector<std::string>{"train_r_000.png", "IMG_1.png", "b_c.png"});
  CHECK(::tool::view_files({"10.30.01", "10.30.02"}) == std::vector<std::string>{"10.30.01.png", "10.30.02.png"});
  CHECK(::tool::view_files({"a.png", "a.jpg", "a-2"}) == std::vector<std::string>{"a.png", "a-3.png", "a-2.png"});
}

TEST_CASE("tool: renders are as many files as are told, and none is or lies among the photographs") {
  const std::string render = "render --threads 1 --split all --model " + setting().model + " --out ";
  const Outcome outcome = done(render + at("renders"));
  CHECK(outcome.text.find("8 views in ") == 0);
  CHECK(names_in(at("renders")).size() == 8);
  done(render + at("renders"));  // again: they are ours
  // The model's own cameras are drawn smaller where no data set says a size, as those of a data set are.
  done(render + at("smaller") + " --downscale 3");
  done(render + at("smaller_data") + " --downscale 3 --data " + setting().scene);
  CHECK(names_in(at("smaller")) == names_in(at("renders")));
  for (const char* folder : {"renders", "smaller", "smaller_data"}) {
    const Result<ImageBytes> one = read_image(fs::path(at(folder)) / *names_in(at(folder)).begin());
    REQUIRE(one.ok());
    const int side = std::string(folder) == "renders" ? 40 : 13;
    CHECK(one->width == side);
    CHECK(one->height == side);
  }
  const std::string photographs = setting().scene + "/train";
  const std::vector<std::byte> before = file_bytes(photographs + "/r_000.png");
  check_refused(tool(render + photographs + " --data " + setting().scene), {"--out", "photographs"});
  // Through a link, and where one render would be a photograph although the folder is another.
  fs::create_directory_symlink(photographs, at("link"));
  check_refused(tool(render + at("link") + " --data " + setting().scene), {"--out"});
  fs::create_directory(at("linked"));
  fs::create_hard_link(photographs + "/r_000.png", at("linked/train_r_000.png"));
  check_refused(tool(render + at("linked") + " --data " + setting().scene), {"--out", "train_r_000.png"});
  // Nor without --data, where the folder is a capture's.
  const std::string mine = at("mine");
  fs::copy(setting().scene, mine, fs::copy_options::recursive);
  fs::rename(mine + "/train/r_000.png", mine + "/train/train_r_000.png");
  check_refused(tool(render + mine + "/train"), {"--out", "train_r_000.png"});
  CHECK(file_bytes(mine + "/train/train_r_000.png") == before);
  done(render + mine + "/renders");
  done(render + mine + "/renders");  // those are ours
  CHECK(file_bytes(photographs + "/r_000.png") == before);
  CHECK(names_in(photographs).size() == 6);
}

TEST_CASE("tool: the scene of others is not written over, and a decoder that is there is moved aside") {
  fs::create_directory(at("capture"));
  REQUIRE(write_file(fs::path(at("capture/transforms_train.json")), std::string_view("{\"frames\": []}")).ok());
  check_refused(tool("scene --out " + at("capture") + " --width 8 --height 8 --train 1 --test 0"), {"capture"});
  CHECK(text_of(at("capture/transforms_train.json")) == "{\"frames\": []}");

  const std::string made = at("made.safetensors");
  const std::string pretrain =
      "pretrain --bits 8 --features 8 --crop 32 --measure 1 --measure-steps 1 --steps 0 --out " + made;
  done(pretrain);
  const std::vector<std::byte> first = file_bytes(made);
  check_refused(tool(pretrain + " --seed 2"), {"made.safetensors", "--force"});
  CHECK(file_bytes(made) == first);
  done(pretrain + " --seed 2 --force");
  CHECK(file_bytes(made) != first);
  std::size_t kept = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(scratch())) {
    const std::string name = entry.path().filename().string();
    if (name.rfind("made.safetensors.", 0) != 0 || entry.path().extension() != ".old") continue;
    CHECK(file_bytes(entry.path()) == first);
    ++kept;
  }
  CHECK(kept == 1);
}

TEST_CASE("tool: threads that the system does not give are fewer threads and a warning") {
  const Outcome outcome =
      tool(setting().verify().replace(0, 18, "verify --threads 64"), "ulimit -c 0; ulimit -v 300000; ");
  INFO(outcome.text);
  CHECK((outcome.code == 0 || outcome.code == 1 || outcome.code == 3));
  CHECK(outcome.text.find("of the 64 threads that --threads asks for") != std::string::npos);
}

TEST_CASE("tool: an image that takes more memory than is allowed is refused before it is decoded") {
  const std::string image = at("large.png");
  REQUIRE(write_png(image, ImageBytes{300, 200, 3, std::vector<std::uint8_t>(180000, 100)}).ok());
  const std::string verify = "verify --threads 1 --key " + setting().key + " --decoder " + setting().decoder +
                             " --images " + image + " --memory-budget ";
  check_refused(tool(verify + "3"), {"large.png", "--memory-budget 4", "300 x 200"});
  CHECK(tool(verify + "4").code != 2);
  fs::create_directory(at("large"));
  fs::copy_file(image, at("large/large.png"));
  check_refused(
      tool("pretrain --crop 64 --images " + at("large") + " --memory-budget 1 --out " + at("unmade.safetensors")),
      {"large.png", "--memory-budget 2"});
  CHECK_FALSE(fs::exists(at("unmade.safetensors")));
}

TEST_CASE("tool: of many keys that are made under one name at once, the one that was told is there") {
  const std::string key = at("contested.key");
  const std::string program = std::string("\"") + COMPMARK_TOOL + "\" ";
  const Outcome outcome =
      testing::run_tool("sh", "-c 'for i in 1 2 3 4 5 6 7 8; do " + program + "keygen --out " + key + " & done; wait'");
  INFO(outcome.text);
  const std::size_t told = outcome.text.find("key id      ");
  REQUIRE(told != std::string::npos);
  CHECK(testing::times_in(outcome.text, "key id      ") == 1);
  CHECK(testing::times_in(outcome.text, "compmark: error: ") == 7);
  CHECK(json_of(key)["id"] == outcome.text.substr(told + 12, 16));
}

TEST_CASE("tool: the decoder of a key's mark is on record, and another one is not taken for it") {
  const std::string key = at("recorded.key");
  fs::copy_file(setting().key, key);
  fs::permissions(key, fs::perms::owner_read | fs::perms::owner_write);
  const std::vector<std::byte> bytes = file_bytes(key);
  const std::string embed = "embed --threads 1 --iterations 3 --model " + setting().model + " --data " +
                            setting().scene + " --key " + key + " --decoder " + setting().decoder + " --out ";
  done(embed + at("marked"));
  CHECK(file_bytes(key) == bytes);  // the key itself is left alone
  const nlohmann::json record = json_of(at("marked/mark.json"));
  CHECK(record["schema"] == "compmark.mark.1");
  CHECK(record["models"][0]["sha256"] == json_of(at("marked/results.json"))["model_sha256"]);
  CHECK(nlohmann::json::parse(text_of(key + ".record")) == record);
  done(embed + at("again"));  // the same mark of the same bits is noted once
  CHECK(testing::times_in(text_of(key + ".record"), "\n") == 1);

  const auto read = [&](const std::string& command, const std::string& decoder, const std::string& more = {}) {
    return tool(command + " --threads 1 --split all --model " + at("marked/model.safetensors") + " --key " + key +
                " --decoder " + decoder + more);
  };
  for (const char* command : {"verify", "extract"}) {
    INFO(command);
    CHECK(read(command, setting().decoder).code != 2);
    const Outcome refused = read(command, setting().other);
    check_refused(refused, {"other.safetensors: --decoder", record["decoder"]["tensors_sha256"], "--any-decoder"});
    CHECK(read(command, setting().other, " --any-decoder").code != 2);
  }
  // The name of a decoder and what its file says beside the numbers are no part of it.
  const std::string renamed = at("renamed.safetensors");
  REQUIRE(
      write_lattice<SafetensorsWriter>(testing::untrained_lattice(16, 32, 2), "another note", fs::path(renamed)).ok());
  CHECK(read("verify", renamed).code != 2);
  // A key that marked nothing so far takes any decoder; one whose record is damaged says so and takes it too.
  CHECK(
      tool(setting().verify().replace(setting().verify().rfind(setting().decoder), std::string::npos, setting().other))
          .code != 2);
  REQUIRE(write_file(fs::path(key + ".record"), std::string_view("{\"schema\":\n")).ok());
  fs::remove(at("marked/mark.json"));
  const Outcome damaged = read("verify", setting().other);
  CHECK(damaged.code != 2);
  CHECK(damaged.text.find("recorded.key.record: line 1 is not a valid record") != std::string::npos);
}

}  // namespace outputs_test
