// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/rate/factorised_prior.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;

constexpr int prior_channels = 3;
constexpr std::size_t prior_anchors = 16;

/// c(z) of a channel as docs/spec/compression.md, 2.2, writes it, from the raw scalars.
long double cumulative_logit(const double* raw, long double z) {
  const auto softplus = [](double x) { return std::log1p(std::exp(static_cast<long double>(x))); };
  std::vector<long double> x{z};
  const int widths[] = {1, 3, 3, 3, 3, 1};
  for (int layer = 0; layer < 5; ++layer) {
    const int in = widths[layer], out = widths[layer + 1];
    std::vector<long double> y(static_cast<std::size_t>(out));
    for (int j = 0; j < out; ++j) {
      long double sum = raw[in * out + j];
      for (int k = 0; k < in; ++k) sum += softplus(raw[in * j + k]) * x[static_cast<std::size_t>(k)];
      if (layer < 4) sum += std::tanh(static_cast<long double>(raw[in * out + out + j])) * std::tanh(sum);
      y[static_cast<std::size_t>(j)] = sum;
    }
    x = y;
    raw += in * out + out + (layer < 4 ? out : 0);
  }
  return x[0];
}
long double sigmoid_of(long double x) { return 1 / (1 + std::exp(-x)); }
/// P of the interval, from the tail that does not cancel.
long double interval(const double* raw, long double z) {
  const long double a = cumulative_logit(raw, z + 0.5L), b = cumulative_logit(raw, z - 0.5L);
  return a + b > 0 ? sigmoid_of(-b) - sigmoid_of(-a) : sigmoid_of(a) - sigmoid_of(b);
}

template <class T>
struct Problem {
  using Prior = FactorisedPrior<T, prior_channels>;
  std::vector<T> values = std::vector<T>(Prior::count), gradients = std::vector<T>(Prior::count, T(0));
  std::vector<T> z = std::vector<T>(prior_channels * prior_anchors), d_z = z, weight = std::vector<T>(prior_anchors),
                 bits = weight;
  explicit Problem(double spread) {
    Prior::initialise({values.data(), prior_channels, 58}, 1);
    const Random random(2, 0, 0);
    std::size_t at = 0;
    for (std::size_t i = 0; i < values.size(); ++i) values[i] += static_cast<T>(0.5 * random.normal(at++));
    for (T& v : z) v = static_cast<T>(spread * random.normal(at++));
    for (T& w : weight) w = static_cast<T>(random.uniform(at++));
  }
  T run() {
    std::vector<T> ready(Prior::count), sums(Prior::count, T(0));
    Prior::prepare({values.data(), prior_channels, 58}, ready.data());
    std::fill(bits.begin(), bits.end(), T(0));
    Prior::bits(ready.data(), z.data(), prior_anchors, weight.data(), bits.data(), d_z.data(), sums.data());
    std::fill(gradients.begin(), gradients.end(), T(0));
    Prior::add_gradients({values.data(), prior_channels, 58}, ready.data(), sums.data(),
                         {gradients.data(), prior_channels, 58});
    T loss = 0;
    for (std::size_t i = 0; i < prior_anchors; ++i) loss += weight[i] * bits[i];
    return loss;
  }
};

}  // namespace

TEST_CASE("rate/factorised_prior: gradients of z and of all 58 scalars a channel (central differences in double)") {
  for (const double spread : {1.0, 6.0, 30.0}) {  // the last: beyond the window too
    CAPTURE(spread);
    Problem<double> problem(spread);
    static_cast<void>(problem.run());
    const std::vector<double> gradients = problem.gradients, d_z = problem.d_z;
    const auto loss = [&] { return problem.run(); };
    CHECK(testing::gradient_law(loss, problem.values, std::span<const double>(gradients), 1e-7, 1000) == "");
    CHECK(testing::gradient_law(loss, problem.z, std::span<const double>(d_z), 1e-7, 1000) == "");
    for (const double g : gradients) CHECK(g != 0);
  }
}

