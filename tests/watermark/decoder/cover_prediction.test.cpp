// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/cover_prediction.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <span>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/mark_laws.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/decoder/lattice_file.hpp"
#include "support/random_values.hpp"
#include "support/scene_files.hpp"

using namespace compmark;
using testing::normals;

namespace {

constexpr std::size_t cover_features = 7, cover_coordinates = 3, cover_centres = 5, cover_bits = 4;

template <class T>
CoverPrediction<T> small_prediction() {
  CoverPrediction<T> cover;
  cover.direction.resize(cover_coordinates * cover_features);
  cover.offset.resize(cover_coordinates);
  cover.centre.resize(cover_centres * cover_coordinates);
  cover.coefficient.resize(cover_centres * cover_bits);
  const Random random(12, 0, random_stage("test/host prediction"));
  std::size_t n = 0;
  for (std::vector<T>* part : {&cover.direction, &cover.offset, &cover.centre, &cover.coefficient}) {
    for (T& value : *part) value = static_cast<T>(random.normal(n++));
  }
  return cover;
}
template <class T>
LatticeDecoder<T> scene_decoder(bool with_cover = true) {
  LatticeSettings settings;
  settings.measure = LatticeMeasure::colour;
  settings.bits = static_cast<int>(cover_bits);
  settings.features = static_cast<int>(cover_features);
  settings.sigma = {0.5};
  settings.stride = 2;
  LatticeWeights<T> weights(settings);
  const Random random(13, 0, random_stage("test/host prediction"));
  std::size_t n = 0;
  for (std::vector<T>* part : {&weights.frequency, &weights.phase, &weights.head, &weights.bias}) {
    for (T& value : *part) value = static_cast<T>(random.normal(n++));
  }
  if (with_cover) {
    weights.cover = small_prediction<T>();
    for (T& value : weights.cover.offset) value *= T(0.1);  // so that the images of the laws are near the centres
    for (T& value : weights.cover.centre) value *= T(0.3);
  }
  return {settings, weights};
}
}  // namespace

TEST_CASE("decoder/cover_prediction: it subtracts the sum of its kernels, and its gradient is that of what is left") {
  const CoverPrediction<double> cover = small_prediction<double>();
  CHECK(cover.coordinates() == cover_coordinates);
  CHECK(cover.centres() == cover_centres);
  std::vector<double> p = normals<double>(cover_features, 1, "test/host prediction values");
  for (double& value : p) value *= 0.4;
  CoverPrediction<double>::Context context;
  const std::vector<double> start = normals<double>(cover_bits, 2, "test/host prediction values"),
                            slope = normals<double>(cover_bits, 3, "test/host prediction values");
  std::vector<double> logits = start;
  cover.subtract(p, logits, context);
  for (std::size_t b = 0; b < cover_bits; ++b) {
    double said = 0;
    for (std::size_t i = 0; i < cover_centres; ++i) {
      double square = 0;
      for (std::size_t d = 0; d < cover_coordinates; ++d) {
        double x = -cover.offset[d] - cover.centre[i * cover_coordinates + d];
        for (std::size_t k = 0; k < cover_features; ++k) x += cover.direction[d * cover_features + k] * p[k];
        square += x * x;
      }
      said += std::exp(-square / 2) * cover.coefficient[i * cover_bits + b];
    }
    CHECK(logits[b] == doctest::Approx(start[b] - said).epsilon(1e-12));
  }
  std::vector<double> gradient(cover_features, 0.0);
  cover.backward(slope, gradient, context);
  const auto loss = [&] {
    std::vector<double> left = start;
    cover.subtract(p, left, context);
    double sum = 0;
    for (std::size_t b = 0; b < cover_bits; ++b) sum += slope[b] * left[b];
    return sum;
  };
  CHECK(testing::gradient_law(loss, p, gradient) == "");
  std::vector<double> wrong = gradient;  // the control: of what was subtracted
  for (double& value : wrong) value = -value;
  CHECK(testing::gradient_law(loss, p, wrong) != "");
}

TEST_CASE("decoder/cover_prediction: far from what it was fitted to nothing is subtracted") {
  const CoverPrediction<double> cover = small_prediction<double>();
  CoverPrediction<double>::Context context;
  std::vector<double> far(cover_features, 0.0), logits(cover_bits, 0.5);
  for (std::size_t k = 0; k < cover_features; ++k) far[k] = 30 * cover.direction[k];
  cover.subtract(far, logits, context);
  for (const double z : logits) CHECK(z == 0.5);
}

TEST_CASE("decoder/cover_prediction: a lattice decoder with one holds the laws of a message decoder") {
  CHECK(testing::message_decoder_laws(scene_decoder<double>(), 24, 31) == "");
  // It is there: the same decoder without reads something else.
  SerialExecutor executor;
  const std::vector<double> noise = normals<double>(3 * 24 * 24, 5, "test/host prediction values");
  std::vector<double> pixels(noise.size()), with(cover_bits), without(cover_bits);
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = 0.5 + 0.1 * noise[i];
  LatticeDecoder<double>::Context context;
  const ImageView<const double> image{pixels.data(), 3, 24, 24};
  scene_decoder<double>().forward(image, std::span<double>(with), context, executor);
  scene_decoder<double>(false).forward(image, std::span<double>(without), context, executor);
  for (std::size_t b = 0; b < cover_bits; ++b) CHECK(std::abs(with[b] - without[b]) > 1e-3);
}

TEST_CASE("decoder/cover_prediction: it comes back from a file, which programs that know of none refuse") {
  const LatticeDecoder<float> decoder = scene_decoder<float>();
  const testing::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "scene.safetensors";
  REQUIRE(write_lattice<SafetensorsWriter>(decoder, "", path).ok());
  Result<SafetensorsFile> file = read_safetensors(path);
  REQUIRE(file.ok());
  CHECK(file->metadata["format_version"] == "2");
  const Result<LatticeDecoder<float>> read = read_lattice(*file);
  REQUIRE(read.ok());
  CHECK(read->weights().cover.direction == decoder.weights().cover.direction);
  CHECK(read->weights().cover.offset == decoder.weights().cover.offset);
  CHECK(read->weights().cover.centre == decoder.weights().cover.centre);
  CHECK(read->weights().cover.coefficient == decoder.weights().cover.coefficient);

  // Every damage on the file as it was read, and mended again.
  for (const char* key : {"centres", "coordinates", "format_version"}) {
    CAPTURE(key);
    std::string& value = file->metadata[key];
    const std::string good = value;
    for (const char* bad : {"6", "0", "many"}) {
      value = bad;
      CHECK(!read_lattice(*file).ok());
    }
    value = good;
  }
  CHECK(read_lattice(*file).ok());
  file->metadata["coordinates"] = "8";  // of 7 features
  const Result<LatticeDecoder<float>> too_many = read_lattice(*file);
  REQUIRE(!too_many.ok());
  CHECK(too_many.error().field == "__metadata__.coordinates");
  file->metadata["coordinates"] = "3";
  file->tensors.erase("host.coefficient");
  const Result<LatticeDecoder<float>> missing = read_lattice(*file);
  REQUIRE(!missing.ok());
  CHECK(missing.error().field == "host.coefficient");

  // Without one a file is what it was, for older programs too.
  REQUIRE(write_lattice<SafetensorsWriter>(scene_decoder<float>(false), "", path).ok());
  file = read_safetensors(path);
  REQUIRE(file.ok());
  CHECK(file->metadata["format_version"] == "1");
  CHECK(!file->metadata.contains("centres"));
  CHECK(read_lattice(*file)->weights().cover.empty());
}
