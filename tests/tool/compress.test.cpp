// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A scene as one small file, as its owner and whoever receives it meet it: train --codec, compress, and every command that reads a model
// reading the .cmk; damage is refused in a sentence, or salvaged when asked.
#include <doctest/doctest.h>

#include <compmark/codec/container/container.hpp>
#include <compmark/codec/container/inspect.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tool/running.hpp"

namespace compress_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::file_bytes;
using testing::json_of;
using testing::Outcome;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-compress-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// The built-in scene, small, trained for compression.
const nlohmann::json& results() {
  static const nlohmann::json instance = [] {
    done("scene --out " + at("scene") + " --width 96 --height 80 --train 12 --test 4");
    done("train --codec hac --voxel-size 0.2 --effects none --iterations 400 --data " + at("scene") + " --out " +
         at("run"));
    return json_of(at("run/results.json"));
  }();
  return instance;
}
std::string small() {
  static_cast<void>(results());
  return at("run/model.cmk");
}

}  // namespace

TEST_CASE("tool: train --codec writes a small file beside the model, and says what it costs") {
  const nlohmann::json& run = results();
  CHECK(run["recipe"] == "hac");
  CHECK(run["profile"] == "hac");
  const nlohmann::json& compressed = run["compressed"];
  CHECK(compressed["codec"] == "hac");
  CHECK(compressed["bytes"] == fs::file_size(small()));
  std::size_t sum = 0;
  for (const auto& [name, bytes] : compressed["sections"].items()) sum += bytes.get<std::size_t>();
  CHECK(sum == compressed["bytes"]);
  MESSAGE("PSNR ", run["test"]["psnr"].get<double>(), " dB, compressed ", compressed["test"]["psnr"].get<double>(),
          " dB in ", compressed["bytes"].get<int>(), " bytes of ", fs::file_size(at("run/model.safetensors")));
  CHECK(compressed["bytes"].get<std::size_t>() * 20 < fs::file_size(at("run/model.safetensors")));
  CHECK(compressed["test"]["psnr"].get<double>() > run["test"]["psnr"].get<double>() - 1);
}

TEST_CASE("tool: compress and decompress do not replace what they read") {
  static_cast<void>(small());
  const std::string model = at("run/model.safetensors"), file = at("run/model.cmk");
  const std::vector<std::byte> before = file_bytes(model), before_file = file_bytes(file);
  check_refused(tool("compress --model " + model + " --out " + model), {"--out", "choose another"});
  check_refused(tool("compress --model " + model + " --out " + at("x.cmk") + " --json " + model), {"--json"});
  check_refused(tool("compress --model " + model + " --out " + at("x.cmk") + " --json " + at("run/../x.cmk")),
                {"--json"});
  check_refused(tool("decompress --model " + file + " --out " + file), {"--out", "choose another"});
  CHECK(file_bytes(model) == before);
  CHECK(file_bytes(file) == before_file);
  CHECK(!fs::exists(at("x.cmk")));
}

TEST_CASE("tool: compress makes the file of the run again, to the byte, at any thread count") {
  const std::vector<std::byte> expected = file_bytes(small());
  for (const char* threads : {"1", "2", "5"}) {
    done("compress --model " + at("run/model.safetensors") + " --out " + at("again.cmk") + " --threads " + threads);
    CHECK(file_bytes(at("again.cmk")) == expected);
  }
  const Outcome less = done("compress --cameras none --networks single --model " + at("run/model.safetensors") +
                            " --out " + at("single.cmk") + " --json " + at("sizes.json"));
  CHECK(less.text.find("positions") != std::string::npos);
  CHECK(json_of(at("sizes.json"))["bytes"] == fs::file_size(at("single.cmk")));
  check_refused(tool("render --model " + at("single.cmk") + " --out " + at("none")), {"--split", "selects no view"});
}

