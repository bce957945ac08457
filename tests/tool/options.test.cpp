// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The table of all options of all commands, and what follows from it for every member: no output is an input or another output, by whatever name;
// a number that is none is refused by name; a file of another kind is named for what it is. Each time one line, exit code 2, and nothing written.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/file_kind.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tool/running.hpp"

namespace options_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::file_bytes;
using testing::Outcome;
using testing::tool;

struct Option {
  std::string name, role, reads, range;
  bool required = false, whole = false;
  std::string needs;  ///< another option
};
using Table = std::map<std::string, std::vector<Option>>;

/// As the tool says it.
const Table& table() {
  static const Table found = [] {
    const Outcome outcome = tool("--options-json");
    REQUIRE(outcome.code == 0);
    Table read;
    const nlohmann::json json = nlohmann::json::parse(outcome.text);
    for (const auto& [command, options] : json.items()) {
      for (const auto& entry : options) {
        const auto word = [&](const char* key) {
          return entry.contains(key) && entry[key].is_string() ? entry[key].get<std::string>() : std::string();
        };
        read[command].push_back({word("name"), word("role"), word("reads"), word("range"),
                                 entry["required"].get<bool>(), entry.value("whole", false),
                                 entry.contains("needs") ? entry["needs"][0].get<std::string>() : std::string()});
      }
    }
    return read;
  }();
  return found;
}

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-options-test");
  return folder.path;
}

/// A folder of its own, with one file of every kind that an option reads, and a capture.
struct Place {
  fs::path folder;
  explicit Place(const std::string& name) : folder(scratch() / name) {
    fs::remove_all(folder);
    fs::create_directories(folder / "capture" / "images");
    fs::create_directories(folder / "photographs");
    put("capture/transforms_train.json", R"({"camera_angle_x": 1, "frames": []})");
    ImageBytes image{8, 8, 3, std::vector<std::uint8_t>(192, 90)};
    for (const char* file : {"capture/images/a.png", "photographs/a.png"})
      REQUIRE(write_png(folder / file, image).ok());
    put("file", "something that nobody shall write over\n");
  }
  void put(const std::string& name, const std::string& text) const { REQUIRE(write_file(folder / name, text).ok()); }
  [[nodiscard]] std::string at(const std::string& name) const { return (folder / name).string(); }
  /// Names and bytes of all there is.
  [[nodiscard]] std::map<std::string, std::vector<std::byte>> all() const {
    std::map<std::string, std::vector<std::byte>> files;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file()) files[entry.path().string()] = file_bytes(entry.path());
    }
    return files;
  }
};

std::string quoted(const std::string& text) { return "'" + text + "'"; }
/// "--name 'value'", or the value alone of an option without dashes.
std::string given(const std::string& name, const std::string& value) {
  return (name[0] == '-' ? " " + name + " " : " ") + quoted(value);
}

/// A command with everything it needs, but for the options that are `given` already.
std::string with_required(const std::string& command, const Place& place,
                          const std::map<std::string, std::string>& values) {
  std::string line = command;
  std::vector<std::string> needed;
  for (const Option& option : table().at(command)) {
    if (values.count(option.name) != 0 && !option.needs.empty()) needed.push_back(option.needs);
  }
  for (const Option& option : table().at(command)) {
    const bool wanted = option.required || std::find(needed.begin(), needed.end(), option.name) != needed.end();
    const auto value = values.find(option.name);
    if (value != values.end()) {
      line += given(option.name, value->second);
    } else if (wanted && option.role == "input") {
      line += given(option.name, option.reads == "dataset" ? place.at("capture") : place.at("missing-" + option.name));
    } else if (wanted && option.role.rfind("output", 0) == 0) {
      line += given(option.name, place.at("new" + option.name));
    } else if (wanted) {
      line += given(option.name, option.name == "--int8" ? "tensor" : "1");
    }
  }
  return line;
}

bool is_input(const Option& option) { return option.role == "input" || option.role == "share or folder"; }

/// Names by which an output meets a file that is there.
std::vector<std::string> other_names(const Place& place, const std::string& file) {
  const fs::path path = place.at(file);
  fs::create_symlink(path, place.folder / "a link");
  fs::create_hard_link(path, place.folder / "a hard link");
  return {path.string(), (path.parent_path() / "." / ".." / path.parent_path().filename() / path.filename()).string(),
          place.at("a link"), place.at("a hard link")};
}

}  // namespace

