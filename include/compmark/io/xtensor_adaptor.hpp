// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Our views as xtensor expressions and back, without copying: the shim for programs whose arrays are xtensor's. Works
// with the flat headers of xtensor 0.24 and with the folders of 0.26 and later; nothing else in the library includes
// it.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

// The headers of xtensor do not pass our warnings.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#if __has_include(<xtensor/containers/xadapt.hpp>)
#include <xtensor/containers/xadapt.hpp>
#else
#include <xtensor/xadapt.hpp>
#endif
#pragma GCC diagnostic pop

#include "compmark/core/views.hpp"

namespace compmark {

/// The elements of a view as an xtensor expression of shape [channels, height, width]; the view's memory must outlive
/// it.
template <class T>
[[nodiscard]] auto as_xtensor(ImageView<T> image) {
  const std::array<std::size_t, 3> shape{static_cast<std::size_t>(image.channels),
                                         static_cast<std::size_t>(image.height), static_cast<std::size_t>(image.width)};
  return xt::adapt(image.data, image.size(), xt::no_ownership(), shape);
}

/// Shape [rows, columns].
template <class T>
[[nodiscard]] auto as_xtensor(MatrixView<T> matrix) {
  const std::array<std::size_t, 2> shape{matrix.rows, matrix.columns};
  return xt::adapt(matrix.data, matrix.size(), xt::no_ownership(), shape);
}

/// An image view of a contiguous row-major xtensor container of shape [channels, height, width].
template <class Array>
[[nodiscard]] auto image_view(Array& array) {
  COMPMARK_ASSERT(array.dimension() == 3, "image_view: the array needs three dimensions");
  return ImageView<std::remove_pointer_t<decltype(array.data())>>{array.data(), static_cast<int>(array.shape(0)),
                                                                  static_cast<int>(array.shape(1)),
                                                                  static_cast<int>(array.shape(2))};
}

}  // namespace compmark
