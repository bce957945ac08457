// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Shrinking an image by area: an output pixel is the mean of the box of input pixels that it covers, border pixels by
// the covered fraction. The two axes are independent and linear; a constant stays a constant (weights of an output sum
// to 1), and no input pixel is skipped, whatever the ratio (a bilinear sample of two pixels aliases below half size).
// Cost: one multiply-add a pixel and axis.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// Which input values an output value covers along one axis, and with what weight.
template <class T>
class AreaAxis {
 public:
  /// `from` values become `to` <= from. Computed once a pair of sizes.
  void prepare(int from, int to) {
    COMPMARK_ASSERT(to >= 1 && to <= from, "AreaAxis: shrinks only");
    if (from == from_ && to == to_) return;
    from_ = from;
    to_ = to;
    first_.resize(static_cast<std::size_t>(to) + 1);
    weight_.resize(static_cast<std::size_t>(from) + static_cast<std::size_t>(to));
    std::int32_t at = 0;
    for (std::int64_t i = 0; i < to; ++i) {
      // In units of 1 / to of an input pixel the box is [i from, (i + 1) from) and pixel k is [k to, (k + 1) to):
      // integers, no rounding.
      const std::int64_t begin = i * from, end = begin + from;
      first_[static_cast<std::size_t>(i)] = at;
      for (std::int64_t k = begin / to; k * to < end; ++k) {
        const std::int64_t covered = std::min(end, (k + 1) * to) - std::max(begin, k * to);
        weight_[static_cast<std::size_t>(at++)] = static_cast<T>(static_cast<double>(covered) / from);
      }
    }
    first_[static_cast<std::size_t>(to)] = at;
  }
  [[nodiscard]] int from() const { return from_; }
  [[nodiscard]] int to() const { return to_; }
  /// The first input value of output i.
  [[nodiscard]] int begin(int i) const { return static_cast<int>(static_cast<std::int64_t>(i) * from_ / to_); }
  [[nodiscard]] int count(int i) const {
    return first_[static_cast<std::size_t>(i) + 1] - first_[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] const T* weights(int i) const { return weight_.data() + first_[static_cast<std::size_t>(i)]; }

 private:
  int from_ = 0;
  int to_ = 0;
  Buffer<std::int32_t> first_;
  Buffer<T> weight_;
};

/// The two axes and the half-shrunk image.
template <class T>
struct AreaResize {
  AreaAxis<T> rows;
  AreaAxis<T> columns;
  Buffer<T> narrow;  ///< [channels, height of the input, width of the output]

  void prepare(int channels, int height, int width, int to_height, int to_width) {
    rows.prepare(height, to_height);
    columns.prepare(width, to_width);
    narrow.resize(static_cast<std::size_t>(channels) * static_cast<std::size_t>(height) *
                  static_cast<std::size_t>(to_width));
  }

  /// Fills `target`.
  template <Executor E>
  void forward(ImageView<const T> image, ImageView<T> target, E& executor) {
    prepare(image.channels, image.height, image.width, target.height, target.width);
    const ImageView<T> middle{narrow.data(), image.channels, image.height, target.width};
    for_rows(middle, executor, [&](int c, int y) {
      const T* const source = image.row(c, y);
      T* const row = middle.row(c, y);
      for (int x = 0; x < middle.width; ++x) {
        const T* const weight = columns.weights(x);
        T sum = 0;
        for (int k = 0; k < columns.count(x); ++k) sum += weight[k] * source[columns.begin(x) + k];
        row[x] = sum;
      }
    });
    for_rows(target, executor, [&](int c, int y) {
      T* const row = target.row(c, y);
      std::fill_n(row, target.width, T(0));
      for (int k = 0; k < rows.count(y); ++k) {
        const T* const source = middle.row(c, rows.begin(y) + k);
        const T weight = rows.weights(y)[k];
        for (int x = 0; x < target.width; ++x) row[x] += weight * source[x];
      }
    });
  }

  /// ADDS the adjoint. A plane of one channel is one chunk: neighbouring outputs share input pixels.
  template <Executor E>
  void adjoint(ImageView<const T> d_target, ImageView<T> d_image, E& executor) {
    prepare(d_image.channels, d_image.height, d_image.width, d_target.height, d_target.width);
    const ImageView<T> middle{narrow.data(), d_image.channels, d_image.height, d_target.width};
    executor.for_chunks(static_cast<std::size_t>(d_image.channels), 1,
                        [&](std::size_t channel, std::size_t, std::size_t) {
                          const int c = static_cast<int>(channel);
                          std::fill_n(middle.plane(c), middle.plane_size(), T(0));
                          for (int y = 0; y < d_target.height; ++y) {
                            const T* const source = d_target.row(c, y);
                            for (int k = 0; k < rows.count(y); ++k) {
                              T* const row = middle.row(c, rows.begin(y) + k);
                              const T weight = rows.weights(y)[k];
                              for (int x = 0; x < middle.width; ++x) row[x] += weight * source[x];
                            }
                          }
                          for (int y = 0; y < d_image.height; ++y) {
                            const T* const source = middle.row(c, y);
                            T* const row = d_image.row(c, y);
                            for (int x = 0; x < middle.width; ++x) {
                              const T* const weight = columns.weights(x);
                              for (int k = 0; k < columns.count(x); ++k)
                                row[columns.begin(x) + k] += weight[k] * source[x];
                            }
                          }
                        });
  }

 private:
  template <class E, class Work>
  static void for_rows(ImageView<T> view, E& executor, const Work& work) {
    const std::size_t count = static_cast<std::size_t>(view.channels) * static_cast<std::size_t>(view.height);
    executor.for_chunks(count, 16, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t r = begin; r < end; ++r)
        work(static_cast<int>(r) / view.height, static_cast<int>(r) % view.height);
    });
  }
};

}  // namespace compmark
