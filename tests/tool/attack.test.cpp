// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a thief does to a model, and what is left of it and of the message in it: the paper's test of rounding every number to 8 bits.
#include <doctest/doctest.h>

#include <compmark/core/random.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tool/running.hpp"

namespace attack_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::Outcome;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-attack-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// The built-in scene, small, with a message of 24 bits in it, and the decoder that reads it: untrained, so that seconds do.
const std::string& marked() {
  static const std::string model = [] {
    done("scene --out " + at("scene") + " --width 96 --height 80 --train 12 --test 4");
    REQUIRE(write_key(at("owner.key"), testing::fixed_key(1, 24)).ok());
    REQUIRE(write_lattice<SafetensorsWriter>(testing::untrained_lattice(24, 64, 2), "a test",
                                             fs::path(at("decoder.safetensors")))
                .ok());
    done("train --voxel-size 0.2 --effects none --iterations 600 --message-weight 0.1 --data " + at("scene") +
         " --out " + at("run") + " --key " + at("owner.key") + " --decoder " + at("decoder.safetensors"));
    return at("run/model.safetensors");
  }();
  return model;
}

/// The same scene without a message.
const std::string& unmarked() {
  static const std::string model = [] {
    (void)marked();
    done("train --voxel-size 0.2 --effects none --iterations 600 --data " + at("scene") + " --out " + at("plain"));
    return at("plain/model.safetensors");
  }();
  return model;
}

double psnr_of(const std::string& model) {
  done("evaluate --model " + model + " --data " + at("scene") + " --json " + at("evaluation.json"));
  return json_of(at("evaluation.json"))["psnr"];
}
/// Bits right over all views, and the mean share of them in a view.
std::pair<int, double> message_of(const std::string& model) {
  (void)tool("verify --model " + model + " --key " + at("owner.key") + " --decoder " + at("decoder.safetensors") +
             " --json " + at("proof.json"));
  const nlohmann::json proof = json_of(at("proof.json"));
  return {proof["matches"].get<int>(), proof["bit_accuracy"]["mean"].get<double>()};
}
std::string attacked(const std::string& model, const std::string& options) {
  done("attack --model " + model + " --out " + at("attacked.safetensors") + " " + options);
  return at("attacked.safetensors");
}

TEST_CASE("tool: a model of 8 bits a number pays for its positions, and little else") {
  const double before = psnr_of(unmarked()), whole = psnr_of(attacked(unmarked(), "--int8 tensor")),
               places = psnr_of(attacked(unmarked(), "--int8 tensor --keep-positions")),
               fine = psnr_of(attacked(unmarked(), "--int8 channel --keep-positions"));
  MESSAGE("PSNR ", before, "; a scale a tensor ", whole, "; positions kept ", places, "; a scale a channel ", fine);
  // measured: 24.26; 24.13; 24.26; 24.26 dB (a trained chair: 36.8; 29.8; 36.4; 36.6, docs/quantizers.md)
  CHECK(whole < before - 0.05);
  CHECK(whole > before - 8);
  CHECK(places > before - 0.5);
  CHECK(places > whole);
  CHECK(fine > before - 0.2);
}

TEST_CASE("tool: a message is read from a model of 8 bits a number") {
  const auto [bits, share] = message_of(marked());
  CHECK(share > 0.7);
  for (const char* options :
       {"--int8 tensor", "--int8 tensor --keep-positions", "--int8 channel", "--int8 tensor --symmetric"}) {
    CAPTURE(options);
    const auto [matches, accuracy] = message_of(attacked(marked(), options));
    CHECK(matches >= bits - 2);
    CHECK(accuracy > share - 0.06);
  }
}

TEST_CASE("tool: attack rounds what it says it rounds, and nothing twice") {
  done("attack --model " + marked() + " --out " + at("once.safetensors") + " --int8 tensor --keep-positions --json " +
       at("once.json"));
  const Result<SafetensorsFile> model = read_safetensors(marked()), once = read_safetensors(at("once.safetensors"));
  REQUIRE(model);
  REQUIRE(once);
  const auto same = [&](const char* name) { return *model->values<float>(name) == *once->values<float>(name); };
  CHECK(same("anchor.position"));
  CHECK_FALSE(same("anchor.feature"));
  CHECK_FALSE(same("mlp_color.0.weight"));
  const std::vector<float> features = *once->values<float>("anchor.feature");
  CHECK(std::set<float>(features.begin(), features.end()).size() <= 256);
  const nlohmann::json report = json_of(at("once.json"));
  CHECK(report["schema"] == "compmark.attack.1");
  CHECK(report["tensors"].size() == 15);  // three attributes of anchors, two layers of three heads
  for (const nlohmann::json& tensor : report["tensors"]) CHECK(tensor["name"] != "anchor.position");
  done("attack --model " + marked() + " --out " + at("again.safetensors") + " --int8 tensor --keep-positions");
  CHECK(*read_file(at("once.safetensors")) == *read_file(at("again.safetensors")));
}

