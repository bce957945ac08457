// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/app/informed.hpp>
#include <compmark/app/spread.hpp>
#include <compmark/core/random.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/scene/register/camera_step.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/picture.hpp"
#include "support/tool.hpp"

namespace informed_test {
namespace {

using namespace compmark;
namespace fs = std::filesystem;

/// A model, the same with a spread mark, and pictures of both from a camera that neither stores.
struct InformedFiles {
  testing::ScratchFolder folder{"compmark-app-informed"};
  fs::path unmarked = folder.path / "unmarked.safetensors", marked = folder.path / "marked.safetensors";
  ThreadExecutor executor{2};
  OwnerKey key = testing::small_key(1, 32), other = testing::small_key(2, 32);
  ReadingSettings reading;

  InformedFiles() {
    Model<recipes::Scaffold> model = testing::small_model<recipes::Scaffold>(5, 500);
    model.render.background = {0, 0, 0};
    REQUIRE(write_model(unmarked, model, testing::larger_info("scaffold", 4)).ok());
    SpreadMarkSettings settings;
    settings.model = unmarked;
    settings.out = marked;
    settings.psnr = 36;
    REQUIRE(mark_spread(key, settings, executor).ok());
    reading.unmarked = unmarked;
    reading.decoder = folder.path / "decoder.safetensors";
    testing::write_decoder(reading.decoder, 32);
  }
  /// A render from an unknown camera, the second another one, darker, with noise.
  fs::path picture(const fs::path& model, const std::string& name, bool mirrored = false, double further = 0) {
    Result<AnyModel> opened = AnyModel::open(model, executor);
    REQUIRE(opened.ok());
    Camera<double> camera = testing::larger_info("scaffold", 4).views[0].camera;
    camera = moved(camera, {0.03 + further, -0.02, 0.1, 0.05, 0.02 - further, 0.04, 0, 0, 0}).resized(160, 128);
    const Result<RenderedView> render = opened->render(camera, executor);
    REQUIRE(render.ok());
    std::vector<float> pixels(render->image.data, render->image.data + render->image.size());
    const Random random(further > 0 ? 9 : 8, 0, random_stage("test/noise"));
    for (std::size_t i = 0; i < pixels.size(); ++i)
      pixels[i] = std::clamp(0.9f * pixels[i] + static_cast<float>(0.01 * random.normal(i)), 0.0f, 1.0f);
    if (mirrored) {
      for (auto row = pixels.begin(); row != pixels.end(); row += 160) std::reverse(row, row + 160);
    }
    const fs::path path = folder.path / name;
    REQUIRE(write_png(path, ImageView<const float>{pixels.data(), 3, 128, 160}).ok());
    return path;
  }
  Result<InformedReport> verify(const OwnerKey& whose, const fs::path& image) {
    reading.images = {image};
    return verify_informed(whose, reading, VerifySettings{}, executor);
  }
  /// A picture of one colour.
  fs::path flat(const std::string& name, int width, int height) {
    const std::vector<float> pixels(static_cast<std::size_t>(3 * width * height), 0.5f);
    REQUIRE(write_png(folder.path / name, ImageView<const float>{pixels.data(), 3, height, width}).ok());
    return folder.path / name;
  }
};

}  // namespace

TEST_CASE(
    "app/informed: one picture of unknown camera proves the mark of this key, and no other; an unmarked one nothing") {
  InformedFiles files;
  const Result<InformedReport> own = files.verify(files.key, files.picture(files.marked, "marked.png"));
  REQUIRE(own.ok());
  REQUIRE(own->pictures.size() == 1);
  MESSAGE("deviations ", own->spread.deviations, ", likeness ", own->pictures[0].likeness);
  CHECK(own->pictures[0].found);
  CHECK(own->spread.p_value < 1e-8);
  CHECK(own->together.verdict == Verdict::detected);
  CHECK(own->report.verification.verdict != Verdict::detected);  // nobody hid a message here
  CHECK(own->together.settings.tries == 2);
  CHECK(own->together.p_corrected == 2 * own->spread.p_value);
  CHECK(together_text(*own).find("together    " + detail::short_number(own->together.p_corrected)) == 0);
  CHECK(verdict_text(own->together).find("DETECTED: ") == 0);
  // The evidence of the message speaks of the message alone.
  CHECK(evidence_text(own->report.verification).find(detail::short_number(own->together.p_corrected)) ==
        std::string::npos);
  CHECK(own->report.sources.unmarked == "unmarked.safetensors");
  const std::string text = informed_text(*own);
  CHECK(text.find("picture     marked.png: camera found, spread mark at ") == 0);
  const auto json = informed_json<nlohmann::json>(*own);
  CHECK(json["pictures"][0]["name"] == "marked.png");
  CHECK(json["spread"]["p_value"] == own->spread.p_value);
  CHECK(json["message"]["p_corrected"] == own->report.verification.p_corrected);

  const Result<InformedReport> wrong = files.verify(files.other, files.folder.path / "marked.png"),
                               none = files.verify(files.key, files.picture(files.unmarked, "plain.png"));
  REQUIRE(wrong.ok());
  REQUIRE(none.ok());
  CHECK(wrong->spread.p_value > 1e-3);
  CHECK(wrong->together.verdict != Verdict::detected);
  CHECK(none->pictures[0].found);
  CHECK(none->spread.p_value > 1e-3);
  CHECK(none->together.verdict != Verdict::detected);

  // Mirrored, where that is looked for; and a picture of something else has no camera.
  const fs::path turned = files.picture(files.marked, "mirrored.png", true);
  files.reading.mirrored = true;
  const Result<InformedReport> mirrored = files.verify(files.key, turned);
  REQUIRE(mirrored.ok());
  CHECK(mirrored->pictures[0].mirrored);
  CHECK(mirrored->spread.p_value < 1e-8);
  files.reading.mirrored = false;
  const std::vector<float> elsewhere = testing::textured_picture(96, 3);
  REQUIRE(write_png(files.folder.path / "elsewhere.png", ImageView<const float>{elsewhere.data(), 3, 96, 96}).ok());
  const Result<InformedReport> far = files.verify(files.key, files.folder.path / "elsewhere.png");
  REQUIRE(far.ok());
  CHECK_FALSE(far->pictures[0].found);
  CHECK(far->spread.p_value == 1);
  CHECK(informed_text(*far).find("no camera of this scene") != std::string::npos);
}

TEST_CASE(
    "app/informed: pictures without a camera are read as they are, and hinder no other; pictures speak together") {
  InformedFiles files;
  const fs::path marked = files.picture(files.marked, "a.png"),
                 second = files.picture(files.marked, "b.png", false, .02);
  const Result<InformedReport> one = files.verify(files.key, marked), other = files.verify(files.key, second);
  REQUIRE(one.ok());
  REQUIRE(other.ok());
  files.reading.images = {marked, second, files.flat("flat.png", 63, 51), files.flat("small.png", 30, 20)};
  files.reading.mirrored = true;
  std::vector<std::string> compared;
  const Result<InformedReport> all =
      verify_informed(files.key, files.reading, VerifySettings{}, files.executor, {},
                      [&](const std::string& name, ImageView<const float> picture, ImageView<const float> render) {
                        CHECK(picture.height == render.height);
                        compared.push_back(name);
                      });
  REQUIRE(all.ok());
  REQUIRE(all->pictures.size() == 4);
  CHECK(compared == std::vector<std::string>{"a.png", "b.png"});
  // From nearly one place they say nearly the same: 6.94 and 7.02 deviations, 7.02 together. One that is lost in the
  // sum, or outweighs the other, would be seen.
  CHECK(all->spread.deviations > std::min(one->spread.deviations, other->spread.deviations));
  CHECK(all->spread.deviations > 0.99 * std::max(one->spread.deviations, other->spread.deviations));
  CHECK(all->spread.deviations != one->spread.deviations);
  // What a picture without a camera says is what a blind reading of it says.
  files.reading.mirrored = false;
  ReadingSettings blind = files.reading;
  blind.unmarked.clear();
  const Result<Reading> read = read_messages(blind, files.key, files.executor);
  REQUIRE(read.ok());
  for (const std::size_t i : {2u, 3u}) {
    CHECK_FALSE(all->pictures[i].found);
    CHECK_FALSE(all->pictures[i].mirrored);
    CHECK(all->report.views[i].logits == read->views[i].logits);
  }
  // Where the camera is known, what the unmarked render says is subtracted: little is left of what is read.
  const auto energy = [](const std::vector<double>& logits) {
    double sum = 0;
    for (const double z : logits) sum += z * z;
    return sum;
  };
  for (const std::size_t i : {0u, 1u}) CHECK(energy(all->report.views[i].logits) < 0.5 * energy(read->views[i].logits));
}

TEST_CASE("app/informed: pictures in memory are read as files are, and what it does not read is refused") {
  InformedFiles files;
  const fs::path path = files.picture(files.marked, "a.png");
  const Result<InformedReport> by_file = files.verify(files.key, path);
  REQUIRE(by_file.ok());
  const Result<OpenPicture> opened = open_picture(path);
  REQUIRE(opened.ok());
  const ImageBytes bytes = to_bytes(opened->image());
  files.reading.images.clear();
  CHECK(verify_informed(files.key, files.reading, VerifySettings{}, files.executor).error().field == "--images");
  files.reading.pictures = {{"a.png", opened->width, opened->height, 3, bytes.pixels}};
  const Result<InformedReport> in_memory = verify_informed(files.key, files.reading, VerifySettings{}, files.executor);
  REQUIRE(in_memory.ok());
  REQUIRE(in_memory->pictures.size() == 1);
  CHECK(in_memory->pictures[0].name == "a.png");
  CHECK(in_memory->spread.p_value == by_file->spread.p_value);
  CHECK(in_memory->report.views[0].logits == by_file->report.views[0].logits);
  // Both: of each one.
  files.reading.images = {path};
  const Result<InformedReport> both = verify_informed(files.key, files.reading, VerifySettings{}, files.executor);
  REQUIRE(both.ok());
  CHECK(both->pictures.size() == 2);
  files.reading.interference = path;
  CHECK(verify_informed(files.key, files.reading, VerifySettings{}, files.executor)
            .error()
            .line()
            .find("both subtract") != std::string::npos);
  files.reading.interference.clear();
  files.reading.model = files.marked;
  CHECK_FALSE(verify_informed(files.key, files.reading, VerifySettings{}, files.executor).ok());
}

TEST_CASE("app/informed: two tests are one verdict, at twice the price") {
  Verification message;
  message.settings.tries = 2;
  message.p_corrected = 0.4;
  CHECK(both_verdicts(message, {10, 1e-9, 100, 10}).verdict == Verdict::detected);
  CHECK(both_verdicts(message, {10, 1e-9, 100, 10}).p_corrected == 2e-9);
  CHECK(both_verdicts(message, {3, 1e-3, 100, 10}).verdict == Verdict::inconclusive);
  // Not without the price: 0.7e-6 is below the rate of 1e-6, twice that is not.
  CHECK(both_verdicts(message, {3, 0.7e-6, 100, 10}).verdict == Verdict::inconclusive);
  CHECK(both_verdicts(message, {3, 0.4e-6, 100, 10}).verdict == Verdict::detected);
  CHECK(both_verdicts(message, {0, 1, 100, 10}).verdict == Verdict::not_detected);
  CHECK(both_verdicts(message, {0, 1, 100, 10}).p_corrected == 0.4);
  message.p_corrected = 1e-9;
  message.verdict = Verdict::detected;
  CHECK(both_verdicts(message, {0, 1, 100, 10}).verdict == Verdict::detected);
}

TEST_CASE("app/informed: a count of tries that cannot be doubled is refused, before anything is read") {
  ThreadExecutor executor(1);
  VerifySettings many;
  const auto field = [&] {
    return verify_informed(testing::small_key(1, 32), ReadingSettings{}, many, executor).error().field;
  };
  for (const std::uint64_t tries : {largest_tries / 2 + 1, largest_tries, ~std::uint64_t{0}}) {
    CAPTURE(tries);
    many.tries = tries;
    CHECK(field() == "tries");
  }
  many.tries = largest_tries / 2;
  CHECK(field() == "--images");  // the next that is missing
}

TEST_CASE("app/informed: a message too short to decide is no reason where the spread mark could") {
  Verification message;
  message.settings.tries = 2;
  message.bits = 8;
  message.p_corrected = 0.4;
  message.verdict = Verdict::inconclusive;  // as verify_message has it without a threshold
  const Verification nothing = both_verdicts(message, {0.1, 0.9, 100, 10});
  CHECK(nothing.verdict == Verdict::not_detected);
  CHECK(verdict_text(nothing).find("NOT DETECTED: ") == 0);
  // 2 exp(-d^2 / 2) reaches 1e-6 from 5.387 deviations on: with 5.38 neither test could, of any number of cells.
  CHECK(both_verdicts(message, {0.1, 0.9, 30, 5.39}).verdict == Verdict::not_detected);
  for (const double most : {0.0, 5.38}) {
    const Verification neither = both_verdicts(message, {0.1, 0.9, 1000, most});
    CHECK(neither.verdict == Verdict::inconclusive);
    CHECK(verdict_text(neither).find("Use a longer message") != std::string::npos);
  }
  // Suspicious, and more pictures could decide, though not by the message.
  const Verification suspicious = both_verdicts(message, {3, 1e-3, 100, 10});
  CHECK(suspicious.verdict == Verdict::inconclusive);
  CHECK(verdict_text(suspicious).find("Read more views") != std::string::npos);
}

TEST_CASE(
    "app/informed: of two owners, both are read; the original of the second carries the mark of the first, and not the "
    "other way round (docs/threat_model.md)") {
  InformedFiles files;
  SpreadMarkSettings again;
  again.model = files.marked;  // who marks a copy that he bought takes it for the unmarked model
  again.out = files.folder.path / "twice.safetensors";
  again.psnr = 40;  // noise to the first mark
  REQUIRE(mark_spread(files.other, again, files.executor).ok());
  // Two pictures of a model, read with a key and what its owner calls unmarked.
  const auto read = [&](const OwnerKey& whose, const fs::path& by, const fs::path& model) {
    const std::string name = model.stem().string();
    files.reading.unmarked = by;
    files.reading.images = {files.picture(model, name + "_a.png"), files.picture(model, name + "_b.png", false, 0.02)};
    const Result<InformedReport> report = verify_informed(whose, files.reading, VerifySettings{}, files.executor);
    REQUIRE(report.ok());
    for (const auto& picture : report->pictures) CHECK(picture.found);
    MESSAGE(name, ": ", report->spread.p_value);
    return report->spread.p_value;
  };
  CHECK(read(files.key, files.unmarked, again.out) < 1e-6);
  CHECK(read(files.other, files.marked, again.out) < 1e-6);
  // Each looks at the other's original.
  CHECK(read(files.key, files.unmarked, files.marked) < 1e-6);
  CHECK(read(files.other, files.marked, files.unmarked) > 1e-3);
}

}  // namespace informed_test
