// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The binary hash grid that tells the context network where an anchor is (HAC, section 4.2; compression sheet, 1.3): every trained value
// counts as its sign, +1 or -1, interpolated linearly between the vertices of each level; straight-through gradients where |value| <= 1.
// Once an iteration the table becomes one byte an entry (four signs, four "gradient passes"), 0.44 MB instead of 7, so that the 144 corners
// of an anchor are reads of the second-level cache. The way back runs a level a task, rows in order: same bits at any thread count.
// The grid itself is coded too: bits = n1 log2(n / n1) + n0 log2(n / n0) + 32, derivative log2((1 - P) / P) / 2 by each value.
// Cost an anchor: 576 multiply-adds each way; an iteration: one read of the table, one pass over its gradients.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/entropy/hash_grid_lanes.hpp"
#include "compmark/entropy/hash_grid_layout.hpp"
#include "compmark/math/pack.hpp"

namespace compmark::inline v0 {

template <class T, HashGridShape shape = HashGridShape{}>
class HashGrid {
 public:
  static_assert(HashGridShape::features == 4, "HashGrid: four signs are half a byte");
  static constexpr std::size_t channels = static_cast<std::size_t>(shape.channels());
  static constexpr std::size_t levels = static_cast<std::size_t>(shape.levels());
  static constexpr std::size_t entries = shape.entries();

  struct Context {
    Buffer<std::uint8_t> signs;  ///< an entry: bit f is value f >= 0, bit 4 + f is |value f| <= 1
    Buffer<std::uint64_t> partial;
    double bits = 0;        ///< what coding the signs costs
    double bits_slope = 0;  ///< … and its derivative by each value
  };

  /// Signs of the table [entries, 4], and the bits they cost.
  template <Executor E>
  static void binarise(MatrixView<const T> table, Context& context, E& executor) {
    constexpr std::size_t grain = 8192;
    context.signs.resize(entries);
    context.partial.resize(chunk_count(entries, grain));
    const std::uint64_t ones = ordered_sum<std::uint64_t>(
        executor, entries, grain, context.partial.span(), [&](std::size_t begin, std::size_t end) {
          std::uint64_t count = 0;
          for (std::size_t i = begin; i < end; i += 4) {  // a level has a multiple of 8 entries
            unsigned positive = 0, passes = 0;            // 16 values each
            for (unsigned lane = 0; lane < 16; lane += W) {
              const auto value = Pack<T, W>::load(table.data + 4 * i + lane);
              positive |= (value >= Pack<T, W>(T(0))).bits() << lane;
              passes |= (abs(value) <= Pack<T, W>(T(1))).bits() << lane;
            }
            count += static_cast<std::uint64_t>(std::popcount(positive));
            const std::uint32_t bytes = spread_nibbles(positive) | spread_nibbles(passes) << 4;
            for (unsigned k = 0; k < 4; ++k) context.signs[i + k] = static_cast<std::uint8_t>(bytes >> 8 * k);
          }
          return count;
        });
    const double n = static_cast<double>(shape.bits()), n1 = static_cast<double>(ones);
    const double p = std::clamp(n1 / n, 1e-6, 1 - 1e-6);  // all alike: case CO1
    context.bits = -n1 * std::log2(p) - (n - n1) * std::log2(1 - p) + 32;
    context.bits_slope = std::log2((1 - p) / p) / 2;
  }

