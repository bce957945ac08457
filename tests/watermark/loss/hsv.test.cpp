// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/loss/hsv.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/loss/concept.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;
static_assert(ImageLoss<HsvLoss<float>> && ImageLoss<HsvLoss<double>> && ImageLoss<HsvLoss<long double>>);

/// Six sextants of the hue circle, exactly: hue in degrees times the range of the channels, from whole numbers.
struct Hue {
  long scaled = 0, range = 0;  // hue = scaled / range in [0, 360); grey has range 0
  Hue(long r, long g, long b) {
    const long largest = std::max({r, g, b});
    range = largest - std::min({r, g, b});
    if (range == 0) return;
    if (largest == r) {
      scaled = 60 * (g - b);
      if (scaled < 0) scaled += 360 * range;
    } else if (largest == g) {
      scaled = 60 * (2 * range + b - r);
    } else {
      scaled = 60 * (4 * range + r - g);
    }
  }
  [[nodiscard]] bool in(long from, long to, bool with_end) const {
    return scaled >= from * range && (with_end ? scaled <= to * range : scaled < to * range);
  }
  [[nodiscard]] std::array<bool, 3> thirds(bool closed) const {
    if (range == 0) return {};
    return {in(0, 60, closed) || in(300, 360, closed), in(60, 180, closed), in(180, 300, closed)};
  }
};

template <class T>
struct HsvImages {
  int height, width;
  std::vector<T> x, y, d;
  HsvImages(int h, int w) : height(h), width(w) {
    const std::size_t n = 3 * static_cast<std::size_t>(h) * static_cast<std::size_t>(w);
    const Random random(5, 0, random_stage("test"));
    for (std::size_t i = 0; i < n; ++i) {
      x.push_back(static_cast<T>(random.uniform(i)));
      y.push_back(static_cast<T>(random.uniform(i + (1u << 30))));
    }
    d.resize(n);
  }
  [[nodiscard]] ImageView<const T> view_x() const { return {x.data(), 3, height, width}; }
  [[nodiscard]] ImageView<const T> view_y() const { return {y.data(), 3, height, width}; }
  [[nodiscard]] ImageView<T> view_d() { return {d.data(), 3, height, width}; }
};

/// Loss of one pixel of colour `c` against black, with all thresholds open: tells the masks through the report.
template <class T>
std::array<bool, 3> masks_of(const HsvLoss<T>& loss, const std::array<T, 3>& c) {
  typename HsvLoss<T>::Context context;
  SerialExecutor executor;
  const std::array<T, 3> black{};
  const HsvReport report =
      loss.forward(ImageView<const T>{c.data(), 3, 1, 1}, ImageView<const T>{black.data(), 3, 1, 1}, context, executor);
  return {report.pixels[0] == 1, report.pixels[1] == 1, report.pixels[2] == 1};
}

/// The hue as an angle in float, wrapped into [0, 2 pi), as one would write it.
std::array<bool, 3> float_thirds(float r, float g, float b) {
  constexpr float pi = 3.14159265f;
  const float largest = std::max({r, g, b}), range = largest - std::min({r, g, b});
  if (range == 0) return {};
  const float sextant = largest == r ? (g - b) / range : (largest == g ? 2 + (b - r) / range : 4 + (r - g) / range);
  const float hue = 2 * pi * (sextant / 6 - std::floor(sextant / 6));
  return {hue < pi / 3 || (hue >= 5 * pi / 3 && hue < 2 * pi), hue >= pi / 3 && hue < pi,
          hue >= pi && hue < 5 * pi / 3};
}

