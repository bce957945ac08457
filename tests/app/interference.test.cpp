// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/app/files.hpp>
#include <compmark/app/interference.hpp>
#include <compmark/app/reading.hpp>
#include <compmark/core/random.hpp>
#include <compmark/io/read_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <compmark/watermark/decoder/carrier_decoder.hpp>
#include <compmark/watermark/decoder/decoder_file.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/tool.hpp"

namespace interference_test {
namespace {

using namespace compmark;
namespace fs = std::filesystem;

constexpr int bits = 8;

/// An unmarked model and two decoders on disk: one without carriers, and one that needs a key.
struct InterferenceFiles {
  testing::ScratchFolder folder{"compmark-app-interference"};
  fs::path model = folder.path / "model.safetensors", lattice = folder.path / "lattice.safetensors",
           carrier = folder.path / "carrier.safetensors", out = folder.path / "interference.safetensors";
  ThreadExecutor executor{2};
  InterferenceFiles() {
    REQUIRE(write_model(model, testing::small_model<recipes::Scaffold>(5), testing::small_info("scaffold")).ok());
    testing::write_decoder(lattice, bits);
    DecoderWeights weights = random_carrier_network(3, InputConvention{}, 8, 64);
    std::vector<std::vector<float>> pictures(80, std::vector<float>(3 * 32 * 32));
    const Random random(9, 0, random_stage("test/interference"));
    std::uint64_t n = 0;
    for (std::vector<float>& picture : pictures) {
      for (float& value : picture) value = static_cast<float>(random.uniform(n++ / 4));
    }
    REQUIRE(calibrate_carriers(
        weights, pictures.size(),
        [&](std::size_t i) {
          return ImageView<const float>{pictures[i].data(), 3, 32, 32};
        },
        12, true, executor));
    REQUIRE(write_decoder<SafetensorsWriter>(weights, carrier).ok());
  }
  [[nodiscard]] InterferenceSettings measured_with(const fs::path& decoder) const {
    InterferenceSettings settings;
    settings.model = model;
    settings.decoder = decoder;
    settings.out = out;
    settings.views = 20;
    return settings;
  }
  [[nodiscard]] ReadingSettings read_with(const fs::path& decoder) const {
    ReadingSettings settings;
    settings.decoder = decoder;
    settings.model = model;
    settings.split = ViewChoice::all;
    settings.interference = out;
    return settings;
  }
};

double loudness(const Reading& reading) {
  double sum = 0;
  for (const ViewLogits& view : reading.views) {
    for (const double z : view.logits) sum += z * z;
  }
  return std::sqrt(sum);
}

}  // namespace

TEST_CASE("app/interference: with its file an unmarked model says less, by the formula, for every key") {
  InterferenceFiles files;
  for (const bool carriers : {false, true}) {
    CAPTURE(carriers);
    const fs::path& decoder = carriers ? files.carrier : files.lattice;
    const Result<MeasuredInterference> measured = measure_interference(files.measured_with(decoder), files.executor);
    if (!measured) FAIL(measured.error().line());
    CHECK(measured->deviation > 0);
    CHECK(measured->told > 0);
    CHECK(measured->told <= 1);
    for (const int number : {1, 2}) {
      const std::optional<OwnerKey> key = testing::small_key(number, bits);
      ReadingSettings settings = files.read_with(decoder);
      const Result<Reading> less = read_messages(settings, key, files.executor);
      settings.interference.clear();
      const Result<Reading> blind = read_messages(settings, key, files.executor);
      REQUIRE((less.ok() && blind.ok()));
      CHECK(less->sources.interference == "interference.safetensors");
      CHECK(less->sources.interference_sha256.size() == 64);
      CHECK(blind->sources.interference.empty());
      CHECK(loudness(*less) < 0.8 * loudness(*blind));

      const Result<CoverInterference> interference = open_interference(files.out, decoder, &*key);
      REQUIRE(interference.ok());
      Result<AnyModel> model = AnyModel::open(files.model, files.executor);
      REQUIRE(model.ok());
      const Result<RenderedView> render = model->render(model->info().views[0], files.executor);
      REQUIRE(render.ok());
      round_to_8bit<float>(render->image, render->image);
      PictureSketch<float> sketch;
      std::vector<double> expected = blind->views[0].logits;
      interference->subtract(sketch.of(ImageView<const float>(render->image), files.executor), expected);
      for (std::size_t b = 0; b < expected.size(); ++b)
        CHECK(less->views[0].logits[b] == doctest::Approx(expected[b]).epsilon(1e-5));
    }
  }
}

TEST_CASE("app/interference: the same file at any thread count, another one of another seed, and none when stopped") {
  InterferenceFiles files;
  InterferenceSettings settings = files.measured_with(files.carrier);
  const auto bytes = [&](std::size_t threads) {
    ThreadExecutor executor(threads);
    REQUIRE(measure_interference(settings, executor).ok());
    return *read_file(files.out);
  };
  const auto one = bytes(1);
  CHECK(one == bytes(3));
  settings.seed = 1;
  CHECK(one != bytes(1));
  fs::remove(files.out);
  std::size_t counted = 0;
  const Result<MeasuredInterference> stopped =
      measure_interference(settings, files.executor, [&](std::size_t done, std::size_t total) {
        CHECK(total == 20);
        counted = done;
        return done < 3;
      });
  REQUIRE_FALSE(stopped.ok());
  CHECK(stopped.error().kind == ErrorKind::cancelled);
  CHECK(counted == 3);
  CHECK_FALSE(fs::exists(files.out));
}

TEST_CASE("app/interference: another decoder's file, a wrong one and a damaged one are a line each") {
  InterferenceFiles files;
  REQUIRE(measure_interference(files.measured_with(files.carrier), files.executor).ok());
  const std::optional<OwnerKey> key = testing::small_key(1, bits);
  const auto refused = [&](const ReadingSettings& settings, const std::string& words) {
    const Result<Reading> read = read_messages(settings, key, files.executor);
    REQUIRE_FALSE(read.ok());
    CAPTURE(read.error().line());
    CHECK(read.error().line().find(words) != std::string::npos);
  };
  CHECK(read_messages(files.read_with(files.carrier), key, files.executor).ok());
  refused(files.read_with(files.lattice), "was measured for another decoder");
  ReadingSettings settings = files.read_with(files.carrier);
  settings.unmarked = files.model;
  refused(settings, "do not go together");
  settings = files.read_with(files.carrier);
  settings.interference = files.carrier;
  refused(settings, "decoder");
  settings.interference = files.folder.path / "none.safetensors";
  refused(settings, "none.safetensors");

  CoverInterference bad = *open_interference(files.out, files.carrier, nullptr);
  bad.mean[0] = std::numeric_limits<float>::quiet_NaN();
  REQUIRE(write_cover_interference<SafetensorsWriter>(bad, "", files.out).ok());
  refused(files.read_with(files.carrier), "NaN");
  bad = {};  // of the decoder, but not of its size
  bad.mean.assign(5, 0.0f);
  bad.sketch.assign(64, 0.0f);
  bad.coefficient.assign(5, 0.0f);
  bad.decoder_sha256 = *file_sha256(files.carrier);
  REQUIRE(write_cover_interference<SafetensorsWriter>(bad, "", files.out).ok());
  refused(files.read_with(files.carrier), "another decoder");
  fs::resize_file(files.out, fs::file_size(files.out) / 2);
  refused(files.read_with(files.carrier), "interference.safetensors");

  InterferenceSettings few = files.measured_with(files.carrier);
  few.views = 1;
  CHECK(measure_interference(few, files.executor).error().field == "--views");
  few = files.measured_with(files.model);
  CHECK_FALSE(measure_interference(few, files.executor).ok());
}

}  // namespace interference_test
