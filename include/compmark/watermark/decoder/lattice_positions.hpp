// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The values u and gates w that the lattice decoder reads at each position, and the gradient through them. With a_0 ...
// a_n the image blurred at growing sigmas, every stride-th pixel,
//   u = (log(a_0 + e) - log(a_1 + e), ..., log(a_(n-1) + e) - log(a_n + e))           contrast: octaves x 3 colours
//   u = (a_0, ..., a_n)                                                               colour: blurs x 3 colours
//   w = (1 - exp(-(m / g)^2)) (1 - exp(-((1 - m) / g)^2)),  m the mean colour of a_n  the gate
// The first blur reduces the resolution, the others work on its grid (sigmas add in squares). The gate fades out black
// and white: noise is clipped to one side there, and a plain background would dominate the mean. Positions lie region
// by region (LatticeSettings::regions), a grid of about square parts of the image, each in whole packs; a single region
// is the image's own order. Cost: 3 (6 sigma_0 + 1) / stride + small, operations a pixel; a logarithm a value.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/separable_map.hpp"

namespace compmark {

/// Contrast is a difference of logarithms: a change of brightness leaves it in place, but a surface seen from another
/// side has another contrast. Colour is the same from every side, but changes with brightness.
enum class LatticeMeasure : std::uint8_t { contrast, colour };

struct LatticeSettings {
  LatticeMeasure measure = LatticeMeasure::contrast;
  int bits = 48;
  int features = 192;
  std::vector<double> sigma{
      3, 6, 12};            ///< of the blurs, in pixels, growing; two or more for contrast, one or more for colour
  int stride = 4;           ///< pixels between positions
  double epsilon = 0.1;     ///< added before the logarithm
  double gate = 0.12;       ///< distance from black and white at which a position counts
  double floor = 0.02;      ///< share of the positions that is added to the sum of gates
  double logit_scale = 2;   ///< what a message loss multiplies the logits by
  int regions = 1;          ///< about so many parts of the image, each with the limit below
  double region_limit = 0;  ///< largest norm of a region's logits; louder ones count less; 0: no limit

  [[nodiscard]] bool limited() const { return region_limit > 0; }
  [[nodiscard]] std::size_t dimensions() const {
    return 3 * (measure == LatticeMeasure::contrast ? sigma.size() - 1 : sigma.size());
  }
  bool operator==(const LatticeSettings&) const = default;
};

/// Positions of one image and their gradients; buffers only grow.
template <class T>
struct LatticePositions {
  int height = 0, width = 0;  ///< of the image the maps are for
  int rows = 0, columns = 0;  ///< of the grid
  std::size_t count = 0;      ///< positions
  std::size_t stride = 0;     ///< of a row of u: every region in whole packs, the rest with gate 0
  /// Of places, within one region: what a thread sums at a time.
  struct Chunk {
    std::size_t begin = 0, end = 0, region = 0;
  };
  std::vector<Chunk> chunks;
  std::size_t regions = 1;
  Buffer<T> u;     ///< [dimensions, stride]
  Buffer<T> gate;  ///< [stride]
  Buffer<T> d_u;   ///< to be filled before scatter(); d_gate likewise
  Buffer<T> d_gate;

