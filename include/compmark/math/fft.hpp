// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Discrete Fourier transform of any length, many signals at a time: the lanes of a pack are separate signals, so every
// step is a plain pack operation. Mixed radix (4, 2, 3, 5, then primes up to 31) without reordering (Stockham's order);
// a length with a larger prime factor becomes a circular convolution of a smooth length (Bluestein). Twiddle factors
// come from a table computed in long double, never from a recurrence (docs/spec/numerics.md, FR4, FR5). Cost: about 5 n
// log2 n operations a signal, one pass over the scratch a factor; Bluestein six times that. 400 transforms of length
// 400: 0.11 ms on one core with AVX-512, where the packaged header-only transform (Eigen's port of kissfft) takes 0.74.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/math/fft_butterfly.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/unroll.hpp"

namespace compmark {

/// Signals side by side: sample k of signal `lane` is re[k * lanes + lane] + i im[k * lanes + lane].
template <class T>
struct ComplexLanes {
  T* re = nullptr;
  T* im = nullptr;
};

template <class T>
class Fft {
 public:
  using Scalar = T;
  using P = Pack<T, native_width<T>>;
  static constexpr int lanes = P::width;

  /// Computes the tables; the only place that allocates.
  explicit Fft(int length);
  [[nodiscard]] int length() const { return length_; }
  /// Samples that `data` and `spare` must each have room for: length(), or what Bluestein needs.
  [[nodiscard]] std::size_t room() const {
    return static_cast<std::size_t>(convolution_ == nullptr ? length_ : convolution_->length());
  }

  /// sum_k x_k exp(-2 pi i j k / n), in natural order, unscaled. Works in both buffers and returns the one that holds
  /// the result.
  ComplexLanes<T> forward(ComplexLanes<T> data, ComplexLanes<T> spare) const;
  /// sum_j x_j exp(+2 pi i j k / n), unscaled: n times the inverse.
  ComplexLanes<T> backward(ComplexLanes<T> data, ComplexLanes<T> spare) const {
    // Exchanging the parts of a signal exchanges the directions.
    const ComplexLanes<T> result = forward({data.im, data.re}, {spare.im, spare.re});
    return {result.im, result.re};
  }

 private:
  struct Stage {
    int radix = 0;
    int blocks = 0;            // n / (radix stride)
    int stride = 0;            // product of the radices before
    std::size_t twiddles = 0;  // of block p: (radix - 1) pairs from here + 2 p (radix - 1)
    std::size_t roots = 0;     // cosines and sines of j / radix, for radices that are not written out
  };
  static constexpr int largest_prime = 31;

  using Parts = detail::FftParts<P>;
  static COMPMARK_INLINE Parts load(ComplexLanes<T> x, int k) {
    const std::size_t at = static_cast<std::size_t>(k) * lanes;
    return {P::load(x.re + at), P::load(x.im + at)};
  }
  static COMPMARK_INLINE void store(Parts v, ComplexLanes<T> x, int k) {
    const std::size_t at = static_cast<std::size_t>(k) * lanes;
    v.re.store(x.re + at);
    v.im.store(x.im + at);
  }
  static COMPMARK_INLINE Parts times(Parts v, P c, P s) { return {fnma(v.im, s, v.re * c), fma(v.re, s, v.im * c)}; }
  /// exp(-2 pi i numerator / denominator)
  template <class U = T>
  static std::pair<U, U> root(std::int64_t numerator, std::int64_t denominator) {
    const long double angle = 2 * std::numbers::pi_v<long double> * static_cast<long double>(numerator % denominator) /
                              static_cast<long double>(denominator);
    return {static_cast<U>(std::cos(angle)), static_cast<U>(-std::sin(angle))};
  }

  template <int Radix>
  void pass(const Stage& stage, ComplexLanes<T> in, ComplexLanes<T> out) const;
  void any_pass(const Stage& stage, ComplexLanes<T> in, ComplexLanes<T> out) const;
  void plan_stages();
  void plan_convolution();

