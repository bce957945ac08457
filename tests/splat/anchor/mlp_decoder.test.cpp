// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// MlpDecoder against ReferenceDecoder (float, double, one lane and many), both against central differences for every
// parameter block and option, the laws A1-A4 of splat/anchor/concept.hpp, and the cases PR7, PR9, QU1, QU2, ML4 of
// docs/spec/numerics.md with their negative controls. More than 300 lines: the fixture is shared by all cases.
#include "compmark/splat/anchor/mlp_decoder.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numeric>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/anchor/reference_decoder.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;

// Few shapes, because each is some seconds of compilation.
constexpr DecoderShape odd{10, 3};  // padded to whole packs
constexpr DecoderShape with_distance{8, 3, true};
constexpr DecoderShape with_bank{8, 3, false, true};
constexpr DecoderShape with_appearance{8, 3, false, false, 5};
constexpr DecoderShape with_all{12, 4, true, true, 3};

template <class T>
std::array<T*, 14> list(const GaussianColumns<T>& c) {
  return {c.mean[0],     c.mean[1],     c.mean[2],     c.scale[0], c.scale[1], c.scale[2], c.rotation[0],
          c.rotation[1], c.rotation[2], c.rotation[3], c.opacity,  c.color[0], c.color[1], c.color[2]};
}

/// A random table, its decoder, one view of some of its anchors, and a loss that is linear in the Gaussians.
template <class Decoder>
struct Fixture {
  using T = typename Decoder::Scalar;
  static constexpr DecoderShape shape = Decoder::shape;
  ParameterArena<T> arena;
  AnchorHandles anchors;
  typename Decoder::Handles heads;
  Decoder decoder;
  typename Decoder::Context context;
  GaussianBatch<T> batch, d_batch;
  std::vector<std::uint32_t> visible;
  std::array<double, 3> center{0.3, -0.2, 3.1};
  std::size_t view = 1;
  double used_share = 1;  ///< share of anchors whose Gaussians have a gradient at all

  Fixture(std::size_t n, std::size_t n_visible, std::uint64_t seed = 1) {
    anchors = add_anchor_blocks(arena, n, shape);
    heads = Decoder::add_parameters(arena, 3);
    Decoder::initialise(arena, heads, seed);
    const auto fill = [&](BlockHandle block, double mean, double deviation) {
      const Random random(seed, 7, block.index);
      std::size_t i = 0;
      for (T& value : arena.values(block).flat()) value = static_cast<T>(mean + deviation * random.normal(i++));
    };
    fill(anchors.position, 0, 1);
    fill(anchors.offset, 0, 0.5);
    fill(anchors.scaling, -1, 0.4);
    fill(anchors.feature, 0, 1);
    for (std::size_t i = 0; i < n_visible; ++i)
      visible.push_back(static_cast<std::uint32_t>((i * n) / std::max<std::size_t>(n_visible, 1)));
  }
  AnchorColumns<const T> table() const { return anchor_values(arena, anchors); }

