// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/verify.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <cstddef>
#include <filesystem>
#include <optional>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/tool.hpp"

TEST_CASE("app/verify: the report is the verification of what is read, for the key's message") {
  using namespace compmark;
  constexpr int message_bits = 32;
  const testing::ScratchFolder folder("compmark-app-verify");
  ThreadExecutor executor(2);
  ReadingSettings reading;
  reading.model = folder.path / "model.safetensors";
  reading.decoder = folder.path / "decoder.safetensors";
  REQUIRE(write_model(reading.model, testing::small_model<recipes::Scaffold>(), testing::small_info("scaffold")).ok());
  testing::write_decoder(reading.decoder, message_bits);
  const Result<Reading> read = read_messages(reading, std::nullopt, executor);
  REQUIRE(read.ok());
  // Nobody marked this model: that bits of many keys are not in it is the control of the verdict.
  int detected = 0;
  for (int number = 1; number <= 5; ++number) {
    const OwnerKey key = testing::small_key(number, message_bits);
    const Result<VerificationReport> report = verify_files(key, reading, VerifySettings{}, executor);
    REQUIRE(report.ok());
    const Result<Verification> direct = verify_message(message_of(key), read->views, VerifySettings{});
    REQUIRE(direct.ok());
    CHECK(report->verification.evidence.p_value == direct->evidence.p_value);
    CHECK(report->verification.verdict == direct->verdict);
    CHECK(report->sources.key_id == key.id());
    CHECK(report->views.size() == read->views.size());
    detected += report->verification.verdict == Verdict::detected;
  }
  CHECK(detected == 0);
  VerifySettings impossible;
  impossible.false_positive_rate = 2;
  CHECK_FALSE(verify_files(testing::small_key(1, message_bits), reading, impossible, executor).ok());
}
