// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/metric/psnr.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

namespace {

using namespace compmark;

struct FlatImage {
  std::vector<float> values;
  int height, width;
  FlatImage(int h, int w, float value)
      : values(3 * static_cast<std::size_t>(h) * static_cast<std::size_t>(w), value),
        height(h),
        width(w) {}
  [[nodiscard]] ImageView<const float> view() const { return {values.data(), 3, height, width}; }
};

TEST_CASE("metric/psnr: a constant difference of 0.01 is 40 dB at any size (ME1), where a float sum is decibels off") {
  for (const int size : {1, 7, 64, 800, 2400}) {
    const FlatImage a(size, size, 0.01f);
    const FlatImage b(size, size, 0.0f);
    CHECK(psnr(a.view(), b.view()) == doctest::Approx(40).epsilon(1e-6 / 40));
  }
  // Negative control: the same mean accumulated in float over 17 million samples sticks.
  float sum = 0;
  for (int i = 0; i < 3 * 2400 * 2400; ++i) sum += 0.01f * 0.01f;
  CHECK(std::abs(-10 * std::log10(static_cast<double>(sum) / (3.0 * 2400 * 2400)) - 40) > 0.05);
}

TEST_CASE("metric/psnr: identical images report the stated finite value, NaN stays NaN") {
  const FlatImage a(5, 7, 0.3f);
  CHECK(psnr(a.view(), a.view()) == psnr_of_identical_images);
  CHECK(psnr_from_mse(1e-30) == psnr_of_identical_images);
  CHECK(std::isnan(psnr_from_mse(std::nan(""))));
  CHECK(psnr_from_mse(1) == 0);
}

TEST_CASE("metric/psnr: the mean of views at 20 and 40 dB is 30, not the PSNR of the mean error (ME2)") {
  const double first = psnr_from_mse(1e-2);
  const double second = psnr_from_mse(1e-4);
  CHECK((first + second) / 2 == doctest::Approx(30));
  CHECK(psnr_from_mse((1e-2 + 1e-4) / 2) == doctest::Approx(22.968).epsilon(1e-4));  // the other convention
}

}  // namespace