TEST_CASE("tool: every command that reads a model reads a compressed one, in a process of its own") {
  const nlohmann::json& compressed = results()["compressed"];
  const std::string data = " --data " + at("scene");
  done("evaluate --model " + small() + data + " --json " + at("evaluate.json"));
  done("decompress --model " + small() + " --out " + at("back.safetensors"));
  done("evaluate --model " + at("back.safetensors") + data + " --json " + at("back.json"));
  for (const char* file : {"evaluate.json", "back.json"}) {
    const nlohmann::json figures = json_of(at(file));
    INFO(figures.dump());
    CHECK(figures["psnr"] == compressed["test"]["psnr"]);
    CHECK(figures["ssim"] == compressed["test"]["ssim"]);
  }
  // Before and after, side by side.
  const Outcome both =
      done("evaluate --model " + at("run/model.safetensors") + " " + small() + data + " --json " + at("both.json"));
  CHECK(both.text.find("positions") != std::string::npos);
  const nlohmann::json models = json_of(at("both.json"))["models"];
  REQUIRE(models.size() == 2);
  CHECK(models[0]["psnr"].get<double>() == doctest::Approx(results()["test"]["psnr"].get<double>()).epsilon(1e-12));
  CHECK_FALSE(models[0].contains("codec"));
  CHECK(models[1]["codec"] == "hac");
  CHECK(models[1]["psnr"] == compressed["test"]["psnr"]);
  CHECK(models[1]["sections"] == compressed["sections"]);
  done("render --model " + small() + " --out " + at("renders"));
  std::size_t images = 0;
  for (const auto& entry : fs::directory_iterator(at("renders"))) images += entry.path().extension() == ".png";
  CHECK(images == 4);
  done("export --model " + small() + " --out " + at("splats.ply") + " --sh-degree 0 --compare 0");
  CHECK(fs::file_size(at("splats.ply")) > 1000);
  const Outcome info = done("info " + small());
  for (const char* word : {"hac", "GEOM", "STRM", "verified", "4 stored"}) {
    INFO(word);
    CHECK(info.text.find(word) != std::string::npos);
  }
}

TEST_CASE("tool: a damaged file is refused with its name, and salvaged when that is asked") {
  const std::vector<std::byte> whole = file_bytes(small());
  const auto write = [&](const std::vector<std::byte>& bytes) {
    REQUIRE(write_file(at("damaged.cmk"), bytes));
    return at("damaged.cmk");
  };
  std::vector<std::byte> cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() / 2));
  check_refused(tool("info " + write(cut)), {"damaged.cmk"});
  // A byte in the last symbols: the chunk's checksum says so.
  const Result<Container> container = parse_container(whole, "whole");
  REQUIRE(container.ok());
  std::vector<std::byte> flipped = whole;
  for (const SectionEntry& entry : container->sections) {
    if (section_name(entry.kind) != "STRM") continue;
    flipped[entry.offset + entry.size / 2] ^= std::byte{4};
    break;
  }
  write(flipped);
  check_refused(tool("evaluate --model " + at("damaged.cmk") + " --data " + at("scene")), {"damaged.cmk", "STRM"});
  check_refused(tool("decompress --model " + at("damaged.cmk") + " --out " + at("kept.safetensors")),
                {"damaged.cmk", "STRM"});
  CHECK_FALSE(fs::exists(at("kept.safetensors")));
  const Outcome salvage =
      tool("decompress --salvage --model " + at("damaged.cmk") + " --out " + at("kept.safetensors"));
  INFO(salvage.text);
  CHECK(salvage.code == 4);
  CHECK(salvage.text.find("is lost") != std::string::npos);
  CHECK(fs::exists(at("kept.safetensors")));
}

