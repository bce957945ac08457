// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/xtensor_adaptor.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <filesystem>
#include <vector>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#if __has_include(<xtensor/views/xview.hpp>)
#include <xtensor/containers/xtensor.hpp>
#include <xtensor/views/xview.hpp>
#else
#include <xtensor/xtensor.hpp>
#include <xtensor/xview.hpp>
#endif
#pragma GCC diagnostic pop

#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/raster/tile.hpp"

using namespace compmark;

TEST_CASE("io/xtensor_adaptor: a view and its expression share elements, both ways") {
  std::vector<float> data(24);
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<float>(i);
  const ImageView<float> image{data.data(), 2, 3, 4};
  auto expression = as_xtensor(image);
  REQUIRE(expression.dimension() == 3);
  CHECK(expression.shape(0) == 2);
  CHECK(expression.shape(2) == 4);
  CHECK(expression(1, 2, 3) == image(1, 2, 3));
  expression(0, 1, 2) = -5.0f;
  CHECK(image(0, 1, 2) == -5.0f);

  const auto back = image_view(expression);
  CHECK(back.data == image.data);
  CHECK(back.channels == 2);
  CHECK(back.height == 3);
  CHECK(back.width == 4);

  auto matrix = as_xtensor(MatrixView<const float>{data.data(), 6, 4});
  CHECK(matrix(5, 3) == 23.0f);
  const auto table = matrix_view(matrix);
  CHECK(table.data == data.data());
  CHECK(table.rows == 6);
  CHECK(table.columns == 4);
}

TEST_CASE("io/xtensor_adaptor: a part of an array or its transpose is not taken for the array") {
  xt::xtensor<float, 2> table = xt::zeros<float>({4, 6});
  CHECK(detail::lies_in_rows(table));
  CHECK(detail::lies_in_rows(xt::view(table, xt::range(1, 3), xt::all())));        // whole rows
  CHECK_FALSE(detail::lies_in_rows(xt::view(table, xt::all(), xt::range(1, 3))));  // columns 1 and 2
  CHECK_FALSE(detail::lies_in_rows(xt::transpose(table)));
  xt::xtensor<float, 2, xt::layout_type::column_major> columns = table;
  CHECK_FALSE(detail::lies_in_rows(columns));
}

TEST_CASE("io/xtensor_adaptor: a render is drawn into an array, to the bits of the rasterizer's own") {
  GaussianBatch<float> batch;
  batch.resize(3);
  batch.set_zero();
  const auto g = batch.columns();
  for (std::size_t i = 0; i < 3; ++i) {
    g.mean[0][i] = 0.3f * static_cast<float>(i) - 0.3f;
    g.mean[2][i] = 3;
    for (float* scale : g.scale) scale[i] = 0.2f;
    g.rotation[0][i] = 1;
    g.opacity[i] = 0.7f;
    g.color[i][i] = 1;
  }
  const Camera<float> camera{.width = 40, .height = 30, .fx = 40, .fy = 40, .cx = 20, .cy = 15};
  SerialExecutor executor;
  TileRasterizer<float>::Context context;
  std::vector<float> pixels(3 * 30 * 40);
  const ImageView<float> image{pixels.data(), 3, 30, 40};
  TileRasterizer<float>{}.forward(g, camera, {0, 0, 0}, image, context, executor);

  xt::xtensor<float, 3> array = xt::zeros<float>({3, 30, 40});
  TileRasterizer<float>{}.forward(g, camera, {0, 0, 0}, image_view(array), context, executor);
  CHECK(std::equal(pixels.begin(), pixels.end(), array.data()));
  CHECK(xt::amax(array)() > 0.5f);
}

TEST_CASE("io/xtensor_adaptor: NumPy files of expressions, and back") {
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "compmark_xtensor.npy";
  xt::xtensor<float, 3> array = xt::zeros<float>({2, 3, 4});
  for (std::size_t i = 0; i < array.size(); ++i) array.data()[i] = 0.5f * static_cast<float>(i);
  REQUIRE(write_npy(path, xt::view(array, xt::all(), 1, xt::all())));  // a part: [2, 4]
  const Result<NpyArray> read = read_npy(path);
  REQUIRE(read.ok());
  const auto back = as_xtensor(*read);
  REQUIRE(back.dimension() == 2);
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t j = 0; j < 4; ++j) CHECK(back(i, j) == static_cast<double>(array(i, 1, j)));
  std::filesystem::remove(path);
}
