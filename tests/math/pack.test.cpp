// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
// Widths beyond this build's registers are tested too; their calling convention does not matter, everything is inlined.
#pragma GCC diagnostic ignored "-Wpsabi"

#include "compmark/math/pack.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

template <class T, int W>
struct Lanes {
  using Scalar = T;
  static constexpr int width = W;
};

#define COMPMARK_TEST_PACKS                                                                                \
  Lanes<float, 1>, Lanes<float, 4>, Lanes<float, 8>, Lanes<float, 16>, Lanes<double, 1>, Lanes<double, 2>, \
      Lanes<double, 4>, Lanes<double, 8>, Lanes<long double, 1>

/// Values with signs, zeros, ties and wide exponents.
template <class T>
T sample(std::uint64_t i) {
  const Random random(8, 0, random_stage("pack"));
  switch (i % 7) {
    case 0:
      return static_cast<T>(random.below(i, 9)) - T(4);
    case 1:
      return (static_cast<T>(random.below(i, 9)) - T(4)) / 2;
    default:
      return static_cast<T>((random.uniform(i) - 0.5) *
                            std::exp2(static_cast<double>(random.below(i + 1000000, 40)) - 20));
  }
}

TEST_CASE_TEMPLATE("math/pack: every lane does what the scalar does", L, COMPMARK_TEST_PACKS) {
  using T = typename L::Scalar;
  constexpr int W = L::width;
  using P = Pack<T, W>;
  std::size_t wrong = 0;
  for (std::uint64_t round = 0; round < 200; ++round) {
    std::array<T, W> a, b, c, out;
    for (std::size_t i = 0; i < W; ++i) {
      a[i] = sample<T>(round * 64 + i);
      b[i] = sample<T>(round * 64 + i + 16);
      c[i] = sample<T>(round * 64 + i + 32);
    }
    const P pa = P::load(a.data()), pb = P::load(b.data()), pc = P::load(c.data());
    const auto compare = [&](P pack, const auto& scalar) {
      pack.store(out.data());
      for (std::size_t i = 0; i < W; ++i)
        wrong += out[i] == scalar(i) && pack.lane(static_cast<int>(i)) == out[i] ? 0 : 1;
    };
    compare(pa + pb, [&](std::size_t i) { return a[i] + b[i]; });
    compare(pa - pb, [&](std::size_t i) { return a[i] - b[i]; });
    compare(pa * pb, [&](std::size_t i) { return a[i] * b[i]; });
    compare(-pa, [&](std::size_t i) { return -a[i]; });
    compare(abs(pa), [&](std::size_t i) { return std::abs(a[i]); });
    compare(sqrt(abs(pa)), [&](std::size_t i) { return std::sqrt(std::abs(a[i])); });
    compare(min(pa, pb), [&](std::size_t i) { return std::min(a[i], b[i]); });
    compare(max(pa, pb), [&](std::size_t i) { return std::max(a[i], b[i]); });
    compare(round_to_even(pa), [&](std::size_t i) { return std::nearbyint(a[i]); });
    compare(select(pa < pb, pa, pb), [&](std::size_t i) { return a[i] < b[i] ? a[i] : b[i]; });
    compare(keep(pa >= pb, pa), [&](std::size_t i) { return a[i] >= b[i] ? a[i] : T(0); });
    if (std::all_of(b.begin(), b.end(), [](T v) { return v != 0; }))
      compare(pa / pb, [&](std::size_t i) { return a[i] / b[i]; });
    for (std::size_t i = 0; i < W; ++i) {
      const int lane = static_cast<int>(i);
      wrong += (pa < pb).lane(lane) == (a[i] < b[i]) && (pa <= pb).lane(lane) == (a[i] <= b[i]) &&
                       (pa > pb).lane(lane) == (a[i] > b[i]) && (pa >= pb).lane(lane) == (a[i] >= b[i]) &&
                       (pa == pb).lane(lane) == (a[i] == b[i])
                   ? 0
                   : 1;
      // Fused where the build fuses, else two roundings: both within one rounding of the product.
      const T sum = fma(pa, pb, pc).lane(lane);
      const long double exact =
          static_cast<long double>(a[i]) * static_cast<long double>(b[i]) + static_cast<long double>(c[i]);
      const long double unit = std::numeric_limits<T>::epsilon();
      const long double bound =
          unit * (std::abs(static_cast<long double>(a[i]) * static_cast<long double>(b[i])) + std::abs(exact));
      wrong += std::abs(static_cast<long double>(sum) - exact) <= bound ? 0 : 1;
      wrong += fnma(pa, pb, pc).lane(lane) == fma(-pa, pb, pc).lane(lane) ? 0 : 1;
    }
  }
  CHECK(wrong == 0);
}

#if defined(__FMA__)
TEST_CASE("math/pack: fma has one rounding at every production width") {
  const float a = 1 + 0x1p-12f;
  const double b = 1 + 0x1p-30;
  CHECK(fma(Pack<float, 16>(a), Pack<float, 16>(a), Pack<float, 16>(-1)).lane(3) == std::fma(a, a, -1.0f));
  CHECK(fma(Pack<float, 8>(a), Pack<float, 8>(a), Pack<float, 8>(-1)).lane(3) == std::fma(a, a, -1.0f));
  CHECK(fma(Pack<float, 4>(a), Pack<float, 4>(a), Pack<float, 4>(-1)).lane(3) == std::fma(a, a, -1.0f));
  CHECK(fma(Pack<float, 1>(a), Pack<float, 1>(a), Pack<float, 1>(-1)).lane(0) == std::fma(a, a, -1.0f));
  CHECK(fma(Pack<double>(b), Pack<double>(b), Pack<double>(-1.0)).lane(0) == std::fma(b, b, -1.0));
  CHECK(std::fma(a, a, -1.0f) != 0x1p-11f);  // two roundings would give this
}
#endif

