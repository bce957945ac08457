// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Kernels of the lattice decoder: with u [dimensions, positions] and gates w [positions],
//   sum_k = sum_i w_i cos(2 pi t_ik),   t_ik = phase_k + sum_j frequency_kj u_ji   (in turns),
// and the two gradients of it. The gradients compute the Fourier features again instead of keeping them: features x
// positions numbers would not fit the caches. Positions come in whole packs (padded with gate 0), and sums and input
// gradients leave out a pack whose gates are all 0, a background. For one colour (three dimensions) these two have
// loops of their own, whose sums stay in registers. Cost: per feature and open position `dimensions` multiply-adds and
// ~22 operations for the cosine; the gradients twice that.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>
#include <type_traits>

#include "compmark/math/pack.hpp"

namespace compmark {
namespace detail {

template <class P>
struct CosineSine {
  P cosine;
  P sine;
};

/// cos and sin of 2 pi x. Float: reduced to half a turn, then the half angle by its series; error 6e-7 for |x| < 3
/// (beyond, the rounding of x itself counts: 4e-6 turns at 100).
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE CosineSine<Pack<T, W>> cosine_sine_of_turns(Pack<T, W> x) {
  using P = Pack<T, W>;
  const P q = x - round_to_even(x);
  if constexpr (!std::is_same_v<T, float>) {
    CosineSine<P> result{P(T(0)), P(T(0))};  // every lane is set below; g++ 12 does not see it
    for (int i = 0; i < W; ++i) {
      result.cosine.set(i, std::cos(2 * std::numbers::pi_v<T> * q.lane(i)));
      result.sine.set(i, std::sin(2 * std::numbers::pi_v<T> * q.lane(i)));
    }
    return result;
  } else {
    const P t = q * P(3.14159265f);  // half the angle, within a quarter turn
    const P t2 = t * t;
    P s = fma(P(-2.50521084e-8f), t2, P(2.75573192e-6f));
    s = fma(s, t2, P(-1.98412698e-4f));
    s = fma(s, t2, P(8.33333333e-3f));
    s = fma(s, t2, P(-1.66666667e-1f));
    s = fma(s * t2, t, t);
    P c = fma(P(2.08767570e-9f), t2, P(-2.75573192e-7f));
    c = fma(c, t2, P(2.48015873e-5f));
    c = fma(c, t2, P(-1.38888889e-3f));
    c = fma(c, t2, P(4.16666667e-2f));
    c = fma(c, t2, P(-0.5f));
    c = fma(c, t2, P(1.0f));
    return {fma(P(-2.0f) * s, s, P(1.0f)), P(2.0f) * s * c};
  }
}

/// What all three kernels read.
template <class T>
struct FourierFeatures {
  const T* frequency = nullptr;  ///< [features, dimensions], in turns
  const T* phase = nullptr;      ///< [features], in turns
  const T* u = nullptr;          ///< [dimensions, stride]
  const T* gate = nullptr;       ///< [stride]
  std::size_t features = 0;
  std::size_t dimensions = 0;
  std::size_t stride = 0;  ///< positions, in whole packs

  static constexpr int lanes = native_width<T>;
  using P = Pack<T, lanes>;

  [[nodiscard]] COMPMARK_INLINE CosineSine<P> cosine_sine(std::size_t k, std::size_t i) const {
    return cosine_sine_in<0>(k, i);
  }

  /// sums[k] of positions [begin, end).
  void sum(std::size_t begin, std::size_t end, T* sums) const {
    dimensions == 3 ? sum_in<3>(begin, end, sums) : sum_in<0>(begin, end, sums);
  }

  /// With e_k = dL/dsum_k: fills d_u [dimensions, stride] and d_gate, positions [begin, end). Both are 0 in a pack
  /// without an open gate.
  void input_gradient(std::size_t begin, std::size_t end, const T* e, T* d_u, T* d_gate) const {
    dimensions == 3 ? input_gradient_in<3>(begin, end, e, d_u, d_gate)
                    : input_gradient_in<0>(begin, end, e, d_u, d_gate);
  }

