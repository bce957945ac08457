// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A decoder that reads a picture and its middle may read one of them alone (NetworkDecoder::draw_part).
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "compmark/watermark/edit/edit_chain.hpp"
#include "support/decoder.hpp"

namespace {

using namespace compmark;
using PartDecoder = HiddenDecoder<0, 0, 0, double>;

PartDecoder decoder_with_middle(double middle) {
  DecoderWeights weights = compmark::testing::small_decoder(5, 9, 2);
  weights.input = imagenet_convention(0);
  weights.input.largest_side = weights.input.smallest_side = 24;
  weights.input.middle = middle;
  auto decoder = PartDecoder::create(weights);
  REQUIRE(decoder.ok());
  return *decoder;
}

/// Of a picture of 40 x 44: logits, then the gradient of a weighted sum of them.
template <class Decoder>
std::vector<double> logits_and_gradient(const Decoder& decoder, typename Decoder::Context& context) {
  constexpr int height = 40, width = 44;
  const Random random(8, 0, random_stage("tests/drawn_part"));
  std::vector<double> pixels(3 * height * width), gradient(pixels.size(), 0.0), result(5);
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = random.uniform(i);
  SerialExecutor executor;
  decoder.forward(ImageView<const double>{pixels.data(), 3, height, width}, std::span<double>(result), context,
                  executor);
  const std::vector<double> slope{1, -0.5, 0.3, 2, -1};
  decoder.backward(std::span<const double>(slope), ImageView<double>{gradient.data(), 3, height, width}, context,
                   executor);
  result.insert(result.end(), gradient.begin(), gradient.end());
  return result;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::abs(a[i] - b[i]));
  return worst;
}

}  // namespace

TEST_CASE("decoder/drawn_part: logits and gradient of the parts have those of the whole reading for their mean") {
  const PartDecoder decoder = decoder_with_middle(0.75), whole_alone = decoder_with_middle(0);
  PartDecoder::Context context;
  const std::vector<double> all = logits_and_gradient(decoder, context);
  std::vector<std::vector<double>> parts;  // as they come
  std::vector<std::size_t> drawn;
  for (std::uint64_t t = 0; t < 400; ++t) {
    const Random random(3, t, 1);
    decoder.draw_part(context, &random);
    const std::vector<double> now = logits_and_gradient(decoder, context);
    const auto known = std::find(parts.begin(), parts.end(), now);
    drawn.push_back(static_cast<std::size_t>(known - parts.begin()));
    if (known == parts.end()) parts.push_back(now);
    REQUIRE(parts.size() <= 2);
  }
  REQUIRE(parts.size() == 2);
  // 400 fair draws: five deviations are 50.
  CHECK(std::abs(std::count(drawn.begin(), drawn.end(), std::size_t{0}) - 200) < 50);
  std::vector<double> mean = parts[0];
  for (std::size_t i = 0; i < mean.size(); ++i) mean[i] = (mean[i] + parts[1][i]) / 2;
  CHECK(largest_difference(mean, all) < 1e-12);
  CHECK(largest_difference(parts[0], parts[1]) > 1e-3);  // the control: they say different things
  PartDecoder::Context plain;
  const std::vector<double> whole = logits_and_gradient(whole_alone, plain);
  CHECK((parts[0] == whole || parts[1] == whole));
  decoder.draw_part(context, nullptr);
  CHECK(logits_and_gradient(decoder, context) == all);
}

TEST_CASE("decoder/drawn_part: a decoder of one part reads it, whatever is drawn") {
  const PartDecoder decoder = decoder_with_middle(0);
  PartDecoder::Context context;
  const std::vector<double> all = logits_and_gradient(decoder, context);
  for (std::uint64_t t = 0; t < 20; ++t) {
    const Random random(3, t, 1);
    decoder.draw_part(context, &random);
    CHECK(logits_and_gradient(decoder, context) == all);
  }
}

TEST_CASE("decoder/drawn_part: in the share of the readings that is asked for, and in none that nobody draws") {
  using Edits = EditChain<>;
  for (const double share : {0.0, 0.4, 1.0}) {
    const EditedDecoder<PartDecoder, Edits> decoder(decoder_with_middle(0.75), {}, share);
    EditedDecoder<PartDecoder, Edits>::Context context;
    const std::vector<double> all = logits_and_gradient(decoder, context);
    int alone = 0;
    for (std::uint64_t t = 0; t < 400; ++t) {
      const Random random(3, t, 1);
      decoder.draw_edits(context, &random);
      alone += logits_and_gradient(decoder, context) == all ? 0 : 1;
    }
    // Five deviations of 400 draws of .4 are 49; 0 and 1 are exact.
    CHECK(std::abs(alone - 400 * share) <= (share == 0.4 ? 49 : 0));
    decoder.draw_edits(context, nullptr);
    CHECK(logits_and_gradient(decoder, context) == all);
  }
}
