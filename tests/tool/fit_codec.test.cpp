// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark fit-codec: a small file of a model that was not trained for one.
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tool/running.hpp"

namespace fit_codec_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::block;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-fit-codec-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// The built-in scene, small, trained for no codec.
const nlohmann::json& results() {
  static const nlohmann::json instance = [] {
    done("scene --out " + at("scene") + " --width 96 --height 80 --train 12 --test 4");
    done("train --voxel-size 0.2 --effects none --iterations 300 --data " + at("scene") + " --out " + at("plain"));
    return json_of(at("plain/results.json"));
  }();
  return instance;
}
std::string plain() {
  static_cast<void>(results());
  return at("plain/model.safetensors");
}
std::string command(const std::string& out, const std::string& more = {}) {
  return "fit-codec --model " + plain() + " --data " + at("scene") +
         (more.find("--iterations") == std::string::npos ? " --iterations 200" : "") + " --out " + at(out) + " " + more;
}
/// Of the anchors and the rendering networks.
bool same_model(const std::string& a, const std::string& b) {
  for (const std::string name : {"anchor.position", "anchor.feature", "anchor.scaling", "anchor.offset"}) {
    if (block(a, name) != block(b, name)) return false;
  }
  for (const std::string head : {"mlp_opacity", "mlp_covariance", "mlp_color"}) {
    for (const char* part : {".0.weight", ".0.bias", ".2.weight", ".2.bias"}) {
      if (block(a, head + part) != block(b, head + part)) return false;
    }
  }
  return true;
}

}  // namespace

TEST_CASE("tool: fit-codec writes a small file of a plain model, which stays as it is") {
  for (const std::string codec : {"hac", "context_gs"}) {
    CAPTURE(codec);
    done(command(codec, "--codec " + codec));
    const nlohmann::json fitted = json_of(at(codec + "/results.json"));
    CHECK(fitted["recipe"] == codec + "+fitted");
    const nlohmann::json& compressed = fitted["compressed"];
    CHECK(compressed["codec"] == codec);
    MESSAGE(codec, ": ", compressed["bytes"].get<int>(), " bytes of ", fs::file_size(plain()), ", ",
            compressed["test"]["psnr"].get<double>(), " dB of ", results()["test"]["psnr"].get<double>());
    CHECK(compressed["bytes"].get<std::size_t>() * 5 < fs::file_size(plain()));
    CHECK(compressed["test"]["psnr"].get<double>() > results()["test"]["psnr"].get<double>() - 1);
    CHECK(same_model(plain(), at(codec + "/model.safetensors")));

    // The file is one as any other: it decodes by itself, and compress makes it again.
    done("decompress --model " + at(codec + "/model.cmk") + " --out " + at(codec + "_decoded.safetensors"));
    CHECK_FALSE(same_model(plain(), at(codec + "_decoded.safetensors")));  // rounded
    done("compress --model " + at(codec + "/model.safetensors") + " --out " + at(codec + "_again.cmk"));
    CHECK(testing::file_bytes(at(codec + "_again.cmk")) == testing::file_bytes(at(codec + "/model.cmk")));
    done("render --model " + at(codec + "/model.cmk") + " --out " + at(codec + "_images"));
  }
}

TEST_CASE("tool: fit-codec --touch-up trains the model on, and a run is not resumed as another one") {
  done(command("touched", "--touch-up --iterations 20"));
  CHECK_FALSE(same_model(plain(), at("touched/model.safetensors")));
  CHECK(block(plain(), "anchor.position") == block(at("touched/model.safetensors"), "anchor.position"));

  // A run that is killed and resumed writes the file of one that is not.
  const std::string run = "fit-codec --model " + plain() + " --data " + at("scene") + " --iterations 100";
  testing::killed(run, at("stopped"));
  done("attack --model " + plain() + " --int8 tensor --keep-positions --out " + at("edited.safetensors"));
  check_refused(tool("fit-codec --model " + at("edited.safetensors") + " --data " + at("scene") +
                     " --iterations 100 --resume --out " + at("stopped")),
                {"the model that was begun from"});
  done(run + " --resume --out " + at("stopped"));
  done(run + " --threads 1 --out " + at("whole"));
  CHECK(testing::file_bytes(at("stopped/model.cmk")) == testing::file_bytes(at("whole/model.cmk")));
}

TEST_CASE("tool: fit-codec takes the loss on alpha as one of training alone") {
  static_cast<void>(plain());
  done("train --recipe scaffold+alpha --iterations 20 --data " + at("scene") + " --out " + at("alpha"));
  done("fit-codec --model " + at("alpha/model.safetensors") + " --data " + at("scene") + " --iterations 20 --out " +
       at("alpha_fitted"));
  CHECK(json_of(at("alpha_fitted/results.json"))["recipe"] == "hac+fitted");
}

