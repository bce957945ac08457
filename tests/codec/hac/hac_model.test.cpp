// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/hac/hac_model.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "codec/rate/anchor_scene.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"
#include "support/short_training.hpp"

namespace {

using namespace compmark;
using testing::D;
using testing::K;

constexpr HashGridShape small_hac_grid{.volume_resolution = {9, 18, 40},
                                       .volume_levels = 3,
                                       .volume_cap_log2 = 9,
                                       .plane_resolution = {20, 66},
                                       .plane_levels = 1,
                                       .plane_cap_log2 = 8};
constexpr bool short_run =
    testing::short_trainings;  // with sanitizers: the code runs, the optimised builds look closer
constexpr std::size_t hac_anchors = 230;
static_assert(EntropyModel<HacModel<float>> && EntropyModel<NoEntropyModel>);
static_assert(HacModel<float>::Network::outputs == 175 && HacModel<float>::Network::inputs == 96);
static_assert(!RatePhase{}.active());

template <class T>
struct HacScene : testing::AnchorScene<T, HacModel<T, D, K, small_hac_grid>, hac_anchors> {
  using Base = testing::AnchorScene<T, HacModel<T, D, K, small_hac_grid>, hac_anchors>;
  using Base::arena, Base::handles, Base::slope, Base::table, Base::view, Base::position, Base::feature, Base::scaling,
      Base::offset;
  using typename Base::Model;

  HacScene() : Base("hac model test") {
    this->fill(position, 1, 0.5);
    this->fill(feature, 2, 0.3);
    this->fill(scaling, 0.7, -4);
    this->fill(offset, 0.8, 0);
    this->fill(handles.mask, 2, 0);
    this->fill(handles.weight2, 0.15, 0);  // something to learn from at once
    for (std::size_t i = 3; i < hac_anchors; i += 7) arena.values(handles.mask)(i, 1) = T(-8);  // masked offsets
    this->kill_every_eleventh_anchor();
    Model::begin_context(arena, handles, std::as_const(arena).values(position), std::as_const(arena).values(feature),
                         std::as_const(arena).values(scaling), std::as_const(arena).values(offset));
    for (std::uint32_t row = 0; row < hac_anchors; row += row % 3 == 0 ? 1 : 2) this->rows.push_back(row);
    for (int which = 0; which < 3; ++which) {
      this->draw_slope(which);
      for (std::size_t row = 1; row < hac_anchors; row += 4) {  // visible, but hidden behind others
        for (std::size_t c = 0; c < table(which).columns; ++c) view(slope[which], which)(row, c) = T(0);
      }
    }
    this->settings.sample = 0.4;
  }
  std::string law(BlockHandle block) {
    const std::vector<T> gradient(arena.gradients(block).flat().begin(), arena.gradients(block).flat().end());
    return testing::gradient_law([&] { return this->loss(); }, arena.values(block).flat(),
                                 std::span<const double>(gradient), 1e-6, short_run ? 6 : 24);
  }
};

}  // namespace

TEST_CASE("hac/hac_model: gradients of all that is smooth, rows outside the list too (central differences in double)") {
  for (const bool all : {true, false}) {
    for (const bool anchor_mask : {true, false}) {
      if (short_run && all != anchor_mask) continue;
      CAPTURE(all);
      CAPTURE(anchor_mask);
      HacScene<double> scene;
      scene.settings.sample_all = all;
      scene.settings.anchor_mask = anchor_mask;
      static_cast<void>(scene.loss());
      SerialExecutor serial;
      scene.backward(serial);
      CHECK(scene.law(scene.feature) == "");
      CHECK(scene.law(scene.scaling) == "");
      CHECK(scene.law(scene.offset) == "");
      CHECK(scene.law(scene.handles.weight1) == "");
      CHECK(scene.law(scene.handles.bias1) == "");
      CHECK(scene.law(scene.handles.weight2) == "");
      CHECK(scene.law(scene.handles.bias2) == "");
      // Rows that are neither listed nor sampled have no gradient; sampled ones have, also where they are not listed.
      std::size_t outside = 0, untouched = 0;
      for (std::size_t row = 0; row < hac_anchors; ++row) {
        if ((scene.context.entries.mark[row] & 1) != 0) continue;
        double size = 0;
        for (std::size_t c = 0; c < D; ++c) size += std::abs(scene.arena.gradients(scene.feature)(row, c));
        if (scene.context.entries.mark[row] == 0) CHECK(size == 0);
        (size > 0 ? outside : untouched) += 1;
      }
      CHECK((outside > 10) == all);
      CHECK(untouched > 10);
    }
  }
}

