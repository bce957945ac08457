// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/core/views.hpp>
#include <compmark/watermark/spread/spread_residual.hpp>
#include <cstddef>
#include <numeric>
#include <vector>

#include "support/picture.hpp"

namespace spread_residual_test {
namespace {

using namespace compmark;
constexpr int side = 64;
constexpr std::size_t plane = side * side;

ImageView<const float> seen(const std::vector<float>& values) { return {values.data(), 3, side, side}; }
double product(const std::vector<float>& a, const std::vector<float>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

struct Residual {
  std::vector<float> values = std::vector<float>(3 * plane);
  double blur = 0;
  Residual(const std::vector<float>& picture, const std::vector<float>& render,
           const std::vector<float>& weight = std::vector<float>(plane, 1.0f)) {
    blur = spread_residual(seen(picture), seen(render), weight, {values.data(), 3, side, side});
  }
};

/// Brighter and darker squares of 8 pixels.
std::vector<float> pattern(float strength) {
  std::vector<float> values(3 * plane);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = ((i % side / 8 + i / side % side / 8) % 2 == 0 ? 1.0f : -1.0f) * strength;
  return values;
}

}  // namespace

TEST_CASE("watermark/spread_residual: a blur keeps sums and what is flat, and is that of its deviation") {
  std::vector<float> point(plane, 0.0f), flat(plane, 0.3f);
  point[plane / 2 + side / 2] = 1;
  detail::blur_planes(point, side, side, 2);
  detail::blur_planes(flat, side, side, 2);
  double sum = 0, square = 0;
  for (std::size_t i = 0; i < plane; ++i) {
    sum += point[i];
    const double x = static_cast<double>(i % side) - side / 2;
    square += point[i] * x * x;
    CHECK(flat[i] == doctest::Approx(0.3));
  }
  CHECK(sum == doctest::Approx(1));
  CHECK(std::sqrt(square) == doctest::Approx(2).epsilon(0.02));  // cut off at three deviations
}

TEST_CASE("watermark/spread_residual: a picture that was blurred is compared with a render as soft") {
  const std::vector<float> render = testing::textured_picture(side, 3);
  std::vector<float> marked = render;
  const std::vector<float> mark = pattern(0.004f);
  for (std::size_t i = 0; i < marked.size(); ++i) marked[i] += mark[i];
  CHECK(Residual(marked, render).blur == 0);
  detail::blur_planes(marked, side, side, 1.4);
  const Residual soft(marked, render);
  CHECK(soft.blur == 1.4);
  // Negative control: the difference to the sharp render says little of the mark, against its own size.
  std::vector<float> plain = marked;
  for (std::size_t i = 0; i < plain.size(); ++i) plain[i] -= render[i];
  const auto told = [&](const std::vector<float>& residual) {
    return product(residual, mark) / std::sqrt(product(residual, residual) * product(mark, mark));
  };
  CHECK(told(soft.values) > 3 * std::abs(told(plain)));
}

TEST_CASE("watermark/spread_residual: a camera that errs by a fraction of a pixel and another tone hide no mark") {
  const std::vector<float> render = testing::textured_picture(side, 5), mark = pattern(0.004f);
  std::vector<float> picture(3 * plane);
  for (std::size_t i = 0; i < picture.size(); ++i) {
    const std::size_t next = i % side + 1 < side ? i + 1 : i;
    picture[i] = std::pow(0.7f * render[i] + 0.3f * render[next] + mark[i], 1.1f);
  }
  const auto told = [&](const std::vector<float>& residual) {
    return product(residual, mark) / std::sqrt(product(residual, residual) * product(mark, mark));
  };
  const Residual residual(picture, render);
  // Negative control: the same without what a camera and a tone explain being taken out.
  std::vector<float> left(3 * plane), variance(3 * plane);
  for (std::size_t i = 0; i < left.size(); ++i) {
    left[i] = picture[i] - render[i];
    variance[i] = left[i] * left[i];
  }
  detail::blur_planes(variance, side, side, spread_window);
  for (std::size_t i = 0; i < left.size(); ++i) left[i] /= variance[i] + spread_least_variance;
  MESSAGE("correlation with the mark ", told(residual.values), ", without it ", told(left));
  CHECK(told(residual.values) > 2 * std::abs(told(left)));
}

TEST_CASE("watermark/spread_residual: what is no number breaks nothing") {
  const std::vector<float> render = testing::textured_picture(side, 6), none(3 * plane, NAN);
  CHECK(Residual(none, render).blur == 0);
  CHECK(Residual(render, none).blur == 0);
  CHECK(Residual(render, render, std::vector<float>(plane, NAN)).blur == 0);
}

TEST_CASE("watermark/spread_residual: what does not show the scene says nothing, and nothing is divided by zero") {
  const std::vector<float> render = testing::textured_picture(side, 4);
  std::vector<float> picture = render, weight(plane, 1.0f);
  for (std::size_t i = 0; i < plane; ++i) {
    if (i % side < 20) {
      weight[i] = 0;
      picture[i] = 1;
    }
  }
  const Residual residual(picture, render, weight);
  for (std::size_t i = 0; i < 3 * plane; ++i) {
    CHECK(std::isfinite(residual.values[i]));
    if (i % side < 20) CHECK(residual.values[i] == 0);
  }
  const Residual same(render, render);
  CHECK(product(same.values, same.values) == 0);
}

}  // namespace spread_residual_test