TEST_CASE("tool: a model for fit-codec is trained without the effects that it does not know") {
  static_cast<void>(plain());
  const std::string train = "train --voxel-size 0.2 --iterations 20 --data " + at("scene") + " --out ";
  const testing::Outcome filtered = tool(train + at("filtered") + " --effects anti_aliasing --for-fit-codec");
  INFO(filtered.text);
  REQUIRE(filtered.code == 0);
  CHECK(filtered.text.find("anti_aliasing is left out") != std::string::npos);
  CHECK(json_of(at("filtered/results.json"))["recipe"] == "scaffold");
  done("fit-codec --model " + at("filtered/model.safetensors") + " --data " + at("scene") + " --iterations 20 --out " +
       at("filtered_fitted"));
  // Those that it knows stay; and without the word the others do, which is what it refuses.
  done(train + at("exposed_for_codec") + " --effects exposure --for-fit-codec");
  CHECK(json_of(at("exposed_for_codec/results.json"))["recipe"] == "scaffold+exposure");
  done(train + at("unfiltered") + " --effects anti_aliasing");
  check_refused(tool("fit-codec --model " + at("unfiltered/model.safetensors") + " --data " + at("scene") +
                     " --iterations 20 --out " + at("nothing")),
                {"antialiasing"});
  check_refused(tool(train + at("nothing") + " --codec hac --for-fit-codec"), {"--for-fit-codec"});
  check_refused(tool(train + at("nothing") + " --recipe scaffold+antialiasing --for-fit-codec"),
                {"--for-fit-codec", "scaffold+antialiasing"});
}

TEST_CASE("tool: fit-codec keeps the exposures of a model that has them, and a mark is hidden in it without them") {
  static_cast<void>(plain());
  const std::string data = " --data " + at("scene"), plain = at("exposed/model.safetensors"),
                    fitted = at("exposed_fitted/model.safetensors");
  done("train --recipe scaffold+exposure --voxel-size 0.2 --iterations 60" + data + " --out " + at("exposed"));
  REQUIRE(write_key(at("exposed.key"), testing::fixed_key(1, 24)).ok());
  const std::string decoder = at("colours.safetensors");
  REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_colours(24), "a test", fs::path(decoder)).ok());
  for (const std::string codec : {"context_gs", "hac"}) {
    done("fit-codec --codec " + codec + " --model " + plain + data + " --iterations 20 --force --out " +
         at("exposed_fitted"));
    CHECK(json_of(at("exposed_fitted/results.json"))["recipe"] == codec + "+fitted+exposure");
    CHECK(same_model(plain, fitted));
    CHECK(block(plain, "exposure") == block(fitted, "exposure"));
    done("embed --iterations 20 --model " + fitted + data + " --key " + at("exposed.key") + " --decoder " + decoder +
         " --out " + at(codec + "_exposed_marked"));
    CHECK(json_of(at(codec + "_exposed_marked/results.json"))["recipe"] == codec + "+fitted");
    CHECK(testing::file_bytes(at(codec + "_exposed_marked/unmarked.cmk")) ==
          testing::file_bytes(at("exposed_fitted/model.cmk")));
  }
  done("fit-codec --touch-up --model " + plain + data + " --iterations 20 --out " + at("exposed_touched"));
  CHECK(block(plain, "exposure") != block(at("exposed_touched/model.safetensors"), "exposure"));
}

TEST_CASE("tool: a message is hidden in a model that a codec was fitted to, as its file is read") {
  REQUIRE(write_key(at("owner.key"), testing::fixed_key(1, 24)).ok());
  REQUIRE(write_key(at("other.key"), testing::fixed_key(2, 24)).ok());
  const std::string data = " --data " + at("scene"), decoder = at("of_fitted.safetensors");
  for (const std::string codec : {"hac", "context_gs"}) {
    CAPTURE(codec);
    const std::string plain = at(codec + "_unmarked"), model = plain + "/model.safetensors",
                      out = at(codec + "_marked");
    done(command(codec + "_unmarked", "--codec " + codec));
    done("fit --force --bits 24 --features 72 --views 200 --gradient-views 6" + data + " --model " + model + " --out " +
         decoder);
    done("embed --iterations 600 --fidelity 60 --message-rate 0.01 --model " + model + data + " --key " +
         at("owner.key") + " --decoder " + decoder + " --out " + out);
    const nlohmann::json results = json_of(out + "/results.json"), &compressed = results["compressed"];
    MESSAGE(codec, ": ", compressed["bit_accuracy"].dump(), " of the file, ", results["bit_accuracy"].dump(),
            " of the model, cost ", compressed["psnr_cost_vs_unmarked"].dump(), " dB, ", compressed["bytes"].dump(),
            " bytes of ", fs::file_size(plain + "/model.cmk"));
    CHECK(results["recipe"] == codec + "+fitted");
    CHECK(testing::file_bytes(out + "/unmarked.cmk") == testing::file_bytes(plain + "/model.cmk"));
    CHECK(compressed["bytes"].get<double>() < 1.1 * static_cast<double>(fs::file_size(plain + "/model.cmk")));
    const auto verdict = [&](const std::string& file, const std::string& key) {
      return tool("verify --alpha 1e-3 --split all --model " + file + " --key " + at(key) + " --decoder " + decoder +
                  testing::claimed(at(key), decoder))
          .code;
    };
    CHECK(verdict(out + "/model.cmk", "owner.key") == 0);
    const auto not_found = [&](int code) { return code == 1 || code == 3; };  // not detected, or inconclusive
    CHECK(not_found(verdict(out + "/model.cmk", "other.key")));               // negative controls
    CHECK(not_found(verdict(out + "/unmarked.cmk", "owner.key")));
    // The mark is in the features alone.
    CHECK(block(model, "anchor.offset") == block(out + "/model.safetensors", "anchor.offset"));
    CHECK(block(model, "anchor.feature") != block(out + "/model.safetensors", "anchor.feature"));
  }
}