TEST_CASE(
    "loss/hsv: masks are the sextant hue on a lattice of 18 levels, random colours and ties; angles in float fail") {
  typename HsvLoss<float>::Settings settings;
  settings.saturation = settings.value = {1e-6f, 1e-6f, 1e-6f};
  const HsvLoss<float> closed(settings);
  settings.thirds = HueThirds::half_open;
  const HsvLoss<float> half_open(settings);
  std::size_t wrong = 0, double_counted = 0, uncovered = 0, wrong_in_float = 0, checked = 0;
  const auto check = [&](long r, long g, long b) {
    const std::array<float, 3> c{static_cast<float>(r) / 255, static_cast<float>(g) / 255, static_cast<float>(b) / 255};
    const Hue hue(r, g, b);
    const std::array<bool, 3> twice = masks_of(closed, c), once = masks_of(half_open, c);
    wrong += (twice != hue.thirds(true) ? 1 : 0) + (once != hue.thirds(false) ? 1 : 0);
    const int members = once[0] + once[1] + once[2];
    uncovered +=
        members != (hue.range == 0 ? 0 : 1) ? 1 : 0;  // the half-open thirds are a partition of what is not grey
    double_counted += twice[0] + twice[1] + twice[2] == 2 ? 1 : 0;
    wrong_in_float += float_thirds(c[0], c[1], c[2]) != hue.thirds(false) ? 1 : 0;
    ++checked;
  };
  for (long r = 0; r <= 255; r += 15) {
    for (long g = 0; g <= 255; g += 15) {
      for (long b = 0; b <= 255; b += 15) check(r, g, b);
    }
  }
  const Random random(7, 0, random_stage("test"));
  for (std::size_t i = 0; i < 20000; ++i) {
    const long a = static_cast<long>(random.below(3 * i, 256)), b = static_cast<long>(random.below(3 * i + 1, 256));
    const long c = i % 4 != 0 ? static_cast<long>(random.below(3 * i + 2, 256)) : (i % 8 == 0 ? a : b);
    check(a, b, c);
    check(c, b, a);
    check(b, a, c);
  }
  CHECK(checked > 60000);
  CHECK(wrong == 0);
  CHECK(uncovered == 0);
  CHECK(double_counted > 1000);
  CHECK(wrong_in_float > 0);
}

TEST_CASE("loss/hsv: red a hair to the blue side keeps its colour (LS5), black and grey have none") {
  HsvLoss<float>::Settings settings;
  settings.saturation = settings.value = {1e-6f, 1e-6f, 1e-6f};
  settings.thirds = HueThirds::half_open;
  const HsvLoss<float> loss(settings);
  const std::array<float, 3> nearly{1.0f, 0.0f, 1e-8f};
  CHECK(masks_of(loss, nearly) == std::array<bool, 3>{true, false, false});
  CHECK(float_thirds(nearly[0], nearly[1], nearly[2]) == std::array<bool, 3>{});  // the angle rounds to 2 pi: nowhere
  CHECK(masks_of(loss, {0.0f, 0.0f, 0.0f}) == std::array<bool, 3>{});
  CHECK(masks_of(loss, {0.5f, 0.5f, 0.5f}) == std::array<bool, 3>{});
}

TEST_CASE("loss/hsv: the released formula, 1 / (9 H W) of the squared error times the number of largest channels") {
  HsvImages<double> images(23, 37);
  for (std::size_t i = 0; i < images.x.size() / 3; i += 5) images.x[i] = images.x[i + images.x.size() / 3];  // ties
  const HsvLoss<double> loss;
  HsvLoss<double>::Context context;
  SerialExecutor executor;
  const std::size_t area = images.x.size() / 3;
  double sum = 0;
  std::size_t members = 0;
  for (std::size_t i = 0; i < area; ++i) {
    const std::array<double, 3> c{images.x[i], images.x[i + area], images.x[i + 2 * area]};
    const double largest = std::max({c[0], c[1], c[2]}), smallest = std::min({c[0], c[1], c[2]});
    if (largest < 0.2 || (largest - smallest) / largest < 0.2) continue;
    for (const double channel : c) {
      if (channel != largest) continue;
      ++members;
      for (std::size_t k = 0; k < 3; ++k) sum += std::pow(images.x[i + k * area] - images.y[i + k * area], 2);
    }
  }
  const HsvReport report = loss.forward(images.view_x(), images.view_y(), context, executor);
  CHECK(report.loss == doctest::Approx(sum / (9 * static_cast<double>(area))).epsilon(1e-13));
  CHECK(report.pixels[0] + report.pixels[1] + report.pixels[2] == members);
}

