// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message in a scene, from the key to the proof, as an owner meets it: train with a key, embed into a finished model, and the verdicts on
// marked, unmarked and foreign models; the same bits at any thread count and after a stop; bad input.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <compmark/core/random.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tool/running.hpp"

namespace watermark_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::json_of;
using testing::Outcome;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-watermark-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// The built-in scene, small; a key of 24 bits, another, and a decoder that nobody trained: seconds must do.
struct Setting {
  std::string scene = at("scene"), key = at("owner.key"), other = at("other.key"), decoder = at("lattice.safetensors"),
              colours = at("colours.safetensors");
  Setting() {
    REQUIRE(tool("scene --out " + scene + " --width 96 --height 80 --train 12 --test 4").code == 0);
    // Fixed keys: whether a decoder that nobody whitened can carry a message in seconds depends on the message.
    for (const auto& [path, number] : {std::pair(&key, 1), std::pair(&other, 2)}) {
      REQUIRE(write_key(*path, testing::fixed_key(number, 24)).ok());
    }
    REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_lattice(24, 64, 2), "a test", fs::path(decoder)).ok());
    REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_colours(24), "a test", fs::path(colours)).ok());
  }
  [[nodiscard]] std::string mark() const { return " --key " + key + " --decoder " + decoder; }
};
const Setting& setting() {
  static const Setting instance;
  return instance;
}

/// Trains on the scene, with a few hundred anchors unless told otherwise: seconds must do; returns results.json.
nlohmann::json train(const std::string& out, const std::string& options, int iterations = 600) {
  const Outcome outcome = tool(
      "train --effects none --iterations " + std::to_string(iterations) + " --data " + setting().scene + " --out " +
      at(out) + (options.find("--voxel-size") == std::string::npos ? " --voxel-size 0.2 " : " ") + options);
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  // One thing comes next. Of a model that was trained on the way it is only told that it is kept.
  CHECK(testing::times_in(outcome.text, "next: compmark ") == 1);
  CHECK(testing::times_in(outcome.text, "kept for you alone: " + at(out) + "/unmarked\n") ==
        (fs::exists(at(out) + "/unmarked/results.json") ? 1u : 0u));
  return json_of(at(out) + "/results.json");
}
const nlohmann::json& unmarked() {
  static const nlohmann::json results = train("unmarked", "");
  return results;
}
/// Of all views, the training views among them: a few hundred iterations on a dozen small pictures do not carry a message to other places.
int verdict(const std::string& model, const std::string& key, const std::string& more = "--split all",
            const std::string& decoder = setting().decoder, const std::string& claims = {}) {
  const Outcome outcome = tool("verify --alpha 1e-3 --model " + at(model) + "/model.safetensors --key " + key +
                               " --decoder " + decoder + " " + more + testing::claimed(key, decoder, claims));
  const std::size_t line = outcome.text.find("matches ");
  if (line != std::string::npos) MESSAGE(model, ": ", outcome.text.substr(line, outcome.text.find('\n', line) - line));
  return outcome.code;
}

bool not_detected(int code) { return code == 1 || code == 3; }

}  // namespace

