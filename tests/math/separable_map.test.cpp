// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/separable_map.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "support/random_values.hpp"

using namespace compmark;
using testing::normals;

namespace {

using Table = RunTable<double>;

std::vector<std::pair<const char*, SeparableMap<double>>> maps(int height, int width) {
  return {{"resize down", {Table::resize(height, height * 3 / 4), Table::resize(width, width * 2 / 3)}},
          {"resize up", {Table::resize(height, height + 5), Table::resize(width, width * 2)}},
          {"crop", {Table::crop(height, 2, height - 5), Table::crop(width, 3, width - 4)}},
          {"blur", {Table::gaussian(height, 1.3), Table::gaussian(width, 0.8)}},
          {"wide blur", {Table::gaussian(height, 3 * height), Table::gaussian(width, 2 * width)}},
          {"blur at every fourth", {Table::gaussian(height, 2, 4), Table::gaussian(width, 2, 4)}}};
}

}  // namespace

TEST_CASE("math/separable_map: the transpose is the adjoint, at any number of threads") {
  for (const auto& named : maps(17, 23)) {
    const auto& name = named.first;
    const auto& map = named.second;
    CAPTURE(name);
    const std::vector<double> x = normals<double>(3 * 17 * 23, 1, "test/separable_map");
    const std::size_t places = static_cast<std::size_t>(map.height()) * static_cast<std::size_t>(map.width());
    const std::vector<double> g = normals<double>(3 * places, 2, "test/separable_map");
    std::vector<double> out(3 * places), again(3 * places), back(x.size(), 0.5), back_again(x.size(), 0.5);
    PerWorkerRows<double> scratch;
    SerialExecutor serial;
    ThreadExecutor threads(3);
    map.apply({x.data(), 3, 17, 23}, {out.data(), 3, map.height(), map.width()}, scratch, serial);
    map.apply({x.data(), 3, 17, 23}, {again.data(), 3, map.height(), map.width()}, scratch, threads);
    map.add_transposed({g.data(), 3, map.height(), map.width()}, {back.data(), 3, 17, 23}, scratch, serial);
    map.add_transposed({g.data(), 3, map.height(), map.width()}, {back_again.data(), 3, 17, 23}, scratch, threads);
    CHECK(out == again);
    CHECK(back == back_again);
    double forward = 0, backward = 0;
    for (std::size_t i = 0; i < out.size(); ++i) forward += out[i] * g[i];
    for (std::size_t i = 0; i < x.size(); ++i) backward += x[i] * (back[i] - 0.5);
    CHECK(forward == doctest::Approx(backward).epsilon(1e-12));
  }
}

TEST_CASE("math/separable_map: a constant image stays constant up to its border") {
  for (const auto& named : maps(16, 12)) {
    const auto& name = named.first;
    const auto& map = named.second;
    CAPTURE(name);
    const std::vector<double> x(3 * 16 * 12, 0.75);
    std::vector<double> out(3 * static_cast<std::size_t>(map.height()) * static_cast<std::size_t>(map.width()));
    PerWorkerRows<double> scratch;
    SerialExecutor serial;
    map.apply({x.data(), 3, 16, 12}, {out.data(), 3, map.height(), map.width()}, scratch, serial);
    double worst = 0;
    for (const double value : out) worst = std::max(worst, std::abs(value - 0.75));
    CHECK(worst < 1e-14);
  }
}

TEST_CASE("math/separable_map: a blur of a tenth of a pixel changes no bit in float, one of half a pixel does (FR8)") {
  const auto blurred = [](double sigma, const std::vector<float>& x) {
    const SeparableMap<float> map{RunTable<float>::gaussian(16, sigma), RunTable<float>::gaussian(12, sigma)};
    std::vector<float> out(x.size());
    PerWorkerRows<float> scratch;
    SerialExecutor serial;
    map.apply({x.data(), 3, 16, 12}, {out.data(), 3, 16, 12}, scratch, serial);
    return out;
  };
  std::vector<float> x;
  for (int i = 0; i < 3 * 16 * 12; ++i) x.push_back(0.5f + 0.5f * std::sin(static_cast<float>(i)));
  CHECK(blurred(0.1, x) == x);
  CHECK(blurred(0.5, x) != x);  // negative control
}

