// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/hidden_decoder.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/mark_laws.hpp"
#include "compmark/watermark/decoder/concept.hpp"
#include "compmark/watermark/decoder/reference_decoder.hpp"
#include "support/decoder.hpp"

namespace {

using namespace compmark;
static_assert(MessageDecoder<HiddenDecoder<>> && present<HiddenDecoder<48, 64, 8>>);

/// The largest difference to the definition, relative to the largest logit.
template <class T>
double distance_to_reference(const DecoderWeights& weights, int height, int width) {
  const auto decoder = HiddenDecoder<0, 0, 0, T>::create(weights);
  REQUIRE(decoder.ok());
  SerialExecutor serial;
  typename HiddenDecoder<0, 0, 0, T>::Context context;
  const auto image = testing::random_image<T>(height, width);
  std::vector<T> logits(static_cast<std::size_t>(decoder->bits()));
  decoder->forward({image.data(), 3, height, width}, logits, context, serial);
  const std::vector<long double> exact_image(image.begin(), image.end());
  const auto expected = reference_logits<long double>(weights, {exact_image.data(), 3, height, width});
  double worst = 0, size = 0;
  for (std::size_t i = 0; i < logits.size(); ++i) {
    worst = std::max(worst, std::abs(static_cast<double>(logits[i]) - static_cast<double>(expected[i])));
    size = std::max(size, std::abs(static_cast<double>(expected[i])));
  }
  return worst / size;
}

}  // namespace

TEST_CASE("decoder/hidden_decoder: equals the definition at any size, in double and in float") {
  for (int levels = 0; levels <= 2; ++levels) {
    DecoderWeights weights = testing::small_decoder(6, 10, 3);
    weights.input = imagenet_convention(levels);
    for (const auto& [height, width] : {std::pair{16, 16}, {13, 22}, {12, 31}}) {
      CHECK(distance_to_reference<double>(weights, height, width) < 1e-13);
      CHECK(distance_to_reference<float>(weights, height, width) < 2e-6);  // measured 4e-7
    }
    weights.input.largest_side = 7;
    CHECK(distance_to_reference<double>(weights, 33, 30) < 1e-13);
    weights.input.largest_side = weights.input.smallest_side = 37;  // read at one size: enlarged, shrunk
    CHECK(distance_to_reference<double>(weights, 13, 22) < 1e-13);
    CHECK(distance_to_reference<double>(weights, 160, 150) < 1e-13);
  }
}

TEST_CASE("decoder/hidden_decoder: the laws of a message decoder") {
  DecoderWeights weights = testing::small_decoder(5, 9, 2);
  for (const int levels : {0, 1, 2}) {
    weights.input = imagenet_convention(levels);
    const auto decoder = HiddenDecoder<0, 0, 0, double>::create(weights);
    REQUIRE(decoder.ok());
    CHECK(decoder->minimum_size() == 3 << levels);
    CHECK(testing::message_decoder_laws(*decoder, 13, 14) == "");
    CHECK(testing::message_decoder_laws(*decoder, decoder->minimum_size(), 15) == "");
  }
}

TEST_CASE(
    "decoder/hidden_decoder: whitening and normalisation count, and a part of the bits reads what it read before") {
  const DecoderWeights weights = testing::small_decoder(6, 8, 2);
  const auto image = testing::random_image<double>(14, 14);
  const auto logits = [&](const DecoderWeights& w) {
    const auto decoder = HiddenDecoder<0, 0, 0, double>::create(w);
    SerialExecutor serial;
    HiddenDecoder<0, 0, 0, double>::Context context;
    std::vector<double> result(static_cast<std::size_t>(w.bits));
    decoder->forward({image.data(), 3, 14, 14}, result, context, serial);
    return result;
  };
  const std::vector<double> all = logits(weights);
  const std::vector<double> some = logits(keep_bits(weights, 4));
  for (std::size_t i = 0; i < 4; ++i) CHECK(std::abs(some[i] - all[i]) < 1e-6);  // the folded matrix is stored in float
  DecoderWeights plain = weights;
  plain.whiten_weight.clear();
  plain.whiten_bias.clear();
  CHECK(std::abs(logits(plain)[0] - all[0]) > 1e-3);
  DecoderWeights wrong = weights;
  wrong.norm_epsilon = 1e-5;  // the usual default, not HiDDeN's: seen at once
  CHECK(std::abs(logits(wrong)[0] - all[0]) > 1e-5);
}

TEST_CASE("decoder/hidden_decoder: sizes fixed in the type are checked, lengths too, in one line") {
  const DecoderWeights weights = testing::small_decoder(6, 8, 2);
  CHECK(HiddenDecoder<6, 8, 2>::create(weights).ok());
  const auto other = HiddenDecoder<48>::create(weights, "weights/small.safetensors");
  REQUIRE(!other.ok());
  CHECK(other.error().line() ==
        "weights/small.safetensors: bits: the decoder file has 6, this program was built for 48; use the decoder it "
        "was built for");
  CHECK(!HiddenDecoder<6, 64>::create(weights).ok());
  CHECK(!HiddenDecoder<6, 8, 7>::create(weights).ok());
  CHECK(!HiddenDecoder<>::create(testing::small_decoder(6, 8, 2, 2)).ok());
  CHECK(require_bits(weights, 6).ok());
  CHECK(require_bits(weights, 48, "a").error().line() ==
        "a: bits: the decoder reads 6 bits, the message has 48; use a key and a decoder of one length");
}