TEST_CASE("hac/hac_model: the grid's gradient is that of the loss by its signs, to first order") {
  HacScene<double> scene;
  for (double& weight : scene.arena.values(scene.handles.weight1).flat()) weight *= 0.02;  // no unit turns on or off
  static_cast<void>(scene.loss());
  SerialExecutor serial;
  scene.backward(serial);
  // The loss is not linear in a sign, but here one sign moves it little.
  const MatrixView<double> grid = scene.arena.values(scene.handles.grid), d = scene.arena.gradients(scene.handles.grid);
  double product = 0, squares = 0, differences = 0;
  for (std::size_t i = 0; i < grid.size(); i += short_run ? 301 : 67) {
    const double kept = grid.data[i];
    grid.data[i] = 0.5;
    const double above = scene.loss();
    grid.data[i] = -0.5;
    const double below = scene.loss();
    grid.data[i] = kept;
    const double difference = (above - below) / 2;
    product += difference * d.data[i];
    squares += d.data[i] * d.data[i];
    differences += difference * difference;
  }
  CHECK(product / std::sqrt(squares * differences) > 0.99);
  CHECK(product / squares == doctest::Approx(1).epsilon(0.01));
}

TEST_CASE(
    "hac/hac_model: masks: the straight-through gradient is the loss with the bits minus without, times the "
    "slope") {
  for (const bool anchor_mask : {true, false}) {
    CAPTURE(anchor_mask);
    HacScene<double> scene;
    scene.settings.anchor_mask = anchor_mask;
    static_cast<void>(scene.loss());
    SerialExecutor serial;
    scene.backward(serial);
    const MatrixView<double> mask = scene.arena.values(scene.handles.mask),
                             d = scene.arena.gradients(scene.handles.mask);
    const double cells = static_cast<double>(mask.size());
    std::size_t tested = 0;
    for (std::size_t row = 0; row < hac_anchors; row += short_run ? 20 : 3) {
      if (!is_unmasked(mask(row, 0)) || !is_unmasked(mask(row, 1)))
        continue;  // the anchor stays coded, so that only offset 0 changes
      const double kept = mask(row, 0), p = mask_probability(kept), slope = mask_slope(kept);
      const double with = scene.loss();
      mask(row, 0) = -20;
      const double without = scene.loss();
      mask(row, 0) = kept;
      const double weight = scene.settings.mask_weight / cells;
      double expected =
          (with - without - weight * (p - mask_probability(-20.0)) + weight) * slope;  // its bits, and the regulariser
      if (anchor_mask) {
        // ... and a third of all bits of feature and scales: what the last unmasked offset of an anchor would take along.
        const double rest[2] = {mask(row, 1), mask(row, 2)};
        mask(row, 1) = mask(row, 2) = -20;
        const double alone = scene.loss();
        mask(row, 0) = -20;
        const double masked = scene.loss();
        mask(row, 0) = kept;
        mask(row, 1) = rest[0];
        mask(row, 2) = rest[1];
        const double geometry = (alone - masked - weight * (p - mask_probability(-20.0))) -
                                (with - without - weight * (p - mask_probability(-20.0)));
        expected += geometry / K * slope;
      }
      CHECK(d(row, 0) == doctest::Approx(expected).epsilon(1e-7));
      tested += (scene.context.entries.mark[row] & 2) != 0 ? 1 : 0;
    }
    CHECK(tested > (short_run ? 1 : 10));
  }
}