TEST_CASE("rate/factorised_prior: bits are those of the formula, in float within 1e-5 of it") {
  for (const double spread : {1.0, 8.0, 25.0}) {
    CAPTURE(spread);
    Problem<double> exact(spread);
    Problem<float> single(spread);
    for (std::size_t i = 0; i < exact.values.size(); ++i) exact.values[i] = static_cast<double>(single.values[i]);
    for (std::size_t i = 0; i < exact.z.size(); ++i) exact.z[i] = static_cast<double>(single.z[i]);
    static_cast<void>(exact.run());
    static_cast<void>(single.run());
    for (std::size_t i = 0; i < prior_anchors; ++i) {
      long double bits = 0;
      for (std::size_t c = 0; c < prior_channels; ++c) {
        const double z = exact.z[c * prior_anchors + i], t = std::max(0.0, std::abs(z) - 15), d = t * t / (1 + t);
        const double e = 1.0 / 65536;
        bits -= std::log2((1 - 4 * e) * interval(exact.values.data() + 58 * c, z) + e / ((1 + d) * (1 + d)));
      }
      CHECK(exact.bits[i] == doctest::Approx(static_cast<double>(bits)).epsilon(1e-12));
      CHECK(static_cast<double>(single.bits[i]) == doctest::Approx(static_cast<double>(bits)).epsilon(1e-5));
    }
  }
}

TEST_CASE(
    "rate/factorised_prior: the cumulative grows, symbols sum to one; the naive difference of sigmoids fails far "
    "out") {
  Problem<double> problem(1);
  std::vector<double> ready(Problem<double>::Prior::count);
  Problem<double>::Prior::prepare({problem.values.data(), prior_channels, 58}, ready.data());
  for (std::size_t c = 0; c < prior_channels; ++c) {
    const double* const raw = problem.values.data() + 58 * c;
    long double sum = 0;
    for (int k = -400; k <= 400; ++k) {
      sum += interval(raw, k);
      CHECK(Problem<double>::Prior::probability(ready.data() + 58 * c, static_cast<double>(k)) ==
            doctest::Approx(static_cast<double>(interval(raw, k))).epsilon(1e-10));
      CHECK(cumulative_logit(raw, k + 0.5) > cumulative_logit(raw, k - 0.5));
    }
    CHECK(static_cast<double>(sum) == doctest::Approx(1).epsilon(1e-6));
  }
  // In float, where P is some 1e-9 at the upper side, the product has it and the difference near 1 has nothing.
  float far = 0;
  const double* const raw = problem.values.data();
  while (interval(raw, static_cast<long double>(far)) > 1e-9L) far += 1;
  const float a = static_cast<float>(cumulative_logit(raw, static_cast<long double>(far) + 0.5L)),
              b = static_cast<float>(cumulative_logit(raw, static_cast<long double>(far) - 0.5L));
  const float naive = 1 / (1 + std::exp(-a)) - 1 / (1 + std::exp(-b));
  const float product = 1 / (1 + std::exp(-a)) / (1 + std::exp(b)) * -std::expm1(b - a);
  const double truth = static_cast<double>(interval(raw, static_cast<long double>(far)));
  CHECK(std::abs(static_cast<double>(product) / truth - 1) < 1e-4);
  CHECK(!(std::abs(static_cast<double>(naive) / truth - 1) < 0.5));
}

TEST_CASE("rate/factorised_prior: it starts narrow, all channels alike; beyond the window a gradient leads back") {
  using Prior = FactorisedPrior<double, 12>;
  std::vector<double> values(Prior::count);
  Prior::initialise({values.data(), 12, 58}, 7);
  int matrices = 0, biases = 0, factors = 0;
  for (int i = 0; i < 58; ++i) {
    matrices += Prior::kind(i) == Prior::Kind::matrix ? 1 : 0;
    biases += Prior::kind(i) == Prior::Kind::bias ? 1 : 0;
    factors += Prior::kind(i) == Prior::Kind::factor ? 1 : 0;
  }
  CHECK(matrices == 33);
  CHECK(biases == 13);
  CHECK(factors == 12);
  double mean = 0;
  for (std::size_t c = 0; c < 12; ++c) {
    const double bits = -std::log2(static_cast<double>(interval(values.data() + 58 * c, 0)));
    CHECK(bits > 0.9);  // a logistic density of scale 0.5 has 1.1 in its middle, and the biases move it
    CHECK(bits < 1.9);
    mean += bits / 12;
  }
  CHECK(mean < 1.4);
  for (const double far : {40.0, -1000.0}) {
    Problem<double> problem(1);
    std::fill(problem.z.begin(), problem.z.end(), far);
    static_cast<void>(problem.run());
    for (std::size_t i = 0; i < problem.z.size(); ++i) CHECK(problem.d_z[i] * far > 0);
    for (const double b : problem.bits) CHECK(b < 3 * (16.1 + 4 * std::log2(std::abs(far))));
  }
}
