// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Frequency loss (docs/spec/method.md, 5.5): the mean of E = 1 - SSIM between the filtered grey planes of render and
// target, and E itself, which frequency-aware growing looks at. Backward: through the SSIM, the sign of the filter's
// response where its modulus is taken, the filter (its own adjoint), the resizing and the three grey weights. Cost at
// native resolution: three real transforms there and back (two when the caller keeps the target's filtered plane) and
// the SSIM of one channel; 1024 x 1024 costs that of a megapixel, whatever the image.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/circular_filter.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/resize_adjoint.hpp"
#include "compmark/watermark/loss/frequency_filter.hpp"
#include "compmark/watermark/loss/frequency_similarity.hpp"

namespace compmark {

struct FrequencyReport {
  double loss = 0;  ///< mean of E, in [0, 2]
};

/// Images of three channels.
template <class T>
class FrequencyLoss {
 public:
  using Scalar = T;
  struct Settings {
    FrequencyGain gain;
    int side = 0;  ///< 0: the image's own size; else planes are resized to side x side first, as released: 1024
    bool modulus =
        true;  ///< of the filter's response, as published; a high pass, whose response has signs, goes without

    [[nodiscard]] static Settings intended() {
      Settings settings;
      settings.gain.band = FrequencyBand::high_pass;
      settings.modulus = false;
      return settings;
    }
  };

  /// Grow-only; tables are kept for every image size met. Belongs to one FrequencyLoss.
  class Context {
   public:
    /// E of the last evaluation, [1, height, width] in the working resolution.
    [[nodiscard]] ImageView<const T> error_map() const { return {similarity.error.data(), 1, height, width}; }

   private:
    friend class FrequencyLoss;
    struct Tables {
      int image_height, image_width;
      CircularFilter<T> filter;
      std::optional<TriangleResize<T>> resize;
    };
    std::vector<std::unique_ptr<Tables>> tables;
    typename detail::SimilarityMap<T>::Context similarity;
    typename CircularFilter<T>::Context transform;
    typename TriangleResize<T>::Context resizing;
    Buffer<T> grey, response, rendered, target, d_response;
    int height = 0, width = 0;
  };

  Settings settings;

  FrequencyLoss() = default;
  explicit FrequencyLoss(const Settings& chosen) : settings(chosen) {}

  template <Executor E>
  FrequencyReport forward(ImageView<const T> rendered, ImageView<const T> target, Context& context, E& executor) const {
    COMPMARK_ASSERT(rendered.height == target.height && rendered.width == target.width, "FrequencyLoss: two sizes");
    return run<false>(rendered, filtered_target(target, context, executor), T(0), {}, context, executor);
  }
  /// ADDS weight dloss/drendered.
  template <Executor E>
  FrequencyReport forward_backward(ImageView<const T> rendered, ImageView<const T> target, T weight,
                                   ImageView<T> d_rendered, Context& context, E& executor) const {
    COMPMARK_ASSERT(rendered.height == target.height && rendered.width == target.width, "FrequencyLoss: two sizes");
    return run<true>(rendered, filtered_target(target, context, executor), weight, d_rendered, context, executor);
  }

  /// Scalars of a filtered plane.
  [[nodiscard]] std::size_t plane_size(int height, int width) const {
    const std::size_t side = static_cast<std::size_t>(settings.side);
    return settings.side > 0 ? side * side : static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
  }
  /// The filtered grey plane of an image. A caller may keep it for a target that is used again.
  template <Executor E>
  void filter(ImageView<const T> image, std::span<T> plane, Context& context, E& executor) const {
    respond(image, tables_of(image, context), plane.data(), context, executor);
    if (settings.modulus) take_modulus(plane.data(), plane.data(), plane.size(), executor);
  }
  /// As forward_backward, with the filtered plane of the target given: a third of the transforms is saved.
  template <Executor E>
  FrequencyReport forward_backward_filtered(ImageView<const T> rendered, std::span<const T> filtered_target, T weight,
                                            ImageView<T> d_rendered, Context& context, E& executor) const {
    COMPMARK_ASSERT(filtered_target.size() == plane_size(rendered.height, rendered.width),
                    "FrequencyLoss: the filtered target has another size");
    return run<true>(rendered, filtered_target.data(), weight, d_rendered, context, executor);
  }

 private:
  using P = Pack<T, native_width<T>>;
  using Tables = typename Context::Tables;
  static constexpr std::size_t grain = 16384;
  static constexpr std::array<double, 3> grey_weights{0.2989, 0.587, 0.114};