  template <class E>
  std::size_t forward(E& executor) {
    return decoder.forward(table(), visible, center, view, arena, heads, batch, context, executor);
  }
  std::size_t forward() {
    SerialExecutor executor;
    return forward(executor);
  }
  /// Weight of one entry of one Gaussian in the loss: keyed by what the Gaussian is, not by its row.
  T loss_weight(std::uint32_t slot, std::size_t column) const {
    const auto k = static_cast<std::uint32_t>(shape.offsets);
    if (Random(11, 0, 1).uniform(slot / k) >= used_share) return T(0);
    return static_cast<T>(Random(11, 0, 0).normal(slot * 14 + column));
  }
  double loss() {
    const std::size_t count = forward();
    const auto statistics = decoder.statistics(context);
    double sum = 0;
    const auto columns = list(std::as_const(batch).columns());
    for (std::size_t c = 0; c < 14; ++c) {
      for (std::size_t row = 0; row < count; ++row) {
        sum +=
            static_cast<double>(loss_weight(statistics.gaussian_slot[row], c)) * static_cast<double>(columns[c][row]);
      }
    }
    return sum;
  }
  template <class E>
  std::size_t forward_backward(E& executor) {
    const std::size_t count = forward(executor);
    d_batch.resize(count);
    const auto statistics = decoder.statistics(context);
    const auto columns = list(d_batch.columns());
    for (std::size_t c = 0; c < 14; ++c) {
      for (std::size_t row = 0; row < count; ++row) columns[c][row] = loss_weight(statistics.gaussian_slot[row], c);
    }
    decoder.backward(table(), visible, center, view, arena, heads, std::as_const(d_batch).columns(),
                     anchor_gradients(arena, anchors), context, executor);
    return count;
  }
  std::size_t forward_backward() {
    SerialExecutor executor;
    return forward_backward(executor);
  }
  /// Gaussians, then statistics, then gradients, as one list.
  std::vector<double> everything() const {
    std::vector<double> all;
    for (const T* column : list(batch.columns())) all.insert(all.end(), column, column + batch.size());
    const auto statistics = decoder.statistics(context);
    all.insert(all.end(), statistics.opacity_sum.begin(), statistics.opacity_sum.end());
    all.insert(all.end(), statistics.gaussian_slot.begin(), statistics.gaussian_slot.end());
    const auto gradients = arena.all_gradients();
    all.insert(all.end(), gradients.begin(), gradients.end());
    return all;
  }
  double relative_gradient_distance(const std::vector<double>& other_gradients, BlockHandle block) const {
    const auto& place = arena.layout().block(block);
    double difference = 0, size = 0;
    for (std::size_t i = place.offset; i < place.offset + place.size(); ++i) {
      const double expected = other_gradients[i];
      difference += std::pow(static_cast<double>(arena.all_gradients()[i]) - expected, 2);
      size += expected * expected;
    }
    return std::sqrt(difference / (size > 0 ? size : 1));
  }
};

/// Fast decoder against the reference of the same scalar; the largest differences over Gaussians (absolute) and blocks
/// (relative L2).
template <class Fast>
void compare(std::size_t n, std::size_t n_visible, double tolerance, double used_share = 1) {
  using T = typename Fast::Scalar;
  CAPTURE(n_visible);
  CAPTURE(used_share);
  Fixture<Fast> fast(n, n_visible);
  Fixture<ReferenceDecoder<T, Fast::shape>> reference(n, n_visible);
  fast.used_share = reference.used_share = used_share;
  const std::size_t count = reference.forward_backward();
  REQUIRE(fast.forward_backward() == count);
  const auto a = fast.decoder.statistics(fast.context);
  const auto b = reference.decoder.statistics(reference.context);
  CHECK(std::vector<std::uint32_t>(a.gaussian_slot.begin(), a.gaussian_slot.end()) == reference.context.slot);
  for (std::size_t i = 0; i < n_visible; ++i) CHECK(std::abs(a.opacity_sum[i] - b.opacity_sum[i]) <= tolerance * 10);
  double worst = 0;
  const auto x = list(std::as_const(fast.batch).columns()), y = list(std::as_const(reference.batch).columns());
  for (std::size_t c = 0; c < 14; ++c) {
    for (std::size_t row = 0; row < count; ++row)
      worst = std::max(worst, std::abs(static_cast<double>(x[c][row] - y[c][row])));
  }
  CHECK(worst <= tolerance);
  const std::vector<double> expected(reference.arena.all_gradients().begin(), reference.arena.all_gradients().end());
  for (std::size_t block = 0; block < fast.arena.layout().blocks().size(); ++block) {
    CAPTURE(fast.arena.layout().blocks()[block].name);
    CHECK(fast.relative_gradient_distance(expected, {block}) <= tolerance);
  }
}

template <class Fast>
void compare_sizes(double tolerance) {
  for (const std::size_t n_visible : {0u, 1u, 15u, 16u, 17u, 64u, 65u, 200u}) compare<Fast>(300, n_visible, tolerance);
  compare<Fast>(3500, 3100, tolerance, 0.4);  // several chunks; more than half of the anchors get no gradient
}

