// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Small products against a plain loop, bit for bit: every tile shape, both orientations of A, padded rows, every start
// and finish.
#include "compmark/math/dense.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "support/random_values.hpp"

namespace {

using namespace compmark;
using testing::normals;

constexpr double untouched = 12345.0;

/// a b + c as math/pack.hpp rounds it in this build.
template <class T>
T fused(T a, T b, T c) {
#if defined(__FMA__)
  return std::fma(a, b, c);
#else
  return a * b + c;
#endif
}

template <class T>
struct Operands {
  std::vector<T> a, b, c, bias;

  explicit Operands(const ProductShape& s)
      : a(normals<T>(size(s.rows, s.a_row, s.steps, s.a_step), 1, "dense test")),
        b(normals<T>(size(s.steps, s.b_step, s.columns, 1), 2, "dense test")),
        c(size(s.rows, s.c_row, s.columns, 1) + 16, static_cast<T>(untouched)),
        bias(normals<T>(static_cast<std::size_t>(s.rows), 4, "dense test")) {
    const std::vector<T> before = normals<T>(c.size(), 3, "dense test");
    for (int r = 0; r < s.rows; ++r) {
      for (int i = 0; i < s.columns; ++i) c[at(r * s.c_row + i)] = before[at(r * s.c_row + i)];
    }
  }
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  static std::size_t size(int outer, int outer_stride, int inner, int inner_stride) {
    return outer == 0 || inner == 0 ? 1 : at((outer - 1) * outer_stride + (inner - 1) * inner_stride + 1);
  }

  /// The definition: steps in ascending order.
  template <class Start, class Finish>
  std::vector<T> plain(const ProductShape& s, const Start& start, const Finish& finish) const {
    std::vector<T> result = c;
    for (int r = 0; r < s.rows; ++r) {
      for (int i = 0; i < s.columns; ++i) {
        T sum = start(r, result[at(r * s.c_row + i)]);
        for (int k = 0; k < s.steps; ++k) sum = fused(a[at(r * s.a_row + k * s.a_step)], b[at(k * s.b_step + i)], sum);
        result[at(r * s.c_row + i)] = finish(sum);
      }
    }
    return result;
  }
};

template <class T>
bool same_bits(const std::vector<T>& x, const std::vector<T>& y) {
  using Bits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
  return std::equal(x.begin(), x.end(), y.begin(), y.end(),
                    [](T p, T q) { return std::bit_cast<Bits>(p) == std::bit_cast<Bits>(q); });
}

/// One shape at one width: the whole of C, its padding included.
template <class T, int W, ProductShape shape>
void check_product() {
  INFO(W, " lanes, ", shape.rows, " x ", shape.columns, " x ", shape.steps);
  const auto zero = [](int, T) { return T(0); };
  const auto linear = [](T x) { return x; };
  const Operands<T> operands(shape);
  const T* const a = operands.a.data();
  const T* const b = operands.b.data();

  std::vector<T> c = operands.c;
  product<T, W, shape>(a, b, c.data(), StartZero<T, W>{}, FinishLinear<T, W>{});
  CHECK(same_bits(c, operands.plain(shape, zero, linear)));

  c = operands.c;
  product<T, W, shape>(a, b, c.data(), StartAccumulate<T, W>{}, FinishLinear<T, W>{});
  CHECK(same_bits(c, operands.plain(
                         shape, [](int, T before) { return before; }, linear)));

  c = operands.c;
  product<T, W, shape>(a, b, c.data(), StartBias<T, W>{operands.bias.data()}, FinishRelu<T, W>{});
  const auto bias = [&](int row, T) { return operands.bias[static_cast<std::size_t>(row)]; };
  CHECK(same_bits(c, operands.plain(shape, bias, [](T x) { return x < 0 ? T(0) : x; })));
}
template <class T, ProductShape shape>
void check_widths() {
  check_product<T, 1, shape>();
  check_product<T, 4, shape>();
  if constexpr (shape.columns % native_width<T> == 0 && native_width < T >> 4)
    check_product<T, native_width<T>, shape>();
}

}  // namespace

TEST_CASE_TEMPLATE("math/dense: the bits of a plain loop at every pack width, padding untouched", T, float, double) {
  check_widths<T, ProductShape{1, 16, 1, 1, 1, 16, 16}>();
  check_widths<T, ProductShape{3, 16, 0, 1, 1, 16, 16}>();     // no step: start and finish alone
  check_widths<T, ProductShape{10, 64, 32, 32, 1, 64, 64}>();  // the second layer of the opacity head
  check_widths<T, ProductShape{32, 64, 35, 35, 1, 64, 64}>();  // a first layer
  check_widths<T, ProductShape{25, 48, 7, 9, 1, 50, 53}>();    // three packs at 16 lanes, padded rows, one row over
  check_widths<T, ProductShape{13, 80, 5, 5, 1, 80, 96}>();    // five packs: strips of one
  check_widths<T, ProductShape{37, 32, 11, 1, 37, 32, 32}>();  // A transposed, as weight gradients read it
  check_widths<T, ProductShape{71, 16, 3, 1, 80, 16, 16}>();   // more rows than three tiles
}