TEST_CASE("math/separable_map: closed forms") {
  const Table half = Table::resize(8, 4);  // a triangle of width 2 around 0.5, 2.5, ...: (1, 3, 3, 1) / 8
  CHECK(half.output() == 4);
  PerWorkerRows<double> scratch;
  SerialExecutor serial;
  std::vector<double> impulse(8, 0.0), out(4);
  impulse[2] = 1;
  const SeparableMap<double> map{Table::crop(1, 0, 1), half};
  map.apply({impulse.data(), 1, 1, 8}, {out.data(), 1, 1, 4}, scratch, serial);
  CHECK(out[0] == doctest::Approx(0.125));
  CHECK(out[1] == doctest::Approx(0.375));
  CHECK(out[2] == doctest::Approx(0));
  const Table mirrored = Table::gaussian(9, 1);  // place 1 is also its own mirror image across place 0
  const double a = std::exp(-0.5), b = std::exp(-2.0), c = std::exp(-4.5), sum = 1 + 2 * (a + b + c);
  CHECK(mirrored.weight[0] == doctest::Approx(1 / sum));
  CHECK(mirrored.weight[1] == doctest::Approx(2 * a / sum));
}

TEST_CASE("math/separable_map: places side by side are those of places one by one") {
  constexpr int height = 19, width = 150;
  const std::vector<double> x = normals<double>(3 * height * width, 3, "test/separable_map");
  const auto farthest = [](const std::vector<double>& a, const std::vector<double>& b) {
    double most = 0;
    for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
    return most;
  };
  int wide = 0;
  for (const auto& named : maps(height, width)) {
    const auto& name = named.first;
    const SeparableMap<double>& map = named.second;
    CAPTURE(name);
    SeparableMap<double> single = map;  // nothing is alike
    single.horizontal.alike_begin = single.horizontal.alike_end = 0;
    wide += map.horizontal.alike_end - map.horizontal.alike_begin > width / 2 ? 1 : 0;
    const int out_height = map.height(), out_width = map.width();
    const std::size_t places = 3 * static_cast<std::size_t>(out_height) * static_cast<std::size_t>(out_width);
    const std::vector<double> g = normals<double>(places, 4, "test/separable_map");
    std::vector<double> out(places), expected(places), back(x.size(), 0.5), expected_back(x.size(), 0.5);
    PerWorkerRows<double> scratch;
    SerialExecutor serial;
    map.apply({x.data(), 3, height, width}, {out.data(), 3, out_height, out_width}, scratch, serial);
    single.apply({x.data(), 3, height, width}, {expected.data(), 3, out_height, out_width}, scratch, serial);
    map.add_transposed({g.data(), 3, out_height, out_width}, {back.data(), 3, height, width}, scratch, serial);
    single.add_transposed({g.data(), 3, out_height, out_width}, {expected_back.data(), 3, height, width}, scratch,
                          serial);
    // Where the compiler contracts a product and a sum in one loop and not in the other, a term is rounded once more:
    // at most a few taps that count, values of up to 4, an ulp each. Measured: 2.2e-16.
    CHECK(farthest(out, expected) < 4e-15);
    CHECK(farthest(back, expected_back) < 4e-15);
    if (map.horizontal.alike_end - map.horizontal.alike_begin < 2) continue;
    // Negative control: a range that is one place too long, at an output of other weights, is seen.
    SeparableMap<double> wrong = map;
    if (wrong.horizontal.alike_begin > 0) --wrong.horizontal.alike_begin;
    if (wrong.horizontal.alike_begin == map.horizontal.alike_begin) continue;
    wrong.apply({x.data(), 3, height, width}, {out.data(), 3, out_height, out_width}, scratch, serial);
    CHECK(farthest(out, expected) > 1e-6);
  }
  CHECK(wide >= 2);  // crop and blur
}
