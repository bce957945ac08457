// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/app/verify.hpp>
#include <compmark/core/random.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <compmark/watermark/decoder/carrier_decoder.hpp>
#include <compmark/watermark/decoder/decoder_file.hpp>
#include <compmark/watermark/decoder/input_convention.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/tool.hpp"

namespace {

/// A model that nobody marked, and a decoder, on disk.
struct VerifyFiles {
  compmark::testing::ScratchFolder folder;
  compmark::ThreadExecutor executor{2};
  compmark::ReadingSettings reading;
  VerifyFiles(const char* name, int message_length) : folder(name) {
    using namespace compmark;
    reading.model = folder.path / "model.safetensors";
    reading.decoder = folder.path / "decoder.safetensors";
    const auto model = testing::small_model<recipes::Scaffold>();
    REQUIRE(write_model(reading.model, model, testing::small_info("scaffold")).ok());
    testing::write_decoder(reading.decoder, message_length);
  }
};

}  // namespace

TEST_CASE("app/verify: the report is the verification of what is read, for the key's message") {
  using namespace compmark;
  constexpr int message_bits = 32;
  VerifyFiles files("compmark-app-verify", message_bits);
  const testing::ScratchFolder& folder = files.folder;
  ThreadExecutor& executor = files.executor;
  ReadingSettings& reading = files.reading;
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
  CHECK_FALSE(verify_either_way(testing::small_key(1, message_bits), reading, VerifySettings{}, executor).ok());
  // Both ways are two tests, and their count is refused before it is doubled.
  ReadingSettings pictures;
  pictures.images = {folder.path / "none.png"};
  VerifySettings many;
  for (const std::uint64_t tries : {largest_tries / 2 + 1, largest_tries, ~std::uint64_t{0}}) {
    CAPTURE(tries);
    many.tries = tries;
    const Error twice = verify_either_way(testing::small_key(1, message_bits), pictures, many, executor).error();
    CHECK(twice.field == "tries");
    CHECK(twice.problem == "is above 2305843009213693952, and each is 2 tests here");
  }
  many.tries = largest_tries / 2;
  CHECK(verify_either_way(testing::small_key(1, message_bits), pictures, many, executor).error().field != "tries");
  many.tries = largest_tries;
  CHECK(verify_files(testing::small_key(1, message_bits), pictures, many, executor).error().field != "tries");
  VerifySettings impossible;
  impossible.false_positive_rate = 2;
  CHECK_FALSE(verify_files(testing::small_key(1, message_bits), reading, impossible, executor).ok());
}

TEST_CASE("app/verify: a model that may lack anchors is read in four ways, as four tests, and the best is told") {
  using namespace compmark;
  constexpr int message_bits = 24;
  VerifyFiles files("compmark-app-pruned", message_bits);
  const testing::ScratchFolder& folder = files.folder;
  ThreadExecutor& executor = files.executor;
  ReadingSettings& reading = files.reading;
  for (int number = 1; number <= 6; ++number) {
    const OwnerKey key = testing::small_key(number, message_bits);
    const Result<VerificationReport> best = verify_pruned(key, reading, VerifySettings{}, executor);
    REQUIRE(best.ok());
    REQUIRE(best->missing_share.has_value());
    CHECK(best->verification.settings.tries == 4);
    CHECK(best->verification.p_corrected == std::min(1.0, 4 * best->verification.evidence.p_value));
    const Result<VerificationReport> as_is = verify_files(key, reading, VerifySettings{}, executor);
    REQUIRE(as_is.ok());
    std::size_t most = 0;
    for (const double share : pruned_shares) {
      ReadingSettings lacking = reading;
      lacking.missing_share = share;
      const Result<VerificationReport> one = verify_files(key, lacking, VerifySettings{}, executor);
      REQUIRE(one.ok());
      CHECK_FALSE(one->missing_share.has_value());
      most = std::max(most, one->verification.evidence.matches);
      // The control: what stands in for others is read otherwise.
      CHECK((one->verification.fused == as_is->verification.fused) == (share == 0));
      if (share == *best->missing_share) CHECK(one->verification.fused == best->verification.fused);
    }
    CHECK(best->verification.evidence.matches == most);
  }

  VerifySettings many;
  many.tries = largest_tries / 2;
  CHECK(verify_pruned(testing::small_key(1, message_bits), reading, many, executor).error().problem ==
        "is above 1152921504606846976, and each is 4 tests here");
  ReadingSettings pictures = reading;
  pictures.model.clear();
  pictures.images = {folder.path / "none.png"};
  CHECK(verify_pruned(testing::small_key(1, message_bits), pictures, VerifySettings{}, executor).error().field ==
        "--pruned");
  pictures.missing_share = 0.2;
  CHECK(verify_files(testing::small_key(1, message_bits), pictures, VerifySettings{}, executor).error().field ==
        "--pruned");
  reading.missing_share = 1;
  const Error none = verify_files(testing::small_key(1, message_bits), reading, VerifySettings{}, executor).error();
  CHECK(none.field == "missing_share");
  CHECK(none.file == reading.model.string());
}

