// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/reading.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/tool.hpp"

namespace {

using namespace compmark;
namespace fs = std::filesystem;

constexpr int bits = 8;

/// A model, a model of the same scene with other features, and a decoder, on disk.
struct ReadingFiles {
  testing::ScratchFolder folder{"compmark-app-reading"};
  fs::path model = folder.path / "model.safetensors", other = folder.path / "other.safetensors",
           decoder = folder.path / "decoder.safetensors";
  ThreadExecutor executor{2};
  ReadingFiles() {
    const ModelInfo info = testing::small_info("scaffold");
    REQUIRE(write_model(model, testing::small_model<recipes::Scaffold>(5), info).ok());
    REQUIRE(write_model(other, testing::small_model<recipes::Scaffold>(6), info).ok());
    testing::write_decoder(decoder, bits);
  }
  [[nodiscard]] ReadingSettings settings() const {
    ReadingSettings settings;
    settings.decoder = decoder;
    settings.model = model;
    return settings;
  }
  Result<Reading> read(const ReadingSettings& settings, const WorkObserver& observer = {}) {
    return read_messages(settings, std::nullopt, executor, observer);
  }
};

}  // namespace

TEST_CASE("app/reading: renders are read as the decoder reads their 8-bit pixels, and as the files of them are read") {
  ReadingFiles files;
  ReadingSettings settings = files.settings();
  settings.split = ViewChoice::all;
  const Result<Reading> renders = files.read(settings);
  if (!renders) FAIL(renders.error().line());
  REQUIRE(renders->views.size() == testing::small_views);
  CHECK(renders->bits == bits);
  CHECK(renders->sources.model == "model.safetensors");
  CHECK(renders->sources.model_sha256.size() == 64);

  Result<AnyModel> model = AnyModel::open(files.model, files.executor);
  REQUIRE(model.ok());
  const fs::path pictures = files.folder.path / "pictures";
  fs::create_directory(pictures);
  const LatticeDecoder<float> decoder = testing::small_decoder(bits);
  for (std::size_t i = 0; i < testing::small_views; ++i) {
    const Result<RenderedView> render = model->render(model->info().views[i], files.executor);
    REQUIRE(render.ok());
    round_to_8bit<float>(render->image, render->image);
    LatticeDecoder<float>::Context context;
    const Result<ViewLogits> typed =
        read_logits(decoder, ImageView<const float>(render->image), "", context, files.executor);
    REQUIRE(typed.ok());
    CHECK(typed->logits == renders->views[i].logits);
    REQUIRE(write_png(pictures / (std::to_string(i) + ".png"), render->image).ok());
  }
  settings.model.clear();
  settings.images = {pictures};
  const Result<Reading> images = files.read(settings);
  REQUIRE(images.ok());
  REQUIRE(images->views.size() == testing::small_views);
  CHECK(images->sources.model.empty());
  for (std::size_t i = 0; i < testing::small_views; ++i) CHECK(images->views[i].logits == renders->views[i].logits);

  // The same pictures in memory, behind one file.
  std::vector<ImageBytes> held;
  for (std::size_t i = 0; i < testing::small_views; ++i) {
    const Result<ImageBytes> picture = read_image(pictures / (std::to_string(i) + ".png"));
    REQUIRE(picture.ok());
    held.push_back(*picture);
  }
  settings.images = {pictures / "0.png"};
  for (const ImageBytes& picture : held)
    settings.pictures.push_back({"held", picture.width, picture.height, picture.channels, picture.pixels});
  const Result<Reading> in_memory = files.read(settings);
  REQUIRE(in_memory.ok());
  REQUIRE(in_memory->views.size() == testing::small_views + 1);
  CHECK(in_memory->views[0].name == "0.png");
  for (std::size_t i = 0; i < testing::small_views; ++i) {
    CHECK(in_memory->views[i + 1].logits == renders->views[i].logits);
    CHECK(in_memory->views[i + 1].name == "held");
    CHECK_FALSE(in_memory->views[i + 1].part);
  }
  settings.pictures.back().height -= 1;
  const Result<Reading> refused = files.read(settings);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().file == "held");
}

TEST_CASE("app/reading: of a page with text the picture is read alone, and its place is told") {
  ReadingFiles files;
  constexpr int height = 500, width = 640, channels = 3;
  std::vector<std::uint8_t> page(std::size_t{height} * width * channels, 255);
  const auto put = [&](int y, int x, int c, int value) {
    page[(static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)) * channels + static_cast<std::size_t>(c)] =
        static_cast<std::uint8_t>(value);
  };
  for (int line = 20; line < 470; line += line == 92 ? 280 : 18) {  // strokes of three pixels
    for (int x = 30; x < 600; x += 7) {
      for (int y = line; y < line + 9; ++y)
        for (int c = 0; c < channels; ++c)
          for (int w = 0; w < 3; ++w) put(y, x + w, c, 20);
    }
  }
  constexpr int top = 140, left = 200, side = 200;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      for (int c = 0; c < channels; ++c) put(top + y, left + x, c, 40 + (x * (c + 1) + 2 * y) % 160);
  ReadingSettings settings = files.settings();
  settings.model.clear();
  settings.pictures = {{"page", width, height, channels, page}};
  const Result<Reading> read = files.read(settings);
  REQUIRE(read.ok());
  REQUIRE(read->views[0].part);
  const PictureBox part = *read->views[0].part;
  CHECK(part.top > 92);
  CHECK(part.top <= top);
  CHECK(part.top + part.height >= top + side);
  CHECK(part.top + part.height <= 372);
  settings.pages = false;
  const Result<Reading> whole = files.read(settings);
  REQUIRE(whole.ok());
  CHECK_FALSE(whole->views[0].part);
  CHECK(whole->views[0].logits != read->views[0].logits);
  settings.pages = true;
  // It is what the part by itself is read as.
  std::vector<std::uint8_t> alone;
  for (int y = part.top; y < part.top + part.height; ++y) {
    const auto row = page.begin() + (std::ptrdiff_t{y} * width + part.left) * channels;
    alone.insert(alone.end(), row, row + std::ptrdiff_t{part.width} * channels);
  }
  settings.pictures = {{"part", part.width, part.height, channels, alone}};
  const Result<Reading> again = files.read(settings);
  REQUIRE(again.ok());
  CHECK_FALSE(again->views[0].part);
  CHECK(again->views[0].logits == read->views[0].logits);
}

