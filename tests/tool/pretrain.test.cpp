// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark pretrain as its user meets it: tiny runs that write a decoder and its measurements, that are the same after an interruption and for
// any number of threads, and one error line for every bad input, with nothing overwritten.
#include <doctest/doctest.h>

#include <compmark/core/buffer.hpp>
#include <compmark/core/views.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <compmark/watermark/decoder/stored_decoder.hpp>
#include <compmark/watermark/pretrain/dead_leaves.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tool/running.hpp"

namespace pretrain_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::file_bytes;
using testing::json_of;
using testing::Outcome;
using testing::tool;

Outcome pretrain(const std::string& arguments, const std::string& after = {}) {
  return tool("pretrain " + arguments, {}, after);
}
std::string at(const std::string& name) {
  static const testing::ScratchFolder scratch("compmark-pretrain-test");
  return (scratch.path / name).string();
}

const std::string tiny = "--bits 16 --features 24 --steps 20 --crop 32 --measure 1 --measure-steps 20 ";

/// Images of 48 x 40, two pieces of each "photograph".
const std::string& photographs() {
  static const std::string path = [] {
    const std::string folder = at("photographs");
    fs::create_directories(folder);
    for (std::size_t i = 0; i < 8; ++i) {
      Buffer<float> pixels(3 * 40 * 48);
      const ImageView<float> view{pixels.data(), 3, 40, 48};
      dead_leaves_image(2, i, view);
      const std::string name = "/p" + std::to_string(i / 2) + "_" + std::to_string(i % 2) + ".png";
      REQUIRE(write_png(folder + name, ImageView<const float>(view)).ok());
    }
    return folder;
  }();
  return path;
}

}  // namespace

TEST_CASE("tool/pretrain: a tiny run on photographs writes a decoder that loads, and what was measured") {
  const Outcome run = pretrain(tiny + "--images " + photographs() + " --held-out 0.25 --out " + at("a.safetensors"));
  INFO(run.text);
  REQUIRE(run.code == 0);
  const auto file = read_safetensors(at("a.safetensors"));
  REQUIRE(file.ok());
  const auto decoder = StoredDecoder<>::read(*file);
  REQUIRE(decoder.ok());
  CHECK(decoder->bits() == 16);
  const nlohmann::json json = json_of(at("a.json"));
  CHECK(json["training_images"] == "6 photographs");  // both pieces of one of four are held out
  CHECK(json["measured_images"] == "2 photographs");
  CHECK(json["bit_accuracy"]["none"]["mean"].get<double>() > 0.8);  // chance is 0.5; 20 steps of embedding
  CHECK(json["psnr"].get<double>() > 38);
  CHECK(json["unmarked"]["images"] == 2);
  CHECK(json["decoder_sha256"].get<std::string>().size() == 64);
  CHECK(!fs::exists(at("a.safetensors.checkpoint")));
}

TEST_CASE("tool/pretrain: the same file for any number of threads and after an interruption, without any photographs") {
  const std::string run = "--bits 16 --features 24 --steps 300 --crop 32 --measure 1 --measure-steps 2 ";
  REQUIRE(pretrain(run + "--threads 1 --out " + at("one.safetensors")).code == 0);
  const std::vector<std::byte> one = file_bytes(at("one.safetensors"));
  REQUIRE(pretrain(run + "--threads 3 --out " + at("three.safetensors")).code == 0);
  CHECK(file_bytes(at("three.safetensors")) == one);
  REQUIRE(pretrain(run + "--seed 2 --out " + at("seed.safetensors")).code == 0);
  CHECK(file_bytes(at("seed.safetensors")) != one);

  const std::string killed = run + "--checkpoint-every 1 --out " + at("killed.safetensors");
  const Outcome stopped = pretrain(killed, "& pid=$!; while [ ! -f " + at("killed.safetensors.checkpoint") +
                                               " ]; do kill -0 $pid 2>/dev/null || break; sleep 0.01; done; "
                                               "kill -TERM $pid; wait $pid");
  INFO(stopped.text);
  if (stopped.code == 130) {
    CHECK(stopped.text.find("--resume") != std::string::npos);
    CHECK(!fs::exists(at("killed.safetensors")));
    check_refused(pretrain(killed), {"checkpoint", "--resume"});
    check_refused(pretrain(killed + " --resume --seed 3"), {"checkpoint", "identity"});
  } else {
    MESSAGE("the run was over before the signal came");
  }
  REQUIRE(pretrain(killed + " --resume").code == 0);
  CHECK(file_bytes(at("killed.safetensors")) == one);
}

TEST_CASE("tool/pretrain: Fourier features of colour as they are drawn, and the same file again") {
  const std::string drawn =
      "--bits 8 --fourier colour --steps 0 --crop 32 --measure 1 --measure-steps 2 --threads 1 --out " +
      at("colour.safetensors");
  REQUIRE(pretrain(drawn).code == 0);
  const std::vector<std::byte> one = file_bytes(at("colour.safetensors"));
  const auto file = read_safetensors(at("colour.safetensors"));
  REQUIRE(file.ok());
  const auto decoder = read_lattice(*file);
  REQUIRE(decoder.ok());
  CHECK(decoder->settings().measure == LatticeMeasure::colour);
  CHECK(decoder->settings().features == 8);  // one a bit
  CHECK(decoder->bits() == 8);
  REQUIRE(pretrain(drawn + " --force").code == 0);
  CHECK(file_bytes(at("colour.safetensors")) == one);
}

TEST_CASE("tool/pretrain: bad input is one error line, and nothing is overwritten") {
  const std::string kept = at("kept.safetensors");
  REQUIRE(write_file(kept, std::string_view("kept")).ok());
  const std::string out = " --out " + kept;
  fs::create_directories(at("empty"));
  check_refused(pretrain("--images " + at("empty") + out), {"empty", "no PNG or JPEG"});
  check_refused(pretrain("--images " + at("nowhere") + out), {"nowhere", "--images"});
  check_refused(pretrain("--images " + photographs() + out), {"p0_0.png", "48 x 40", "--crop"});
  check_refused(pretrain(tiny + "--images " + photographs() + " --held-out 0.99" + out), {"--held-out"});
  for (const char* share : {"0", "1", "-0.5", "nan"})
    check_refused(pretrain(tiny + "--held-out " + std::string(share) + out), {"--held-out", share});
  check_refused(pretrain(tiny + "--held-out " + at("empty") + out), {"--held-out", "empty"});
  check_refused(pretrain("--bits 0" + out), {"--bits", "1 to 128"});
  check_refused(pretrain("--bits 129" + out), {"--bits", "129"});
  check_refused(pretrain("--features 3" + out), {"--features"});
  check_refused(pretrain("--steps -1" + out), {"--steps"});
  CHECK(pretrain("--fourier texture" + out).code == 2);
  check_refused(pretrain(tiny + "--out " + at("no/such/folder/a.safetensors")), {"no/such/folder"});
  check_refused(pretrain(tiny + "--out " + at("empty")), {"empty", "is a folder"});
  check_refused(pretrain(tiny + "--json " + kept + out), {"--out"});
  fs::create_directories(at("broken"));
  REQUIRE(write_file(at("broken/x.png"), std::string_view("no image")).ok());
  check_refused(pretrain("--images " + at("broken") + out), {"x.png"});
  CHECK(fs::file_size(kept) == 4);
  CHECK(file_bytes(kept)[0] == std::byte{'k'});
  CHECK(!fs::exists(kept + ".partial"));
}

}  // namespace pretrain_test
