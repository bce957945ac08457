// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One scene, a copy for each of several recipients: the key, the copies, who leaked one, and what two of them who average theirs leave.
#include <doctest/doctest.h>

#include <compmark/io/json_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tool/running.hpp"

namespace recipients_test {

namespace {

namespace fs = std::filesystem;
using namespace compmark;
using testing::check_refused;
using testing::done;
using testing::json_of;
using testing::Outcome;
using testing::tool;

const fs::path& scratch() {
  static const testing::ScratchFolder folder("compmark-recipients-test");
  return folder.path;
}
std::string at(const std::string& name) { return (scratch() / name).string(); }

/// The built-in scene, small, unmarked; a key of 48 bits for ten recipients, and a decoder that is fitted to it.
const std::string& unmarked() {
  static const std::string model = [] {
    OwnerKey key = testing::fixed_key(4, 48);
    key.recipients = 10;
    REQUIRE(write_key(at("owner.key"), key).ok());
    key = testing::fixed_key(5, 48);
    key.recipients = 10;
    REQUIRE(write_key(at("other.key"), key).ok());
    REQUIRE(write_key(at("plain.key"), testing::fixed_key(4, 48)).ok());
    done("scene --out " + at("scene") + " --width 96 --height 80 --train 12 --test 4");
    done("train --voxel-size 0.05 --effects none --iterations 800 --data " + at("scene") + " --out " + at("plain"));
    done("fit --bits 48 --features 144 --views 300 --gradient-views 6 --data " + at("scene") + " --model " +
         at("plain/model.safetensors") + " --out " + at("decoder.safetensors"));
    return at("plain/model.safetensors");
  }();
  return model;
}
std::string embedding(const std::string& key = "owner.key") {
  return "embed --iterations 500 --fidelity 100 --model " + unmarked() + " --data " + at("scene") + " --key " +
         at(key) + " --decoder " + at("decoder.safetensors") + " --out ";
}
/// The copy of a recipient.
std::string copy_for(int recipient) {
  const std::string out = at("copy" + std::to_string(recipient));
  if (!fs::exists(out + "/model.safetensors")) done(embedding() + out + " --recipient " + std::to_string(recipient));
  return out + "/model.safetensors";
}
std::string reading(const std::string& model, const std::string& key) {
  return "verify --split all --model " + model + " --unmarked " + unmarked() + " --key " + at(key) + " --decoder " +
         at("decoder.safetensors") + " --json " + at("proof.json");
}
/// The report of verify, which did not fail.
nlohmann::json report(const std::string& model, const std::string& key = "owner.key") {
  const Outcome outcome = tool(reading(model, key));
  INFO(outcome.text);
  REQUIRE(outcome.code != 2);
  MESSAGE(outcome.text);
  return json_of(at("proof.json"));
}

}  // namespace

TEST_CASE("tool: a key for recipients says how many, and what is wrong with a number in one line") {
  const Outcome made = tool("keygen --quick --recipients 25 --out " + at("new.key"));
  INFO(made.text);
  REQUIRE(made.code == 0);
  CHECK(made.text.find("recipients  25, 1 to 25: 24 bits are in every copy, 24 name the recipient") !=
        std::string::npos);
  CHECK(json_of(at("new.key"))["recipients"] == 25);
  CHECK(json_of(at("new.key"))["version"] == 4);
  done("keygen --recipients 30 --from " + at("new.key") + " --out " + at("more.key"));
  CHECK(json_of(at("more.key"))["secret"] == json_of(at("new.key"))["secret"]);
  CHECK(json_of(at("more.key"))["commitment"] != json_of(at("new.key"))["commitment"]);
  // 16 shared bits are 3e-5 at best: said when the key is made.
  const Outcome weak = tool("keygen --quick --bits 32 --recipients 20 --out " + at("weak.key"));
  CHECK(weak.code == 0);
  CHECK(weak.text.find("copies that are averaged will not be proven") != std::string::npos);
  CHECK(made.text.find("will not be proven") == std::string::npos);
  check_refused(tool("keygen --recipients 1 --out " + at("x.key")), {"--recipients", "2"});
  check_refused(tool("keygen --recipients 20000 --out " + at("x.key")), {"--recipients", "16777"});
  check_refused(tool("keygen --recipients 2 --bits 16 --out " + at("x.key")), {"--recipients", "48 or 64"});
  check_refused(tool("keygen --recipients 5 --payload 5eed --out " + at("x.key")), {"--payload", "--recipients"});
  check_refused(tool("keygen --recipients 5 --from " + at("new.key") + " --out " + at("x.key")), {"new.key", "25"});
  CHECK_FALSE(fs::exists(at("x.key")));
}

TEST_CASE("tool: whose copy leaked is told from its renders; of two that are averaged, the owner still") {
  const nlohmann::json one = report(copy_for(1)), two = report(copy_for(2));
  CHECK(json_of(at("copy1/mark.json"))["recipient"] == 1);
  CHECK(json_of(at("copy2/verification.json"))["recipient"] == 2);
  for (const auto& [json, recipient] : {std::pair(&one, 1), std::pair(&two, 2)}) {
    CHECK((*json)["verdict"] == "detected");
    const nlohmann::json& found = (*json)["recipients"];
    CHECK(found["number"] == 10);
    CHECK(found["shared"]["bits"] == 24);
    REQUIRE(found["named"].size() == 1);
    CHECK(found["named"][0]["recipient"] == recipient);
    CHECK(found["named"][0]["p_corrected"].get<double>() <= 1e-3);
  }
  // Two recipients average their copies: the bits in which they differ are lost, those that all share are not.
  done("attack --model " + copy_for(1) + " --average " + copy_for(2) + " --out " + at("mixed.safetensors"));
  const nlohmann::json mixed = report(at("mixed.safetensors"));
  CHECK(mixed["verdict"] == "detected");
  CHECK(mixed["recipients"]["shared"]["matches"].get<int>() >= 23);
  CHECK(mixed["recipients"]["naming"]["undecided"].get<int>() >= 6);
  for (const nlohmann::json& named : mixed["recipients"]["named"]) CHECK(named["recipient"].get<int>() <= 2);
  // Who goes on with the copy of another is told so.
  check_refused(tool(embedding() + at("copy1") + " --recipient 2 --resume"), {"--recipient"});
  // Negative controls: another key, and what nobody marked (read blind: less itself it says nothing at all).
  done("render --split all --model " + unmarked() + " --out " + at("unmarked_renders"));
  const Outcome blind = tool("verify --images " + at("unmarked_renders") + " --key " + at("owner.key") + " --decoder " +
                             at("decoder.safetensors") + " --json " + at("proof.json"));
  REQUIRE(blind.code == 1);
  CHECK(json_of(at("proof.json"))["verdict"] == "not_detected");
  CHECK(json_of(at("proof.json"))["recipients"]["named"].empty());
  for (const auto& [model, key] :
       {std::pair(at("mixed.safetensors"), "other.key"), std::pair(copy_for(1), "other.key")}) {
    const nlohmann::json nothing = report(model, key);
    CHECK(nothing["verdict"] == "not_detected");
    CHECK(nothing["recipients"]["named"].empty());
  }
}

TEST_CASE("tool: a recipient that is missing, or that the key does not have, is refused before any work") {
  (void)unmarked();
  const std::string out = at("refused");
  check_refused(tool(embedding() + out), {"owner.key", "--recipient", "1 to 10"});
  check_refused(tool(embedding() + out + " --recipient 0"), {"owner.key", "--recipient", "1 to 10"});
  check_refused(tool(embedding() + out + " --recipient 11"), {"owner.key", "--recipient", "1 to 10"});
  check_refused(tool(embedding("plain.key") + out + " --recipient 1"), {"plain.key", "--recipient", "no recipients"});
  check_refused(tool("train --data " + at("scene") + " --key " + at("owner.key") + " --out " + out),
                {"owner.key", "--recipient"});
  check_refused(tool("evaluate --model " + unmarked() + " --data " + at("scene") + " --key " + at("owner.key") +
                     " --decoder " + at("decoder.safetensors")),
                {"owner.key", "--recipient"});
  CHECK_FALSE(fs::exists(out + "/model.safetensors"));
  check_refused(tool(reading(unmarked(), "owner.key") + " --recipient-alpha 0"), {"--recipient-alpha", "above 0"});
}

}  // namespace recipients_test