TEST_CASE("hac/hac_model: loss, sample and report fit together; bits are those of gaussian_bits") {
  HacScene<double> scene;
  scene.settings.sample = 1;
  SerialExecutor serial;
  const RateReport report = scene.forward(serial);
  CHECK(report.sampled == hac_anchors);
  CHECK(report.unmasked_share == doctest::Approx(1 - 21.0 / hac_anchors).epsilon(0.02));
  const double scalars = D + 6 + 3 * K;
  CHECK(report.bits_per_scalar ==
        doctest::Approx((D * report.bits_feature + 6 * report.bits_scaling + 3 * K * report.bits_offset) / scalars));
  double masks = 0;
  for (const double stored : scene.arena.values(scene.handles.mask).flat()) masks += mask_probability(stored);
  CHECK(report.loss ==
        doctest::Approx(scene.settings.lambda * (report.bits_per_scalar + report.hash_bits / (hac_anchors * scalars)) +
                        scene.settings.mask_weight * masks / (hac_anchors * K)));
  CHECK(report.unmasked_offsets > 0.8);
  CHECK(report.unmasked_offsets < report.unmasked_share);
  CHECK(report.step_feature > 0.3);
  CHECK(report.step_feature < 2);
  CHECK(report.step_scaling == doctest::Approx(0.001).epsilon(0.7));
  scene.settings.anchor_mask = false;  // HAC: unmasked ones alone, times their share
  const RateReport unmasked = scene.forward(serial);
  CHECK(unmasked.sampled < hac_anchors);
  CHECK(unmasked.sampled == static_cast<std::size_t>(std::lround(unmasked.unmasked_share * hac_anchors)));
  CHECK(unmasked.unmasked_share * unmasked.bits_per_scalar == doctest::Approx(report.bits_per_scalar));
  scene.phase.counts = false;
  CHECK(scene.forward(serial).loss == 0);
  CHECK(scene.context.entries.full == 0);
}

TEST_CASE("hac/hac_model: noise of the base steps; scales stay positive; nothing else is touched") {
  HacScene<float> scene;
  scene.phase = {.noise = true, .seed = 1, .iteration = 2};
  for (float& s : scene.table(1).flat()) s = std::log(2e-4f);  // smaller than the noise on them
  SerialExecutor serial;
  const RateReport report = scene.forward(serial);
  CHECK(report.loss == 0);
  double sums[3] = {}, squares[3] = {}, n[3] = {};
  std::vector<bool> listed(hac_anchors, false);
  bool naive_fails = false;
  for (const std::uint32_t row : scene.rows) listed[row] = true;
  for (int which = 0; which < 3; ++which) {
    const double step = which == 0 ? 1 : (which == 1 ? 0.001 : 0.2);
    for (std::size_t i = 0; i < scene.out[which].size(); ++i) {
      const std::size_t row = i / scene.table(which).columns;
      if (!listed[row]) {
        CHECK(scene.out[which][i] == scene.table(which).data[i]);
        continue;
      }
      if (which == 1) {
        CHECK(std::exp(scene.out[1][i]) >= 0.999e-6f);
        naive_fails = naive_fails || scene.out[1][i] < -13.8f;
        continue;
      }
      const double u = static_cast<double>(scene.out[which][i] - scene.table(which).data[i]) / step;
      CHECK(std::abs(u) < 0.50001);
      sums[which] += u;
      squares[which] += u * u;
      n[which] += 1;
    }
    if (which == 1) continue;
    CHECK(std::abs(sums[which] / n[which]) < 4 / std::sqrt(12 * n[which]));
    CHECK(squares[which] / n[which] == doctest::Approx(1.0 / 12).epsilon(0.1));
  }
  CHECK(naive_fails);  // scales that the noise would have made negative were held
  scene.backward(serial);
  bool held_is_zero = true;
  for (const std::uint32_t row : scene.rows) {
    for (std::size_t c = 0; c < D; ++c)
      CHECK(scene.arena.gradients(scene.feature)(row, c) == scene.view(scene.slope[0], 0)(row, c));
    for (std::size_t c = 0; c < 6; ++c) {
      if (scene.view(scene.out[1], 1)(row, c) < -13.8f)
        held_is_zero = held_is_zero && scene.arena.gradients(scene.scaling)(row, c) == 0;
    }
  }
  CHECK(held_is_zero);
  scene.phase = {};
  scene.forward(serial);
  for (const float d : scene.arena.gradients(scene.handles.weight1).flat()) CHECK(d == 0);
}

