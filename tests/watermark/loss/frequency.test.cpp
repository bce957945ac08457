// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/loss/frequency.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/loss/concept.hpp"
#include "compmark/splat/loss/reference_ssim.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;
static_assert(ImageLoss<FrequencyLoss<float>> && ImageLoss<FrequencyLoss<double>> &&
              ImageLoss<FrequencyLoss<long double>>);

template <class T>
struct FrequencyImages {
  int height, width;
  std::vector<T> x, y, d;
  FrequencyImages(int h, int w, double noise = 0.3) : height(h), width(w) {
    const std::size_t n = 3 * static_cast<std::size_t>(h) * static_cast<std::size_t>(w);
    const Random random(5, 0, random_stage("test"));
    for (std::size_t i = 0; i < n; ++i) {
      y.push_back(static_cast<T>(0.3 + 0.4 * random.uniform(i + (1u << 30))));
      x.push_back(y.back() + static_cast<T>(noise * random.centered(i)));
    }
    d.resize(n);
  }
  [[nodiscard]] ImageView<const T> view_x() const { return {x.data(), 3, height, width}; }
  [[nodiscard]] ImageView<const T> view_y() const { return {y.data(), 3, height, width}; }
  [[nodiscard]] ImageView<T> view_d() { return {d.data(), 3, height, width}; }
};

template <class T>
typename FrequencyLoss<T>::Settings settings_of(FrequencyBand band, bool modulus, int side, double radius = 3,
                                                double spread = 1) {
  typename FrequencyLoss<T>::Settings settings;
  settings.gain = {band, radius, spread};
  settings.modulus = modulus;
  settings.side = side;
  return settings;
}

/// The loss at native resolution from its definition: plain sums over signed frequencies and the published SSIM.
struct Reference {
  std::vector<long double> response, error;
  long double loss = 0;
};
std::vector<long double> plain_response(ImageView<const double> image, const FrequencyGain& gain, bool modulus) {
  using C = std::complex<long double>;
  const int h = image.height, w = image.width;
  const auto turn = [](int k, int n) { return std::polar(1.0L, -2 * std::numbers::pi_v<long double> * (k % n) / n); };
  const auto at = [&](int y, int x) { return static_cast<std::size_t>(y * w + x); };
  std::vector<C> spectrum(image.plane_size());
  std::vector<long double> response;
  for (int ky = 0; ky < h; ++ky) {
    for (int kx = 0; kx < w; ++kx) {
      C sum{};
      for (int i = 0; i < h; ++i) {
        for (int j = 0; j < w; ++j) {
          const long double grey = 0.2989L * static_cast<long double>(image(0, i, j)) +
                                   0.587L * static_cast<long double>(image(1, i, j)) +
                                   0.114L * static_cast<long double>(image(2, i, j));
          sum += grey * turn(ky * i, h) * turn(kx * j, w);
        }
      }
      spectrum[at(ky, kx)] = sum * static_cast<long double>(gain(std::min(ky, h - ky), std::min(kx, w - kx)));
    }
  }
  for (int i = 0; i < h; ++i) {
    for (int j = 0; j < w; ++j) {
      C sum{};
      for (int ky = 0; ky < h; ++ky) {
        for (int kx = 0; kx < w; ++kx) sum += spectrum[at(ky, kx)] * std::conj(turn(ky * i, h) * turn(kx * j, w));
      }
      const long double value = sum.real() / (h * w);
      response.push_back(modulus ? std::abs(value) : value);
    }
  }
  return response;
}

TEST_CASE(
    "loss/frequency: published gains in closed form; the ring lets the mean through, the high pass "
    "does not (FR1)") {
  const FrequencyGain ring;
  CHECK(1 - ring(0, 0) == doctest::Approx(1.523e-8).epsilon(1e-3));
  CHECK(ring(30, 0) == 0);
  CHECK(ring(18, 24) == 0);
  CHECK(ring(35, 0) == doctest::Approx(1 - std::exp(-0.5)).epsilon(1e-14));
  CHECK(ring(0, 25) == doctest::Approx(0.39347).epsilon(1e-5));
  const FrequencyGain high{FrequencyBand::high_pass, 30, 5};
  CHECK(high(0, 0) == 0);
  CHECK(high(0, 1) == doctest::Approx(5.5540e-4).epsilon(1e-4));
  const std::vector<float> white(3 * 50 * 40, 1.0f);
  SerialExecutor executor;
  for (const FrequencyBand band : {FrequencyBand::ring_notch, FrequencyBand::high_pass}) {
    const FrequencyLoss<float> loss(settings_of<float>(band, false, 0, 30, 5));
    FrequencyLoss<float>::Context context;
    std::vector<float> plane(50 * 40);
    loss.filter({white.data(), 3, 50, 40}, plane, context, executor);
    const double expected = band == FrequencyBand::ring_notch ? 0.9999 : 0;
    for (const float v : plane) CHECK(std::abs(static_cast<double>(v) - expected) < 1e-6);
  }
}

