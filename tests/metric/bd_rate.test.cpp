// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/metric/bd_rate.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace compmark;
using Curve = std::vector<RatePoint>;

/// Two encoders on one video, kbit/s and dB: curves that are published to try implementations with.
const Curve first_a = {{9487.76, 40.037}, {4593.60, 38.615}, {2486.44, 36.845}, {1358.24, 34.851}};
const Curve first_b = {{9787.80, 40.121}, {4469.00, 38.651}, {2451.52, 36.970}, {1356.24, 34.987}};
const Curve second_a = {{686.76, 40.28}, {309.58, 37.18}, {157.11, 34.24}, {85.95, 31.42}};
const Curve second_b = {{893.34, 40.39}, {407.8, 37.21}, {204.93, 34.17}, {112.75, 31.24}};
const Curve x264 = {{9.525, 37.73}, {14.27, 39.07}, {19.113, 40.07}, {24.393, 40.95}};
const Curve x265 = {{8.914, 37.02}, {13.33, 38.37}, {17.88, 39.42}, {22.99, 40.35}};

/// The definition of 2001: one cubic through four points each, log(rate) over quality.
double one_cubic_each(const Curve& reference, const Curve& test) {
  const auto log_rate = [](const Curve& curve, double quality) {
    double sum = 0;
    for (std::size_t i = 0; i < curve.size(); ++i) {
      double term = std::log(curve[i].rate);
      for (std::size_t j = 0; j < curve.size(); ++j)
        term *= i == j ? 1 : (quality - curve[j].quality) / (curve[i].quality - curve[j].quality);
      sum += term;
    }
    return sum;
  };
  double from = -1e9, to = 1e9;
  for (const Curve* curve : {&reference, &test}) {
    double least = 1e9, most = -1e9;
    for (const RatePoint& point : *curve) {
      least = std::min(least, point.quality);
      most = std::max(most, point.quality);
    }
    from = std::max(from, least);
    to = std::min(to, most);
  }
  const auto difference = [&](double quality) { return log_rate(test, quality) - log_rate(reference, quality); };
  // Simpson's rule is exact for cubics.
  return std::expm1((difference(from) + 4 * difference((from + to) / 2) + difference(to)) / 6);
}

double rate_delta(const Curve& a, const Curve& b) {
  const Result<BdDelta> found = bd_rate(a, b);
  REQUIRE(found.ok());
  return found->delta;
}

}  // namespace

TEST_CASE("metric/bd_rate: published curves, with the monotone cubics of another program (SciPy 1.10.1)") {
  struct Known {
    const Curve *a, *b;
    double rate, quality;
  };
  for (const Known& known : {Known{&first_a, &first_b, -0.04417485350588976, 0.11969278542479912},
                             Known{&second_a, &second_b, 0.3137987820239764, -1.1834724046224563},
                             Known{&x264, &x265, 0.13731411019696715, -0.44739524912190126}}) {
    CHECK(rate_delta(*known.a, *known.b) == doctest::Approx(known.rate).epsilon(1e-12));
    const Result<BdDelta> quality = bd_quality(*known.a, *known.b);
    REQUIRE(quality.ok());
    CHECK(quality->delta == doctest::Approx(known.quality).epsilon(1e-12));
  }
  // What is published for the last with one cubic each: -12.098 %. The monotone cubics are .03 points from it.
  CHECK(100 * one_cubic_each(x265, x264) == doctest::Approx(-12.098).epsilon(0.0005 / 12));
  CHECK(std::abs(rate_delta(x265, x264) - one_cubic_each(x265, x264)) < 5e-4);
}

TEST_CASE("metric/bd_rate: the same curve is 0, a fifth fewer bytes -20 %, and who is better is worse the other way") {
  CHECK(rate_delta(first_a, first_a) == 0);
  Curve cheaper = second_a, better = second_a;
  for (RatePoint& point : cheaper) point.rate *= 0.8;
  for (RatePoint& point : better) point.quality += 0.5;
  CHECK(rate_delta(second_a, cheaper) == doctest::Approx(-0.2).epsilon(1e-12));
  CHECK(bd_quality(second_a, better)->delta == doctest::Approx(0.5).epsilon(1e-12));
  CHECK((1 + rate_delta(first_a, first_b)) * (1 + rate_delta(first_b, first_a)) == doctest::Approx(1).epsilon(1e-12));
  // In any unit, from points in any order.
  Curve bytes = first_a, turned(first_b.rbegin(), first_b.rend());
  for (RatePoint& point : bytes) point.rate *= 125;
  for (RatePoint& point : turned) point.rate *= 125;
  CHECK(rate_delta(bytes, turned) == doctest::Approx(rate_delta(first_a, first_b)).epsilon(1e-12));
  // The mean is over what both reach.
  const Result<BdDelta> found = bd_rate(first_a, first_b);
  CHECK(found->from == 34.987);
  CHECK(found->to == 40.037);
  CHECK(bd_quality(first_a, first_b)->to == doctest::Approx(9487.76).epsilon(1e-12));
}

TEST_CASE(
    "metric/bd_rate: where points bend, one cubic swings by tens of percent where every point is a fifth cheaper") {
  // A codec that stops gaining: the cubic through the reference turns back and counts rates that nobody measured.
  const Curve reference = {{100, 30}, {110, 34}, {1000, 34.5}, {1100, 38}};
  const Curve test = {{80, 30.2}, {90, 33.8}, {780, 34.6}, {870, 38.1}};
  const double monotone = rate_delta(reference, test), cubic = one_cubic_each(reference, test);
  MESSAGE(monotone, " ", cubic);
  CHECK(monotone > -0.35);
  CHECK(monotone < -0.15);
  CHECK((cubic < -0.35 || cubic > -0.15));  // negative control
}

TEST_CASE("metric/bd_rate: what is no curve is refused in a sentence") {
  const auto refused = [](const Curve& a, const Curve& b, const char* text) {
    const Result<BdDelta> found = bd_rate(a, b);
    REQUIRE_FALSE(found.ok());
    INFO(found.error().line());
    CHECK(found.error().line().find(text) != std::string::npos);
  };
  refused({{100, 30}}, first_a, "reference curve: has fewer than two points");
  refused(first_a, {}, "tested curve");
  refused(first_a, {{100, 30}, {0, 29}}, "not above 0");
  refused(first_a, {{100, 30}, {200, std::numeric_limits<double>::quiet_NaN()}}, "not finite");
  refused(first_a, {{100, 30}, {200, 29}}, "quality 29.000000 at a rate of 200.000000");
  refused(first_a, {{100, 30}, {100, 31}}, "does not rise");
  refused(first_a, {{100, 20}, {200, 21}}, "no quality");
  const Result<BdDelta> apart = bd_quality(first_a, Curve{{1, 35}, {2, 36}});
  REQUIRE_FALSE(apart.ok());
  CHECK(apart.error().line().find("no rate in common") != std::string::npos);
  CHECK_FALSE(bd_quality(Curve{{1e17, 30}, {std::nextafter(1e17, 1e18), 31}}, first_a).ok());  // one logarithm
}
