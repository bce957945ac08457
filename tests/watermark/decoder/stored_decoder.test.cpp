// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/stored_decoder.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <type_traits>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/testing/mark_laws.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/reference_decoder.hpp"
#include "compmark/watermark/proof/carriers.hpp"
#include "support/decoder.hpp"
#include "support/scene_files.hpp"

namespace {

using namespace compmark;
static_assert(MessageDecoder<StoredDecoder<>> && present<StoredDecoder<>>);
static_assert(MessageDecoder<StridedDecoder<48, 32, 5, 2>> && MessageDecoder<CarrierDecoder<>>);

std::vector<double> carriers(int bits, int dimension, std::uint64_t seed = 1) {
  const Random random(seed, 0, random_stage("carrier test"));
  std::vector<std::byte> bytes(carrier_bytes(bits, dimension));
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(random.bits(i));
  return make_carriers(bytes, bits, dimension);
}

/// An AlexNet in miniature: strides, two poolings, ReLU, several taps.
DecoderWeights small_alex() {
  DecoderWeights weights;
  weights.kind = DecoderKind::carrier;
  weights.activation = DecoderActivation::relu;
  weights.input = {0, 2, {0.9, 0.8, 0.7}, {0.5, 0.4, 0.6}, 0};
  weights.layers.resize(4);
  weights.layers[0].shape = {3, 6, 11, 4, 2};
  weights.layers[1].shape = {6, 9, 5, 1, 2};
  weights.layers[2].shape = {9, 8, 3, 1, 1};
  weights.layers[3].shape = {8, 7, 3, 2, 1};
  weights.layers[1].pool = weights.layers[2].pool = true;
  weights.layers[1].tap = weights.layers[3].tap = true;
  testing::randomise_layers(weights);
  return weights;
}

struct Pictures {
  int height, width;
  std::vector<std::vector<float>> pixels;
  Pictures(std::size_t count, int h, int w) : height(h), width(w) {
    for (std::size_t i = 0; i < count; ++i) {  // smooth noise of changing contrast, so that features vary
      std::vector<float> image = testing::random_image<float>(h, w, 100 + i);
      const float contrast = 0.2f + 0.8f * static_cast<float>(i % 7) / 7;
      for (std::size_t k = 1; k < image.size(); ++k)
        image[k] = contrast * image[k] + (1 - contrast) * image[k - 1] * (i % 2 == 0 ? 1.0f : 0.5f);
      pixels.push_back(std::move(image));
    }
  }
  ImageView<const float> operator()(std::size_t i) const { return {pixels[i].data(), 3, height, width}; }
};

}  // namespace

TEST_CASE("decoder/strided_decoder: equals the definition, and obeys the laws, at sizes its stem does not divide") {
  for (const int stem : {2, 4}) {
    DecoderWeights weights = testing::small_decoder(5, 8, 2, stem);
    weights.input = imagenet_convention(1);
    const auto decoder = StridedDecoder<0, 0, 0, 0, double>::create(weights);
    REQUIRE(decoder.ok());
    CHECK(decoder->minimum_size() == 6 * stem);
    CHECK(testing::message_decoder_laws(*decoder, 6 * stem, 6 * stem + 3) == "");
    CHECK(testing::message_decoder_laws(*decoder, 29, 31) == "");
    SerialExecutor serial;
    NetworkDecoder<double>::Context context;
    const auto image = testing::random_image<double>(29, 31);
    std::vector<double> logits(5);
    decoder->forward({image.data(), 3, 29, 31}, logits, context, serial);
    const auto expected = reference_logits<double>(weights, {image.data(), 3, 29, 31});
    for (std::size_t i = 0; i < 5; ++i) CHECK(std::abs(logits[i] - expected[i]) < 1e-12);
  }
  CHECK(!StridedDecoder<5, 8, 2, 4>::create(testing::small_decoder(5, 8, 2, 2)).ok());
  CHECK(StridedDecoder<5, 8, 2, 2>::create(testing::small_decoder(5, 8, 2, 2)).ok());
}