TEST_CASE(
    "tool: a key's message is hidden while a scene is trained, and proven from its renders; another key's is not") {
  const nlohmann::json plain = unmarked();
  CHECK_FALSE(plain.contains("bit_accuracy"));
  const nlohmann::json marked =
      train("marked", setting().mark() + " --message-weight 0.06 --unmarked " + at("unmarked/model.safetensors"));
  MESSAGE(marked["bit_accuracy"].dump(), " p ", marked["p_value"].dump(), " cost ",
          marked["psnr_cost_vs_unmarked"].dump(), " dB, ", marked["psnr_marked_vs_unmarked"].dump(), " dB");
  CHECK(marked["recipe"] == "scaffold");
  CHECK(marked["bit_accuracy"]["views"] == 4);
  CHECK(marked["psnr_cost_vs_unmarked"].get<double>() ==
        doctest::Approx(plain["test"]["psnr"].get<double>() - marked["test"]["psnr"].get<double>()).epsilon(1e-9));
  CHECK(marked["psnr_marked_vs_unmarked"].get<double>() > 20);

  CHECK(verdict("marked", setting().key) == 0);
  CHECK(not_detected(verdict("marked", setting().other)));  // negative controls
  CHECK(not_detected(verdict("unmarked", setting().key)));
  // What verify reads from the file's test views is what the training said.
  CHECK(verdict("marked", setting().key, "--split test --json " + at("report.json")) != 2);
  CHECK(json_of(at("report.json"))["p_value"] == marked["p_value"]);
  CHECK(json_of(at("marked/verification.json"))["model"]["sha256"] == marked["model_sha256"]);

  // evaluate says the same of the files, and of the counterpart beside it.
  const std::string evaluate = "evaluate --model " + at("marked/model.safetensors") + " --data " + setting().scene,
                    counterpart = " --unmarked " + at("unmarked/model.safetensors");
  const Outcome outcome = tool(evaluate + counterpart + setting().mark() + " --json " + at("evaluate.json") +
                               " --csv " + at("evaluate.csv") + " --html " + at("evaluate.html"));
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  const nlohmann::json found = json_of(at("evaluate.json"));
  CHECK(found["psnr"].get<double>() == doctest::Approx(marked["test"]["psnr"].get<double>()).epsilon(1e-12));
  CHECK(found["p_value"] == marked["p_value"]);
  CHECK(found["bit_accuracy"] == marked["bit_accuracy"]);
  CHECK(found["psnr_cost_vs_unmarked"].get<double>() ==
        doctest::Approx(marked["psnr_cost_vs_unmarked"].get<double>()).epsilon(1e-9));
  CHECK(found["psnr_vs_unmarked"].get<double>() ==
        doctest::Approx(marked["psnr_marked_vs_unmarked"].get<double>()).epsilon(1e-9));
  REQUIRE(found["models"].size() == 2);
  CHECK(found["models"][1]["unmarked"] == true);
  CHECK(found["models"][1]["psnr"].get<double>() ==
        doctest::Approx(plain["test"]["psnr"].get<double>()).epsilon(1e-12));
  CHECK_FALSE(found["models"][1].contains("psnr_vs_unmarked"));
  const std::string csv = testing::text_of(at("evaluate.csv"));
  CHECK(std::count(csv.begin(), csv.end(), '\n') == 1 + 2 * (4 + 1));  // a line a view, and one of all
  const std::string page = testing::text_of(at("evaluate.html"));
  for (const char* part : {"<h2>Message</h2>", "<svg", "data:image/png", "against unmarked"}) {
    INFO(part);
    CHECK(page.find(part) != std::string::npos);
  }
  // Where pixels do not count the error is none, and the message is read all the same: nobody who renders has the photograph.
  fs::copy(setting().scene, at("masked"), fs::copy_options::recursive);
  nlohmann::json frames = json_of(at("masked/transforms_test.json"));
  for (nlohmann::json& frame : frames["frames"]) frame["mask_path"] = "mask.png";
  REQUIRE(write_json(at("masked/transforms_test.json"), frames).ok());
  ImageBytes mask{96, 80, 1, std::vector<std::uint8_t>(96 * 80)};
  for (std::size_t i = 0; i < mask.pixels.size(); ++i) mask.pixels[i] = i % 96 < 48 ? 255 : 0;
  REQUIRE(write_png(at("masked/mask.png"), mask).ok());
  REQUIRE(tool("evaluate --model " + at("marked/model.safetensors") + " --data " + at("masked") + counterpart +
               setting().mark() + " --json " + at("masked.json"))
              .code == 0);
  const nlohmann::json masked = json_of(at("masked.json"));
  CHECK(masked["psnr"] != found["psnr"]);
  CHECK(masked["bit_accuracy"] == found["bit_accuracy"]);
  CHECK(masked["psnr_vs_unmarked"] == found["psnr_vs_unmarked"]);

  const Outcome by_default =
      tool(evaluate + " --key " + setting().key);  // the one for every scene, which did not mark it
  CHECK(by_default.code == 0);
  CHECK(by_default.text.find("is not the decoder of this key's mark") != std::string::npos);
  check_refused(tool(evaluate + counterpart + " --json " + at("unmarked/model.safetensors")), {"--json"});
  check_refused(tool(evaluate + " --json " + at("same.txt") + " --csv " + at("same.txt")), {"same.txt"});
  CHECK_FALSE(fs::exists(at("same.txt")));
}

TEST_CASE("tool: embed marks a finished model and leaves the file it read as it was") {
  // Of some hundred anchors, which are enough for a decoder that is fitted to them, one that asks for colours reads 17 of 24 bits.
  const nlohmann::json dense = train("dense", "--voxel-size 0.001");
  const std::string before = dense["model_sha256"];
  const Outcome outcome = tool("embed --iterations 800 --fidelity 100 --message-rate 0.006 --model " +
                               at("dense/model.safetensors") + " --data " + setting().scene + " --out " +
                               at("embedded") + " --key " + setting().key + " --decoder " + setting().colours);
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  const nlohmann::json results = json_of(at("embedded/results.json"));
  MESSAGE(results["bit_accuracy"].dump(), " p ", results["p_value"].dump(), " cost ",
          results["psnr_cost_vs_unmarked"].dump(), " dB, ", results["psnr_marked_vs_unmarked"].dump(), " dB");
  CHECK(results["anchors"] == dense["anchors"]);
  CHECK(results["psnr_marked_vs_unmarked"].get<double>() > 20);
  CHECK(verdict("embedded", setting().key, "--split all", setting().colours) == 0);
  CHECK(not_detected(verdict("embedded", setting().other, "--split all", setting().colours)));  // negative controls
  CHECK(not_detected(verdict("dense", setting().key, "--split all", setting().colours)));
  CHECK(results["psnr_cost_vs_unmarked"].get<double>() < 1);  // measured 0.31 dB
  const std::string by_method = "embed --model " + at("dense/model.safetensors") + " --data " + setting().scene +
                                " --out " + at("by_method") + " --key " + setting().key + " --method ";
  check_refused(tool(by_method + "watref"),
                {"--method", "\"watref\" is none of compmark, waterf, guardsplat, gaussianmarker, 3dgsw",
                 "did you mean waterf?"});
  check_refused(tool(by_method + "banana"), {"--method", "\"banana\"", "give one of them"});
  // The published way, which trains on from the model, is still there.
  const Outcome published = tool("embed --iterations 20 --fidelity 0 --model " + at("dense/model.safetensors") +
                                 " --data " + setting().scene + " --out " + at("touched") + setting().mark());
  INFO(published.text);
  CHECK(published.code == 0);
  const Result<SafetensorsFile> plain = read_safetensors(at("dense/model.safetensors")),
                                beside = read_safetensors(at("embedded/model.safetensors")),
                                touched = read_safetensors(at("touched/model.safetensors"));
  REQUIRE((plain.ok() && beside.ok() && touched.ok()));
  for (const char* name : {"anchor.offset", "anchor.scaling", "mlp_color.0.weight"}) {
    CAPTURE(name);
    CHECK(*beside->values<float>(name) == *plain->values<float>(name));
    CHECK(*touched->values<float>(name) != *plain->values<float>(name));
  }
  CHECK(*beside->values<float>("anchor.feature") != *plain->values<float>("anchor.feature"));
  CHECK(json_of(at("dense/results.json"))["model_sha256"] == before);
  CHECK(tool("info " + at("dense/model.safetensors")).text.find(before) != std::string::npos);
}