/// Law A1, every block.
template <class Decoder>
void check_gradients(std::uint64_t seed) {
  Fixture<Decoder> f(40, 33, seed);
  REQUIRE(f.forward_backward() > 20);
  const std::vector<double> gradients(f.arena.all_gradients().begin(), f.arena.all_gradients().end());
  for (std::size_t block = 0; block < f.arena.layout().blocks().size(); ++block) {
    const auto& place = f.arena.layout().blocks()[block];
    CAPTURE(place.name);
    const std::span<double> values = f.arena.values({block}).flat();
    // Measured: at most 3e-9 of the largest entry; the bound leaves room for another compiler's rounding.
    CHECK(testing::gradient_law([&] { return f.loss(); }, values,
                                std::span(gradients).subspan(place.offset, place.size()), 1e-7, 24) == "");
  }
}

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

}  // namespace

TEST_CASE("anchor/mlp_decoder: equals the reference in double, every option") {
  // Measured 3e-15; the sums differ in the use of fused multiply-add only.
  compare_sizes<MlpDecoder<double, odd>>(1e-12);
  compare_sizes<MlpDecoder<double, with_distance>>(1e-12);
  compare_sizes<MlpDecoder<double, with_bank>>(1e-12);
  compare_sizes<MlpDecoder<double, with_appearance>>(1e-12);
  compare_sizes<MlpDecoder<double, with_all>>(1e-12);
}

TEST_CASE("anchor/mlp_decoder: equals the reference in float and at one lane") {
  // Measured 1.5e-6 (32-term sums of order one, 6e-8 a rounding).
  compare_sizes<MlpDecoder<float, odd>>(1e-5);
  compare_sizes<MlpDecoder<float, with_all>>(1e-5);
  compare<MlpDecoder<float>>(400, 333, 1e-5);
  compare<MlpDecoder<float, odd, 4>>(300, 133, 1e-5);
  compare<MlpDecoder<float, odd, 1>>(300, 133, 1e-5);
}

TEST_CASE("anchor/mlp_decoder: gradients of every block and option, against central differences (A1)") {
  check_gradients<MlpDecoder<double, odd>>(2);
  check_gradients<MlpDecoder<double, with_distance>>(3);
  check_gradients<MlpDecoder<double, with_bank>>(4);
  check_gradients<MlpDecoder<double, with_appearance>>(5);
  check_gradients<MlpDecoder<double, with_all>>(6);
  check_gradients<ReferenceDecoder<double, with_all>>(6);
}

TEST_CASE("anchor/mlp_decoder: gradients of positions have the path through the view direction (SH1)") {
  Fixture<MlpDecoder<double, odd>> f(40, 33, 2);
  REQUIRE(f.forward_backward() > 20);
  const MatrixView<double> gradient = anchor_gradients(f.arena, f.anchors).position;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double slope = 0;
    for (std::size_t n = 0; n < 40; ++n) slope += gradient(n, axis);
    const double step = 1e-6;
    /// The loss with all anchors moved along the axis, and the camera by a share of it.
    const auto moved = [&](double by, double camera) {
      for (std::size_t n = 0; n < 40; ++n) f.arena.values(f.anchors.position)(n, axis) += by;
      f.center[axis] += camera * by;
      const double loss = f.loss();
      for (std::size_t n = 0; n < 40; ++n) f.arena.values(f.anchors.position)(n, axis) -= by;
      f.center[axis] -= camera * by;
      return loss;
    };
    const double difference = (moved(step, 0) - moved(-step, 0)) / (2 * step);
    const double frozen = (moved(step, 1) - moved(-step, 1)) / (2 * step);
    CHECK(std::abs(slope - difference) < 1e-6 * (1 + std::abs(difference)));
    CHECK(std::abs(frozen - difference) > 1e-2);  // negative control: with the camera beside them, no direction changes
  }
}

