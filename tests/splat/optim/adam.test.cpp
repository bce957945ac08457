// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Adam against its formula in long double, against the published transients (docs/spec/method.md, 9), and its laws
// (splat/optim/concept.hpp).
#include "compmark/splat/optim/adam.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/optim/reference_adam.hpp"

using namespace compmark;

static_assert(Optimizer<Adam<float>> && Optimizer<Adam<double>> && Optimizer<ReferenceAdam<float>> &&
              Optimizer<ReferenceAdam<long double>>);

namespace {

/// Two anchor blocks and two fixed ones; sizes with every kind of tail, one above the chunk size.
template <class T>
ParameterArena<T> make_arena(std::size_t anchors = 37) {
  ParameterArena<T> arena;
  arena.add("anchor.a", anchors, 3, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  arena.add("net.w", 1301, 17, RowKind::fixed, BlockRole::rendering, LearningSchedule::fixed());
  arena.add("anchor.b", anchors, 5, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  arena.add("net.b", 1, 7, RowKind::fixed, BlockRole::rendering, LearningSchedule::fixed());
  const Random random(7, 0, random_stage("values"));
  for (const ArenaLayout::Block& block : arena.layout().blocks()) {
    for (std::size_t i = 0; i < block.size(); ++i)
      arena.all_values()[block.offset + i] = static_cast<T>(random.normal(block.offset + i));
  }
  return arena;
}
template <class T>
void fill_gradients(ParameterArena<T>& arena, std::uint64_t iteration) {
  const Random random(7, iteration, random_stage("gradients"));
  for (const ArenaLayout::Block& block : arena.layout().blocks()) {
    for (std::size_t i = block.offset; i < block.offset + block.size(); ++i) {
      const double magnitude = std::pow(10.0, -6 + 4 * random.uniform(i * 2 + 1));
      arena.all_gradients()[i] = static_cast<T>(static_cast<float>(random.normal(i * 2) * magnitude));
    }
  }
}
template <class T>
bool same_bits(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}
template <class T>
bool same_state(const AdamState<T>& a, const AdamState<T>& b) {
  return a.steps == b.steps && same_bits(a.first_moment.span(), b.first_moment.span()) &&
         same_bits(a.second_moment.span(), b.second_moment.span());
}
std::vector<double> rates_of(std::size_t blocks, double rate) { return std::vector<double>(blocks, rate); }

/// An arena on its way: the four blocks of make_arena, or one block of `parameters` zeros.
template <class T, class A = Adam<T>>
struct Training {
  ParameterArena<T> arena = make_arena<T>();
  A adam;
  AdamState<T> state;
  SerialExecutor executor;

  Training() { adam.prepare(arena.layout(), state); }
  explicit Training(std::size_t parameters, const AdamSettings& settings = {}) : adam(settings) {
    arena = {};
    arena.add("p", 1, parameters, RowKind::fixed, BlockRole::rendering, LearningSchedule::fixed());
    adam.prepare(arena.layout(), state);
  }
  [[nodiscard]] std::vector<T> values() const { return {arena.all_values().begin(), arena.all_values().end()}; }
  /// With the gradients that are there.
  AdamReport step(double rate, StepOptions options = {}) {
    return adam.step(arena, rates_of(arena.layout().blocks().size(), rate), state, executor, options);
  }
  /// With the random gradients of an iteration.
  AdamReport step_at(std::uint64_t iteration, double rate, StepOptions options = {}) {
    fill_gradients(arena, iteration);
    return step(rate, options);
  }
  /// With the same gradient everywhere.
  AdamReport step_with(T gradient, double rate) {
    std::fill(arena.all_gradients().begin(), arena.all_gradients().end(), gradient);
    return step(rate);
  }
};
template <class T>
bool same_training(const Training<T>& a, const Training<T>& b) {
  return same_bits<T>(a.arena.all_values(), b.arena.all_values()) && same_state(a.state, b.state);
}

/// One parameter that sees the gradients given, at rate 1 from 0: returns the size of each update.
std::vector<double> updates(const std::vector<double>& gradients, std::uint64_t first_step = 0, double m = 0,
                            double v = 0) {
  Training<double> one(1);
  one.state.steps[0] = first_step;
  one.state.first_moment[0] = m;
  one.state.second_moment[0] = v;
  std::vector<double> result;
  for (const double g : gradients) {
    const double before = one.arena.all_values()[0];
    one.step_with(g, 1.0);
    result.push_back(before - one.arena.all_values()[0]);
  }
  return result;
}

}  // namespace

TEST_CASE("optim/adam: follows the formula in long double over 200 steps") {
  // Both start from the same float values and see the same float gradients. Bound: each step rounds p by half a unit in the last place of
  // its size (2^-24 |p|), and m / denominator by a few 2^-24 of an update of at most 10 lr; measured worst 3.0e-6 here.
  Training<float> fast;
  Training<long double, ReferenceAdam<long double>> exact;
  std::copy(fast.arena.all_values().begin(), fast.arena.all_values().end(), exact.arena.all_values().begin());
  for (std::uint64_t t = 1; t <= 200; ++t) {
    fast.step_at(t, 0.005);
    exact.step_at(t, 0.005);
  }
  double worst = 0, worst_m = 0, worst_v = 0;
  for (std::size_t i = 0; i < fast.arena.all_values().size(); ++i) {
    worst = std::max(worst, std::abs(static_cast<double>(fast.arena.all_values()[i] - exact.arena.all_values()[i])));
    const double v = static_cast<double>(exact.state.second_moment[i]);
    if (v == 0) continue;
    const double error_m = static_cast<double>(fast.state.first_moment[i] - exact.state.first_moment[i]);
    worst_m = std::max(worst_m, std::abs(error_m) / std::sqrt(v));
    worst_v = std::max(worst_v, std::abs(static_cast<double>(fast.state.second_moment[i]) / v - 1));
  }
  INFO("worst value " << worst << ", m " << worst_m << ", v " << worst_v);
  CHECK(worst < 1e-5);
  CHECK(worst_m < 3e-6);
  CHECK(worst_v < 2e-5);
}

TEST_CASE("optim/adam: equals the plain scalar reference within four units in the last place a step") {
  Training<float> fast;
  Training<float, ReferenceAdam<float>> plain;
  constexpr float ulp = std::numeric_limits<float>::epsilon();
  for (std::uint64_t t = 1; t <= 20; ++t) {
    std::copy(fast.arena.all_values().begin(), fast.arena.all_values().end(), plain.arena.all_values().begin());
    plain.state = fast.state;
    const std::vector<float> old_m(fast.state.first_moment.begin(), fast.state.first_moment.end());
    fast.step_at(t, 0.01);
    plain.step_at(t, 0.01);
    for (std::size_t i = 0; i < old_m.size(); ++i) {
      const float g = fast.arena.all_gradients()[i], value = fast.arena.all_values()[i];
      REQUIRE(std::abs(fast.state.first_moment[i] - plain.state.first_moment[i]) <=
              4 * ulp * std::max(std::abs(g), std::abs(old_m[i])));
      REQUIRE(std::abs(fast.state.second_moment[i] - plain.state.second_moment[i]) <=
              4 * ulp * fast.state.second_moment[i]);
      // An update is at most 10 lr; its m may carry the error above, so one part in 2^-20 of the largest update is allowed.
      REQUIRE(std::abs(value - plain.arena.all_values()[i]) <= ulp * (std::abs(value) + 0.1f));
    }
  }
}

TEST_CASE("optim/adam: the same bits at every pack width and at 1, 2, 3 and 4 threads") {
  const auto run = [](auto adam, std::size_t threads, auto& state) {
    ParameterArena<float> arena = make_arena<float>();
    ThreadExecutor executor(threads);
    adam.prepare(arena.layout(), state);
    for (std::uint64_t t = 1; t <= 5; ++t) {
      fill_gradients(arena, t);
      adam.step(arena, rates_of(4, 0.01), state, executor);
    }
    return std::vector<float>(arena.all_values().begin(), arena.all_values().end());
  };
  AdamState<float> state;
  const std::vector<float> expected = run(Adam<float>(), 1, state);
  const auto check = [&](const std::vector<float>& values, const AdamState<float>& other) {
    CHECK(same_bits<float>(values, expected));
    CHECK(same_state(other, state));
  };
  AdamState<float> other;
  check(run(Adam<float, 1>(), 1, other), other);
  check(run(Adam<float, 4>(), 1, other), other);
  check(run(Adam<float, 8>(), 1, other), other);
  for (const std::size_t threads : {2u, 3u, 4u}) check(run(Adam<float>(), threads, other), other);
}

TEST_CASE("optim/adam: the first step is lr sign(g), for float too (numerics OP3)") {
  Training<float> training;
  std::fill(training.arena.all_values().begin(), training.arena.all_values().end(), 0.0f);
  training.step_at(3, 0.25);
  for (std::size_t i = 0; i < training.arena.all_values().size(); ++i) {
    const float g = training.arena.all_gradients()[i];
    if (std::abs(g) < 1e-8f) continue;  // there epsilon shows: 1e-15 / |g|; padding between blocks has none
    REQUIRE(training.arena.all_values()[i] == doctest::Approx(g > 0 ? -0.25 : 0.25).epsilon(1e-6));
  }
  // Negative control: 1 - beta^t in float is off by 1e-5 at the first step.
  CHECK(std::abs(static_cast<double>(1.0f - 0.999f) / detail::bias_correction(0.999, 1) - 1) > 1e-5);
  CHECK(std::abs(0.001 / detail::bias_correction(0.999, 1) - 1) < 1e-12);
}

TEST_CASE("optim/adam: a constant gradient of 1e-12 moves by lr, and by 1e-4 lr at the usual epsilon (numerics OP1)") {
  CHECK(updates({1e-12})[0] == doctest::Approx(0.999).epsilon(1e-6));
  Training<double> usual(1, AdamSettings{0.9, 0.999, 1e-8});
  usual.step_with(1e-12, 1.0);
  CHECK(-usual.arena.all_values()[0] == doctest::Approx(1e-4).epsilon(1e-3));
}

TEST_CASE("optim/adam: a loss that becomes ten times larger takes steps of up to 5.20 lr, 17 steps later") {
  const std::vector<double> sizes = updates(std::vector<double>(60, 10.0), 20000, 1.0, 1.0);
  const auto peak = std::max_element(sizes.begin(), sizes.end());
  CHECK(*peak == doctest::Approx(5.20).epsilon(1e-3));
  CHECK(peak - sizes.begin() + 1 == 17);
}

TEST_CASE("optim/adam: a fresh row under an old step count takes 3.162, 4.25 and 6.53 lr at steps 1, 2 and 10") {
  const std::vector<double> sizes = updates(std::vector<double>(200, 0.3), 20000);
  CHECK(sizes[0] == doctest::Approx(3.162).epsilon(1e-3));
  CHECK(sizes[1] == doctest::Approx(4.25).epsilon(1e-3));
  CHECK(sizes[9] == doctest::Approx(6.53).epsilon(1e-3));
  CHECK(sizes[199] == doctest::Approx(2.35).epsilon(0.02));  // "back to about 2.4"
}

TEST_CASE("optim/adam: law O1, a block of rate 0 and the anchor blocks of an adjustment keep every bit") {
  Training<float> training;
  training.step_at(1, 0.01);
  const Training<float> before = training;
  CHECK(training.step_at(2, 0).stepped_blocks == 0);
  CHECK(same_training(training, before));
  CHECK(training.step(0.01, {true, false}).stepped_blocks == 2);
  CHECK(training.state.steps == std::vector<std::uint64_t>{1, 2, 1, 2});
  for (const ArenaLayout::Block& block : training.arena.layout().blocks()) {
    const auto then = before.arena.all_values().subspan(block.offset, block.size());
    const auto now = std::as_const(training.arena).all_values().subspan(block.offset, block.size());
    CHECK(same_bits<float>(then, now) == (block.kind == RowKind::anchor));
  }
}

TEST_CASE(
    "optim/adam: law O2, a gradient that is not finite skips its block alone, is counted, and training goes on "
    "identically") {
  for (const float poison : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -2e19f}) {
    for (const std::size_t place : {0u, 777u, 16383u, 16384u, 22116u}) {
      Training<float> training, clean;
      ThreadExecutor executor(2);
      for (std::uint64_t t = 1; t <= 4; ++t) {
        fill_gradients(training.arena, t);
        fill_gradients(clean.arena, t);
        std::vector<double> rates = rates_of(4, 0.01);
        if (t == 2) training.arena.gradients({1}).flat()[place] = poison;
        const AdamReport report = training.adam.step(training.arena, rates, training.state, executor);
        CHECK(report.skipped_blocks == (t == 2 ? 1 : 0));
        CHECK(report.stepped_blocks == (t == 2 ? 3 : 4));
        if (t == 2) CHECK(report.first_skipped.index == 1);
        if (t == 2) rates[1] = 0;
        clean.adam.step(clean.arena, rates, clean.state, executor);
      }
      CHECK(same_training(training, clean));
    }
  }
}

TEST_CASE("optim/adam: the largest gradient that passes the guard keeps the moments finite for ever") {
  Training<float> one(1);
  for (int t = 0; t < 20000; ++t) REQUIRE(one.step_with(1.8446742e19f, 0.001).skipped_blocks == 0);
  CHECK(std::isfinite(one.state.second_moment[0]));
  CHECK(one.arena.all_values()[0] == doctest::Approx(-20.0).epsilon(0.01));
  float naive = 0;  // negative control: a moment that has seen one NaN
  for (int step = 0; step < 100; ++step) naive += 0.1f * ((step == 0 ? std::nanf("") : 1.0f) - naive);
  CHECK(std::isnan(naive));
}

TEST_CASE("optim/adam: law O3, values without gradients keep their bits, minus zero too, for 100 steps") {
  Training<float> training;
  training.arena.all_values()[0] = -0.0f;
  const std::vector<float> before = training.values();
  for (int t = 0; t < 100; ++t) training.step(0.01);
  CHECK(same_bits<float>(before, training.arena.all_values()));
}

TEST_CASE("optim/adam: a row that is not seen again moves on by its old momentum, as published (numerics OP4)") {
  // One gradient of 1 at rate 1, then none: after n steps the moments are 0.1 0.9^(n-1) and 0.001 0.999^(n-1).
  std::vector<double> gradients(20, 0.0);
  gradients[0] = 1;
  const std::vector<double> sizes = updates(gradients);
  for (std::size_t n = 1; n <= sizes.size(); ++n) {
    const auto steps = static_cast<double>(n);
    const double m = 0.1 * std::pow(0.9, steps - 1) / (1 - std::pow(0.9, steps));
    const double v = 0.001 * std::pow(0.999, steps - 1) / (1 - std::pow(0.999, steps));
    CHECK(sizes[n - 1] == doctest::Approx(m / std::sqrt(v)).epsilon(1e-9));
  }
  double drift = 0;  // negative control: a selective optimizer, which skips rows without a gradient, stands still
  for (std::size_t n = 1; n < sizes.size(); ++n) drift += sizes[n];
  CHECK(drift > 3);
}

TEST_CASE("optim/adam: losses times a power of two take the same steps, to rounding (LS10)") {
  const auto trained = [](double epsilon, int power) {
    Training<float> training;
    training.adam = Adam<float>(AdamSettings{0.9, 0.999, epsilon});
    for (std::uint64_t t = 1; t <= 50; ++t) {
      fill_gradients(training.arena, t);
      for (float& g : training.arena.all_gradients()) g = std::abs(g) < 2e-3f ? 0 : std::ldexp(g, power);
      training.step(0.01);
    }
    return training.values();
  };
  const auto distance = [](const std::vector<float>& a, const std::vector<float>& b) {
    float largest = 0;
    for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
    return largest;
  };
  const std::vector<float> plain = trained(1e-15, 0);
  // 50 steps of 0.01, of parameters below 5: a rounding of 2.4e-7 in each would be 1.2e-5.
  for (const int power : {-10, 10}) CHECK(distance(trained(1e-15, power), plain) < 1e-5f);
  CHECK(distance(trained(1e-8, -10), plain) > 1e-3f);  // negative control: with the usual epsilon they fall behind
}

TEST_CASE("optim/adam: the steps of an export's refinement change a quaternion's length by less than 2 % (QU3)") {
  // Tangential gradients of a random direction in every step, as bad as can be; rates fall from 0.003 to a tenth, as
  // SplatRefineSettings has it.
  const auto length_after = [](std::uint64_t seed, int steps, double last_rate) {
    Training<double> one(4);
    const Random random(seed, 0, random_stage("test/quaternion"));
    const std::span<double> q = one.arena.all_values(), d = one.arena.all_gradients();
    for (std::size_t k = 0; k < 4; ++k) q[k] = k < 2 ? 0.7 : 0.1;
    const auto squares = [&] { return q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]; };
    for (int t = 0; t < steps; ++t) {
      std::array<double, 4> g{};
      double along = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        g[k] = random.normal(4 * static_cast<std::uint64_t>(t) + k);
        along += g[k] * q[k] / squares();
      }
      for (std::size_t k = 0; k < 4; ++k) d[k] = g[k] - along * q[k];
      one.step(0.003 * std::pow(last_rate, static_cast<double>(t) / steps));
    }
    return std::sqrt(squares());
  };
  double most = 0, least = 10, longest = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    most = std::max(most, length_after(seed, 500, 0.1));
    least = std::min(least, length_after(seed, 500, 0.1));
    longest = std::max(longest, length_after(seed, 30000, 1));
  }
  MESSAGE("from 1 to between ", least, " and ", most, "; in a training's steps to ", longest);
  CHECK(least > 0.98);
  CHECK(most < 1.02);
  CHECK(longest > 1.2);  // negative control: a training's steps, were a quaternion trained
}

