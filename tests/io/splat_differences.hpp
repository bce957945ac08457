// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// How far two tables of splats are from one another, and whether a format keeps to its own rounding: for the tests of
// readers and writers.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "compmark/io/splat/read_splat.hpp"
#include "io/splat_writers.hpp"

namespace compmark::testing::splats {

/// Largest differences of two tables, each in the units that its bound is stated in.
struct Differences {
  double mean = 0, log_scale = 0, color = 0, opacity = 0, harmonics = 0;  ///< colour and opacity in [0, 1]
  double smallest_three = 0;  ///< of a rotation's components beside the largest
  double rotation = 0;        ///< |q - r| or |q + r|, the smaller
};
inline Differences differences(const SplatTable& a, const SplatTable& b) {
  REQUIRE(a.count == b.count);
  REQUIRE(a.degree == b.degree);
  Differences most;
  const auto raise = [](double& value, double to) { value = std::max(value, std::abs(to)); };
  for (std::size_t row = 0; row < a.count; ++row) {
    const auto d = [row](const std::vector<float>& x, const std::vector<float>& y) {
      return static_cast<double>(x[row]) - static_cast<double>(y[row]);
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      raise(most.mean, d(a.mean[axis], b.mean[axis]));
      raise(most.log_scale, d(a.log_scale[axis], b.log_scale[axis]));
      raise(most.color, color_of_dc(a.color(axis, 0)[row]) - color_of_dc(b.color(axis, 0)[row]));
      for (std::size_t k = 1; k < a.coefficients(); ++k) raise(most.harmonics, d(a.color(axis, k), b.color(axis, k)));
    }
    raise(most.opacity, sigmoid(a.opacity[row]) - sigmoid(b.opacity[row]));
    const std::array<double, 4> p = rotation_of(a, row), q = rotation_of(b, row);
    double plus = 0, minus = 0, norm = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      plus += (p[k] + q[k]) * (p[k] + q[k]);
      minus += (p[k] - q[k]) * (p[k] - q[k]);
      norm += q[k] * q[k];
    }
    CHECK(std::abs(norm - 1) < 1e-6);
    raise(most.rotation, std::sqrt(std::min(plus, minus)));
    const SmallestThree three = smallest_three(p);
    for (std::size_t k = 0, n = 0; k < 4; ++k) {
      if (k != three.largest)
        raise(most.smallest_three,
              three.others[n++] - (plus < minus ? -1 : 1) * (p[three.largest] < 0 ? -1 : 1) * q[k]);
    }
  }
  return most;
}

/// Bounds from the bits of a format; 0: not rounded beyond a float's own, 1e-6 relative here.
struct Rounding {
  double mean = 0, log_scale = 0, color = 0, opacity = 0, harmonics = 0, smallest_three = 0, rotation = 0;
};
inline constexpr double float_slack = 2e-6;  // of numbers up to 8, or of their logarithms

/// All are within the bounds; and of a file with one bit less, every rounded quantity beyond its own.
template <class Write>
void check_rounding(const std::string& name, const SplatTable& table, const Rounding& bound, const Write& write) {
  INFO(name);
  const Result<SplatFile> read = parse_splat(write(0), name);
  REQUIRE_MESSAGE(read.ok(), read.error().line());
  const Result<SplatFile> coarse = parse_splat(write(1), name);
  REQUIRE_MESSAGE(coarse.ok(), coarse.error().line());
  const Differences fine = differences(table, read->table), less = differences(table, coarse->table);
  const auto check = [&](const char* what, double bound_of, double found, double found_coarse) {
    INFO(what << ": " << found << " and with a bit less " << found_coarse << ", bound " << bound_of);
    CHECK(found <= bound_of + float_slack);
    if (bound_of > 0) CHECK(found_coarse > bound_of + float_slack);  // negative control
  };
  check("mean", bound.mean, fine.mean, less.mean);
  check("log scale", bound.log_scale, fine.log_scale, less.log_scale);
  check("colour", bound.color, fine.color, less.color);
  check("opacity", bound.opacity, fine.opacity, less.opacity);
  if (table.degree > 0) check("harmonics", bound.harmonics, fine.harmonics, less.harmonics);
  if (bound.rotation > 0) {
    check("rotation", bound.rotation, fine.rotation, less.rotation);
  } else {
    check("smallest three", bound.smallest_three, fine.smallest_three, less.smallest_three);
  }
}

}  // namespace compmark::testing::splats
