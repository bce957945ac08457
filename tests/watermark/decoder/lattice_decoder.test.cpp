// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/lattice_decoder.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/mark_laws.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/lattice_file.hpp"
#include "support/scene_files.hpp"

using namespace compmark;

namespace {

static_assert(MessageDecoder<LatticeDecoder<float>>);

template <class T>
LatticeDecoder<T> small_decoder(int bits = 5, int features = 7, std::vector<double> sigma = {1.5, 3, 6},
                                LatticeMeasure measure = LatticeMeasure::contrast) {
  LatticeSettings settings;
  settings.measure = measure;
  settings.bits = bits;
  settings.features = features;
  settings.sigma = std::move(sigma);
  settings.stride = 2;
  LatticeWeights<T> weights(settings);
  const Random random(9, 0, random_stage("test/lattice"));
  std::size_t n = 0;
  for (std::vector<T>* part : {&weights.frequency, &weights.phase, &weights.head, &weights.bias}) {
    for (T& value : *part) value = static_cast<T>(random.normal(n++));
  }
  return {settings, weights};
}
template <class T>
LatticeDecoder<T> small_colour_decoder(std::vector<double> sigma) {
  return small_decoder<T>(5, 7, std::move(sigma), LatticeMeasure::colour);
}

std::vector<double> noise(std::size_t count) {
  const Random random(4, 0, random_stage("test/lattice image"));
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = random.uniform(i);
  return values;
}

}  // namespace

TEST_CASE("decoder/lattice_decoder: the laws of a message decoder hold") {
  const LatticeDecoder<double> decoder = small_decoder<double>();
  CHECK(testing::message_decoder_laws(decoder, 24, 31) == "");
  CHECK(testing::message_decoder_laws(decoder, decoder.minimum_size(), 9) == "");
}

namespace {

void check_weight_gradients(LatticeDecoder<double> decoder) {
  std::vector<double> pixels = noise(3 * 20 * 26);
  const ImageView<const double> image{pixels.data(), 3, 20, 26};
  SerialExecutor executor;
  LatticeDecoder<double>::Context context;
  const std::vector<double> slope{0.7, -1.1, 0.4, 0.2, -0.9};
  std::vector<double> logits(5);
  const auto loss = [&] {
    decoder.forward(image, std::span<double>(logits), context, executor);
    double sum = 0;
    for (std::size_t i = 0; i < 5; ++i) sum += slope[i] * logits[i];
    return sum;
  };
  static_cast<void>(loss());
  LatticeWeights<double> gradient(decoder.settings());
  decoder.add_weight_gradient(slope, gradient, context, executor);
  CHECK(testing::gradient_law(loss, decoder.weights().frequency, gradient.frequency) == "");
  CHECK(testing::gradient_law(loss, decoder.weights().phase, gradient.phase) == "");
  CHECK(testing::gradient_law(loss, decoder.weights().head, gradient.head) == "");
  CHECK(testing::gradient_law(loss, decoder.weights().bias, gradient.bias) == "");
  std::vector<double> wrong = gradient.phase;  // the control: without the factor of the turn
  for (double& value : wrong) value /= 2 * std::numbers::pi;
  CHECK(testing::gradient_law(loss, decoder.weights().phase, wrong) != "");

  LatticeWeights<double> threaded(decoder.settings());
  ThreadExecutor threads(3);
  static_cast<void>(loss());
  decoder.add_weight_gradient(slope, threaded, context, threads);
  CHECK(threaded.frequency == gradient.frequency);
}

}  // namespace

TEST_CASE("decoder/lattice_decoder: gradients of every weight against central differences") {
  check_weight_gradients(small_decoder<double>());
}

TEST_CASE("decoder/lattice_decoder: Fourier features of colour hold the laws, of one blur and of three") {
  for (const std::vector<double>& sigma : {std::vector<double>{0.5}, std::vector<double>{1, 2, 4}}) {
    CAPTURE(sigma.size());
    const LatticeDecoder<double> decoder = small_colour_decoder<double>(sigma);
    CHECK(decoder.settings().dimensions() == 3 * sigma.size());
    CHECK(testing::message_decoder_laws(decoder, 24, 31) == "");
    check_weight_gradients(decoder);
  }
}

