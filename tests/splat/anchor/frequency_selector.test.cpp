// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/anchor/frequency_selector.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;

/// Selects on a map of given values; means in pixels of an image of the map's size unless given.
template <class T>
struct Selection {
  FrequencySelection report;
  std::vector<std::uint8_t> selected;
  Selection(const FrequencyBandSettings& settings, const std::vector<T>& map, int h, int w,
            const std::vector<std::array<T, 2>>& means, int image_h = 0, int image_w = 0,
            std::vector<std::uint8_t> visible = {}, std::size_t threads = 1) {
    if (visible.empty()) visible.assign(means.size(), 1);
    typename FrequencySelector<T>::Context context;
    ThreadExecutor executor(threads);
    report = FrequencySelector<T>(settings).select(
        {map.data(), 1, h, w}, image_h > 0 ? image_h : h, image_w > 0 ? image_w : w, visible,
        [&](std::size_t i) { return means[i]; }, context, executor);
    selected.assign(context.selected.begin(), context.selected.end());
  }
};

TEST_CASE("anchor/frequency_selector: the median is the lower middle value, exactly, for any distribution") {
  const Random random(3, 0, random_stage("test"));
  for (const std::size_t n : {1u, 2u, 3u, 4u, 99u, 100u, 4096u, 5001u}) {
    for (const int kind : {0, 1, 2, 3, 4}) {
      std::vector<float> map;
      for (std::size_t i = 0; i < n; ++i) {
        const float u = static_cast<float>(random.uniform(i));
        map.push_back(kind == 0   ? u
                      : kind == 1 ? std::exp(20 * u - 18)  // all in one bin but for a few
                      : kind == 2 ? std::floor(4 * u)      // ties
                      : kind == 3 ? 0.25f
                                  : 1e-42f * u);  // a range too small to be divided by
      }
      std::vector<float> sorted = map;
      std::sort(sorted.begin(), sorted.end());
      const Selection<float> s({}, map, 1, static_cast<int>(n), {});
      CHECK(s.report.median == static_cast<double>(sorted[(n - 1) / 2]));
    }
  }
}

TEST_CASE("anchor/frequency_selector: released band [m + 0.1, m + 0.3], the paper's |E - m| <= 0.3, bounds included") {
  const std::vector<double> map{0.5, 0.5, 0.5, 0.5, 0.625, 0.75, 0.5625, 0.8125, 0.25, 0.1875};
  FrequencyBandSettings settings;
  settings.lowest = 0.125;
  settings.highest = 0.25;
  std::vector<std::array<double, 2>> means;
  for (int i = 0; i < 10; ++i) means.push_back({i + 0.5, 0.5});
  const Selection<double> released(settings, map, 1, 10, means);
  CHECK(released.report.median == 0.5);
  CHECK(released.selected == std::vector<std::uint8_t>{0, 0, 0, 0, 1, 1, 0, 0, 0, 0});
  CHECK(released.report.coverage == 0.2);
  CHECK(released.report.selected == 2);
  CHECK(released.report.visible == 10);
  settings.lowest = -0.25;
  const Selection<double> paper(settings, map, 1, 10, means);
  CHECK(paper.selected == std::vector<std::uint8_t>{1, 1, 1, 1, 1, 1, 1, 0, 1, 0});
  CHECK(FrequencyBandSettings{}.lowest == 0.1);
  CHECK(FrequencyBandSettings::paper().lowest == -0.3);
}

TEST_CASE(
    "anchor/frequency_selector: half of the image flat and the paper's band selects what is well reconstructed (AN7)") {
  std::vector<double> map(100, 0.0);
  for (std::size_t i = 0; i < 40; ++i) map[i] = 0.2;
  CHECK(Selection<double>(FrequencyBandSettings::paper(), map, 10, 10, {}).report.coverage == 1);
  CHECK(Selection<double>({}, map, 10, 10, {}).report.coverage == 0.4);
}

/// A map whose single selected pixel is (row, column).
std::vector<double> spot(int h, int w, int row, int column) {
  std::vector<double> map(static_cast<std::size_t>(h * w), 0.0);
  map[static_cast<std::size_t>(row * w + column)] = 0.2;
  return map;
}

