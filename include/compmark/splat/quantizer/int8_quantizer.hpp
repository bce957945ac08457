// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Quantizer to 8 bits, scales from the least and greatest value, zero among them: lo = min(0, min x), hi = max(0, max
// x); one scale a tensor, a row or a column. It is the "general quantization" of the paper's robustness test
// (docs/spec/watermark.md, 4; docs/spec/method.md, 6, T8), with the rules of the usual observer:
//   affine     s = max((hi - lo) / 255, least),  z = clamp(-128 - round(lo / s), -128, 127)
//   symmetric  s = max(max(-lo, hi) / 127.5, least),  z = 0
//   k = clamp(round(x / s) + z, -128, 127),  x^ = (k - z) s    round to even; the inverse is exact but for one rounding
// For every x of the tensor |x^ - x| <= s / 2 (1 + 2^-13). A tensor of zeros has the least scale, not 0, and one of a
// constant c comes back as c to 255 eps (0 / 0 otherwise). hi - lo above the largest number is divided first; x^ above
// it is held there; what is not finite is refused. Gradients pass straight through. Cost: two reads (extremes,
// rounding), one division, one write.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <span>
#include <string>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/quantizer/uniform_quantizer.hpp"

namespace compmark {

enum class Int8Scheme : std::uint8_t { affine, symmetric };
/// What shares a scale.
enum class Int8Channels : std::uint8_t { tensor, rows, columns };

template <class T>
class Int8Quantizer {
 public:
  static constexpr bool is_absent = false;
  using Scalar = T;
  struct Settings {
    Int8Scheme scheme = Int8Scheme::affine;
    Int8Channels channels = Int8Channels::tensor;
    double least_scale = 0x1p-23;  ///< a normal number of T; the usual observer's, below which values become zero
  };
  /// One channel's: x^ = (k - zero_point) scale.
  struct Scale {
    T scale = 1;
    T zero_point = 0;  ///< an integer in [-128, 127]
  };
  /// Scales that fit() has found, one a channel, and what the kernels need of them.
  struct Context {
    Buffer<Scale> scales;
    Buffer<T> pattern_scale, pattern_zero;  ///< of columns: `native_width` rows of scales, whole packs
    Buffer<T> low, high;
  };

  Int8Quantizer() = default;
  [[nodiscard]] static Result<Int8Quantizer> create(const Settings& settings) {
    if (!(settings.least_scale >= static_cast<double>(std::numeric_limits<T>::min()) && settings.least_scale <= 1)) {
      return Error{ErrorKind::invalid,
                   {},
                   "least_scale",
                   std::to_string(settings.least_scale) + " is not in (0, 1]",
                   "leave it at 2^-23"};
    }
    Int8Quantizer quantizer;
    quantizer.settings_ = settings;
    return quantizer;
  }
  [[nodiscard]] const Settings& settings() const { return settings_; }

  /// Scale of a channel with these extremes, which enclose zero.
  [[nodiscard]] Scale scale_of(T low, T high) const {
    const T least = static_cast<T>(settings_.least_scale);
    if (settings_.scheme == Int8Scheme::symmetric) return {std::max(std::max(-low, high) / T(127.5), least), T(0)};
    const T range = high - low;
    const T scale = std::max(range <= greatest ? range / 255 : high / 255 - low / 255, least);
    return {scale, std::clamp(-128 - std::nearbyint(low / scale), T(-128), T(127))};
  }
  /// The integer that is stored.
  [[nodiscard]] static T symbol(T x, Scale s) {
    return symbols(Pack<T, 1>(x), Pack<T, 1>(s.scale), Pack<T, 1>(s.zero_point)).lane(0);
  }
  /// The value that comes back.
  [[nodiscard]] static T value(T x, Scale s) {
    return values(Pack<T, 1>(symbol(x, s)), Pack<T, 1>(s.scale), Pack<T, 1>(s.zero_point)).lane(0);
  }
  /// (x^ - x) / s.
  [[nodiscard]] static T error(T x, Scale s) { return (value(x, s) - x) / s.scale; }