TEST_CASE("tool: attack changes a model by the attacks of a list, in turn, the same for the same seed") {
  const auto anchors = [](const std::string& model) {
    return read_safetensors(model)->values<float>("anchor.feature")->size();
  };
  const std::size_t all = anchors(marked());
  const std::string options = "--attack prune:0.5 --attack noise:0.02 --seed 3";
  const std::string once = attacked(marked(), options);
  CHECK(anchors(once) < 6 * all / 10);
  CHECK(anchors(once) > 4 * all / 10);
  const std::vector<std::byte> bytes = *read_file(once);
  CHECK(*read_file(attacked(marked(), options)) == bytes);
  CHECK(*read_file(attacked(marked(), "--attack prune:0.5 --attack noise:0.02 --seed 4")) != bytes);
  CHECK(psnr_of(attacked(marked(), "--attack prune:0.5")) < psnr_of(marked()));
  const std::string doubled = attacked(marked(), "--attack clone:1");
  CHECK(anchors(doubled) == 2 * all);
  CHECK(psnr_of(doubled) < psnr_of(marked()));
}

TEST_CASE("tool: attack changes images by the attacks of a list, and their message is read or gone") {
  done("render --model " + marked() + " --out " + at("renders"));
  const auto read = [](const std::string& folder) {
    (void)tool("verify --images " + at(folder) + " --key " + at("owner.key") + " --decoder " +
               at("decoder.safetensors") + " --json " + at("images.json"));
    return json_of(at("images.json"))["matches"].get<int>();
  };
  const int before = read("renders");
  done("attack --images " + at("renders") + " --into " + at("bright") + " --attack brightness:0.9 --attack noise:0.01");
  done("attack --images " + at("renders") + " --into " + at("black") + " --attack brightness:0");
  std::set<std::string> names, attacked_names;
  for (const auto& entry : fs::directory_iterator(at("renders"))) names.insert(entry.path().filename().string());
  for (const auto& entry : fs::directory_iterator(at("bright")))
    attacked_names.insert(entry.path().filename().string());
  std::erase_if(attacked_names, [](const std::string& name) { return name[0] == '.'; });
  std::erase_if(names, [](const std::string& name) { return name[0] == '.'; });
  CHECK(names == attacked_names);
  CHECK(read("bright") >= before - 4);
  CHECK(*read_file(at("bright/" + *names.begin())) != *read_file(at("renders/" + *names.begin())));
}

TEST_CASE("tool: evaluate reads after an attack what verify reads from the pictures that attack wrote") {
  const std::string scene = at("scene"), key = " --key " + at("owner.key") + " --decoder " + at("decoder.safetensors");
  const std::vector<std::string> attacks = {"jpeg:30", "noise:0.05", "saturation:0", "brightness:1"};
  std::string words;
  for (const std::string& attack : attacks) words += " --attack " + attack;
  const std::string evaluate = "evaluate --data " + scene + " --model " + marked();
  done(evaluate + key + words + " --json " + at("after.json") + " --csv " + at("after.csv"));
  const nlohmann::json report = json_of(at("after.json"));
  REQUIRE(report["attacks"].size() == attacks.size());
  done("render --model " + marked() + " --out " + at("to_edit"));
  for (std::size_t a = 0; a < attacks.size(); ++a) {
    CAPTURE(attacks[a]);
    const std::string edited = at("after_" + std::to_string(a));
    done("attack --images " + at("to_edit") + " --into " + edited + " --attack " + attacks[a]);
    (void)tool("verify --images " + edited + key + " --json " + at("read.json"));
    const nlohmann::json read = json_of(at("read.json")), &said = report["attacks"][a];
    CHECK(said["attack"] == attacks[a]);
    const double left = said["psnr_to_unattacked"].get<double>();
    CHECK((a == 3 ? left > 99 : left > 15 && left < 50));  // the last one changes nothing
    CHECK(said["bits_right"] == read["matches"]);
    CHECK(said["bit_accuracy"]["mean"].get<double>() ==
          doctest::Approx(read["bit_accuracy"]["mean"].get<double>()).epsilon(1e-9));
  }
  CHECK(report["attacks"][3]["bit_accuracy"] == report["bit_accuracy"]);  // nothing was done to them
  // The control: this scene's mark feels JPEG. (All views together may say as many bits after it.)
  CHECK(report["attacks"][0]["bit_accuracy"] != report["bit_accuracy"]);
  CHECK(testing::text_of(at("after.csv")).find("saturation:0") != std::string::npos);
  check_refused(tool(evaluate + words), {"--key", "is missing"});
  check_refused(tool(evaluate + key + " --attack poster"), {"attack", "none of crop"});
  check_refused(tool(evaluate + key + " --attack frame:0"), {"frame:0", "from 1 to 512 in steps of 1"});
}