TEST_CASE("anchor/mlp_decoder: an anchor that is not visible gets exactly zero gradient (A2)") {
  Fixture<MlpDecoder<float, with_distance>> f(100, 37);
  f.forward_backward();
  const std::set<std::uint32_t> visible(f.visible.begin(), f.visible.end());
  const auto gradients = anchor_gradients(f.arena, f.anchors);
  for (std::uint32_t row = 0; row < 100; ++row) {
    double size = 0;
    for (const MatrixView<float>& block :
         {gradients.position, gradients.offset, gradients.scaling, gradients.feature}) {
      for (std::size_t c = 0; c < block.columns; ++c) size += std::abs(block(row, c));
    }
    if (visible.count(row) == 0) CHECK(size == 0);
  }
}

TEST_CASE("anchor/mlp_decoder: same bits at any thread count (A3)") {
  using Fast = MlpDecoder<float, with_all>;
  Fixture<Fast> serial(4000, 3001);
  serial.forward_backward();
  const std::vector<double> expected = serial.everything();
  for (const std::size_t threads : {2u, 3u, 5u}) {
    ThreadExecutor executor(threads);
    Fixture<Fast> threaded(4000, 3001);
    threaded.forward_backward(executor);
    CHECK(same_bits(threaded.everything(), expected));
  }
}

TEST_CASE("anchor/mlp_decoder: Gaussians are those of positive opacity, in the published order (A4)") {
  Fixture<MlpDecoder<float>> f(500, 321);
  const std::size_t count = f.forward();
  const auto statistics = f.decoder.statistics(f.context);
  std::vector<double> sums(f.visible.size(), 0);
  std::vector<std::size_t> index(500, 0);
  for (std::size_t i = 0; i < f.visible.size(); ++i) index[f.visible[i]] = i;
  std::size_t previous = 0;
  const auto columns = std::as_const(f.batch).columns();
  for (std::size_t row = 0; row < count; ++row) {
    CHECK(columns.opacity[row] > 0);
    CHECK(columns.opacity[row] <= 1);
    const std::size_t i = index[statistics.gaussian_slot[row] / 10], k = statistics.gaussian_slot[row] % 10;
    const std::size_t place = (i / 16 * 10 + k) * 16 + i % 16;
    CHECK((row == 0 || place > previous));
    previous = place;
    sums[i] += columns.opacity[row];
  }
  for (std::size_t i = 0; i < sums.size(); ++i)
    CHECK(std::abs(sums[i] - static_cast<double>(statistics.opacity_sum[i])) < 1e-5);
  CHECK(count > 1000);
  CHECK(count < 2500);
}

TEST_CASE("anchor/mlp_decoder: nothing visible, and nothing opaque") {
  Fixture<MlpDecoder<float>> f(50, 0);
  CHECK(f.forward_backward() == 0);
  Fixture<MlpDecoder<float>> g(50, 50);
  for (float& bias : g.arena.values(g.heads.opacity.bias2).flat()) bias = -30;
  CHECK(g.forward_backward() == 0);
  for (const float gradient : g.arena.all_gradients()) CHECK(gradient == 0);
  const auto statistics = g.decoder.statistics(g.context);
  for (const float sum : statistics.opacity_sum) CHECK(sum == 0);
}

TEST_CASE("anchor/mlp_decoder: gradients are added, not written") {
  Fixture<MlpDecoder<double, with_all>> f(60, 40);
  f.forward_backward();
  const std::vector<double> once(f.arena.all_gradients().begin(), f.arena.all_gradients().end());
  f.forward_backward();
  for (std::size_t i = 0; i < once.size(); ++i)
    CHECK(std::abs(f.arena.all_gradients()[i] - 2 * once[i]) <= 1e-12 * (1 + std::abs(once[i])));
}

