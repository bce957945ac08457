// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// HSV loss (docs/spec/method.md, 5.6): the squared error on the saturated, bright pixels of the red, the green and the
// blue third of the hue circle, mean over the three. No hue is computed: a hue lies in the third of colour c when
// channel c is the largest, which comparisons decide exactly where angles in float misplace 0.19 % of 8-bit colours
// (docs/spec/numerics.md, LS5); saturation is compared without division. Masks carry no gradient: dI = 2 (I - I_gt)
// times the sum over the masks of 1 / (9 |Omega|). Cost: one pass, 24 bytes a pixel read, 24 more with the gradient.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/training/settings.hpp"

namespace compmark {

/// Which hues belong to a colour.
enum class HueThirds {
  closed,  ///< as released: 60 and 180 and 300 degrees belong to both neighbours, so a tie of two channels counts twice
  half_open,  ///< as in the paper: [300, 360) and [0, 60), [60, 180), [180, 300)
};
/// |Omega|: what a colour's squared error is divided by.
enum class HueNorm {
  image,  ///< all pixels, as released
  mask,   ///< the pixels of the colour; no such pixel: 0 (docs/spec/numerics.md, LS7)
};

struct HsvReport {
  double loss = 0;
  std::array<double, 3> colour{};       ///< of red, green and blue; loss is their mean
  std::array<std::size_t, 3> pixels{};  ///< of each mask
};

/// Images of three channels.
template <class T>
class HsvLoss {
 public:
  using Scalar = T;
  /// Defaults are the released program's.
  struct Settings {
    HueThirds thirds = HueThirds::closed;
    HueSource source = HueSource::rendered;
    HueNorm norm = HueNorm::image;
    std::array<T, 3> saturation{T(0.2), T(0.2), T(0.2)};  ///< a pixel counts from here on; grey never does
    std::array<T, 3> value{T(0.2), T(0.2), T(0.2)};       ///< of the largest channel

    /// The paper's text. Its value threshold of red is 0, where rounding noise of a black pixel decides
    /// (docs/spec/numerics.md, LS6): here the smallest 8-bit step.
    [[nodiscard]] static Settings paper() {
      Settings settings;
      settings.thirds = HueThirds::half_open;
      settings.norm = HueNorm::mask;
      settings.saturation = {T(0.4), T(0.2), T(0.2)};
      settings.value = {T(1) / T(255), T(0.2), T(0.2)};
      return settings;
    }
  };
  struct Context {
    Buffer<double> sum;          ///< 3 a chunk of 8192 pixels
    Buffer<std::size_t> pixels;  ///< likewise
  };

  Settings settings;

  HsvLoss() = default;
  explicit HsvLoss(const Settings& chosen) : settings(chosen) {}

  template <Executor E>
  HsvReport forward(ImageView<const T> rendered, ImageView<const T> target, Context& context, E& executor) const {
    return report(rendered, sweep<false>(rendered, target, {}, {}, context, executor));
  }
  /// ADDS weight dloss/drendered.
  template <Executor E>
  HsvReport forward_backward(ImageView<const T> rendered, ImageView<const T> target, T weight, ImageView<T> d_rendered,
                             Context& context, E& executor) const {
    COMPMARK_ASSERT(d_rendered.size() == rendered.size(), "HsvLoss: gradient and image differ in size");
    const std::size_t area = rendered.plane_size();
    std::array<std::size_t, 3> norm{area, area, area};
    if (settings.norm == HueNorm::mask) norm = sweep<false>(rendered, target, {}, {}, context, executor).pixels;
    std::array<T, 3> slope{};
    for (std::size_t c = 0; c < 3; ++c)
      slope[c] = weight * T(2) / (T(9) * static_cast<T>(std::max<std::size_t>(1, norm[c])));
    return report(rendered, sweep<true>(rendered, target, slope, d_rendered, context, executor));
  }

 private:
  using P = Pack<T, native_width<T>>;
  using M = typename P::MaskType;
  static constexpr std::size_t grain = 8192;
  struct Sums {
    std::array<double, 3> squares{};
    std::array<std::size_t, 3> pixels{};
  };

  [[nodiscard]] HsvReport report(ImageView<const T> x, const Sums& sums) const {
    HsvReport result;
    result.pixels = sums.pixels;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t norm = settings.norm == HueNorm::mask ? sums.pixels[c] : x.plane_size();
      result.colour[c] = sums.squares[c] / (3 * static_cast<double>(std::max<std::size_t>(1, norm)));
      result.loss += result.colour[c] / 3;
    }
    return result;
  }