TEST_CASE("loss/frequency: value and map against the definition in long double, odd and even sizes") {
  SerialExecutor executor;
  for (const bool high : {false, true}) {
    for (const int width : {12, 17}) {
      const FrequencyImages<double> images(11, width);
      const auto settings = settings_of<double>(high ? FrequencyBand::high_pass : FrequencyBand::ring_notch, !high, 0);
      const FrequencyLoss<double> loss(settings);
      FrequencyLoss<double>::Context context;
      const FrequencyReport report = loss.forward(images.view_x(), images.view_y(), context, executor);
      const std::vector<long double> a = plain_response(images.view_x(), settings.gain, settings.modulus);
      const std::vector<long double> b = plain_response(images.view_y(), settings.gain, settings.modulus);
      const auto similarity = reference_ssim<long double>({a.data(), 1, 11, width}, {b.data(), 1, 11, width});
      CHECK(report.loss == doctest::Approx(static_cast<double>(1 - similarity.mean)).epsilon(1e-12));
      const ImageView<const double> map = context.error_map();
      REQUIRE(map.size() == similarity.map.size());
      double error = 0;
      for (std::size_t i = 0; i < map.size(); ++i)
        error = std::max(error, std::abs(map.data[i] - static_cast<double>(1 - similarity.map[i])));
      CHECK(error < 1e-12);
    }
  }
}

TEST_CASE(
    "loss/frequency: gradient law for both filters, native and resized either way; without the filter's adjoint it "
    "fails") {
  SerialExecutor executor;
  struct Case {
    FrequencyBand band;
    bool modulus;
    int side;
  };
  for (const Case& c : {Case{FrequencyBand::ring_notch, true, 0}, Case{FrequencyBand::high_pass, false, 0},
                        Case{FrequencyBand::ring_notch, true, 16}, Case{FrequencyBand::ring_notch, true, 8},
                        Case{FrequencyBand::high_pass, false, 16}}) {
    FrequencyImages<double> images(11, 13);
    const FrequencyLoss<double> loss(settings_of<double>(c.band, c.modulus, c.side));
    FrequencyLoss<double>::Context context;
    loss.forward_backward(images.view_x(), images.view_y(), 0.7, images.view_d(), context, executor);
    const auto value = [&] { return 0.7 * loss.forward(images.view_x(), images.view_y(), context, executor).loss; };
    CHECK(testing::gradient_law(value, images.x, images.d, 1e-7) == std::string());
    // control: the gradient as if the filter were the identity
    if (c.side == 0) {
      std::vector<double> response(images.x.size() / 3), target(response.size()), skipped(images.x.size());
      loss.filter(images.view_x(), response, context, executor);
      loss.filter(images.view_y(), target, context, executor);
      std::vector<double> d(response.size());
      (void)reference_ssim<double>({response.data(), 1, 11, 13}, {target.data(), 1, 11, 13}, -0.7,
                                   ImageView<double>{d.data(), 1, 11, 13});
      const std::vector<double> grey{0.2989, 0.587, 0.114};
      for (std::size_t i = 0; i < skipped.size(); ++i) skipped[i] = grey[i / d.size()] * d[i % d.size()];
      CHECK(testing::gradient_law(value, images.x, skipped, 1e-7) != std::string());
    }
    // added, and the same from a target filtered before
    std::vector<double> once = images.d, kept(loss.plane_size(11, 13));
    loss.filter(images.view_y(), kept, context, executor);
    loss.forward_backward_filtered(images.view_x(), kept, 0.7, images.view_d(), context, executor);
    for (std::size_t i = 0; i < once.size(); ++i) CHECK(images.d[i] == 2 * once[i]);
  }
}

TEST_CASE("loss/frequency: the modulus turns the gradient's sign where the response is negative") {
  SerialExecutor executor;
  FrequencyImages<double> images(9, 10);
  const FrequencyLoss<double> loss(settings_of<double>(FrequencyBand::high_pass, true, 0, 1.5));
  FrequencyLoss<double>::Context context;
  // responses nearer to 0 than a difference step would cross the kink: the seed has none
  std::vector<double> response(90);
  FrequencyLoss<double>(settings_of<double>(FrequencyBand::high_pass, false, 0, 1.5))
      .filter(images.view_x(), response, context, executor);
  double nearest = 1;
  std::size_t negative = 0;
  for (const double v : response) {
    nearest = std::min(nearest, std::abs(v));
    negative += v < 0 ? 1 : 0;
  }
  REQUIRE(nearest > 2e-5);
  REQUIRE(negative > 20);
  FrequencyLoss<double>::Context fresh;
  loss.forward_backward(images.view_x(), images.view_y(), 1.0, images.view_d(), fresh, executor);
  const auto value = [&] { return loss.forward(images.view_x(), images.view_y(), fresh, executor).loss; };
  CHECK(testing::gradient_law(value, images.x, images.d, 1e-6, 300) == std::string());
}

