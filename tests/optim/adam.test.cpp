// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Adam against its formula in long double, against the published transients (method sheet, section 8), and its laws (optim/concept.hpp).
#include "compmark/optim/adam.hpp"

#include <doctest/doctest.h>

#include <algorithm>
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
#include "compmark/optim/reference_adam.hpp"

using namespace compmark;

static_assert(Optimizer<Adam<float>> && Optimizer<Adam<double>> && Optimizer<ReferenceAdam<float>> &&
              Optimizer<ReferenceAdam<long double>>);

namespace {

/// Two anchor blocks and two fixed ones; sizes with every kind of tail, one above the chunk size.
template <class T>
ParameterArena<T> make_arena(std::size_t anchors = 37) {
  ParameterArena<T> arena;
  arena.add("anchor.a", anchors, 3, RowKind::anchor);
  arena.add("net.w", 1301, 17, RowKind::fixed);
  arena.add("anchor.b", anchors, 5, RowKind::anchor);
  arena.add("net.b", 1, 7, RowKind::fixed);
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

/// One parameter that sees the gradients given, at rate 1 from 0: returns the size of each update.
std::vector<double> updates(const std::vector<double>& gradients, std::uint64_t first_step = 0, double m = 0,
                            double v = 0) {
  ParameterArena<double> arena;
  arena.add("p", 1, 1, RowKind::fixed);
  const Adam<double> adam;
  AdamState<double> state;
  SerialExecutor executor;
  adam.prepare(arena.layout(), state);
  state.steps[0] = first_step;
  state.first_moment[0] = m;
  state.second_moment[0] = v;
  std::vector<double> result;
  for (const double g : gradients) {
    const double before = arena.all_values()[0];
    arena.all_gradients()[0] = g;
    adam.step(arena, rates_of(1, 1.0), state, executor);
    result.push_back(before - arena.all_values()[0]);
  }
  return result;
}

}  // namespace

TEST_CASE("optim/adam: follows the formula in long double over 200 steps") {
  // Both start from the same float values and see the same float gradients. Bound: each step rounds p by half a unit in the last place of
  // its size (2^-24 |p|), and m / denominator by a few 2^-24 of an update of at most 10 lr; measured worst 3.0e-6 here.
  ParameterArena<float> arena = make_arena<float>();
  ParameterArena<long double> exact = make_arena<long double>();
  std::copy(arena.all_values().begin(), arena.all_values().end(), exact.all_values().begin());
  AdamState<float> state;
  AdamState<long double> exact_state;
  const Adam<float> adam;
  const ReferenceAdam<long double> reference;
  adam.prepare(arena.layout(), state);
  reference.prepare(exact.layout(), exact_state);
  SerialExecutor executor;
  for (std::uint64_t t = 1; t <= 200; ++t) {
    fill_gradients(arena, t);
    fill_gradients(exact, t);
    adam.step(arena, rates_of(4, 0.005), state, executor);
    reference.step(exact, rates_of(4, 0.005), exact_state, executor);
  }
  double worst = 0, worst_m = 0, worst_v = 0;
  for (std::size_t i = 0; i < arena.all_values().size(); ++i) {
    worst = std::max(worst, std::abs(static_cast<double>(arena.all_values()[i] - exact.all_values()[i])));
    const double v = static_cast<double>(exact_state.second_moment[i]);
    if (v == 0) continue;
    worst_m = std::max(
        worst_m, std::abs(static_cast<double>(state.first_moment[i] - exact_state.first_moment[i])) / std::sqrt(v));
    worst_v = std::max(worst_v, std::abs(static_cast<double>(state.second_moment[i]) / v - 1));
  }
  INFO("worst value " << worst << ", m " << worst_m << ", v " << worst_v);
  CHECK(worst < 1e-5);
  CHECK(worst_m < 3e-6);
  CHECK(worst_v < 2e-5);
}

TEST_CASE("optim/adam: equals the plain scalar reference within four units in the last place a step") {
  ParameterArena<float> arena = make_arena<float>();
  ParameterArena<float> plain = make_arena<float>();
  AdamState<float> state;
  const Adam<float> adam;
  const ReferenceAdam<float> reference;
  adam.prepare(arena.layout(), state);
  SerialExecutor executor;
  constexpr float ulp = std::numeric_limits<float>::epsilon();
  for (std::uint64_t t = 1; t <= 20; ++t) {
    fill_gradients(arena, t);
    fill_gradients(plain, t);
    std::copy(arena.all_values().begin(), arena.all_values().end(), plain.all_values().begin());
    AdamState<float> plain_state = state;
    const std::vector<float> old_m(state.first_moment.begin(), state.first_moment.end());
    adam.step(arena, rates_of(4, 0.01), state, executor);
    reference.step(plain, rates_of(4, 0.01), plain_state, executor);
    for (std::size_t i = 0; i < arena.all_values().size(); ++i) {
      const float g = arena.all_gradients()[i];
      REQUIRE(std::abs(state.first_moment[i] - plain_state.first_moment[i]) <=
              4 * ulp * std::max(std::abs(g), std::abs(old_m[i])));
      REQUIRE(std::abs(state.second_moment[i] - plain_state.second_moment[i]) <= 4 * ulp * state.second_moment[i]);
      // An update is at most 10 lr; its m may carry the error above, so one part in 2^-20 of the largest update is allowed.
      REQUIRE(std::abs(arena.all_values()[i] - plain.all_values()[i]) <=
              ulp * (std::abs(arena.all_values()[i]) + 0.1f));
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
  ParameterArena<float> arena = make_arena<float>();
  std::fill(arena.all_values().begin(), arena.all_values().end(), 0.0f);
  fill_gradients(arena, 3);
  AdamState<float> state;
  const Adam<float> adam;
  adam.prepare(arena.layout(), state);
  SerialExecutor executor;
  adam.step(arena, rates_of(4, 0.25), state, executor);
  for (const ArenaLayout::Block& block : arena.layout().blocks()) {
    for (std::size_t i = block.offset; i < block.offset + block.size(); ++i) {
      if (std::abs(arena.all_gradients()[i]) < 1e-8f) continue;  // there epsilon shows: 1e-15 / |g|
      const float expected = arena.all_gradients()[i] > 0 ? -0.25f : 0.25f;
      REQUIRE(arena.all_values()[i] == doctest::Approx(static_cast<double>(expected)).epsilon(1e-6));
    }
  }
  // Negative control: 1 - beta^t in float is off by 1e-5 at the first step.
  CHECK(std::abs(static_cast<double>(1.0f - 0.999f) / detail::bias_correction(0.999, 1) - 1) > 1e-5);
  CHECK(std::abs(0.001 / detail::bias_correction(0.999, 1) - 1) < 1e-12);
}

TEST_CASE("optim/adam: a constant gradient of 1e-12 moves by lr, and by 1e-4 lr at the usual epsilon (numerics OP1)") {
  CHECK(updates({1e-12})[0] == doctest::Approx(0.999).epsilon(1e-6));
  ParameterArena<double> arena;
  arena.add("p", 1, 1, RowKind::fixed);
  const Adam<double> usual(AdamSettings{0.9, 0.999, 1e-8});
  AdamState<double> state;
  usual.prepare(arena.layout(), state);
  SerialExecutor executor;
  arena.all_gradients()[0] = 1e-12;
  usual.step(arena, rates_of(1, 1.0), state, executor);
  CHECK(-arena.all_values()[0] == doctest::Approx(1e-4).epsilon(1e-3));
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
  ParameterArena<float> arena = make_arena<float>();
  AdamState<float> state;
  const Adam<float> adam;
  adam.prepare(arena.layout(), state);
  SerialExecutor executor;
  fill_gradients(arena, 1);
  adam.step(arena, rates_of(4, 0.01), state, executor);
  const std::vector<float> before(arena.all_values().begin(), arena.all_values().end());
  const AdamState<float> state_before = state;
  fill_gradients(arena, 2);
  CHECK(adam.step(arena, rates_of(4, 0), state, executor).stepped_blocks == 0);
  CHECK(same_bits<float>(before, arena.all_values()));
  CHECK(same_state(state, state_before));
  CHECK(adam.step(arena, rates_of(4, 0.01), state, executor, {true, false}).stepped_blocks == 2);
  CHECK(state.steps == std::vector<std::uint64_t>{1, 2, 1, 2});
  for (const ArenaLayout::Block& block : arena.layout().blocks()) {
    const auto now = std::as_const(arena).all_values().subspan(block.offset, block.size());
    CHECK(same_bits<float>(std::span(before).subspan(block.offset, block.size()), now) ==
          (block.kind == RowKind::anchor));
  }
}

TEST_CASE(
    "optim/adam: law O2, a gradient that is not finite skips its block alone, is counted, and training goes on "
    "identically") {
  for (const float poison : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -2e19f}) {
    for (const std::size_t place : {0u, 777u, 16383u, 16384u, 22116u}) {
      ParameterArena<float> arena = make_arena<float>(), clean = make_arena<float>();
      AdamState<float> state, clean_state;
      const Adam<float> adam;
      ThreadExecutor executor(2);
      adam.prepare(arena.layout(), state);
      adam.prepare(clean.layout(), clean_state);
      for (std::uint64_t t = 1; t <= 4; ++t) {
        fill_gradients(arena, t);
        fill_gradients(clean, t);
        std::vector<double> rates = rates_of(4, 0.01);
        if (t == 2) {
          arena.gradients({1}).flat()[place] = poison;
          const AdamReport report = adam.step(arena, rates, state, executor);
          CHECK(report.skipped_blocks == 1);
          CHECK(report.first_skipped.index == 1);
          CHECK(report.stepped_blocks == 3);
          rates[1] = 0;
        } else {
          CHECK(adam.step(arena, rates, state, executor).skipped_blocks == 0);
        }
        adam.step(clean, rates, clean_state, executor);
      }
      CHECK(same_bits<float>(arena.all_values(), clean.all_values()));
      CHECK(same_state(state, clean_state));
    }
  }
}

TEST_CASE("optim/adam: the largest gradient that passes the guard keeps the moments finite for ever") {
  ParameterArena<float> arena;
  arena.add("p", 1, 1, RowKind::fixed);
  const Adam<float> adam;
  AdamState<float> state;
  adam.prepare(arena.layout(), state);
  SerialExecutor executor;
  for (int t = 0; t < 20000; ++t) {
    arena.all_gradients()[0] = 1.8446742e19f;
    REQUIRE(adam.step(arena, rates_of(1, 0.001), state, executor).skipped_blocks == 0);
  }
  CHECK(std::isfinite(state.second_moment[0]));
  CHECK(arena.all_values()[0] == doctest::Approx(-20.0).epsilon(0.01));
}

TEST_CASE("optim/adam: law O3, values without gradients keep their bits, minus zero too, for 100 steps") {
  ParameterArena<float> arena = make_arena<float>();
  arena.all_values()[0] = -0.0f;
  const std::vector<float> before(arena.all_values().begin(), arena.all_values().end());
  AdamState<float> state;
  const Adam<float> adam;
  adam.prepare(arena.layout(), state);
  SerialExecutor executor;
  for (int t = 0; t < 100; ++t) adam.step(arena, rates_of(4, 0.01), state, executor);
  CHECK(same_bits<float>(before, arena.all_values()));
}

TEST_CASE("optim/adam: zero_gradients_after leaves none, with the same bits otherwise") {
  ParameterArena<float> arena = make_arena<float>(), plain = make_arena<float>();
  AdamState<float> state, plain_state;
  const Adam<float> adam;
  SerialExecutor executor;
  adam.prepare(arena.layout(), state);
  adam.prepare(plain.layout(), plain_state);
  fill_gradients(arena, 1);
  fill_gradients(plain, 1);
  arena.all_gradients()[3] = std::numeric_limits<float>::quiet_NaN();
  plain.all_gradients()[3] = std::numeric_limits<float>::quiet_NaN();
  const std::vector<double> rates{0.01, 0.01, 0, 0.02};
  adam.step(arena, rates, state, executor, {false, true});
  adam.step(plain, rates, plain_state, executor);
  CHECK(same_bits<float>(arena.all_values(), plain.all_values()));
  CHECK(same_state(state, plain_state));
  for (const float g : arena.all_gradients()) REQUIRE(std::bit_cast<std::uint32_t>(g) == 0);
}

TEST_CASE("optim/adam: law O4, a row edit moves the moments of kept rows bit for bit and starts new rows at zero") {
  ParameterArena<float> arena = make_arena<float>();
  AdamState<float> state;
  const Adam<float> adam;
  adam.prepare(arena.layout(), state);
  SerialExecutor executor;
  fill_gradients(arena, 1);
  adam.step(arena, rates_of(4, 0.01), state, executor);
  const AdamState<float> before = state;
  const ArenaLayout old_layout = arena.layout();
  const std::vector<std::uint32_t> kept{0, 3, 4, 20, 36};
  const RowEdit edit{kept, 3};
  arena.edit_rows(edit);
  adam.edit_rows(edit, old_layout, arena.layout(), state);
  CHECK(state.steps == before.steps);
  const ArenaLayout& layout = arena.layout();
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
  ParameterArena<float> arena = make_arena<float>();
  AdamState<float> state;
  const Adam<float> adam;
  adam.prepare(arena.layout(), state);
  SerialExecutor executor;
  fill_gradients(arena, 1);
  adam.step(arena, rates_of(4, 0.01), state, executor);
  ParameterArena<float> resumed = make_arena<float>();
  std::copy(arena.all_values().begin(), arena.all_values().end(), resumed.all_values().begin());
  AdamState<float> restored;
  adam.prepare(resumed.layout(), restored);
  std::copy(state.first_moment.begin(), state.first_moment.end(), restored.first_moment.begin());
  std::copy(state.second_moment.begin(), state.second_moment.end(), restored.second_moment.begin());
  restored.steps = state.steps;
  for (std::uint64_t t = 2; t < 6; ++t) {
    fill_gradients(arena, t);
    fill_gradients(resumed, t);
    adam.step(arena, rates_of(4, 0.01), state, executor);
    adam.step(resumed, rates_of(4, 0.01), restored, executor);
  }
  CHECK(same_bits<float>(arena.all_values(), resumed.all_values()));
  CHECK(same_state(state, restored));
}

TEST_CASE("optim/adam: a row out of sight ends with moments of zero, not denormal (numerics OP2)") {
  ParameterArena<float> arena;
  arena.add("p", 1, 64, RowKind::fixed);
  const Adam<float> adam;
  AdamState<float> state;
  adam.prepare(arena.layout(), state);
  SerialExecutor executor;
  std::fill(arena.all_gradients().begin(), arena.all_gradients().end(), 1e-4f);
  adam.step(arena, rates_of(1, 0.01), state, executor);
  std::fill(arena.all_gradients().begin(), arena.all_gradients().end(), 0.0f);
  float naive = state.first_moment[0];
  for (int t = 0; t < 2000; ++t) {
    adam.step(arena, rates_of(1, 0.01), state, executor);
    naive = naive + 0.1f * (0.0f - naive);
  }
  for (const float m : state.first_moment) REQUIRE(std::bit_cast<std::uint32_t>(m) == 0);
  CHECK(std::fpclassify(naive) == FP_SUBNORMAL);  // negative control: rounds to itself, for ever
}

#if defined(__SSE2__)
TEST_CASE("optim/adam: flush-to-zero mode changes no bit for gradients of 1e-15 and more (numerics OP2)") {
  const auto run = [](bool flush) {
    const unsigned mode = _mm_getcsr();
    if (flush) _mm_setcsr(mode | 0x8040u);
    ParameterArena<float> arena;
    arena.add("p", 1, 4096, RowKind::fixed);
    const Adam<float> adam;
    AdamState<float> state;
    adam.prepare(arena.layout(), state);
    SerialExecutor executor;
    const Random random(1, 2, 3);
    for (std::uint64_t t = 0; t < 1500; ++t) {
      for (std::size_t i = 0; i < 4096; ++i) {
        // From 1e-15 up, over 15 decades, for ten steps; then silence, so that the moments decay through the smallest normal number.
        arena.all_gradients()[i] =
            t < 10 ? 1e-15f * static_cast<float>(1 << (i % 31)) * (1 + static_cast<float>(random.uniform(i + 4096 * t)))
                   : 0.0f;
      }
      adam.step(arena, rates_of(1, 0.01), state, executor);
    }
    std::vector<float> result(arena.all_values().begin(), arena.all_values().end());
    result.insert(result.end(), state.first_moment.begin(), state.first_moment.end());
    result.insert(result.end(), state.second_moment.begin(), state.second_moment.end());
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
    ParameterArena<float> arena;
    arena.add("p", 1, 64, RowKind::fixed);
    const Adam<float> adam(AdamSettings{beta1, 0.999, 1e-15});
    AdamState<float> state;
    adam.prepare(arena.layout(), state);
    SerialExecutor executor;
    const float weight = static_cast<float>(1 - beta1);
    std::size_t decaying = 0, lost = 0;
    float naive =
        0;  // negative control: with the limit of the second moment, moments are kept whose next step is denormal
    for (int t = 0; t < 10000; ++t) {
      std::fill(arena.all_gradients().begin(), arena.all_gradients().end(), t == 0 ? 1e-9f : 0.0f);
      adam.step(arena, rates_of(1, 0.01), state, executor);
      const float m = state.first_moment[0];
      REQUIRE((m == 0 || std::fpclassify(weight * m) == FP_NORMAL));
      decaying += m != 0 ? 1u : 0u;
      naive += weight * (arena.all_gradients()[0] - naive);
      if (naive < 2 * std::numeric_limits<float>::min()) naive = 0;
      lost += std::fpclassify(weight * naive) == FP_SUBNORMAL ? 1u : 0u;
    }
    CHECK(state.first_moment[0] == 0);
    CHECK(decaying > 0);
    if (beta1 >= 0.9) CHECK(lost > 0);
  }
}
