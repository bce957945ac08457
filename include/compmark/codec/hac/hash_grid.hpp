// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The binary hash grid that tells the context network where an anchor is (HAC, section 4.2; docs/spec/compression.md,
// 1.1): every trained value counts as its sign, +1 or -1, interpolated linearly between the vertices of each level;
// straight-through gradients where |value| <= 1. Once an iteration the table becomes one byte an entry (four signs,
// four "gradient passes"), 0.44 MB instead of 7, so that the 144 corners of an anchor are reads of the second-level
// cache. The backward pass runs a level a task, rows in order: same bits at any thread count. The grid itself is coded
// too: bits = n1 log2(n / n1) + n0 log2(n / n0) + 32, derivative log2((1 - P) / P) / 2 by each value. Cost an anchor:
// 576 multiply-adds each way; an iteration: one read of the table, one pass over its gradients.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "compmark/codec/hac/hash_grid_cell.hpp"
#include "compmark/codec/hac/hash_grid_lanes.hpp"
#include "compmark/codec/hac/hash_grid_layout.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

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

  /// Position in the box [2, 3] (minimum, maximum), each axis 0 … 1; an axis without extent is 0. Outside or not
  /// finite: not in [0, 1].
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
      for (; done + 16 <= count; done += std::min(count - done, panel) / 16 * 16) {
        interpolate_lanes(context, unit + 3 * done, std::min(count - done, panel) / 16, out + done * stride, stride);
      }
    }
    if (done == count) return;
    for (std::size_t index = 0; index < levels; ++index) {
      const HashGridLevel& level = hash_grid_levels<shape>[index];
      dispatch(level, [&](auto dimensions, auto dense) {
        for (std::size_t row = done; row < count; ++row) {
          const detail::GridCell<T, dimensions> cell(level, unit + 3 * row);
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

  /// Adds into d_table [entries, 4] what comes by way of the output, and the derivative of bits_weight * bits; then 0
  /// where |value| > 1, also for what was there. d_out is level-major: d_out[(level * capacity + row) * 4 + feature].
  /// unit [count, 3].
  template <Executor E>
  static void backward(const Context& context, const T* unit, std::size_t count, const T* d_out, std::size_t capacity,
                       double bits_weight, MatrixView<T> d_table, E& executor) {
    scatter(unit, count, d_out, capacity, d_table, executor);
    settle(context, bits_weight, d_table, executor);
  }

 private:
  static constexpr int W = native_width<T>;
  static constexpr std::size_t panel = 64;  ///< positions that a level is kept for
  /// The output's part of the gradient, without the straight-through rule: that saves a look-up for each of 144
  /// corners.
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
          sum.add_product(part, Four(T(1)));  // product and sum are rounded apart, whatever a compiler contracts
          sum.store(target);
        };
        std::size_t done = 0;
        if constexpr (detail::has_grid_lanes<T>) {
          using Lanes = detail::GridLanes<dimensions, dense>;
          using Block = detail::GridBlock<Lanes::corners>;
          Block blocks[2];  // the next is written while one is read: a read would wait for a write of just before
          const auto prepare = [&](std::size_t begin, Block& block) {
            alignas(64) T soa[3 * 16];
            detail::by_axis(unit + 3 * begin, soa);
            Lanes(level, soa, 16).store(block);
          };
          if (count >= 16) prepare(0, blocks[0]);
          for (; done + 16 <= count; done += 16) {
            const Block& block = blocks[done / 16 % 2];
            if (done + 32 <= count) prepare(done + 16, blocks[(done / 16 + 1) % 2]);
            for (std::size_t i = 0; i < 16; ++i) {
              if ((block.inside >> i & 1u) == 0) continue;
              const Four d(d_out + 4 * (index * capacity + done + i));
              for (int c = 0; c < Lanes::corners; ++c) add(block.entry[c][i], block.weight[c][i], d);
            }
          }
        }
        for (std::size_t row = done; row < count; ++row) {
          const detail::GridCell<T, dimensions> cell(level, unit + 3 * row);
          if (!cell.inside) continue;
          const Four d(d_out + 4 * (index * capacity + row));
          cell.template corners<dense>(level, [&](std::uint32_t entry, T weight) { add(entry, weight, d); });
        }
      });
    });
  }
  /// Adds the derivative of weight * bits and applies the straight-through rule: no gradient passes where |value| > 1.
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

  /// `blocks` times sixteen positions, a level after the other: the level's signs, 8 or 32 KB, come to the first-level
  /// cache once for all.
  static void interpolate_lanes(const Context& context, const T* unit, std::size_t blocks, T* out, std::size_t stride) {
    alignas(64) T soa[3 * panel], rows[4 * 16];
    for (std::size_t block = 0; block < blocks; ++block) detail::by_axis(unit + 48 * block, soa + 48 * block);
    for (std::size_t index = 0; index < levels; ++index) {
      const HashGridLevel& level = hash_grid_levels<shape>[index];
      dispatch(level, [&](auto dimensions, auto dense) {
        for (std::size_t block = 0; block < blocks; ++block) {
          const detail::GridLanes<dimensions, dense> lanes(level, soa + 48 * block, 16);
          Pack<T, 16> sum[4];
          lanes.interpolate(context.signs.data(), sum);
          lanes.transpose(sum, rows);
          T* const to = out + 16 * block * stride + 4 * index;
          for (std::size_t i = 0; i < 16; ++i) std::copy_n(rows + lanes.at(i), 4, to + i * stride);
        }
      });
    }
  }

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

}  // namespace compmark
