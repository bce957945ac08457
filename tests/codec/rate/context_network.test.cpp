// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/rate/context_network.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;
using Net = ContextNetwork<double, 12, 21, 31, 3>;  // no width is a multiple of a pack
using FloatNet = ContextNetwork<float, 96, 100, 175, 3>;

template <class N, class T>
struct Case {
  std::vector<T> weight1, bias1, weight2, bias2, input, hidden, output, tail;
  Buffer<T> packed;
  explicit Case(std::uint64_t seed) {
    const Random random(seed, 0, random_stage("context network test"));
    std::uint64_t at = 0;
    const auto fill = [&](std::vector<T>& values, int count, double scale) {
      for (int i = 0; i < count; ++i) values.push_back(static_cast<T>(scale * random.normal(at++)));
    };
    fill(weight1, N::hidden * N::inputs, 0.3);
    fill(bias1, N::hidden, 0.3);
    fill(weight2, N::outputs * N::hidden, 0.3);
    fill(bias2, N::outputs, 0.3);
    input.assign(N::panel * N::input_row, T(0));
    for (int i = 0; i < N::panel; ++i) {
      for (int c = 0; c < N::inputs; ++c) input.data()[i * N::input_row + c] = static_cast<T>(random.normal(at++));
    }
    hidden.resize(N::panel * N::hidden_row);
    output.resize(N::panel * N::output_row);
    tail.resize(N::panel * N::tail_row);
  }
  template <class U, class V>
  static MatrixView<U> view(V& values, int rows) {
    return {values.data(), static_cast<std::size_t>(rows), values.size() / static_cast<std::size_t>(rows)};
  }
  void run() {
    N::pack({view<const T>(weight1, N::hidden), view<const T>(bias1, 1), view<const T>(weight2, N::outputs),
             view<const T>(bias2, 1)},
            packed);
    N::hidden_layer(packed.data(), input.data(), hidden.data());
    N::all_outputs(packed.data(), hidden.data(), output.data());
    N::tail_outputs(packed.data(), hidden.data(), tail.data());
  }
};

}  // namespace

TEST_CASE("rate/context_network: outputs are those of plain loops, and the tail is the last of all outputs") {
  Case<FloatNet, float> c(1);
  c.run();
  double worst = 0, worst_tail = 0;
  for (int i = 0; i < FloatNet::panel; i += 9) {
    double hidden[100];
    for (int h = 0; h < 100; ++h) {
      double sum = static_cast<double>(c.bias1.data()[h]);
      for (int k = 0; k < 96; ++k)
        sum += static_cast<double>(c.weight1.data()[h * 96 + k]) *
               static_cast<double>(c.input.data()[i * FloatNet::input_row + k]);
      hidden[h] = std::max(0.0, sum);
    }
    for (int o = 0; o < 175; ++o) {
      double sum = static_cast<double>(c.bias2.data()[o]);
      for (int h = 0; h < 100; ++h) sum += static_cast<double>(c.weight2.data()[o * 100 + h]) * hidden[h];
      worst = std::max(worst, std::abs(sum - static_cast<double>(c.output.data()[i * FloatNet::output_row + o])));
      if (o >= 172)
        worst_tail = std::max(worst_tail, std::abs(static_cast<double>(c.tail.data()[i * FloatNet::tail_row + o - 172] -
                                                                       c.output.data()[i * FloatNet::output_row + o])));
    }
  }
  CHECK(worst < 1e-4);     // 100 products of size 1
  CHECK(worst_tail == 0);  // the same sums in the same order
}

TEST_CASE(
    "rate/context_network: gradients of inputs, weights and biases, all outputs and tail (central differences in "
    "double)") {
  for (const bool all : {true, false}) {
    CAPTURE(all);
    Case<Net, double> c(2);
    const Random random(3, 0, random_stage("context network test"));
    std::vector<double> d_out(Net::panel * Net::output_row, 0.0), d_tail(Net::panel * Net::tail_row, 0.0);
    for (int i = 0; i < Net::panel; ++i) {
      for (int o = 0; o < Net::outputs; ++o)
        d_out.data()[i * Net::output_row + o] = random.normal(static_cast<std::uint64_t>(i * 100 + o));
      for (int o = 0; o < Net::tail; ++o)
        d_tail.data()[i * Net::tail_row + o] = random.normal(static_cast<std::uint64_t>(90000 + i * 100 + o));
    }
    const auto loss = [&] {
      c.run();
      double sum = 0;
      if (all) {
        for (std::size_t i = 0; i < d_out.size(); ++i) sum += d_out[i] * c.output[i];
      } else {
        for (std::size_t i = 0; i < d_tail.size(); ++i) sum += d_tail[i] * c.tail[i];
      }
      return sum;
    };
    static_cast<void>(loss());
    std::vector<double> sums(Net::gradient_count, 0.0), d_hidden(c.hidden.size()), d_input(c.input.size());
    if (all) {
      Net::backward_all(c.packed.data(), c.input.data(), c.hidden.data(), d_out.data(), d_hidden.data(), d_input.data(),
                        sums.data());
    } else {
      Net::backward_tail(c.packed.data(), c.input.data(), c.hidden.data(), d_tail.data(), d_hidden.data(),
                         d_input.data(), sums.data());
    }
    std::vector<double> g1(c.weight1.size(), 0.0), b1(c.bias1.size(), 0.0), g2(c.weight2.size(), 0.0),
        b2(c.bias2.size(), 0.0);
    using C = Case<Net, double>;
    Net::add_gradients(sums.data(), {C::view<double>(g1, Net::hidden), C::view<double>(b1, 1),
                                     C::view<double>(g2, Net::outputs), C::view<double>(b2, 1)});
    CHECK(testing::gradient_law(loss, c.weight1, g1) == "");
    CHECK(testing::gradient_law(loss, c.bias1, b1) == "");
    CHECK(testing::gradient_law(loss, c.weight2, g2) == "");
    CHECK(testing::gradient_law(loss, c.bias2, b2) == "");
    std::vector<double> x, dx;
    for (int i = 0; i < 5; ++i) {
      for (int k = 0; k < Net::inputs; ++k) {
        double& at = c.input.data()[i * Net::input_row + k];
        CHECK(d_input.data()[i * Net::input_row + k] ==
              doctest::Approx(testing::central_difference(loss, at)).epsilon(1e-5));
      }
    }
  }
}