TEST_CASE("options: every option of every command says what it is") {
  CHECK(table().size() >= 18);
  std::size_t inputs = 0, outputs = 0, numbers = 0;
  for (const auto& [name, options] : table()) {
    const std::string& command = name;  // a structured binding is no part of doctest's lambdas
    for (const Option& option : options) {
      INFO(command, " ", option.name);
      CHECK_FALSE(option.role.empty());  // one that was not declared has none
      inputs += is_input(option) ? 1u : 0u;
      outputs += option.role.rfind("output", 0) == 0 ? 1u : 0u;
      if (option.role != "number") continue;
      ++numbers;
      CHECK_FALSE(option.range.empty());
    }
  }
  CHECK(inputs > 30);
  CHECK(outputs > 15);
  CHECK(numbers > 60);
  // What the table says is what the help says.
  for (const auto& [name, options] : table()) {
    const std::string& command = name;
    const std::string help = tool(command + " --help").text;
    std::size_t lines = 0;
    for (std::size_t at = help.find("\n  -"); at != std::string::npos; at = help.find("\n  -", at + 1)) ++lines;
    const auto dashed =
        std::count_if(options.begin(), options.end(), [](const Option& option) { return option.name[0] == '-'; });
    INFO(command, "\n", help);
    CHECK(lines == static_cast<std::size_t>(dashed) + 2);  // --help, --help-all
  }
}

TEST_CASE("options: no output is the file that an input reads, for every pair, by whatever name") {
  std::size_t pairs = 0;
  for (const auto& [command, options] : table()) {
    for (const Option& output : options) {
      if (output.role != "output file") continue;
      for (const Option& input : options) {
        if (!is_input(input)) continue;
        const bool capture = input.reads == "dataset", photographs = input.reads == "images" || input.reads.empty();
        const std::vector<std::string> files =
            capture       ? std::vector<std::string>{"capture/transforms_train.json", "capture/images/a.png"}
            : photographs ? std::vector<std::string>{"photographs/a.png"}
                          : std::vector<std::string>{"file"};
        for (const std::string& file : files) {
          const Place place("pairs");
          const std::vector<std::string> names = other_names(place, file);
          const auto before = place.all();
          const std::string read = place.at(capture ? "capture" : photographs ? "photographs" : file);
          for (const std::string& name : names) {
            const std::string line = with_required(command, place, {{input.name, read}, {output.name, name}});
            INFO(line);
            check_refused(tool(line), {output.name, input.name});
            CHECK(place.all() == before);
          }
          ++pairs;
        }
      }
    }
  }
  CHECK(pairs > 40);
}

TEST_CASE("options: what a command writes into its folder is not the file that an input reads") {
  const std::map<std::string, std::vector<std::string>> written{
      {"train", {"model.safetensors", "checkpoint.safetensors", "results.json", "report.html", "log.jsonl"}},
      {"embed", {"model.safetensors", "checkpoint.safetensors", "results.json", "report.html", "mark.json"}},
      {"fit-codec", {"model.safetensors", "model.cmk", "checkpoint.safetensors", "results.json", "report.html"}}};
  for (const auto& [command, names] : written) {
    for (const Option& input : table().at(command)) {
      if (input.role != "input" || input.reads == "dataset") continue;
      for (const std::string& name : names) {
        const Place place("folders");
        fs::create_directory(place.folder / "run");
        place.put("run/" + name, "an input");
        const auto before = place.all();
        const std::string line =
            with_required(command, place, {{input.name, place.at("run/" + name)}, {"--out", place.at("run")}});
        INFO(line);
        check_refused(tool(line), {"--out", input.name});
        CHECK(place.all() == before);
      }
    }
  }
}

TEST_CASE("options: two outputs of a command are two files") {
  std::size_t pairs = 0;
  for (const auto& [command, options] : table()) {
    for (const Option& one : options) {
      for (const Option& other : options) {
        if (one.role != "output file" || other.role != "output file" || !(one.name < other.name)) continue;
        const Place place("outputs");
        const auto before = place.all();
        const std::string line =
            with_required(command, place, {{one.name, place.at("new")}, {other.name, place.at("capture/../new")}});
        INFO(line);
        check_refused(tool(line), {one.name, other.name});
        CHECK(place.all() == before);
        ++pairs;
      }
    }
  }
  CHECK(pairs >= 5);
}

