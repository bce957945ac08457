// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/input_convention.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/archetypes.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/testing/mark_laws.hpp"
#include "compmark/watermark/decoder/concept.hpp"

namespace {

using namespace compmark;
static_assert(MessageDecoder<NoMessageDecoder> && !present<NoMessageDecoder>);
static_assert(MessageDecoder<testing::MessageDecoderArchetype<float>>);
struct Mute {  // no backward pass
  using Scalar = float;
  struct Context {};
  static int bits();
  static int minimum_size();
  template <class E>
  void forward(ImageView<const float>, std::span<float>, Context&, E&) const;
};
static_assert(!MessageDecoder<Mute>);
struct Overwrites : testing::MessageDecoderArchetype<double> {
  template <Executor E>
  void backward(std::span<const double> d, ImageView<double> d_image, Context& /*ctx*/, E& /*executor*/) const {
    for (double& value : d_image.flat()) value = d[0] / static_cast<double>(d_image.size());
  }
};

}  // namespace

TEST_CASE("decoder/concept: the archetype obeys the laws, and a decoder that overwrites does not") {
  CHECK(testing::message_decoder_laws(testing::MessageDecoderArchetype<double>(), 3, 5) == "");
  CHECK(testing::message_decoder_laws(Overwrites(), 3, 5).find("D2") != std::string::npos);
}

TEST_CASE("decoder/input_convention: sizes") {
  InputConvention c;
  CHECK(c.output_size(400, 800) == std::array{200, 400});
  c.largest_side = 128;
  CHECK(c.output_size(400, 800) == std::array{64, 128});
  CHECK(c.output_size(100, 101) == std::array{50, 51});
  CHECK(c.output_size(1, 8000) == std::array{1, 128});
  c.haar_levels = 2;
  CHECK(c.output_size(401, 403) == std::array{101, 101});
}

TEST_CASE("decoder/input_convention: a constant grey image becomes the stated number, whatever the level and size") {
  SerialExecutor serial;
  for (int levels = 0; levels <= 2; ++levels) {
    for (const int side : {0, 5}) {
      InputConvention c = imagenet_convention(levels);
      c.largest_side = side;
      DecoderInput<double> input(c);
      DecoderInput<double>::Context context;
      const std::vector<double> image(3 * 23 * 31, 0.6);
      const auto [h, w] = c.output_size(23, 31);
      std::vector<double> out(static_cast<std::size_t>(3 * h * w));
      input.forward({image.data(), 3, 23, 31}, {out.data(), 3, h, w}, context, serial);
      for (std::size_t i = 0; i < out.size(); ++i) {
        const std::size_t channel = i / static_cast<std::size_t>(h * w);
        CHECK(std::abs(out[i] - (0.6 - c.mean[channel]) / c.deviation[channel]) < 1e-14);
      }
    }
  }
}

TEST_CASE(
    "decoder/input_convention: gradients of every level, with and without shrinking; they add; any thread count") {
  for (int levels = 0; levels <= 2; ++levels) {
    for (const int side : {0, 5}) {
      InputConvention c{levels, 0.7, {0.1, 0.2, 0.3}, {0.5, 2, 0.25}, side};
      DecoderInput<double> input(c);
      const Random random(7, 0, random_stage("convention test"));
      std::vector<double> image(3 * 13 * 18);
      for (std::size_t i = 0; i < image.size(); ++i) image[i] = random.uniform(i);
      const auto size = c.output_size(13, 18);
      std::vector<double> out(static_cast<std::size_t>(3 * size[0] * size[1])), slope(out.size()), expected;
      for (std::size_t i = 0; i < slope.size(); ++i) slope[i] = random.normal(i + 5000);
      for (const std::size_t threads : {1u, 3u}) {
        ThreadExecutor executor(threads);
        DecoderInput<double>::Context context;
        const ImageView<double> view{out.data(), 3, size[0], size[1]};
        const auto loss = [&] {
          input.forward({image.data(), 3, 13, 18}, view, context, executor);
          double sum = 0;
          for (std::size_t i = 0; i < out.size(); ++i) sum += slope[i] * out[i];
          return sum;
        };
        static_cast<void>(loss());
        std::vector<double> d_out = slope, d_image(image.size(), 2.0);
        input.backward({d_out.data(), 3, size[0], size[1]}, {d_image.data(), 3, 13, 18}, context, executor);
        for (double& value : d_image) value -= 2.0;
        CHECK(testing::gradient_law(loss, image, d_image) == "");
        if (expected.empty()) expected = d_image;
        CHECK(d_image == expected);
      }
    }
  }
}