  /// f(index, mask) for all packs of `count` values, in parallel.
  template <class E, class F>
  static void for_packs(std::size_t count, E& executor, const F& f) {
    executor.for_chunks(count, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; i += P::width)
        f(i, P::MaskType::first(static_cast<std::ptrdiff_t>(end - i)));
    });
  }
  template <class E>
  static void take_modulus(const T* from, T* to, std::size_t count, E& executor) {
    for_packs(count, executor, [&](std::size_t i, auto mask) { abs(P::load(from + i, mask)).store(to + i, mask); });
  }

  [[nodiscard]] const Tables& tables_of(ImageView<const T> image, Context& context) const {
    COMPMARK_ASSERT(image.channels == 3 && image.height > 0 && image.width > 0, "FrequencyLoss: three channels");
    const int height = settings.side > 0 ? settings.side : image.height;
    const int width = settings.side > 0 ? settings.side : image.width;
    context.height = height;
    context.width = width;
    for (const auto& known : context.tables) {
      if (known->image_height == image.height && known->image_width == image.width) return *known;
    }
    context.tables.push_back(std::unique_ptr<Tables>(
        new Tables{image.height, image.width, CircularFilter<T>(height, width, settings.gain), std::nullopt}));
    if (height != image.height || width != image.width)
      context.tables.back()->resize.emplace(image.height, image.width, height, width);
    return *context.tables.back();
  }

  /// The signed response of the filter to an image.
  template <class E>
  void respond(ImageView<const T> image, const Tables& tables, T* response, Context& context, E& executor) const {
    context.grey.resize(image.plane_size());
    for_packs(image.plane_size(), executor, [&](std::size_t i, auto mask) {
      P grey(T(0));
      for (int c = 0; c < 3; ++c) grey = fma(weight_of(c), P::load(image.plane(c) + i, mask), grey);
      grey.store(context.grey.data() + i, mask);
    });
    const T* plane = context.grey.data();
    if (tables.resize.has_value()) {
      tables.resize->apply(plane, response, context.resizing, executor);
      plane = response;
    }
    tables.filter.apply(plane, response, context.transform, executor);
  }
  static P weight_of(int channel) { return P(static_cast<T>(grey_weights[static_cast<std::size_t>(channel)])); }

  template <class E>
  const T* filtered_target(ImageView<const T> target, Context& context, E& executor) const {
    context.target.resize(plane_size(target.height, target.width));
    filter(target, context.target.span(), context, executor);
    return context.target.data();
  }

  template <bool Backward, class E>
  FrequencyReport run(ImageView<const T> x, const T* target, T weight, ImageView<T> d_x, Context& context,
                      E& executor) const {
    const Tables& tables = tables_of(x, context);
    const std::size_t height = static_cast<std::size_t>(context.height),
                      width = static_cast<std::size_t>(context.width);
    const std::size_t count = height * width;
    context.response.resize(count);
    T* const response = context.response.data();
    respond(x, tables, response, context, executor);
    const T* rendered = response;
    if (settings.modulus) {
      context.rendered.resize(count);
      take_modulus(response, context.rendered.data(), count, executor);
      rendered = context.rendered.data();
    }
    using Map = detail::SimilarityMap<T>;
    const double sum = Map::template measure<Backward>(rendered, target, height, width, context.similarity, executor);
    if constexpr (Backward) {
      COMPMARK_ASSERT(d_x.size() == x.size(), "FrequencyLoss: gradient and image differ in size");
      context.d_response.resize(count);
      T* const d = context.d_response.data();
      Map::gradient(rendered, target, height, width, weight / static_cast<T>(count), d, context.similarity, executor);
      if (settings.modulus) {
        for_packs(count, executor, [&](std::size_t i, auto mask) {
          const P z = P::load(response + i, mask), value = P::load(d + i, mask), zero(T(0));
          select(z > zero, value, select(z < zero, -value, zero)).store(d + i, mask);
        });
      }
      tables.filter.apply(d, d, context.transform, executor);
      const T* d_grey = d;
      if (tables.resize.has_value()) {
        tables.resize->apply_adjoint(d, context.grey.data(), context.resizing, executor);
        d_grey = context.grey.data();
      }
      for_packs(x.plane_size(), executor, [&](std::size_t i, auto mask) {
        const P value = P::load(d_grey + i, mask);
        for (int c = 0; c < 3; ++c) {
          T* const at = d_x.plane(c) + i;
          fma(weight_of(c), value, P::load(at, mask)).store(at, mask);
        }
      });
    }
    return {sum / static_cast<double>(count)};
  }
};

}  // namespace compmark
