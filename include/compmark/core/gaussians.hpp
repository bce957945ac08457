// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The data between the Gaussian decoder and the rasterizer, and (same shape) its gradients: 14 columns, one row a
// Gaussian.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <type_traits>

#include "compmark/core/buffer.hpp"

namespace compmark {

/// Structure of arrays; each column is 64-byte aligned and may be read and written up to the next multiple of 16 rows.
///   mean      world coordinates               scale     standard deviations along the local axes, world units, not log
///   rotation  unit quaternion (w, x, y, z)           opacity   in (0, 1]; rows with opacity <= 0 are not rendered
///   color     red, green, blue, linear in [0, 1]
template <class T>
struct GaussianColumns {
  std::array<T*, 3> mean{};
  std::array<T*, 3> scale{};
  std::array<T*, 4> rotation{};
  T* opacity = nullptr;
  std::array<T*, 3> color{};
  std::size_t count = 0;

  constexpr operator GaussianColumns<const T>()
      const  // NOLINT(google-explicit-constructor): a view to const is always safe
      requires(!std::is_const_v<T>) {
    return {{mean[0], mean[1], mean[2]},
            {scale[0], scale[1], scale[2]},
            {rotation[0], rotation[1], rotation[2], rotation[3]},
            opacity,
            {color[0], color[1], color[2]},
            count};
  }
};

/// Owner of the columns: grow-only, contents undefined after resize.
template <class T>
class GaussianBatch {
 public:
  static constexpr std::size_t column_count = 14;

  void resize(std::size_t count) {
    count_ = count;
    stride_ = (count + 15) / 16 * 16;
    storage_.resize(stride_ * column_count);
  }
  void set_zero() {
    for (T& value : storage_) value = T{};
  }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] std::span<T> storage() {
    return storage_.span();
  }  ///< all columns and their padding, to set them to zero
  [[nodiscard]] GaussianColumns<T> columns() { return make<T>(storage_.data()); }
  [[nodiscard]] GaussianColumns<const T> columns() const { return make<const T>(storage_.data()); }

 private:
  template <class U>
  [[nodiscard]] GaussianColumns<U> make(U* base) const {
    const auto at = [&](std::size_t column) { return base + column * stride_; };
    return {{at(0), at(1), at(2)},        {at(3), at(4), at(5)},
            {at(6), at(7), at(8), at(9)}, at(10),
            {at(11), at(12), at(13)},     count_};
  }
  Buffer<T> storage_;
  std::size_t count_ = 0;
  std::size_t stride_ = 0;
};

}  // namespace compmark
