// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/loss/photometric.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/loss/concept.hpp"
#include "compmark/splat/loss/l1.hpp"
#include "compmark/splat/loss/reference_ssim.hpp"

namespace {

using namespace compmark;
static_assert(ImageLoss<PhotometricLoss<float>> && ImageLoss<PhotometricLoss<double>> && ImageLoss<L1Loss<float>>);

template <class T>
struct Pair {
  int channels, height, width;
  std::vector<T> x, y, d;
  Pair(int c, int h, int w, double base_x, double base_y, double noise) : channels(c), height(h), width(w) {
    const std::size_t n = static_cast<std::size_t>(c) * static_cast<std::size_t>(h) * static_cast<std::size_t>(w);
    const Random random(11, 0, random_stage("test"));
    for (std::size_t i = 0; i < n; ++i) {
      x.push_back(static_cast<T>(base_x + noise * random.uniform(i)));
      y.push_back(static_cast<T>(base_y + noise * random.uniform(i + (1u << 30))));
    }
    d.resize(n);
  }
  [[nodiscard]] ImageView<const T> view_x() const { return {x.data(), channels, height, width}; }
  [[nodiscard]] ImageView<const T> view_y() const { return {y.data(), channels, height, width}; }
  [[nodiscard]] ImageView<T> view_d() { return {d.data(), channels, height, width}; }
};

/// Value and gradient of lambda (1 - SSIM) + (1 - lambda) L1 in long double, from the reference.
template <class T>
struct Expected {
  long double ssim = 0, l1 = 0, loss = 0;
  std::vector<long double> d;
  Expected(const Pair<T>& pair, long double lambda, long double weight) : d(pair.x.size()) {
    const std::vector<long double> x(pair.x.begin(), pair.x.end());
    const std::vector<long double> y(pair.y.begin(), pair.y.end());
    const int c = pair.channels, h = pair.height, w = pair.width;
    ssim = reference_ssim<long double>({x.data(), c, h, w}, {y.data(), c, h, w}, -lambda * weight,
                                       ImageView<long double>{d.data(), c, h, w})
               .mean;
    const long double n = static_cast<long double>(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      l1 += std::abs(x[i] - y[i]) / n;
      d[i] += (1 - lambda) * weight / n * (x[i] > y[i] ? 1 : (x[i] < y[i] ? -1 : 0));
    }
    loss = (1 - lambda) * l1 + lambda * (1 - ssim);
  }
};

template <class T>
double worst(const std::vector<T>& value, const std::vector<long double>& expected) {
  long double result = 0;
  for (std::size_t i = 0; i < value.size(); ++i)
    result = std::max(result, std::abs(static_cast<long double>(value[i]) - expected[i]));
  return static_cast<double>(result);
}
double largest(const std::vector<long double>& values) {
  long double result = 0;
  for (const long double v : values) result = std::max(result, std::abs(v));
  return static_cast<double>(result);
}

TEST_CASE(
    "loss/photometric: equals the reference in double, at every size of rows, bands and packs, value and gradient (G1, "
    "LS4)") {
  struct Size {
    int c, h, w;
  };
  for (const Size& s : {Size{1, 1, 1},
                        {1, 5, 7},
                        {3, 7, 5},
                        {1, 11, 11},
                        {2, 16, 8},
                        {1, 23, 17},
                        {1, 4, 33},
                        {1, 96, 9},
                        {1, 97, 15},
                        {1, 101, 16},
                        {1, 203, 12}}) {
    Pair<double> pair(s.c, s.h, s.w, 0.1, 0.15, 0.7);
    PhotometricLoss<double> loss(PhotometricLoss<double>::Settings{0.35});
    PhotometricLoss<double>::Context context;
    SerialExecutor executor;
    const PhotometricReport report =
        loss.forward_backward(pair.view_x(), pair.view_y(), 2.5, pair.view_d(), context, executor);
    const Expected<double> expected(pair, 0.35L, 2.5L);
    CAPTURE(s.h);
    CAPTURE(s.w);
    CHECK(std::abs(report.ssim - static_cast<double>(expected.ssim)) < 1e-14);
    CHECK(std::abs(report.l1 - static_cast<double>(expected.l1)) < 1e-14);
    CHECK(std::abs(report.loss - static_cast<double>(expected.loss)) < 1e-14);
    CHECK(worst(pair.d, expected.d) < 1e-14 * std::max(1.0, largest(expected.d)));
    const PhotometricReport value = loss.forward(pair.view_x(), pair.view_y(), context, executor);
    CHECK(value.ssim == doctest::Approx(report.ssim).epsilon(1e-15));
    CHECK(value.loss == doctest::Approx(report.loss).epsilon(1e-15));
  }
}

TEST_CASE("loss/photometric: the gradient is the slope of the value (G1, central differences in double)") {
  Pair<double> pair(2, 13, 19, 0.1, 0.15, 0.7);
  PhotometricLoss<double> loss(PhotometricLoss<double>::Settings{0.2});
  PhotometricLoss<double>::Context context;
  SerialExecutor executor;
  loss.forward_backward(pair.view_x(), pair.view_y(), 1.0, pair.view_d(), context, executor);
  const double step = 1e-5;  // error of the difference: step^2 f''' / 6 + 1e-16 / step, both near 1e-11
  double gap = 0;
  for (std::size_t i = 0; i < pair.x.size(); i += 7) {
    const double old = pair.x[i];
    pair.x[i] = old + step;
    const double above = loss.forward(pair.view_x(), pair.view_y(), context, executor).loss;
    pair.x[i] = old - step;
    const double below = loss.forward(pair.view_x(), pair.view_y(), context, executor).loss;
    pair.x[i] = old;
    gap = std::max(gap, std::abs((above - below) / (2 * step) - pair.d[i]));
  }
  CHECK(gap < 1e-10);  // gradients are 1e-3; measured 2e-11
}

TEST_CASE("loss/photometric: identical images give SSIM 1, loss 0 and a gradient of exact zeros (G2, LS9)") {
  for (const double base : {0.0, 0.5, 0.999, -3.0, 40.0}) {
    Pair<float> pair(3, 29, 37, base, base, base == 0.5 ? 0 : 0.3);
    pair.y = pair.x;
    PhotometricLoss<float> loss;
    PhotometricLoss<float>::Context context;
    SerialExecutor executor;
    const PhotometricReport report =
        loss.forward_backward(pair.view_x(), pair.view_y(), 1e6f, pair.view_d(), context, executor);
    CHECK(report.ssim == 1);
    CHECK(report.l1 == 0);
    CHECK(report.loss == 0);
    CHECK(std::all_of(pair.d.begin(), pair.d.end(), [](float g) { return g == 0; }));
  }
  // Negative control: copysign has no zero.
  CHECK(std::copysign(1.0f, 0.3f - 0.3f) == 1.0f);
}

/// The published formula in float: five blurs, variance = E[x^2] - mean^2, no shift. Returns the largest error of the map against long double.
double naive_float_map_error(const Pair<float>& pair, double& largest_ssim) {
  const std::array<float, ssim_radius + 1> window = ssim_window<float>();
  const std::vector<long double> x(pair.x.begin(), pair.x.end());
  const std::vector<long double> y(pair.y.begin(), pair.y.end());
  const auto exact =
      reference_ssim<long double>({x.data(), 1, pair.height, pair.width}, {y.data(), 1, pair.height, pair.width});
  double error = 0;
  for (int row = 0; row < pair.height; ++row) {
    for (int column = 0; column < pair.width; ++column) {
      std::array<float, 5> m{};
      for (int i = -ssim_radius; i <= ssim_radius; ++i) {
        std::array<float, 5> line{};
        for (int j = -ssim_radius; j <= ssim_radius; ++j) {
          const bool in = row + i >= 0 && row + i < pair.height && column + j >= 0 && column + j < pair.width;
          const float a = in ? pair.view_x()(0, row + i, column + j) : 0;
          const float b = in ? pair.view_y()(0, row + i, column + j) : 0;
          const float w = window[static_cast<std::size_t>(std::abs(j))];
          const std::array<float, 5> term{a, b, a * a, b * b, a * b};
          for (std::size_t k = 0; k < 5; ++k) line[k] += w * term[k];
        }
        for (std::size_t k = 0; k < 5; ++k) m[k] += window[static_cast<std::size_t>(std::abs(i))] * line[k];
      }
      const float c1 = 1e-4f, c2 = 9e-4f;
      const float s = (2 * m[0] * m[1] + c1) * (2 * (m[4] - m[0] * m[1]) + c2) /
                      ((m[0] * m[0] + m[1] * m[1] + c1) * ((m[2] - m[0] * m[0]) + (m[3] - m[1] * m[1]) + c2));
      const std::size_t at =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(pair.width) + static_cast<std::size_t>(column);
      error = std::max(error, static_cast<double>(std::abs(static_cast<long double>(s) - exact.map[at])));
      largest_ssim = std::max(largest_ssim, static_cast<double>(s));
    }
  }
  return error;
}

TEST_CASE("loss/photometric: float agrees with long double on six kinds of image to 1e-6, white ones included (LS1)") {
  struct Kind {
    const char* name;
    double base_x, base_y, noise;
  };
  for (const Kind& kind : {Kind{"noise", 0, 0, 1},
                           {"white", 0.999, 0.999, 0.001},
                           {"white against off-white", 0.998, 0.99, 0.002},
                           {"black", 0, 0, 0.001},
                           {"grey", 0.5, 0.5, 0.02},
                           {"high contrast", -0.5, 0.5, 1}}) {
    Pair<float> pair(1, 61, 83, kind.base_x, kind.base_y, kind.noise);
    PhotometricLoss<float> loss(PhotometricLoss<float>::Settings{1.0f});
    PhotometricLoss<float>::Context context;
    SerialExecutor executor;
    const PhotometricReport report =
        loss.forward_backward(pair.view_x(), pair.view_y(), 1.0f, pair.view_d(), context, executor);
    const Expected<float> expected(pair, 1, 1);
    CAPTURE(kind.name);
    CHECK(std::abs(report.ssim - static_cast<double>(expected.ssim)) < 1e-6);  // measured below 2e-8
    CHECK(report.ssim <= 1 + 1e-6);
    CHECK(worst(pair.d, expected.d) < 2e-4 * largest(expected.d));  // measured 6e-5 on white
  }
  // Negative control: the published formula in float misses on white by more than the tolerance, and exceeds 1.
  const Pair<float> white(1, 61, 83, 0.999, 0.999, 0.001);
  double largest_ssim = 0;
  CHECK(naive_float_map_error(white, largest_ssim) > 1e-4);
  CHECK(largest_ssim > 1 + 1e-5);
}

TEST_CASE("loss/photometric: an inverted image has finite value and gradient (LS3)") {
  Pair<float> pair(1, 32, 32, 0, 0, 1);
  for (std::size_t i = 0; i < pair.x.size(); ++i) pair.y[i] = 1 - pair.x[i];
  PhotometricLoss<float> loss;
  PhotometricLoss<float>::Context context;
  SerialExecutor executor;
  const PhotometricReport report =
      loss.forward_backward(pair.view_x(), pair.view_y(), 1.0f, pair.view_d(), context, executor);
  CHECK(report.ssim < -0.5);
  CHECK(std::isnan(std::pow(report.ssim, 0.2856)));  // negative control: a weight of MS-SSIM as its power
  CHECK(std::isfinite(report.loss));
  CHECK(std::all_of(pair.d.begin(), pair.d.end(), [](float g) { return std::isfinite(g); }));
}

TEST_CASE("loss/photometric: zero-mean high-pass images (LS2)") {
  const int size = 64;
  Pair<float> pair(1, size, size, 0, 0, 0);
  PhotometricLoss<float> loss(PhotometricLoss<float>::Settings{1.0f});
  PhotometricLoss<float>::Context context;
  SerialExecutor executor;
  CHECK(loss.forward_backward(pair.view_x(), pair.view_y(), 1.0f, pair.view_d(), context, executor).loss ==
        0);  // zero against zero
  CHECK(std::all_of(pair.d.begin(), pair.d.end(), [](float g) { return g == 0; }));
  // A checkerboard has mean 0 in every window that lies inside: its negative has 1 - SSIM near 2 there.
  for (std::size_t i = 0; i < pair.x.size(); ++i) {
    pair.x[i] = (i / size + i) % 2 == 0 ? 0.5f : -0.5f;
    pair.y[i] = -pair.x[i];
  }
  const double distance = loss.forward(pair.view_x(), pair.view_y(), context, executor).loss;
  CHECK(distance > 1.5);
  CHECK(distance <= 2);
  const double mean = 0, variance = 0;  // negative control: two flat images, without the constants
  CHECK(std::isnan(2 * mean * mean * 2 * variance / ((mean * mean + mean * mean) * (variance + variance))));
}

TEST_CASE("loss/photometric: same bits with 1, 2, 3 and 4 threads (G3)") {
  Pair<float> first(3, 250, 43, 0, 0, 1);
  PhotometricLoss<float> loss;
  PhotometricLoss<float>::Context context;
  SerialExecutor serial;
  const PhotometricReport report =
      loss.forward_backward(first.view_x(), first.view_y(), 1.0f, first.view_d(), context, serial);
  for (const std::size_t threads : {1u, 2u, 3u, 4u}) {
    Pair<float> pair(3, 250, 43, 0, 0, 1);
    ThreadExecutor executor(threads);
    PhotometricLoss<float>::Context fresh;
    const PhotometricReport again =
        loss.forward_backward(pair.view_x(), pair.view_y(), 1.0f, pair.view_d(), fresh, executor);
    CHECK(std::memcmp(pair.d.data(), first.d.data(), first.d.size() * sizeof(float)) == 0);
    CHECK(std::memcmp(&again, &report, sizeof(report)) == 0);
  }
}

TEST_CASE(
    "loss/photometric: nothing is allocated after the first call of a size (G4); one context serves sizes in turn") {
  Pair<float> large(3, 120, 70, 0, 0, 1);
  Pair<float> small(3, 30, 21, 0, 0, 1);
  PhotometricLoss<float> loss;
  PhotometricLoss<float>::Context context, fresh;
  SerialExecutor executor;
  loss.forward_backward(large.view_x(), large.view_y(), 1.0f, large.view_d(), context, executor);
  const void* scratch = context.scratch.row(0);
  const void* partial = context.partial.data();
  loss.forward_backward(large.view_x(), large.view_y(), 1.0f, large.view_d(), context, executor);
  const PhotometricReport used =
      loss.forward_backward(small.view_x(), small.view_y(), 1.0f, small.view_d(), context, executor);
  CHECK(context.scratch.row(0) == scratch);
  CHECK(context.partial.data() == partial);
  // What another size left in the scratch is not seen.
  Pair<float> again(3, 30, 21, 0, 0, 1);
  const PhotometricReport clean =
      loss.forward_backward(again.view_x(), again.view_y(), 1.0f, again.view_d(), fresh, executor);
  CHECK(again.d == small.d);
  CHECK(clean.loss == used.loss);
}

TEST_CASE("loss/photometric: gradients are added, linear in the weight (G5)") {
  Pair<double> pair(1, 17, 18, 0, 0, 1);
  PhotometricLoss<double> loss;
  PhotometricLoss<double>::Context context;
  SerialExecutor executor;
  loss.forward_backward(pair.view_x(), pair.view_y(), 1.0, pair.view_d(), context, executor);
  const std::vector<double> once = pair.d;
  loss.forward_backward(pair.view_x(), pair.view_y(), 2.0, pair.view_d(), context, executor);
  double gap = 0;
  for (std::size_t i = 0; i < once.size(); ++i) gap = std::max(gap, std::abs(pair.d[i] - 3 * once[i]));
  CHECK(gap < 1e-17);
}

TEST_CASE("loss/photometric: GradientMode::set is add on a cleared gradient, whatever was there before") {
  Pair<float> pair(3, 19, 37, 0, 0, 1);
  const PhotometricLoss<float> loss;
  PhotometricLoss<float>::Context context;
  SerialExecutor executor;
  loss.forward_backward(pair.view_x(), pair.view_y(), 1.0f, pair.view_d(), context, executor);
  const std::vector<float> added = pair.d;
  std::fill(pair.d.begin(), pair.d.end(), std::numeric_limits<float>::quiet_NaN());
  loss.forward_backward<GradientMode::set>(pair.view_x(), pair.view_y(), 1.0f, pair.view_d(), context, executor);
  CHECK(pair.d == added);
}

TEST_CASE("loss/photometric: the border sees zeros outside the image, as published") {
  // Embedding both images in a larger black frame changes the window sums nowhere inside, so the map inside must be the same.
  const int h = 14, w = 21, rim = 6;
  const Pair<float> small(1, h, w, 0.2, 0.3, 0.5);
  std::vector<long double> x(static_cast<std::size_t>((h + 2 * rim) * (w + 2 * rim)));
  std::vector<long double> y(x.size());
  for (int r = 0; r < h; ++r) {
    for (int c = 0; c < w; ++c) {
      x[static_cast<std::size_t>((r + rim) * (w + 2 * rim) + c + rim)] =
          static_cast<long double>(small.view_x()(0, r, c));
      y[static_cast<std::size_t>((r + rim) * (w + 2 * rim) + c + rim)] =
          static_cast<long double>(small.view_y()(0, r, c));
    }
  }
  const auto framed =
      reference_ssim<long double>({x.data(), 1, h + 2 * rim, w + 2 * rim}, {y.data(), 1, h + 2 * rim, w + 2 * rim});
  long double mean = 0;
  for (int r = 0; r < h; ++r) {
    for (int c = 0; c < w; ++c) mean += framed.map[static_cast<std::size_t>((r + rim) * (w + 2 * rim) + c + rim)];
  }
  PhotometricLoss<float> loss;
  PhotometricLoss<float>::Context context;
  SerialExecutor executor;
  CHECK(std::abs(loss.forward(small.view_x(), small.view_y(), context, executor).ssim -
                 static_cast<double>(mean / (h * w))) < 1e-6);
}

TEST_CASE("loss/photometric: a NaN pixel shows in the value instead of being hidden") {
  Pair<float> pair(1, 12, 12, 0, 0, 1);
  pair.x[40] = std::nanf("");
  PhotometricLoss<float> loss;
  PhotometricLoss<float>::Context context;
  SerialExecutor executor;
  CHECK(std::isnan(loss.forward(pair.view_x(), pair.view_y(), context, executor).loss));
}

}  // namespace