TEST_CASE("hac/hac_model: coded steps are the sixteenths of an octave next to the steps, as the coder finds them") {
  using Attributes = HacAttributes<double, 8, 3>;
  const std::array<double, 3> base{1, 0.001, 0.2};
  double farthest = 0;
  for (double r = -2.5; r < 6; r += 0.0137) {
    const double raw[3] = {r, r + 0.004, r + 0.009};
    double q[3 + Attributes::W], coded[3];
    Attributes::steps(raw, base, q);
    Attributes::coded_steps(raw, base, coded);
    for (std::size_t g = 0; g < 3; ++g) {
      const double index = 16 * std::log2(coded[g] / base[g]);
      CHECK(std::abs(index - std::nearbyint(index)) < 1e-4);  // ratios have 24 fraction bits: 4.4e-5 at the least
      farthest = std::max(farthest, std::abs(16 * std::log2(q[g] / coded[g])));
      CHECK(std::nearbyint(index) == step_index(static_cast<std::int32_t>(std::lround(raw[g] * 0x1p16))));
    }
  }
  CHECK(farthest < 0.501);
  CHECK(farthest > 0.45);
  const double far[3] = {1e30, -1e30, std::numeric_limits<double>::quiet_NaN()};
  double coded[3];
  Attributes::coded_steps(far, base, coded);
  CHECK(coded[0] == 2 * base[0]);
  CHECK(coded[1] == Attributes::least_step * base[1]);
  CHECK(std::isnan(coded[2]));
}

TEST_CASE("hac/hac_model: rounding lands on whole steps, to within half of one (QZ2)") {
  HacScene<double> scene;
  scene.phase.round = true;
  scene.phase.counts = false;
  SerialExecutor serial;
  scene.forward(serial);
  double worst = 0, farthest = 0;
  for (std::size_t e = 0; e < scene.context.entries.light; ++e) {
    const std::size_t row = scene.context.entries.row[e];
    for (int which = 0; which < 3; ++which) {
      const double q = scene.context.step[3 * e + static_cast<std::size_t>(which)];
      for (std::size_t c = 0; c < scene.table(which).columns; ++c) {
        double after = scene.view(scene.out[which], which)(row, c), before = scene.table(which)(row, c);
        if (which == 1) {
          after = std::exp(after);
          before = std::exp(before);
          if (after < 1.001e-6) continue;  // rounded to nothing, held
        }
        worst = std::max(worst, std::abs(after / q - std::nearbyint(after / q)));
        farthest = std::max(farthest, std::abs(after - before) / q);
      }
    }
  }
  CHECK(worst < 1e-9);
  CHECK(farthest <= 0.5 + 1e-9);
  CHECK(farthest > 0.45);
  scene.backward(serial);  // straight through (QZ4)
  for (const std::uint32_t row : scene.rows) {
    for (std::size_t c = 0; c < D; ++c) {
      CHECK(scene.arena.gradients(scene.feature)(row, c) == scene.view(scene.slope[0], 0)(row, c));
    }
  }
}

TEST_CASE("hac/hac_model: a share of the light anchors teaches its steps at the inverse weight; nothing else changes") {
  HacScene<double> all, some;
  some.settings.step_share = 0.25;
  SerialExecutor serial;
  all.forward(serial);
  some.forward(serial);
  all.backward(serial);
  some.backward(serial);
  std::size_t drawn = 0, could = 0;
  for (std::size_t i = 0; i < all.context.d_step.size(); ++i) {
    could += all.context.d_step[i] != 0 ? 1 : 0;
    if (some.context.d_step[i] == 0) continue;
    CHECK(some.context.d_step[i] == doctest::Approx(4 * all.context.d_step[i]));
    ++drawn;
  }
  CHECK(static_cast<double>(drawn) == doctest::Approx(0.25 * static_cast<double>(could)).epsilon(0.6));
  for (const BlockHandle block : {all.feature, all.scaling, all.offset, all.handles.mask}) {
    const auto a = all.arena.gradients(block).flat(), b = some.arena.gradients(block).flat();
    CHECK(std::equal(a.begin(), a.end(), b.begin()));
  }
}

TEST_CASE("hac/hac_model: same bits at any thread count") {
  HacScene<float> one, four;
  SerialExecutor serial;
  ThreadExecutor threads(4);
  const RateReport a = one.forward(serial), b = four.forward(threads);
  CHECK(a.loss == b.loss);
  for (int which = 0; which < 3; ++which) CHECK(one.out[which] == four.out[which]);
  one.backward(serial);
  four.backward(threads);
  CHECK(std::memcmp(one.arena.all_gradients().data(), four.arena.all_gradients().data(),
                    one.arena.all_gradients().size_bytes()) == 0);
}