TEST_CASE("optim/adam: zero_gradients_after leaves none, with the same bits otherwise") {
  Training<float> training, plain;
  const std::vector<double> rates{0.01, 0.01, 0, 0.02};
  for (Training<float>* one : {&training, &plain}) {
    fill_gradients(one->arena, 1);
    one->arena.all_gradients()[3] = std::numeric_limits<float>::quiet_NaN();
    one->adam.step(one->arena, rates, one->state, one->executor, {false, one == &training});
  }
  CHECK(same_training(training, plain));
  for (const float g : training.arena.all_gradients()) REQUIRE(std::bit_cast<std::uint32_t>(g) == 0);
}

TEST_CASE("optim/adam: law O4, a row edit moves the moments of kept rows bit for bit and starts new rows at zero") {
  Training<float> training;
  training.step_at(1, 0.01);
  const AdamState<float> before = training.state;
  const ArenaLayout old_layout = training.arena.layout();
  const std::vector<std::uint32_t> kept{0, 3, 4, 20, 36};
  const RowEdit edit{kept, 3};
  training.arena.edit_rows(edit);
  training.adam.edit_rows(edit, old_layout, training.arena.layout(), training.state);
  const AdamState<float>& state = training.state;
  CHECK(state.steps == before.steps);
  const ArenaLayout& layout = training.arena.layout();
  REQUIRE(state.first_moment.size() == layout.size());
  for (std::size_t b = 0; b < 4; ++b) {
    const ArenaLayout::Block& block = layout.blocks()[b];
    const ArenaLayout::Block& old_block = old_layout.blocks()[b];
    for (std::size_t row = 0; row < block.rows; ++row) {
      for (std::size_t column = 0; column < block.columns; ++column) {
        const std::size_t at = block.offset + row * block.columns + column;
        const bool fresh = block.kind == RowKind::anchor && row >= kept.size();
        const std::size_t old_row = block.kind == RowKind::fixed || fresh ? row : kept[row];
        const std::size_t old_at = old_block.offset + old_row * block.columns + column;
        REQUIRE(std::bit_cast<std::uint32_t>(state.first_moment[at]) ==
                (fresh ? 0u : std::bit_cast<std::uint32_t>(before.first_moment[old_at])));
        REQUIRE(std::bit_cast<std::uint32_t>(state.second_moment[at]) ==
                (fresh ? 0u : std::bit_cast<std::uint32_t>(before.second_moment[old_at])));
      }
    }
  }
}