TEST_CASE("tool: attack averages copies, prunes by significance, and puts a cut-out back into its scene") {
  const auto anchors = [](const std::string& model) {
    return read_safetensors(model)->values<float>("anchor.feature")->size();
  };
  const std::size_t all = anchors(marked());
  // LightGaussian throws away what matters least: much less is lost than by as many at random.
  const std::string significant = attacked(marked(), "--attack lightgaussian:0.3");
  CHECK(anchors(significant) > 69 * all / 100);
  CHECK(anchors(significant) < 71 * all / 100);
  const double by_significance = psnr_of(significant), at_random = psnr_of(attacked(marked(), "--attack prune:0.3"));
  MESSAGE("PSNR ", psnr_of(marked()), "; 30 % by significance ", by_significance, ", at random ", at_random);
  CHECK(by_significance > at_random + 1);

  done("attack --model " + marked() + " --out " + at("moved.safetensors") + " --attack feature_noise:0.1 --seed 5");
  const Result<SafetensorsFile> one = read_safetensors(marked()), two = read_safetensors(at("moved.safetensors")),
                                mean = read_safetensors(attacked(marked(), "--average " + at("moved.safetensors")));
  const std::vector<float> a = *one->values<float>("anchor.feature"), b = *two->values<float>("anchor.feature"),
                           m = *mean->values<float>("anchor.feature");
  REQUIRE(a.size() == m.size());
  for (std::size_t i = 0; i < m.size(); ++i) CHECK(m[i] == doctest::Approx(0.5f * (a[i] + b[i])).epsilon(1e-5));
  const std::string model = "attack --model " + marked() + " --out " + at("x.safetensors");
  done("attack --model " + marked() + " --out " + at("both.safetensors") + " --attack cutout:0.25 --insert-into " +
       marked());
  CHECK(anchors(at("both.safetensors")) > 5 * all / 4 - 100);
  CHECK(anchors(at("both.safetensors")) < 5 * all / 4 + 100);
  check_refused(tool(model + " --average " + at("both.safetensors")), {"both.safetensors"});  // other anchors
  check_refused(tool(model + " --attack cutout --insert-into " + unmarked()), {"is a network of other weights"});
  check_refused(tool("attack --images " + at("scene") + " --into " + at("y") + " --attack blur --average " + marked()),
                {"--average, --insert-into", "are of a model"});
}

