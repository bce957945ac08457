// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A number with its derivatives by x and y: what a formula computes on it are its value and its exact 2 x 2 Jacobian at
// once, so that the seventeen lens models need no derivative written by hand. Cost: three times the formula.
#pragma once

#include <cmath>

namespace compmark {
namespace detail {

template <class T>
struct Dual {
  T value{};
  T dx{};
  T dy{};

  constexpr Dual() = default;
  constexpr Dual(T v) : value(v) {}  // NOLINT(google-explicit-constructor): constants mix with numbers
  constexpr Dual(T v, T by_x, T by_y) : value(v), dx(by_x), dy(by_y) {}

  friend constexpr Dual operator+(const Dual& a, const Dual& b) {
    return {a.value + b.value, a.dx + b.dx, a.dy + b.dy};
  }
  friend constexpr Dual operator-(const Dual& a, const Dual& b) {
    return {a.value - b.value, a.dx - b.dx, a.dy - b.dy};
  }
  friend constexpr Dual operator*(const Dual& a, const Dual& b) {
    return {a.value * b.value, a.dx * b.value + a.value * b.dx, a.dy * b.value + a.value * b.dy};
  }
  friend constexpr Dual operator/(const Dual& a, const Dual& b) {
    const T q = a.value / b.value;
    return {q, (a.dx - q * b.dx) / b.value, (a.dy - q * b.dy) / b.value};
  }
  friend Dual sqrt(const Dual& a) {
    const T root = std::sqrt(a.value);
    return {root, a.dx / (T(2) * root), a.dy / (T(2) * root)};
  }
  friend Dual atan(const Dual& a) {
    const T slope = T(1) / (T(1) + a.value * a.value);
    return {std::atan(a.value), a.dx * slope, a.dy * slope};
  }
};

template <class T>
[[nodiscard]] constexpr T value_of(const T& v) {
  return v;
}
template <class T>
[[nodiscard]] constexpr T value_of(const Dual<T>& v) {
  return v.value;
}

}  // namespace detail
}  // namespace compmark
