// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/raster/bin.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/raster/project.hpp"
#include "compmark/testing/raster_scene.hpp"

using namespace compmark;
using testing::raster_scene;
using testing::RasterScene;

namespace {

constexpr Accuracy boxes{.footprint = FootprintRule::opacity_box};
constexpr Accuracy nothing_cut{.alpha_min = 0};

template <class T>
struct Binned {
  ProjectedSplats<T> projected;
  TileLists lists;
};

template <Accuracy accuracy, int W = 0, class T, Executor E>
Binned<T> run(const RasterScene<T>& scene, E& executor) {
  Binned<T> result;
  ProjectWorkspace<T> workspace;
  BinWorkspace bins;
  const GaussianColumns<const T> gaussians = scene.gaussians.columns();
  project<accuracy>(gaussians, scene.camera, ProjectionSettings<T>{}, result.projected, workspace, executor);
  const auto done = bin < accuracy, T,
             W == 0 ? native_width<T>
                    : W > (result.projected, scene.camera.width, scene.camera.height, BinSettings{}, result.lists, bins,
                           executor);
  CHECK(done.ok());
  return result;
}

/// Thin splats of every size up to the whole image: the hard case of the ellipse test.
RasterScene<float> thin_scene(std::uint64_t seed, std::size_t count, int width, int height) {
  RasterScene<float> scene = raster_scene<float>(seed, count, width, height);
  const Random random(seed, 0, random_stage("test/thin_scene"));
  for (std::size_t i = 0; i < count; ++i) {
    scene.gaussians.columns().scale[0][i] = static_cast<float>(std::exp(6 * random.uniform(2 * i) - 5));
    scene.gaussians.columns().scale[1][i] *= 0.05f;
  }
  return scene;
}

/// The tiles that splat s must be in: those with a pixel centre where alpha >= alpha_min, by evaluating every pixel in
/// double.
std::vector<char> tiles_by_force(const Splat<float>& s, int width, int height, int tiles_x, int tiles_y, double slack) {
  std::vector<char> hit(static_cast<std::size_t>(tiles_x * tiles_y), 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double dx = x + 0.5 - static_cast<double>(s.u), dy = y + 0.5 - static_cast<double>(s.v);
      const double a = s.pivot_x != 0 ? dy : dx, b = s.pivot_x != 0 ? dx : dy, w = a - static_cast<double>(s.slope) * b;
      const double sigma = static_cast<double>(s.major) * w * w + static_cast<double>(s.minor) * b * b;
      if (sigma <= static_cast<double>(s.sigma_max) * (1 + slack))
        hit[static_cast<std::size_t>(y / 16 * tiles_x + x / 16)] = 1;
    }
  }
  return hit;
}

bool same_lists(const TileLists& a, const TileLists& b) {
  return a.pairs == b.pairs && std::equal(a.begin.begin(), a.begin.end(), b.begin.begin(), b.begin.end()) &&
         std::equal(a.splat.begin(), a.splat.end(), b.splat.begin(), b.splat.end()) &&
         std::equal(a.position.begin(), a.position.end(), b.position.begin(), b.position.end()) &&
         std::equal(a.first_slot.begin(), a.first_slot.end(), b.first_slot.begin(), b.first_slot.end());
}

/// What TileLists promises: ascending splats in each tile; slots are a permutation, splat by splat, tiles row-major
/// within a splat.
template <class T>
void check_structure(const Binned<T>& binned) {
  const TileLists& lists = binned.lists;
  const auto tiles = static_cast<std::size_t>(lists.tiles_x) * static_cast<std::size_t>(lists.tiles_y);
  REQUIRE(lists.begin.size() == tiles + 1);
  REQUIRE(lists.first_slot.size() == binned.projected.count + 1);
  CHECK(lists.begin[0] == 0);
  CHECK(lists.begin[tiles] == lists.pairs);
  CHECK(lists.first_slot[binned.projected.count] == lists.pairs);
  std::vector<std::size_t> next(lists.first_slot.begin(), lists.first_slot.end());
  std::size_t wrong = 0;
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    for (std::size_t p = lists.begin[tile]; p < lists.begin[tile + 1]; ++p) {
      if (p > lists.begin[tile] && lists.splat[p - 1] >= lists.splat[p]) ++wrong;
      if (lists.position[next[lists.splat[p]]++] != p) ++wrong;
    }
  }
  for (std::size_t i = 0; i < binned.projected.count; ++i) wrong += next[i] == lists.first_slot[i + 1] ? 0 : 1;
  CHECK(wrong == 0);
}

}  // namespace