TEST_CASE("tool: a model that was trained with exposures is marked as what its renders are, one without") {
  const std::string exposed = at("exposed/model.safetensors"), decoder = at("exposed-decoder.safetensors");
  const Outcome trained = tool("train --effects exposure --iterations 60 --voxel-size 0.2 --data " + setting().scene +
                               " --out " + at("exposed"));
  INFO(trained.text);
  REQUIRE(trained.code == 0);
  REQUIRE(json_of(at("exposed/results.json"))["recipe"] == "scaffold+exposure");
  REQUIRE(tool("fit --bits 24 --features 48 --views 60 --gradient-views 2 --data " + setting().scene + " --model " +
               exposed + " --out " + decoder)
              .code == 0);
  const std::string embed = "embed --iterations 20 --model " + exposed + " --data " + setting().scene + " --key " +
                            setting().key + " --decoder " + decoder + " --out ";
  const Outcome marked = tool(embed + at("exposed-marked"));
  INFO(marked.text);
  REQUIRE(marked.code == 0);
  CHECK(marked.text.find("exposures of the photographs stay in the unmarked model") != std::string::npos);
  const nlohmann::json results = json_of(at("exposed-marked/results.json"));
  CHECK(results["recipe"] == "scaffold");
  CHECK(results["psnr_marked_vs_unmarked"].get<double>() >
        30);  // the counterpart is the model with exposures: its renders are compared
  const Result<SafetensorsFile> plain = read_safetensors(exposed),
                                beside = read_safetensors(at("exposed-marked/model.safetensors"));
  REQUIRE((plain.ok() && beside.ok()));
  const auto exposures = [](const SafetensorsFile& file) {
    return std::count_if(file.tensors.begin(), file.tensors.end(),
                         [](const auto& tensor) { return tensor.first.find("exposure") != std::string::npos; });
  };
  CHECK(exposures(*plain) > 0);
  CHECK(exposures(*beside) == 0);
  for (const char* name : {"anchor.position", "anchor.scaling", "mlp_color.0.weight"}) {
    CAPTURE(name);
    CHECK(*beside->values<float>(name) == *plain->values<float>(name));
  }
  CHECK(*beside->values<float>("anchor.feature") != *plain->values<float>("anchor.feature"));
  // In the loss of the photographs they would have to train on, which no recipe with a message does.
  check_refused(tool(embed + at("exposed-loss") + " --fidelity 0"), {"scaffold+exposure"});
}

TEST_CASE("tool: a model for a codec that was trained with exposures is marked in its file, as one without") {
  const std::string exposed = at("exposed-hac/model.safetensors"), decoder = at("exposed-hac-decoder.safetensors");
  const Outcome trained =
      tool("train --codec hac --lambda 0.004 --effects exposure --iterations 60 --voxel-size 0.2 --data " +
           setting().scene + " --out " + at("exposed-hac"));
  INFO(trained.text);
  REQUIRE(trained.code == 0);
  REQUIRE(json_of(at("exposed-hac/results.json"))["recipe"] == "hac+exposure");
  testing::done("fit --bits 24 --features 48 --views 60 --gradient-views 2 --data " + setting().scene + " --model " +
                exposed + " --out " + decoder);
  const std::string out = at("exposed-hac-marked");
  const Outcome marked = tool("embed --iterations 20 --model " + exposed + " --data " + setting().scene + " --key " +
                              setting().key + " --decoder " + decoder + " --out " + out);
  INFO(marked.text);
  REQUIRE(marked.code == 0);
  const nlohmann::json results = json_of(out + "/results.json");
  CHECK(results["recipe"] == "hac");
  CHECK(json_of(at("exposed-hac/results.json"))["rate_lambda"] == 0.004);
  CHECK_FALSE(
      results.contains("rate_lambda"));  // no bit is a loss of the mark: a default is not the unmarked model's lambda
  // The counterpart is the file of the model with exposures: their renders are compared.
  CHECK(results["compressed"]["psnr_marked_vs_unmarked"].get<double>() > 30);
  const Result<SafetensorsFile> plain = read_safetensors(exposed),
                                beside = read_safetensors(out + "/model.safetensors");
  REQUIRE((plain.ok() && beside.ok()));
  CHECK(*beside->values<float>("anchor.position") == *plain->values<float>("anchor.position"));
  CHECK(*beside->values<float>("anchor.feature") != *plain->values<float>("anchor.feature"));
  for (const char* name : {"/unmarked.cmk", "/model.cmk"}) {
    CAPTURE(name);
    const Outcome read = tool("extract --model " + out + name + " --decoder " + decoder);
    INFO(read.text);
    CHECK(read.code == 0);
  }
}