TEST_CASE_TEMPLATE("math/pack: masks, masked loads and stores", L, COMPMARK_TEST_PACKS) {
  using T = typename L::Scalar;
  constexpr int W = L::width;
  using P = Pack<T, W>;
  using M = Mask<T, W>;
  const unsigned full = (1u << W) - 1u;
  CHECK(M::first(-3).bits() == 0);
  CHECK(M::first(0).bits() == 0);
  CHECK(M::first(W).bits() == full);
  CHECK(M::first(W + 5).bits() == full);
  CHECK(all(M::first(W)));
  CHECK(!any(M::first(0)));
  std::array<T, W> values;
  for (std::size_t i = 0; i < W; ++i) values[i] = static_cast<T>(i + 1);
  std::size_t wrong = 0;
  for (unsigned trial = 0; trial < 64; ++trial) {
    const unsigned bits = static_cast<unsigned>(mix_bits(trial)) & full;
    const M mask = M::from_bits(bits);
    wrong += mask.bits() == bits && (!mask).bits() == (full & ~bits) && count(mask) == __builtin_popcount(bits) ? 0 : 1;
    const M other = M::first(W / 2);
    wrong += (mask & other).bits() == (bits & other.bits()) && (mask | other).bits() == (bits | other.bits()) ? 0 : 1;
    const P loaded = P::load(values.data(), mask);
    std::array<T, W> target;
    target.fill(T(-9));
    loaded.store(target.data(), mask);
    std::array<T, 2 * W> packed;
    const int n = loaded.compress_store(packed.data(), mask);
    wrong += n == count(mask) ? 0 : 1;
    const P spread = P::expand_load(packed.data(), mask);
    int seen = 0;
    for (int i = 0; i < W; ++i) {
      const bool on = (bits >> i & 1u) != 0;
      const std::size_t at = static_cast<std::size_t>(i);
      // Three statements: g++ 12 -O2 compiles the three conditions joined by && wrongly (a bit test loses its partner).
      wrong += mask.lane(i) != on ? 1 : 0;
      wrong += loaded.lane(i) != (on ? values[at] : T(0)) ? 1 : 0;
      wrong += target[at] != (on ? values[at] : T(-9)) ? 1 : 0;
      wrong += spread.lane(i) == loaded.lane(i) ? 0 : 1;
      if (on) wrong += packed[static_cast<std::size_t>(seen++)] == values[at] ? 0 : 1;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE_TEMPLATE("math/pack: gather, ramp, powers of two, sums", L, COMPMARK_TEST_PACKS) {
  using T = typename L::Scalar;
  constexpr int W = L::width;
  using P = Pack<T, W>;
  std::array<T, 100> table;
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = sample<T>(i);
  alignas(64) std::array<std::int32_t, 16> index;
  for (std::size_t i = 0; i < index.size(); ++i) index[i] = static_cast<std::int32_t>((i * 37 + 5) % 100);
  const P gathered = P::gather(table.data(), index.data());
  const P ramp = P::ramp(T(3));
  const P powers = P::ramp(T(-W / 2));
  const P scaled = scale_by_power_of_two(P(T(1.25)), powers);
  std::size_t wrong = 0;
  for (int i = 0; i < W; ++i) {
    wrong += gathered.lane(i) == table[static_cast<std::size_t>(index[static_cast<std::size_t>(i)])] ? 0 : 1;
    wrong += ramp.lane(i) == static_cast<T>(3 + i) ? 0 : 1;
    wrong += scaled.lane(i) == std::ldexp(T(1.25), i - W / 2) ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK(reduce_add(ramp) == static_cast<T>(3 * W + W * (W - 1) / 2));
  // The tree of halves: what the same tree in scalars gives, to the bit.
  std::array<T, W> leaves;
  gathered.store(leaves.data());
  for (std::size_t half = W / 2; half > 0; half /= 2) {
    for (std::size_t i = 0; i < half; ++i) leaves[i] += leaves[i + half];
  }
  CHECK(reduce_add(gathered) == leaves[0]);
}

TEST_CASE_TEMPLATE("math/pack: NaN: comparisons are false, min and max take the second argument", L,
                   COMPMARK_TEST_PACKS) {
  using T = typename L::Scalar;
  using P = Pack<T, L::width>;
  const P nan(std::numeric_limits<T>::quiet_NaN());
  const P one(T(1));
  CHECK(!any(nan < one));
  CHECK(!any(nan <= one));
  CHECK(!any(nan > one));
  CHECK(!any(nan >= one));
  CHECK(!any(nan == nan));
  CHECK(all(min(nan, one) == one));
  CHECK(all(max(nan, one) == one));
  CHECK(!any(min(one, nan) == one));
}

TEST_CASE("math/pack: rounding breaks ties to even") {
  for (const float x : {-2.5f, -1.5f, -0.5f, 0.5f, 1.5f, 2.5f, 8388607.5f}) {
    CHECK(round_to_even(Pack<float, 16>(x)).lane(0) == std::nearbyint(x));
    CHECK(round_to_even(Pack<float, 8>(x)).lane(0) == std::nearbyint(x));
    CHECK(round_to_even(Pack<float, 1>(x)).lane(0) == std::nearbyint(x));
  }
}

}  // namespace