  template <Executor E>
  void read(ImageView<const T> image, const LatticeSettings& settings, E& executor) {
    prepare(image, settings);
    read_levels(image, settings, executor);
    u.resize(settings.dimensions() * stride);
    gate.resize(stride);
    std::fill_n(gate.data(), stride, T(0));
    executor.for_chunks(settings.dimensions(), 1, [&](std::size_t j, std::size_t, std::size_t) {
      const T* fine = levels_[j / 3].data() + j % 3 * count;
      T* target = u.data() + j * stride;
      std::fill_n(target, stride, T(0));
      if (settings.measure == LatticeMeasure::colour) {
        for (const Run& run : runs_) std::copy_n(fine + run.position, run.count, target + run.place);
        return;
      }
      const T* wide = levels_[j / 3 + 1].data() + j % 3 * count;
      for (const Run& run : runs_) {
        for (std::size_t i = 0; i < run.count; ++i)
          target[run.place + i] = fine[run.position + i] - wide[run.position + i];
      }
    });
    executor.for_chunks(runs_.size(), 1, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t n = begin; n < end; ++n) {
        const Run& run = runs_[n];
        for (std::size_t i = 0; i < run.count; ++i) gate[run.place + i] = gate_at(run.position + i, settings).value;
      }
    });
  }

  /// Adds the gradient through d_u and d_gate to d_image; from the widest blur to the first.
  template <Executor E>
  void scatter(ImageView<T> d_image, const LatticeSettings& settings, E& executor) {
    const std::size_t last = maps_.size() - 1;
    d_level_.resize(3 * count);
    executor.for_chunks(runs_.size(), 1, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t n = begin; n < end; ++n) {
        const Run& run = runs_[n];
        for (std::size_t i = 0; i < run.count; ++i) {
          const T share = gate_at(run.position + i, settings).slope * d_gate[run.place + i] / T(3);
          for (std::size_t c = 0; c < 3; ++c) d_level_[c * count + run.position + i] = share;
        }
      }
    });
    const T lowest = std::log(static_cast<T>(settings.epsilon));
    for (std::size_t b = last + 1; b-- > 0;) {
      executor.for_chunks(3, 1, [&](std::size_t c, std::size_t, std::size_t) {
        const T* value = levels_[b].data() + c * count;
        T* target = d_level_.data() + c * count;
        if (settings.measure == LatticeMeasure::colour) {
          const T* gradient = d_u.data() + (3 * b + c) * stride;
          for (const Run& run : runs_) {
            for (std::size_t i = 0; i < run.count; ++i) target[run.position + i] += gradient[run.place + i];
          }
          return;
        }
        const T* fine = b < last ? d_u.data() + (3 * b + c) * stride : nullptr;
        const T* wide = b > 0 ? d_u.data() + (3 * (b - 1) + c) * stride : nullptr;
        for (const Run& run : runs_) {
          for (std::size_t n = 0; n < run.count; ++n) {
            const std::size_t i = run.position + n, at = run.place + n;
            const T sum = (fine != nullptr ? fine[at] : T(0)) - (wide != nullptr ? wide[at] : T(0));
            if (value[i] > lowest) target[i] += sum * std::exp(-value[i]);
          }
        }
      });
      if (b == 0) {
        maps_[0].add_transposed(grid(d_level_), d_image, row_, executor);
        return;
      }
      d_finer_.resize(3 * count);
      std::fill_n(d_finer_.data(), 3 * count, T(0));
      maps_[b].add_transposed(grid(d_level_), grid(d_finer_), row_, executor);
      std::swap(d_level_, d_finer_);
    }
  }

 private:
  void prepare(ImageView<const T> image, const LatticeSettings& settings) {
    const int wanted = settings.limited() ? settings.regions : 1;
    if (height == image.height && width == image.width && wanted == wanted_) return;
    height = image.height;
    width = image.width;
    wanted_ = wanted;
    maps_.clear();
    maps_.push_back({RunTable<T>::gaussian(height, settings.sigma[0], settings.stride),
                     RunTable<T>::gaussian(width, settings.sigma[0], settings.stride)});
    rows = maps_[0].height();
    columns = maps_[0].width();
    for (std::size_t b = 1; b < settings.sigma.size(); ++b) {
      const double wide = settings.sigma[b], fine = settings.sigma[b - 1];
      const double more = std::sqrt(wide * wide - fine * fine) / settings.stride;
      maps_.push_back({RunTable<T>::gaussian(rows, more), RunTable<T>::gaussian(columns, more)});
    }
    count = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
    levels_.resize(maps_.size());
    place(wanted);
  }
  /// Lays out the positions and the chunks of work.
  void place(int wanted) {
    constexpr std::size_t lanes = native_width<T>,
                          grain = 512;  // 27 octave planes of 512 positions fit the first cache
    const double aspect = static_cast<double>(rows) / columns;
    const int down = std::clamp(static_cast<int>(std::lround(std::sqrt(wanted * aspect))), 1, std::min(wanted, rows));
    const int across = std::clamp(static_cast<int>(std::lround(static_cast<double>(wanted) / down)), 1, columns);
    regions = static_cast<std::size_t>(down) * static_cast<std::size_t>(across);
    runs_.clear();
    chunks.clear();
    stride = 0;
    for (int r = 0; r < down; ++r) {
      for (int q = 0; q < across; ++q) {
        const int top = r * rows / down, bottom = (r + 1) * rows / down;
        const int left = q * columns / across, right = (q + 1) * columns / across;
        const std::size_t first = stride, length = static_cast<std::size_t>(right - left);
        std::size_t at = first;
        if (across == 1) {
          // Rows of the whole width lie behind each other in the image too.
          const std::size_t begin = static_cast<std::size_t>(top) * length,
                            all = static_cast<std::size_t>(bottom - top) * length;
          for (std::size_t i = 0; i < all; i += 2 * grain)
            runs_.push_back({begin + i, at + i, std::min(2 * grain, all - i)});
          at += all;
        } else {
          for (int y = top; y < bottom; ++y, at += length)
            runs_.push_back(
                {static_cast<std::size_t>(y) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(left), at,
                 length});
        }
        stride = (at + lanes - 1) / lanes * lanes;
        for (std::size_t i = first; i < stride; i += grain)
          chunks.push_back({i, std::min(i + grain, stride), static_cast<std::size_t>(r * across + q)});
      }
    }
  }

  [[nodiscard]] ImageView<T> grid(Buffer<T>& buffer) const { return {buffer.data(), 3, rows, columns}; }

  template <class E>
  void read_levels(ImageView<const T> image, const LatticeSettings& settings, E& executor) {
    ImageView<const T> at = image;
    for (std::size_t b = 0; b < maps_.size(); ++b) {
      levels_[b].resize(3 * count);
      maps_[b].apply(at, grid(levels_[b]), row_, executor);
      at = grid(levels_[b]);
    }
    coarse_.resize(3 * count);
    std::copy_n(levels_.back().data(), 3 * count, coarse_.data());
    if (settings.measure == LatticeMeasure::colour) return;
    const T epsilon = static_cast<T>(settings.epsilon);
    for (Buffer<T>& level : levels_) {
      executor.for_chunks(3 * count, 4096, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i) level[i] = std::log(std::max(level[i], T(0)) + epsilon);
      });
    }
  }

  /// A run of positions of the image that are neighbours in memory.
  struct Run {
    std::size_t position = 0, place = 0, count = 0;
  };
  struct Gate {
    T value, slope;
  };
  [[nodiscard]] Gate gate_at(std::size_t i, const LatticeSettings& settings) const {
    const T* coarse = coarse_.data() + i;
    const T mean = (coarse[0] + coarse[count] + coarse[2 * count]) / T(3);
    const T scale = T(1) / static_cast<T>(settings.gate);
    const T low = mean * scale, high = (T(1) - mean) * scale;
    const T dark = std::exp(-low * low), bright = std::exp(-high * high);
    if ((T(1) - dark) * (T(1) - bright) == T(0)) return {T(0), T(0)};  // to rounding: nothing is read there
    return {(T(1) - dark) * (T(1) - bright),
            T(2) * scale * (low * dark * (T(1) - bright) - high * bright * (T(1) - dark))};
  }

  int wanted_ = 0;  ///< regions
  std::vector<Run> runs_;
  std::vector<SeparableMap<T>> maps_;
  std::vector<Buffer<T>> levels_;  ///< log(a_b + epsilon), or a_b for colour
  Buffer<T> coarse_;               ///< a_n
  Buffer<T> d_level_, d_finer_;
  PerWorkerRows<T> row_;
};

}  // namespace compmark
