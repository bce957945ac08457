// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which Gaussians frequency-aware growing looks at (docs/spec/method.md, 5.5, steps 5 and 6): those whose mean falls on
// a pixel where the error map E of the frequency loss lies in a band about its median. The median is the lower of the
// two middle values and exact: a histogram finds its bin, the bin's values are sorted out. Pixels are found by floor
// and then tested as integers, so that no mean is read out of bounds, NaN included (docs/spec/numerics.md, AN6). Cost:
// three passes over E and one look-up a Gaussian.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

enum class PixelMapping {
  correct,  ///< the pixel the mean is on, brought to the map's resolution
  /// row = x, column = y, both rounded half to even in image pixels, not brought to the map's resolution
  /// (docs/spec/method.md, 7.8)
  published,
};

struct FrequencyBandSettings {
  double lowest = 0.1;  ///< E of a selected pixel lies in [median + lowest, median + highest], as released
  double highest = 0.3;
  PixelMapping mapping = PixelMapping::correct;

  /// |E - median| <= 0.3: selects nearly everything that is well reconstructed (docs/spec/method.md, 7.7;
  /// docs/spec/numerics.md, AN7).
  [[nodiscard]] static constexpr FrequencyBandSettings paper() { return {-0.3, 0.3, PixelMapping::correct}; }
};

/// The result of a selection. A coverage of a half and more means that the band selects flat regions
/// (docs/spec/numerics.md, AN7).
struct FrequencySelection {
  double median = 0;
  double coverage = 0;         ///< fraction of the pixels in the band
  std::size_t visible = 0;     ///< Gaussians asked about
  std::size_t selected = 0;    ///< and selected
  std::size_t non_finite = 0;  ///< pixels of E that are NaN or infinite: then nothing is selected
};

template <class T>
class FrequencySelector {
 public:
  using Scalar = T;
  using Settings = FrequencyBandSettings;
  struct Context {
    Buffer<T> members;              ///< of the median's bin
    Buffer<std::uint8_t> selected;  ///< [gaussians] of the last selection
    Buffer<std::uint32_t> chunk_counts;
  };

  Settings settings;

  FrequencySelector() = default;
  explicit FrequencySelector(const Settings& chosen) : settings(chosen) {}

  /// Fills context.selected. `error` is [1, h, w]; `visible` has one entry a Gaussian; mean(i) is the {u, v} of a
  /// visible Gaussian i in pixels of the rendered image, whose pixel (0, 0) covers [0, 1) x [0, 1).
  template <class Mean, Executor E>
  FrequencySelection select(ImageView<const T> error, int image_height, int image_width,
                            std::span<const std::uint8_t> visible, const Mean& mean, Context& context,
                            E& executor) const {
    COMPMARK_ASSERT(error.channels == 1, "FrequencySelector: a map of one channel");
    FrequencySelection result;
    context.selected.resize(visible.size());
    const std::span<const T> values = error.flat();
    const T median = lower_median(values, context, result.non_finite);
    const bool usable = !values.empty() && result.non_finite == 0;
    const T low = median + static_cast<T>(settings.lowest), high = median + static_cast<T>(settings.highest);
    if (usable) {
      std::size_t covered = 0;
      for (const T e : values) covered += e >= low && e <= high ? 1 : 0;
      result.median = static_cast<double>(median);
      result.coverage = static_cast<double>(covered) / static_cast<double>(values.size());
    }
    const Place place = place_of(error, image_height, image_width);
    const std::size_t chunks = chunk_count(visible.size(), grain);
    context.chunk_counts.resize(2 * chunks);
    executor.for_chunks(visible.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::uint32_t seen = 0, chosen = 0;
      for (std::size_t i = begin; i < end; ++i) {
        bool take = false;
        if (visible[i] != 0) {
          ++seen;
          std::size_t pixel;
          if (usable && locate(mean(i), place, pixel)) take = values[pixel] >= low && values[pixel] <= high;
        }
        context.selected[i] = take ? 1 : 0;
        chosen += take ? 1 : 0;
      }
      context.chunk_counts[2 * (begin / grain)] = seen;
      context.chunk_counts[2 * (begin / grain) + 1] = chosen;
    });
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
      result.visible += context.chunk_counts[2 * chunk];
      result.selected += context.chunk_counts[2 * chunk + 1];
    }
    return result;
  }

 private:
  static constexpr std::size_t grain = 8192;
  static constexpr std::size_t bins = 1024;

  struct Place {
    int height, width;  // of the map
    T down, across;     // map pixels an image pixel
  };
  [[nodiscard]] Place place_of(ImageView<const T> error, int image_height, int image_width) const {
    return {error.height, error.width, static_cast<T>(error.height) / static_cast<T>(image_height),
            static_cast<T>(error.width) / static_cast<T>(image_width)};
  }
  /// False where the mean is not on the map.
  [[nodiscard]] bool locate(const std::array<T, 2>& mean, const Place& place, std::size_t& pixel) const {
    T row, column;
    if (settings.mapping == PixelMapping::correct) {
      column = std::floor(mean[0] * place.across);
      row = std::floor(mean[1] * place.down);
    } else {  // the published rasterizer counts from pixel centres
      row = std::nearbyint(mean[0] - T(0.5));
      column = std::nearbyint(mean[1] - T(0.5));
    }
    if (!(row >= T(0) && row < static_cast<T>(place.height) && column >= T(0) &&
          column < static_cast<T>(place.width))) {
      return false;  // NaN too
    }
    pixel = static_cast<std::size_t>(row) * static_cast<std::size_t>(place.width) + static_cast<std::size_t>(column);
    return true;
  }

  static T lower_median(std::span<const T> values, Context& context, std::size_t& non_finite) {
    if (values.empty()) return T(0);
    T lowest = values[0], highest = values[0];
    for (const T e : values) {
      non_finite += std::isfinite(e) ? 0 : 1;
      lowest = e < lowest ? e : lowest;
      highest = e > highest ? e : highest;
    }
    if (non_finite != 0 || !(highest > lowest)) return lowest;
    // Rounding is monotone, so bins are ordered as their values are.
    const T scale = static_cast<T>(bins - 1) / (highest - lowest);
    const auto bin_of = [&](T e) {
      return std::min(bins - 1, static_cast<std::size_t>(std::max(T(0), (e - lowest) * scale)));
    };
    if (!std::isfinite(scale)) return nth(values, (values.size() - 1) / 2, context, [](T) { return true; });
    std::array<std::size_t, bins> histogram{};
    for (const T e : values) ++histogram[bin_of(e)];
    std::size_t rank = (values.size() - 1) / 2, bin = 0;
    while (rank >= histogram[bin]) rank -= histogram[bin++];
    return nth(values, rank, context, [&](T e) { return bin_of(e) == bin; });
  }
  template <class Keep>
  static T nth(std::span<const T> values, std::size_t rank, Context& context, const Keep& keep) {
    context.members.resize(values.size());
    std::size_t count = 0;
    for (const T e : values) {
      context.members[count] = e;
      count += keep(e) ? 1 : 0;
    }
    T* const begin = context.members.data();
    std::nth_element(begin, begin + rank, begin + count);
    return begin[rank];
  }
};

}  // namespace compmark
