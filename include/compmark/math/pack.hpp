// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The only file that knows SIMD: Pack<T, W> is W lanes of T, Mask<T, W> the result of comparing two. Kernels are
// written once on Pack and instantiated at native_width<T> (production), at 1 (any scalar, long double too) and at
// other widths (tests). Built on the vector extensions that g++ and clang++ share, with intrinsics only where these do
// not reach one instruction (fused multiply-add, masks, compress, gather). docs/rationale.md says why not a SIMD
// library (measured). Longer than 300 lines: the one place of intrinsics is kept together. The zero-masking forms
// (maskz) with a full mask compile to the plain instruction and avoid a false -Wuninitialized of g++ 12 in its own
// headers.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#if defined(__x86_64__) || defined(__i386__)
#include <immintrin.h>
#endif

#include "compmark/core/config.hpp"

namespace compmark {

/// Lanes of the widest register of this build; 1 for scalars without SIMD (long double).
template <class T>
inline constexpr int native_width = [] {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
  constexpr int bytes = 64;
#elif defined(__AVX2__)
  constexpr int bytes = 32;
#else
  constexpr int bytes = 16;
#endif
  return std::is_same_v<T, float> || std::is_same_v<T, double> ? bytes / static_cast<int>(sizeof(T)) : 1;
}();

namespace detail {

template <class T, int W>
struct LaneStorage {
  typedef T type __attribute__((vector_size(sizeof(T) * W), may_alias));
};
template <class T>
struct LaneStorage<T, 1> {
  using type = T;
};

template <std::size_t Bytes>
struct LaneInteger;
template <>
struct LaneInteger<4> {
  using type = std::int32_t;
};
template <>
struct LaneInteger<8> {
  using type = std::int64_t;
};

#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
inline constexpr bool has_mask_registers = true;
#else
inline constexpr bool has_mask_registers = false;
#endif

/// How a mask is held: bool for one lane, a mask register for full 64-byte packs, else integer lanes of 0 and -1.
template <class T, int W>
inline constexpr bool uses_mask_register = has_mask_registers&& W > 1 && sizeof(T) * W == 64;

template <class T, int W, bool Register = uses_mask_register<T, W>>
struct MaskStorage {
  using type = typename LaneStorage<typename LaneInteger<sizeof(T)>::type, W>::type;
};
template <class T>
struct MaskStorage<T, 1, false> {
  using type = bool;
};
template <class T, int W>
struct MaskStorage<T, W, true> {
  using type = std::uint16_t;
};

}  // namespace detail

/// One truth value a lane.
template <class T, int W>
struct Mask {
  typename detail::MaskStorage<T, W>::type native;

