// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Regions of an image, and how what says more than a limit counts less: watermark/decoder/lattice_decoder.hpp.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/mark_laws.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/decoder/lattice_file.hpp"
#include "support/scene_files.hpp"

using namespace compmark;

namespace {

constexpr int limited_bits = 5, limited_features = 11;

template <class T>
LatticeDecoder<T> decoder_of(int regions, double limit, LatticeMeasure measure = LatticeMeasure::colour) {
  LatticeSettings settings;
  settings.measure = measure;
  settings.bits = limited_bits;
  settings.features = limited_features;
  settings.sigma = measure == LatticeMeasure::colour ? std::vector<double>{0.5} : std::vector<double>{1, 2, 4};
  settings.stride = 1;
  settings.regions = regions;
  settings.region_limit = limit;
  LatticeWeights<T> weights(settings);
  const Random random(11, 0, random_stage("test/regions"));
  std::size_t n = 0;
  for (T& value : weights.frequency) value = static_cast<T>(2 * random.normal(n++));
  for (T& value : weights.phase) value = static_cast<T>(random.uniform(n++));
  for (std::vector<T>* part : {&weights.head, &weights.bias}) {
    for (T& value : *part) value = static_cast<T>(random.normal(n++));
  }
  return {settings, weights};
}

/// Colours that change slowly over the image, by up to `contrast` around grey, and some noise.
std::vector<double> scene(int height, int width, double contrast = 0.25) {
  const Random random(4, 0, random_stage("test/regions scene"));
  std::vector<double> values;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const double slow = std::sin(0.05 * (c + 1) * x + 0.08 * y + c);
        values.push_back(0.5 + contrast * slow + 0.1 * (random.uniform(values.size()) - 0.5));
      }
    }
  }
  return values;
}

struct Reading {
  std::vector<double> logits = std::vector<double>(limited_bits);
  LatticeDecoder<double>::Context context;
};
template <class E = SerialExecutor>
Reading read(const LatticeDecoder<double>& decoder, const std::vector<double>& pixels, int height, int width,
             E&& executor = {}) {
  Reading reading;
  decoder.forward({pixels.data(), 3, height, width}, std::span<double>(reading.logits), reading.context, executor);
  return reading;
}
/// A limit that holds back some of the regions of a scene and not the others.
double middle_limit(int regions, const std::vector<double>& pixels, int height, int width,
                    LatticeMeasure measure = LatticeMeasure::colour) {
  const Reading reading = read(decoder_of<double>(regions, 1e9, measure), pixels, height, width);
  std::vector<double> norm = reading.context.region_norm;
  std::nth_element(norm.begin(), norm.begin() + static_cast<std::ptrdiff_t>(norm.size() / 2), norm.end());
  return 0.97 * norm[norm.size() / 2];  // at a region's own loudness there is no gradient
}
double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double square = 0;
  for (std::size_t i = 0; i < a.size(); ++i) square += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(square);
}

}  // namespace

