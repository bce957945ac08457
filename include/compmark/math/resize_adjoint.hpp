// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Resizing of one plane with the triangle filter, and its adjoint: half-pixel centres, bilinear when a side grows,
// support widened by the scale when it shrinks (antialiasing), weights that leave the plane are dropped and the others
// brought to sum one (docs/spec/method.md, 7.14). Separable; the adjoint is the same pass over the transposed table, so
// that both run over their outputs and nothing is scattered. Cost: height of the input x width of the output and output
// pixels, times 2 max(1, scale) multiply-adds each.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {
namespace detail {

/// One axis: output i is the sum of weights[taps[i].weights + k] input[taps[i].first + k], k < taps[i].count.
template <class T>
struct ResizeAxis {
  struct Tap {
    int first = 0, count = 0;
    std::size_t weights = 0;
  };
  int input = 0;
  std::vector<Tap> taps;
  std::vector<T> weights;

  [[nodiscard]] static ResizeAxis triangle(int from, int to) {
    ResizeAxis axis;
    axis.input = from;
    const double scale = static_cast<double>(from) / to;
    const double support = std::max(scale, 1.0);
    std::vector<double> w;
    for (int i = 0; i < to; ++i) {
      const double center = (i + 0.5) * scale;
      const int first = std::max(0, static_cast<int>(center - support + 0.5));
      const int last = std::min(from, static_cast<int>(center + support + 0.5));
      double sum = 0;
      w.clear();
      for (int k = first; k < last; ++k) {
        w.push_back(std::max(0.0, 1 - std::abs(k - center + 0.5) / support));
        sum += w.back();
      }
      axis.taps.push_back({first, last - first, axis.weights.size()});
      for (const double value : w) axis.weights.push_back(static_cast<T>(value / sum));
    }
    return axis;
  }
  /// The outputs that an input reaches are neighbours, because the taps move on monotonically.
  [[nodiscard]] ResizeAxis transposed() const {
    ResizeAxis axis;
    axis.input = static_cast<int>(taps.size());
    const auto reaches = [&](int output, int source) {
      const Tap& tap = taps[static_cast<std::size_t>(output)];
      return source >= tap.first && source < tap.first + tap.count;
    };
    int begin = 0;
    for (int source = 0; source < input; ++source) {
      while (begin < axis.input &&
             taps[static_cast<std::size_t>(begin)].first + taps[static_cast<std::size_t>(begin)].count <= source) {
        ++begin;
      }
      int end = begin;
      const std::size_t offset = axis.weights.size();
      for (; end < axis.input && reaches(end, source); ++end) {
        const Tap& tap = taps[static_cast<std::size_t>(end)];
        axis.weights.push_back(weights[tap.weights + static_cast<std::size_t>(source - tap.first)]);
      }
      axis.taps.push_back({begin, end - begin, offset});
    }
    return axis;
  }
};

}  // namespace detail

template <class T>
class TriangleResize {
 public:
  using Scalar = T;
  struct Context {
    PerWorkerRows<T> rows;  ///< the plane after the first pass
  };

  /// Computes the tables.
  TriangleResize(int from_height, int from_width, int to_height, int to_width)
      : vertical_(detail::ResizeAxis<T>::triangle(from_height, to_height)),
        horizontal_(detail::ResizeAxis<T>::triangle(from_width, to_width)),
        vertical_back_(vertical_.transposed()),
        horizontal_back_(horizontal_.transposed()) {
    COMPMARK_ASSERT(from_height > 0 && from_width > 0 && to_height > 0 && to_width > 0,
                    "TriangleResize: an empty plane");
  }

  /// output [to_height, to_width] = R input; written, not added.
  template <Executor E>
  void apply(const T* input, T* output, Context& context, E& executor) const {
    run(vertical_, horizontal_, input, output, context, executor);
  }
  /// d_input [from_height, from_width] = R^T d_output; written, not added.
  template <Executor E>
  void apply_adjoint(const T* d_output, T* d_input, Context& context, E& executor) const {
    run(vertical_back_, horizontal_back_, d_output, d_input, context, executor);
  }

 private:
  using Axis = detail::ResizeAxis<T>;
  using P = Pack<T, native_width<T>>;

  /// Down the columns first, a pack of columns at a time; then along the rows, on the row just made and still in the
  /// cache.
  template <class E>
  static void run(const Axis& vertical, const Axis& horizontal, const T* input, T* output, Context& context,
                  E& executor) {
    const std::size_t from_width = static_cast<std::size_t>(horizontal.input), to_width = horizontal.taps.size();
    context.rows.resize(executor.concurrency(), from_width);
    executor.for_chunks(vertical.taps.size(), 16, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      T* const row = context.rows.row(worker);
      for (std::size_t y = begin; y < end; ++y) {
        const typename Axis::Tap& down = vertical.taps[y];
        for (std::size_t x = 0; x < from_width; x += P::width) {
          const auto inside = P::MaskType::first(static_cast<std::ptrdiff_t>(from_width - x));
          P sum(T(0));
          for (int k = 0; k < down.count; ++k) {
            const std::size_t source = static_cast<std::size_t>(down.first + k) * from_width + x;
            sum = fma(P(vertical.weights[down.weights + static_cast<std::size_t>(k)]), P::load(input + source, inside),
                      sum);
          }
          sum.store(row + x, inside);
        }
        T* const to = output + y * to_width;
        for (std::size_t x = 0; x < to_width; ++x) {
          const typename Axis::Tap& along = horizontal.taps[x];
          T sum(0);
          for (int k = 0; k < along.count; ++k)
            sum += horizontal.weights[along.weights + static_cast<std::size_t>(k)] * row[along.first + k];
          to[x] = sum;
        }
      }
    });
  }

  Axis vertical_, horizontal_, vertical_back_, horizontal_back_;
};

}  // namespace compmark