TEST_CASE("anchor/mlp_decoder: a poisoned anchor gives no Gaussians, is counted, and harms no other (ML4)") {
  for (const float poison : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                             -std::numeric_limits<float>::infinity()}) {
    Fixture<MlpDecoder<float>> clean(100, 100), poisoned(100, 100);
    poisoned.arena.values(poisoned.anchors.feature)(42, 5) = poison;
    const std::size_t all = clean.forward_backward(), rest = poisoned.forward_backward();
    CHECK(poisoned.context.non_finite_anchors == 1);
    CHECK(clean.context.non_finite_anchors == 0);
    std::size_t of_poisoned = 0;
    for (const std::uint32_t slot : clean.decoder.statistics(clean.context).gaussian_slot)
      of_poisoned += slot / 10 == 42 ? 1u : 0u;
    CHECK(rest + of_poisoned == all);
    for (const float gradient : poisoned.arena.all_gradients()) CHECK(std::isfinite(gradient));
    // Negative control: an activation that absorbs the NaN would have let the anchor through.
    if (std::isnan(poison)) CHECK(std::max(0.0f, poison) == 0.0f);
  }
}

TEST_CASE("anchor/mlp_decoder: a Gaussian without gradient passes no infinity on") {
  Fixture<MlpDecoder<float>> f(64, 64);
  f.used_share = 0.5;
  const auto hit = [&](std::uint32_t anchor) { return f.loss_weight(anchor * 10, 0) != 0; };
  std::uint32_t unused = 0;
  while (hit(unused)) ++unused;
  for (std::size_t c = 0; c < 30; ++c)
    f.arena.values(f.anchors.offset)(unused, c) = std::numeric_limits<float>::infinity();
  f.forward_backward();
  for (const float gradient : f.arena.all_gradients()) CHECK(std::isfinite(gradient));
}

TEST_CASE("anchor/mlp_decoder: an anchor at the camera centre has a direction and finite gradients (PR9)") {
  constexpr DecoderShape shape = with_distance;
  for (const double delta : {0.0, 1e-30, 1e-15, 1e-8, 1e-3}) {
    CAPTURE(delta);
    Fixture<MlpDecoder<float, shape>> fast(20, 20);
    Fixture<ReferenceDecoder<double, shape>> reference(20, 20);
    const std::array<double, 3> toward{2.0 / 3, -1.0 / 3, 2.0 / 3};
    fast.center = reference.center = {0, 0, 0};
    const auto copy = [&](BlockHandle block) {
      const auto from = fast.arena.values(block).flat();
      const auto to = reference.arena.values(block).flat();
      for (std::size_t i = 0; i < from.size(); ++i) to[i] = static_cast<double>(from[i]);
    };
    for (std::size_t i = 0; i < 3; ++i)
      fast.arena.values(fast.anchors.position)(7, i) = static_cast<float>(delta * toward[i]);
    for (std::size_t block = 0; block < fast.arena.layout().blocks().size(); ++block) copy({block});
    REQUIRE(fast.forward_backward() == reference.forward_backward());
    for (const double value : fast.everything()) CHECK(std::isfinite(value));
    const auto d = anchor_gradients(fast.arena, fast.anchors).position;
    const auto expected = anchor_gradients(reference.arena, reference.anchors).position;
    double difference = 0, size = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      difference += std::pow(static_cast<double>(d(7, i)) - expected(7, i), 2);
      size += std::pow(expected(7, i), 2);
    }
    CHECK(std::sqrt(difference / size) <= 1e-5);  // measured 4e-7
    // Negative control: v / sqrt(v v) in float.
    const float x = static_cast<float>(delta * toward[0]);
    if (delta == 0 || delta == 1e-30) CHECK_FALSE(std::isfinite(x / std::sqrt(x * x)));
  }
}

TEST_CASE("anchor/mlp_decoder: rotating position and camera rotates direction and gradient (PR9)") {
  // Direction alone: the quarter turn (x, y, z) -> (-y, x, z) is exact in float.
  const detail::ViewPoint<float> from({1, 2, 3}, 1e-12), turned_from({-2, 1, 3}, 1e-12);
  const Pack<float, 1> position[3] = {1.7f, -0.4f, 2.2f}, turned[3] = {0.4f, 1.7f, 2.2f};
  const detail::ViewLanes<float, 1> a(from, position), b(turned_from, turned);
  CHECK(b.direction[0].native == -a.direction[1].native);
  CHECK(b.direction[1].native == a.direction[0].native);
  CHECK(b.direction[2].native == a.direction[2].native);
  CHECK(a.distance.native == b.distance.native);
}

