// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Growing and pruning against the published numbers (docs/spec/method.md, 4 and 9), against a plain O(M N)
// implementation of the published loop with its own containers, and the laws of splat/anchor/density_control.hpp.
#include "compmark/splat/anchor/growth.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

using namespace compmark;

static_assert(DensityControl<GradientGrowth<float>> && DensityControl<GradientGrowth<double>>);
static_assert(!present<NoGrowth> && std::is_empty_v<NoGrowth> && std::is_empty_v<NoGrowth::State>);

namespace {

constexpr int K = 3;
constexpr std::size_t feature_dim = 4;

/// An arena with an anchor table, one more anchor block and a network, and the growth policy with its state.
template <class T>
struct World {
  ParameterArena<T> arena;
  AnchorHandles handles;
  BlockHandle extra, network;
  typename GradientGrowth<T>::Settings settings;
  typename GradientGrowth<T>::State state;
  AdjustmentInputs context{11, 1600, 0.01, {}};
  std::vector<std::vector<std::uint32_t>> edits;

  explicit World(std::size_t anchors) {
    handles.position =
        arena.add("anchor.position", anchors, 3, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    handles.offset =
        arena.add("anchor.offset", anchors, 3 * K, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    handles.scaling =
        arena.add("anchor.scaling", anchors, 6, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    handles.feature = arena.add("anchor.feature", anchors, feature_dim, RowKind::anchor, BlockRole::rendering,
                                LearningSchedule::fixed());
    extra = arena.add("anchor.extra", anchors, 2, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    network = arena.add("network", 3, 5, RowKind::fixed, BlockRole::rendering, LearningSchedule::fixed());
    settings.offsets = K;
    GradientGrowth<T>(settings).prepare(anchors, state);
  }
  [[nodiscard]] std::size_t anchors() const { return arena.layout().block(handles.position).rows; }
  /// Every Gaussian judged (41 views) with mean gradient `gradient`, every anchor judged and opaque.
  void judge_all(T gradient) {
    for (T& count : state.statistics.gradient_count) count = 41;
    for (T& sum : state.statistics.gradient_sum) sum = 41 * gradient;
    for (T& visits : state.statistics.visits) visits = 81;
    for (T& opacity : state.statistics.opacity_sum) opacity = 81;
  }
  GrowthReport adapt() {
    return GradientGrowth<T>(settings).adapt(arena, handles, state, context,
                                             [&](const RowEdit& edit, const ArenaLayout& old_layout) {
                                               CHECK(arena.layout().block(handles.position).rows == edit.rows());
                                               CHECK(old_layout.block(handles.position).rows >= edit.kept.size());
                                               edits.emplace_back(edit.kept.begin(), edit.kept.end());
                                             });
  }
};

/// Random anchors, a tenth of them clustered in few cells, and random statistics that straddle every threshold.
template <class T>
World<T> random_world(std::size_t anchors, std::uint64_t seed) {
  World<T> world(anchors);
  const Random random(seed, 0, random_stage("world"));
  std::uint64_t n = 0;
  const auto uniform = [&](double low, double high) {
    return static_cast<T>(static_cast<float>(low + (high - low) * random.uniform(n++)));
  };
  const AnchorColumns<T> columns = anchor_values(world.arena, world.handles);
  for (std::size_t a = 0; a < anchors; ++a) {
    for (std::size_t i = 0; i < 3; ++i) {
      columns.position(a, i) =
          static_cast<T>(static_cast<float>(std::nearbyint(random.uniform(n++) * 200 - 100) * 0.01));
    }
    for (std::size_t i = 0; i < 3 * K; ++i) columns.offset(a, i) = uniform(-2, 2);
    for (std::size_t i = 0; i < 6; ++i) columns.scaling(a, i) = uniform(-5, 0.3);
    for (std::size_t i = 0; i < feature_dim; ++i) columns.feature(a, i) = uniform(-1, 1);
    for (std::size_t i = 0; i < 2; ++i) world.arena.values(world.extra)(a, i) = uniform(-1, 1);
    world.state.statistics.visits[a] = static_cast<T>(random.below(n++, 101));
    world.state.statistics.opacity_sum[a] = world.state.statistics.visits[a] * uniform(0, 0.02);
    for (std::size_t k = 0; k < K; ++k) {
      const std::size_t slot = a * K + k;
      world.state.statistics.gradient_count[slot] = static_cast<T>(random.below(n++, 81));
      world.state.statistics.gradient_sum[slot] = world.state.statistics.gradient_count[slot] * uniform(0, 0.0012);
    }
  }
  for (T& value : world.arena.values(world.network).flat()) value = uniform(-1, 1);
  return world;
}

template <class T>
std::vector<T> copy_of(std::span<const T> values) {
  return {values.begin(), values.end()};
}
template <class T>
bool same_bits(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

/// The published loop, plainly: grow level by level over growing lists, every cell against every anchor; then prune.
template <class T>
struct PlainAnchor {
  std::vector<T> position, offset, scaling, feature;
  T opacity_sum{}, visits{};
  std::vector<T> gradient_sum = std::vector<T>(K), gradient_count = std::vector<T>(K);
};
template <class T>
std::vector<PlainAnchor<T>> plain_adapt(const World<T>& world) {
  std::vector<PlainAnchor<T>> anchors;
  const auto row = [](MatrixView<const T> view, std::size_t a) {
    return std::vector<T>(view.row(a), view.row(a) + view.columns);
  };
  const AnchorColumns<const T> columns = anchor_values(world.arena, world.handles);
  for (std::size_t a = 0; a < world.anchors(); ++a) {
    PlainAnchor<T> anchor{row(columns.position, a), row(columns.offset, a), row(columns.scaling, a),
                          row(columns.feature, a)};
    anchor.opacity_sum = world.state.statistics.opacity_sum[a];
    anchor.visits = world.state.statistics.visits[a];
    for (std::size_t k = 0; k < K; ++k) {
      anchor.gradient_sum[k] = world.state.statistics.gradient_sum[a * K + k];
      anchor.gradient_count[k] = world.state.statistics.gradient_count[a * K + k];
    }
    anchors.push_back(anchor);
  }
  using Coordinates = std::array<std::int64_t, 3>;
  const auto cell = [](const std::vector<T>& position, double size) {
    Coordinates result;
    for (std::size_t i = 0; i < 3; ++i) result[i] = std::llrint(static_cast<double>(position[i]) / size);
    return result;
  };
  const auto& s = world.settings;
  const std::size_t old_count = anchors.size();
  const Random random(world.context.seed, world.context.iteration, random_stage("growth candidate"));
  for (int level = 0; level < s.update_depth; ++level) {
    const int factor = s.init_factor / static_cast<int>(std::pow(s.hierarchy_factor, level));
    if (factor == 0 || (level > 0 && anchors.size() == old_count)) continue;
    const double size = world.context.voxel_size * factor;
    std::map<Coordinates, std::vector<T>> wanted;  // ordered by cell
    for (std::size_t a = 0; a < old_count; ++a) {
      for (std::size_t k = 0; k < K; ++k) {
        const PlainAnchor<T>& parent = anchors[a];
        if (!(static_cast<double>(parent.gradient_count[k]) > 40)) continue;
        if (!(parent.gradient_sum[k] / parent.gradient_count[k] >=
              static_cast<T>(s.gradient_threshold * std::pow(2.0, level))))
          continue;
        if (!(random.uniform((static_cast<std::uint64_t>(level) << 40) + a * K + k) > std::pow(0.5, level + 1)))
          continue;
        std::vector<T> position(3);
        for (std::size_t i = 0; i < 3; ++i)
          position[i] = parent.position[i] + parent.offset[3 * k + i] * std::exp(parent.scaling[i]);
        std::vector<T>& feature = wanted.try_emplace(cell(position, size), parent.feature).first->second;
        for (std::size_t i = 0; i < feature.size(); ++i) feature[i] = std::max(feature[i], parent.feature[i]);
      }
    }
    const std::size_t before = anchors.size();
    for (const auto& [where, feature] : wanted) {
      bool occupied = false;
      for (std::size_t a = 0; a < before; ++a) occupied = occupied || cell(anchors[a].position, size) == where;
      if (occupied) continue;
      PlainAnchor<T> anchor;
      for (std::size_t i = 0; i < 3; ++i)
        anchor.position.push_back(static_cast<T>(static_cast<double>(where[i]) * size));
      anchor.offset.assign(3 * K, T{});
      anchor.scaling.assign(6, static_cast<T>(std::log(size)));
      anchor.feature = feature;
      anchors.push_back(anchor);
    }
  }
  std::vector<PlainAnchor<T>> kept;
  for (PlainAnchor<T>& anchor : anchors) {
    for (std::size_t k = 0; k < K; ++k) {
      if (static_cast<double>(anchor.gradient_count[k]) > 40) anchor.gradient_count[k] = anchor.gradient_sum[k] = T{};
    }
    const bool judged_anchor = static_cast<double>(anchor.visits) > 80;
    if (judged_anchor && anchor.opacity_sum < static_cast<T>(s.min_opacity) * anchor.visits) continue;
    if (judged_anchor) anchor.visits = anchor.opacity_sum = T{};
    for (std::size_t i = 3; i < 6; ++i) anchor.scaling[i] = std::min(anchor.scaling[i], static_cast<T>(0.05));
    kept.push_back(anchor);
  }
  return kept;
}

template <class T>
void check_against_plain(World<T> world) {
  const std::vector<PlainAnchor<T>> expected = plain_adapt(world);
  const std::size_t before = world.anchors();
  const GrowthReport report = world.adapt();
  REQUIRE(world.anchors() == expected.size());
  CHECK(report.grown + before == expected.size() + report.pruned);
  const AnchorColumns<const T> columns = anchor_values(std::as_const(world.arena), world.handles);
  for (std::size_t a = 0; a < expected.size(); ++a) {
    REQUIRE(same_bits<T>(expected[a].position, {columns.position.row(a), 3}));
    REQUIRE(same_bits<T>(expected[a].offset, {columns.offset.row(a), 3 * K}));
    REQUIRE(same_bits<T>(expected[a].scaling, {columns.scaling.row(a), 6}));
    REQUIRE(same_bits<T>(expected[a].feature, {columns.feature.row(a), feature_dim}));
    REQUIRE(world.state.statistics.visits[a] == expected[a].visits);
    REQUIRE(world.state.statistics.opacity_sum[a] == expected[a].opacity_sum);
    for (std::size_t k = 0; k < K; ++k) {
      REQUIRE(world.state.statistics.gradient_sum[a * K + k] == expected[a].gradient_sum[k]);
      REQUIRE(world.state.statistics.gradient_count[a * K + k] == expected[a].gradient_count[k]);
    }
  }
}

}  // namespace

TEST_CASE("anchor/growth: equals the published loop written plainly, on random clouds") {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u}) {
    check_against_plain(random_world<float>(300, seed));
    check_against_plain(random_world<double>(300, seed));
    World<float> blender = random_world<float>(200, seed);
    blender.settings.init_factor = 4;
    check_against_plain(std::move(blender));
    World<float> high = random_world<float>(200, seed);
    high.settings.gradient_threshold = 0.001;  // the third level's threshold is above every gradient
    check_against_plain(std::move(high));
  }
}

TEST_CASE(
    "anchor/growth: a Gaussian is judged above 40 views and an anchor above 80 visits; above 30 and 60 at a success "
    "threshold of 0.6") {
  for (const auto& [success, views, visits] : {std::tuple{0.8, 40.0f, 80.0f}, std::tuple{0.6, 30.0f, 60.0f}}) {
    World<float> world(4);
    world.settings.success_threshold = success;
    GrowthStatistics<float>& s = world.state.statistics;
    for (std::size_t slot = 0; slot < s.slots(); ++slot) {
      s.gradient_count[slot] = views + static_cast<float>(slot % 2);  // every other one is just judged
      s.gradient_sum[slot] = 1e-9f;
    }
    for (std::size_t a = 0; a < 4; ++a) s.visits[a] = visits + static_cast<float>(a % 2);  // all transparent
    CHECK(world.adapt().pruned == 2);
    CHECK(world.edits == std::vector<std::vector<std::uint32_t>>{{0, 2}});
    for (std::size_t a = 0; a < 2; ++a) {
      CHECK(s.visits[a] == visits);  // not judged: goes on counting
      for (std::size_t k = 0; k < K; ++k) {
        const bool judged_before = (2 * a * K + k) % 2 == 1;
        CHECK(s.gradient_count[a * K + k] == (judged_before ? 0.0f : views));  // docs/spec/method.md, 7.15
        CHECK((s.gradient_sum[a * K + k] == 0) == judged_before);
      }
    }
  }
}

TEST_CASE("anchor/growth: opacity is compared strictly, as a sum over K and a mean over visits") {
  World<float> world(3);
  for (std::size_t a = 0; a < 3; ++a) world.state.statistics.visits[a] = 100;
  const float floor_sum = 0.005f * 100;
  world.state.statistics.opacity_sum[0] = std::nextafter(floor_sum, 0.0f);
  world.state.statistics.opacity_sum[1] = floor_sum;
  world.state.statistics.opacity_sum[2] = 50;
  const GrowthReport report = world.adapt();
  CHECK(report.pruned == 1);
  CHECK(world.edits.at(0) == std::vector<std::uint32_t>{1, 2});
  CHECK(world.state.statistics.visits[0] == 0);  // judged and kept: counts anew
  CHECK(world.state.statistics.opacity_sum[1] == 0);
}

TEST_CASE("anchor/growth: thresholds are tau, 2 tau and 4 tau, reached inclusively; keep rates are 1/2, 3/4 and 7/8") {
  constexpr std::size_t anchors = 20000;
  // Candidates of a level: what one level more adds. A quarter of the Gaussians is just at each threshold or just below the lowest.
  const auto candidates = [&](int depth) {
    World<float> world(anchors);
    world.settings.update_depth = depth;
    world.judge_all(0);
    const float tau = 0.0002f;
    const float levels[4] = {std::nextafter(tau, 0.0f), tau, 2 * tau, 4 * tau};
    for (float& count : world.state.statistics.gradient_count) count = 64;  // exact division
    for (std::size_t slot = 0; slot < anchors * K; ++slot)
      world.state.statistics.gradient_sum[slot] = 64 * levels[slot % 4];
    const AnchorColumns<float> columns = anchor_values(world.arena, world.handles);
    for (std::size_t a = 0; a < anchors; ++a) {  // offsets leave the anchors' own cells, so that level 0 grows
      columns.position(a, 0) = static_cast<float>(a) * 0.01f;
      for (std::size_t k = 0; k < K; ++k) columns.offset(a, 3 * k + 1) = static_cast<float>(k + 1);
    }
    return static_cast<double>(world.adapt().candidates);
  };
  const double n = anchors * K / 4.0;  // Gaussians in each quarter
  const double one = candidates(1), two = candidates(2), three = candidates(3);
  const auto within_five_sigma = [](double count, double trials, double p) {
    return std::abs(count - trials * p) < 5 * std::sqrt(trials * p * (1 - p));
  };
  CHECK(within_five_sigma(one, 3 * n, 0.5));
  CHECK(within_five_sigma(two - one, 2 * n, 0.75));
  CHECK(within_five_sigma(three - two, n, 0.875));
}

TEST_CASE("anchor/growth: cells are voxel x 16, 4, 1, and with an initial factor of 4 the third level is left out") {
  for (const int init_factor : {16, 4}) {
    World<double> world = random_world<double>(400, 3);
    world.settings.init_factor = init_factor;
    world.judge_all(0.01);
    const GrowthReport report = world.adapt();
    REQUIRE(report.grown > 10);
    const AnchorColumns<double> columns = anchor_values(world.arena, world.handles);
    std::set<double> sizes;
    double last = 1e9;
    Cell last_cell;
    for (std::size_t a = 400; a < world.anchors(); ++a) {
      const double size = std::exp(columns.scaling(a, 0));
      for (std::size_t i = 0; i < 6; ++i) CHECK(columns.scaling(a, i) == columns.scaling(a, 0));
      for (std::size_t i = 0; i < 3 * K; ++i) CHECK(columns.offset(a, i) == 0);
      const double factor = std::nearbyint(size / 0.01);
      CHECK(size == doctest::Approx(factor * 0.01).epsilon(1e-12));
      sizes.insert(factor);
      Cell cell;
      REQUIRE(cell_of(columns.position.row(a), 0.01 * factor, cell));
      CHECK(columns.position(a, 0) == doctest::Approx(cell.x * 0.01 * factor).epsilon(1e-12));
      CHECK((factor < last || last_cell < cell));  // ordered by level, then by cell
      last = factor;
      last_cell = cell;
    }
    CHECK(sizes == (init_factor == 16 ? std::set<double>{16, 4, 1} : std::set<double>{4, 1}));
  }
}

TEST_CASE("anchor/growth: without an anchor at the coarsest level the finer ones are skipped") {
  World<float> world(1);  // its offsets are zero: the anchor's own cell, at every level
  world.judge_all(1.0f);
  const AnchorColumns<float> columns = anchor_values(world.arena, world.handles);
  for (std::size_t k = 0; k < K; ++k) columns.offset(0, 3 * k) = 0.05f;  // 5 voxels: its own cell of 16, another of 4
  for (std::uint64_t iteration = 100; iteration < 2000; iteration += 100) {
    world.context.iteration = iteration;
    world.judge_all(1.0f);
    CHECK(world.adapt().grown == 0);
  }
  CHECK(world.edits.empty());      // nothing changed: no row edit
  world.settings.init_factor = 4;  // negative control: at the finer cell there is something to grow
  std::size_t grown = 0;
  for (std::uint64_t iteration = 100; iteration < 2000 && grown == 0; iteration += 100) {
    world.context.iteration = iteration;
    world.judge_all(1.0f);
    grown += world.adapt().grown;
  }
  CHECK(grown > 0);
}

TEST_CASE(
    "anchor/growth: new features are the component-wise maximum over the cell's parents; pooled blocks too, others "
    "start at zero") {
  constexpr std::size_t anchors = 64;
  World<double> world(anchors);
  world.settings.update_depth = 1;
  world.judge_all(1.0);
  const AnchorColumns<double> columns = anchor_values(world.arena, world.handles);
  const MatrixView<double> extra = world.arena.values(world.extra);
  for (std::size_t a = 0; a < anchors; ++a) {
    const double x = static_cast<double>(a);
    columns.position(a, 2) = 10 + x;                                             // each its own cell
    for (std::size_t k = 0; k < K; ++k) columns.offset(a, 3 * k + 2) = -10 - x;  // all Gaussians at the origin
    for (std::size_t i = 0; i < feature_dim; ++i) columns.feature(a, i) = std::sin(x * static_cast<double>(i + 1)) - 3;
    extra(a, 0) = -x - 1;
    extra(a, 1) = x;
  }
  const std::array<BlockHandle, 1> pooled{world.extra};
  for (const bool pool : {false, true}) {
    World<double> copy = world;
    if (pool) copy.context.pooled = pooled;
    const GrowthReport report = copy.adapt();
    REQUIRE(report.grown == 1);
    // Every parent has three Gaussians in the cell; the chance that none of them wins its draw is 1/8, so compare with the true winners.
    const Random random(11, 1600, random_stage("growth candidate"));
    std::vector<double> feature(feature_dim, -9), expected_extra(2, -1000);
    for (std::size_t slot = 0; slot < anchors * K; ++slot) {
      if (!(random.uniform(slot) > 0.5)) continue;
      for (std::size_t i = 0; i < feature_dim; ++i) feature[i] = std::max(feature[i], columns.feature(slot / K, i));
      for (std::size_t i = 0; i < 2; ++i) expected_extra[i] = std::max(expected_extra[i], extra(slot / K, i));
    }
    for (std::size_t i = 0; i < feature_dim; ++i)
      CHECK(copy.arena.values(copy.handles.feature)(anchors, i) == feature[i]);
    for (std::size_t i = 0; i < 2; ++i)
      CHECK(copy.arena.values(copy.extra)(anchors, i) == (pool ? expected_extra[i] : 0));
  }
}

TEST_CASE("anchor/growth: laws D1 and D2, kept rows, networks and moments keep every bit through the one edit") {
  World<float> world = random_world<float>(500, 9);
  world.settings.base_scale_log_limit = std::numeric_limits<double>::infinity();
  const ParameterArena<float> before = world.arena;
  Buffer<float> moments(before.layout().size()), moved;
  for (std::size_t i = 0; i < moments.size(); ++i) moments[i] = static_cast<float>(i) * 0.37f;
  for (float& g : world.arena.all_gradients()) g = 1;
  std::vector<std::uint32_t> kept;
  const GrowthReport report =
      GradientGrowth<float>(world.settings)
          .adapt(world.arena, world.handles, world.state, world.context,
                 [&](const RowEdit& edit, const ArenaLayout& old_layout) {
                   kept.assign(edit.kept.begin(), edit.kept.end());
                   moved.resize(world.arena.layout().size());
                   move_rows<float>(old_layout, world.arena.layout(), edit, moments.span(), moved.span());
                 });
  REQUIRE(report.edited);
  REQUIRE(report.grown > 0);
  REQUIRE(report.pruned > 0);
  CHECK(world.anchors() == 500 + report.grown - report.pruned);
  CHECK(world.state.statistics.anchors() == world.anchors());
  CHECK(world.state.statistics.slots() == world.anchors() * K);
  for (const float g : world.arena.all_gradients()) REQUIRE(g == 0);
  for (std::size_t b = 0; b < before.layout().blocks().size(); ++b) {
    const ArenaLayout::Block& old_block = before.layout().blocks()[b];
    const ArenaLayout::Block& block = world.arena.layout().blocks()[b];
    const std::size_t rows = block.kind == RowKind::fixed ? block.rows : kept.size();
    for (std::size_t row = 0; row < rows; ++row) {
      const std::size_t from = old_block.offset + (block.kind == RowKind::fixed ? row : kept[row]) * block.columns;
      const std::size_t to = block.offset + row * block.columns;
      REQUIRE(same_bits<float>(before.all_values().subspan(from, block.columns),
                               world.arena.all_values().subspan(to, block.columns)));
      REQUIRE(same_bits<float>(moments.span().subspan(from, block.columns), moved.span().subspan(to, block.columns)));
    }
    for (std::size_t i = block.offset + rows * block.columns; i < block.offset + block.size(); ++i)
      REQUIRE(moved[i] == 0);  // new rows
  }
}

TEST_CASE(
    "anchor/growth: the base scale is limited to log 0.05 on all rows, at each adjustment, and not at a limit of "
    "infinity") {
  World<float> world(5);
  for (float& s : world.arena.values(world.handles.scaling).flat()) s = 0.3f;
  World<float> unlimited = world;
  unlimited.settings.base_scale_log_limit = std::numeric_limits<double>::infinity();
  world.adapt();
  unlimited.adapt();
  for (std::size_t a = 0; a < 5; ++a) {
    for (std::size_t i = 0; i < 6; ++i) {
      CHECK(world.arena.values(world.handles.scaling)(a, i) == (i < 3 ? 0.3f : 0.05f));
      CHECK(unlimited.arena.values(unlimited.handles.scaling)(a, i) == 0.3f);
    }
  }
}

TEST_CASE(
    "anchor/growth: a NaN or an infinity in the statistics is counted, neither grows nor prunes, and starts again "
    "(numerics AN5)") {
  for (const float poison : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    World<float> world = random_world<float>(100, 4), clean = random_world<float>(100, 4);
    world.state.statistics.gradient_sum[17] = poison;
    world.state.statistics.opacity_sum[33] = poison;
    clean.state.statistics.gradient_sum[17] = clean.state.statistics.gradient_count[17] = 0;
    clean.state.statistics.opacity_sum[33] = clean.state.statistics.visits[33] = 0;
    const GrowthReport report = world.adapt();
    const GrowthReport clean_report = clean.adapt();
    CHECK(report.non_finite == 2);
    CHECK(clean_report.non_finite == 0);
    CHECK(report.grown == clean_report.grown);
    CHECK(same_bits<float>(world.arena.all_values(), clean.arena.all_values()));
    for (const float value : world.state.statistics.gradient_sum) REQUIRE(std::isfinite(value));
    for (const float value : world.state.statistics.opacity_sum) REQUIRE(std::isfinite(value));
  }
  // Negative control: a mean over nothing is no number, and who sets those to 0 sees no other either.
  const float nothing = 0, nan = std::numeric_limits<float>::quiet_NaN();
  const auto passed_over = [](float mean) { return std::isnan(mean) ? 0.0f : mean; };
  CHECK(std::isnan(nothing / nothing));
  CHECK(passed_over(nothing / nothing) == passed_over(nan / 41));
}

TEST_CASE("anchor/growth: empty sets (numerics AN8)") {
  SUBCASE("no statistics: nothing happens") {
    World<float> world(7);
    const GrowthReport report = world.adapt();
    CHECK(report.candidates == 0);
    CHECK(report.grown == 0);
    CHECK(report.pruned == 0);
    CHECK_FALSE(report.edited);
    CHECK(world.edits.empty());
  }
  SUBCASE("no anchors at all") {
    World<float> world(0);
    const GrowthReport report = world.adapt();
    CHECK(report.grown + report.pruned == 0);
    CHECK_FALSE(report.kept_last);
  }
  SUBCASE("all candidates fall into occupied cells") {
    World<float> world(50);
    for (std::size_t a = 0; a < 50; ++a) world.arena.values(world.handles.position)(a, 0) = static_cast<float>(a);
    world.judge_all(1.0f);
    const GrowthReport report = world.adapt();
    CHECK(report.candidates > 0);
    CHECK(report.grown == 0);
  }
  SUBCASE("all anchors but one go") {
    World<float> world(50);
    world.judge_all(0);
    for (std::size_t a = 0; a < 50; ++a) world.state.statistics.opacity_sum[a] = a == 31 ? 1.0f : 0.0f;
    CHECK(world.adapt().pruned == 49);
    CHECK(world.anchors() == 1);
    CHECK(world.edits.at(0) == std::vector<std::uint32_t>{31});
  }
  SUBCASE("all anchors are to go: the most opaque one is kept, and told") {
    World<float> world(50);
    world.judge_all(0);
    for (std::size_t a = 0; a < 50; ++a) world.state.statistics.opacity_sum[a] = a == 12 || a == 40 ? 0.01f : 0.005f;
    std::size_t naive = 0;  // negative control: the rule by itself leaves nobody
    for (std::size_t a = 0; a < 50; ++a) {
      const auto visits = static_cast<double>(world.state.statistics.visits[a]);
      naive += static_cast<double>(world.state.statistics.opacity_sum[a]) < world.settings.min_opacity * visits ? 1 : 0;
    }
    CHECK(naive == 50);
    const GrowthReport report = world.adapt();
    CHECK(report.kept_last);
    CHECK(report.pruned == 49);
    CHECK(world.edits.at(0) == std::vector<std::uint32_t>{12});
  }
  SUBCASE("all old anchors go, and new ones take their place") {
    World<float> world(50);
    world.judge_all(1.0f);
    for (float& opacity : world.state.statistics.opacity_sum) opacity = 0;
    for (std::size_t a = 0; a < 50; ++a) world.arena.values(world.handles.offset)(a, 0) = static_cast<float>(a + 1);
    const GrowthReport report = world.adapt();
    CHECK(report.pruned == 50);
    CHECK_FALSE(report.kept_last);
    CHECK(world.anchors() == report.grown);
    CHECK(report.grown > 0);
  }
}

TEST_CASE("anchor/growth: law D3, the limit holds, counts what it drops and prefers high gradients") {
  World<float> free = random_world<float>(300, 6);
  const GrowthReport free_report = free.adapt();
  REQUIRE(free_report.grown > 40);
  for (const std::size_t limit : {1ul, 290ul, 300ul, 310ul, 100000ul}) {
    World<float> world = random_world<float>(300, 6);
    world.settings.max_anchors = limit;
    const GrowthReport report = world.adapt();
    const std::size_t survivors = 300 - report.pruned;  // the limit adds nothing to pruning
    CHECK(report.pruned == free_report.pruned);
    CHECK(world.anchors() == survivors + report.grown);
    CHECK(world.anchors() <= std::max(limit, survivors));
    CHECK((report.dropped_by_budget > 0) == (limit < 100000));
    if (limit == 100000) CHECK(report.grown == free_report.grown);
  }
  // Ten Gaussians in cells of their own, gradients 1 … 10 times the threshold, room for three: of those that won the draw the highest stay.
  World<double> world(10);
  world.settings.update_depth = 1;
  world.settings.max_anchors = 13;
  world.judge_all(0);
  std::set<double> expected;
  const Random random(11, 1600, random_stage("growth candidate"));
  for (std::size_t a = 0; a < 10; ++a) {
    world.arena.values(world.handles.offset)(a, 0) = static_cast<double>((a * 7) % 10 + 1);
    world.state.statistics.gradient_sum[a * K] = 41 * 0.0002 * static_cast<double>(a + 1);
  }
  for (std::size_t a = 10; a-- > 0;) {
    if (random.uniform(a * K) > 0.5 && expected.size() < 3) expected.insert(static_cast<double>((a * 7) % 10 + 1));
  }
  REQUIRE(expected.size() == 3);
  CHECK(world.adapt().grown == 3);
  std::set<double> places;
  for (std::size_t a = 10; a < 13; ++a) places.insert(std::nearbyint(world.arena.values(world.handles.position)(a, 0)));
  CHECK(places == expected);
}

TEST_CASE("anchor/growth: a Gaussian that is nowhere is counted and grows nothing") {
  World<float> world(3);
  world.judge_all(1.0f);
  const AnchorColumns<float> columns = anchor_values(world.arena, world.handles);
  for (std::size_t k = 0; k < K; ++k) columns.offset(0, 3 * k) = std::numeric_limits<float>::quiet_NaN();
  columns.scaling(1, 0) = 200;  // exp overflows
  for (std::size_t k = 0; k < K; ++k) columns.offset(1, 3 * k) = 1;
  columns.position(2, 0) = 1e12f;  // further than 2^31 cells
  const GrowthReport report = world.adapt();
  CHECK(report.candidates > 0);
  CHECK(report.out_of_range == report.candidates);
  CHECK(report.grown == 0);
}

TEST_CASE("anchor/growth: law D5, a Gaussian beyond the reach is counted and grows nothing") {
  const auto born = [](double reach, std::size_t& refused) {
    World<float> world(2);
    world.judge_all(1.0f);
    const AnchorColumns<float> columns = anchor_values(world.arena, world.handles);
    for (std::size_t k = 0; k < K; ++k) {
      columns.offset(0, 3 * k) = 5000 + 10 * static_cast<float>(k);  // of an anchor at the origin: it has wandered
      columns.offset(1, 3 * k + 1) = 5 + static_cast<float>(k);
    }
    world.context.reach = reach;
    std::vector<float> places;
    std::size_t before = world.anchors();
    for (std::uint64_t t = 100; t < 1500; t += 100) {
      world.context.iteration = t;
      world.judge_all(1.0f);
      refused += world.adapt().out_of_range;
    }
    const MatrixView<float> position = world.arena.values(world.handles.position);
    for (std::size_t a = before; a < position.rows; ++a) places.push_back(position(a, 0));
    return places;
  };
  std::size_t refused = 0, never = 0;
  const std::vector<float> held = born(100, refused), free = born(std::numeric_limits<double>::infinity(), never);
  CHECK(!held.empty());
  for (const float x : held) CHECK(std::abs(x) < 100);
  CHECK(refused > 0);
  CHECK(never == 0);  // the control
  CHECK(*std::max_element(free.begin(), free.end()) > 4000);
}

TEST_CASE("anchor/growth: an anchor grown a million units away is found again in its cell (numerics AN3)") {
  World<float> world(1);
  world.context.voxel_size = 0.001;
  const AnchorColumns<float> columns = anchor_values(world.arena, world.handles);
  for (std::size_t k = 0; k < K; ++k) columns.offset(0, 3 * k) = 1.2345678e6f;
  std::size_t grown = 0;
  for (std::uint64_t t = 100; t < 3000; t += 100) {
    world.context.iteration = t;
    world.judge_all(1.0f);
    for (std::size_t slot = K; slot < world.state.statistics.slots(); ++slot)
      world.state.statistics.gradient_sum[slot] = 0;
    grown += world.adapt().grown;
  }
  CHECK(grown >= 1);
  CHECK(grown <= 3);  // one a level, never a second time
}

TEST_CASE(
    "anchor/growth: law D4, same seed and iteration give the same bits, others other candidates; a checkpoint needs "
    "the statistics alone") {
  World<float> first = random_world<float>(300, 8), second = random_world<float>(300, 8),
               other = random_world<float>(300, 8);
  World<float> resumed(300);
  resumed.arena = second.arena;
  resumed.state.statistics = second.state.statistics;
  first.state.scratch.hot.resize(1000);  // work space is without meaning
  const GrowthReport report = first.adapt();
  second.adapt();
  resumed.adapt();
  CHECK(same_bits<float>(first.arena.all_values(), second.arena.all_values()));
  CHECK(same_bits<float>(first.arena.all_values(), resumed.arena.all_values()));
  CHECK(same_bits<float>(first.state.statistics.gradient_sum.span(), resumed.state.statistics.gradient_sum.span()));
  other.context.iteration += 100;
  CHECK(other.adapt().candidates != report.candidates);
}

TEST_CASE("anchor/growth: observing adds the published statistics, with the same bits at 1, 2 and 4 threads") {
  constexpr std::size_t anchors = 5000;
  const Random random(5, 0, random_stage("views"));
  std::vector<std::vector<float>> results;
  std::vector<double> expected_sum(anchors * K, 0), expected_count(anchors * K, 0), expected_visits(anchors, 0),
      expected_opacity(anchors, 0);
  for (const std::size_t threads : {1u, 2u, 4u}) {
    World<float> world(anchors);
    ThreadExecutor executor(threads);
    const GradientGrowth<float> growth(world.settings);
    for (std::uint64_t view = 0; view < 6; ++view) {
      std::vector<std::uint32_t> visible, slots;
      std::vector<float> opacity, norm;
      std::vector<std::uint8_t> on_screen;
      for (std::size_t a = 0; a < anchors; ++a) {
        if (random.below(view * 100000 + a, 3) == 0) continue;
        visible.push_back(static_cast<std::uint32_t>(a));
        opacity.push_back(static_cast<float>(random.below(a + view, 64)) / 64);
      }
      for (std::size_t k = 0; k < K; ++k) {  // the decoder's order: not by slot
        for (const std::uint32_t a : visible) {
          if (random.below(view * 999983 + a * K + k, 2) == 0) continue;
          slots.push_back(a * K + static_cast<std::uint32_t>(k));
          on_screen.push_back(random.below(slots.size() + view, 4) != 0 ? 1 : 0);
          norm.push_back(on_screen.back() != 0 ? static_cast<float>(random.below(slots.size(), 256)) / 256
                                               : std::numeric_limits<float>::quiet_NaN());
        }
      }
      growth.observe(DecodedStatistics<float>{visible, opacity, slots}, on_screen, norm, world.state, executor);
      if (threads != 1) continue;
      for (std::size_t i = 0; i < visible.size(); ++i) {
        expected_visits[visible[i]] += 1;
        expected_opacity[visible[i]] += static_cast<double>(opacity[i]);
      }
      for (std::size_t i = 0; i < slots.size(); ++i) {
        if (on_screen[i] == 0) continue;
        expected_count[slots[i]] += 1;
        expected_sum[slots[i]] += static_cast<double>(norm[i]);
      }
    }
    const GrowthStatistics<float>& s = world.state.statistics;
    if (threads == 1) {  // the numbers are multiples of 1/256: sums are exact
      for (std::size_t slot = 0; slot < anchors * K; ++slot) {
        REQUIRE(static_cast<double>(s.gradient_sum[slot]) == expected_sum[slot]);
        REQUIRE(static_cast<double>(s.gradient_count[slot]) == expected_count[slot]);
      }
      for (std::size_t a = 0; a < anchors; ++a) {
        REQUIRE(static_cast<double>(s.visits[a]) == expected_visits[a]);
        REQUIRE(static_cast<double>(s.opacity_sum[a]) == expected_opacity[a]);
      }
    }
    std::vector<float> all;
    for (const Buffer<float>* column : {&s.gradient_sum, &s.gradient_count, &s.visits, &s.opacity_sum})
      all.insert(all.end(), column->begin(), column->end());
    results.push_back(all);
  }
  CHECK(same_bits<float>(results[0], results[1]));
  CHECK(same_bits<float>(results[0], results[2]));
}

TEST_CASE("anchor/growth: a view of nothing changes nothing") {
  World<float> world(3);
  SerialExecutor executor;
  GradientGrowth<float>(world.settings).observe(DecodedStatistics<float>{}, {}, {}, world.state, executor);
  for (const float v : world.state.statistics.visits) CHECK(v == 0);
}
