// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/decoder/input_convention.hpp"

#include <doctest/doctest.h>

#include <algorithm>
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
  c = {0, 1, {0, 0, 0}, {1, 1, 1}, 128, 128};  // one size for every picture
  CHECK(c.output_size(400, 800) == std::array{64, 128});
  CHECK(c.output_size(128, 90) == std::array{128, 90});
  CHECK(c.output_size(20, 50) == std::array{51, 128});
  CHECK(c.output_size(1, 50) == std::array{3, 128});
  c.smallest_side = 30;
  CHECK(c.output_size(20, 50) == std::array{20, 50});
  CHECK(c.output_size(20, 25) == std::array{24, 30});
}

TEST_CASE(
    "mark/input_convention: one size for every picture makes a scaled picture what it was; a limit alone does not") {
  SerialExecutor serial;
  const auto picture = [](int side) {  // one scene, sampled over pixels of any size
    std::vector<double> image;
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x)
          image.push_back(0.5 + 0.2 * std::sin(7 * (x + 0.5) / side + c) * std::cos(5 * (y + 0.5) / side));
      }
    }
    return image;
  };
  const auto converted = [&](const InputConvention& c, int side) {
    const std::vector<double> image = picture(side);
    const auto size = c.output_size(side, side);
    std::vector<double> out(static_cast<std::size_t>(3 * size[0] * size[1]));
    DecoderInput<double>::Context context;
    DecoderInput<double>(c).forward({image.data(), 3, side, side}, {out.data(), 3, size[0], size[1]}, context, serial);
    return out;
  };
  InputConvention c{0, 1, {0, 0, 0}, {1, 1, 1}, 48, 48};
  const std::vector<double> large = converted(c, 96);
  for (const int side : {24, 33, 47, 48, 70}) {
    const std::vector<double> scaled = converted(c, side);
    REQUIRE(scaled.size() == large.size());
    double worst = 0;
    for (std::size_t i = 0; i < large.size(); ++i) worst = std::max(worst, std::abs(scaled[i] - large[i]));
    CHECK(worst < 0.02);
  }
  c.smallest_side = 0;
  CHECK(converted(c, 24).size() == large.size() / 4);
  CHECK(converted(c, 70) == converted({0, 1, {0, 0, 0}, {1, 1, 1}, 48, 48}, 70));  // shrinking is what it was
}

TEST_CASE("decoder/input_convention: a constant grey image becomes the stated number, whatever the level and size") {
  SerialExecutor serial;
  for (int levels = 0; levels <= 2; ++levels) {
    for (const int side : {0, 5, 57}) {
      InputConvention c = imagenet_convention(levels);
      (side > 5 ? c.smallest_side : c.largest_side) = side;
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
    "decoder/input_convention: gradients of every level, shrunk, enlarged or neither; they add; any thread count") {
  for (int levels = 0; levels <= 2; ++levels) {
    for (const int side : {0, 5, 29}) {
      InputConvention c{levels, 0.7, {0.1, 0.2, 0.3}, {0.5, 2, 0.25}};
      (side > 5 ? c.smallest_side : c.largest_side) = side;
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