  friend COMPMARK_INLINE Mask operator&(Mask a, Mask b) {
    return combine(a, b, [](auto x, auto y) { return x & y; });
  }
  friend COMPMARK_INLINE Mask operator|(Mask a, Mask b) {
    return combine(a, b, [](auto x, auto y) { return x | y; });
  }
  friend COMPMARK_INLINE Mask operator!(Mask a) {
    if constexpr (W == 1) {
      return {!a.native};
    } else if constexpr (detail::uses_mask_register<T, W>) {
      return {static_cast<std::uint16_t>(~a.native & ((1u << W) - 1u))};
    } else {
      return {~a.native};
    }
  }
  [[nodiscard]] COMPMARK_INLINE bool lane(int i) const {
    if constexpr (W == 1) {
      return native;
    } else if constexpr (detail::uses_mask_register<T, W>) {
      return ((native >> i) & 1) != 0;
    } else {
      return native[i] != 0;
    }
  }
  /// Bit i is lane i.
  [[nodiscard]] COMPMARK_INLINE unsigned bits() const {
    if constexpr (W == 1) {
      return native ? 1u : 0u;
    } else if constexpr (detail::uses_mask_register<T, W>) {
      return native;
    } else {
#if defined(__AVX2__)
      if constexpr (W == 8 && sizeof(T) == 4) return static_cast<unsigned>(_mm256_movemask_ps((__m256)native));
      if constexpr (W == 4 && sizeof(T) == 8) return static_cast<unsigned>(_mm256_movemask_pd((__m256d)native));
#endif
      unsigned result = 0;
      for (int i = 0; i < W; ++i) result |= native[i] != 0 ? 1u << i : 0u;
      return result;
    }
  }
  /// The first `count` lanes (count may exceed W).
  static COMPMARK_INLINE Mask first(std::ptrdiff_t count) {
    const unsigned bits = count <= 0 ? 0u : (count >= W ? (W == 32 ? ~0u : (1u << W) - 1u) : (1u << count) - 1u);
    return from_bits(bits);
  }
  static COMPMARK_INLINE Mask from_bits(unsigned bits) {
    Mask mask;
    if constexpr (W == 1) {
      mask.native = (bits & 1u) != 0;
    } else if constexpr (detail::uses_mask_register<T, W>) {
      mask.native = static_cast<std::uint16_t>(bits);
    } else {
      for (int i = 0; i < W; ++i) mask.native[i] = (bits >> i & 1u) != 0 ? -1 : 0;
    }
    return mask;
  }

 private:
  template <class F>
  static COMPMARK_INLINE Mask combine(Mask a, Mask b, F f) {
    return {static_cast<decltype(native)>(f(a.native, b.native))};
  }
};

template <class T, int W>
[[nodiscard]] COMPMARK_INLINE bool any(Mask<T, W> mask) {
  return mask.bits() != 0;
}
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE bool all(Mask<T, W> mask) {
  return mask.bits() == (W == 32 ? ~0u : (1u << W) - 1u);
}
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE int count(Mask<T, W> mask) {
  return __builtin_popcount(mask.bits());
}

/// W lanes of T with the arithmetic of T in every lane.
template <class T, int W = native_width<T>>
struct Pack {
  using Scalar = T;
  using MaskType = Mask<T, W>;
  using Native = typename detail::LaneStorage<T, W>::type;
  static constexpr int width = W;

  Native native;