TEST_CASE("anchor/mlp_decoder: the view direction keeps its digits far from the origin (PR7)") {
  using Fast = MlpDecoder<float, odd>;
  for (const double shift : {0.0, 1024.0, 131072.0}) {  // exact in float, as are the positions below
    CAPTURE(shift);
    Fixture<Fast> near(40, 40), far(40, 40);
    for (std::size_t n = 0; n < 40; ++n) {
      for (std::size_t i = 0; i < 3; ++i) {
        const double rounded = std::round(near.arena.values(near.anchors.position)(n, i) * 16) / 16;
        near.arena.values(near.anchors.position)(n, i) = static_cast<float>(rounded);
        far.arena.values(far.anchors.position)(n, i) = static_cast<float>(rounded + shift);
      }
    }
    near.center = {0.3, -0.2, 3.1};
    far.center = {0.3 + shift, -0.2 + shift, 3.1 + shift};
    REQUIRE(near.forward() == far.forward());
    const auto x = std::as_const(near.batch).columns(), y = std::as_const(far.batch).columns();
    double worst = 0;
    for (std::size_t row = 0; row < near.batch.size(); ++row)
      worst = std::max(worst, std::abs(static_cast<double>(x.color[0][row] - y.color[0][row])));
    CHECK(worst <= 1e-6);
    // Negative control: the centre rounded to float first moves the direction by 1e-3 at 131072.
    if (shift > 1e5) CHECK(std::abs(static_cast<double>(static_cast<float>(0.3 + shift)) - (0.3 + shift)) > 1e-4);
  }
}

namespace {

/// One anchor whose covariance head is a constant: returns the rotation of its first Gaussian and d loss / d quaternion
/// logits.
struct QuaternionProbe {
  Fixture<MlpDecoder<float, odd>> f{1, 1};
  std::size_t k = 0;

  explicit QuaternionProbe(const std::array<float, 4>& logits) {
    for (float& weight : f.arena.values(f.heads.covariance.weight2).flat()) weight = 0;
    for (float& bias : f.arena.values(f.heads.opacity.bias2).flat()) bias = 2;
    for (std::size_t i = 0; i < 4; ++i) f.arena.values(f.heads.covariance.bias2)(0, 3 + i) = logits[i];
    REQUIRE(f.forward_backward() == 3);
  }
  float rotation(std::size_t i) const { return f.batch.columns().rotation[i][0]; }
  float gradient(std::size_t i) const { return f.arena.gradients(f.heads.covariance.bias2)(0, 3 + i); }
};

}  // namespace

TEST_CASE("anchor/mlp_decoder: quaternion logits of any size (QU1)") {
  const std::array<float, 4> q{0.3f, -0.7f, 0.2f, 0.9f};
  const QuaternionProbe unit(q);
  for (int power = -100; power <= 100; power += 20) {
    const float k = std::ldexp(1.0f, power);
    const QuaternionProbe scaled({k * q[0], k * q[1], k * q[2], k * q[3]});
    for (std::size_t i = 0; i < 4; ++i) {
      CHECK(std::abs(scaled.rotation(i) - unit.rotation(i)) <= 4 * 6e-8f);
      CHECK(std::isfinite(scaled.gradient(i)));
      CHECK(std::abs(scaled.gradient(i) * k - unit.gradient(i)) <= 1e-5f * std::abs(unit.gradient(i)));
    }
    // Negative control: the plain norm.
    const float squares = k * k * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (power == -100 || power == 100) CHECK_FALSE(std::abs(k * q[0] / std::sqrt(squares) - unit.rotation(0)) < 0.1f);
  }
  const QuaternionProbe zero({0, 0, 0, 0});
  CHECK(zero.rotation(0) == 1);
  for (std::size_t i = 0; i < 4; ++i) {
    if (i > 0) CHECK(zero.rotation(i) == 0);
    CHECK(zero.gradient(i) == 0);
  }
}

