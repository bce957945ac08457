// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Chains of edits and their gradients, each edit by itself, and a decoder behind a chain.
#include "compmark/watermark/edit/edit_chain.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;
using Smooth = EditChain<RotationEdit, CropEdit, ResizeEdit, ToneEdit, BlurEdit, NoiseEdit>;  // all but JPEG

template <class T>
std::vector<T> middle_picture(int height, int width) {
  std::vector<T> pixels(3 * static_cast<std::size_t>(height * width));
  const Random random(3, 0, random_stage("test edits"));
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<T>(0.35 + 0.2 * random.uniform(i));
  return pixels;
}
template <class T>
T weight_of(std::size_t i) {
  return static_cast<T>(Random(7, 0, 0).normal(i));
}

/// d loss / d pixel by the chain, and by central differences, of loss = sum weight * edited.
template <class Chain>
double worst_gradient(const typename Chain::Settings& settings, std::uint64_t iteration) {
  std::vector<double> pixels = middle_picture<double>(17, 21), d(pixels.size(), 0.0);
  const ImageView<double> image{pixels.data(), 3, 17, 21};
  typename Chain::template Context<double> context;
  Chain::draw(settings, Random(1, iteration, 2), context);
  SerialExecutor executor;
  const auto loss = [&] {
    const ImageView<const double> edited = Chain::forward(ImageView<const double>(image), context, executor);
    double sum = 0;
    for (std::size_t i = 0; i < edited.size(); ++i) sum += weight_of<double>(i) * edited.data[i];
    return sum;
  };
  static_cast<void>(loss());
  const ImageView<double> behind = Chain::gradient(ImageView<double>{d.data(), 3, 17, 21}, context);
  for (std::size_t i = 0; i < behind.size(); ++i) behind.data[i] += weight_of<double>(i);
  Chain::backward(ImageView<double>{d.data(), 3, 17, 21}, context, executor);
  double worst = 0;
  for (std::size_t i = 0; i < pixels.size(); i += 5) {
    const double kept = pixels[i], h = 1e-6;
    pixels[i] = kept + h;
    const double more = loss();
    pixels[i] = kept - h;
    const double less = loss();
    pixels[i] = kept;
    worst = std::max(worst, std::abs((more - less) / (2 * h) - d[i]));
  }
  return worst;
}

/// Bits are means of columns of the picture against the whole.
struct ColumnDecoder {
  static constexpr bool is_absent = false;
  using Scalar = double;
  struct Context {
    int height = 0, width = 0;
  };
  static int bits() { return 3; }
  static int minimum_size() { return 8; }
  template <class E>
  void forward(ImageView<const double> image, std::span<double> logits, Context& context, E& /*executor*/) const {
    context = {image.height, image.width};
    std::fill(logits.begin(), logits.end(), 0.0);
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) logits[static_cast<std::size_t>(3 * x / image.width)] += image(1, y, x);
    }
  }
  template <class E>
  void backward(std::span<const double> d_logits, ImageView<double> d_image, Context& context, E& /*executor*/) const {
    REQUIRE(d_image.height == context.height);
    for (int y = 0; y < d_image.height; ++y) {
      for (int x = 0; x < d_image.width; ++x)
        d_image(1, y, x) += d_logits[static_cast<std::size_t>(3 * x / d_image.width)];
    }
  }
};
static_assert(MessageDecoder<EditedDecoder<ColumnDecoder, Smooth>>);

}  // namespace

TEST_CASE_TEMPLATE("edit/edit_chain: the gradient of an edit is that of central differences (E1)", Edit, RotationEdit,
                   CropEdit, ResizeEdit, ToneEdit, BlurEdit, NoiseEdit) {
  using Chain = EditChain<Edit>;
  typename Chain::Settings settings;
  settings.none = 0;
  settings.share = 1;
  for (std::uint64_t iteration = 0; iteration < 4; ++iteration)
    CHECK(worst_gradient<Chain>(settings, iteration) < 2e-7);  // measured 3e-8: the curvature of gamma
}

TEST_CASE("edit/edit_chain: the gradient of a chain is that of central differences, whatever of it was drawn") {
  Smooth::Settings settings;
  settings.none = 0;
  settings.share = 0.6;
  for (std::uint64_t iteration = 0; iteration < 12; ++iteration)
    CHECK(worst_gradient<Smooth>(settings, iteration) < 1e-6);
  settings.none = 1;
  CHECK(worst_gradient<Smooth>(settings, 0) < 1e-8);  // no edit
}

