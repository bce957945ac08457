// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What is read of a model that was put back together; renders as they are: reading.test.cpp.
#include <doctest/doctest.h>

#include <compmark/app/verify.hpp>
#include <compmark/core/random.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <compmark/watermark/attack/model_attacks.hpp>
#include <compmark/watermark/proof/restored_features.hpp>
#include <cstddef>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/tool.hpp"

TEST_CASE(
    "app/render_reading: a model is put back together in the unmarked one, and that is read less the unmarked one") {
  using namespace compmark;
  using R = recipes::Scaffold;
  constexpr int message_bits = 24;
  const testing::ScratchFolder folder("compmark-app-restored");
  ThreadExecutor executor(2);
  const ModelInfo info = testing::small_info("scaffold");
  const Model<R> unmarked = testing::small_model<R>();
  Model<R> suspected = unmarked, whole = unmarked;
  std::size_t n = 0;
  const Random random(4, 0, random_stage("test/restored"));
  for (float& feature : suspected.arena.values(suspected.anchors.feature).flat())
    feature += static_cast<float>(0.3 * random.normal(n++));
  REQUIRE(attack_model<ModelAttacks>("prune:0.4", suspected.arena, 5).ok());
  const Result<RestoredFeatures> found = restore_features(whole.arena, suspected.arena, executor);
  REQUIRE(found.ok());
  REQUIRE(found->found < found->anchors);
  for (float& size : suspected.arena.values(suspected.anchors.scaling).flat()) size += 0.4f;  // a thief's own numbers
  const auto path = [&](const char* name) { return folder.path / name; };
  REQUIRE(write_model(path("unmarked.safetensors"), unmarked, info).ok());
  REQUIRE(write_model(path("suspected.safetensors"), suspected, info).ok());
  REQUIRE(write_model(path("whole.safetensors"), whole, info).ok());
  ReadingSettings reading;
  reading.decoder = path("decoder.safetensors");
  testing::write_decoder(reading.decoder, message_bits);
  reading.unmarked = path("unmarked.safetensors");
  const OwnerKey key = testing::small_key(1, message_bits);
  const auto read = [&](const char* name, bool restored) {
    reading.model = path(name);
    reading.restored = restored;
    const Result<VerificationReport> report = verify_files(key, reading, VerifySettings{}, executor);
    REQUIRE(report.ok());
    return *report;
  };
  const VerificationReport together = read("suspected.safetensors", true), expected = read("whole.safetensors", false),
                           torn = read("suspected.safetensors", false);
  CHECK(together.verification.fused == expected.verification.fused);
  CHECK(together.restored == *found);
  CHECK(together.verification.settings.tries == 1);
  CHECK(together.sources.model_sha256 == torn.sources.model_sha256);
  CHECK_FALSE(torn.restored.has_value());
  CHECK(torn.verification.fused != expected.verification.fused);  // the control

  reading.restored = true;
  reading.unmarked.clear();
  CHECK(verify_files(key, reading, VerifySettings{}, executor).error().field == "--restored");
}
