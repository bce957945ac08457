// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/app/run/jpeg_codec.hpp>
#include <cstddef>
#include <vector>

TEST_CASE("app/run/jpeg_codec: a picture comes back, the worse the lower the quality") {
  using namespace compmark;
  constexpr int side = 32;
  std::vector<float> pixels(3 * side * side), back(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = 0.5f + 0.4f * std::sin(0.7f * static_cast<float>(i % 97));
  const auto error = [&](int quality) {
    JpegCodec{}(ImageView<const float>{pixels.data(), 3, side, side}, quality,
                ImageView<float>{back.data(), 3, side, side});
    double sum = 0;
    for (std::size_t i = 0; i < pixels.size(); ++i) sum += std::abs(double{pixels[i]} - double{back[i]});
    return sum / static_cast<double>(pixels.size());
  };
  const double fine = error(98), coarse = error(10);
  CHECK(fine > 0);
  CHECK(fine < 0.05);
  CHECK(coarse > fine);
}