TEST_CASE("raster/bin: exact tiles: no tile is missed, at most 1 % are too many, and far fewer than in the box (TB3)") {
  SerialExecutor serial;
  std::size_t extra = 0, missed = 0, pairs = 0, in_boxes = 0;
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const RasterScene<float> scene = thin_scene(seed, 400, 150, 210);
    const auto got = run<accuracy::standard>(scene, serial);
    check_structure(got);
    const auto tiles = static_cast<std::size_t>(got.lists.tiles_x * got.lists.tiles_y);
    std::vector<std::vector<char>> listed(got.projected.count, std::vector<char>(tiles, 0));
    for (std::size_t tile = 0; tile < tiles; ++tile) {
      for (std::size_t p = got.lists.begin[tile]; p < got.lists.begin[tile + 1]; ++p)
        listed[got.lists.splat[p]][tile] = 1;
    }
    for (std::size_t i = 0; i < got.projected.count; ++i) {
      const Splat<float>& s = got.projected.splats[i];
      const auto needed = tiles_by_force(s, 150, 210, got.lists.tiles_x, got.lists.tiles_y, 1e-6);
      for (std::size_t tile = 0; tile < tiles; ++tile) {
        missed += needed[tile] != 0 && listed[i][tile] == 0 ? 1 : 0;
        extra += needed[tile] == 0 && listed[i][tile] != 0 ? 1 : 0;
      }
    }
    pairs += got.lists.pairs;
    in_boxes += run<boxes>(scene, serial).lists.pairs;
  }
  MESSAGE(pairs, " pairs, ", in_boxes, " in boxes, ", extra, " without a pixel centre inside");
  CHECK(missed == 0);
  // The test minimises over the whole rectangle of pixel centres, a thin ellipse may pass between two of them: that is
  // not an error.
  CHECK(static_cast<double>(extra) <= 0.01 * static_cast<double>(pairs));
  CHECK(2 * pairs < in_boxes);
}

TEST_CASE("raster/bin: any image size, one pixel and exact multiples of the tile included (TB7)") {
  SerialExecutor serial;
  for (const int width : {1, 15, 16, 17, 257}) {
    for (const int height : {1, 16, 33}) {
      const auto got = run<accuracy::standard>(raster_scene<float>(4, 60, width, height), serial);
      CHECK(got.lists.tiles_x == (width + 15) / 16);
      CHECK(got.lists.tiles_y == (height + 15) / 16);
      if (width % 16 != 0) CHECK(16 * (width / 16) < width);  // negative control: columns that whole tiles leave out
      check_structure(got);
    }
  }
}

TEST_CASE("raster/bin: a crop of whole tiles has the lists of the full image (TB7)") {
  SerialExecutor serial;
  RasterScene<float> scene = thin_scene(5, 200, 160, 96);
  const auto full = run<accuracy::standard>(scene, serial);
  scene.camera = scene.camera.cropped(0, 0, 64, 48);
  const auto crop = run<accuracy::standard>(scene, serial);
  std::size_t compared = 0;
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) {
      const auto a = static_cast<std::size_t>(y * full.lists.tiles_x + x),
                 b = static_cast<std::size_t>(y * crop.lists.tiles_x + x);
      std::vector<std::uint32_t> in_full, in_crop;
      for (std::size_t p = full.lists.begin[a]; p < full.lists.begin[a + 1]; ++p)
        in_full.push_back(full.projected.source[full.lists.splat[p]]);
      for (std::size_t p = crop.lists.begin[b]; p < crop.lists.begin[b + 1]; ++p)
        in_crop.push_back(crop.projected.source[crop.lists.splat[p]]);
      compared += in_full.size();
      // The Jacobian's clamp follows the image, so a few splats beyond the crop's limits may differ: none here is
      // dropped from both.
      CHECK(std::abs(static_cast<int>(in_full.size()) - static_cast<int>(in_crop.size())) <=
            static_cast<int>(in_full.size()) / 4 + 2);
    }
  }
  CHECK(compared > 100);
}

