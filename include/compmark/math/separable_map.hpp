// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Linear maps of images that act on rows and on columns alone: out = V x H^T a channel. Crop, antialiased resize,
// Gaussian blur, and a blur that also thins out are all of this kind, and so the gradient of each is the transposed
// map, exactly: g_x = V^T g H. A table holds, for every output place, one run of input places and its weights; what a
// filter reads beyond the border is folded back (mirrored without repeating the edge), so that a constant image stays
// constant. Cost: taps multiply-adds an output place and pass; rows first. Along a row the places of a blur or a crop that
// have the same weights are made side by side, as lanes, each with its terms in the order they have one by one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// out[i] = sum_t weight[i * taps + t] in[first[i] + t], every run inside the input.
template <class T>
struct RunTable {
  int input = 0;
  int taps = 0;
  std::vector<int> first;
  std::vector<T> weight;
  /// Outputs [alike_begin, alike_end) have the same weights, and each run begins one place after the one before.
  int alike_begin = 0, alike_end = 0;

  [[nodiscard]] int output() const { return static_cast<int>(first.size()); }

  /// A filter kernel(distance in input places), of support `radius`, around center(i); weights are made to sum to one.
  template <class Center, class Kernel>
  [[nodiscard]] static RunTable filter(int input, int output, double radius, const Center& center,
                                       const Kernel& kernel) {
    COMPMARK_ASSERT(input > 0 && output > 0, "RunTable: empty side");
    RunTable table;
    table.input = input;
    table.taps = std::min(input, 2 * static_cast<int>(std::ceil(radius)) + 1);
    table.first.reserve(static_cast<std::size_t>(output));
    table.weight.assign(static_cast<std::size_t>(output) * static_cast<std::size_t>(table.taps), T(0));
    for (int i = 0; i < output; ++i) {
      const double middle = center(i);
      const int begin = static_cast<int>(std::ceil(middle - radius));
      const int end = static_cast<int>(std::floor(middle + radius));
      const int start = std::clamp(begin, 0, input - table.taps);
      T* weights = table.weight.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(table.taps);
      double sum = 0;
      for (int k = begin; k <= end; ++k) sum += kernel(k - middle);
      for (int k = begin; k <= end; ++k) {
        const int place = std::clamp(folded(k, input) - start, 0, table.taps - 1);
        weights[place] += static_cast<T>(kernel(k - middle) / sum);
      }
      table.first.push_back(start);
    }
    table.find_alike();
    return table;
  }

  /// `count` places from `begin`.
  [[nodiscard]] static RunTable crop(int input, int begin, int count) {
    COMPMARK_ASSERT(begin >= 0 && count > 0 && begin + count <= input, "RunTable: crop outside the input");
    RunTable table;
    table.input = input;
    table.taps = 1;
    for (int i = 0; i < count; ++i) table.first.push_back(begin + i);
    table.weight.assign(static_cast<std::size_t>(count), T(1));
    table.find_alike();
    return table;
  }
  /// Bilinear with antialiasing: a triangle as wide as the coarser of the two grids.
  [[nodiscard]] static RunTable resize(int input, int output) {
    const double scale = static_cast<double>(input) / output;
    const double width = std::max(scale, 1.0);
    return filter(
        input, output, width, [scale](int i) { return (i + 0.5) * scale - 0.5; },
        [width](double d) { return std::max(0.0, 1 - std::abs(d) / width); });
  }
  /// Gaussian of `sigma` places, cut at 3 sigma, taken at every `stride`-th place (the middle of each group of
  /// `stride`).
  [[nodiscard]] static RunTable gaussian(int input, double sigma, int stride = 1) {
    const int output = std::max(1, input / stride);
    return filter(
        input, output, std::max(1.0, 3 * sigma), [stride](int i) { return i * stride + 0.5 * (stride - 1); },
        [sigma](double d) { return std::exp(-0.5 * d * d / (sigma * sigma)); });
  }

 private:
  /// The longest such range round the middle, where no border is near.
  void find_alike() {
    const auto follows = [&](int i) {  // output i is like i - 1
      const T* const own = weight.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(taps);
      return first[static_cast<std::size_t>(i)] == first[static_cast<std::size_t>(i) - 1] + 1 &&
             std::equal(own, own + taps, own - taps);
    };
    alike_begin = output() / 2;
    alike_end = alike_begin + 1;
    while (alike_end < output() && follows(alike_end)) ++alike_end;
    while (alike_begin > 0 && follows(alike_begin)) --alike_begin;
  }
  /// Mirror without repeating the edge, as often as needed.
  [[nodiscard]] static int folded(int k, int input) {
    if (input == 1) return 0;
    const int period = 2 * (input - 1);
    k = ((k % period) + period) % period;
    return k < input ? k : period - k;
  }
};

template <class T>
struct SeparableMap {
  RunTable<T> vertical;
  RunTable<T> horizontal;

  [[nodiscard]] int height() const { return vertical.output(); }
  [[nodiscard]] int width() const { return horizontal.output(); }