TEST_CASE("decoder/carrier_decoder: poolings, strides and several taps equal the definition and have a gradient") {
  DecoderWeights weights = small_alex();
  const int dimension = 12;
  weights.whiten_weight.assign(static_cast<std::size_t>(dimension * weights.features()), 0.0f);
  weights.whiten_bias.assign(static_cast<std::size_t>(dimension), 0.25f);
  const Random random(4, 0, 0);
  for (std::size_t i = 0; i < weights.whiten_weight.size(); ++i) weights.whiten_weight[i] = random.centered(i);
  const std::vector<double> frame = carriers(5, dimension);
  const auto decoder = CarrierDecoder<double>::create(weights, frame);
  REQUIRE(decoder.ok());
  CHECK(decoder->bits() == 5);
  CHECK(testing::message_decoder_laws(*decoder, 67, 75) == "");
  CHECK(testing::message_decoder_laws(*decoder, decoder->minimum_size(), decoder->minimum_size()) == "");
  const auto image = testing::random_image<double>(67, 75);
  const auto features = reference_features<double>(weights, {image.data(), 3, 67, 75});
  SerialExecutor serial;
  CarrierDecoder<double>::Context context;
  std::vector<double> logits(5);
  decoder->forward({image.data(), 3, 67, 75}, logits, context, serial);
  for (std::size_t b = 0; b < 5; ++b) {
    double expected = 0;
    for (std::size_t d = 0; d < static_cast<std::size_t>(dimension); ++d) {
      double white = 0.25;
      for (std::size_t f = 0; f < features.size(); ++f)
        white += static_cast<double>(weights.whiten_weight[d * features.size() + f]) * features[f];
      expected += frame[b * static_cast<std::size_t>(dimension) + d] * white;
    }
    CHECK(std::abs(logits[b] - expected) < 1e-12);
  }
}

TEST_CASE("decoder/carriers: orthonormal rows, a function of the bytes alone") {
  const std::vector<double> a = carriers(16, 24);
  for (std::size_t i = 0; i < 16; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double dot = 0;
      for (std::size_t k = 0; k < 24; ++k) dot += a[i * 24 + k] * a[j * 24 + k];
      CHECK(std::abs(dot - (i == j ? 1 : 0)) < 1e-14);
    }
  }
  CHECK(carriers(16, 24) == a);
  CHECK(carriers(16, 24, 2) != a);
  CHECK(carriers(24, 24).size() == 24 * 24);  // a whole basis
}

TEST_CASE("decoder/decoder_whitening: covariance becomes the identity, flat directions are left out") {
  FeatureStatistics statistics;
  const Random random(9, 0, 0);
  constexpr std::size_t n = 6, count = 500;
  std::vector<std::vector<double>> rows;
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<double> row(n);
    for (std::size_t k = 0; k + 1 < n; ++k)
      row[k] = 5 + std::pow(10.0, -static_cast<double>(k)) * random.normal(n * i + k) + (k > 0 ? 0.3 * row[k - 1] : 0);
    row[n - 1] = row[0] + row[1];  // no variance of its own
    statistics.add(row);
    rows.push_back(row);
  }
  const Whitening whitening = make_whitening(statistics, 6);
  CHECK(whitening.dimension == 5);
  CHECK(make_whitening(statistics, 3).dimension == 3);
  for (std::size_t a = 0; a < 5; ++a) {
    for (std::size_t b = 0; b <= a; ++b) {
      double covariance = 0, mean = 0;
      for (const std::vector<double>& row : rows) {
        double z[2] = {static_cast<double>(whitening.bias[a]), static_cast<double>(whitening.bias[b])};
        for (std::size_t k = 0; k < n; ++k) {
          z[0] += static_cast<double>(whitening.weight[a * n + k]) * row[k];
          z[1] += static_cast<double>(whitening.weight[b * n + k]) * row[k];
        }
        covariance += z[0] * z[1] / (count - 1);
        mean += z[0] / count;
      }
      CHECK(std::abs(covariance - (a == b ? 1 : 0)) < 1e-2);  // weights of 1e4 are stored in float
      CHECK(std::abs(mean) < 1e-2);
    }
  }
}