TEST_CASE(
    "decoder/lattice_decoder: a feature of colour is the same at twice the size; contrast is not, and brightness is "
    "not") {
  // Blocks of colour, each pixel and then each pixel four times: a surface from afar and from near.
  constexpr int side = 24;
  std::vector<double> coarse = noise(3 * side * side), fine(3 * 4 * side * side);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < 2 * side; ++y) {
      for (int x = 0; x < 2 * side; ++x) {
        fine[static_cast<std::size_t>((c * 2 * side + y) * 2 * side + x)] =
            coarse[static_cast<std::size_t>((c * side + y / 2) * side + x / 2)];
      }
    }
  }
  SerialExecutor executor;
  const auto difference = [&](LatticeDecoder<double> decoder, double brightness) {
    LatticeSettings settings = decoder.settings();
    settings.stride = 1;
    settings.gate = 1e-3;
    settings.floor = 0;
    decoder = {settings, decoder.weights()};
    LatticeDecoder<double>::Context context;
    std::vector<double> near(5), far(5), brighter = coarse;
    for (double& value : brighter) value *= brightness;
    decoder.forward({fine.data(), 3, 2 * side, 2 * side}, std::span<double>(near), context, executor);
    decoder.forward({brighter.data(), 3, side, side}, std::span<double>(far), context, executor);
    double sum = 0;
    for (std::size_t i = 0; i < 5; ++i) sum += std::abs(near[i] - far[i]);
    return sum;
  };
  const double colour = difference(small_colour_decoder<double>({0.1}), 1);
  CHECK(colour < 1e-9);  // a blur of a tenth of a pixel is none
  CHECK(difference(small_colour_decoder<double>({0.1}), 0.8) > 0.05);
  CHECK(difference(small_decoder<double>(5, 7, {0.1, 2}), 1) > 0.05);
}

TEST_CASE(
    "decoder/lattice_decoder: a colour decoder comes back from its file; a file without a measure holds contrast") {
  const LatticeDecoder<float> colour = small_colour_decoder<float>({1, 2});
  CHECK(colour.settings().measure == LatticeMeasure::colour);
  const testing::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "colour.safetensors";
  REQUIRE(write_lattice<SafetensorsWriter>(colour, "", path).ok());
  Result<SafetensorsFile> file = read_safetensors(path);
  REQUIRE(file.ok());
  const Result<LatticeDecoder<float>> read = read_lattice(*file);
  REQUIRE(read.ok());
  CHECK(read->settings() == colour.settings());
  CHECK(read->weights().frequency == colour.weights().frequency);
  CHECK(read->weights().head == colour.weights().head);

  file->metadata["measure"] = "texture";
  const Result<LatticeDecoder<float>> unknown = read_lattice(*file);
  REQUIRE(!unknown.ok());
  CHECK(unknown.error().field == "__metadata__.measure");
  // Read as contrast its tensors have the wrong shape: an older program refuses it instead of reading another message.
  file->metadata.erase("measure");
  CHECK(!read_lattice(*file).ok());

  const LatticeDecoder<float> contrast = small_decoder<float>();
  REQUIRE(write_lattice<SafetensorsWriter>(contrast, "", path).ok());
  file = read_safetensors(path);
  REQUIRE(file.ok());
  file->metadata.erase("measure");  // as the files written before there was one
  const Result<LatticeDecoder<float>> old = read_lattice(*file);
  REQUIRE(old.ok());
  CHECK(old->settings() == contrast.settings());
}