TEST_CASE("tool: what cannot be compressed is refused in one line, and nothing is overwritten") {
  static_cast<void>(small());
  done("train --effects none --iterations 20 --data " + at("scene") + " --out " + at("plain"));
  check_refused(tool("compress --model " + at("plain/model.safetensors") + " --out " + small()),
                {"scaffold", "--codec hac"});
  check_refused(tool("compress --model " + small() + " --out " + at("twice.cmk")), {"compressed already"});
  done("decompress --model " + small() + " --out " + at("unpacked.safetensors"));
  check_refused(tool("compress --model " + at("unpacked.safetensors") + " --out " + at("twice.cmk")),
                {"unpacked.safetensors", "decompressed"});
  check_refused(tool("compress --model " + at("nothing.safetensors") + " --out " + at("twice.cmk")), {"nothing"});
  check_refused(tool("train --codec hac --recipe compmark-host --data " + at("scene") + " --out " + at("no")),
                {"--codec", "compmark-host"});
  CHECK(json_of(at("run/results.json"))["compressed"]["bytes"] == fs::file_size(small()));
}

TEST_CASE(
    "tool: a decoder is fitted to a model for a codec, which is marked as its file is read, beside an unmarked file") {
  static_cast<void>(small());
  const std::string key = at("owner.key"), other = at("other.key"), decoder = at("fitted.safetensors"),
                    out = at("embedded"), data = " --data " + at("scene");
  REQUIRE(write_key(key, testing::fixed_key(1, 24)).ok());
  REQUIRE(write_key(other, testing::fixed_key(2, 24)).ok());
  const std::string fit = "fit --bits 24" + data + " --model ";
  done(fit + at("run/model.safetensors") + " --features 72 --views 200 --gradient-views 6 --out " + decoder);
  // To what the file says: of a file with all cameras it is the same decoder.
  const std::string quick = " --features 32 --views 60 --gradient-views 2 --out ";
  done(fit + at("run/model.safetensors") + quick + at("of-model.safetensors"));
  done("compress --cameras all --model " + at("run/model.safetensors") + " --out " + at("all.cmk"));
  done(fit + at("all.cmk") + quick + at("of-file.safetensors"));
  done(fit + at("all.cmk") + " --seed 2" + quick + at("other.safetensors"));
  const auto tensors = [](const std::string& file) {  // what is behind the header, which names the model
    const std::string text = testing::text_of(file);
    std::size_t header = 0;
    for (std::size_t i = 8; i-- > 0;) header = header << 8 | static_cast<unsigned char>(text[i]);
    return text.substr(8 + header);
  };
  CHECK(tensors(at("of-file.safetensors")) == tensors(at("of-model.safetensors")));
  CHECK(tensors(at("of-file.safetensors")) != tensors(at("other.safetensors")));
  // A model that came out of a file says it already.
  done("decompress --model " + at("all.cmk") + " --out " + at("all.safetensors"));
  done(fit + at("all.safetensors") + quick + at("of-decompressed.safetensors"));
  CHECK(tensors(at("of-decompressed.safetensors")) == tensors(at("of-model.safetensors")));
  const std::string embed = "embed --iterations 1200 --message-rate 0.01 --model " + at("run/model.safetensors") +
                            data + " --key " + key + " --decoder " + decoder + " --out " + out;
  check_refused(tool(embed + " --fidelity 0"), {"--fidelity", "train --codec"});
  CHECK_FALSE(fs::exists(out));
  done(embed + " --fidelity 60");
  const nlohmann::json compressed = json_of(out + "/results.json")["compressed"];
  MESSAGE(compressed["bit_accuracy"].dump(), " p ", compressed["p_value"].dump(), " cost ",
          compressed["psnr_cost_vs_unmarked"].dump(), " dB, ", compressed["psnr_marked_vs_unmarked"].dump(), " dB, ",
          compressed["bytes"].dump(), " bytes of ", fs::file_size(small()));
  CHECK(file_bytes(out + "/unmarked.cmk") == file_bytes(small()));
  CHECK(compressed["psnr_marked_vs_unmarked"].get<double>() > 20);
  CHECK(compressed["bytes"].get<double>() < 1.1 * static_cast<double>(fs::file_size(small())));
  const auto verdict = [&](const std::string& file, const std::string& whose) {
    return tool("verify --alpha 1e-3 --split all --model " + file + " --key " + whose + " --decoder " + decoder +
                testing::claimed(whose, decoder))
        .code;
  };
  CHECK(verdict(out + "/model.cmk", key) == 0);
  CHECK(verdict(out + "/model.cmk", other) != 0);  // negative controls
  CHECK(verdict(out + "/unmarked.cmk", key) != 0);

  // Stopped, it ends in the same file; begun anew or with another model, it says so.
  const std::string again = "embed --iterations 100 --model " + at("run/model.safetensors") + data + " --key " + key +
                            " --decoder " + decoder;
  testing::killed(again, at("stopped"));
  check_refused(tool(again + " --out " + at("stopped")), {"checkpoint.safetensors", "--resume"});
  done(again + " --resume --out " + at("stopped"));
  done(again + " --out " + at("straight"));
  CHECK(file_bytes(at("stopped/model.cmk")) == file_bytes(at("straight/model.cmk")));
  check_refused(tool(again + " --out " + at("straight") + " --unmarked " + at("straight/model.cmk")), {"--unmarked"});

  // What a reading does to features: the loss of the first, held hard to the unmarked render before rounding, is what rounding does to the image (38.5 here),
  // and next to nothing without it (0.9) or where both have the same noise (0.9).
  const auto distorted = [&](const std::string& how) {
    done("embed --iterations 20 --fidelity 1e6 --model " + at("run/model.safetensors") + data + " --key " + key +
         " --decoder " + decoder + " --distortion " + how + " --out " + at(how));
    const std::string log = testing::text_of(at(how + "/log.jsonl"));
    return nlohmann::json::parse(log.substr(0, log.find('\n')))["loss"].get<double>();
  };
  const double rounded = distorted("round"), noisy = distorted("noise"), undistorted = distorted("none");
  CHECK(10 * noisy < rounded);
  CHECK(10 * undistorted < rounded);
  CHECK(file_bytes(at("noise/model.cmk")) != file_bytes(at("none/model.cmk")));
  CHECK(tool(again + " --distortion some --out " + at("some")).code == 2);
  CHECK_FALSE(fs::exists(at("some")));
}

