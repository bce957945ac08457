// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Marked files that another build wrote: whoever verifies them, with any compiler and any flags, reads the same bits at the same p-value.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/io/json_file.hpp>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>

#include "tool/running.hpp"

namespace golden_mark_test {

namespace {

using namespace compmark;
using testing::done;
using testing::json_of;
using testing::Outcome;
using testing::tool;

}  // namespace

TEST_CASE("tool: marked files of another build: the same bits, the same p-value") {
  const testing::ScratchFolder scratch("compmark-golden-mark-test");
  const std::string folder = "tests/golden/marked/", json = (scratch.path / "proof.json").string(),
                    other = (scratch.path / "other.key").string();
  REQUIRE(write_key(other, testing::fixed_key(2, 32)).ok());
  for (const std::string name : {"hac", "context_gs"}) {
    CAPTURE(name);
    std::string claim;
    const auto verify = [&](const std::string& key) {
      return tool("verify --alpha 1e-3 --split all --model " + folder + name +
                  ".cmk --decoder weights/lattice_32.safetensors --key " + key + " --json " + json + claim);
    };
    // 29 of 32 bits are a proof with a claim alone: of the keys of that version, millions can be tried.
    CHECK(verify(folder + "owner.key").code == 3);
    CHECK(json_of(json)["proof"]["standing"] == "not_a_proof");
    CHECK(json_of(json)["proof"]["decoder"] == "shipped");
    claim = " --claim " + (scratch.path / "owner.claim").string();
    done("claim --key " + folder + "owner.key --decoder weights/lattice_32.safetensors --out " +
         (scratch.path / "owner.claim").string());
    const Outcome outcome = verify(folder + "owner.key");
    INFO(outcome.text);
    CHECK(outcome.code == 0);
    const nlohmann::json here = json_of(json), there = json_of(folder + name + ".json");
    CHECK(here["model"]["sha256"] == there["model"]["sha256"]);
    CHECK(here["read"]["hex"] == there["read"]["hex"]);
    CHECK(here["matches"] == there["matches"]);
    CHECK(here["p_value"].get<double>() == there["p_value"].get<double>());
    REQUIRE(here["views"].size() == there["views"].size());
    // Sums of floats in another order.
    double farthest = 0, largest = 0;
    for (std::size_t v = 0; v < here["views"].size(); ++v) {
      const nlohmann::json &a = here["views"][v]["logits"], &b = there["views"][v]["logits"];
      REQUIRE(a.size() == b.size());
      for (std::size_t i = 0; i < a.size(); ++i) {
        farthest = std::max(farthest, std::abs(a[i].get<double>() - b[i].get<double>()));
        largest = std::max(largest, std::abs(b[i].get<double>()));
      }
    }
    MESSAGE(name, ": logits differ by ", farthest, " of ", largest);
    CHECK(farthest < 1e-3 * largest);
    claim = "";
    CHECK(verify(other).code == 1);  // negative control: another key is not in it
  }
}

}  // namespace golden_mark_test