TEST_CASE(
    "tool: what one region says is limited in views that are large enough, as much as was asked for, and read in as "
    "many lights") {
  // 128 x 96 positions, so two regions of 5,000; the scene of the other cases has 96 x 80, which is too small for a limit.
  const std::string scene = at("large"), model = at("large-run/model.safetensors");
  testing::done("scene --width 128 --height 96 --train 6 --test 2 --out " + scene);
  testing::done("train --effects none --iterations 60 --voxel-size 0.3 --data " + scene + " --out " + at("large-run"));
  const std::string fit = "fit --bits 12 --features 30 --views 60 --gradient-views 2 --stride 1";
  const auto fitted = [&](const std::string& data, const std::string& of, const std::string& name,
                          const std::string& more) {
    testing::done(fit + " --data " + data + " --model " + of + " --out " + at(name) + ".safetensors" + more);
    return json_of(at(name) + ".json");
  };
  const nlohmann::json once = fitted(scene, model, "limit-once", " --region-limit 1"),
                       thrice = fitted(scene, model, "limit-thrice", " --region-limit 3"),
                       none = fitted(scene, model, "limit-none", " --region-limit 0");
  CHECK(once["regions"] == 2);
  CHECK(once["region_limit"].get<double>() > 0);
  CHECK(thrice["region_limit"].get<double>() == doctest::Approx(3 * once["region_limit"].get<double>()));
  // Of a limit of one median every other view is held back, of three fewer; of none there is nothing to hold.
  CHECK(once["held_back"].get<double>() == doctest::Approx(0.5).epsilon(0.02));
  CHECK(thrice["held_back"].get<double>() < once["held_back"].get<double>());
  CHECK(none["region_limit"] == 0);
  CHECK(none["held_back"] == 0);
  static_cast<void>(unmarked());
  CHECK(fitted(setting().scene, at("unmarked/model.safetensors"), "limit-small", "")["region_limit"] == 0);
  // In many lights by default; in one: another decoder, which says so.
  const nlohmann::json light = fitted(scene, model, "limit-light", " --region-limit 1 --tone 0");
  CHECK(light["tone"] == 0);
  CHECK(once["tone"] == 0.01);
  CHECK(light["decoder_sha256"] != once["decoder_sha256"]);
  // Out of its range it is the parser that refuses it, by name.
  const Outcome far = tool(fit + " --data " + scene + " --model " + model + " --out " + at("no-limit.safetensors") +
                           " --region-limit 101");
  CHECK(far.code != 0);
  CHECK(far.text.find("--region-limit") != std::string::npos);
  CHECK_FALSE(fs::exists(at("no-limit.safetensors")));
}

