// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Quantizer with one fixed step and no dead zone: x^ = q round(x / q), ties to even; decoded from the symbol k =
// round(x / q) as x^ = k q. Training passes gradients straight through. Two ends where that formula fails and this does
// not: k q above the largest number (x^ is held there, which is nearer to x), and |k| of 2^22 and more in float (2^51
// in double), where numbers lie closer than q and x^ is x. Hence for every finite x: |x^ - x| <= q / 2 + eps |x|, the
// last term zero where q is a power of two, and x^^ = x^. Cost: one read, one division, one write.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/quantizer/adaptive_quantizer.hpp"

namespace compmark {

namespace detail {

/// d_in += d_out: the gradient of a rounding that is taken for x + constant.
template <class T>
void pass_straight_through(std::span<const T> d_out, std::span<T> d_in) {
  COMPMARK_ASSERT(d_out.size() == d_in.size(), "straight through: one gradient a value");
  for (std::size_t i = 0; i < d_in.size(); ++i) d_in[i] += d_out[i];
}

}  // namespace detail

template <class T>
class UniformQuantizer {
 public:
  static constexpr bool is_absent = false;
  using Scalar = T;
  struct Settings {
    double step = 1;  ///< q, a normal number of T
  };

  UniformQuantizer() = default;
  [[nodiscard]] static Result<UniformQuantizer> create(const Settings& settings) {
    if (!(settings.step >= static_cast<double>(std::numeric_limits<T>::min()) &&
          settings.step <= static_cast<double>(greatest))) {
      return Error{ErrorKind::invalid,
                   {},
                   "step",
                   std::to_string(settings.step) + " is not a positive normal number",
                   "choose a step of the size of the error that the values may have"};
    }
    UniformQuantizer quantizer;
    quantizer.step_ = static_cast<T>(settings.step);
    return quantizer;
  }

  [[nodiscard]] T step() const { return step_; }
  /// As the Quantizer of a recipe: always the base step, for any output of a network.
  [[nodiscard]] static T step(T /*r*/, T q0, T least) { return std::max(q0, least); }
  [[nodiscard]] static T step_slope(T /*r*/, T /*q0*/, T /*least*/) { return T(0); }
  [[nodiscard]] static T step_log_slope(T /*r*/) { return T(0); }
  /// The integer that is coded.
  [[nodiscard]] static T symbol(T x, T q) { return AdaptiveQuantizer<T>::symbol(x, q); }
  /// The value that is decoded; of NaN, NaN.
  [[nodiscard]] static T value(T x, T q) { return rounded(Pack<T, 1>(x), Pack<T, 1>(q)).lane(0); }
  /// (x^ - x) / q: what the distortion layer draws at random instead.
  [[nodiscard]] static T error(T x, T q) { return AdaptiveQuantizer<T>::error(x, q); }

  /// out = x^; it may be x. A value that is not finite is refused, `out` then holds nothing of use.
  [[nodiscard]] Result<Done> forward(std::span<const T> x, std::span<T> out) const {
    COMPMARK_ASSERT(x.size() == out.size(), "UniformQuantizer: one value a value");
    const P q(step_), most(greatest);
    auto finite = q <= most;
    for (std::size_t i = 0; i < x.size(); i += W) {
      const auto lanes = Pack<T>::MaskType::first(static_cast<std::ptrdiff_t>(x.size() - i));
      const bool whole = x.size() - i >= W;
      const P v = whole ? P::load(x.data() + i) : P::load(x.data() + i, lanes);
      finite = finite & (abs(v) <= most);
      whole ? rounded(v, q).store(out.data() + i) : rounded(v, q).store(out.data() + i, lanes);
    }
    return all(finite) ? Result<Done>(Done{}) : not_finite(out);
  }
  /// d_x += d_out.
  static void backward(std::span<const T> d_out, std::span<T> d_x) { detail::pass_straight_through(d_out, d_x); }

  /// Symbols for a coder. One whose value has none (above) is refused, as is what is not finite.
  [[nodiscard]] Result<Done> encode(std::span<const T> x, std::span<std::int32_t> symbols) const {
    COMPMARK_ASSERT(x.size() == symbols.size(), "UniformQuantizer: one symbol a value");
    for (std::size_t i = 0; i < x.size(); ++i) {
      const T k = symbol(x[i], step_);
      if (!(std::abs(k) < symbol_limit)) {
        return Error{ErrorKind::invalid,
                     {},
                     "value " + std::to_string(i),
                     "is not finite, or too large for its step",
                     "choose a larger step"};
      }
      symbols[i] = static_cast<std::int32_t>(k);
    }
    return Done{};
  }
  /// x = k q: what forward gave.
  void decode(std::span<const std::int32_t> symbols, std::span<T> x) const {
    COMPMARK_ASSERT(x.size() == symbols.size(), "UniformQuantizer: one symbol a value");
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] = std::clamp(static_cast<T>(symbols[i]) * step_, -greatest, greatest);
    }
  }

 private:
  using P = Pack<T>;
  static constexpr std::size_t W = native_width<T>;
  static constexpr T greatest = std::numeric_limits<T>::max();
  /// From here on numbers are spaced by q / 4 at least.
  static constexpr T limit = static_cast<T>(std::uint64_t{1} << (std::numeric_limits<T>::digits - 2));
  static constexpr T symbol_limit = limit < T(1 << 30) ? limit : T(1 << 30);

  template <int N>
  [[nodiscard]] static Pack<T, N> rounded(Pack<T, N> x, Pack<T, N> q) {
    const Pack<T, N> k = round_to_even(x / q), most(greatest);
    const Pack<T, N> held = max(min(k * q, most), -most);
    return select(abs(k) < Pack<T, N>(limit), held, x);
  }
  [[nodiscard]] static Result<Done> not_finite(std::span<const T> x) {
    std::size_t i = 0;
    while (i < x.size() && std::isfinite(x[i])) ++i;
    return Error{ErrorKind::invalid, {}, "value " + std::to_string(i), "is not finite", "look where it was made"};
  }

  T step_ = 1;
};

}  // namespace compmark
