// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Statistics of a sample of a dataset's photographs for scene/probe.hpp: transparency, a constant border, drift of
// exposure. Cost: decodes the sample once, 128 photographs at most.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/probe_sightings.hpp"
#include "compmark/scene/turn.hpp"

namespace compmark {
namespace detail {

/// The q-th quantile of a list that is not empty; reorders it.
[[nodiscard]] inline double quantile(std::vector<double>& values, double q) {
  const auto place =
      values.begin() + static_cast<std::ptrdiff_t>(std::lround(q * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

struct PixelEvidence {
  std::size_t photographs = 0;
  double transparent = 0;  ///< share of pixels with alpha below 255
  double border_deviation =
      255;  ///< levels: largest standard deviation of the border of one photograph, or of all borders' means
  std::array<double, 3> border{0, 0, 0};  ///< mean colour, levels
  double exposure_deviation = 0;          ///< standard deviation of the logarithm of the photographs' gains
  std::size_t exposure_matches = 0;
};

/// Gains of photographs from the brightness of the same points: ln L_ij = gain_i + point_j, by alternating medians, as
/// a few points are on edges or highlights. The mean gain is the gauge. `brightness` holds (view, point, ln L), by
/// point.
struct PointBrightness {
  std::size_t view, point;
  double log_value;
};
[[nodiscard]] inline double gain_deviation(const std::vector<PointBrightness>& brightness, std::size_t views) {
  std::vector<double> gain(views, 0);
  std::vector<std::vector<double>> residual(views);
  for (int iteration = 0; iteration < 20; ++iteration) {
    for (std::vector<double>& r : residual) r.clear();
    for (std::size_t i = 0; i < brightness.size();) {
      std::size_t end = i;
      std::vector<double> values;
      for (; end < brightness.size() && brightness[end].point == brightness[i].point; ++end)
        values.push_back(brightness[end].log_value - gain[brightness[end].view]);
      if (values.size() >= 2) {
        double mean = 0;
        for (const double v : values) mean += v / static_cast<double>(values.size());
        const double level = values.size() == 2 ? mean : quantile(values, 0.5);
        for (std::size_t k = i; k < end; ++k) residual[brightness[k].view].push_back(brightness[k].log_value - level);
      }
      i = end;
    }
    for (std::size_t v = 0; v < views; ++v) {
      if (residual[v].size() >= 8) gain[v] = quantile(residual[v], 0.5);
    }
  }
  double mean = 0, square = 0, count = 0;
  for (std::size_t v = 0; v < views; ++v) {
    if (residual[v].size() < 8) continue;
    count += 1;
    mean += gain[v];
    square += gain[v] * gain[v];
  }
  return count < 2 ? 0 : std::sqrt(std::fmax(0, square / count - mean * mean / (count * count)));
}

/// The photographs that are looked at: all of 128, else 64 pairs of neighbours over the whole capture. Pairs, as
/// neighbours see the same points however long the capture is, and as a fixed stride would be blind to what alternates
/// from photograph to photograph. (A sample of 26 of a real capture's 77 gave a drift of 0.044 or 0.069, by which it
/// began with; all of them, 0.060.)
[[nodiscard]] inline std::vector<std::size_t> sampled_views(std::size_t count) {
  std::vector<std::size_t> views;
  if (count <= 128) {
    for (std::size_t i = 0; i < count; ++i) views.push_back(i);
    return views;
  }
  for (std::size_t pair = 0; pair < 64; ++pair) {
    const std::size_t first = pair * (count - 2) / 63;  // 127 / 63 > 2: pairs do not overlap
    views.push_back(first);
    views.push_back(first + 1);
  }
  return views;
}

[[nodiscard]] inline Result<PixelEvidence> look_at_pixels(const Dataset& dataset, const Sightings& sightings) {
  PixelEvidence evidence;
  std::vector<std::vector<const Sighting*>> seen(dataset.views.size());
  if (sightings.are_features) {
    for (const Sighting& s : sightings.list) seen[s.view].push_back(&s);
  }
  std::vector<PointBrightness> brightness;
  std::array<double, 3> border_sum{}, border_square{};
  double pixels = 0, transparent = 0, worst = 0;
  for (const std::size_t i : sampled_views(dataset.views.size())) {
    Result<ImageBytes> file = read_image(dataset.views[i].image_path);
    if (!file) return file.error();
    const ImageBytes image = turned(std::move(*file), dataset.views[i].orientation);
    const std::size_t channels = static_cast<std::size_t>(image.channels);
    const bool alpha = channels == 2 || channels == 4, colored = channels >= 3;
    const auto at = [&](int x, int y) {
      return image.pixels.data() +
             (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x)) *
                 channels;
    };
    ++evidence.photographs;
    pixels += static_cast<double>(image.pixels.size() / channels);
    for (std::size_t k = channels - 1; alpha && k < image.pixels.size(); k += channels)
      transparent += image.pixels[k] < 255;

    std::array<double, 3> sum{}, square{};
    double count = 0;
    const auto add = [&](int x, int y) {
      count += 1;
      for (std::size_t c = 0; c < 3; ++c) {
        const double v = at(x, y)[colored ? c : 0];
        sum[c] += v;
        square[c] += v * v;
      }
    };
    for (int x = 0; x < image.width; ++x) add(x, 0), add(x, image.height - 1);
    for (int y = 1; y + 1 < image.height; ++y) add(0, y), add(image.width - 1, y);
    for (std::size_t c = 0; c < 3; ++c) {
      const double mean = sum[c] / count;
      worst = std::fmax(worst, std::sqrt(std::fmax(0, square[c] / count - mean * mean)));
      border_sum[c] += mean;
      border_square[c] += mean * mean;
    }
    for (const Sighting* s : seen[i]) {
      const int x = static_cast<int>(std::floor(s->x)), y = static_cast<int>(std::floor(s->y));
      if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
      const std::uint8_t* p = at(x, y);
      const double value = colored ? (p[0] + p[1] + p[2]) / 3.0 : p[0];
      if (value < 10 || value > 245) continue;  // dark noise, or clipped
      brightness.push_back({i, s->point, std::log(value)});
    }
  }
  const double n = static_cast<double>(evidence.photographs);
  for (std::size_t c = 0; c < 3; ++c) {
    evidence.border[c] = border_sum[c] / n;
    worst = std::fmax(worst, std::sqrt(std::fmax(0, border_square[c] / n - evidence.border[c] * evidence.border[c])));
  }
  evidence.border_deviation = worst;
  evidence.transparent = transparent / pixels;
  std::stable_sort(brightness.begin(), brightness.end(),
                   [](const PointBrightness& a, const PointBrightness& b) { return a.point < b.point; });
  evidence.exposure_matches = brightness.size();
  evidence.exposure_deviation = gain_deviation(brightness, dataset.views.size());
  return evidence;
}

}  // namespace detail
}  // namespace compmark
