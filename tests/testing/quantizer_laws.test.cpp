// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/testing/quantizer_laws.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <string>

#include "compmark/splat/quantizer/adaptive_quantizer.hpp"
#include "compmark/splat/quantizer/int8_quantizer.hpp"
#include "compmark/splat/quantizer/uniform_quantizer.hpp"

namespace {

using namespace compmark;

// Negative controls: one law each is broken.
struct Truncating : AdaptiveQuantizer<double> {
  static double symbol(double x, double q) { return std::trunc(x / q); }
  static double value(double x, double q) { return q * symbol(x, q); }
  static double error(double x, double q) { return symbol(x, q) - x / q; }
};
struct WrongSlope : AdaptiveQuantizer<double> {
  static double step_slope(double r, double q0, double least) {
    return 0.5 * AdaptiveQuantizer<double>::step_slope(r, q0, least);
  }
};
struct Unheld : AdaptiveQuantizer<double> {
  static double step(double r, double q0, double /*least*/) { return adaptive_step(r, q0, 0.0); }
};
struct Rising : AdaptiveQuantizer<double> {  // halves go up, so that -x is coded otherwise than x
  static double symbol(double x, double q) { return std::floor(x / q + 0.4); }
  static double value(double x, double q) { return q * symbol(x, q); }
  static double error(double x, double q) { return symbol(x, q) - x / q; }
};

bool names(const std::string& violations, const char* law) { return violations.find(law) != std::string::npos; }

}  // namespace

TEST_CASE("testing/quantizer_laws: hold for the quantizers that a recipe may have") {
  CHECK(testing::quantizer_laws<AdaptiveQuantizer<double>>() == "");
  CHECK(testing::quantizer_laws<UniformQuantizer<double>>() == "");
  CHECK(testing::quantizer_laws<Int8Quantizer<double>>() == "");
}

TEST_CASE("testing/quantizer_laws: each law is seen to be broken") {
  CHECK(names(testing::quantizer_laws<Truncating>(), "Q3"));
  CHECK(names(testing::quantizer_laws<WrongSlope>(), "Q2"));
  CHECK(names(testing::quantizer_laws<Unheld>(), "Q1"));
  CHECK(names(testing::quantizer_laws<Rising>(), "Q4"));
}