TEST_CASE(
    "loss/hsv: gradient law for every source and norm; identical images give exact zeros; the gradient is added") {
  SerialExecutor executor;
  for (const HueSource source : {HueSource::rendered, HueSource::target, HueSource::either}) {
    for (const bool paper : {false, true}) {
      HsvImages<double> images(5, 7);
      // A difference quotient must not cross the edge of a mask: channels apart, thresholds apart.
      const std::size_t area = images.x.size() / 3;
      for (std::size_t i = 0; i < area; ++i) {
        for (std::vector<double>* v : {&images.x, &images.y}) {
          const std::size_t top = (i + (v == &images.x ? 0 : i / 3)) % 4;
          for (std::size_t c = 0; c < 3; ++c) {
            double& value = (*v)[i + c * area];
            value = c == top ? 0.9 + 0.1 * value : 0.1 + 0.3 * value;
            if (top == 3) value = 0.1 + 0.01 * value;  // dark: in no mask
          }
        }
      }
      HsvLoss<double>::Settings settings = paper ? HsvLoss<double>::Settings::paper() : HsvLoss<double>::Settings{};
      settings.source = source;
      const HsvLoss<double> loss(settings);
      HsvLoss<double>::Context context;
      loss.forward_backward(images.view_x(), images.view_y(), 0.6, images.view_d(), context, executor);
      const auto value = [&] { return 0.6 * loss.forward(images.view_x(), images.view_y(), context, executor).loss; };
      CHECK(testing::gradient_law(value, images.x, images.d, 1e-7, 1000) == std::string());
      std::vector<double> off = images.d;
      for (double& g : off) g *= 1.01;
      CHECK(testing::gradient_law(value, images.x, off, 1e-7, 1000) != std::string());
      std::vector<double> once = images.d;
      loss.forward_backward(images.view_x(), images.view_y(), 0.6, images.view_d(), context, executor);
      for (std::size_t i = 0; i < once.size(); ++i) CHECK(images.d[i] == doctest::Approx(2 * once[i]).epsilon(1e-14));
      images.d.assign(images.d.size(), 0.0);
      CHECK(loss.forward_backward(images.view_x(), images.view_x(), 0.6, images.view_d(), context, executor).loss == 0);
      CHECK(std::all_of(images.d.begin(), images.d.end(), [](double g) { return g == 0; }));
    }
  }
}

TEST_CASE("loss/hsv: a colour that left the mask is not seen by the render's mask but by the target's and by either") {
  const std::array<double, 3> grey{0.5, 0.5, 0.5}, red{0.9, 0.1, 0.1};
  SerialExecutor executor;
  HsvLoss<double>::Context context;
  for (const HueSource source : {HueSource::rendered, HueSource::target, HueSource::either}) {
    HsvLoss<double>::Settings settings;
    settings.source = source;
    const HsvReport report = HsvLoss<double>(settings).forward(
        ImageView<const double>{grey.data(), 3, 1, 1}, ImageView<const double>{red.data(), 3, 1, 1}, context, executor);
    CHECK(report.loss == doctest::Approx(source == HueSource::rendered ? 0.0 : 3 * 0.16 / 9));
  }
}

TEST_CASE(
    "loss/hsv: empty masks cost nothing (LS7); noise on black does not make red pixels in the paper's masks (LS6)") {
  const HsvLoss<float> loss(HsvLoss<float>::Settings::paper());
  HsvLoss<float>::Context context;
  SerialExecutor executor;
  HsvImages<float> images(32, 32);
  for (std::size_t i = 0; i < images.x.size(); ++i) images.x[i] = 1e-4f * images.x[i];
  HsvReport report = loss.forward_backward(images.view_x(), images.view_y(), 1.0f, images.view_d(), context, executor);
  CHECK(report.pixels == std::array<std::size_t, 3>{});
  CHECK(report.loss == 0);
  CHECK(std::all_of(images.d.begin(), images.d.end(), [](float g) { return g == 0; }));
  const double none = 0;  // the control: a mean over them
  CHECK(std::isnan(none / none));
  HsvLoss<float>::Settings literal = HsvLoss<float>::Settings::paper();
  literal.value[0] = 0;  // the control: a third of the black pixels is red
  report = HsvLoss<float>(literal).forward(images.view_x(), images.view_y(), context, executor);
  CHECK(report.pixels[0] > 200);
}

TEST_CASE("loss/hsv: same bits at any thread count, widths around the pack") {
  for (const int width : {1, 15, 16, 17, 333}) {
    HsvImages<float> first(101, width);
    const HsvLoss<float> loss(HsvLoss<float>::Settings::paper());
    HsvLoss<float>::Context context;
    SerialExecutor serial;
    const double value =
        loss.forward_backward(first.view_x(), first.view_y(), 1.0f, first.view_d(), context, serial).loss;
    HsvImages<float> other(101, width);
    ThreadExecutor threads(3);
    CHECK(loss.forward_backward(other.view_x(), other.view_y(), 1.0f, other.view_d(), context, threads).loss == value);
    CHECK(other.d == first.d);
    HsvImages<long double> exact(101, width);
    const HsvLoss<long double> reference(HsvLoss<long double>::Settings::paper());
    HsvLoss<long double>::Context reference_context;
    CHECK(value == doctest::Approx(reference.forward(exact.view_x(), exact.view_y(), reference_context, serial).loss)
                       .epsilon(1e-6));
  }
}

}  // namespace
