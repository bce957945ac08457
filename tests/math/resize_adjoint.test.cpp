// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/resize_adjoint.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "math/random_plane.hpp"

namespace {

using namespace compmark;
using testing::random_plane;

std::vector<double> resized(const std::vector<double>& x, int h, int w, int to_h, int to_w) {
  const TriangleResize<double> resize(h, w, to_h, to_w);
  TriangleResize<double>::Context context;
  SerialExecutor executor;
  std::vector<double> y(static_cast<std::size_t>(to_h * to_w), -7.0);
  resize.apply(x.data(), y.data(), context, executor);
  return y;
}

TEST_CASE(
    "math/resize_adjoint: dot test for growing, shrinking, both and neither; a wrong pair of operators fails it") {
  for (const std::array<int, 4>& s : std::vector<std::array<int, 4>>{{5, 7, 5, 7},
                                                                     {5, 7, 16, 16},
                                                                     {31, 40, 16, 16},
                                                                     {9, 40, 16, 11},
                                                                     {1, 1, 6, 4},
                                                                     {23, 17, 1, 1},
                                                                     {64, 3, 10, 64}}) {
    const std::vector<double> x = random_plane<double>(s[0], s[1], 1), v = random_plane<double>(s[2], s[3], 2);
    const std::vector<double> y = resized(x, s[0], s[1], s[2], s[3]);
    const TriangleResize<double> resize(s[0], s[1], s[2], s[3]);
    TriangleResize<double>::Context context;
    SerialExecutor executor;
    std::vector<double> back(x.size(), -7.0);
    resize.apply_adjoint(v.data(), back.data(), context, executor);
    const auto dot = [](const std::vector<double>& a, const std::vector<double>& b) {
      double sum = 0;
      for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
      return sum;
    };
    const double size = std::sqrt(dot(y, y) * dot(v, v));
    CHECK(std::abs(dot(y, v) - dot(x, back)) <= 1e-14 * size);
    // control: resizing back is not the adjoint
    if (s[0] != s[2] && x.size() > 1)
      CHECK(std::abs(dot(y, v) - dot(x, resized(v, s[2], s[3], s[0], s[1]))) > 1e-6 * size);
  }
}

TEST_CASE(
    "math/resize_adjoint: same size is the identity, constants stay, halving a line of a ramp and doubling it by "
    "hand") {
  const std::vector<double> x = random_plane<double>(5, 6, 3);
  CHECK(resized(x, 5, 6, 5, 6) == x);
  for (const double v : resized(std::vector<double>(30, 0.3), 5, 6, 13, 4))
    CHECK(v == doctest::Approx(0.3).epsilon(1e-15));
  // doubling: half-pixel centres, so 3/4 and 1/4, the border repeated
  const std::vector<double> doubled = resized({0.0, 4.0}, 1, 2, 1, 4);
  CHECK(doubled == std::vector<double>{0, 1, 3, 4});
  // halving: triangle over four samples, weights 1 3 3 1; at the border the part outside is dropped, (3 3 1) / 7
  const std::vector<double> halved = resized({0.0, 7.0, 14.0, 21.0, 28.0, 35.0}, 1, 6, 1, 3);
  CHECK(halved[0] == doctest::Approx((3 * 7 + 14) / 7.0));
  CHECK(halved[1] == doctest::Approx(17.5));
  CHECK(halved[2] == doctest::Approx((21 + 3 * 28 + 3 * 35) / 7.0));
}

TEST_CASE("math/resize_adjoint: shrinking averages a checkerboard away; sampling without antialiasing would not") {
  std::vector<double> board;
  for (int i = 0; i < 32 * 32; ++i) board.push_back((i / 32 + i % 32) % 2);
  double worst = 0;
  const std::vector<double> small = resized(board, 32, 32, 8, 8);
  for (int i = 9; i < 54; ++i) {
    if (i % 8 != 0 && i % 8 != 7) worst = std::max(worst, std::abs(small[static_cast<std::size_t>(i)] - 0.5));
  }
  CHECK(worst < 1e-12);
}

TEST_CASE("math/resize_adjoint: float, same bits at any thread count, close to double") {
  const TriangleResize<float> resize(40, 41, 102, 103);
  const std::vector<double> exact_input = random_plane<double>(40, 41, 5);
  const std::vector<float> x(exact_input.begin(), exact_input.end());
  std::vector<float> first(102 * 103), second(102 * 103);
  TriangleResize<float>::Context context;
  SerialExecutor serial;
  ThreadExecutor threads(3);
  resize.apply(x.data(), first.data(), context, serial);
  resize.apply(x.data(), second.data(), context, threads);
  CHECK(first == second);
  const std::vector<double> exact = resized(std::vector<double>(x.begin(), x.end()), 40, 41, 102, 103);
  double error = 0;
  for (std::size_t i = 0; i < exact.size(); ++i)
    error = std::max(error, std::abs(exact[i] - static_cast<double>(first[i])));
  CHECK(error < 1.5e-7);
}

}  // namespace