TEST_CASE("app/verify: either way gives the reading with more matches, as two tests, and says which it is") {
  using namespace compmark;
  constexpr int message_bits = 32, side = 48;
  const testing::ScratchFolder folder("compmark-app-mirrored");
  ThreadExecutor executor(2);
  const auto pixels = [&](std::uint64_t number, bool mirrored) {  // squares of drawn colours
    const Random random(8, number, random_stage("mirrored"));
    std::vector<float> planes;
    for (std::uint64_t c = 0; c < 3; ++c) {
      for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
          const int at = y / 4 * side + (mirrored ? side - 1 - x : x) / 4;
          planes.push_back(static_cast<float>(random.uniform(3 * static_cast<std::uint64_t>(at) + c)));
        }
      }
    }
    return planes;
  };
  const auto view = [&](const std::vector<float>& planes) {
    return ImageView<const float>{planes.data(), 3, side, side};
  };
  DecoderWeights weights = random_carrier_network(3, InputConvention{}, 8, 64);
  std::vector<std::vector<float>> others;
  for (std::uint64_t n = 1; n <= 80; ++n) others.push_back(pixels(n, false));
  REQUIRE(calibrate_carriers(
      weights, others.size(), [&](std::size_t i) { return view(others[i]); }, message_bits, true, executor));
  const auto picture = [&](const char* name, bool mirrored) {
    ReadingSettings reading;
    reading.decoder = folder.path / "carrier.safetensors";
    reading.images = {folder.path / name};
    REQUIRE(write_png(reading.images[0], view(pixels(0, mirrored))).ok());
    return reading;
  };
  REQUIRE(write_decoder<SafetensorsWriter>(weights, folder.path / "carrier.safetensors").ok());
  const ReadingSettings plain = picture("plain.png", false), turned = picture("turned.png", true);
  int mirrored_wins = 0, apart = 0;
  for (int number = 1; number <= 12; ++number) {
    const OwnerKey key = testing::small_key(number, message_bits);
    VerifySettings settings;
    settings.tries = 3;
    const auto one_way = [&](const ReadingSettings& reading) {
      const Result<VerificationReport> report = verify_files(key, reading, settings, executor);
      if (!report) FAIL(report.error().line());
      CHECK_FALSE(report->mirrored.has_value());
      return report->verification;
    };
    const Verification as_it_is = one_way(plain), mirror_image = one_way(turned);
    const bool wins = mirror_image.evidence.matches > as_it_is.evidence.matches;
    const Result<VerificationReport> both = verify_either_way(key, plain, settings, executor);
    REQUIRE(both.ok());
    CHECK(both->mirrored == wins);
    CHECK(both->verification.fused == (wins ? mirror_image : as_it_is).fused);
    CHECK(both->verification.settings.tries == 6);
    CHECK(both->verification.p_corrected == std::min(1.0, 6 * both->verification.evidence.p_value));
    const Result<VerificationReport> back = verify_either_way(key, turned, settings, executor);
    REQUIRE(back.ok());
    CHECK(back->verification.evidence.matches == both->verification.evidence.matches);  // whichever file was mirrored
    mirrored_wins += wins;
    apart += as_it_is.fused != mirror_image.fused;
  }
  CHECK(apart == 12);  // the control: read one way only, a picture and its mirror image are two
  CHECK(mirrored_wins > 0);
  CHECK(mirrored_wins < 12);
}
