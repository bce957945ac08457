// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Growing and pruning against the published numbers (method sheet, sections 4 and 8), against a plain O(M N) implementation of the published
// loop with its own containers, and the laws of anchor/density_control.hpp.
#include "compmark/anchor/growth.hpp"

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
  AdaptContext context{11, 1600, 0.01, {}};
  std::vector<std::vector<std::uint32_t>> edits;

  explicit World(std::size_t anchors) {
    handles.position = arena.add("anchor.position", anchors, 3, RowKind::anchor);
    handles.offset = arena.add("anchor.offset", anchors, 3 * K, RowKind::anchor);
    handles.scaling = arena.add("anchor.scaling", anchors, 6, RowKind::anchor);
    handles.feature = arena.add("anchor.feature", anchors, feature_dim, RowKind::anchor);
    extra = arena.add("anchor.extra", anchors, 2, RowKind::anchor);
    network = arena.add("network", 3, 5, RowKind::fixed);
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
    return GradientGrowth<T>(settings).adapt(arena, handles, state, context, [&](const RowEdit& edit, const ArenaLayout& old_layout) {
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
  const auto uniform = [&](double low, double high) { return static_cast<T>(static_cast<float>(low + (high - low) * random.uniform(n++))); };
  const AnchorColumns<T> columns = anchor_values(world.arena, world.handles);
  for (std::size_t a = 0; a < anchors; ++a) {
    for (std::size_t i = 0; i < 3; ++i) {
      columns.position(a, i) = static_cast<T>(static_cast<float>(std::nearbyint(random.uniform(n++) * 200 - 100) * 0.01));
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
  const auto row = [](MatrixView<const T> view, std::size_t a) { return std::vector<T>(view.row(a), view.row(a) + view.columns); };
  const AnchorColumns<const T> columns = anchor_values(world.arena, world.handles);
  for (std::size_t a = 0; a < world.anchors(); ++a) {
    PlainAnchor<T> anchor{row(columns.position, a), row(columns.offset, a), row(columns.scaling, a), row(columns.feature, a)};
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
        if (!(parent.gradient_sum[k] / parent.gradient_count[k] >= static_cast<T>(s.gradient_threshold * std::pow(2.0, level)))) continue;
        if (!(random.uniform((static_cast<std::uint64_t>(level) << 40) + a * K + k) > std::pow(0.5, level + 1))) continue;
        std::vector<T> position(3);
        for (std::size_t i = 0; i < 3; ++i) position[i] = parent.position[i] + parent.offset[3 * k + i] * std::exp(parent.scaling[i]);
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
      for (std::size_t i = 0; i < 3; ++i) anchor.position.push_back(static_cast<T>(static_cast<double>(where[i]) * size));
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