TEST_CASE("math/dense: negative control, the comparison sees a sum in another order") {
  constexpr ProductShape shape{4, 16, 35, 35, 1, 16, 16};
  const Operands<float> operands(shape);
  std::vector<float> c = operands.c, backwards = operands.c;
  product<float, 4, shape>(operands.a.data(), operands.b.data(), c.data(), StartZero<float, 4>{},
                           FinishLinear<float, 4>{});
  for (std::size_t r = 0; r < 4; ++r) {
    for (std::size_t i = 0; i < 16; ++i) {
      float sum = 0;
      for (std::size_t k = 35; k-- > 0;) sum = fused(operands.a[r * 35 + k], operands.b[k * 16 + i], sum);
      backwards[r * 16 + i] = sum;
    }
  }
  CHECK(!same_bits(c, backwards));
}

TEST_CASE("math/dense: the error is within steps u sum |a b| of the exact product") {
  constexpr ProductShape shape{20, 32, 64, 64, 1, 32, 32};
  const Operands<float> operands(shape);
  std::vector<float> c = operands.c;
  product<float, native_width<float>, shape>(operands.a.data(), operands.b.data(), c.data(),
                                             StartZero<float, native_width<float>>{},
                                             FinishLinear<float, native_width<float>>{});
  double worst = 0;
  for (std::size_t r = 0; r < 20; ++r) {
    for (std::size_t i = 0; i < 32; ++i) {
      double exact = 0, size = 0;
      for (std::size_t k = 0; k < 64; ++k) {
        const double term = static_cast<double>(operands.a[r * 64 + k]) * static_cast<double>(operands.b[k * 32 + i]);
        exact += term;
        size += std::abs(term);
      }
      worst = std::max(worst, std::abs(static_cast<double>(c[r * 32 + i]) - exact) / size);
    }
  }
  INFO("worst error ", worst, " of sum |a b|");
  CHECK(worst < 65 * std::ldexp(1.0, -24));  // one rounding a step, and the product's own where it is not fused
  CHECK(worst > 0);
}

TEST_CASE("math/dense: with rows and steps of A exchanged it is the adjoint") {
  constexpr ProductShape forward{9, 32, 21, 21, 1, 32, 32}, backward{21, 32, 9, 1, 21, 32, 32};
  const Operands<double> operands(forward);
  const std::vector<double> gradient = normals<double>(9 * 32, 7, "dense test");
  std::vector<double> c(9 * 32), d_b(21 * 32);
  constexpr int W = native_width<double>;
  product<double, W, forward>(operands.a.data(), operands.b.data(), c.data(), StartZero<double, W>{},
                              FinishLinear<double, W>{});
  product<double, W, backward>(operands.a.data(), gradient.data(), d_b.data(), StartZero<double, W>{},
                               FinishLinear<double, W>{});
  double left = 0, right = 0;
  for (std::size_t i = 0; i < c.size(); ++i) left += c[i] * gradient[i];
  for (std::size_t i = 0; i < d_b.size(); ++i) right += d_b[i] * operands.b[i];
  CHECK(left == doctest::Approx(right).epsilon(1e-12));
  CHECK(std::abs(left) > 1);
}

TEST_CASE("math/dense: the rectifier keeps a NaN where std::max would absorb it (ML4)") {
  constexpr int W = native_width<float>;
  constexpr float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  const auto relu = [](float x) { return FinishRelu<float, W>{}(0, 0, Pack<float, W>(x)).lane(W - 1); };
  CHECK(std::isnan(relu(nan)));
  CHECK(relu(-infinity) == 0);
  CHECK(relu(infinity) == infinity);
  CHECK(relu(-1e-45f) == 0);
  CHECK(std::max(0.0f, nan) == 0);  // negative control
}

namespace {

template <class T, int W>
void check_transpose() {
  Pack<T, W> rows[W];
  for (int r = 0; r < W; ++r) rows[r] = Pack<T, W>::ramp(static_cast<T>(100 * r));
  transpose(rows);
  bool right = true;
  for (int r = 0; r < W; ++r) {
    for (int i = 0; i < W; ++i) right = right && rows[r].lane(i) == static_cast<T>(100 * i + r);
  }
  CHECK(right);
}

}  // namespace

TEST_CASE("math/dense: transpose exchanges rows and lanes at every width") {
  check_transpose<float, 1>();
  check_transpose<float, 2>();
  check_transpose<float, 4>();
  check_transpose<float, 8>();
  check_transpose<float, 16>();
  check_transpose<double, 2>();
  check_transpose<double, 4>();
  check_transpose<double, 8>();
}