TEST_CASE("hac/hac_model: box and statistics of the published rule, of unmasked anchors") {
  HacScene<double> scene;
  const MatrixView<double> box = scene.arena.values(scene.handles.box),
                           statistics = scene.arena.values(scene.handles.statistics);
  const MatrixView<double> position = scene.arena.values(scene.position), mask = scene.arena.values(scene.handles.mask);
  double least = 1e9, most = -1e9, sum = 0, squares = 0, n = 0;
  for (std::size_t row = 0; row < hac_anchors; ++row) {
    least = std::min(least, position(row, 1));
    most = std::max(most, position(row, 1));
    if (!any_unmasked(mask.row(row), K)) continue;
    const double l = std::exp(scene.table(1)(row, 2));
    sum += l;
    squares += l * l;
    n += 1;
  }
  CHECK(box(0, 1) == doctest::Approx(1.2 * least));  // negative
  CHECK(box(1, 1) == doctest::Approx(1.2 * most));
  CHECK(statistics(0, D + 2) == doctest::Approx(sum / n));
  CHECK(statistics(1, D + 2) == doctest::Approx(std::sqrt(squares / n - sum / n * sum / n)));
  // Away from the origin the box is wider on both sides too; a channel that does not vary keeps a deviation.
  for (std::size_t row = 0; row < hac_anchors; ++row) {
    position(row, 1) += 100;
    scene.table(0)(row, 4) = 7;
  }
  HacModel<double, D, K, small_hac_grid>::begin_context(scene.arena, scene.handles, position, scene.table(0),
                                                        scene.table(1), scene.table(2));
  CHECK(box(0, 1) == doctest::Approx(0.8 * (least + 100)));
  CHECK(box(1, 1) == doctest::Approx(1.2 * (most + 100)));
  CHECK(statistics(0, 4) == 7);
  CHECK(statistics(1, 4) == doctest::Approx(1.0 / 64));
}

TEST_CASE(
    "hac/hac_model: an anchor far away is outside the box, which is that of the others; one at the edge of the "
    "core is inside") {
  HacScene<double> scene;
  const MatrixView<double> box = scene.arena.values(scene.handles.box), position = scene.arena.values(scene.position);
  const auto begin = [&] {
    HacModel<double, D, K, small_hac_grid>::begin_context(scene.arena, scene.handles, position, scene.table(0),
                                                          scene.table(1), scene.table(2));
    return box(1, 1) - box(0, 1);
  };
  const RobustBall ball = robust_ball(hac_anchors, [&](std::size_t i) { return position.row(i); });
  const double width = begin(), kept = position(3, 1);
  for (const double away : {17.0, 1e3, 1e30}) {
    position(3, 1) = ball.center[1] + away * ball.wide;
    CHECK(begin() == doctest::Approx(width).epsilon(0.1));
    position(3, 1) = std::numeric_limits<double>::infinity();
    CHECK(begin() == doctest::Approx(width).epsilon(0.1));
  }
  position(3, 1) = ball.center[1] + 12 * ball.wide;  // the control
  CHECK(begin() > 3 * width);
  position(3, 1) = kept;
  CHECK(begin() == width);
}

namespace {
/// Descent by signs on the rate, and on a loss that the noise of features raises; returns the last report.
RateReport trained_hac(double lambda, int iterations, bool structured) {
  HacScene<float> scene;
  scene.settings.lambda = lambda;
  scene.settings.mask_weight = 0;
  scene.settings.sample = 1;
  if (structured) {  // features of two kinds, by where the anchor is
    for (std::size_t row = 0; row < hac_anchors; ++row) {
      const float side = scene.arena.values(scene.position)(row, 0) > 0.5f ? 4.0f : -4.0f;
      for (std::size_t c = 0; c < D; ++c) scene.table(0)(row, c) = 0.15f * scene.table(0)(row, c) + side;
    }
    HacScene<float>::Model::begin_context(scene.arena, scene.handles, scene.arena.values(scene.position),
                                          scene.table(0), scene.table(1), scene.table(2));
  }
  SerialExecutor serial;
  RateReport report;
  for (int t = 0; t < iterations; ++t) {
    scene.phase.iteration = static_cast<std::uint64_t>(t);
    report = scene.forward(serial);
    for (std::size_t i = 0; i < scene.slope[0].size(); ++i)
      scene.slope[0][i] = 2e-3f * (scene.out[0][i] - scene.table(0).data[i]);
    std::fill(scene.slope[1].begin(), scene.slope[1].end(), 0.0f);
    std::fill(scene.slope[2].begin(), scene.slope[2].end(), 0.0f);
    scene.backward(serial);
    for (const BlockHandle block :
         {scene.handles.grid, scene.handles.weight1, scene.handles.bias1, scene.handles.weight2, scene.handles.bias2}) {
      const MatrixView<float> x = scene.arena.values(block), d = scene.arena.gradients(block);
      for (std::size_t i = 0; i < x.size(); ++i) x.data[i] -= d.data[i] > 0 ? 2e-3f : (d.data[i] < 0 ? -2e-3f : 0.0f);
    }
  }
  return report;
}
}  // namespace