TEST_CASE("decoder/carrier_decoder: after calibration the logits of other images are centred with unit spread") {
  ThreadExecutor executor(2);
  DecoderWeights weights = random_carrier_network(7, imagenet_convention(0), 8, 16);
  for (std::size_t k = 0; k < weights.layers[0].weight.size(); k += 9) {
    float sum = 0;
    for (std::size_t i = 0; i < 9; ++i) sum += weights.layers[0].weight[k + i];
    CHECK(std::abs(sum) < 1e-6f);
  }
  const Pictures pictures(200, 24, 20);
  REQUIRE(calibrate_carriers(weights, 150, pictures, 10, true, executor));
  CHECK(weights.dimension() == 10);
  const auto decoder = CarrierDecoder<float>::create(weights, carriers(6, 10));
  REQUIRE(decoder.ok());
  CHECK(decoder->logit_scale() == 1);
  CarrierDecoder<float>::Context context;
  std::vector<float> logits(6);
  double square = 0, sum = 0;
  for (std::size_t i = 0; i < 200; ++i) {
    decoder->forward(pictures(i), logits, context, executor);
    for (const float z : logits) {
      square += static_cast<double>(z) * static_cast<double>(z) / 1200;
      sum += static_cast<double>(z) / 1200;
    }
  }
  CHECK(square > 0.7);
  CHECK(square < 1.5);
  CHECK(std::abs(sum) < 0.1);
}

TEST_CASE("decoder/carrier_decoder: one line where the carriers are missing, or the kind is another") {
  DecoderWeights weights = small_alex();
  weights.whiten_weight.assign(4 * static_cast<std::size_t>(weights.features()), 0.1f);
  weights.whiten_bias.assign(4, 0.0f);
  const auto refused = CarrierDecoder<float>::create(weights, {}, "a.safetensors");
  REQUIRE(!refused.ok());
  CHECK(refused.error().line() ==
        "a.safetensors: carriers: the decoder needs carriers in 4 dimensions; give the key: carriers come from its "
        "secret");
  CHECK(require_bits(weights, 4).ok());
  CHECK(!require_bits(weights, 5).ok());
  CHECK(!CarrierDecoder<>::create(testing::small_decoder(4, 5, 2), carriers(2, 4)).ok());
}

TEST_CASE(
    "decoder/stored_decoder: the file says the kind, and the key the carriers; logits are those of the kind's own "
    "type") {
  const testing::TemporaryFolder folder;
  const auto path = folder.path() / "decoder.safetensors";
  const auto image = testing::random_image<double>(67, 75);
  const ImageView<const double> view{image.data(), 3, 67, 75};
  SerialExecutor serial;
  const auto logits = [&](const auto& decoder) {
    typename std::remove_cvref_t<decltype(decoder)>::Context context;
    std::vector<double> read(static_cast<std::size_t>(decoder.bits()));
    decoder.forward(view, std::span<double>(read), context, serial);
    return read;
  };
  for (const int stem : {1, 2}) {
    const DecoderWeights weights = testing::small_decoder(7, 5, 2, stem);
    REQUIRE(write_decoder<SafetensorsWriter>(weights, path).ok());
    const auto read = StoredDecoder<double>::read(*read_safetensors(path));
    REQUIRE(read.ok());
    CHECK(read->logit_scale() == weights.logit_scale);
    CHECK(logits(*read) == (stem == 1 ? logits(*HiddenDecoder<0, 0, 0, double>::create(weights))
                                      : logits(*StridedDecoder<0, 0, 0, 0, double>::create(weights))));
  }
  DecoderWeights weights = small_alex();
  weights.width = 6;
  weights.depth = 3;
  weights.whiten_weight.assign(4 * static_cast<std::size_t>(weights.features()), 0.1f);
  weights.whiten_bias.assign(4, 0.0f);
  REQUIRE(write_decoder<SafetensorsWriter>(weights, path).ok());
  const auto file = read_safetensors(path);
  const DecoderKey key{{1, 2, 3, 4}, 3};
  const auto read = StoredDecoder<double>::read(*file, key);
  REQUIRE(read.ok());
  CHECK(logits(*read) == logits(*CarrierDecoder<double>::create(weights, make_carriers(key.seed, 3, 4))));
  CHECK(logits(*read) != logits(*StoredDecoder<double>::read(*file, DecoderKey{{1, 2, 3, 5}, 3})));
  CHECK(StoredDecoder<double>::read(*file).error().field == "carriers");
  CHECK(StoredDecoder<double>::read(*file, DecoderKey{key.seed, 5}).error().field == "bits");
}