TEST_CASE("anchor/mlp_decoder: the gradient of a quaternion is tangential (QU2)") {
  const std::array<float, 4> q{1.3f, -2.7f, 0.2f, 4.9f};
  const QuaternionProbe probe(q);
  double radial = 0, size = 0, naive = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    radial += static_cast<double>(q[i]) * static_cast<double>(probe.gradient(i));
    size += std::pow(static_cast<double>(probe.gradient(i)), 2);
    naive += static_cast<double>(q[i]) * static_cast<double>(probe.f.loss_weight(probe.f.context.slot[0], 6 + i));
  }
  const double norm = std::sqrt(1.3 * 1.3 + 2.7 * 2.7 + 0.2 * 0.2 + 4.9 * 4.9);
  CHECK(std::abs(radial) <= 1e-6 * norm * std::sqrt(size));
  CHECK(std::abs(naive) / norm > 1e-2 * std::sqrt(size));  // negative control: without the projection
}

TEST_CASE("anchor/mlp_decoder: a second view allocates nothing") {
  Fixture<MlpDecoder<float, with_all>> f(2000, 2000);
  ThreadExecutor executor(2);
  f.forward_backward(executor);
  const std::size_t bytes = f.context.memory_bytes();
  const void* const first = f.context.inverse_norm.data();
  f.visible.resize(1500);
  f.forward_backward(executor);
  f.forward_backward(executor);
  CHECK(f.context.memory_bytes() == bytes);
  CHECK(f.context.inverse_norm.data() == first);
}

TEST_CASE("anchor/mlp_decoder: an option that is off leaves nothing behind") {
  static_assert(sizeof(DecoderHandles<odd>) == 12 * sizeof(BlockHandle));
  static_assert(sizeof(DecoderHandles<with_bank>) == 16 * sizeof(BlockHandle));
  static_assert(sizeof(DecoderHandles<with_appearance>) == 13 * sizeof(BlockHandle));
  ParameterArena<float> arena;
  MlpDecoder<float>::add_parameters(arena, 100);
  CHECK(arena.layout().blocks().size() == 12);
  CHECK(arena.layout().find("mlp_opacity.0.weight").valid());
  CHECK(arena.layout().block(arena.layout().find("mlp_covariance.2.weight")).rows == 70);
  CHECK(arena.layout().block(arena.layout().find("mlp_color.0.weight")).columns == 35);
  Fixture<MlpDecoder<float>> f(20, 20);
  f.forward_backward();
  CHECK(f.context.bank.capacity_bytes() == 0);
}

TEST_CASE("anchor/mlp_decoder: initialisation is PyTorch's Linear, keyed by the seed") {
  ParameterArena<float> a, b, c;
  const auto ha = MlpDecoder<float>::add_parameters(a, 1), hb = MlpDecoder<float>::add_parameters(b, 1),
             hc = MlpDecoder<float>::add_parameters(c, 1);
  MlpDecoder<float>::initialise(a, ha, 1);
  MlpDecoder<float>::initialise(b, hb, 1);
  MlpDecoder<float>::initialise(c, hc, 2);
  CHECK(std::equal(a.all_values().begin(), a.all_values().end(), b.all_values().begin()));
  CHECK_FALSE(std::equal(a.all_values().begin(), a.all_values().end(), c.all_values().begin()));
  const auto weights = a.values(ha.covariance.weight2).flat();
  const double bound = 1 / std::sqrt(32.0);
  double mean = 0, square = 0;
  for (const float w : weights) {
    CHECK(std::abs(static_cast<double>(w)) <= bound);
    mean += static_cast<double>(w) / static_cast<double>(weights.size());
    square += static_cast<double>(w) * static_cast<double>(w) / static_cast<double>(weights.size());
  }
  CHECK(std::abs(mean) < 4 * bound / std::sqrt(3.0 * static_cast<double>(weights.size())));  // four standard errors
  CHECK(std::abs(square / (bound * bound / 3) - 1) < 0.1);
}