  /// As the Quantizer of a recipe: 8 bits, symmetric, whatever a network says. A distortion layer gives the extremes of
  /// a channel of the anchors that a view decodes, and takes this for the base step; beyond 127 steps values are held.
  [[nodiscard]] static T base_step(T low, T high) { return std::max(std::max(-low, high) / T(127.5), T(0x1p-23)); }
  [[nodiscard]] static T step(T /*r*/, T q0, T least) { return std::max(q0, least); }
  [[nodiscard]] static T step_slope(T /*r*/, T /*q0*/, T /*least*/) { return T(0); }
  [[nodiscard]] static T step_log_slope(T /*r*/) { return T(0); }
  [[nodiscard]] static T symbol(T x, T q) { return std::clamp(std::nearbyint(x / q), T(-127), T(127)); }
  [[nodiscard]] static T value(T x, T q) { return q * symbol(x, q); }
  [[nodiscard]] static T error(T x, T q) { return symbol(x, q) - x / q; }

  /// Finds the scales of a tensor. Refuses what is not finite; the context then holds nothing of use.
  [[nodiscard]] Result<Done> fit(MatrixView<const T> x, Context& context) const {
    const bool columns = settings_.channels == Int8Channels::columns;
    const std::size_t channels = columns ? x.columns : settings_.channels == Int8Channels::rows ? x.rows : 1;
    context.scales.resize(channels);
    bool finite = true;
    if (!columns) {
      const std::size_t length = x.size() / std::max<std::size_t>(1, channels);
      for (std::size_t c = 0; c < channels; ++c) {
        P low(T{}), high(T{});
        const T* const from = x.data + c * length;
        each_pack(length, [&](std::size_t i, bool whole, auto lanes) {
          finite &= widen(whole ? P::load(from + i) : P::load(from + i, lanes), low, high);
        });
        context.scales[c] = scale_of(least_lane(low), -least_lane(-high));
      }
    } else {
      const std::size_t period = x.columns * W;
      context.low.resize(period, T{});
      context.high.resize(period, T{});
      for (std::size_t base = 0; base < x.size(); base += period) {
        each_pack(std::min(period, x.size() - base), [&](std::size_t i, bool whole, auto lanes) {
          P low = P::load(context.low.data() + i), high = P::load(context.high.data() + i);
          finite &= widen(whole ? P::load(x.data + base + i) : P::load(x.data + base + i, lanes), low, high);
          low.store(context.low.data() + i);
          high.store(context.high.data() + i);
        });
      }
      context.pattern_scale.resize(period);
      context.pattern_zero.resize(period);
      for (std::size_t c = 0; c < x.columns; ++c) {
        T low{}, high{};
        for (std::size_t i = c; i < period; i += x.columns) {
          low = std::min(low, context.low[i]);
          high = std::max(high, context.high[i]);
        }
        const Scale scale = context.scales[c] = scale_of(low, high);
        for (std::size_t i = c; i < period; i += x.columns) {
          context.pattern_scale[i] = scale.scale;
          context.pattern_zero[i] = scale.zero_point;
        }
      }
    }
    return finite ? Result<Done>(Done{}) : not_finite(x);
  }

  /// out = x^; it may be x.
  [[nodiscard]] Result<Done> forward(MatrixView<const T> x, MatrixView<T> out, Context& context) const {
    COMPMARK_ASSERT(x.rows == out.rows && x.columns == out.columns, "Int8Quantizer: a tensor of the same shape");
    if (Result<Done> fitted = fit(x, context); !fitted) return fitted;
    each(x.rows, x.columns, context, [&](std::size_t i, bool whole, auto lanes, P scale, P zero) {
      const P in = whole ? P::load(x.data + i) : P::load(x.data + i, lanes);
      const P back = values(symbols(in, scale, zero), scale, zero);
      whole ? back.store(out.data + i) : back.store(out.data + i, lanes);
    });
    return Done{};
  }
  /// d_x += d_out.
  static void backward(std::span<const T> d_out, std::span<T> d_x) { detail::pass_straight_through(d_out, d_x); }