  Pack() = default;
  COMPMARK_INLINE Pack(
      T value) {  // NOLINT(google-explicit-constructor): constants mix with packs as they do with scalars
    if constexpr (W == 1) {
      native = value;
    } else {
      // x - 0 is x for every x, so it folds to one broadcast; 0 + x is not (-0) and would cost an addition
      native = value - Native{};
    }
  }
  static COMPMARK_INLINE Pack from_native(Native native) {
    Pack pack;
    pack.native = native;
    return pack;
  }
  /// start, start + 1, …
  static COMPMARK_INLINE Pack ramp(T start) {
    Pack pack;
    if constexpr (W == 1) {
      pack.native = start;
    } else {
      for (int i = 0; i < W; ++i) pack.native[i] = start + static_cast<T>(i);
    }
    return pack;
  }
  static COMPMARK_INLINE Pack load(const T* source) {
    Pack pack;
    std::memcpy(&pack.native, source, sizeof(Native));
    return pack;
  }
  COMPMARK_INLINE void store(T* target) const { std::memcpy(target, &native, sizeof(Native)); }
  /// A store past the caches, for whole cache lines that are not read again soon: it does not read the line first.
  /// `target` is aligned to the pack. Call streaming_fence() before another thread may read.
  COMPMARK_INLINE void store_streaming(T* target) const {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    if constexpr (std::is_same_v<T, float> && W == 16) {
      _mm512_stream_ps(target, (__m512)native);
      return;
    }
    if constexpr (std::is_same_v<T, double> && W == 8) {
      _mm512_stream_pd(target, (__m512d)native);
      return;
    }
#elif defined(__AVX__)
    if constexpr (std::is_same_v<T, float> && W == 8) {
      _mm256_stream_ps(target, (__m256)native);
      return;
    }
#endif
    store(target);
  }
  /// Lanes where the mask is false read nothing and become zero.
  static COMPMARK_INLINE Pack load(const T* source, MaskType mask) {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    if constexpr (std::is_same_v<T, float> && W == 16)
      return from_native((Native)_mm512_maskz_loadu_ps(mask.native, source));
    if constexpr (std::is_same_v<T, double> && W == 8) {
      return from_native((Native)_mm512_maskz_loadu_pd(static_cast<__mmask8>(mask.native), source));
    }
#endif
    Pack pack(T{});
    for (int i = 0; i < W; ++i) {
      if (mask.lane(i)) pack.set(i, source[i]);
    }
    return pack;
  }
  COMPMARK_INLINE void store(T* target, MaskType mask) const {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    if constexpr (std::is_same_v<T, float> && W == 16) {
      _mm512_mask_storeu_ps(target, mask.native, (__m512)native);
      return;
    }
    if constexpr (std::is_same_v<T, double> && W == 8) {
      _mm512_mask_storeu_pd(target, static_cast<__mmask8>(mask.native), (__m512d)native);
      return;
    }
#endif
    for (int i = 0; i < W; ++i) {
      if (mask.lane(i)) target[i] = lane(i);
    }
  }
  /// Lane i reads base[index[i]].
  static COMPMARK_INLINE Pack gather(const T* base, const std::int32_t* index) {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    if constexpr (std::is_same_v<T, float> && W == 16) {
      return from_native(
          (Native)_mm512_mask_i32gather_ps(_mm512_setzero_ps(), 0xFFFF, _mm512_loadu_si512(index), base, 4));
    }
    if constexpr (std::is_same_v<T, double> && W == 8) {
      return from_native((Native)_mm512_mask_i32gather_pd(
          _mm512_setzero_pd(), 0xFF, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(index)), base, 8));
    }
#endif
    Pack pack;
    for (int i = 0; i < W; ++i) pack.set(i, base[index[i]]);
    return pack;
  }
  /// Stores the lanes whose mask is true next to each other; returns how many. May write up to W values (the rest is
  /// scratch).
  COMPMARK_INLINE int compress_store(T* target, MaskType mask) const {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    if constexpr (std::is_same_v<T, float> && W == 16) {
      _mm512_storeu_ps(target, _mm512_maskz_compress_ps(mask.native, (__m512)native));
      return count(mask);
    }
    if constexpr (std::is_same_v<T, double> && W == 8) {
      _mm512_storeu_pd(target, _mm512_maskz_compress_pd(static_cast<__mmask8>(mask.native), (__m512d)native));
      return count(mask);
    }
#endif
    int n = 0;
    for (int i = 0; i < W; ++i) {
      if (mask.lane(i)) target[n++] = lane(i);
    }
    return n;
  }
  /// The inverse of compress_store: consecutive values go to the lanes whose mask is true, the others become zero.
  /// Reads count(mask) values.
  static COMPMARK_INLINE Pack expand_load(const T* source, MaskType mask) {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    if constexpr (std::is_same_v<T, float> && W == 16)
      return from_native((Native)_mm512_maskz_expandloadu_ps(mask.native, source));
    if constexpr (std::is_same_v<T, double> && W == 8) {
      return from_native((Native)_mm512_maskz_expandloadu_pd(static_cast<__mmask8>(mask.native), source));
    }
#endif
    Pack pack(T{});
    int n = 0;
    for (int i = 0; i < W; ++i) {
      if (mask.lane(i)) pack.set(i, source[n++]);
    }
    return pack;
  }

  [[nodiscard]] COMPMARK_INLINE T lane(int i) const {
    if constexpr (W == 1) {
      return native;
    } else {
      return native[i];
    }
  }
  COMPMARK_INLINE void set(int i, T value) {
    if constexpr (W == 1) {
      native = value;
    } else {
      native[i] = value;
    }
  }

