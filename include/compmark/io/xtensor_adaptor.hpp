// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Images, renders and tables as xtensor arrays and back, without copying, and NumPy files of them: the border for
// programs whose arrays are xtensor's. Works
// with the flat headers of xtensor 0.24 and with the folders of 0.26 and later; nothing else in the library includes
// it.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <type_traits>
#include <vector>

// The headers of xtensor do not pass our warnings.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#if __has_include(<xtensor/containers/xadapt.hpp>)
#include <xtensor/containers/xadapt.hpp>
#include <xtensor/containers/xarray.hpp>
#else
#include <xtensor/xadapt.hpp>
#include <xtensor/xarray.hpp>
#endif
#pragma GCC diagnostic pop

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/npy.hpp"

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

/// An array that was read, with its shape.
[[nodiscard]] inline auto as_xtensor(const NpyArray& array) {
  return xt::adapt(array.values.data(), array.values.size(), xt::no_ownership(), array.shape);
}

namespace detail {
/// Whether the elements lie one after the other, the last index running fastest: a part of an array, or its transpose,
/// does not, and its data() would be read as other elements.
template <class Array>
[[nodiscard]] bool lies_in_rows(const Array& array) {
  std::ptrdiff_t stride = 1;
  for (std::size_t i = array.dimension(); i-- > 0;) {
    if (array.shape(i) > 1 && static_cast<std::ptrdiff_t>(array.strides()[i]) != stride) return false;
    stride *= static_cast<std::ptrdiff_t>(array.shape(i));
  }
  return true;
}
}  // namespace detail

/// An image view of a row-major xtensor array of shape [channels, height, width], without a gap: a render can be drawn
/// into it. Take xt::eval of a strided view or a transpose first.
template <class Array>
[[nodiscard]] auto image_view(Array& array) {
  COMPMARK_ASSERT(array.dimension() == 3, "image_view: the array needs three dimensions");
  COMPMARK_ASSERT(detail::lies_in_rows(array), "image_view: the elements do not lie one after the other (xt::eval)");
  return ImageView<std::remove_pointer_t<decltype(array.data())>>{array.data(), static_cast<int>(array.shape(0)),
                                                                  static_cast<int>(array.shape(1)),
                                                                  static_cast<int>(array.shape(2))};
}

/// The same of shape [rows, columns]: a table of features, for instance.
template <class Array>
[[nodiscard]] auto matrix_view(Array& array) {
  COMPMARK_ASSERT(array.dimension() == 2, "matrix_view: the array needs two dimensions");
  COMPMARK_ASSERT(detail::lies_in_rows(array), "matrix_view: the elements do not lie one after the other (xt::eval)");
  return MatrixView<std::remove_pointer_t<decltype(array.data())>>{array.data(), array.shape(0), array.shape(1)};
}

/// Writes an expression as a NumPy file, whole or not at all; what is no row-major array yet is evaluated first.
template <class Expression>
[[nodiscard]] Result<Done> write_npy(const std::filesystem::path& path, const xt::xexpression<Expression>& expression) {
  using Value = std::remove_cv_t<typename Expression::value_type>;
  const xt::xarray<Value, xt::layout_type::row_major> array = expression.derived_cast();
  const std::vector<std::size_t> shape(array.shape().begin(), array.shape().end());
  return write_npy<Value>(path, shape, std::span<const Value>(array.data(), array.size()));
}

}  // namespace compmark