  /// Position in the box [2, 3] (minimum, maximum), each axis 0 … 1; an axis without extent is 0. Outside or not finite: not in [0, 1].
  static void normalise(MatrixView<const T> box, const T* position, T* unit) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const T extent = box(1, axis) - box(0, axis);
      unit[axis] = (position[axis] - box(0, axis)) / (extent > T(0) ? extent : T(1));
    }
  }

  /// out[row * stride + channel] for `count` normalised positions [count, 3].
  static void interpolate(const Context& context, const T* unit, std::size_t count, T* out, std::size_t stride) {
    std::size_t done = 0;
    if constexpr (detail::has_grid_lanes<T>) {
      for (; done + 16 <= count; done += 16) {
        interpolate_lanes(context, unit + 3 * done, out + done * stride, stride);
      }
    }
    if (done == count) return;
    for (std::size_t index = 0; index < levels; ++index) {
      const HashGridLevel& level = hash_grid_levels<shape>[index];
      dispatch(level, [&](auto dimensions, auto dense) {
        for (std::size_t row = done; row < count; ++row) {
          const Cell<dimensions> cell(level, unit + 3 * row);
          Four sum(T(0));
          if (cell.inside) {
            cell.template corners<dense>(level, [&](std::uint32_t entry, T weight) {
              sum.add_product(Four(weight), Four(plus_minus[context.signs[entry] & 15u].data()));
            });
          }
          sum.store(out + row * stride + 4 * index);
        }
      });
    }
  }

  /// Adds into d_table [entries, 4] what comes by way of the output, and the derivative of bits_weight * bits; then 0 where |value| > 1, also
  /// for what was there. d_out is level-major: d_out[(level * capacity + row) * 4 + feature]. unit [count, 3].
  template <Executor E>
  static void backward(const Context& context, const T* unit, std::size_t count, const T* d_out, std::size_t capacity,
                       double bits_weight, MatrixView<T> d_table, E& executor) {
    scatter(unit, count, d_out, capacity, d_table, executor);
    settle(context, bits_weight, d_table, executor);
  }

 private:
  static constexpr int W = native_width<T>;
  /// The output's part, as if every value passed: 144 corners an anchor are spared the look-up of which do.
  template <Executor E>
  static void scatter(const T* unit, std::size_t count, const T* d_out, std::size_t capacity, MatrixView<T> d_table,
                      E& executor) {
    executor.for_chunks(levels, 1, [&](std::size_t index, std::size_t, std::size_t) {
      const HashGridLevel& level = hash_grid_levels<shape>[index];
      dispatch(level, [&](auto dimensions, auto dense) {
        const auto add = [&](std::uint32_t entry, T weight, const Four& d) {
          T* const target = d_table.data + std::size_t{4} * entry;
          Four part = d, sum(target);
          part.scale(weight);
          sum.add_product(part, Four(T(1)));
          sum.store(target);
        };
        std::size_t done = 0;
        if constexpr (detail::has_grid_lanes<T>) {
          using Lanes = detail::GridLanes<dimensions, dense>;
          for (; done + 16 <= count; done += 16) {
            alignas(64) T soa[3 * 16], weight[Lanes::corners][16];
            by_axis(unit + 3 * done, soa);
            const Lanes lanes(level, soa, 16);
            for (int c = 0; c < Lanes::corners; ++c) lanes.weight[c].store(weight[c]);
            const unsigned inside = lanes.inside.bits();
            for (std::size_t i = 0; i < 16; ++i) {
              if ((inside >> i & 1u) == 0) continue;
              const Four d(d_out + 4 * (index * capacity + done + i));
              for (int c = 0; c < Lanes::corners; ++c) add(lanes.entry[c][i], weight[c][i], d);
            }
          }
        }
        for (std::size_t row = done; row < count; ++row) {
          const Cell<dimensions> cell(level, unit + 3 * row);
          if (!cell.inside) continue;
          const Four d(d_out + 4 * (index * capacity + row));
          cell.template corners<dense>(level, [&](std::uint32_t entry, T weight) { add(entry, weight, d); });
        }
      });
    });
  }
  /// The derivative of weight * bits, and the straight-through rule: nothing passes where |value| > 1.
  template <Executor E>
  static void settle(const Context& context, double weight, MatrixView<T> d_table, E& executor) {
    const Pack<T, W> slope(static_cast<T>(weight * context.bits_slope));
    executor.for_chunks(entries, 8192, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; i += 4) {
        std::uint32_t bytes = 0;
        for (unsigned k = 0; k < 4; ++k) bytes |= static_cast<std::uint32_t>(context.signs[i + k]) << 8 * k;
        const unsigned passes = join_nibbles(bytes >> 4);
        for (unsigned lane = 0; lane < 16; lane += W) {
          T* const target = d_table.data + 4 * i + lane;
          const auto mask = Mask<T, W>::from_bits(passes >> lane & ((1u << W) - 1u));
          keep(mask, Pack<T, W>::load(target) + slope).store(target);
        }
      }
    });
  }

  /// Nibble k to the low half of byte k.
  [[nodiscard]] static constexpr std::uint32_t spread_nibbles(std::uint32_t x) {
    x = (x | x << 8) & 0x00FF00FFu;
    return (x | x << 4) & 0x0F0F0F0Fu;
  }
  /// The inverse.
  [[nodiscard]] static constexpr std::uint32_t join_nibbles(std::uint32_t x) {
    x &= 0x0F0F0F0Fu;
    x = (x | x >> 4) & 0x00FF00FFu;
    return (x | x >> 8) & 0xFFFFu;
  }
  /// Four features, in one pack or in two narrow ones.
  struct Four {
    static constexpr int V = W < 4 ? W : 4;
    Pack<T, V> part[4 / V];
    COMPMARK_INLINE explicit Four(T value) {
      for (Pack<T, V>& p : part) p = Pack<T, V>(value);
    }
    COMPMARK_INLINE explicit Four(const T* source) {
      for (int i = 0; i < 4 / V; ++i) part[i] = Pack<T, V>::load(source + i * V);
    }
    COMPMARK_INLINE void store(T* target) const {
      for (int i = 0; i < 4 / V; ++i) part[i].store(target + i * V);
    }
    /// this += a b
    COMPMARK_INLINE void add_product(const Four& a, const Four& b) {
      for (int i = 0; i < 4 / V; ++i) part[i] = fma(a.part[i], b.part[i], part[i]);
    }
    COMPMARK_INLINE void scale(T factor) {
      for (Pack<T, V>& p : part) p = p * Pack<T, V>(factor);
    }
  };
  using Signs = std::array<std::array<T, 4>, 16>;
  alignas(64) static constexpr Signs plus_minus = [] {
    Signs values{};
    for (unsigned n = 0; n < 16; ++n) {
      for (unsigned f = 0; f < 4; ++f) values[n][f] = static_cast<T>((n >> f & 1u) != 0 ? 1 : -1);
    }
    return values;
  }();

  static void by_axis(const T* unit, T* soa) {
    for (std::size_t i = 0; i < 16; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) soa[axis * 16 + i] = unit[3 * i + axis];
    }
  }
  static void interpolate_lanes(const Context& context, const T* unit, T* out, std::size_t stride) {
    alignas(64) T soa[3 * 16], rows[4 * 16];
    by_axis(unit, soa);
    for (std::size_t index = 0; index < levels; ++index) {
      const HashGridLevel& level = hash_grid_levels<shape>[index];
      dispatch(level, [&](auto dimensions, auto dense) {
        const detail::GridLanes<dimensions, dense> lanes(level, soa, 16);
        Pack<T, 16> sum[4];
        lanes.interpolate(context.signs.data(), sum);
        lanes.transpose(sum, rows);
        for (std::size_t i = 0; i < 16; ++i) std::copy_n(rows + lanes.at(i), 4, out + i * stride + 4 * index);
      });
    }
  }

  /// Where a position lies in a level: two neighbours an axis and their weights.
  template <int dimensions>
  struct Cell {
    bool inside = true;
    std::uint32_t neighbour[3][2] = {};
    T weight[3][2] = {};

    COMPMARK_INLINE Cell(const HashGridLevel& level, const T* unit) {
      for (int d = 0; d < dimensions; ++d) {
        const T t = unit[level.axis[static_cast<std::size_t>(d)]];
        inside = inside && t >= T(0) && t <= T(1);
      }
      if (!inside) return;
      const int last = level.resolution - 2;
      for (int d = 0; d < dimensions; ++d) {
        const T t = unit[level.axis[static_cast<std::size_t>(d)]];
        const T p = fma(Pack<T, 1>(t), Pack<T, 1>(static_cast<T>(last)), Pack<T, 1>(T(0.5))).lane(0);
        const int below = static_cast<int>(p);  // p >= 0
        const T fraction = p - static_cast<T>(below);
        neighbour[d][0] = static_cast<std::uint32_t>(std::max(below, 1));
        neighbour[d][1] = static_cast<std::uint32_t>(std::min(below + 1, last));
        weight[d][0] = 1 - fraction;
        weight[d][1] = fraction;
      }
    }
    /// f(entry, weight) of the 4 or 8 corners.
    template <bool dense, class F>
    COMPMARK_INLINE void corners(const HashGridLevel& level, const F& f) const {
      const auto r = static_cast<std::uint32_t>(level.resolution);
      const std::uint32_t step1 = dense ? r : HashGridLevel::prime1, step2 = dense ? r * r : HashGridLevel::prime2;
      const auto entry = [&](std::uint32_t i0, std::uint32_t rest) {
        return level.first + (dense ? i0 + rest : (i0 ^ rest) & level.hash_mask);
      };
      for (int c2 = 0; c2 < (dimensions == 3 ? 2 : 1); ++c2) {
        const std::uint32_t h2 = dimensions == 3 ? neighbour[2][c2] * step2 : 0u;
        for (int c1 = 0; c1 < 2; ++c1) {
          const std::uint32_t h1 = neighbour[1][c1] * step1, rest = dense ? h1 + h2 : h1 ^ h2;
          const T w = dimensions == 3 ? weight[1][c1] * weight[2][c2] : weight[1][c1];
          f(entry(neighbour[0][0], rest), weight[0][0] * w);
          f(entry(neighbour[0][1], rest), weight[0][1] * w);
        }
      }
    }
  };

  /// body(dimensions, dense) with both known to the compiler.
  template <class Body>
  COMPMARK_INLINE static void dispatch(const HashGridLevel& level, const Body& body) {
    using Two = std::integral_constant<int, 2>;
    using Three = std::integral_constant<int, 3>;
    if (level.dimensions == 3) {
      if (level.dense) {
        body(Three{}, std::true_type{});
      } else {
        body(Three{}, std::false_type{});
      }
    } else if (level.dense) {
      body(Two{}, std::true_type{});
    } else {
      body(Two{}, std::false_type{});
    }
  }
};

}  // namespace compmark::inline v0