TEST_CASE("tool: fit-codec says what is read of a mark before and after, which it does not train for") {
  REQUIRE(write_key(at("plain.key"), testing::fixed_key(1, 24)).ok());
  const std::string data = " --data " + at("scene"), decoder = at("of_plain.safetensors"),
                    mark = " --key " + at("plain.key") + " --decoder " + decoder;
  done("fit --tone 0 --bits 24 --features 72 --views 200 --gradient-views 6 --model " + plain() + data + " --out " +
       decoder);
  done("embed --iterations 1200 --fidelity 100 --message-rate 0.01 --model " + plain() + data + mark + " --out " +
       at("marked_plain"));
  const std::string marked = at("marked_plain/model.safetensors"),
                    fit = "fit-codec --iterations 200 --model " + marked + data;
  check_refused(tool(fit + " --out " + at("unread") + " --decoder " + decoder), {"--key", "missing"});
  CHECK_FALSE(fs::exists(at("unread")));
  done(fit + mark + " --unmarked " + plain() + " --out " + at("read"));
  done(fit + " --out " + at("unread"));
  // Reading changes nothing of what is fitted.
  CHECK(testing::file_bytes(at("read/model.cmk")) == testing::file_bytes(at("unread/model.cmk")));
  CHECK(same_model(marked, at("read/model.safetensors")));
  const nlohmann::json before = json_of(at("marked_plain/results.json")), read = json_of(at("read/results.json"));
  MESSAGE("bits of the model ", read["bit_accuracy"].dump(), ", of its file ",
          read["compressed"]["bit_accuracy"].dump());
  CHECK(read["rate_lambda"] == 0.001);
  CHECK(read["bit_accuracy"] == before["bit_accuracy"]);
  CHECK(read["psnr_cost_vs_unmarked"] == before["psnr_cost_vs_unmarked"]);
  CHECK(read["bit_accuracy"]["mean"].get<double>() > 0.8);
  // What the file says is what verify reads from it.
  static_cast<void>(tool("verify --model " + at("read/model.cmk") + mark + " --json " + at("of_file.json")));
  CHECK(json_of(at("of_file.json"))["bit_accuracy"] == read["compressed"]["bit_accuracy"]);
  // The file has what the model has lost, and its own rounding, of which the fit of the networks takes some back: .83 dB
  // in the file and .86 in the model were measured.
  CHECK(std::abs(read["compressed"]["psnr_cost_vs_unmarked"].get<double>() -
                 read["psnr_cost_vs_unmarked"].get<double>()) < 0.2);
  CHECK_FALSE(json_of(at("unread/results.json")).contains("bit_accuracy"));
}

TEST_CASE("tool: what no codec can be fitted to is refused in one line") {
  done(command("short", "--iterations 20"));
  check_refused(
      tool("fit-codec --model " + at("short/model.safetensors") + " --data " + at("scene") + " --out " + at("twice")),
      {"hac+fitted", "compmark compress"});
  check_refused(tool("fit-codec --model " + at("short/model.cmk") + " --data " + at("scene") + " --out " + at("twice")),
                {"compressed already"});
  check_refused(tool("fit-codec --model " + plain() + " --data " + at("scene") + " --out " + at("plain")),
                {"--out", "would be overwritten"});
  check_refused(tool("fit-codec --model " + plain() + " --data " + at("scene") + " --downscale 2 --out " + at("twice")),
                {"--downscale"});
  done("train --recipe compmark-host --iterations 20 --data " + at("scene") + " --out " + at("other"));
  check_refused(
      tool("fit-codec --model " + at("other/model.safetensors") + " --data " + at("scene") + " --out " + at("twice")),
      {"compmark-host", "compmark train --codec"});
  done("attack --model " + plain() + " --int8 channel --out " + at("off_grid.safetensors"));
  CHECK(done("fit-codec --iterations 10 --model " + at("off_grid.safetensors") + " --data " + at("scene") + " --out " +
             at("off_grid"))
            .text.find("lay off the grid") != std::string::npos);  // no reason to refuse it: they are moved there
  check_refused(tool("train --recipe hac+fitted --data " + at("scene") + " --out " + at("twice")), {"fit-codec"});
  CHECK_FALSE(fs::exists(at("twice/model.cmk")));
  CHECK_FALSE(fs::exists(at("twice/model.safetensors")));
}

}  // namespace fit_codec_test