TEST_CASE("tool: reproduce_robustness fills its tables, goes on where it was stopped, and says what is wrong") {
  (void)marked();
  const auto reproduce = [](const std::string& more) {
    return testing::run_tool(COMPMARK_REPRODUCE_ROBUSTNESS, "--run " + at("run") + " --key " + at("owner.key") +
                                                                " --decoder " + at("decoder.safetensors") + " --out " +
                                                                at("robustness") + " --views 2 " + more);
  };
  const std::string few = "--picture jpeg:50 brightness:0 --model prune:0.2 lightgaussian:0.3 --pgd pgd:0.1";
  const Outcome outcome = reproduce(few);
  INFO(outcome.text);
  REQUIRE(outcome.code == 0);
  const nlohmann::json cells = json_of(at("robustness/robustness.json"))["cells"];
  REQUIRE(cells.size() == 6);
  CHECK(cells[0]["attack"] == "none");
  CHECK(cells[0]["psnr_to_unattacked"].get<double>() > 99);
  CHECK(cells[0]["paper"] == "95.9 / 94.0");
  const double clean = cells[0]["bit_accuracy"]["mean"];
  CHECK(clean > 0.7);
  for (const nlohmann::json& cell : cells) {
    CHECK(cell["views"] == 2);
    CHECK(cell["bits"] == 24);
    if (cell["attack"] != "none") CHECK(cell["psnr_to_unattacked"].get<double>() < 60);
  }
  CHECK(cells[2]["bit_accuracy"]["mean"].get<double>() < clean);  // black pictures
  CHECK(cells[5]["attack"] == "pgd:0.1");
  CHECK(cells[5]["bit_accuracy"]["mean"].get<double>() < 0.5);  // who knows the decoder turns the bits round
  CHECK(cells[5]["psnr_to_unattacked"].get<double>() > 19.9);   // epsilon .1 at most in every value
  for (const char* name : {"robustness.csv", "robustness.md", "robustness.html"})
    CHECK(testing::text_of(at(std::string("robustness/") + name)).find("lightgaussian:0.3") != std::string::npos);
  // Again: nothing is measured; one more: that alone.
  const std::string before = testing::text_of(at("robustness/robustness.json"));
  CHECK(reproduce(few).text.find("% of the bits") == std::string::npos);
  CHECK(testing::text_of(at("robustness/robustness.json")) == before);
  const Outcome more = reproduce(few + " --also twice=" + marked());
  CHECK(testing::times_in(more.text, "% of the bits") == 1);
  CHECK(reproduce(few + " --seed 2").text.find("prune:0.2") != std::string::npos);
  // What is wrong with the words is said before anything is measured.
  for (const auto& [words, said] :
       {std::pair("--picture poster", "none of crop"), std::pair("--model jpeg", "none of int8"),
        std::pair("--also twice", "is no NAME=MODEL")}) {
    const Outcome refused = reproduce(words);
    CHECK(refused.code == 2);
    CHECK(refused.text.rfind("reproduce_robustness: error: ", 0) == 0);
    CHECK(testing::times_in(refused.text, "\n") == 1);
    CHECK(refused.text.find(said) != std::string::npos);
  }
  CHECK(reproduce("--restored").text.find("--restored: needs the unmarked model") != std::string::npos);
  // Attacked models are also read put back together in the unmarked one (here what stands in for it), pictures are not.
  REQUIRE(
      tool("attack --model " + marked() + " --attack feature_noise:0.2 --out " + at("as_unmarked.safetensors")).code ==
      0);
  const Outcome restored = reproduce("--picture jpeg:50 --model prune:0.5 --informed-views 0 --restored --unmarked " +
                                     at("as_unmarked.safetensors"));
  INFO(restored.text);
  REQUIRE(restored.code == 0);
  const nlohmann::json read = json_of(at("robustness/robustness.json"))["cells"];
  REQUIRE(read.size() == 4);
  CHECK_FALSE(read[1].contains("restored"));
  REQUIRE(read[2].contains("restored"));
  CHECK(read[2]["restored"]["found"] < read[2]["restored"]["anchors"]);
  CHECK(read[2]["restored"]["raised"].get<double>() > 1.5);
  CHECK(read[3]["restored"]["found"] == read[3]["restored"]["anchors"]);  // averaged with the unmarked
  const std::string shown = testing::text_of(at("robustness/robustness.md"));
  CHECK(shown.find(" restored |") != std::string::npos);
  CHECK(shown.find(std::to_string(read[2]["restored"]["bits_right"].get<int>()) + " of 24, p ") != std::string::npos);
  CHECK(testing::text_of(at("robustness/robustness.csv")).find(",restored_p_value,") != std::string::npos);
  const Outcome epsilon = reproduce("--pgd pgd:2");
  CHECK(epsilon.code == 2);
  CHECK(epsilon.text.find("epsilon from 0 to 1") != std::string::npos);
}

TEST_CASE("tool: attack refuses what it cannot do in a sentence") {
  const std::string model = "attack --model " + marked() + " --out " + at("x.safetensors");
  check_refused(tool(model + " --attack blur"), {"attack", "none of int8, noise, prune, clone"});
  check_refused(tool(model + " --attack prune:2"), {"prune:2", "from 0 to 0.99", "share"});
  check_refused(tool(model + " --attack prune --int8 tensor"), {"--attack, --int8", "do not go together"});
  check_refused(tool(model + " --attack prune --symmetric"), {"--symmetric"});
  check_refused(tool("attack --attack prune --out " + at("x.safetensors")), {"--model, --images", "missing"});
  check_refused(tool("attack --model " + marked() + " --attack prune --into " + at("x")),
                {"--into: is for images, and a model is attacked"});
  check_refused(tool("attack --model " + marked() + " --attack prune"), {"--out: is missing", "name the model"});
  check_refused(tool("attack --images " + at("pictures") + " --attack jpeg:50"), {"--into: is missing", "folder"});
  check_refused(tool("attack --images " + at("pictures") + " --attack jpeg:50 --out " + at("x.safetensors")),
                {"--out: is for a model, and images are attacked"});
  CHECK(!fs::exists(at("x.safetensors")));
  check_refused(tool("attack --model " + at("none.safetensors") + " --out " + at("x.safetensors") + " --int8 tensor"),
                {"none.safetensors"});
  check_refused(tool("attack --model " + marked() + " --out " + marked() + " --int8 tensor"),
                {"model.safetensors", "choose another"});
  CHECK(tool("attack --model " + marked() + " --out " + at("x.safetensors") + " --int8 image").code == 2);
  CHECK(tool("attack --model " + marked() + " --out " + at("x.safetensors")).code == 2);
}

}  // namespace

}  // namespace attack_test