  /// The three masks of a pack of pixels.
  [[nodiscard]] COMPMARK_INLINE std::array<M, 3> masks(P r, P g, P b) const {
    const P largest = max(max(r, g), b);
    const P range = largest - min(min(r, g), b);
    std::array<M, 3> mask;
    if (settings.thirds == HueThirds::closed) {
      mask = {r == largest, g == largest, b == largest};
    } else {
      mask = {(r > g) & (r >= b), (g >= r) & (g > b), (b > r) & (b >= g)};
    }
    for (std::size_t c = 0; c < 3; ++c) {
      mask[c] = mask[c] & (range > P(T(0))) & (range >= P(settings.saturation[c]) * largest) &
                (largest >= P(settings.value[c]));
    }
    return mask;
  }

  template <bool Backward, class E>
  Sums sweep(ImageView<const T> x, ImageView<const T> y, const std::array<T, 3>& slope, ImageView<T> d_x,
             Context& context, E& executor) const {
    COMPMARK_ASSERT(x.channels == 3 && y.channels == 3 && x.height == y.height && x.width == y.width,
                    "HsvLoss: two images of three channels and one size");
    const std::size_t area = x.plane_size();
    const std::size_t chunks = chunk_count(area, grain);
    context.sum.resize(3 * chunks);
    context.pixels.resize(3 * chunks);
    executor.for_chunks(area, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      const Sums sums = chunk<Backward>(x, y, slope, d_x, begin, end);
      for (std::size_t c = 0; c < 3; ++c) {
        context.sum[3 * (begin / grain) + c] = sums.squares[c];
        context.pixels[3 * (begin / grain) + c] = sums.pixels[c];
      }
    });
    Sums total;
    for (std::size_t i = 0; i < 3 * chunks; ++i) {
      total.squares[i % 3] += context.sum[i];
      total.pixels[i % 3] += context.pixels[i];
    }
    return total;
  }

  template <bool Backward>
  Sums chunk(ImageView<const T> x, ImageView<const T> y, const std::array<T, 3>& slope, ImageView<T> d_x,
             std::size_t begin, std::size_t end) const {
    Sums sums;
    // Blocks of 64 packs: a float sum of that length keeps its digits, then goes to double.
    for (std::size_t block = begin; block < end; block += 64 * P::width) {
      const std::size_t block_end = std::min(block + 64 * P::width, end);
      std::array<P, 3> squares{P(T(0)), P(T(0)), P(T(0))};
      for (std::size_t i = block; i < block_end; i += P::width) {
        const M inside = M::first(static_cast<std::ptrdiff_t>(block_end - i));
        std::array<P, 3> a, b, d;
        std::array<M, 3> mask;
        P error(T(0));
        for (std::size_t c = 0; c < 3; ++c) {
          b[c] = P::load(y.plane(static_cast<int>(c)) + i, inside);
          a[c] = P::load(x.plane(static_cast<int>(c)) + i, inside);
          d[c] = a[c] - b[c];
          error = fma(d[c], d[c], error);
        }
        if (settings.source != HueSource::target) mask = masks(a[0], a[1], a[2]);
        if (settings.source != HueSource::rendered) {
          const std::array<M, 3> of_target = masks(b[0], b[1], b[2]);
          for (std::size_t c = 0; c < 3; ++c)
            mask[c] = settings.source == HueSource::either ? mask[c] | of_target[c] : of_target[c];
        }
        P pull(T(0));
        for (std::size_t c = 0; c < 3; ++c) {
          mask[c] = mask[c] & inside;
          squares[c] += keep(mask[c], error);
          sums.pixels[c] += static_cast<std::size_t>(count(mask[c]));
          if constexpr (Backward) pull += keep(mask[c], P(slope[c]));
        }
        if constexpr (Backward) {
          for (std::size_t c = 0; c < 3; ++c) {
            T* const at = d_x.plane(static_cast<int>(c)) + i;
            fma(pull, d[c], P::load(at, inside)).store(at, inside);
          }
        }
      }
      for (std::size_t c = 0; c < 3; ++c) sums.squares[c] += static_cast<double>(reduce_add(squares[c]));
    }
    return sums;
  }
};

}  // namespace compmark