TEST_CASE("tool: a decoder is fitted to an unmarked scene, and a message hidden for it is proven") {
  static_cast<void>(unmarked());
  const std::string scene = "fit --bits 24 --data " + setting().scene + " --model " + at("unmarked/model.safetensors");
  const std::string fit = scene + " --features 72 --views 200 --gradient-views 6 --out ";
  const std::string fitted = at("fitted.safetensors");
  const Outcome made = tool(fit + fitted + " --threads 1");
  INFO(made.text);
  REQUIRE(made.code == 0);
  const nlohmann::json found = json_of(at("fitted.json"));
  CHECK(found["bits"] == 24);
  CHECK(found["model_sha256"] == unmarked()["model_sha256"]);
  CHECK(found["agreement"].get<double>() > found["wave_agreement"].get<double>());
  CHECK(found["noise_ratio"].get<double>() < 1);
  // The same file at any number of threads, another of another seed.
  REQUIRE(tool(fit + at("fitted-3.safetensors") + " --threads 3").code == 0);
  CHECK(json_of(at("fitted-3.json"))["decoder_sha256"] == found["decoder_sha256"]);
  REQUIRE(tool(fit + at("fitted-seed.safetensors") + " --seed 5").code == 0);
  CHECK(json_of(at("fitted-seed.json"))["decoder_sha256"] != found["decoder_sha256"]);

  const Outcome outcome = tool("embed --iterations 600 --fidelity 300 --message-rate 0.004 --model " +
                               at("unmarked/model.safetensors") + " --data " + setting().scene + " --out " +
                               at("fit-embedded") + " --key " + setting().key + " --decoder " + fitted);
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  const nlohmann::json results = json_of(at("fit-embedded/results.json"));
  MESSAGE(results["bit_accuracy"].dump(), " p ", results["p_value"].dump(), " cost ",
          results["psnr_cost_vs_unmarked"].dump(), " dB, ", results["psnr_marked_vs_unmarked"].dump(), " dB");
  CHECK(results["psnr_marked_vs_unmarked"].get<double>() > 30);
  CHECK(verdict("fit-embedded", setting().key, "--split all --json " + at("all.json"), fitted) == 0);
  CHECK(not_detected(verdict("fit-embedded", setting().other, "--split all", fitted)));  // negative controls
  CHECK(not_detected(verdict("unmarked", setting().key, "--split all", fitted)));

  // The defaults with a fitted decoder, said aloud: a run that was stopped goes on with them, and with no others.
  const std::string defaults = "embed --iterations 100 --data " + setting().scene + " --key " + setting().key +
                               " --decoder " + fitted + " --model " + at("unmarked/model.safetensors");
  testing::killed(defaults, at("fit-stopped"));
  const std::string go_on = defaults + " --resume --out " + at("fit-stopped") + " --message-rate 0.006 --fidelity 3000";
  check_refused(tool(go_on + " --message-power 1"), {"checkpoint.safetensors"});
  CHECK(tool(go_on + " --message-power 2").code == 0);

  // Whoever has the unmarked model can take away what the scene says by itself: no key gains by it but the one that is there.
  const std::string less = " --unmarked " + at("unmarked/model.safetensors");
  CHECK(verdict("fit-embedded", setting().key, "--split all --json " + at("less.json") + less, fitted, less) == 0);
  // … where the claim names the unmarked model: another one could have been made for this message.
  CHECK(verdict("fit-embedded", setting().key, "--split all --json " + at("unclaimed.json") + less, fitted) == 3);
  CHECK(json_of(at("unclaimed.json"))["verdict"] == "detected");
  CHECK(json_of(at("unclaimed.json"))["proof"]["reason"].get<std::string>().find("what is subtracted") == 0);
  CHECK(json_of(at("less.json"))["unmarked"]["sha256"] == unmarked()["model_sha256"]);
  const double informed = json_of(at("less.json"))["bit_accuracy"]["mean"].get<double>(),
               blind = json_of(at("all.json"))["bit_accuracy"]["mean"].get<double>();
  MESSAGE("of all views ", blind, " of the bits, informed ", informed);
  // A bit that the scene says by itself needs less of a mark, so that some go with what the scene says: .021 of them here.
  CHECK(informed > blind - 0.03);
  CHECK(not_detected(verdict("fit-embedded", setting().other, "--split all" + less, fitted, less)));
  CHECK(not_detected(verdict("unmarked", setting().key, "--split all" + less, fitted, less)));  // nothing is left of it
  check_refused(tool("verify --model " + at("fit-embedded/model.safetensors") + " --key " + setting().key +
                     " --decoder " + fitted + " --unmarked " + at("nowhere.safetensors")),
                {"nowhere.safetensors"});

  check_refused(tool(fit + at("unmarked/model.safetensors")), {"--out", "model.safetensors"});
  check_refused(tool(fit + at("no.safetensors") + " --json " + at("unmarked/model.safetensors")),
                {"--json", "model.safetensors"});
  check_refused(tool(fit + at("no.safetensors") + " --downscale 2"), {"model.safetensors", "--downscale"});
  check_refused(tool(scene + " --features 23 --out " + at("no.safetensors")), {"--features", "--bits"});
  for (const char* number : {"--period", "--tone", "--edit-weight", "--region-limit"}) {
    CAPTURE(number);
    check_refused(tool(scene + " --out " + at("no.safetensors") + " " + number + " nan"), {number, "not a number"});
  }
  check_refused(tool(scene + " --views 70 --out " + at("no.safetensors")), {"--views", "--features"});
  check_refused(tool(scene + " --features 72 --coordinates 60 --out " + at("no.safetensors")),
                {"--coordinates", "--bits"});
  check_refused(tool("fit --data " + setting().scene + " --model " + at("nowhere.safetensors") + " --out " +
                     at("no.safetensors")),
                {"nowhere.safetensors"});
  check_refused(tool("fit --data " + at("nowhere") + " --model " + at("unmarked/model.safetensors") + " --out " +
                     at("no.safetensors")),
                {"nowhere"});
  CHECK_FALSE(fs::exists(at("no.safetensors")));
}