TEST_CASE("optim/adam: saved and restored moments and step counts continue bit for bit") {
  Training<float> training, resumed;
  training.step_at(1, 0.01);
  std::copy(training.arena.all_values().begin(), training.arena.all_values().end(), resumed.arena.all_values().begin());
  const AdamState<float>& saved = training.state;
  std::copy(saved.first_moment.begin(), saved.first_moment.end(), resumed.state.first_moment.begin());
  std::copy(saved.second_moment.begin(), saved.second_moment.end(), resumed.state.second_moment.begin());
  resumed.state.steps = saved.steps;
  for (std::uint64_t t = 2; t < 6; ++t) {
    training.step_at(t, 0.01);
    resumed.step_at(t, 0.01);
  }
  CHECK(same_training(training, resumed));
}

TEST_CASE("optim/adam: a row out of sight ends with moments of zero, not denormal (numerics OP2)") {
  Training<float> training(64);
  training.step_with(1e-4f, 0.01);
  float naive = training.state.first_moment[0];
  for (int t = 0; t < 2000; ++t) {
    training.step_with(0.0f, 0.01);
    naive = naive + 0.1f * (0.0f - naive);
  }
  for (const float m : training.state.first_moment) REQUIRE(std::bit_cast<std::uint32_t>(m) == 0);
  CHECK(std::fpclassify(naive) == FP_SUBNORMAL);  // negative control: rounds to itself, for ever
}