  int length_;
  std::vector<Stage> stages_;
  std::vector<T> table_;
  // Bluestein
  std::unique_ptr<Fft> convolution_;
  std::vector<T> chirp_;  // exp(-pi i k^2 / n), pairs
  std::vector<T>
      kernel_;  // transform of the conjugate chirp over the convolution's length, divided by that length; pairs
};

template <class T>
Fft<T>::Fft(int length) : length_(length) {
  COMPMARK_ASSERT(length >= 1, "Fft: a length of at least 1");
  int rest = length;
  for (int prime = 2; prime <= largest_prime; ++prime) {
    while (rest % prime == 0) rest /= prime;
  }
  if (rest == 1) {
    plan_stages();
  } else {
    plan_convolution();
  }
}

template <class T>
void Fft<T>::plan_stages() {
  int rest = length_, stride = 1;
  for (int radix = 4; rest > 1; radix = radix == 4 ? 2 : (radix == 3 ? 5 : radix + 1)) {
    while (rest % radix == 0) {
      Stage stage{radix, rest / radix, stride, table_.size(), 0};
      for (int p = 0; p < stage.blocks; ++p) {
        for (int j = 1; j < radix; ++j) {
          const auto [c, s] = root(std::int64_t{p} * j, rest);
          table_.insert(table_.end(), {c, s});
        }
      }
      stage.roots = table_.size();
      for (int j = 0; j < radix; ++j) {
        const auto [c, s] = root(j, radix);
        table_.insert(table_.end(), {c, -s});
      }
      stages_.push_back(stage);
      rest /= radix;
      stride *= radix;
    }
  }
}

template <class T>
void Fft<T>::plan_convolution() {
  int smooth = 2 * length_ - 1;
  for (;; ++smooth) {
    int rest = smooth;
    for (const int prime : {2, 3, 5}) {
      while (rest % prime == 0) rest /= prime;
    }
    if (rest == 1) break;
  }
  convolution_ = std::make_unique<Fft>(smooth);
  for (std::int64_t k = 0; k < length_; ++k) {
    const auto [c, s] = root(k * k, 2 * std::int64_t{length_});  // k^2 modulo 2 n in whole numbers: no angle grows
    chirp_.insert(chirp_.end(), {c, s});
  }
  // The kernel's transform in long double, whatever T is.
  const Fft<long double> exact(smooth);
  const std::size_t size = static_cast<std::size_t>(smooth);
  std::vector<long double> work(4 * size, 0.0L);
  const ComplexLanes<long double> data{work.data(), work.data() + size};
  const ComplexLanes<long double> spare{work.data() + 2 * size, work.data() + 3 * size};
  for (std::int64_t k = 0; k < length_; ++k) {
    const auto [c, s] = root<long double>(k * k, 2 * std::int64_t{length_});
    for (const std::int64_t at : {k, (smooth - k) % smooth}) {
      data.re[at] = c / static_cast<long double>(smooth);
      data.im[at] = -s / static_cast<long double>(smooth);
    }
  }
  const ComplexLanes<long double> result = exact.forward(data, spare);
  for (std::size_t k = 0; k < size; ++k)
    kernel_.insert(kernel_.end(), {static_cast<T>(result.re[k]), static_cast<T>(result.im[k])});
}

template <class T>
template <int Radix>
void Fft<T>::pass(const Stage& stage, ComplexLanes<T> in, ComplexLanes<T> out) const {
  const int stride = stage.stride, blocks = stage.blocks;
  const T* const roots = table_.data() + stage.roots;
  for (int p = 0; p < blocks; ++p) {
    const T* const twiddle = table_.data() + stage.twiddles + 2 * static_cast<std::size_t>(p * (Radix - 1));
    for (int q = 0; q < stride; ++q) {
      Parts a[Radix], y[Radix];
      detail::unroll<Radix>([&](auto j) __attribute__((always_inline)) {
        a[j()] = load(in, q + stride * (p + blocks * decltype(j)::value));
      });
      detail::fft_butterfly<Radix>(roots, a, y);
      const int first = q + stride * Radix * p;
      store(y[0], out, first);
      detail::unroll<Radix - 1>([&](auto i) __attribute__((always_inline)) {
        constexpr int j = decltype(i)::value + 1;
        if (p != 0) y[j] = times(y[j], P(twiddle[2 * (j - 1)]), P(twiddle[2 * (j - 1) + 1]));
        store(y[j], out, first + stride * j);
      });
    }
  }
}

/// A prime radix from 7 to 31: radix^2 / 2 multiplications a butterfly.
template <class T>
void Fft<T>::any_pass(const Stage& stage, ComplexLanes<T> in, ComplexLanes<T> out) const {
  const int radix = stage.radix, stride = stage.stride, half = (radix - 1) / 2;
  const T* const roots = table_.data() + stage.roots;
  std::array<Parts, largest_prime / 2> sum, difference;
  for (int p = 0; p < stage.blocks; ++p) {
    const T* const twiddle = table_.data() + stage.twiddles + 2 * static_cast<std::size_t>(p * (radix - 1));
    const auto put = [&](Parts y, int q, int j) {
      if (p != 0 && j != 0) y = times(y, P(twiddle[2 * (j - 1)]), P(twiddle[2 * (j - 1) + 1]));
      store(y, out, q + stride * (radix * p + j));
    };
    for (int q = 0; q < stride; ++q) {
      const Parts a0 = load(in, q + stride * p);
      Parts y0 = a0;
      for (int j = 1; j <= half; ++j) {
        const Parts low = load(in, q + stride * (p + stage.blocks * j));
        const Parts high = load(in, q + stride * (p + stage.blocks * (radix - j)));
        const std::size_t at = static_cast<std::size_t>(j - 1);
        sum[at] = {low.re + high.re, low.im + high.im};
        difference[at] = {low.re - high.re, low.im - high.im};
        y0 = {y0.re + sum[at].re, y0.im + sum[at].im};
      }
      put(y0, q, 0);
      for (int k = 1; k <= half; ++k) {
        Parts even = a0, odd{P(T(0)), P(T(0))};
        for (int j = 1; j <= half; ++j) {
          const int index = j * k % radix;
          const std::size_t at = static_cast<std::size_t>(j - 1);
          const P c(roots[2 * index]), s(roots[2 * index + 1]);
          even = {fma(c, sum[at].re, even.re), fma(c, sum[at].im, even.im)};
          odd = {fma(s, difference[at].re, odd.re), fma(s, difference[at].im, odd.im)};
        }
        put({even.re + odd.im, even.im - odd.re}, q, k);
        put({even.re - odd.im, even.im + odd.re}, q, radix - k);
      }
    }
  }
}

template <class T>
ComplexLanes<T> Fft<T>::forward(ComplexLanes<T> data, ComplexLanes<T> spare) const {
  if (convolution_ != nullptr) {
    const int size = convolution_->length_;
    const auto by_chirp = [&](ComplexLanes<T> x, int k) {
      const std::size_t at = 2 * static_cast<std::size_t>(k);
      store(times(load(x, k), P(chirp_[at]), P(chirp_[at + 1])), x, k);
    };
    for (int k = 0; k < length_; ++k) by_chirp(data, k);
    for (int k = length_; k < size; ++k) store({P(T(0)), P(T(0))}, data, k);
    ComplexLanes<T> result = convolution_->forward(data, spare);
    for (int k = 0; k < size; ++k) {
      const std::size_t at = 2 * static_cast<std::size_t>(k);
      store(times(load(result, k), P(kernel_[at]), P(kernel_[at + 1])), result, k);
    }
    result = convolution_->backward(result, result.re == data.re || result.re == data.im ? spare : data);
    for (int k = 0; k < length_; ++k) by_chirp(result, k);
    return result;
  }
  for (const Stage& stage : stages_) {
    switch (stage.radix) {
      case 2:
        pass<2>(stage, data, spare);
        break;
      case 3:
        pass<3>(stage, data, spare);
        break;
      case 4:
        pass<4>(stage, data, spare);
        break;
      case 5:
        pass<5>(stage, data, spare);
        break;
      default:
        any_pass(stage, data, spare);
        break;
    }
    std::swap(data, spare);
  }
  return data;
}

}  // namespace compmark
