// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The inner loop of the integer network: sums of products of 16-bit numbers in 32 bits, for a panel of anchors at once.
// Sums of integers do not depend on their order, so the plain loop, the multiply-add of pairs that x86 has (which no
// compiler finds in the loop; five times faster, measured) and any other way give the same bits. Inputs lie in pairs,
// [channel / 2][lane][2].
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#if defined(__AVX2__) || defined(__SSE2__)
#include <immintrin.h>
#endif

namespace compmark {

/// Anchors that go through the integer network together.
inline constexpr int integer_panel = 16;

namespace detail {

/// sums[r][lane] = sum over 2 `pairs` channels of weight[r][channel] * input[channel][lane], for 4 rows of weights,
/// `stride` apart.
inline void integer_dot(const std::int16_t* weight, std::size_t stride, const std::int16_t* input, std::size_t pairs,
                        std::int32_t (*sums)[integer_panel]) {
#if defined(__AVX512BW__) && defined(__AVX512F__)
  static_assert(integer_panel == 16);
  __m512i sum0 = _mm512_setzero_si512(), sum1 = sum0, sum2 = sum0, sum3 = sum0;
  const auto pair = [&](std::size_t row, std::size_t p) {
    std::int32_t both;
    std::memcpy(&both, weight + row * stride + 2 * p, sizeof(both));
    return _mm512_set1_epi32(both);
  };
  for (std::size_t p = 0; p < pairs; ++p) {
    const __m512i x = _mm512_loadu_si512(input + p * 2 * integer_panel);
    sum0 = _mm512_add_epi32(sum0, _mm512_madd_epi16(x, pair(0, p)));
    sum1 = _mm512_add_epi32(sum1, _mm512_madd_epi16(x, pair(1, p)));
    sum2 = _mm512_add_epi32(sum2, _mm512_madd_epi16(x, pair(2, p)));
    sum3 = _mm512_add_epi32(sum3, _mm512_madd_epi16(x, pair(3, p)));
  }
  _mm512_storeu_si512(sums[0], sum0);
  _mm512_storeu_si512(sums[1], sum1);
  _mm512_storeu_si512(sums[2], sum2);
  _mm512_storeu_si512(sums[3], sum3);
#elif defined(__AVX2__)
  __m256i sum[4][2];
  for (auto& row : sum) row[0] = row[1] = _mm256_setzero_si256();
  for (std::size_t p = 0; p < pairs; ++p) {
    const std::int16_t* const source = input + p * 2 * integer_panel;
    const __m256i low = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(source));
    const __m256i high = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(source + 16));
    for (std::size_t r = 0; r < 4; ++r) {
      std::int32_t both;
      std::memcpy(&both, weight + r * stride + 2 * p, sizeof(both));
      const __m256i w = _mm256_set1_epi32(both);
      sum[r][0] = _mm256_add_epi32(sum[r][0], _mm256_madd_epi16(low, w));
      sum[r][1] = _mm256_add_epi32(sum[r][1], _mm256_madd_epi16(high, w));
    }
  }
  for (std::size_t r = 0; r < 4; ++r) {
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(sums[r]), sum[r][0]);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(sums[r] + 8), sum[r][1]);
  }
#elif defined(__SSE2__)
  for (std::size_t r = 0; r < 4; ++r) {
    __m128i sum[4];
    for (__m128i& part : sum) part = _mm_setzero_si128();
    for (std::size_t p = 0; p < pairs; ++p) {
      std::int32_t both;
      std::memcpy(&both, weight + r * stride + 2 * p, sizeof(both));
      const __m128i w = _mm_set1_epi32(both);
      for (std::size_t part = 0; part < 4; ++part) {
        const __m128i x = _mm_loadu_si128(reinterpret_cast<const __m128i*>(input + p * 2 * integer_panel + 8 * part));
        sum[part] = _mm_add_epi32(sum[part], _mm_madd_epi16(x, w));
      }
    }
    for (std::size_t part = 0; part < 4; ++part) {
      _mm_storeu_si128(reinterpret_cast<__m128i*>(sums[r] + 4 * part), sum[part]);
    }
  }
#else
  for (std::size_t r = 0; r < 4; ++r) {
    for (std::int32_t& sum : sums[r]) sum = 0;
    for (std::size_t p = 0; p < pairs; ++p) {
      const std::int32_t w0 = weight[r * stride + 2 * p], w1 = weight[r * stride + 2 * p + 1];
      const std::int16_t* const x = input + p * 2 * integer_panel;
      for (std::size_t lane = 0; lane < integer_panel; ++lane) sums[r][lane] += w0 * x[2 * lane] + w1 * x[2 * lane + 1];
    }
  }
#endif
}

}  // namespace detail

}  // namespace compmark