TEST_CASE(
    "tool: train with a key alone: a decoder is fitted to the finished scene, which is marked beside what it was") {
  // 16 bits: a decoder of 24 takes twice as long to fit.
  const std::string key = at("owner16.key"), other = at("other16.key");
  REQUIRE(write_key(key, testing::fixed_key(1, 16)).ok());
  REQUIRE(write_key(other, testing::fixed_key(2, 16)).ok());
  const std::string run =
      "train --voxel-size 0.2 --effects none --iterations 600 --mark-iterations 400 --fidelity 300 --message-rate "
      "0.004 --period 0.12 --tone 0.005 --data " +
      setting().scene + " --key " + key + " --decoder fit --out " + at("whole");
  // A signal that meets the fit ends it at once: there is nothing to save, and no flag is looked at before the decoder would be written.
  const Outcome ended =
      tool(run + " 2>&1 & pid=$!; while [ ! -f " + at("whole/unmarked/results.json") +
           " ]; do kill -0 $pid 2>/dev/null || break; sleep 0.01; done; kill -TERM $pid; wait $pid; echo code $? #");
  INFO(ended.text);
  CHECK(ended.text.find("code 143") != std::string::npos);
  CHECK_FALSE(fs::exists(at("whole/decoder.safetensors")));
  const fs::file_time_type trained = fs::last_write_time(at("whole/unmarked/model.safetensors"));
  const Outcome outcome = tool(run + " --resume");
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  // One thing comes next: nothing is told of the unmarked model but that it is kept.
  CHECK(testing::times_in(outcome.text, "next: compmark export --model ") == 1);
  CHECK(outcome.text.find("next: compmark export --model " + at("whole/model.safetensors")) != std::string::npos);
  const nlohmann::json results = json_of(at("whole/results.json"));
  MESSAGE(results["bit_accuracy"].dump(), " p ", results["p_value"].dump(), " cost ",
          results["psnr_cost_vs_unmarked"].dump(), " dB, ", results["psnr_marked_vs_unmarked"].dump(), " dB");
  CHECK(fs::last_write_time(at("whole/unmarked/model.safetensors")) == trained);
  CHECK(json_of(at("whole/unmarked/results.json"))["model_sha256"] == unmarked()["model_sha256"]);
  CHECK(results["psnr_marked_vs_unmarked"].get<double>() > 30);
  const nlohmann::json fit = json_of(at("whole/decoder.json"));
  CHECK(fit["model_sha256"] == unmarked()["model_sha256"]);
  CHECK(fit["period"] == 0.12);
  CHECK(fit["tone"] == 0.005);
  const std::string decoder = at("whole/decoder.safetensors");
  CHECK(verdict("whole", key, "--split all", decoder) == 0);
  CHECK(not_detected(verdict("whole", other, "--split all", decoder)));
  CHECK(not_detected(verdict("unmarked", key, "--split all", decoder)));
  // Resumed, it neither trains the unmarked model nor fits again.
  const fs::file_time_type before = fs::last_write_time(at("whole/unmarked/model.safetensors"));
  const fs::file_time_type fitted = fs::last_write_time(at("whole/decoder.safetensors"));
  const Outcome again = tool(run + " --resume");
  INFO(again.text);
  REQUIRE(again.code == 0);
  CHECK(fs::last_write_time(at("whole/unmarked/model.safetensors")) == before);
  CHECK(fs::last_write_time(at("whole/decoder.safetensors")) == fitted);
  // A decoder is kept, and an unmarked model of other options is not taken for this one.
  check_refused(tool(run), {at("whole"), "--out", "finished run"});
  fs::rename(at("whole/results.json"), at("whole/aside.json"));
  check_refused(tool(run), {"decoder.safetensors", "--out"});
  fs::rename(at("whole/aside.json"), at("whole/results.json"));
  check_refused(tool(run + " --resume --seed 9"), {"results.json", "seed"});
  check_refused(tool(run + " --resume --bits 48"), {"owner16.key", "16", "48"});
  // Nor is the decoder taken for another one, and one that is named is not fitted.
  const std::string embed = "embed --iterations 400 --fidelity 300 --message-rate 0.004 --model " +
                            at("whole/unmarked/model.safetensors") + " --data " + setting().scene + " --key " + key +
                            " --out " + at("whole") + " --resume",
                    fitting = embed + " --decoder fit";
  check_refused(tool(fitting + " --period 0.2"), {"decoder.safetensors", "--period"});
  check_refused(tool(fitting + " --tone 0"), {"decoder.safetensors", "--tone"});
  check_refused(tool(fitting + " --tone 0.05"), {"decoder.safetensors", "--tone"});
  check_refused(tool(embed + " --period 0.12 --decoder " + decoder), {"--period", "--decoder"});
  check_refused(tool(embed + " --tone 0.005 --decoder " + decoder), {"--tone", "--decoder"});
  check_refused(tool(fitting + " --period nan"), {"--period", "not a number"});  // within every range, for CLI11
  const Outcome named = tool(fitting + " --period 0.12 --tone 0.005");           // what it began with, said aloud
  INFO(named.text);
  CHECK(named.code == 0);
  CHECK(fs::last_write_time(at("whole/decoder.safetensors")) == fitted);
  CHECK(json_of(at("whole/results.json"))["model_sha256"] == results["model_sha256"]);
}