  /// The tensor that fit() has seen, as integers.
  void encode(MatrixView<const T> x, const Context& context, std::span<std::int8_t> symbol) const {
    COMPMARK_ASSERT(x.size() == symbol.size(), "Int8Quantizer: one symbol a value");
    alignas(64) T block[1024];  // compilers make vectors of a plain loop over this, not of one over a pack
    std::size_t begin = 0, filled = 0;
    const auto flush = [&] {
      for (std::size_t j = 0; j < filled; ++j)
        symbol[begin + j] = static_cast<std::int8_t>(static_cast<std::int32_t>(block[j]));
      begin += filled;
      filled = 0;
    };
    each(x.rows, x.columns, context, [&](std::size_t i, bool whole, auto lanes, P scale, P zero) {
      symbols(whole ? P::load(x.data + i) : P::load(x.data + i, lanes), scale, zero).store(block + filled);
      filled += whole ? W : static_cast<std::size_t>(count(lanes));
      if (filled + W > std::size(block)) flush();
    });
    flush();
  }
  /// What forward gave, from the integers and the scales alone.
  void decode(std::span<const std::int8_t> symbol, const Context& context, MatrixView<T> x) const {
    COMPMARK_ASSERT(x.size() == symbol.size(), "Int8Quantizer: one symbol a value");
    alignas(64) T block[1024] = {};
    std::size_t begin = 0, filled = 0;
    each(x.rows, x.columns, context, [&](std::size_t i, bool whole, auto lanes, P scale, P zero) {
      if (i + W > begin + filled) {
        begin = i;
        filled = std::min(std::size(block), symbol.size() - i);
        for (std::size_t j = 0; j < filled; ++j) block[j] = static_cast<T>(symbol[begin + j]);
      }
      const P back = values(P::load(block + (i - begin)), scale, zero);
      whole ? back.store(x.data + i) : back.store(x.data + i, lanes);
    });
  }

 private:
  using P = Pack<T>;
  static constexpr std::size_t W = native_width<T>;
  static constexpr T greatest = std::numeric_limits<T>::max();

  template <int N>
  [[nodiscard]] static Pack<T, N> symbols(Pack<T, N> x, Pack<T, N> scale, Pack<T, N> zero) {
    using Q = Pack<T, N>;
    return max(min(round_to_even(x / scale) + zero, Q(T(127))), Q(T(-128)));
  }
  template <int N>
  [[nodiscard]] static Pack<T, N> values(Pack<T, N> k, Pack<T, N> scale, Pack<T, N> zero) {
    const Pack<T, N> most(greatest);
    return max(min((k - zero) * scale, most), -most);
  }

  /// False where a lane is not finite.
  [[nodiscard]] static bool widen(P x, P& low, P& high) {
    low = min(x, low);
    high = max(x, high);
    return all(abs(x) <= P(greatest));
  }
  [[nodiscard]] static T least_lane(P x) {
    alignas(64) T lane[W];
    x.store(lane);
    for (std::size_t half = W / 2; half > 0; half /= 2) {
      for (std::size_t l = 0; l < half; ++l) lane[l] = std::min(lane[l], lane[l + half]);
    }
    return lane[0];
  }

  template <class Body>
  static void each_pack(std::size_t length, const Body& body) {
    std::size_t i = 0;
    for (; i + W <= length; i += W) body(i, true, P::MaskType::first(W));
    if (i < length) body(i, false, P::MaskType::first(static_cast<std::ptrdiff_t>(length - i)));
  }
  /// body(first element, whole pack?, lanes, scales, zero points) for all packs of a tensor.
  template <class Body>
  void each(std::size_t rows, std::size_t columns, const Context& context, const Body& body) const {
    const std::size_t size = rows * columns;
    if (settings_.channels == Int8Channels::columns) {
      const std::size_t period = columns * W;
      for (std::size_t base = 0; base < size; base += period) {
        each_pack(std::min(period, size - base), [&](std::size_t i, bool whole, auto lanes) {
          body(base + i, whole, lanes, P::load(context.pattern_scale.data() + i),
               P::load(context.pattern_zero.data() + i));
        });
      }
      return;
    }
    const std::size_t channels = settings_.channels == Int8Channels::rows ? rows : 1;
    const std::size_t length = size / std::max<std::size_t>(1, channels);
    for (std::size_t c = 0; c < channels; ++c) {
      const P scale(context.scales[c].scale), zero(context.scales[c].zero_point);
      each_pack(length,
                [&](std::size_t i, bool whole, auto lanes) { body(c * length + i, whole, lanes, scale, zero); });
    }
  }

  [[nodiscard]] static Result<Done> not_finite(MatrixView<const T> x) {
    std::size_t i = 0;
    while (i < x.size() && std::isfinite(x.data[i])) ++i;
    return Error{ErrorKind::invalid,
                 {},
                 "row " + std::to_string(i / x.columns) + ", column " + std::to_string(i % x.columns),
                 "is not finite",
                 "look where it was made"};
  }

  Settings settings_;
};

}  // namespace compmark