TEST_CASE(
    "decoder/lattice_regions: as many as were asked for, about square, each in whole packs, every position once") {
  for (const std::array<int, 3>& shape : {std::array<int, 3>{300, 400, 24},
                                          {480, 270, 24},
                                          {400, 400, 24},
                                          {7, 90, 6},
                                          {90, 7, 6},
                                          {5, 3, 24},
                                          {9, 9, 1}}) {
    const int height = shape[0], width = shape[1], wanted = shape[2];
    CAPTURE(height);
    CAPTURE(width);
    const std::vector<double> pixels = scene(height, width);
    const Reading reading = read(decoder_of<double>(wanted, 1e9), pixels, height, width);
    const LatticePositions<double>& at = reading.context.positions;
    CHECK(static_cast<double>(at.regions) <= 1.3 * wanted);
    if (std::min(height, width) > 20) CHECK(static_cast<double>(at.regions) >= 0.8 * wanted);
    std::size_t places = 0;
    for (const auto& chunk : at.chunks) {
      CHECK(chunk.begin == places);
      CHECK(chunk.region < at.regions);
      CHECK(chunk.begin % native_width<double> == 0);
      places = chunk.end;
    }
    CHECK(places == at.stride);
    // Every colour is there once: sums of the first one's values, and as many open gates as positions.
    double sum = 0, expected = 0;
    std::size_t open = 0;
    for (std::size_t i = 0; i < at.stride; ++i) {
      sum += at.u[i];
      open += at.gate[i] > 0 ? 1 : 0;
    }
    const Reading plain = read(decoder_of<double>(1, 0), pixels, height, width);
    for (std::size_t i = 0; i < plain.context.positions.stride; ++i) expected += plain.context.positions.u[i];
    CHECK(sum == doctest::Approx(expected).epsilon(1e-12));
    CHECK(open == static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
    // And who is not limited reads what is read without regions.
    CHECK(distance(reading.logits, plain.logits) < 1e-12);
  }
}

TEST_CASE("decoder/lattice_regions: the laws of a message decoder hold where some regions are held back") {
  for (const LatticeMeasure measure : {LatticeMeasure::colour, LatticeMeasure::contrast}) {
    const Random random(3, 0, random_stage("testing/message_decoder_laws"));
    for (const auto& [height, width] : {std::pair{24, 31}, {9, 16}}) {
      std::vector<double> pixels(static_cast<std::size_t>(3 * height * width));  // those of message_decoder_laws
      for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = random.uniform(i);
      const double limit = middle_limit(6, pixels, height, width, measure);
      const LatticeDecoder<double> decoder = decoder_of<double>(6, limit, measure);
      const Reading reading = read(decoder, pixels, height, width);
      const std::vector<double>& share = reading.context.region_share;
      CHECK(std::count(share.begin(), share.end(), 1.0) > 0);
      CHECK(std::count_if(share.begin(), share.end(), [](double c) { return c < 1; }) > 1);
      CHECK(testing::message_decoder_laws(decoder, height, width) == "");
    }
  }
}

TEST_CASE("decoder/lattice_regions: the gradient counts what a change does to the limits themselves") {
  const int height = 20, width = 26;
  std::vector<double> pixels = scene(height, width);
  const LatticeDecoder<double> decoder = decoder_of<double>(6, middle_limit(6, pixels, height, width));
  SerialExecutor executor;
  LatticeDecoder<double>::Context context;
  std::vector<double> logits(limited_bits), slope{0.7, -1.1, 0.4, 0.2, -0.9}, gradient(pixels.size(), 0.0);
  const auto loss = [&] {
    decoder.forward({pixels.data(), 3, height, width}, std::span<double>(logits), context, executor);
    double sum = 0;
    for (std::size_t i = 0; i < limited_bits; ++i) sum += slope[i] * logits[i];
    return sum;
  };
  static_cast<void>(loss());
  decoder.backward(slope, {gradient.data(), 3, height, width}, context, executor);
  CHECK(testing::gradient_law(loss, pixels, gradient) == "");
  // The control: shares taken for constants are another gradient.
  static_cast<void>(loss());
  context.all_gates = 1e30;  // which their derivatives are quotients by
  std::vector<double> constant(pixels.size(), 0.0);
  decoder.backward(slope, {constant.data(), 3, height, width}, context, executor);
  CHECK(testing::gradient_law(loss, pixels, constant) != "");
}

TEST_CASE(
    "decoder/lattice_regions: a corner of a colour that nobody saw says no more than the limit, without one it "
    "outshouts "
    "the image") {
  const int height = 60, width = 80;
  const std::vector<double> pixels = scene(height, width, 0.02);
  const LatticeDecoder<double> plain = decoder_of<double>(1, 0);
  // As a fitted decoder is: the scene itself says nothing.
  const auto quiet = [&](LatticeDecoder<double> decoder) {
    const Reading reading = read(plain, pixels, height, width);
    for (std::size_t b = 0; b < limited_bits; ++b) decoder.weights().bias[b] -= reading.logits[b];
    return decoder;
  };
  const double loudest = [&] {
    const Reading reading = read(quiet(decoder_of<double>(12, 1e9)), pixels, height, width);
    return *std::max_element(reading.context.region_norm.begin(), reading.context.region_norm.end());
  }();
  const LatticeDecoder<double> naive = quiet(plain), limited = quiet(decoder_of<double>(12, 1.2 * loudest));
  double worst_naive = 0, worst = 0;
  const Random random(5, 0, random_stage("test/regions glare"));
  for (std::size_t n = 0; n < 200; ++n) {
    std::vector<double> glare = pixels;
    for (std::size_t c = 0; c < 3; ++c) {
      const double colour = 0.15 + 0.7 * random.uniform(3 * n + c);
      for (int y = 0; y < height / 3; ++y) {
        for (int x = 0; x < width / 4; ++x)
          glare[(c * height + static_cast<std::size_t>(y)) * width + static_cast<std::size_t>(x)] = colour;
      }
    }
    const Reading before = read(limited, pixels, height, width), after = read(limited, glare, height, width);
    worst = std::max(worst, distance(before.logits, after.logits));
    worst_naive = std::max(
        worst_naive, distance(read(naive, pixels, height, width).logits, read(naive, glare, height, width).logits));
    // A limit is what a region says of all gates, and p the mean over those that count: one of twelve that counts less.
    const double mean_of = after.context.all_gates / after.context.gate_sum;
    for (std::size_t r = 0; r < after.context.region_norm.size(); ++r)
      CHECK(after.context.region_norm[r] * after.context.region_share[r] * mean_of <= 1.1 * 1.2 * loudest);
  }
  MESSAGE("moved by up to ", worst_naive, ", limited by up to ", worst, ", the loudest region of the scene ", loudest);
  // What the corner said before and what it says now, a limit each, the blur's rim in its neighbours and their shares:
  // measured 1.96 limits.
  CHECK(worst < 2.2 * 1.2 * loudest);
  CHECK(worst_naive > 2 * worst);  // the control: measured 2.4 times
}

TEST_CASE("decoder/lattice_regions: the same bits at any thread count") {
  const int height = 120, width = 90;
  const std::vector<double> pixels = scene(height, width);
  const LatticeDecoder<double> decoder = decoder_of<double>(24, middle_limit(24, pixels, height, width));
  const std::vector<double> slope{0.7, -1.1, 0.4, 0.2, -0.9};
  std::vector<std::vector<double>> logits, gradients;
  for (const std::size_t count : {std::size_t{1}, std::size_t{2}, std::size_t{5}}) {
    ThreadExecutor threads(count);
    Reading reading = read(decoder, pixels, height, width, threads);
    std::vector<double> gradient(pixels.size(), 0.0);
    decoder.backward(slope, {gradient.data(), 3, height, width}, reading.context, threads);
    logits.push_back(reading.logits);
    gradients.push_back(std::move(gradient));
  }
  CHECK(logits[0] == logits[1]);
  CHECK(logits[0] == logits[2]);
  CHECK(gradients[0] == gradients[1]);
  CHECK(gradients[0] == gradients[2]);
}

TEST_CASE("decoder/lattice_regions: a limit comes back from its file, and an older program refuses it") {
  const LatticeDecoder<float> decoder = decoder_of<float>(24, 6.25);
  const testing::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "limited.safetensors";
  REQUIRE(write_lattice<SafetensorsWriter>(decoder, "", path).ok());
  Result<SafetensorsFile> file = read_safetensors(path);
  REQUIRE(file.ok());
  CHECK(file->metadata["format_version"] == "3");
  const Result<LatticeDecoder<float>> back = read_lattice(*file);
  REQUIRE(back.ok());
  CHECK(back->settings() == decoder.settings());
  CHECK(back->weights().cover.empty());
  for (const auto& lie : {std::pair<std::string, std::string>{"regions", "0"},
                          {"regions", "many"},
                          {"region_limit", "0"},
                          {"region_limit", "nan"},
                          {"region_limit", "inf"},
                          {"format_version", "2"},
                          {"format_version", "4"}}) {
    const std::string field = lie.first;
    CAPTURE(field);
    const std::string good = std::exchange(file->metadata[field], lie.second);
    const Result<LatticeDecoder<float>> bad = read_lattice(*file);
    REQUIRE(!bad.ok());
    CHECK(bad.error().field == "__metadata__." + field);
    file->metadata[field] = good;
  }
  // With a cover prediction both are kept.
  LatticeDecoder<float> predicting = decoder;
  CoverPrediction<float>& cover = predicting.weights().cover;
  cover.direction.assign(2 * limited_features, 0.1f);
  cover.offset.assign(2, 0.2f);
  cover.centre.assign(3 * 2, 0.3f);
  cover.coefficient.assign(3 * limited_bits, 0.4f);
  REQUIRE(write_lattice<SafetensorsWriter>(predicting, "", path).ok());
  file = read_safetensors(path);
  REQUIRE(file.ok());
  const Result<LatticeDecoder<float>> both = read_lattice(*file);
  REQUIRE(both.ok());
  CHECK(both->settings() == decoder.settings());
  CHECK(both->weights().cover.coefficient == cover.coefficient);
  file->metadata.erase("coordinates");  // without its prediction it would be another decoder
  CHECK(!read_lattice(*file).ok());
  // A limit that holds nothing back is one too.
  LatticeSettings loose = decoder.settings();
  loose.region_limit = 1e6;
  REQUIRE(write_lattice<SafetensorsWriter>(LatticeDecoder<float>(loose, decoder.weights()), "", path).ok());
  file = read_safetensors(path);
  REQUIRE(file.ok());
  CHECK(read_lattice(*file)->settings() == loose);
}
