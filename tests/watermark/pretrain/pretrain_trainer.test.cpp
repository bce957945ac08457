// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/splat/optim/adam.hpp"
#include "compmark/watermark/decoder/lattice_file.hpp"
#include "compmark/watermark/decoder/stored_decoder.hpp"
#include "compmark/watermark/pretrain/dead_leaves.hpp"
#include "compmark/watermark/pretrain/decoder_measure.hpp"
#include "compmark/watermark/pretrain/lattice_network.hpp"
#include "compmark/watermark/pretrain/trainer.hpp"
#include "compmark/watermark/pretrain/training_file.hpp"
#include "watermark/proof/no_codec.hpp"

using namespace compmark;
using testing::NoCodec;

namespace {

using Network = LatticeNetwork<float>;

struct Leaves {
  [[nodiscard]] static std::size_t size() { return 20; }
  static void read(std::size_t index, const Random& /*random*/, int /*side*/, ImageView<float> image) {
    dead_leaves_image(3, index, image);
  }
};

LatticeDecoder<float> start() {
  LatticeSettings settings;
  settings.bits = 6;
  settings.features = 16;
  settings.sigma = {1.5, 3};
  settings.stride = 2;
  LatticeDecoder<float> decoder(settings, random_lattice<float>(settings, std::vector<double>{0.1}, 1));
  LatticeDecoder<float>::Context context;
  SerialExecutor executor;
  std::vector<double> features;
  std::vector<float> pixels(3 * 32 * 32);
  for (std::size_t i = 0; i < 40; ++i) {
    dead_leaves_image(3, i, {pixels.data(), 3, 32, 32});
    decoder.pool({pixels.data(), 3, 32, 32}, context, executor);
    features.insert(features.end(), context.pooled.begin(), context.pooled.end());
  }
  lattice_head<float>(decoder, features, 1);
  return decoder;
}

PretrainSettings short_run() {
  PretrainSettings settings;
  settings.steps = 24;
  settings.batch = 3;
  settings.side = 32;
  settings.life = 8;
  return settings;
}

struct Run {
  ParameterArena<float> arena;
  Network network;
  Adam<float> adam;
  AdamState<float> moments;
  Pretrainer<Network> trainer;
  PretrainState<float> state;
  Pretrainer<Network>::Context context;
  double loss = 0;

  explicit Run(const PretrainSettings& settings) : network(start(), arena), trainer(settings) {
    adam.prepare(arena.layout(), moments);
    trainer.prepare(Leaves{}, 6, state);
  }
  template <class E>
  void steps(int count, E& executor) {
    for (int i = 0; i < count; ++i)
      loss = trainer.step(Leaves{}, network, arena, adam, moments, state, context, NoCodec{}, executor).loss;
  }
  [[nodiscard]] std::vector<float> values() const { return {arena.all_values().begin(), arena.all_values().end()}; }
};

std::filesystem::path temporary(const std::string& name) {
  return std::filesystem::temp_directory_path() / ("compmark_pretrain_" + name);
}

}  // namespace

TEST_CASE("pretrain/pretrain_trainer: a resumed run has the bits of an uninterrupted one, at any number of threads") {
  SerialExecutor serial;
  ThreadExecutor threads(3);
  const PretrainSettings settings = short_run();
  Run whole(settings);
  const std::vector<float> before = whole.values();
  whole.steps(20, serial);
  CHECK(whole.values() != before);

  Run first(settings);
  first.steps(11, threads);
  const std::filesystem::path path = temporary("checkpoint.safetensors");
  REQUIRE(write_pretrain_state<SafetensorsWriter>(first.arena, first.moments, first.state, "run a", path));
  Run second(settings);
  const auto file = read_safetensors(path);
  REQUIRE(file);
  REQUIRE(read_pretrain_state(*file, "run a", second.arena, second.moments, second.state));
  second.steps(9, serial);
  CHECK(second.values() == whole.values());
  CHECK(second.loss == whole.loss);

  Run other(settings);
  const auto refused = read_pretrain_state(*file, "run b", other.arena, other.moments, other.state);
  REQUIRE(!refused);
  CHECK(refused.error().field == "__metadata__.identity");
  std::filesystem::remove(path);
}

TEST_CASE("pretrain/pretrain_trainer: curriculum and rate") {
  PretrainSettings settings = short_run();
  settings.steps = 1000;
  CHECK(pretrain_psnr(settings, 0) == settings.first_psnr);
  CHECK(pretrain_psnr(settings, 900) == settings.psnr);
  CHECK(pretrain_rate(settings, 0) < 0.2 * settings.rate);
  CHECK(pretrain_rate(settings, 20) == doctest::Approx(settings.rate).epsilon(0.01));
  CHECK(pretrain_rate(settings, 1000) == doctest::Approx(settings.rate / 50));
  int kinds = 0, last = 0;
  for (std::int64_t iteration = 0; iteration < 1000; iteration += 10) {  // one after the other, none leaves
    const AugmentationSettings now = pretrain_augmentation(settings, iteration);
    kinds = 0;
    for (const double w : now.weight) kinds += w > 0 ? 1 : 0;
    CHECK(kinds >= last);
    last = kinds;
    if (iteration == 0) CHECK(kinds == 1);
  }
  CHECK(kinds == 8);
}