  friend COMPMARK_INLINE Pack operator+(Pack a, Pack b) { return from_native(a.native + b.native); }
  friend COMPMARK_INLINE Pack operator-(Pack a, Pack b) { return from_native(a.native - b.native); }
  friend COMPMARK_INLINE Pack operator*(Pack a, Pack b) { return from_native(a.native * b.native); }
  friend COMPMARK_INLINE Pack operator/(Pack a, Pack b) { return from_native(a.native / b.native); }
  friend COMPMARK_INLINE Pack operator-(Pack a) { return from_native(-a.native); }
  COMPMARK_INLINE Pack& operator+=(Pack b) { return *this = *this + b; }
  COMPMARK_INLINE Pack& operator-=(Pack b) { return *this = *this - b; }
  COMPMARK_INLINE Pack& operator*=(Pack b) { return *this = *this * b; }

  friend COMPMARK_INLINE MaskType operator<(Pack a, Pack b) { return compare<0>(a, b); }
  friend COMPMARK_INLINE MaskType operator<=(Pack a, Pack b) { return compare<1>(a, b); }
  friend COMPMARK_INLINE MaskType operator>(Pack a, Pack b) { return compare<0>(b, a); }
  friend COMPMARK_INLINE MaskType operator>=(Pack a, Pack b) { return compare<1>(b, a); }
  friend COMPMARK_INLINE MaskType operator==(Pack a, Pack b) { return compare<2>(a, b); }

 private:
  /// 0: a < b, 1: a <= b, 2: a == b; all false where a lane is NaN.
  template <int Which>
  static COMPMARK_INLINE MaskType compare(Pack a, Pack b) {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    constexpr int predicate = Which == 0 ? _CMP_LT_OQ : (Which == 1 ? _CMP_LE_OQ : _CMP_EQ_OQ);
    if constexpr (std::is_same_v<T, float> && W == 16)
      return {_mm512_cmp_ps_mask((__m512)a.native, (__m512)b.native, predicate)};
    if constexpr (std::is_same_v<T, double> && W == 8) {
      return {_mm512_cmp_pd_mask((__m512d)a.native, (__m512d)b.native, predicate)};
    }
#endif
    if constexpr (Which == 0) {
      return make_mask(a.native < b.native);
    } else if constexpr (Which == 1) {
      return make_mask(a.native <= b.native);
    } else {
      return make_mask(a.native == b.native);
    }
  }
  template <class Compared>
  static COMPMARK_INLINE MaskType make_mask(Compared compared) {
    if constexpr (W == 1) {
      return {static_cast<bool>(compared)};
    } else if constexpr (detail::uses_mask_register<T, W>) {
      unsigned bits = 0;
      for (int i = 0; i < W; ++i) bits |= compared[i] != 0 ? 1u << i : 0u;
      return MaskType::from_bits(bits);
    } else {
      return {(typename detail::MaskStorage<T, W>::type)compared};
    }
  }
};

/// Orders store_streaming before what follows.
COMPMARK_INLINE void streaming_fence() {
#if defined(__x86_64__) || defined(__i386__)
  _mm_sfence();
#endif
}

/// mask ? a : b, lane by lane.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> select(Mask<T, W> mask, Pack<T, W> a, Pack<T, W> b) {
  using P = Pack<T, W>;
  if constexpr (W == 1) {
    return mask.native ? a : b;
  } else {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    if constexpr (std::is_same_v<T, float> && W == 16) {
      return P::from_native((typename P::Native)_mm512_mask_blend_ps(mask.native, (__m512)b.native, (__m512)a.native));
    }
    if constexpr (std::is_same_v<T, double> && W == 8) {
      return P::from_native((typename P::Native)_mm512_mask_blend_pd(static_cast<__mmask8>(mask.native),
                                                                     (__m512d)b.native, (__m512d)a.native));
    }
#endif
    if constexpr (!detail::uses_mask_register<T, W>) {
      using Bits = typename detail::MaskStorage<T, W>::type;
      return P::from_native((typename P::Native)((mask.native & (Bits)a.native) | (~mask.native & (Bits)b.native)));
    } else {
      P result;
      for (int i = 0; i < W; ++i) result.set(i, mask.lane(i) ? a.lane(i) : b.lane(i));
      return result;
    }
  }
}
/// a where the mask is true, else zero.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> keep(Mask<T, W> mask, Pack<T, W> a) {
  return select(mask, a, Pack<T, W>(T{}));
}