TEST_CASE("app/reading: the cameras of a split are read, evenly spaced where fewer are asked for") {
  ReadingFiles files;
  ReadingSettings settings = files.settings();
  REQUIRE(files.read(settings).ok());
  CHECK(files.read(settings)->views[0].name == "view 2");  // the test's
  settings.split = ViewChoice::train;
  CHECK(files.read(settings)->views.size() == 2);
  settings.views = 1;
  const Result<Reading> one = files.read(settings);
  REQUIRE(one->views.size() == 1);
  CHECK(one->views[0].name == "view 0");
}

TEST_CASE("app/reading: what the unmarked model says by itself is subtracted") {
  ReadingFiles files;
  ReadingSettings settings = files.settings();
  const Result<Reading> alone = files.read(settings);
  settings.unmarked = files.other;
  const Result<Reading> less = files.read(settings);
  settings.unmarked.clear();
  settings.model = files.other;
  const Result<Reading> other = files.read(settings);
  REQUIRE((alone.ok() && less.ok() && other.ok()));
  bool differs = false;
  for (std::size_t b = 0; b < bits; ++b) {
    CHECK(less->views[0].logits[b] == alone->views[0].logits[b] - other->views[0].logits[b]);
    differs = differs || other->views[0].logits[b] != 0;
  }
  CHECK(differs);
  CHECK(less->sources.unmarked == "other.safetensors");

  // One whose lengths are counted otherwise shows something else from these cameras.
  ModelInfo scaled = testing::small_info("scaffold");
  scaled.unit = 2;
  REQUIRE(write_model(files.other, testing::small_model<recipes::Scaffold>(6), scaled).ok());
  settings = files.settings();
  settings.unmarked = files.other;
  const Result<Reading> refused = files.read(settings);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "--unmarked");
}

TEST_CASE("app/reading: the observer counts views, and one that says stop ends the reading") {
  ReadingFiles files;
  ReadingSettings settings = files.settings();
  settings.split = ViewChoice::all;
  std::vector<std::size_t> counted;
  REQUIRE(files
              .read(settings,
                    [&](std::size_t done, std::size_t total) {
                      CHECK(total == testing::small_views);
                      counted.push_back(done);
                      return true;
                    })
              .ok());
  CHECK(counted == std::vector<std::size_t>{1, 2, 3});
  const Result<Reading> stopped = files.read(settings, [](std::size_t, std::size_t) { return false; });
  REQUIRE_FALSE(stopped.ok());
  CHECK(stopped.error().kind == ErrorKind::cancelled);
}

TEST_CASE("app/reading: a decoder is of the key's length, and every wrong file is named for what it is") {
  ReadingFiles files;
  const OwnerKey wide = testing::small_key(1, 16), right = testing::small_key(1, bits);
  CHECK(open_decoder(files.decoder, &right).ok());
  CHECK(open_decoder(files.decoder, nullptr).ok());
  CHECK(open_decoder(files.decoder, &wide).error().problem.find("reads 8 bits, the key is for messages of 16") !=
        std::string::npos);
  CHECK(open_decoder(files.model, nullptr).error().line().find("model") != std::string::npos);
  // The decoder that comes with the program reads along the key's carriers, and says so.
  const Result<FileDecoder> keyless = open_decoder("weights/universal3_64.safetensors", nullptr);
  REQUIRE_FALSE(keyless.ok());
  CHECK(keyless.error().field == "--key");
  CHECK(keyless.error().problem.find("is missing, and this decoder reads along carriers") == 0);
  CHECK_FALSE(open_key(files.decoder).ok());
  ReadingSettings settings = files.settings();
  settings.model = files.decoder;
  const Result<Reading> decoder = files.read(settings);
  REQUIRE_FALSE(decoder.ok());
  CHECK(decoder.error().line().find("decoder") != std::string::npos);
  settings.images = {files.folder.path};
  CHECK(files.read(settings).error().problem == "are both given");
  settings.images.clear();
  settings.model.clear();
  CHECK(files.read(settings).error().problem == "are both missing");

  // Transparent pixels are what is behind them: black, if nobody says otherwise.
  const fs::path clear = files.folder.path / "clear.png";
  ImageBytes image{40, 40, 4, std::vector<std::uint8_t>(4 * 40 * 40, 100)};
  REQUIRE(write_png(clear, image).ok());
  settings.images = {clear};
  const Result<Reading> black = files.read(settings);
  REQUIRE(black.ok());
  settings.background = {1, 1, 1};
  const Result<Reading> white = files.read(settings);
  REQUIRE(white.ok());
  CHECK(black->views[0].logits != white->views[0].logits);
}