TEST_CASE("tool: --codec context_gs: its own file, read by every command, salvaged by chunks") {
  done("scene --out " + at("scene") + " --width 96 --height 80 --train 12 --test 4");
  done("train --codec context_gs --voxel-size 0.2 --effects none --iterations 400 --data " + at("scene") + " --out " +
       at("gs"));
  const nlohmann::json run = json_of(at("gs/results.json"));
  CHECK(run["recipe"] == "context_gs");
  const nlohmann::json& compressed = run["compressed"];
  CHECK(compressed["codec"] == "context_gs");
  CHECK(compressed["bytes"] == fs::file_size(at("gs/model.cmk")));
  std::size_t sum = 0;
  for (const auto& [name, bytes] : compressed["sections"].items()) sum += bytes.get<std::size_t>();
  CHECK(sum == compressed["bytes"]);
  MESSAGE("PSNR ", run["test"]["psnr"].get<double>(), " dB, compressed ", compressed["test"]["psnr"].get<double>(),
          " dB in ", compressed["bytes"].get<int>(), " bytes of ", fs::file_size(at("gs/model.safetensors")));
  CHECK(compressed["test"]["psnr"].get<double>() > run["test"]["psnr"].get<double>() - 1);
  const std::vector<std::byte> expected = file_bytes(at("gs/model.cmk"));
  done("compress --model " + at("gs/model.safetensors") + " --out " + at("gs_again.cmk") + " --threads 5");
  CHECK(file_bytes(at("gs_again.cmk")) == expected);
  const Outcome info = done("info " + at("gs/model.cmk"));
  for (const char* word : {"context_gs", "LVLS", "HYPR", "verified"}) {
    INFO(word);
    CHECK(info.text.find(word) != std::string::npos);
  }
  done("decompress --model " + at("gs/model.cmk") + " --out " + at("gs_back.safetensors"));
  for (const std::string& model : {at("gs/model.cmk"), at("gs_back.safetensors")}) {
    done("evaluate --model " + model + " --data " + at("scene") + " --json " + at("gs_evaluate.json"));
    CHECK(json_of(at("gs_evaluate.json"))["psnr"] == compressed["test"]["psnr"]);
  }
  done("export --model " + at("gs/model.cmk") + " --out " + at("gs.ply") + " --sh-degree 0 --compare 0");
  // Marked as its file is read.
  REQUIRE(write_key(at("gs.key"), testing::fixed_key(1, 24)).ok());
  const std::string data = " --data " + at("scene") + " --model " + at("gs/model.safetensors"),
                    decoder = at("gs_fitted.safetensors");
  done("fit --tone 0 --bits 24 --features 72 --views 200 --gradient-views 6" + data + " --out " + decoder);
  done("embed --iterations 400 --fidelity 100 --message-rate 0.01" + data + " --key " + at("gs.key") + " --decoder " +
       decoder + " --out " + at("gs_marked"));
  const nlohmann::json marked = json_of(at("gs_marked/results.json"))["compressed"];
  MESSAGE(marked["bit_accuracy"].dump(), ", ", marked["psnr_cost_vs_unmarked"].dump(), " dB, ", marked["bytes"].dump(),
          " bytes of ", compressed["bytes"].dump());
  CHECK(file_bytes(at("gs_marked/unmarked.cmk")) == expected);
  CHECK(marked["bit_accuracy"]["mean"].get<double>() > 0.7);
  // A byte of the last z: a chunk of level 0.
  const Result<Container> container = parse_container(expected, "whole");
  REQUIRE(container.ok());
  std::vector<std::byte> flipped = expected;
  const SectionEntry last = container->all(four_characters("HYPR")).back();
  flipped[last.offset + last.size / 2] ^= std::byte{4};
  REQUIRE(write_file(at("gs_damaged.cmk"), flipped));
  check_refused(tool("info " + at("gs_damaged.cmk")), {"gs_damaged.cmk", "HYPR"});
  const Outcome salvage =
      tool("decompress --salvage --model " + at("gs_damaged.cmk") + " --out " + at("kept.safetensors"));
  INFO(salvage.text);
  CHECK(salvage.code == 4);
  CHECK(salvage.text.find("is lost") != std::string::npos);
  // The beginning of a file is a preview, when that is asked.
  const std::vector<CodecLevel> levels = codec_levels(*container);
  REQUIRE(levels.size() == 3);
  CHECK(info.text.find("there after " + std::to_string(levels[1].end) + " bytes") != std::string::npos);
  const auto begun = expected.begin();
  REQUIRE(write_file(at("gs_begun.cmk"),
                     std::vector<std::byte>(begun, begun + static_cast<std::ptrdiff_t>(levels[1].end) + 7)));
  const std::string decompress =
      "decompress --model " + at("gs_begun.cmk") + " --out " + at("gs_begun.safetensors") + " ";
  check_refused(tool(decompress), {"gs_begun.cmk", "bytes", "decompress --partial"});
  const Outcome preview = done(decompress + "--partial");
  CHECK(preview.text.find("2 of 3 levels") != std::string::npos);
  CHECK(preview.text.find(std::to_string(levels[2].anchors) + " anchors are still missing") != std::string::npos);
  done("evaluate --model " + at("gs_begun.safetensors") + " --data " + at("scene") + " --json " +
       at("gs_evaluate.json"));
  CHECK(json_of(at("gs_evaluate.json"))["psnr"].get<double>() < compressed["test"]["psnr"].get<double>());
  check_refused(tool("train --codec hac --recipe context_gs --data " + at("scene") + " --out " + at("no")),
                {"--codec", "context_gs"});
}

}  // namespace compress_test