TEST_CASE(
    "hac/hac_model: the context learns where which features are, and the rate holds the steps that noise alone "
    "collapses (QD2)") {
  constexpr int iterations = short_run ? 2 : 150;
  const RateReport before = trained_hac(0.05, 1, true), after = trained_hac(0.05, iterations, true);
  const RateReport free_steps = trained_hac(0, iterations, false), rated = trained_hac(0.5, iterations, false);
  if (short_run) return;
  CAPTURE(before.bits_feature);
  CAPTURE(after.bits_feature);
  CHECK(after.bits_feature < before.bits_feature - 0.5);
  CHECK(after.hash_bits < 1.001 * before.hash_bits);
  CAPTURE(free_steps.step_feature);
  CAPTURE(rated.step_feature);
  CHECK(free_steps.step_feature < 0.25);  // negative control
  CHECK(rated.step_feature > 0.5);
}

TEST_CASE("hac/hac_model: a NaN or infinity in one anchor, mask or grid entry stays where it is") {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  for (const bool round : {false, true}) {
    HacScene<float> scene;
    scene.phase.round = round;
    scene.settings.sample = 1;
    const std::size_t bad[3] = {scene.rows[2], scene.rows[6], 5};  // two that are listed, one that is not
    CHECK(std::find(scene.rows.begin(), scene.rows.end(), 5u) == scene.rows.end());
    scene.table(0)(bad[0], 1) = nan;
    scene.table(1)(bad[1], 2) = infinity;
    scene.table(2)(bad[2], 0) = -infinity;
    scene.arena.values(scene.position)(10, 1) = nan;
    scene.arena.values(scene.handles.mask)(20, 0) = nan;
    scene.arena.values(scene.handles.grid).data[77] = nan;
    for (const std::size_t row : {bad[0], bad[1]}) {  // an anchor that is not decoded has no gradient
      for (int which = 0; which < 3; ++which) {
        for (std::size_t c = 0; c < scene.table(which).columns; ++c) scene.view(scene.slope[which], which)(row, c) = 0;
      }
    }
    SerialExecutor serial;
    const RateReport report = scene.forward(serial);
    CHECK(std::isfinite(report.loss));
    CHECK(report.bits_per_scalar > 0);
    CHECK(std::isnan(scene.out[0][bad[0] * D + 1]));  // for the decoder to see
    scene.backward(serial);
    std::size_t broken = 0;
    for (const float d : scene.arena.all_gradients()) broken += std::isfinite(d) ? 0 : 1;
    CHECK(broken == 0);
    scene.arena.values(scene.handles.weight1).data[3] = nan;  // a weight: every anchor keeps the least step
    scene.forward(serial);
    for (std::size_t i = 0; i < scene.context.entries.light * 3; ++i) CHECK(scene.context.step[i] > 0);
  }
}

TEST_CASE("hac/hac_model: no rows, no sample, nobody unmasked") {
  HacScene<float> scene;
  SerialExecutor serial;
  scene.rows.clear();
  RateReport report = scene.forward(serial);
  scene.backward(serial);
  CHECK(report.sampled > 0);  // of rows that are not listed
  scene.settings.sample_all = false;
  report = scene.forward(serial);
  scene.backward(serial);
  CHECK(report.sampled == 0);
  CHECK(report.bits_per_scalar == 0);
  CHECK(report.loss > 0);  // grid and masks
  scene.settings.sample = 0;
  scene.rows = {1, 2};
  CHECK(scene.forward(serial).sampled == 0);
  scene.backward(serial);
  scene.settings.sample = 1;
  for (float& stored : scene.arena.values(scene.handles.mask).flat()) stored = -9;
  for (const bool anchor_mask : {true, false}) {
    scene.settings.anchor_mask = anchor_mask;
    report = scene.forward(serial);
    scene.backward(serial);
    CHECK(report.unmasked_share == 0);
    CHECK(report.bits_per_scalar == 0);
    for (const float d : scene.arena.all_gradients()) REQUIRE(std::isfinite(d));
  }
}
