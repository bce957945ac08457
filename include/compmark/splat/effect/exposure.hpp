// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Exposure of a photograph: its colours are an affine map of the scene's, C' = M C + t with M [3, 3] and t [3] per
// training view (docs/spec/effects.md, 2). The scene's own brightness is free as long as every view may undo it, so the
// gauge is fixed after each step: the mean of the maps over the training views is the identity. A photograph that was
// not trained on is rendered in the gauge. Cost: 9 multiply-adds a pixel forward, 18 backward, 48 bytes of parameters a
// view in float.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/effect/concept.hpp"

namespace compmark {

template <class T>
class AffineExposure {
 public:
  static constexpr bool is_absent = false;
  using Scalar = T;
  struct Settings {};
  struct Handles {
    BlockHandle affine;  ///< "exposure" [views, 12], row-major [M | t]
  };
  struct Context {
    Buffer<T> render;        ///< [3, height, width] before the map
    Buffer<double> partial;  ///< 12 sums a chunk
  };

  [[nodiscard]] static Handles add_parameters(ParameterArena<T>& arena, std::size_t views) {
    return {arena.add("exposure", views, 12, RowKind::fixed, BlockRole::rendering, {0.005, 0.0005})};
  }
  static void initialise(ParameterArena<T>& arena, Handles handles) {
    const MatrixView<T> rows = arena.values(handles.affine);
    for (std::size_t view = 0; view < rows.rows; ++view) {
      for (std::size_t c = 0; c < 12; ++c) rows(view, c) = identity(c);
    }
  }

  /// Maps `image` in place and keeps what it was. An unseen view stays as it is.
  template <Executor E>
  static void forward(const ParameterArena<T>& arena, Handles handles, std::size_t view, ImageView<T> image,
                      Context& context, E& executor) {
    const MatrixView<const T> rows = arena.values(handles.affine);
    context.render.resize(image.size());
    if (view >= rows.rows) return;
    const T* const map = rows.row(view);
    const std::size_t pixels = image.plane_size();
    T* const render = context.render.data();
    T* const planes = image.data;
    executor.for_chunks(pixels, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; i += P::width) {
        const auto inside = P::MaskType::first(static_cast<std::ptrdiff_t>(end - i));
        const Color color = load(planes, pixels, i, inside);
        for (std::size_t c = 0; c < 3; ++c) {
          color[c].store(render + c * pixels + i, inside);
          const T* const row = map + 4 * c;
          const P mapped = fma(P(row[0]), color[0], fma(P(row[1]), color[1], fma(P(row[2]), color[2], P(row[3]))));
          mapped.store(planes + c * pixels + i, inside);
        }
      }
    });
  }

  /// Turns dL/d(photograph) in `d_image` into dL/d(render) and ADDS the gradient of the view's map. Ordered sums in
  /// double.
  template <Executor E>
  static void backward(ParameterArena<T>& arena, Handles handles, std::size_t view, ImageView<T> d_image,
                       Context& context, E& executor) {
    const MatrixView<const T> rows = std::as_const(arena).values(handles.affine);
    if (view >= rows.rows) return;
    const T* const map = rows.row(view);
    const std::size_t pixels = d_image.plane_size(), chunks = chunk_count(pixels, grain);
    context.partial.resize(12 * chunks);
    const T* const render = context.render.data();
    T* const planes = d_image.data;
    executor.for_chunks(pixels, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::array<double, 12> sum{};
      for (std::size_t part = begin; part < end; part += part_pixels) {
        std::array<P, 12> lanes;  // few enough pixels for sums in T
        lanes.fill(P(T(0)));
        const std::size_t part_end = std::min(end, part + part_pixels);
        for (std::size_t i = part; i < part_end; i += P::width) {
          const auto inside = P::MaskType::first(static_cast<std::ptrdiff_t>(part_end - i));
          const Color color = load(render, pixels, i, inside), d = load(planes, pixels, i, inside);
          for (std::size_t c = 0; c < 3; ++c) {
            for (std::size_t k = 0; k < 3; ++k) lanes[4 * c + k] = fma(d[c], color[k], lanes[4 * c + k]);
            lanes[4 * c + 3] += d[c];
          }
          for (std::size_t k = 0; k < 3; ++k) {
            const P back = fma(P(map[k]), d[0], fma(P(map[4 + k]), d[1], P(map[8 + k]) * d[2]));
            back.store(planes + k * pixels + i, inside);
          }
        }
        for (std::size_t c = 0; c < 12; ++c) sum[c] += static_cast<double>(reduce_add(lanes[c]));
      }
      std::copy(sum.begin(), sum.end(), context.partial.data() + 12 * (begin / grain));
    });
    T* const gradient = arena.gradients(handles.affine).row(view);
    for (std::size_t c = 0; c < 12; ++c) {
      double total = 0;
      for (std::size_t chunk = 0; chunk < chunks; ++chunk) total += context.partial[12 * chunk + c];
      gradient[c] += static_cast<T>(total);
    }
  }

  /// Moves all maps by the same amount so that their mean is the identity.
  static void fix_gauge(ParameterArena<T>& arena, Handles handles) {
    const MatrixView<T> rows = arena.values(handles.affine);
    if (rows.rows == 0) return;
    for (std::size_t c = 0; c < 12; ++c) {
      double sum = 0;
      for (std::size_t view = 0; view < rows.rows; ++view) sum += static_cast<double>(rows(view, c));
      const T shift = static_cast<T>(static_cast<double>(identity(c)) - sum / static_cast<double>(rows.rows));
      for (std::size_t view = 0; view < rows.rows; ++view) rows(view, c) += shift;
    }
  }

 private:
  using P = Pack<T, native_width<T>>;
  using Color = std::array<P, 3>;
  static constexpr std::size_t grain = 16384;       // pixels
  static constexpr std::size_t part_pixels = 1024;  // pixels
  static COMPMARK_INLINE Color load(const T* planes, std::size_t pixels, std::size_t i, typename P::MaskType inside) {
    return {P::load(planes + i, inside), P::load(planes + pixels + i, inside),
            P::load(planes + 2 * pixels + i, inside)};
  }
  static constexpr T identity(std::size_t c) { return c % 5 == 0 ? T(1) : T(0); }  // 0, 5 and 10 are the diagonal of M
};

}  // namespace compmark
