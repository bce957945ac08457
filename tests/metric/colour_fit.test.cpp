// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/metric/colour_fit.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

struct FittedImage {
  std::vector<float> data;
  int height, width;
  FittedImage(int h, int w) : data(static_cast<std::size_t>(3 * h * w)), height(h), width(w) {}
  [[nodiscard]] ImageView<const float> view() const { return {data.data(), 3, height, width}; }
  [[nodiscard]] std::size_t plane() const { return data.size() / 3; }
};

FittedImage random_image(std::uint64_t seed, double low, double high) {
  FittedImage image(20, 30);
  const Random random(seed, 0, random_stage("colour fit"));
  for (std::size_t i = 0; i < image.data.size(); ++i)
    image.data[i] = static_cast<float>(low + (high - low) * random.uniform(i));
  return image;
}
FittedImage mapped(const FittedImage& image, const ColourMap& map) {
  FittedImage out(image.height, image.width);
  const std::size_t n = image.plane();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t r = 0; r < 3; ++r) {
      double v = map.offset[r];
      for (std::size_t c = 0; c < 3; ++c) v += map.matrix[3 * r + c] * static_cast<double>(image.data[c * n + i]);
      out.data[r * n + i] = static_cast<float>(v);
    }
  }
  return out;
}
const ColourMap tint{{1.2, 0.05, -0.1, 0, 0.8, 0.02, 0.1, 0, 0.9}, {0.03, -0.02, 0.05}};

TEST_CASE("metric/colour_fit: a planted map is found, and pixels that do not count have no say") {
  const FittedImage image = random_image(1, 0.1, 0.7), target = mapped(image, tint);
  const ColourMap found = fit_colours(image.view(), target.view());
  // The ridge is 1.28e-6 of a variance of 0.03.
  for (std::size_t i = 0; i < 9; ++i) CHECK(std::abs(found.matrix[i] - tint.matrix[i]) < 1e-4);
  for (std::size_t i = 0; i < 3; ++i) CHECK(std::abs(found.offset[i] - tint.offset[i]) < 1e-4);
  CHECK(psnr_colour_fitted(image.view(), target.view()) > 80);
  CHECK(psnr(image.view(), target.view()) < 25);
  FittedImage spoilt = target;
  std::vector<float> weight(image.plane(), 1.0f);
  for (std::size_t i = 0; i < image.plane(); i += 3) {
    weight[i] = 0.25f;
    for (std::size_t c = 0; c < 3; ++c) spoilt.data[c * image.plane() + i] = c == 0 ? 1.0f : 0.0f;
  }
  CHECK(psnr_colour_fitted(image.view(), spoilt.view(), weight) > 80);
  CHECK(psnr_colour_fitted(image.view(), spoilt.view()) < 25);
  weight.assign(weight.size(), 0.0f);
  CHECK(std::isnan(psnr_colour_fitted(image.view(), spoilt.view(), weight)));
}

TEST_CASE("metric/colour_fit: no map near the best one is better, and the best is never worse than none") {
  const FittedImage image = random_image(2, 0, 1), target = random_image(3, 0.2, 0.8);
  const ColourMap best = fit_colours(image.view(), target.view());
  const auto error = [&](const ColourMap& map) { return mean_squared_error(mapped(image, map).view(), target.view()); };
  const double least = error(best);
  CHECK(least < error({}));
  for (std::size_t i = 0; i < 12; ++i) {
    for (const double step : {-1e-2, 1e-2}) {
      ColourMap other = best;
      (i < 9 ? other.matrix[i] : other.offset[i - 9]) += step;
      CHECK(error(other) > least);
    }
  }
}

TEST_CASE(
    "metric/colour_fit: images of one colour and of grey alone, where the plain normal equations have no solution") {
  FittedImage flat(20, 30), target(20, 30);
  for (std::size_t i = 0; i < flat.data.size(); ++i) {
    flat.data[i] = 0.4f;
    target.data[i] = 0.5f;
  }
  CHECK(psnr_colour_fitted(flat.view(), target.view()) > 80);
  // Control: the uncentred normal equations of [colour 1], in double.
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  const Eigen::Vector4d row(0.4f, 0.4f, 0.4f, 1);
  for (std::size_t i = 0; i < flat.plane(); ++i) normal += row * row.transpose();
  CHECK(std::abs(normal.determinant()) < 1e-6);
  FittedImage grey = random_image(4, 0, 1);
  for (std::size_t i = 0; i < grey.plane(); ++i) {
    for (std::size_t c = 1; c < 3; ++c) grey.data[c * grey.plane() + i] = grey.data[i];
  }
  FittedImage brighter = grey;
  for (float& v : brighter.data) v = 0.1f + 0.8f * v;
  CHECK(psnr_colour_fitted(grey.view(), brighter.view()) > 80);
  const ColourMap map = fit_colours(grey.view(), brighter.view());
  for (const double m : map.matrix) CHECK(std::abs(m) < 1.0001);  // no huge entries that cancel
}

}  // namespace