  /// Fills `output`, of this map's height and width. `scratch` grows to one input row a worker.
  template <Executor E>
  void apply(ImageView<const T> input, ImageView<T> output, PerWorkerRows<T>& scratch, E& executor) const {
    check(input.height, input.width, output.height, output.width);
    const std::size_t columns = static_cast<std::size_t>(input.width);
    const std::size_t rows = static_cast<std::size_t>(output.height);
    scratch.resize(executor.concurrency(), columns);
    executor.for_chunks(rows * static_cast<std::size_t>(input.channels), 16,
                        [&](std::size_t begin, std::size_t end, std::size_t worker) {
                          T* const sums = scratch.row(worker);
                          for (std::size_t r = begin; r < end; ++r)
                            apply_row(input, static_cast<int>(r / rows), static_cast<int>(r % rows), output, sums);
                        });
  }

  /// Adds the transposed map of `gradient` (this map's size) to `input_gradient`. `scratch` grows to one input row a
  /// worker.
  template <Executor E>
  void add_transposed(ImageView<const T> gradient, ImageView<T> input_gradient, PerWorkerRows<T>& scratch,
                      E& executor) const {
    check(input_gradient.height, input_gradient.width, gradient.height, gradient.width);
    const std::size_t columns = static_cast<std::size_t>(input_gradient.width);
    scratch.resize(executor.concurrency(), columns);
    const auto channels = static_cast<std::size_t>(gradient.channels);
    executor.for_chunks(channels, 1, [&](std::size_t channel, std::size_t, std::size_t worker) {
      for (int y = 0; y < gradient.height; ++y)
        scatter_row(gradient, static_cast<int>(channel), y, input_gradient, scratch.row(worker));
    });
  }

 private:
  void apply_row(ImageView<const T> input, int c, int y, ImageView<T> output, T* sums) const {
    const std::size_t columns = static_cast<std::size_t>(input.width);
    const T* weight = row_weights(vertical, y);
    std::fill_n(sums, columns, T(0));
    for (int t = 0; t < vertical.taps; ++t) {
      const T w = weight[t];
      if (w == T(0)) continue;
      const T* row = input.row(c, vertical.first[static_cast<std::size_t>(y)] + t);
      for (std::size_t x = 0; x < columns; ++x) sums[x] += w * row[x];
    }
    T* target = output.row(c, y);
    const auto one_by_one = [&](int begin, int end) {
      for (int x = begin; x < end; ++x) {
        const T* w = row_weights(horizontal, x);
        const T* source = sums + horizontal.first[static_cast<std::size_t>(x)];
        T sum(0);
        for (int t = 0; t < horizontal.taps; ++t) sum += w[t] * source[t];
        target[x] = sum;
      }
    };
    one_by_one(0, horizontal.alike_begin);
    if (const std::size_t alike = alike_count(); alike > 0) {
      T* const out = target + horizontal.alike_begin;
      const T* const source = sums + horizontal.first[static_cast<std::size_t>(horizontal.alike_begin)];
      const T* const w = row_weights(horizontal, horizontal.alike_begin);
      std::fill_n(out, alike, T(0));
      for (std::size_t t = 0; t < static_cast<std::size_t>(horizontal.taps); ++t) {
        for (std::size_t x = 0; x < alike; ++x) out[x] += w[t] * source[x + t];
      }
    }
    one_by_one(horizontal.alike_end, output.width);
  }
  void scatter_row(ImageView<const T> gradient, int c, int y, ImageView<T> input_gradient, T* sums) const {
    const std::size_t columns = static_cast<std::size_t>(input_gradient.width);
    std::fill_n(sums, columns, T(0));
    const T* source = gradient.row(c, y);
    const auto one_by_one = [&](int begin, int end) {
      for (int x = begin; x < end; ++x) {
        const T* w = row_weights(horizontal, x);
        T* target = sums + horizontal.first[static_cast<std::size_t>(x)];
        for (int t = 0; t < horizontal.taps; ++t) target[t] += w[t] * source[x];
      }
    };
    one_by_one(0, horizontal.alike_begin);
    if (const std::size_t alike = alike_count(); alike > 0) {
      const T* const slope = source + horizontal.alike_begin;
      T* const target = sums + horizontal.first[static_cast<std::size_t>(horizontal.alike_begin)];
      const T* const w = row_weights(horizontal, horizontal.alike_begin);
      // The last weight first: an input place then adds its outputs in the order of x, as one by one.
      for (std::size_t t = static_cast<std::size_t>(horizontal.taps); t-- > 0;) {
        for (std::size_t x = 0; x < alike; ++x) target[x + t] += w[t] * slope[x];
      }
    }
    one_by_one(horizontal.alike_end, gradient.width);
    const T* weight = row_weights(vertical, y);
    for (int t = 0; t < vertical.taps; ++t) {
      const T w = weight[t];
      if (w == T(0)) continue;
      T* row = input_gradient.row(c, vertical.first[static_cast<std::size_t>(y)] + t);
      for (std::size_t x = 0; x < columns; ++x) row[x] += w * sums[x];
    }
  }
  [[nodiscard]] std::size_t alike_count() const {
    return static_cast<std::size_t>(horizontal.alike_end - horizontal.alike_begin);
  }
  [[nodiscard]] static const T* row_weights(const RunTable<T>& table, int i) {
    return table.weight.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(table.taps);
  }
  void check([[maybe_unused]] int in_height, [[maybe_unused]] int in_width, [[maybe_unused]] int out_height,
             [[maybe_unused]] int out_width) const {
    COMPMARK_ASSERT(in_height == vertical.input && in_width == horizontal.input, "SeparableMap: input size");
    COMPMARK_ASSERT(out_height == height() && out_width == width(), "SeparableMap: output size");
  }
};

}  // namespace compmark
