// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The feature bank against the published slicing feature[::4], feature[::2], feature (docs/spec/method.md, 1.3), and
// its gradients.
#include "compmark/splat/anchor/feature_bank.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;

constexpr int D = 8;
using Bank = FeatureBank<double, D>;

std::vector<double> noise(std::size_t count, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("feature bank test"));
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = random.normal(i);
  return values;
}

/// The network's last biases choose the mixture; all else is zero.
std::array<double, D> mixed_by(double coarse, double middle, double fine, Bank::Record& record) {
  std::vector<double> parameters(Bank::parameter_count, 0.0), feature(D);
  std::iota(feature.begin(), feature.end(), 0.0);
  parameters[Bank::bias2] = coarse;
  parameters[Bank::bias2 + 1] = middle;
  parameters[Bank::bias2 + 2] = fine;
  std::array<double, D> mixed{};
  const double view[4] = {0, 0, 1, 3};
  Bank::forward(parameters.data(), view, feature.data(), mixed.data(), record);
  return mixed;
}

}  // namespace

TEST_CASE(
    "anchor/feature_bank: each resolution is the feature's every fourth, every second and every channel, repeated") {
  Bank::Record record;
  CHECK(mixed_by(1e4, 0, 0, record) == std::array<double, D>{0, 4, 0, 4, 0, 4, 0, 4});
  CHECK(mixed_by(0, 1e4, 0, record) == std::array<double, D>{0, 2, 4, 6, 0, 2, 4, 6});
  CHECK(mixed_by(0, 0, 1e4, record) == std::array<double, D>{0, 1, 2, 3, 4, 5, 6, 7});
}

TEST_CASE("anchor/feature_bank: the weights are a softmax of logits of any size") {
  Bank::Record record;
  for (const double shift : {0.0, 1e3, -1e3, 1e300}) {
    mixed_by(shift, shift, shift, record);
    for (const double weight : record.weight) CHECK(weight == doctest::Approx(1.0 / 3).epsilon(1e-15));
  }
  mixed_by(std::log(0.5), std::log(0.3), std::log(0.2), record);
  CHECK(record.weight[0] == doctest::Approx(0.5).epsilon(1e-14));
  CHECK(record.weight[1] == doctest::Approx(0.3).epsilon(1e-14));
  CHECK(record.weight[2] == doctest::Approx(0.2).epsilon(1e-14));
}

TEST_CASE("anchor/feature_bank: gradients of parameters, view and feature, added (A1)") {
  std::vector<double> parameters = noise(Bank::parameter_count, 1), feature = noise(D, 2), view = noise(4, 3);
  const std::vector<double> d_mixed = noise(D, 4);
  Bank::Record record;
  const auto run = [&](double* mixed) {
    const double v[4] = {view[0], view[1], view[2], view[3]};
    Bank::forward(parameters.data(), v, feature.data(), mixed, record);
  };
  const auto loss = [&] {
    double mixed[D], sum = 0;
    run(mixed);
    for (std::size_t c = 0; c < D; ++c) sum += d_mixed[c] * mixed[c];
    return sum;
  };
  loss();
  std::vector<double> d_parameters(Bank::parameter_count, 0.25), d_feature(D, 0.25);
  double d_view_array[4] = {0.25, 0.25, 0.25, 0.25};
  const double v[4] = {view[0], view[1], view[2], view[3]};
  Bank::backward(parameters.data(), v, feature.data(), record, d_mixed.data(), d_parameters.data(), d_view_array,
                 d_feature.data());
  std::vector<double> d_view(d_view_array, d_view_array + 4);
  for (std::vector<double>* gradient : {&d_parameters, &d_feature, &d_view}) {
    for (double& g : *gradient) g -= 0.25;  // what was there before
  }
  for (const std::string& broken :
       {testing::gradient_law(loss, parameters, d_parameters, 1e-8, 1000),
        testing::gradient_law(loss, feature, d_feature, 1e-8), testing::gradient_law(loss, view, d_view, 1e-8)}) {
    CHECK_MESSAGE(broken.empty(), broken);
  }
  std::size_t off = 0;  // a unit at rest passes nothing on
  for (std::size_t h = 0; h < D; ++h) {
    if (record.hidden[h] > 0) continue;
    ++off;
    CHECK(d_parameters[Bank::bias1 + h] == 0);
  }
  CHECK(off > 0);
  d_parameters[Bank::weight2 + 3] += 0.01;  // negative control
  CHECK(!testing::gradient_law(loss, parameters, d_parameters, 1e-8, 1000).empty());
}

TEST_CASE("anchor/feature_bank: a NaN in the view reaches the mixture and is not absorbed by the rectifier (ML4)") {
  const std::vector<double> parameters = noise(Bank::parameter_count, 1), feature = noise(D, 2);
  const double view[4] = {0, std::nan(""), 1, 3};
  double mixed[D];
  Bank::Record record;
  Bank::forward(parameters.data(), view, feature.data(), mixed, record);
  for (const double value : mixed) CHECK(std::isnan(value));
}
