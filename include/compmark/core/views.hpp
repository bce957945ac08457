// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The neutral currency of kernels: non-owning views. Row-major matrices [rows, columns] and planar images [channels,
// height, width]. A view is a pointer and its shape: trivially copyable, never owning, as cheap as its members.
#pragma once

#include <cstddef>
#include <span>
#include <type_traits>

#include "compmark/core/config.hpp"

namespace compmark {

/// Row-major matrix view, rows contiguous: element (i, j) is data[i * columns + j].
template <class T>
struct MatrixView {
  T* data = nullptr;
  std::size_t rows = 0;
  std::size_t columns = 0;

  [[nodiscard]] constexpr T* row(std::size_t i) const { return data + i * columns; }
  [[nodiscard]] constexpr T& operator()(std::size_t i, std::size_t j) const { return data[i * columns + j]; }
  [[nodiscard]] constexpr std::span<T> flat() const { return {data, rows * columns}; }
  [[nodiscard]] constexpr std::size_t size() const { return rows * columns; }

  constexpr operator MatrixView<const T>() const  // NOLINT(google-explicit-constructor): a view to const is always safe
      requires(!std::is_const_v<T>) {
    return {data, rows, columns};
  }
};

/// Planar image view [channels, height, width]; colours in [0, 1] unless the user of the view says otherwise.
template <class T>
struct ImageView {
  T* data = nullptr;
  int channels = 0;
  int height = 0;
  int width = 0;

  [[nodiscard]] constexpr std::size_t plane_size() const {
    return static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
  }
  [[nodiscard]] constexpr std::size_t size() const { return plane_size() * static_cast<std::size_t>(channels); }
  [[nodiscard]] constexpr T* plane(int c) const { return data + static_cast<std::size_t>(c) * plane_size(); }
  [[nodiscard]] constexpr T* row(int c, int y) const {
    return plane(c) + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  }
  [[nodiscard]] constexpr T& operator()(int c, int y, int x) const { return row(c, y)[x]; }
  [[nodiscard]] constexpr std::span<T> flat() const { return {data, size()}; }

  constexpr operator ImageView<const T>() const  // NOLINT(google-explicit-constructor): a view to const is always safe
      requires(!std::is_const_v<T>) {
    return {data, channels, height, width};
  }
};

/// Part of a picture, in pixels.
struct PictureBox {
  int top = 0, left = 0, height = 0, width = 0;
  bool operator==(const PictureBox&) const = default;
};

}  // namespace compmark