TEST_CASE("options: a number that is none, or is out of its range, is refused by name") {
  static constexpr std::array words{"nan", "inf", "-inf", "-1", "1e308", "18446744073709551616",
                                    "",    "x",   "0x10", "1 2"};
  const Place place("numbers");
  const auto before = place.all();
  std::size_t tried = 0;
  for (const auto& [command, options] : table()) {
    for (const Option& option : options) {
      if (option.role != "number" && option.role != "share or folder") continue;
      const std::size_t from = option.range.find_first_of("-0123456789");
      const double low = from == std::string::npos ? 0 : std::strtod(option.range.c_str() + from, nullptr);
      for (const std::string word : words) {
        if (word == "-1" && low <= -1) continue;
        if (option.role != "number" && (word == "x" || word == "0x10" || word == "1 2")) continue;  // may be a folder
        const std::string line = with_required(command, place, {{option.name, word}});
        INFO(line);
        check_refused(tool(line), {option.name, "\"" + word + "\""});
        ++tried;
      }
    }
  }
  CHECK(place.all() == before);
  CHECK(tried > 500);
}

TEST_CASE("options: a file of another kind is named for what it is") {
  const Place place("kinds");
  place.put("splats.ply", "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n");
  place.put("cameras.json", R"({"camera_angle_x": 1, "frames": []})");
  place.put("small.cmk",
            "\x89"
            "CMK\r\n\x1a\n and more");
  place.put("page.html", "<!doctype html><p>");
  place.put("archive.zip", std::string("PK\3\4", 4) + std::string(60, '\0'));
  place.put("array.npy", std::string("\x93NUMPY\1\0", 8) + std::string(60, '\0'));
  const auto tensors = [&](const std::string& name, const std::string& format) {
    const std::string header = R"({"__metadata__":{"format":")" + format + R"("}})";
    std::string length(8, '\0');
    length[0] = static_cast<char>(header.size());
    place.put(name, length + header);
  };
  tensors("model.safetensors", "compmark.model");
  tensors("decoder.safetensors", "compmark decoder");
  tensors("checkpoint.safetensors", "compmark.checkpoint");
  tensors("interference.safetensors", "compmark cover interference");
  REQUIRE(write_key(place.folder / "owner.key", testing::fixed_key(1, 8)).ok());
  const std::map<std::string, std::vector<std::string>> taken{
      {"model", {"model.safetensors", "small.cmk", "splats.ply"}},
      {"markable model", {"model.safetensors", "small.cmk", "splats.ply"}},
      {"trained model", {"model.safetensors", "small.cmk"}},
      {"compressed model", {"small.cmk"}},
      {"decoder", {"decoder.safetensors"}},
      {"interference", {"interference.safetensors"}},
      {"key", {"owner.key"}},
      {"claim", {}},
      {"time stamp", {}},
      {"images", {"photographs/a.png", "photographs"}},
      {"dataset", {"cameras.json", "photographs", "splats.ply"}},
      {"splat file", {"splats.ply"}},
      {"LPIPS weights", {}}};
  const auto before = place.all();
  std::size_t tried = 0;
  for (const auto& [command, options] : table()) {
    for (const Option& option : options) {
      if (option.role != "input") continue;
      for (const char* file : {"splats.ply", "cameras.json", "small.cmk", "page.html", "archive.zip", "array.npy",
                               "model.safetensors", "decoder.safetensors", "checkpoint.safetensors",
                               "interference.safetensors", "owner.key", "photographs/a.png", "photographs"}) {
        const std::vector<std::string>& own = taken.at(option.reads);
        if (std::find(own.begin(), own.end(), file) != own.end()) continue;
        const std::string line = with_required(command, place, {{option.name, place.at(file)}});
        INFO(line);
        check_refused(tool(line), {std::string(file_kind_name(identify_file(place.at(file))))});
        ++tried;
      }
    }
  }
  CHECK(place.all() == before);
  CHECK(tried > 300);
}

TEST_CASE("options: an output replaces its like, or nothing that tells what it is, and never a key") {
  const Place place("replaced");
  REQUIRE(write_key(place.folder / "owner.key", testing::fixed_key(1, 8)).ok());
  REQUIRE(write_key(place.folder / "made.json", testing::fixed_key(2, 8)).ok());
  const auto before = place.all();
  for (const auto& [command, options] : table()) {
    for (const Option& option : options) {
      if (option.role != "output file" || command == "keygen") continue;
      for (const char* file : {"owner.key", "photographs/a.png"}) {
        const std::string line = with_required(command, place, {{option.name, place.at(file)}});
        INFO(line);
        check_refused(tool(line), {file, std::string(file_kind_name(identify_file(place.at(file))))});
      }
    }
  }
  // Nor by a file that a command names by itself.
  check_refused(tool("pretrain --steps 0 --out " + place.at("made.safetensors")), {"made.json", "an owner's key"});
  CHECK(place.all() == before);
}