TEST_CASE("tool: a scene that is marked when it is finished keeps the exposures that it calls for") {
  // What is asked for and the recipe of the unmarked model. In the loss of the photographs the mark would have to train with them.
  const std::vector<std::array<std::string, 3>> cases = {{"", "plain", "scaffold+exposure"},
                                                         {"--codec hac --lambda 0.004 ", "coded", "hac+exposure"},
                                                         {"--fidelity 0 ", "in-the-loss", "scaffold"}};
  for (const auto& [options, called, recipe] : cases) {
    const std::string& name = called;
    CAPTURE(name);
    const std::string out = at("exposed-then-marked-" + name);
    // Of the unmarked model alone: ended when it is there.
    const Outcome ended =
        tool("train --voxel-size 0.2 --effects exposure --iterations 60 " + options + "--data " + setting().scene +
             " --key " + setting().key + " --out " + out + " 2>&1 & pid=$!; while [ ! -f " + out +
             "/unmarked/results.json ]; do kill -0 $pid 2>/dev/null || break; sleep 0.01; done; kill -TERM $pid; "
             "wait $pid #");
    INFO(ended.text);
    REQUIRE(fs::exists(out + "/unmarked/results.json"));
    CHECK(json_of(out + "/unmarked/results.json")["recipe"] == recipe);
    CHECK((ended.text.find("exposure is left out") != std::string::npos) == (recipe == "scaffold"));
  }
}

TEST_CASE("tool: train --fidelity marks the finished model, and keeps the unmarked one") {
  const nlohmann::json held = train("held", setting().mark() + " --fidelity 300 --mark-iterations 60");
  CHECK(held["psnr_cost_vs_unmarked"].is_number());
  const Result<SafetensorsFile> plain =
                                    read_safetensors((static_cast<void>(unmarked()), at("unmarked/model.safetensors"))),
                                counterpart = read_safetensors(at("held/unmarked/model.safetensors")),
                                marked = read_safetensors(at("held/model.safetensors"));
  REQUIRE((plain.ok() && counterpart.ok() && marked.ok()));
  for (const char* name : {"anchor.offset", "anchor.scaling", "anchor.feature", "mlp_color.0.weight"}) {
    CAPTURE(name);
    CHECK(*counterpart->values<float>(name) == *plain->values<float>(name));
  }
  CHECK(*marked->values<float>("anchor.feature") != *plain->values<float>("anchor.feature"));
}

TEST_CASE("tool: a marked training has the same model_sha256 at any thread count, with the noise of quantization too") {
  const std::string options = setting().mark() + " --for-compression";
  CHECK(train("threads-1", options + " --threads 1", 60)["model_sha256"] ==
        train("threads-3", options + " --threads 3", 60)["model_sha256"]);
}

TEST_CASE("tool: a marked training and an embedding that were stopped end in the bits of one that was not") {
  static_cast<void>(unmarked());
  const auto finished = [](const std::string& command, const std::string& out) {
    const Outcome outcome = tool(command + " --out " + at(out));
    INFO(outcome.text);
    REQUIRE(outcome.code == 0);
    return json_of(at(out) + "/results.json")["model_sha256"].get<std::string>();
  };
  const std::string data = " --data " + setting().scene,
                    run = "train --voxel-size 0.2 --effects none --iterations 200" + data;
  testing::killed(run + setting().mark(), at("stopped"));
  check_refused(
      tool(run + " --key " + setting().other + " --decoder " + setting().decoder + " --resume --out " + at("stopped")),
      {"checkpoint.safetensors", "watermark"});
  CHECK(finished(run + setting().mark() + " --resume", "stopped") == finished(run + setting().mark(), "straight"));
  const std::string embed = "embed --iterations 200" + data + setting().mark() + " --model ";
  testing::killed(embed + at("unmarked/model.safetensors"), at("stopped-embed"));
  check_refused(tool(embed + at("straight/model.safetensors") + " --resume --out " + at("stopped-embed")),
                {"checkpoint.safetensors", "watermark"});
  check_refused(
      tool(embed + at("unmarked/model.safetensors") + " --resume --message-power 2 --out " + at("stopped-embed")),
      {"checkpoint.safetensors"});
  check_refused(
      tool(embed + at("unmarked/model.safetensors") + " --resume --fidelity-fall 0 --out " + at("stopped-embed")),
      {"checkpoint.safetensors"});
  // Drawn by what the message cost, which is state: stopped and gone on with it is the run that was not stopped, and another one than without.
  const std::string by_cost = embed + at("unmarked/model.safetensors") + " --sample-by-loss 1";
  testing::killed(by_cost, at("stopped-by-cost"));
  CHECK(finished(by_cost + " --resume", "stopped-by-cost") == finished(by_cost, "straight-by-cost"));
  CHECK(json_of(at("straight-by-cost/results.json"))["model_sha256"].get<std::string>() !=
        finished(embed + at("unmarked/model.safetensors"), "straight-even"));
  // The defaults with a decoder that was not fitted to the scene, said aloud.
  const std::string defaults = " --message-power 1 --message-rate 0.001 --fidelity 3000 --fidelity-fall 2";
  CHECK(finished(embed + at("unmarked/model.safetensors") + defaults + " --resume", "stopped-embed") ==
        finished(embed + at("unmarked/model.safetensors"), "straight-embed"));
}