/// a b + c. Fused (one rounding) where the build has the instruction; never a call of libm's emulation.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> fma(Pack<T, W> a, Pack<T, W> b, Pack<T, W> c) {
  using P = Pack<T, W>;
  using N [[maybe_unused]] = typename P::Native;
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
  if constexpr (std::is_same_v<T, float> && W == 16) {
    return P::from_native((N)_mm512_fmadd_ps((__m512)a.native, (__m512)b.native, (__m512)c.native));
  }
  if constexpr (std::is_same_v<T, double> && W == 8) {
    return P::from_native((N)_mm512_fmadd_pd((__m512d)a.native, (__m512d)b.native, (__m512d)c.native));
  }
#endif
#if defined(__FMA__)
  if constexpr (std::is_same_v<T, float> && W == 8) {
    return P::from_native((N)_mm256_fmadd_ps((__m256)a.native, (__m256)b.native, (__m256)c.native));
  }
  if constexpr (std::is_same_v<T, double> && W == 4) {
    return P::from_native((N)_mm256_fmadd_pd((__m256d)a.native, (__m256d)b.native, (__m256d)c.native));
  }
  if constexpr (std::is_same_v<T, float> && W == 4) {
    return P::from_native((N)_mm_fmadd_ps((__m128)a.native, (__m128)b.native, (__m128)c.native));
  }
  if constexpr (std::is_same_v<T, double> && W == 2) {
    return P::from_native((N)_mm_fmadd_pd((__m128d)a.native, (__m128d)b.native, (__m128d)c.native));
  }
  if constexpr (W == 1 && (std::is_same_v<T, float> || std::is_same_v<T, double>))
    return P(std::fma(a.native, b.native, c.native));
  if constexpr (W > native_width<T> &&
                native_width < T >>
                    1) {  // wider than a register (tests only): halves, so that every width rounds alike
    using H = Pack<T, W / 2>;
    P result;
    for (int half = 0; half < 2; ++half) {
      H parts[3];
      std::memcpy(&parts[0], reinterpret_cast<const char*>(&a) + half * static_cast<int>(sizeof(H)), sizeof(H));
      std::memcpy(&parts[1], reinterpret_cast<const char*>(&b) + half * static_cast<int>(sizeof(H)), sizeof(H));
      std::memcpy(&parts[2], reinterpret_cast<const char*>(&c) + half * static_cast<int>(sizeof(H)), sizeof(H));
      const H sum = fma(parts[0], parts[1], parts[2]);
      std::memcpy(reinterpret_cast<char*>(&result) + half * static_cast<int>(sizeof(H)), &sum, sizeof(H));
    }
    return result;
  }
#endif
  return a * b + c;
}
/// c - a b.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> fnma(Pack<T, W> a, Pack<T, W> b, Pack<T, W> c) {
  return fma(-a, b, c);
}