TEST_CASE("tool: the help has its options under headings, and every option has one") {
  const std::string help = tool("train --help").text;
  for (const char* heading : {"\nOptions:", "\nMessage (watermark):", "\nCodec (compression):", "\nExpert:"})
    CHECK(help.find(heading) != std::string::npos);
  CHECK(help.find("Usage: compmark train [OPTIONS]") != std::string::npos);
  CHECK(tool("--help").text.find("Usage: compmark [OPTIONS] SUBCOMMAND") != std::string::npos);
  CHECK(help.find("--data") < help.find("Expert:"));
  CHECK(help.find("--voxel-size") > help.find("Expert:"));
  const nlohmann::json json = nlohmann::json::parse(tool("--options-json").text);
  std::map<std::string, std::size_t> members;
  for (const auto& [command, options] : json.items())
    for (const auto& option : options) ++members[option["group"].get<std::string>()];
  CHECK(members.size() == 4);
  CHECK(members["Expert"] > 20);
}

TEST_CASE("options: a file that is not there, or is empty, is told with the option that names it") {
  const Place place("absent");
  REQUIRE(write_key(place.folder / "owner.key", testing::fixed_key(1, 8)).ok());
  place.put("zero.ply", "");
  const std::string verify = "verify --images " + place.at("photographs") + " --key ";
  check_refused(tool("info " + place.at("zero.ply")), {"zero.ply", "is empty; copy it again"});
  check_refused(tool(verify + place.at("none.key")), {"none.key: --key: no such file"});
  check_refused(tool(verify + place.at("owner.key") + " --decoder " + place.at("none.safetensors")),
                {"none.safetensors: --decoder: no such file; check the path"});
  // A word of the commands that hide a message is no file of those that read one.
  check_refused(tool(verify + place.at("owner.key") + " --decoder fit"),
                {"fit: --decoder: no such file; name the file, RUN/decoder.safetensors"});
}

TEST_CASE("options: what would change nothing is refused where somebody gives it by hand") {
  const Place place("idle");
  const auto before = place.all();
  const std::string train = "train --data " + place.at("capture") + " --out " + place.at("run");
  check_refused(tool(train + " --lambda 0.002"), {"--lambda", "give --codec, or leave it out"});
  check_refused(tool(train + " --mark-iterations 100"), {"--mark-iterations: needs a message to hide; give --key"});
  for (const char* name :
       {"--spread 50", "--sample-by-loss 1", "--orbit 0.5", "--photographs 0.3", "--calibrate-steps 50"}) {
    INFO(name);
    const std::string words = name, option = words.substr(0, words.find(' '));
    check_refused(tool(train + " " + words), {option + ": needs a message to hide; give --key"});
  }
  // A preset sets both, and is for trainings of every kind: what it does not find here is a capture of the right form.
  const Outcome preset = tool(train + " --preset draft --iterations 1");
  CHECK(preset.text.find("--lambda") == std::string::npos);
  CHECK(preset.text.find("--mark-iterations") == std::string::npos);
  fs::remove_all(place.folder / "run");
  const std::string model = place.at("model.safetensors");
  const std::string header = R"({"__metadata__":{"format":"compmark.model"}})";
  std::string length(8, '\0');
  length[0] = static_cast<char>(header.size());
  place.put("model.safetensors", length + header);  // of the right kind, and nothing else
  for (const std::string words : {"--spz-bits 9", "--spz-version 3"}) {
    const std::string option = words.substr(0, words.find(' '));
    check_refused(tool("export --model " + model + " --out " + place.at("a.ply") + " " + words),
                  {"a.ply", option, "is for SPZ files"});
    // The control: of an SPZ file it is the model that is looked at.
    CHECK(tool("export --model " + model + " --out " + place.at("a.spz") + " " + words).text.find("is for SPZ files") ==
          std::string::npos);
  }
  // A size of photographs without photographs; the control: without the option it is the model that is looked at.
  const std::string splats = "export --model " + model + " --out " + place.at("a.ply");
  check_refused(tool(splats + " --downscale 2"), {"--downscale", "no --data is given", "give --data"});
  CHECK(tool(splats).text.find("--downscale") == std::string::npos);
  fs::remove(place.folder / "model.safetensors");
  CHECK(place.all() == before);
}

TEST_CASE("tool: options are known by the names that they had before, which is said") {
  const Outcome old = tool("fit --waves 0 --model m --data d --out o");
  CHECK(old.code == 2);
  CHECK(old.text.find("--waves is called --features now") != std::string::npos);
  CHECK(old.text.find("--features") != std::string::npos);
  CHECK(tool("pretrain --waves=none --out o").text.find("--waves is called --fourier now") != std::string::npos);
  CHECK(tool("fit --features 0 --model m --data d --out o").text.find("is called") == std::string::npos);
}

}  // namespace options_test