  /// Adds to sines[k] = sum w sin and to moments[k, j] = sum w u_j sin over [begin, end): dL/dphase_k = -2 pi e_k
  /// sines[k], and so on.
  void weight_sums(std::size_t begin, std::size_t end, T* sines, T* moments) const {
    for (std::size_t k = 0; k < features; ++k) {
      P total(T(0)), moment[most_dimensions];
      for (std::size_t j = 0; j < dimensions; ++j) moment[j] = P(T(0));
      for (std::size_t i = begin; i < end; i += lanes) {
        const P s = P::load(gate + i) * cosine_sine(k, i).sine;
        total = total + s;
        for (std::size_t j = 0; j < dimensions; ++j) moment[j] = fma(s, P::load(u + j * stride + i), moment[j]);
      }
      sines[k] += reduce_add(total);
      for (std::size_t j = 0; j < dimensions; ++j) moments[k * dimensions + j] += reduce_add(moment[j]);
    }
  }

 private:
  static constexpr std::size_t most_dimensions = 24;

  [[nodiscard]] COMPMARK_INLINE bool open(std::size_t i) const { return any(P::load(gate + i) > P(T(0))); }

  /// Fixed: the number of dimensions, or 0 where it is known at run time alone.
  template <int Fixed>
  [[nodiscard]] COMPMARK_INLINE CosineSine<P> cosine_sine_in(std::size_t k, std::size_t i) const {
    const std::size_t count = Fixed == 0 ? dimensions : static_cast<std::size_t>(Fixed);
    P turns(phase[k]);
    const T* f = frequency + k * count;
    for (std::size_t j = 0; j < count; ++j) turns = fma(P(f[j]), P::load(u + j * stride + i), turns);
    return cosine_sine_of_turns(turns);
  }

  template <int Fixed>
  void sum_in(std::size_t begin, std::size_t end, T* sums) const {
    for (std::size_t k = 0; k < features; ++k) sums[k] = T(0);
    constexpr std::size_t most = 64;  // packs at a time
    std::size_t opened[most];
    while (begin < end) {
      std::size_t count = 0;
      for (; begin < end && count < most; begin += lanes) {
        if (open(begin)) opened[count++] = begin;
      }
      if (count == 0) continue;
      std::size_t k = 0;
      for (; k + together <= features; k += together) add_features<Fixed, together>(k, opened, count, sums);
      for (; k < features; ++k) add_features<Fixed, 1>(k, opened, count, sums);
    }
  }

  /// Features whose sums run side by side: they share the loads of a pack and hide each other's latency. Each keeps
  /// the order of its own terms, so that the sums are those of one feature at a time, bit for bit.
  static constexpr std::size_t together = 4;

  /// Adds to sums[k] .. sums[k + Together) the packs that begin at opened[0 .. count).
  template <int Fixed, std::size_t Together>
  COMPMARK_INLINE void add_features(std::size_t k, const std::size_t* opened, std::size_t count, T* sums) const {
    P total[Together];
    for (std::size_t f = 0; f < Together; ++f) total[f] = P(T(0));
    for (std::size_t n = 0; n < count; ++n) {
      const P weight = P::load(gate + opened[n]);
      for (std::size_t f = 0; f < Together; ++f)
        total[f] = fma(weight, cosine_sine_in<Fixed>(k + f, opened[n]).cosine, total[f]);
    }
    for (std::size_t f = 0; f < Together; ++f) sums[k + f] += reduce_add(total[f]);
  }

  template <int Fixed>
  void input_gradient_in(std::size_t begin, std::size_t end, const T* e, T* d_u, T* d_gate) const {
    const std::size_t count = Fixed == 0 ? dimensions : static_cast<std::size_t>(Fixed);
    const P turn(-2 * std::numbers::pi_v<T>);
    for (std::size_t i = begin; i < end; i += lanes) {
      P slope[Fixed == 0 ? most_dimensions : static_cast<std::size_t>(Fixed)];
      for (std::size_t j = 0; j < count; ++j) slope[j] = P(T(0));
      P share(T(0));
      const std::size_t open_features = open(i) ? features : 0;
      for (std::size_t k = 0; k < open_features; ++k) {
        const CosineSine<P> at = cosine_sine_in<Fixed>(k, i);
        share = fma(P(e[k]), at.cosine, share);
        const P s = P(e[k]) * at.sine;
        const T* f = frequency + k * count;
        for (std::size_t j = 0; j < count; ++j) slope[j] = fma(P(f[j]), s, slope[j]);
      }
      const P scale = turn * P::load(gate + i);
      for (std::size_t j = 0; j < count; ++j) (scale * slope[j]).store(d_u + j * stride + i);
      share.store(d_gate + i);
    }
  }
};

}  // namespace detail
}  // namespace compmark
