// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/decoder_winograd.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/mark_laws.hpp"
#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "support/decoder.hpp"

using namespace compmark;

TEST_CASE("decoder/decoder_winograd: the laws of a message decoder, at sizes that tiles do not divide") {
  DecoderWeights weights = testing::small_decoder(16, 17, 2);
  weights.input = imagenet_convention(1);
  const auto decoder = HiddenDecoder<0, 0, 0, double, WinogradOrDirect>::create(weights);
  REQUIRE(decoder.ok());
  CHECK(testing::message_decoder_laws(*decoder, 23, 30, 8) == "");
  CHECK(testing::message_decoder_laws(*decoder, decoder->minimum_size(), 7, 8) == "");
}

TEST_CASE("decoder/decoder_winograd: logits and gradient are those of the direct sum to rounding") {
  DecoderWeights weights = testing::small_decoder(16, 32, 4);
  const auto image = testing::random_image<float>(45, 38);
  ThreadExecutor executor(2);
  const auto run = [&](const auto& decoder) {
    typename std::decay_t<decltype(*decoder)>::Context context;
    std::vector<float> logits(16), slope(16, 0.5f), d(image.size(), 0.0f);
    decoder->forward({image.data(), 3, 45, 38}, logits, context, executor);
    decoder->backward(slope, {d.data(), 3, 45, 38}, context, executor);
    return std::array{logits, d};
  };
  const auto direct = run(HiddenDecoder<>::create(weights));
  const auto fast = run(HiddenDecoder<0, 0, 0, float, WinogradOrDirect>::create(weights));
  for (std::size_t part = 0; part < 2; ++part) {
    double worst = 0, size = 0;
    for (std::size_t i = 0; i < direct[part].size(); ++i) {
      worst = std::max(worst, std::abs(static_cast<double>(direct[part][i] - fast[part][i])));
      size = std::max(size, std::abs(static_cast<double>(direct[part][i])));
    }
    MESSAGE("relative difference " << worst / size);
    CHECK(worst < 2e-5 * size);
    CHECK(worst > 0);  // another sum, or the policy was not taken
  }
}