TEST_CASE("raster/bin: the same lists at any thread count; structure holds at every pack width (TB2, TB4)") {
  RasterScene<float> scene = thin_scene(6, 6000, 300, 200);
  SerialExecutor serial;
  const auto expected = run<accuracy::standard>(scene, serial);
  check_structure(expected);
  for (const std::size_t threads : {2u, 4u, 8u}) {
    ThreadExecutor executor(threads);
    CHECK(same_lists(run<accuracy::standard>(scene, executor).lists, expected.lists));
  }
  const auto narrow = run<accuracy::standard, 1>(scene, serial), half = run<accuracy::standard, 8>(scene, serial);
  check_structure(narrow);
  check_structure(half);
  // Rounding may differ between widths where a splat only just touches a tile.
  CHECK(std::abs(static_cast<double>(narrow.lists.pairs) - static_cast<double>(expected.lists.pairs)) <=
        1e-4 * static_cast<double>(expected.lists.pairs));
  CHECK(std::abs(static_cast<double>(half.lists.pairs) - static_cast<double>(expected.lists.pairs)) <=
        1e-4 * static_cast<double>(expected.lists.pairs));
  // Negative control: the same test twice, fused and rounded after every product, as two inlinings of it may be.
  const Random random(6, 0, random_stage("test/twice"));
  std::size_t differ = 0;
  for (std::size_t i = 0; i < 100000; ++i) {
    const auto draw = [&](std::size_t k) { return static_cast<float>(random.uniform(4 * i + k)); };
    const float major = draw(0), w = draw(1), minor = draw(2), b = draw(3);
    const auto rounded = [](float p, float q) {
      return static_cast<float>(static_cast<double>(p) * static_cast<double>(q));
    };
    const float fused = std::fma(major, w * w, minor * (b * b));
    const float unfused = rounded(major, rounded(w, w)) + rounded(minor, rounded(b, b));
    const float limit = std::min(fused, unfused);
    differ += (fused <= limit) != (unfused <= limit) ? 1 : 0;
  }
  CHECK(differ > 1000);
}

TEST_CASE("raster/bin: the published square in whole tiles (docs/spec/method.md, 2.1, step 8)") {
  SerialExecutor serial;
  const auto got = run<accuracy::inria>(raster_scene<double>(7, 300, 200, 120), serial);
  check_structure(got);
  std::size_t expected = 0;
  for (std::size_t i = 0; i < got.projected.count; ++i) {
    const Splat<double>& s = got.projected.splats[i];
    const double x = s.u - 0.5, y = s.v - 0.5, r = s.half_width;
    const auto clamp = [](double t, int high) { return std::min(std::max(static_cast<int>(t), 0), high); };
    const int width = clamp((x + r + 15) / 16, 13) - clamp((x - r) / 16, 13),
              height = clamp((y + r + 15) / 16, 8) - clamp((y - r) / 16, 8);
    CHECK(width > 0);
    CHECK(height > 0);
    CHECK(got.lists.first_slot[i + 1] - got.lists.first_slot[i] == static_cast<std::size_t>(width * height));
    expected += static_cast<std::size_t>(width * height);
  }
  CHECK(got.lists.pairs == expected);
}

TEST_CASE("raster/bin: with nothing cut every splat is in every tile") {
  SerialExecutor serial;
  const auto got = run<nothing_cut>(raster_scene<float>(8, 50, 100, 300), serial);
  CHECK(got.projected.count == 50);
  CHECK(got.lists.pairs == 50 * 7 * 19);
  check_structure(got);
}

TEST_CASE("raster/bin: more pairs than the budget is an error, not an overflow (TB6)") {
  SerialExecutor serial;
  const RasterScene<float> scene = raster_scene<float>(9, 100, 128, 128);
  ProjectedSplats<float> projected;
  ProjectWorkspace<float> workspace;
  const GaussianColumns<const float> gaussians = scene.gaussians.columns();
  project<accuracy::standard>(gaussians, scene.camera, ProjectionSettings<float>{}, projected, workspace, serial);
  TileLists lists;
  BinWorkspace bins;
  const auto done = bin<accuracy::standard>(projected, 128, 128, BinSettings{.pair_budget = 20}, lists, bins, serial);
  REQUIRE_FALSE(done.ok());
  CHECK(done.error().kind == ErrorKind::exhausted);
  CHECK(done.error().line().find("budget") != std::string::npos);
  CHECK(lists.pairs == 0);
  for (const std::size_t begin : lists.begin) CHECK(begin == 0);

  std::array<std::uint64_t, 3> counts{3000000000u, 3000000000u, 5u};  // no 32-bit sum survives this
  const std::size_t total = detail::exclusive_sums(counts.data(), counts.size());
  CHECK(total == 6000000005u);
  CHECK(counts[2] == 6000000000u);
  CHECK(static_cast<std::uint32_t>(total) <
        3000000000u);  // negative control: in 32 bits the sum is less than its parts
  CHECK_FALSE(detail::check_pair_budget(total, ~std::size_t{0}).ok());
  CHECK(detail::check_pair_budget(1000, 1000).ok());
}

TEST_CASE("raster/bin: no splat at all") {
  SerialExecutor serial;
  RasterScene<float> scene = raster_scene<float>(10, 10, 40, 40);
  scene.gaussians.resize(0);
  const auto got = run<accuracy::standard>(scene, serial);
  CHECK(got.lists.pairs == 0);
  check_structure(got);
}