/// The smaller; where a lane of a is NaN, b (the x86 rule, so put the possibly bad value first).
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> min(Pack<T, W> a, Pack<T, W> b) {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
  if constexpr (std::is_same_v<T, float> && W == 16) {
    return Pack<T, W>::from_native(
        (typename Pack<T, W>::Native)_mm512_maskz_min_ps(0xFFFF, (__m512)a.native, (__m512)b.native));
  }
#endif
  return select(a < b, a, b);
}
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> max(Pack<T, W> a, Pack<T, W> b) {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
  if constexpr (std::is_same_v<T, float> && W == 16) {
    return Pack<T, W>::from_native(
        (typename Pack<T, W>::Native)_mm512_maskz_max_ps(0xFFFF, (__m512)a.native, (__m512)b.native));
  }
#endif
  return select(a > b, a, b);
}
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> abs(Pack<T, W> a) {
  return select(a < Pack<T, W>(T{}), -a, a);
}
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> sqrt(Pack<T, W> a) {
  using P = Pack<T, W>;
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
  if constexpr (std::is_same_v<T, float> && W == 16)
    return P::from_native((typename P::Native)_mm512_maskz_sqrt_ps(0xFFFF, (__m512)a.native));
  if constexpr (std::is_same_v<T, double> && W == 8)
    return P::from_native((typename P::Native)_mm512_maskz_sqrt_pd(0xFF, (__m512d)a.native));
#endif
  P result;
  for (int i = 0; i < W; ++i) result.set(i, std::sqrt(a.lane(i)));
  return result;
}

/// Sum of all lanes in a fixed tree: halves are added until one lane is left, so the result depends on W alone.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE T reduce_add(Pack<T, W> a) {
  if constexpr (W == 1) {
    return a.native;
  } else {
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    if constexpr (std::is_same_v<T, float> && W == 16) {
      const __m512 x = (__m512)a.native;
      const __m256 half =
          _mm256_add_ps(_mm512_maskz_extractf32x8_ps(0xFF, x, 0), _mm512_maskz_extractf32x8_ps(0xFF, x, 1));
      return reduce_add(Pack<T, 8>::from_native((typename Pack<T, 8>::Native)half));
    }
#endif
    Pack<T, W / 2> half;
    for (int i = 0; i < W / 2; ++i) half.set(i, a.lane(i) + a.lane(i + W / 2));
    return reduce_add(half);
  }
}

/// 2^n r for integral n given as T, |n| below the exponent range: adds n to the exponent field (r normal, result
/// normal).
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> scale_by_power_of_two(Pack<T, W> r, Pack<T, W> n) {
  using P = Pack<T, W>;
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
  if constexpr (std::is_same_v<T, float> && W == 16) {
    return P::from_native((typename P::Native)_mm512_maskz_scalef_ps(0xFFFF, (__m512)r.native, (__m512)n.native));
  }
  if constexpr (std::is_same_v<T, double> && W == 8) {
    return P::from_native((typename P::Native)_mm512_maskz_scalef_pd(0xFF, (__m512d)r.native, (__m512d)n.native));
  }
#endif
  if constexpr (std::is_same_v<T, float> && W > 1) {
    using Integers = typename detail::LaneStorage<std::int32_t, W>::type;
    const Integers shift = __builtin_convertvector(n.native, Integers) << 23;
    return P::from_native((typename P::Native)((Integers)r.native + shift));
  } else {
    P result;
    for (int i = 0; i < W; ++i) result.set(i, std::ldexp(r.lane(i), static_cast<int>(n.lane(i))));
    return result;
  }
}
/// Nearest integer, ties to even.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> round_to_even(Pack<T, W> a) {
  using P = Pack<T, W>;
#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
  if constexpr (std::is_same_v<T, float> && W == 16) {
    return P::from_native((typename P::Native)_mm512_maskz_roundscale_ps(
        0xFFFF, (__m512)a.native, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC));
  }
#endif
#if defined(__AVX__)
  if constexpr (std::is_same_v<T, float> && W == 8) {
    return P::from_native(
        (typename P::Native)_mm256_round_ps((__m256)a.native, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC));
  }
#endif
  P result;
  for (int i = 0; i < W; ++i) result.set(i, std::nearbyint(a.lane(i)));
  return result;
}

}  // namespace compmark
