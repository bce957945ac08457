// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/app/compress.hpp>
#include <compmark/app/spread.hpp>
#include <compmark/core/random.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <utility>
#include <vector>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/tool.hpp"

namespace spread_test {
namespace {

using namespace compmark;

struct SpreadFiles {
  testing::ScratchFolder folder{"compmark-app-spread"};
  std::filesystem::path unmarked = folder.path / "unmarked.safetensors", marked = folder.path / "marked.safetensors";
  ThreadExecutor executor{2};
  SpreadFiles() {
    Model<recipes::Scaffold> model = testing::small_model<recipes::Scaffold>(5, 500);
    model.render.background = {0, 0, 0};
    REQUIRE(write_model(unmarked, model, testing::larger_info("scaffold", 4)).ok());
  }
};

std::vector<float> shown(AnyModel& model, const Camera<double>& camera, ThreadExecutor& executor) {
  const Result<RenderedView> render = model.render(camera, executor);
  REQUIRE(render.ok());
  return {render->image.data, render->image.data + render->image.size()};
}

}  // namespace

TEST_CASE(
    "app/spread: a model is marked to the decibel, and a noisy render of it says the key, no other, at any thread "
    "count") {
  SpreadFiles files;
  SpreadMarkSettings settings;
  settings.model = files.unmarked;
  settings.out = files.marked;
  settings.psnr = 42;
  const OwnerKey key = testing::small_key(1, 48), other = testing::small_key(2, 48);
  const Result<SpreadMarked> made = mark_spread(key, settings, files.executor);
  REQUIRE(made.ok());
  MESSAGE(made->cells, " cells, ", made->psnr, " dB");
  CHECK(made->psnr == doctest::Approx(42).epsilon(0.005));
  CHECK(made->cells >= 64);

  Result<AnyModel> unmarked = AnyModel::open(files.unmarked, files.executor),
                   marked = AnyModel::open(files.marked, files.executor);
  REQUIRE(unmarked.ok());
  REQUIRE(marked.ok());
  Result<SpreadReader> reader = SpreadReader::make(*unmarked, files.executor);
  REQUIRE(reader.ok());
  CHECK(reader->cells().place.size() == made->cells);
  const Camera<double> camera = testing::larger_info("scaffold", 4).views[0].camera.resized(160, 128);
  const std::vector<float> render = shown(*unmarked, camera, files.executor), weight(render.size() / 3, 1.0f);
  const ImageView<const float> plain{render.data(), 3, 128, 160};
  const auto sums_of = [&](AnyModel& model, double noise, ThreadExecutor& executor) {
    std::vector<float> picture = shown(model, camera, executor);
    const Random random(8, 0, random_stage("test/noise"));
    for (std::size_t i = 0; i < picture.size(); ++i) {
      picture[i] += static_cast<float>(noise * random.normal(i));
      picture[i] = std::round(255 * std::clamp(picture[i], 0.0f, 1.0f)) / 255;
    }
    std::vector<double> sums(reader->cells().place.size(), 0.0);
    REQUIRE(reader->add({picture.data(), 3, 128, 160}, plain, weight, camera, executor, sums).ok());
    return sums;
  };
  const std::vector<std::int8_t> own = spread_signs(key, reader->cells()),
                                 others = spread_signs(other, reader->cells());
  const std::vector<double> sums = sums_of(*marked, 0.02, files.executor);
  const SpreadEvidence evidence = spread_evidence(own, sums), wrong = spread_evidence(others, sums),
                       nothing = spread_evidence(own, sums_of(*unmarked, 0.02, files.executor));
  MESSAGE("deviations ", evidence.deviations, ", another key ", wrong.deviations, ", unmarked ", nothing.deviations);
  CHECK(evidence.p_value < 1e-4);
  CHECK(wrong.p_value > 1e-3);
  CHECK(nothing.p_value > 1e-3);
  // The null on what real pictures say, marked and not: other keys are at most p with probability p.
  for (const std::vector<double>& said : {sums, sums_of(*unmarked, 0.02, files.executor)}) {
    constexpr std::size_t keys = 2000;
    std::array<std::size_t, 2> hits{};
    for (int number = 100; number < 100 + static_cast<int>(keys); ++number) {
      const double p = spread_evidence(spread_signs(testing::small_key(number, 48), reader->cells()), said).p_value;
      hits[0] += p <= 0.1;
      hits[1] += p <= 0.01;
    }
    CHECK(static_cast<double>(hits[0]) <= 0.1 * keys + 4 * std::sqrt(0.1 * keys));
    CHECK(static_cast<double>(hits[1]) <= 0.01 * keys + 4 * std::sqrt(0.01 * keys));
    CHECK(hits[0] > 0);
  }
  ThreadExecutor alone(1);
  CHECK(sums_of(*marked, 0.02, alone) == sums);
}

TEST_CASE("app/spread: a compressed file that says the side has the cubes of the model that was marked, to the bit") {
  SpreadFiles files;
  Model<recipes::HacScaffold> made = testing::small_model<recipes::HacScaffold>(5, 500);
  made.render.background = {0, 0, 0};
  ModelInfo info = testing::larger_info("hac", 4);
  for (double& x : info.views[2].camera.center_world) x *= 1.1;  // the file keeps this camera alone
  REQUIRE(write_model(files.unmarked, made, info).ok());
  Result<AnyModel> model = AnyModel::open(files.unmarked, files.executor);
  REQUIRE(model.ok());
  const Result<SpreadReader> of_model = SpreadReader::make(*model, files.executor);
  REQUIRE(of_model.ok());
  Result<CodecModel> coded = model->coded();
  REQUIRE(coded.ok());
  const std::filesystem::path cmk = files.folder.path / "unmarked.cmk", back = files.folder.path / "back.safetensors";
  const auto reader_of = [&](const std::filesystem::path& file) {
    Result<AnyModel> opened = AnyModel::open(file, files.executor);
    REQUIRE(opened.ok());
    const Result<SpreadReader> reader = SpreadReader::make(*opened, files.executor);
    REQUIRE(reader.ok());
    return std::pair(reader->cell_side(), reader->cells().place);
  };
  const auto sorted = [](std::vector<std::array<std::int64_t, 3>> places) {
    std::sort(places.begin(), places.end());
    return places;
  };
  // As files of before: from what it keeps, which gives other cubes.
  REQUIRE(write_coded(cmk, *coded, files.executor).ok());
  const auto before = reader_of(cmk);
  CHECK(std::abs(before.first / of_model->cell_side() - 1) > 0.02);
  CHECK(sorted(before.second) != sorted(of_model->cells().place));

  REQUIRE(store_spread_side(*model, *coded).ok());
  REQUIRE(write_coded(cmk, *coded, files.executor).ok());
  const auto after = reader_of(cmk);
  CHECK(after.first == of_model->cell_side());
  CHECK(sorted(after.second) == sorted(of_model->cells().place));
  // What is made of that file keeps it.
  REQUIRE(decompress_file(cmk, back, CodecDecodeSettings{}, files.executor).ok());
  CHECK(reader_of(back).first == of_model->cell_side());

  for (const CodecValue& wrong :
       {CodecValue(0.0), CodecValue(-1.0), CodecValue(std::nan("")), CodecValue(std::int64_t{1})}) {
    coded->metadata["spread_side"] = wrong;
    REQUIRE(write_coded(cmk, *coded, files.executor).ok());
    const Result<AnyModel> refused = AnyModel::open(cmk, files.executor);
    REQUIRE_FALSE(refused.ok());
    CHECK(refused.error().field == "META.spread_side");
  }
  info.spread_side = std::numeric_limits<double>::infinity();  // JSON has none
  REQUIRE(write_model(back, made, info).ok());
  CHECK(AnyModel::open(back, files.executor).error().field.find("__metadata__.info") == 0);
}

TEST_CASE("app/spread: what cannot be marked is said, and nothing is written") {
  SpreadFiles files;
  SpreadMarkSettings settings;
  settings.model = files.unmarked;
  settings.out = files.marked;
  const OwnerKey key = testing::small_key(1, 48);
  for (const double psnr : {0.0, 29.0, 81.0, std::nan("")}) {
    settings.psnr = psnr;
    const Result<SpreadMarked> made = mark_spread(key, settings, files.executor);
    REQUIRE_FALSE(made.ok());
    CHECK(made.error().field == "--psnr");
  }
  settings.psnr = 50;
  settings.model = files.folder.path / "none.safetensors";
  CHECK_FALSE(mark_spread(key, settings, files.executor).ok());
  // 60 anchors are fewer cells than evidence takes.
  settings.model = files.folder.path / "few.safetensors";
  REQUIRE(write_model(settings.model, testing::small_model<recipes::Scaffold>(), testing::small_info("scaffold")).ok());
  const Result<SpreadMarked> few = mark_spread(key, settings, files.executor);
  REQUIRE_FALSE(few.ok());
  CHECK(few.error().file == settings.model.string());
  CHECK(few.error().problem.find("too few for evidence") != std::string::npos);
  CHECK_FALSE(std::filesystem::exists(files.marked));
}

}  // namespace spread_test