TEST_CASE("loss/frequency: identical images give 0 and exact zeros, flat ones too (LS2); x against -x is no NaN") {
  SerialExecutor executor;
  for (const auto& settings : {FrequencyLoss<float>::Settings{}, FrequencyLoss<float>::Settings::intended()}) {
    FrequencyImages<float> images(40, 33);
    const FrequencyLoss<float> loss(settings);
    FrequencyLoss<float>::Context context;
    CHECK(loss.forward_backward(images.view_x(), images.view_x(), 1.0f, images.view_d(), context, executor).loss == 0);
    CHECK(std::all_of(images.d.begin(), images.d.end(), [](float g) { return g == 0; }));
    images.x.assign(images.x.size(), 1.0f);
    CHECK(loss.forward_backward(images.view_x(), images.view_x(), 1.0f, images.view_d(), context, executor).loss == 0);
    CHECK(std::all_of(images.d.begin(), images.d.end(), [](float g) { return g == 0; }));
  }
  FrequencyImages<float> images(40, 33);
  for (std::size_t i = 0; i < images.x.size(); ++i) images.x[i] = -images.y[i];
  const FrequencyLoss<float> loss(settings_of<float>(FrequencyBand::high_pass, false, 0));
  FrequencyLoss<float>::Context context;
  const double value =
      loss.forward_backward(images.view_x(), images.view_y(), 1.0f, images.view_d(), context, executor).loss;
  CHECK(value > 1);
  CHECK(value <= 2);
  CHECK(std::all_of(images.d.begin(), images.d.end(), [](float g) { return std::isfinite(g); }));
}

TEST_CASE("loss/frequency: distances are cycles over the image, so 30 is the published ring at any resolution") {
  SerialExecutor executor;
  const auto residue = [&](int size, int side, double radius) {
    std::vector<float> wave;
    for (int i = 0; i < 3 * size * size; ++i)
      wave.push_back(static_cast<float>(0.5 + 0.4 * std::cos(2 * std::numbers::pi * 30 * (i % size + 0.5) / size)));
    FrequencyLoss<float>::Settings settings;
    settings.gain.radius = radius;
    settings.side = side;
    const FrequencyLoss<float> loss(settings);
    FrequencyLoss<float>::Context context;
    std::vector<float> plane(loss.plane_size(size, size));
    loss.filter({wave.data(), 3, size, size}, plane, context, executor);
    double power = 0;
    for (const float v : plane) power += std::pow(static_cast<double>(v) - 0.49995, 2);
    return std::sqrt(power / static_cast<double>(plane.size()));  // 0.28 without a filter
  };
  CHECK(residue(160, 0, 30) < 1e-6);
  CHECK(residue(120, 0, 30) < 1e-6);
  CHECK(residue(160, 256, 30) < 0.02);              // measured 0.0146: resampled, the border is no longer periodic
  CHECK(residue(160, 0, 30.0 * 160 / 256) > 0.25);  // control: the radius in pixels of a 256-grid is another band
}

TEST_CASE("loss/frequency: float against long double, same bits at any thread count, several sizes in one context") {
  for (const auto& settings : {FrequencyLoss<float>::Settings{}, FrequencyLoss<float>::Settings::intended()}) {
    FrequencyLoss<float>::Context context;
    const FrequencyLoss<float> loss(settings);
    FrequencyLoss<long double>::Settings exact_settings;
    exact_settings.gain = settings.gain;
    exact_settings.modulus = settings.modulus;
    const FrequencyLoss<long double> exact_loss(exact_settings);
    FrequencyLoss<long double>::Context exact_context;
    SerialExecutor serial;
    ThreadExecutor threads(3);
    for (const int width : {37, 64, 71, 37}) {
      FrequencyImages<float> images(50, width, 0.1), again(50, width, 0.1);
      const double value =
          loss.forward_backward(images.view_x(), images.view_y(), 1.0f, images.view_d(), context, serial).loss;
      CHECK(loss.forward_backward(again.view_x(), again.view_y(), 1.0f, again.view_d(), context, threads).loss ==
            value);
      CHECK(images.d == again.d);
      CHECK(context.error_map().width == width);
      FrequencyImages<long double> exact(50, width);
      exact.x.assign(images.x.begin(), images.x.end());
      exact.y.assign(images.y.begin(), images.y.end());
      const double expected =
          exact_loss.forward_backward(exact.view_x(), exact.view_y(), 1.0L, exact.view_d(), exact_context, serial).loss;
      double error = 0, size = 0;
      for (std::size_t i = 0; i < exact.d.size(); ++i) {
        error = std::max(error, std::abs(static_cast<double>(exact.d[i]) - static_cast<double>(images.d[i])));
        size = std::max(size, std::abs(static_cast<double>(exact.d[i])));
      }
      CHECK(value == doctest::Approx(expected).epsilon(2e-6));
      CHECK(error / size < 5e-5);  // measured 2.4e-5: a weak high pass, whose variances are near the constant C2
    }
  }
}

}  // namespace