TEST_CASE("decoder/lattice_decoder: brightness leaves the contrast of logarithms alone") {
  LatticeDecoder<double> decoder = small_decoder<double>();
  LatticeSettings settings = decoder.settings();
  settings.epsilon = 1e-9;  // the exact law; 0.1 trades it for calm in the dark
  settings.gate = 1e-3;
  decoder = {settings, decoder.weights()};
  std::vector<double> pixels = noise(3 * 32 * 32);
  for (double& value : pixels) value = 0.3 + 0.3 * value;
  SerialExecutor executor;
  LatticeDecoder<double>::Context context;
  std::vector<double> logits(5), brighter(5);
  decoder.forward({pixels.data(), 3, 32, 32}, std::span<double>(logits), context, executor);
  for (double& value : pixels) value *= 1.3;
  decoder.forward({pixels.data(), 3, 32, 32}, std::span<double>(brighter), context, executor);
  for (std::size_t i = 0; i < 5; ++i) CHECK(brighter[i] == doctest::Approx(logits[i]).epsilon(1e-6));
}

TEST_CASE("decoder/lattice_decoder: a background of white or black does not speak") {
  LatticeDecoder<double> decoder = small_decoder<double>(5, 7, {1, 2});
  LatticeSettings settings = decoder.settings();
  settings.floor = 0;
  decoder = {settings, decoder.weights()};
  const int side = 64;
  const std::vector<double> texture = noise(3 * 64 * 64);
  std::vector<double> pixels(3 * 64 * 64);
  SerialExecutor executor;
  LatticeDecoder<double>::Context context;
  std::vector<double> first(5), second(5);
  const auto read = [&](int rows, std::vector<double>& logits) {  // the upper `rows` rows are texture, the rest white
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
          const std::size_t i = static_cast<std::size_t>((c * side + y) * side + x);
          pixels[i] = y < rows ? 0.3 + 0.4 * texture[i] : 1.0;
        }
      }
    }
    decoder.forward({pixels.data(), 3, side, side}, std::span<double>(logits), context, executor);
  };
  read(side, first);
  read(side / 2, second);
  double change = 0, size = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    change += std::abs(first[i] - second[i]);
    size += std::abs(first[i] - decoder.weights().bias[i]);
  }
  CHECK(change < 0.6 * size);  // measured 0.3: another half of a small texture and one border; without the gate above 1
}

TEST_CASE("decoder/lattice_decoder: float agrees with double") {
  const LatticeDecoder<double> exact = small_decoder<double>(5, 70, {1.5, 3, 6, 12});
  LatticeWeights<float> weights(exact.settings());
  const auto copy = [](const std::vector<double>& from, std::vector<float>& to) {
    for (std::size_t i = 0; i < from.size(); ++i) to[i] = static_cast<float>(from[i]);
  };
  copy(exact.weights().frequency, weights.frequency);
  copy(exact.weights().phase, weights.phase);
  copy(exact.weights().head, weights.head);
  copy(exact.weights().bias, weights.bias);
  const LatticeDecoder<float> decoder(exact.settings(), weights);
  const std::vector<double> pixels = noise(3 * 40 * 40);
  const std::vector<float> rounded(pixels.begin(), pixels.end());
  SerialExecutor executor;
  LatticeDecoder<double>::Context context;
  LatticeDecoder<float>::Context small;
  std::vector<double> expected(5);
  std::vector<float> logits(5);
  exact.forward({pixels.data(), 3, 40, 40}, std::span<double>(expected), context, executor);
  decoder.forward({rounded.data(), 3, 40, 40}, std::span<float>(logits), small, executor);
  for (std::size_t i = 0; i < 5; ++i) CHECK(std::abs(static_cast<double>(logits[i]) - expected[i]) < 2e-5);
}

TEST_CASE("decoder/lattice_decoder: cosine and sine of turns are those of the angle") {
  double worst = 0;
  for (int i = -4000; i <= 4000; ++i) {
    const float x = static_cast<float>(i) * 0.000737f;
    const auto both = detail::cosine_sine_of_turns(Pack<float, 1>(x));
    const double angle = 2 * std::numbers::pi * static_cast<double>(x);
    worst = std::max({worst, std::abs(static_cast<double>(both.cosine.lane(0)) - std::cos(angle)),
                      std::abs(static_cast<double>(both.sine.lane(0)) - std::sin(angle))});
  }
  CHECK(worst < 1e-6);  // measured 5.9e-7, most of it the rounding of x
}
