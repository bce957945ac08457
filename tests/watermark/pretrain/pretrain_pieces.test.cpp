// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"
#include "compmark/watermark/pretrain/augmentation.hpp"
#include "compmark/watermark/pretrain/dead_leaves.hpp"
#include "compmark/watermark/pretrain/photograph_split.hpp"
#include "compmark/watermark/pretrain/pixel_adam.hpp"
#include "compmark/watermark/pretrain/whitening.hpp"

using namespace compmark;

namespace {

std::vector<double> values(std::size_t count, std::uint64_t seed, double low, double high) {
  const Random random(seed, 0, random_stage("test/pretrain pieces"));
  std::vector<double> result(count);
  for (std::size_t i = 0; i < count; ++i) result[i] = low + (high - low) * random.uniform(i);
  return result;
}

/// Rounds to 8 levels, as a codec would; nearly everywhere its true gradient is zero.
struct CoarseCodec {
  void operator()(ImageView<const double> image, int /*quality*/, ImageView<double> output) const {
    for (std::size_t i = 0; i < image.size(); ++i) output.data[i] = std::round(8 * image.data[i]) / 8;
  }
};

AugmentationDraw drawn(Augmentation kind, double amount) {
  AugmentationDraw draw;
  draw.kind = kind;
  draw.amount = amount;
  draw.seed = 5;
  return draw;
}

}  // namespace

TEST_CASE("pretrain/pretrain: every distortion's gradient against central differences") {
  SerialExecutor executor;
  for (const AugmentationDraw& draw :
       {drawn(Augmentation::none, 0), drawn(Augmentation::crop, 0.4), drawn(Augmentation::resize, 0.6),
        drawn(Augmentation::resize, 1.3), drawn(Augmentation::rotation, 0.4), drawn(Augmentation::blur, 1.1),
        drawn(Augmentation::noise, 0.05), drawn(Augmentation::brightness, 1.25)}) {
    CAPTURE(static_cast<int>(draw.kind));
    std::vector<double> pixels = values(3 * 12 * 15, 1, 0.2, 0.9);  // brightness clamps the upper part
    std::vector<double> gradient(pixels.size(), 0.0);
    const ImageView<const double> image{pixels.data(), 3, 12, 15};
    Augmenter<double> augmenter;
    std::vector<double> slope;
    const auto loss = [&] {
      const ImageView<const double> seen = augmenter.forward(image, draw, CoarseCodec{}, executor);
      if (slope.empty()) slope = values(seen.size(), 2, -1, 1);
      double sum = 0;
      for (std::size_t i = 0; i < seen.size(); ++i) sum += slope[i] * seen.data[i];
      return sum;
    };
    static_cast<void>(loss());
    const ImageView<const double> seen = augmenter.forward(image, draw, CoarseCodec{}, executor);
    augmenter.backward({slope.data(), 3, seen.height, seen.width}, {gradient.data(), 3, 12, 15}, executor);
    CHECK(testing::gradient_law(loss, pixels, gradient, 1e-6, 48) == "");
  }
}

TEST_CASE("pretrain/pretrain: a codec is passed straight through") {
  SerialExecutor executor;
  const std::vector<double> pixels = values(3 * 8 * 8, 3, 0, 1);
  std::vector<double> gradient(pixels.size(), 0.25);
  Augmenter<double> augmenter;
  const AugmentationDraw draw = drawn(Augmentation::jpeg, 50);
  const auto seen = augmenter.forward({pixels.data(), 3, 8, 8}, draw, CoarseCodec{}, executor);
  for (std::size_t i = 0; i < seen.size(); ++i) CHECK(seen.data[i] * 8 == std::round(seen.data[i] * 8));
  const std::vector<double> slope = values(pixels.size(), 4, -1, 1);
  augmenter.backward({slope.data(), 3, 8, 8}, {gradient.data(), 3, 8, 8}, executor);
  for (std::size_t i = 0; i < gradient.size(); ++i) CHECK(gradient[i] == doctest::Approx(0.25 + slope[i]));
}

TEST_CASE("pretrain/pretrain: rotation turns counter-clockwise about the middle") {
  std::vector<double> pixels(11 * 11, 0.0), turned(11 * 11, 9.0);
  pixels[5 * 11 + 9] = 1;  // right of the middle
  SerialExecutor executor;
  rotate_image<double>({pixels.data(), 1, 11, 11}, std::acos(-1.0) / 2, {turned.data(), 1, 11, 11}, executor);
  CHECK(turned[1 * 11 + 5] == doctest::Approx(1));  // above it
  CHECK(turned[5 * 11 + 9] == doctest::Approx(0).epsilon(1e-9));
}

