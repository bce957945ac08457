// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The decoders of weights/: each is the file its card speaks of, loads, and reads a message from a procedural image
// marked at 38 dB.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/io/sha256.hpp"
#include "compmark/watermark/decoder/stored_decoder.hpp"
#include "compmark/watermark/pretrain/dead_leaves.hpp"
#include "compmark/watermark/pretrain/decoder_measure.hpp"
#include "watermark/proof/no_codec.hpp"

using namespace compmark;
using testing::NoCodec;

namespace {

/// From the project's root, where the tests run, or beside this file.
std::filesystem::path weights(const std::string& name) {
  const std::filesystem::path here = std::filesystem::path("weights") / name;
  if (std::filesystem::exists(here)) return here;
  return std::filesystem::path(__FILE__).parent_path().parent_path().parent_path() / here;
}

}  // namespace

TEST_CASE("decoder/lattice: the shipped decoders are those of their cards and read what is embedded at 38 dB") {
  SerialExecutor executor;
  for (const int bits : {32, 48, 64}) {
    CAPTURE(bits);
    const std::string name = "lattice_" + std::to_string(bits);
    const std::filesystem::path path = weights(name + ".safetensors");
    const Result<std::vector<std::byte>> bytes = read_file(path), card = read_file(weights(name + ".md"));
    REQUIRE(bytes.ok());
    REQUIRE(card.ok());
    const std::string text(reinterpret_cast<const char*>(card->data()), card->size());
    CHECK(text.find(Sha256{}.update(*bytes).hex()) != std::string::npos);
    const auto file = read_safetensors(path);
    REQUIRE(file.ok());
    const auto decoder = StoredDecoder<>::read(*file);
    REQUIRE(decoder.ok());
    REQUIRE(decoder->bits() == bits);

    constexpr int side = 128;
    const auto image = [](std::size_t i, std::vector<float>& pixels) {
      pixels.resize(3 * side * side);
      dead_leaves_image(11, i, {pixels.data(), 3, side, side});
      return ImageView<const float>{pixels.data(), 3, side, side};
    };
    PixelEmbeddingSettings settings;
    settings.steps = 20;
    settings.psnr = 38;
    settings.augmentation = no_augmentation();
    std::vector<float> pixels, marked(3 * side * side), signs(static_cast<std::size_t>(bits)), logits(signs.size());
    PixelEmbedding<StoredDecoder<>> embedding;
    int right = 0, by_chance = 0;
    constexpr std::size_t images = 2;
    for (std::size_t i = 0; i < images; ++i) {
      const ImageView<const float> original = image(i, pixels);
      for (std::size_t b = 0; b < signs.size(); ++b) signs[b] = (Random(1, i, 2).bits(b) & 1u) != 0 ? 1.0f : -1.0f;
      decoder->forward(original, std::span<float>(logits), embedding.context, executor);
      for (std::size_t b = 0; b < signs.size(); ++b) by_chance += logits[b] * signs[b] > 0 ? 1 : 0;
      const ImageView<float> view{marked.data(), 3, side, side};
      embedding.embed(*decoder, original, std::span<const float>(signs), settings, i, NoCodec{}, view, executor);
      for (float& value : marked) value = std::floor(value * 255 + 0.5f) / 255;
      decoder->forward(ImageView<const float>(view), std::span<float>(logits), embedding.context, executor);
      for (std::size_t b = 0; b < signs.size(); ++b) right += logits[b] * signs[b] > 0 ? 1 : 0;
    }
    const double total = static_cast<double>(images) * bits;
    CHECK(right >= 0.97 * total);
    CHECK(std::abs(by_chance - total / 2) < 2 * std::sqrt(total));  // four standard deviations: unmarked says nothing
  }
}
