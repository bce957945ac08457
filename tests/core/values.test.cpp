// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The small value types of core: views, gaussians, result, absent.
#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>

#include "compmark/core/absent.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"

using namespace compmark;

TEST_CASE("core/views: matrix rows are contiguous, images are planar") {
  std::array<int, 24> data{};
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<int>(i);
  const MatrixView<int> matrix{data.data(), 4, 6};
  CHECK(matrix(2, 3) == 15);
  CHECK(matrix.row(3) == data.data() + 18);
  const ImageView<int> image{data.data(), 2, 3, 4};
  CHECK(image(1, 2, 3) == 12 + 2 * 4 + 3);
  CHECK(image.plane_size() == 12);
  CHECK(image.size() == 24);
  const ImageView<const int> read_only = image;
  CHECK(read_only.plane(1) == data.data() + 12);
  static_assert(!std::is_convertible_v<ImageView<const int>, ImageView<int>>,
                "a view to const does not lose its const");
  static_assert(!std::is_convertible_v<MatrixView<const int>, MatrixView<int>>,
                "a view to const does not lose its const");
}

TEST_CASE("core/gaussians: columns are aligned, apart, and readable up to a multiple of 16 rows") {
  GaussianBatch<float> batch;
  batch.resize(17);
  batch.set_zero();
  const GaussianColumns<float> columns = batch.columns();
  CHECK(columns.count == 17);
  const std::array<float*, 14> all{columns.mean[0],     columns.mean[1],     columns.mean[2],     columns.scale[0],
                                   columns.scale[1],    columns.scale[2],    columns.rotation[0], columns.rotation[1],
                                   columns.rotation[2], columns.rotation[3], columns.opacity,     columns.color[0],
                                   columns.color[1],    columns.color[2]};
  for (std::size_t c = 0; c < all.size(); ++c) {
    CHECK(reinterpret_cast<std::uintptr_t>(all[c]) % 64 == 0);
    for (std::size_t i = 0; i < 32; ++i) all[c][i] = static_cast<float>(c);
  }
  for (std::size_t c = 0; c < all.size(); ++c) {
    for (std::size_t i = 0; i < 32; ++i) REQUIRE(all[c][i] == static_cast<float>(c));
  }
}

TEST_CASE("core/result: a value or an error, and the error's line names file, field, problem and remedy") {
  const Result<int> value = 3;
  CHECK(value.ok());
  CHECK(*value == 3);
  const Result<int> error = Error{ErrorKind::invalid, "a.json", "frames[2].transform", "is NaN", "remove the frame"};
  CHECK_FALSE(error);
  CHECK(error.error().line() == "a.json: frames[2].transform: is NaN; remove the frame");
  CHECK(Error{ErrorKind::not_found, "", "", "nothing", ""}.line() == "nothing");
  // What a file says of itself is quoted: it neither ends the line nor moves the cursor.
  CHECK(Error{ErrorKind::invalid, "a\nb", "c\r", "\x1b[2J is \x7f", "\xC3\xBC\t"}.line() ==
        "a?b: c?: ?[2J is ?; \xC3\xBC?");
  Result<std::string> text = std::string("moved");
  CHECK(std::move(text).value() == "moved");
}

TEST_CASE("core/absent: present() tells absent stages from the others") {
  struct NoStage : Absent<NoStage> {};
  struct Stage {};
  CHECK_FALSE(present<NoStage>);
  CHECK(present<Stage>);
}