TEST_CASE("pretrain/pretrain: a distortion has the same bits for any number of threads, there and back") {
  constexpr int height = 131, width = 90;  // more than a chunk of each loop
  const std::vector<float> pixels = [] {
    std::vector<float> made;
    for (const double v : values(3 * height * width, 12, 0, 1)) made.push_back(static_cast<float>(v));
    return made;
  }();
  const ImageView<const float> image{pixels.data(), 3, height, width};
  SerialExecutor serial;
  ThreadExecutor threads(3);
  const auto run = [&](const AugmentationDraw& draw, auto& executor) {
    Augmenter<float> augmenter;
    const auto codec = [](ImageView<const float> from, int, ImageView<float> to) {
      std::copy_n(from.data, from.size(), to.data);
    };
    const auto seen = augmenter.forward(image, draw, codec, executor);
    std::vector<float> all(seen.data, seen.data + seen.size());
    std::vector<float> gradient(pixels.size(), 0.5f), slope(seen.size());
    for (std::size_t i = 0; i < slope.size(); ++i) slope[i] = seen.data[i] - 0.3f;
    augmenter.backward({slope.data(), 3, seen.height, seen.width}, {gradient.data(), 3, height, width}, executor);
    all.insert(all.end(), gradient.begin(), gradient.end());
    return all;
  };
  for (const AugmentationDraw& draw :
       {drawn(Augmentation::noise, 0.1), drawn(Augmentation::brightness, 1.3), drawn(Augmentation::rotation, 0.4),
        drawn(Augmentation::blur, 0.8), drawn(Augmentation::resize, 0.7), drawn(Augmentation::none, 0)}) {
    CAPTURE(static_cast<int>(draw.kind));
    const std::vector<float> alone = run(draw, serial);
    CHECK(alone == run(draw, threads));
    CHECK((draw.kind == Augmentation::none) == std::equal(pixels.begin(), pixels.end(), alone.begin()));
  }
}

TEST_CASE("pretrain/pretrain: draws stay in their ranges, and kinds of weight zero are not drawn") {
  AugmentationSettings settings;
  settings.weight = {0, 1, 1, 0, 1, 0, 1, 0};
  std::array<int, augmentation_count> seen{};
  for (std::uint64_t i = 0; i < 4000; ++i) {
    const AugmentationDraw draw = draw_augmentation(settings, Random(1, i, 2));
    ++seen[static_cast<std::size_t>(draw.kind)];
    if (draw.kind == Augmentation::crop) CHECK((draw.amount >= 0.25 && draw.amount <= 0.9));
    if (draw.kind == Augmentation::resize) CHECK((draw.amount >= 0.6 && draw.amount <= 1.1));
  }
  for (std::size_t k = 0; k < augmentation_count; ++k) {
    if (settings.weight[k] == 0) CHECK(seen[k] == 0);
    if (settings.weight[k] != 0) CHECK(std::abs(seen[k] - 1000) < 110);  // four standard deviations of 27.4
  }
}

TEST_CASE("pretrain/pretrain: pixels stay in range and on the ball of their PSNR") {
  const std::vector<double> pixels = values(300, 6, 0, 1), gradient = values(300, 7, -1, 1);
  std::vector<double> marked(300);
  PixelChange<double> change;
  change.reset(300);
  const ImageView<const double> image{pixels.data(), 3, 10, 10}, slope{gradient.data(), 3, 10, 10};
  for (int step = 0; step < 20; ++step) change.step(image, slope, 0.01, 38);
  change.write(image, {marked.data(), 3, 10, 10});
  double square = 0, along = 0;
  for (std::size_t i = 0; i < 300; ++i) {
    CHECK((marked[i] >= 0 && marked[i] <= 1));
    square += (marked[i] - pixels[i]) * (marked[i] - pixels[i]);
    along += (marked[i] - pixels[i]) * gradient[i];
  }
  CHECK(-10 * std::log10(square / 300) == doctest::Approx(38).epsilon(1e-9));
  CHECK(along < 0);
}