TEST_CASE("edit/edit_chain: draws follow from the stream, in the shares that are asked for") {
  Smooth::Settings settings;
  Smooth::Context<float> context, again;
  std::size_t untouched = 0, rotated = 0;
  for (std::uint64_t t = 0; t < 4000; ++t) {
    Smooth::draw(settings, Random(5, t, 1), context);
    Smooth::draw(settings, Random(5, t, 1), again);
    CHECK(context.drawn == again.drawn);
    untouched += std::none_of(context.drawn.begin(), context.drawn.end(), [](bool drawn) { return drawn; }) ? 1 : 0;
    rotated += context.drawn[0] ? 1 : 0;
  }
  // 0.15 + 0.85 * 0.65^6, and 0.85 * 0.35; five standard deviations of 4,000 draws are 0.032 and 0.037.
  CHECK(std::abs(static_cast<double>(untouched) / 4000 - 0.2141) < 0.032);
  CHECK(std::abs(static_cast<double>(rotated) / 4000 - 0.2975) < 0.037);
}

TEST_CASE("edit/edit_chain: JPEG changes a picture as a file does and passes gradients straight through") {
  using Chain = EditChain<JpegEdit>;
  Chain::Settings settings;
  settings.none = 0;
  settings.share = 1;
  std::get<0>(settings.edits).jpeg_quality = {30, 30};
  std::vector<float> pixels = middle_picture<float>(40, 48), d(pixels.size(), 0.0f);
  Chain::Context<float> context;
  Chain::draw(settings, Random(1, 1, 2), context);
  SerialExecutor executor;
  const auto edited = Chain::forward(ImageView<const float>{pixels.data(), 3, 40, 48}, context, executor);
  std::vector<float> by_file(pixels.size());
  jpeg_picture<float>({pixels.data(), 3, 40, 48}, 30, {by_file.data(), 3, 40, 48});
  CHECK(std::equal(by_file.begin(), by_file.end(), edited.data));
  CHECK(by_file != pixels);
  const ImageView<float> behind = Chain::gradient(ImageView<float>{d.data(), 3, 40, 48}, context);
  for (std::size_t i = 0; i < behind.size(); ++i) behind.data[i] += weight_of<float>(i);
  Chain::backward(ImageView<float>{d.data(), 3, 40, 48}, context, executor);
  bool straight = true;
  for (std::size_t i = 0; i < d.size(); ++i) straight = straight && d[i] == weight_of<float>(i);
  CHECK(straight);
}

TEST_CASE("edit/edit_chain: a decoder sees edits where they are drawn, the picture where not, and adds its gradient") {
  Smooth::Settings settings;
  settings.none = 0;
  settings.share = 1;
  const EditedDecoder<ColumnDecoder, Smooth> decoder({}, settings);
  EditedDecoder<ColumnDecoder, Smooth>::Context context;
  std::vector<double> pixels = middle_picture<double>(24, 30), plain(3), edited(3), again(3);
  const ImageView<const double> image{pixels.data(), 3, 24, 30};
  SerialExecutor executor;
  ThreadExecutor threads(3);
  decoder.forward(image, std::span<double>(plain), context, executor);
  ColumnDecoder::Context own;
  ColumnDecoder{}.forward(image, std::span<double>(again), own, executor);
  CHECK(plain == again);
  const Random random(4, 4, 4);
  decoder.draw_edits(context, &random);
  decoder.forward(image, std::span<double>(edited), context, executor);
  CHECK(edited != plain);
  decoder.forward(image, std::span<double>(again), context, threads);
  CHECK(again == edited);
  std::vector<double> d(pixels.size(), 1.0), once(pixels.size(), 0.0);
  const std::vector<double> d_logits{1, -2, 0.5};
  decoder.backward(std::span<const double>(d_logits), ImageView<double>{once.data(), 3, 24, 30}, context, executor);
  decoder.backward(std::span<const double>(d_logits), ImageView<double>{d.data(), 3, 24, 30}, context, executor);
  for (std::size_t i = 0; i < d.size(); ++i) CHECK(d[i] == doctest::Approx(1 + once[i]).epsilon(1e-12));
  decoder.draw_edits(context, nullptr);
  decoder.forward(image, std::span<double>(again), context, executor);
  CHECK(again == plain);
}

TEST_CASE("edit/tone_edit: grey is grey, and no saturation or hue is nothing") {
  const std::array<double, 9> same = ToneEdit::colour_matrix({1, 1, 1}, 1, 0);
  for (std::size_t i = 0; i < 9; ++i) CHECK(same[i] == doctest::Approx(i % 4 == 0 ? 1.0 : 0.0).epsilon(1e-12));
  const std::array<double, 9> grey = ToneEdit::colour_matrix({1, 1, 1}, 0, 0.3);
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(grey[i] == doctest::Approx(grey[3 + i]).epsilon(1e-9));
    CHECK(grey[i] == doctest::Approx(grey[6 + i]).epsilon(1e-9));
  }
  CHECK(grey[0] + grey[1] + grey[2] == doctest::Approx(1));
}