TEST_CASE("tool: bad input to a marked training is one line, and nothing is written") {
  const std::string common = "train --effects none --iterations 20 --data " + setting().scene + " --out " + at("none");
  check_refused(tool(common + " --key " + setting().key + " --codec hac --for-compression"), {"--decoder", "missing"});
  check_refused(tool(common + " --key " + setting().key + " --tone nan"), {"--tone", "is not a number"});
  check_refused(tool(common + " --key " + setting().key + " --codec hac --fidelity 0"), {"--fidelity", "--decoder"});
  check_refused(tool(common + " --key " + at("nowhere.key")), {"nowhere.key"});
  check_refused(tool(common + " --decoder " + setting().decoder), {"--key", "missing"});
  check_refused(tool(common + setting().mark() + " --bits 48"), {"owner.key", "bits", "24", "48"});
  REQUIRE(tool("keygen --bits 32 --out " + at("long.key")).code == 0);
  check_refused(tool(common + " --key " + at("long.key") + " --decoder " + setting().decoder),
                {"lattice.safetensors", "24", "32"});
  check_refused(tool("embed --distortion noise --data " + setting().scene + " --out " + at("none") + setting().mark() +
                     " --model " + (static_cast<void>(unmarked()), at("unmarked/model.safetensors"))),
                {"--distortion", "train --codec"});
  check_refused(tool("train --iterations 20 --data " + setting().scene + " --out " + at("none") + setting().mark() +
                     " --recipe scaffold+antialiasing"),
                {"--recipe", "scaffold+antialiasing", "+alpha"});
  check_refused(tool(common + setting().mark() + " --unmarked " + at("nowhere.safetensors")), {"nowhere.safetensors"});
  CHECK_FALSE(fs::exists(at("none/model.safetensors")));
  check_refused(tool(common + " --for-compression"), {"--key", "missing"});
  check_refused(tool(common + " --message-rate 0.1"), {"--key", "missing"});
  for (const char* name : {"--message-power", "--message-margin", "--message-rate", "--message-weight", "--fidelity"}) {
    CHECK(tool(common + setting().mark() + " " + name + " nan").code != 0);
  }
  for (const char* name : {"--fidelity-fall", "--sample-by-loss", "--orbit", "--photographs"}) {
    const Outcome outcome = tool(common + setting().mark() + " --fidelity 3000 " + name + " nan");
    CHECK(outcome.code != 0);
    CHECK(outcome.text.find(name) != std::string::npos);
  }
  CHECK(tool(common + setting().mark() + " --message-power 0.5").code != 0);
  CHECK(tool(common + setting().mark() + " --fidelity 3000 --fidelity-fall 5").code != 0);
  check_refused(tool(common + setting().mark() + " --fidelity-fall 1"),
                {"--fidelity-fall", "needs post-hoc embedding"});
  check_refused(tool(common + setting().mark() + " --sample-by-loss 1"), {"--sample-by-loss", "finished model"});
  check_refused(tool(common + setting().mark() + " --fidelity 3000 --for-compression"),
                {"--fidelity", "leave out --for-compression"});
  check_refused(tool(common + setting().mark() + " --fidelity 3000 --unmarked " + at("unmarked/model.safetensors")),
                {"--fidelity", "leave out --unmarked"});
  // Before the unmarked model is trained, not after.
  check_refused(tool(common + " --key " + setting().key + " --fidelity 0 --sample-by-loss 1"),
                {"--sample-by-loss", "needs post-hoc embedding"});
  check_refused(tool(common + " --key " + setting().key + " --codec hac --calibrate-steps 50"),
                {"--calibrate-steps", "context_gs"});
  check_refused(tool(common + setting().mark() + " --codec context_gs --calibrate-steps 50"),
                {"--calibrate-steps", "finished model"});
  CHECK_FALSE(fs::exists(at("none/unmarked")));
  check_refused(tool("train --profile paper --iterations 20 --data " + setting().scene + " --out " + at("none") +
                     setting().mark() + " --message-power 2"),
                {"--message-power", "--message-margin"});
  static_cast<void>(unmarked());
  check_refused(tool("train --effects none --iterations 20 --data " + setting().scene + " --out " + at("unmarked") +
                     setting().mark() + " --unmarked " + at("unmarked/model.safetensors")),
                {"--unmarked", "model.safetensors"});
  const std::string embed = "embed --iterations 20 --data " + setting().scene + setting().mark();
  check_refused(tool(embed + " --model " + at("unmarked/model.safetensors") + " --out " + at("unmarked")), {"--out"});
  check_refused(tool(embed + " --model " + at("nowhere.safetensors") + " --out " + at("none")),
                {"nowhere.safetensors"});
  REQUIRE(tool("scene --out " + at("scene-5") + " --width 48 --height 40 --train 5 --test 1").code == 0);
  check_refused(tool("embed --iterations 20 --data " + at("scene-5") + setting().mark() + " --model " +
                     at("unmarked/model.safetensors") + " --out " + at("none")),
                {"views", "12", "5"});
}

}  // namespace watermark_test