TEST_CASE("pretrain/pretrain: whitening with the covariance gives variance one and no correlation") {
  const std::size_t size = 5, count = 400;
  std::vector<double> samples = values(size * count, 8, -1, 1);
  for (std::size_t n = 0; n < count; ++n) {
    double* y = samples.data() + n * size;
    y[3] = 3 + 10 * y[0] + 0.1 * y[3];
    y[4] = y[1] - y[2] + 0.3 * y[4] - 7;
  }
  const TriangularWhitening whitening = triangular_whitening(samples, size, 0);
  std::vector<double> moments(size * size, 0);
  for (std::size_t n = 0; n < count; ++n) {
    std::vector<double> z(size, 0);
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j <= i; ++j)
        z[i] += whitening.weight[i * size + j] * (samples[n * size + j] - whitening.mean[j]);
    }
    for (std::size_t i = 0; i < size * size; ++i) moments[i] += z[i / size] * z[i % size] / count;
  }
  for (std::size_t i = 0; i < size * size; ++i)
    CHECK(moments[i] == doctest::Approx(i % (size + 1) == 0 ? 1 : 0).epsilon(1e-8));
  // The control: the published sum instead of the covariance depends on the number of samples.
  const std::vector<double> half(samples.begin(), samples.begin() + static_cast<std::ptrdiff_t>(size * count / 2));
  CHECK(triangular_whitening(half, size, 0).weight[0] == doctest::Approx(whitening.weight[0]).epsilon(0.1));

  // A head of random directions of the whitened features has unit variance too, and whitening it again changes nothing.
  const std::vector<double> rows = orthonormal_rows(3, size, Random(1, 2, 3));
  std::vector<double> head(3 * size), bias(3), logits(3 * count);
  whitened_head<double>(rows, whitening, head, bias);
  for (std::size_t n = 0; n < count; ++n) {
    for (std::size_t r = 0; r < 3; ++r) {
      logits[n * 3 + r] = bias[r];
      for (std::size_t j = 0; j < size; ++j) logits[n * 3 + r] += head[r * size + j] * samples[n * size + j];
    }
  }
  const TriangularWhitening again = triangular_whitening(logits, 3, 0);
  for (std::size_t i = 0; i < 9; ++i) CHECK(again.weight[i] == doctest::Approx(i % 4 == 0 ? 1 : 0).epsilon(1e-7));
  const std::vector<double> kept = head;
  whiten_head<double>(again, head, bias);
  for (std::size_t i = 0; i < head.size(); ++i) CHECK(head[i] == doctest::Approx(kept[i]).epsilon(1e-6));
}

TEST_CASE("pretrain/pretrain: dead leaves are images, the same for the same index") {
  std::vector<float> a(3 * 40 * 48), b(a.size()), c(a.size());
  dead_leaves_image(1, 5, {a.data(), 3, 40, 48});
  dead_leaves_image(1, 5, {b.data(), 3, 40, 48});
  dead_leaves_image(1, 6, {c.data(), 3, 40, 48});
  CHECK(a == b);
  CHECK(a != c);
  double mean = 0, square = 0;
  for (const float v : a) {
    CHECK((v >= 0 && v <= 1));
    mean += static_cast<double>(v) / static_cast<double>(a.size());
    square += static_cast<double>(v * v) / static_cast<double>(a.size());
  }
  CHECK(square - mean * mean > 1e-3);
}

TEST_CASE("pretrain/pretrain: pieces of one photograph stay on one side of the split, whatever else is in the folder") {
  CHECK(photograph_group("kitchen_0.jpg") == "kitchen");
  CHECK(photograph_group("kitchen_12.png") == "kitchen");
  CHECK(photograph_group("coco_000000000009_1.jpg") == "coco_000000000009");
  CHECK(photograph_group("0001.jpg") == "0001");
  CHECK(photograph_group("_7.jpg") == "_7");
  std::vector<std::string> names;
  for (int i = 0; i < 100; ++i) {
    for (const char* piece : {"_0.jpg", "_1.jpg"}) names.push_back("photo" + std::to_string(i) + piece);
  }
  const std::set<std::string> out = held_out_groups(names, 0.2);
  CHECK(out.size() == 20);
  CHECK(held_out_groups({names.rbegin(), names.rend()}, 0.2) == out);
  CHECK(held_out_groups({"a_0.png", "b_0.png"}, 0.001).size() == 1);
  const std::set<std::string> more = held_out_groups(names, 0.3);  // the same and others
  CHECK(std::includes(more.begin(), more.end(), out.begin(), out.end()));
}