TEST_CASE(
    "anchor/frequency_selector: a mean on the edge of the image, outside, NaN and huge (AN6); invisible ones are not "
    "asked") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), tiny = 1e-9;
  const std::vector<std::array<double, 2>> means{{0.0, 0.0}, {-tiny, 0.0}, {1 - tiny, 1 - tiny}, {1.0, 0.0}, {nan, 0.0},
                                                 {0.0, nan}, {1e20, 0.0},  {-1e20, 0.0},         {0.1, 0.1}};
  std::vector<std::uint8_t> visible(means.size(), 1);
  visible.back() = 0;
  const Selection<double> first({}, spot(4, 5, 0, 0), 4, 5, means, 4, 5, visible);
  CHECK(first.selected == std::vector<std::uint8_t>{1, 0, 1, 0, 0, 0, 0, 0, 0});
  CHECK(first.report.visible == means.size() - 1);
  const Selection<double> last({}, spot(4, 5, 3, 4), 4, 5, {{5 - tiny, 4 - tiny}, {5.0, 3.5}, {4.5, 4.0}, {4.0, 3.0}});
  CHECK(last.selected == std::vector<std::uint8_t>{1, 0, 0, 1});
  // Negative control: asked before it is rounded, the first of these is column 5 of 5.
  CHECK((5 - tiny < 5 && std::lround(5 - tiny) == 5));
}

TEST_CASE(
    "anchor/frequency_selector: the correct mapping scales and keeps rows and columns; the published one does "
    "neither") {
  FrequencyBandSettings published;
  published.mapping = PixelMapping::published;
  // image 20 high and 40 wide, map 16 x 16: the mean (30, 5) is on map row 4, column 12
  const std::vector<std::array<double, 2>> means{{30.0, 5.0}};
  CHECK(Selection<double>({}, spot(16, 16, 4, 12), 16, 16, means, 20, 40).report.selected == 1);
  CHECK(Selection<double>({}, spot(16, 16, 12, 4), 16, 16, means, 20, 40).report.selected == 0);
  CHECK(Selection<double>(published, spot(16, 16, 4, 12), 16, 16, means, 20, 40).report.selected == 0);
  // published: row = rint(x - 1/2), column = rint(y - 1/2), and nothing beyond the map's side
  const std::vector<std::array<double, 2>> inside{{9.5, 5.5}, {9.0, 5.0}, {10.0, 6.0}, {30.0, 5.5}};
  const Selection<double> s(published, spot(16, 16, 9, 5), 16, 16, inside, 20, 40);
  CHECK(s.selected == std::vector<std::uint8_t>{1, 0, 0, 0});  // 8.5 and 9.5 go to the even 8 and 10
  CHECK(Selection<double>(published, spot(16, 16, 8, 4), 16, 16, inside, 20, 40).selected[1] == 1);
}

TEST_CASE(
    "anchor/frequency_selector: a NaN in the map selects nothing and is reported; same answer at any thread count") {
  std::vector<double> map = spot(4, 4, 1, 1);
  map[5] = 0.2;
  const std::vector<std::array<double, 2>> means{{1.5, 1.5}};
  CHECK(Selection<double>({}, map, 4, 4, means).report.selected == 1);
  map[0] = std::numeric_limits<double>::quiet_NaN();
  const Selection<double> bad({}, map, 4, 4, means);
  CHECK(bad.report.non_finite == 1);
  CHECK(bad.report.selected == 0);
  CHECK(bad.report.coverage == 0);

  const Random random(8, 0, random_stage("test"));
  std::vector<float> noise;
  std::vector<std::array<float, 2>> many;
  for (std::size_t i = 0; i < 64 * 48; ++i) noise.push_back(static_cast<float>(random.uniform(i)));
  for (std::size_t i = 0; i < 30000; ++i)
    many.push_back({static_cast<float>(50 * random.uniform(2 * i + (1u << 20)) - 1),
                    static_cast<float>(66 * random.uniform(2 * i + 1 + (1u << 20)) - 1)});
  const Selection<float> serial({}, noise, 64, 48, many), parallel({}, noise, 64, 48, many, 0, 0, {}, 3);
  CHECK(serial.selected == parallel.selected);
  CHECK(serial.report.selected == parallel.report.selected);
  CHECK(serial.report.selected > 1000);
}

}  // namespace
