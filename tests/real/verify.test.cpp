// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The p-value on photographs, with the published HiDDeN decoder, which is biased on its input (docs/spec/watermark.md,
// 1.4): 10,000 random keys against unmarked photographs and against one that is marked in its pixels, and the wrong key
// on the marked one.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/watermark/decoder/decoder_file.hpp>
#include <compmark/watermark/decoder/decoder_winograd.hpp>
#include <compmark/watermark/decoder/hidden_decoder.hpp>
#include <compmark/watermark/pretrain/pixel_embedding.hpp>
#include <compmark/watermark/proof/calibrate.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <compmark/watermark/proof/report.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "support/data.hpp"

namespace {

using namespace compmark;
using Decoder = HiddenDecoder<0, 0, 0, float, WinogradOrDirect>;

OwnerKey owner(std::uint64_t number) {
  Digest256 secret{};
  secret[0] = std::byte{5};
  for (std::size_t i = 0; i < 8; ++i) secret[31 - i] = static_cast<std::byte>(number >> (8 * i) & 0xFF);
  return *make_key(secret, "2026-01-31T23:59:59Z", 48);
}

struct Photograph {
  int height = 0, width = 0;
  std::vector<float> pixels;
  [[nodiscard]] ImageView<const float> view() const { return {pixels.data(), 3, height, width}; }
  [[nodiscard]] ImageView<float> view() { return {pixels.data(), 3, height, width}; }
};
Photograph planes_of(const ImageBytes& bytes) {
  Photograph photo{bytes.height, bytes.width, {}};
  const std::size_t count = static_cast<std::size_t>(bytes.height) * static_cast<std::size_t>(bytes.width);
  photo.pixels.resize(3 * count);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < count; ++i)
      photo.pixels[c * count + i] = static_cast<float>(bytes.pixels[3 * i + c]) / 255.0f;
  }
  return photo;
}

}  // namespace

TEST_CASE(
    "mark/calibrate: 10,000 random keys keep the rates on photographs, unmarked and marked; only the right key is "
    "detected") {
  const auto data = testing::data_dir();
  if (!data || !std::filesystem::exists(*data / "weights/hidden_48.safetensors") ||
      !std::filesystem::is_directory(*data / "natural_crops256")) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  const auto file = read_safetensors(*data / "weights/hidden_48.safetensors");
  REQUIRE(file.ok());
  const auto weights = read_decoder(*file);
  REQUIRE(weights.ok());
  const auto decoder = Decoder::create(*weights);
  REQUIRE(decoder.ok());
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(*data / "natural_crops256"))
    if (entry.path().extension() == ".jpg" || entry.path().extension() == ".png") paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  REQUIRE(paths.size() > 1000);

  ThreadExecutor executor;
  Decoder::Context context;
  std::vector<ViewLogits> views;
  Photograph photo;
  for (std::size_t i = 0; i < paths.size(); i += 25) {
    const auto bytes = read_image(paths[i]);
    REQUIRE(bytes.ok());
    if (bytes->channels != 3) continue;
    photo = planes_of(*bytes);
    const auto view =
        read_logits(*decoder, ImageView<const float>(photo.view()), paths[i].filename().string(), context, executor);
    REQUIRE(view.ok());
    views.push_back(*view);
  }
  REQUIRE(views.size() > 30);
  const auto draw = [](std::size_t i) { return message_of(owner(i + 2)); };
  const auto unmarked = calibrate_null(views, {}, draw);
  REQUIRE(unmarked.ok());
  MESSAGE(calibration_text(*unmarked));
  CHECK(unmarked->holds());
  // Photographs are far from independent for this decoder: their p-values must not be multiplied, and a fixed message
  // would not do.
  CHECK(unmarked->images_worth < 0.8 * static_cast<double>(views.size()));
  CHECK(unmarked->largest_bias > 0.15);

  // The owner's message in the last photograph.
  const Message message = message_of(owner(1));
  std::vector<float> signs;
  for (std::size_t i = 0; i < message.size(); ++i) signs.push_back(message[i] ? 1.0f : -1.0f);
  Photograph marked = photo;
  PixelEmbedding<Decoder> embedding;
  PixelEmbeddingSettings settings;
  settings.steps = 40;
  settings.psnr = 38;
  settings.temperature = 10;  // the published whitening leaves logits of 0.07
  settings.augmentation = no_augmentation();
  embedding.embed(
      *decoder, ImageView<const float>(photo.view()), std::span<const float>(signs), settings, 1, [](auto&&...) {},
      marked.view(), executor);
  round_to_8bit<float>(marked.view(), marked.view());
  const double quality = psnr(ImageView<const float>(marked.view()), ImageView<const float>(photo.view()));
  CHECK(quality > 37.5);
  const auto view = read_logits(*decoder, ImageView<const float>(marked.view()), "marked", context, executor);
  REQUIRE(view.ok());
  const std::vector<ViewLogits> one{*view};
  const auto right = verify_message(message, one);
  REQUIRE(right.ok());
  MESSAGE("marked at " << quality << " dB: " << right->evidence.matches << " of 48 bits, p "
                       << right->evidence.p_value);
  CHECK(right->verdict == Verdict::detected);
  const auto others = calibrate_null(one, {}, draw);
  REQUIRE(others.ok());
  CHECK(others->holds());
  std::size_t most = 0;
  for (std::size_t k = 41; k <= 48; ++k) most += others->histogram[k];
  CHECK(most == 0);  // none of 10,000 wrong keys is detected

  const auto jpeg = decode_image(encode_jpeg(to_bytes(ImageView<const float>(marked.view())), 80), "jpeg");
  REQUIRE(jpeg.ok());
  const Photograph copy = planes_of(*jpeg);
  const auto again = read_logits(*decoder, copy.view(), "jpeg", context, executor);
  REQUIRE(again.ok());
  const std::vector<ViewLogits> compressed{*again};
  const auto after = verify_message(message, compressed);
  REQUIRE(after.ok());
  MESSAGE("after JPEG 80: " << after->evidence.matches << " of 48 bits, p " << after->evidence.p_value);
  CHECK(after->verdict == Verdict::detected);
}