#if defined(__SSE2__)
TEST_CASE("optim/adam: flush-to-zero mode changes no bit for gradients of 1e-15 and more (numerics OP2)") {
  const auto run = [](bool flush) {
    const unsigned mode = _mm_getcsr();
    if (flush) _mm_setcsr(mode | 0x8040u);
    Training<float> training(4096);
    const Random random(1, 2, 3);
    for (std::uint64_t t = 0; t < 1500; ++t) {
      for (std::size_t i = 0; i < 4096; ++i) {
        // From 1e-15 up, over 15 decades, for ten steps; then silence, so that the moments decay through the smallest normal number.
        training.arena.all_gradients()[i] =
            t < 10 ? 1e-15f * static_cast<float>(1 << (i % 31)) * (1 + static_cast<float>(random.uniform(i + 4096 * t)))
                   : 0.0f;
      }
      training.step(0.01);
    }
    std::vector<float> result = training.values();
    for (const Buffer<float>* moment : {&training.state.first_moment, &training.state.second_moment})
      result.insert(result.end(), moment->begin(), moment->end());
    _mm_setcsr(mode);
    return result;
  };
  CHECK(same_bits<float>(run(false), run(true)));
}
#endif

TEST_CASE(
    "optim/adam: what is left of a moment makes no denormal number in the next step, fused or not (numerics OP2)") {
  // Where a product is rounded on its own (no fused multiply-add), flush-to-zero mode would lose (1 - beta1) m and the moment would stay.
  for (const double beta1 : {0.0, 0.5, 0.9, 0.99}) {
    Training<float> training(64, AdamSettings{beta1, 0.999, 1e-15});
    const float weight = static_cast<float>(1 - beta1);
    std::size_t decaying = 0, lost = 0;
    float naive =
        0;  // negative control: with the limit of the second moment, moments are kept whose next step is denormal
    for (int t = 0; t < 10000; ++t) {
      const float gradient = t == 0 ? 1e-9f : 0.0f;
      training.step_with(gradient, 0.01);
      const float m = training.state.first_moment[0];
      REQUIRE((m == 0 || std::fpclassify(weight * m) == FP_NORMAL));
      decaying += m != 0 ? 1u : 0u;
      naive += weight * (gradient - naive);
      if (naive < 2 * std::numeric_limits<float>::min()) naive = 0;
      lost += std::fpclassify(weight * naive) == FP_SUBNORMAL ? 1u : 0u;
    }
    CHECK(training.state.first_moment[0] == 0);
    CHECK(decaying > 0);
    if (beta1 >= 0.9) CHECK(lost > 0);
  }
}