TEST_CASE("pretrain/pretrain_trainer: an embedded message reads back, and another decoder reads nothing") {
  SerialExecutor executor;
  const LatticeDecoder<float> decoder = start();
  PixelEmbeddingSettings settings;
  settings.steps = 40;
  settings.psnr = 36;
  settings.augmentation = no_augmentation();
  const auto image = [](std::size_t i, std::vector<float>& pixels) {  // image 0 is black: gates closed, half its bits
    pixels.resize(3 * 48 * 48);
    dead_leaves_image(8, i + 1, {pixels.data(), 3, 48, 48});
    return ImageView<const float>{pixels.data(), 3, 48, 48};
  };
  const DecoderMeasurement result = measure_decoder(decoder, 6, image, settings, 1, NoCodec{}, executor);
  CHECK(result.accuracy[0] >= 35.0 / 36);
  CHECK(result.psnr > 35.9);
  int spread = 0;
  for (std::size_t d = 0; d < result.accuracy.size(); ++d) {
    const double below = result.accuracy[d] - result.worst[d], square = result.error[d] * result.error[d];
    CHECK(below > -1e-9);
    CHECK(square * 30 >= below * below - 1e-9);                    // one image alone is that far from the mean
    CHECK(square * 5 <= below * (1 - result.accuracy[d]) + 1e-9);  // Bhatia and Davis: values between worst and 1
    spread += square > 0 ? 1 : 0;
  }
  CHECK(spread > 3);  // noise 0.1 and its like are not read everywhere

  // The control: the same marked image through a decoder of another seed.
  LatticeDecoder<float> other(decoder.settings(),
                              random_lattice<float>(decoder.settings(), std::vector<double>{0.1}, 2));
  other.weights().head = decoder.weights().head;
  int right = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    std::vector<float> pixels, marked(3 * 48 * 48), signs(6, 1.0f), plain(6), logits(6);
    const ImageView<const float> original = image(i, pixels);
    PixelEmbedding<LatticeDecoder<float>> embedding;
    embedding.embed(decoder, original, std::span<const float>(signs), settings, i, NoCodec{},
                    ImageView<float>{marked.data(), 3, 48, 48}, executor);
    LatticeDecoder<float>::Context context;
    other.forward(original, std::span<float>(plain), context, executor);
    other.forward(ImageView<const float>{marked.data(), 3, 48, 48}, std::span<float>(logits), context, executor);
    for (std::size_t b = 0; b < 6; ++b) right += logits[b] > plain[b] ? 1 : 0;
  }
  CHECK(std::abs(right - 24) < 12);  // of 48 by chance
}

TEST_CASE("pretrain/pretrain_trainer: a lattice file gives the same decoder back; bad files are refused") {
  const LatticeDecoder<float> decoder = start();
  const std::filesystem::path path = temporary("lattice.safetensors");
  REQUIRE(write_lattice<SafetensorsWriter>(decoder, "a test", path));
  auto file = read_safetensors(path);
  REQUIRE(file);
  const auto stored = StoredDecoder<>::read(*file);
  REQUIRE(stored);
  CHECK(stored->bits() == 6);
  CHECK(stored->logit_scale() == 2);
  std::vector<float> pixels(3 * 32 * 32), expected(6), logits(6);
  dead_leaves_image(1, 1, {pixels.data(), 3, 32, 32});
  SerialExecutor executor;
  LatticeDecoder<float>::Context context;
  StoredDecoder<>::Context stored_context;
  decoder.forward({pixels.data(), 3, 32, 32}, std::span<float>(expected), context, executor);
  stored->forward({pixels.data(), 3, 32, 32}, std::span<float>(logits), stored_context, executor);
  CHECK(logits == expected);
  std::vector<float> slope(6, 1.0f), d_a(pixels.size(), 0.0f), d_b(pixels.size(), 0.0f);
  decoder.backward(slope, {d_a.data(), 3, 32, 32}, context, executor);
  stored->backward(slope, {d_b.data(), 3, 32, 32}, stored_context, executor);
  CHECK(d_a == d_b);

  const auto refused = [&](const char* key, const char* value) {
    auto damaged = read_safetensors(path);
    REQUIRE(damaged);
    damaged->metadata[key] = value;
    const auto result = read_lattice<float>(*damaged);
    return !result && result.error().line().find(key) != std::string::npos;
  };
  CHECK(refused("sigma", "3 1"));
  CHECK(refused("sigma", "1.5 nan"));
  CHECK(refused("stride", "0"));
  CHECK(refused("epsilon", "0"));
  CHECK(refused("kind", "hidden"));
  CHECK(refused("features", "100000"));
  auto other = read_safetensors(path);
  REQUIRE(other);
  other->metadata["bits"] = "7";
  CHECK(!read_lattice<float>(*other));
  LatticeDecoder<float> broken = decoder;
  broken.weights().phase[0] = std::nanf("");
  REQUIRE(write_lattice<SafetensorsWriter>(broken, "", path));
  file = read_safetensors(path);
  REQUIRE(file);
  CHECK(!read_lattice<float>(*file));
  std::filesystem::remove(path);
}
