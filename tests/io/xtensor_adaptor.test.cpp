// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/xtensor_adaptor.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <vector>

#include "compmark/core/views.hpp"

TEST_CASE("io/xtensor_adaptor: a view and its expression share elements, both ways") {
  std::vector<float> data(24);
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<float>(i);
  const compmark::ImageView<float> image{data.data(), 2, 3, 4};
  auto expression = compmark::as_xtensor(image);
  REQUIRE(expression.dimension() == 3);
  CHECK(expression.shape(0) == 2);
  CHECK(expression.shape(2) == 4);
  CHECK(expression(1, 2, 3) == image(1, 2, 3));
  expression(0, 1, 2) = -5.0f;
  CHECK(image(0, 1, 2) == -5.0f);

  const auto back = compmark::image_view(expression);
  CHECK(back.data == image.data);
  CHECK(back.channels == 2);
  CHECK(back.height == 3);
  CHECK(back.width == 4);

  auto matrix = compmark::as_xtensor(compmark::MatrixView<const float>{data.data(), 6, 4});
  CHECK(matrix(5, 3) == 23.0f);
}
