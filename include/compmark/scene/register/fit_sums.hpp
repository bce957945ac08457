// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The sums of one step of fit_camera: differences of a picture from a tone-mapped render, their robust weights, and the
// normal equations by the numbers of the camera. Sums are over fixed groups of rows, added in order: the same bits at
// any thread count. Cost: 200 multiply-adds a pixel with derivatives.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/scene/register/camera_step.hpp"
#include "compmark/scene/register/tone_map.hpp"

namespace compmark {

/// Symmetric [9, 9], packed lower triangle.
using CameraMatrix = std::array<double, 45>;

namespace detail {

struct FitSums {
  CameraMatrix h{};
  std::array<double, camera_parameters> g{};
  double cost = 0;
  double weight = 0, weighted_square = 0;
};

/// Room for one size of picture.
struct FitRoom {
  std::vector<float> image, tangents, error, weight;
  ImageView<float> view, planes;
  void resize(int width, int height) {
    const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    image.resize(3 * pixels);
    tangents.resize(27 * pixels);
    error.resize(pixels);
    weight.assign(pixels, 1.0f);
    view = {image.data(), 3, height, width};
    planes = {tangents.data(), 27, height, width};
  }
};

/// One pack of pixels: the difference of each channel, 0 where both are beyond black or white.
template <class P>
struct FitPixels {
  std::array<P, 3> color, difference, slope;  // slope: of the channel's own curve; color: the render's
  std::array<typename P::MaskType, 3> open;
};
template <class P>
[[nodiscard]] COMPMARK_INLINE FitPixels<P> fit_pixels(ImageView<const float> render, ImageView<const float> picture,
                                                      const ToneMap& tone, int x, int y, typename P::MaskType inside) {
  FitPixels<P> result;
  for (int c = 0; c < 3; ++c) result.color[static_cast<std::size_t>(c)] = P::load(render.row(c, y) + x, inside);
  for (int c = 0; c < 3; ++c) {
    const auto k = static_cast<std::size_t>(c);
    const auto t = [&](std::size_t i) { return P(static_cast<float>(tone.term[k][i])); };
    const P own = result.color[k];
    P value = fma(t(1), result.color[0], fma(t(2), result.color[1], fma(t(3), result.color[2], t(0))));
    value = fma(own * own, fma(t(5), own, t(4)), value);
    result.slope[k] = own * fma(P(3.0f) * t(5), own, P(2.0f) * t(4));
    const P clipped = min(max(value, P(0.0f)), P(1.0f));
    result.open[k] = clipped == value;
    result.difference[k] = keep(inside, clipped - P::load(picture.row(c, y) + x, inside));
  }
  return result;
}

template <class Body, Executor E>
void fit_rows(int height, E& executor, const Body& body) {
  executor.for_chunks(static_cast<std::size_t>(height), register_rows,
                      [&](std::size_t begin, std::size_t end, std::size_t) {
                        body(begin / register_rows, static_cast<int>(begin), static_cast<int>(end));
                      });
}

/// room.error = e of every pixel.
template <Executor E>
void fit_errors(FitRoom& room, ImageView<const float> picture, const ToneMap& tone, E& executor) {
  using P = Pack<float, native_width<float>>;
  fit_rows(picture.height, executor, [&](std::size_t, int begin, int end) {
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < picture.width; x += P::width) {
        const auto inside = P::MaskType::first(picture.width - x);
        const FitPixels<P> at = fit_pixels<P>(room.view, picture, tone, x, y, inside);
        const P square = at.difference[0] * at.difference[0] + at.difference[1] * at.difference[1] +
                         at.difference[2] * at.difference[2];
        sqrt(square * P(1.0f / 3.0f))
            .store(room.error.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                       static_cast<std::size_t>(x),
                   inside);
      }
    }
  });
}

/// The deviation of e where the picture tells about the camera: 1.48 times the median over the pixels that a
/// translation would change.
[[nodiscard]] inline double fit_deviation(const FitRoom& room) {
  const std::size_t pixels = room.error.size();
  std::vector<float> told(pixels, 0.0f), errors;
  double mean = 0;
  for (std::size_t plane = 9; plane < 15; ++plane) {
    const float* const tangent = room.tangents.data() + plane * pixels;
    for (std::size_t i = 0; i < pixels; ++i) told[i] += std::abs(tangent[i]);
  }
  for (const float t : told) mean += static_cast<double>(t) / static_cast<double>(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    if (static_cast<double>(told[i]) > 0.1 * mean) errors.push_back(room.error[i]);
  }
  if (errors.empty()) return 1;
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  return 1.48 * static_cast<double>(*middle);
}

/// Weights, cost and, with `derivatives`, the normal equations, at scale c. Differences beyond what least squares can
/// explain weigh little.
template <bool derivatives, Executor E>
[[nodiscard]] FitSums fit_sums(FitRoom& room, ImageView<const float> picture, const ToneMap& tone, double c,
                               E& executor) {
  using P = Pack<float, native_width<float>>;
  std::vector<FitSums> part(chunk_count(static_cast<std::size_t>(picture.height), register_rows));
  const P inverse(static_cast<float>(1 / (c * c)));
  fit_rows(picture.height, executor, [&](std::size_t chunk, int begin, int end) {
    FitSums& sums = part[chunk];
    for (int y = begin; y < end; ++y) {
      std::array<P, 45> h;
      std::array<P, camera_parameters> g;
      h.fill(P(0.0f));
      g.fill(P(0.0f));
      P cost(0.0f), weight(0.0f), weighted(0.0f);
      for (int x = 0; x < picture.width; x += P::width) {
        const auto inside = P::MaskType::first(picture.width - x);
        const FitPixels<P> at = fit_pixels<P>(room.view, picture, tone, x, y, inside);
        const P square = P(1.0f / 3.0f) * (at.difference[0] * at.difference[0] + at.difference[1] * at.difference[1] +
                                           at.difference[2] * at.difference[2]);
        const P root = P(1.0f) / fma(square, inverse, P(1.0f)), w = keep(inside, root * root);
        cost = fma(square, root, cost);
        weight += w;
        weighted = fma(w, square, weighted);
        w.store(room.weight.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                    static_cast<std::size_t>(x),
                inside);
        if constexpr (derivatives) {
          std::array<std::array<P, 3>, camera_parameters> raw;
          for (std::size_t p = 0; p < camera_parameters; ++p) {
            for (std::size_t k = 0; k < 3; ++k)
              raw[p][k] = P::load(room.planes.row(static_cast<int>(3 * p + k), y) + x, inside);
          }
          for (std::size_t k = 0; k < 3; ++k) {
            std::array<P, camera_parameters> j;
            const P own = at.slope[k];
            for (std::size_t p = 0; p < camera_parameters; ++p) {
              P sum = own * raw[p][k];
              for (std::size_t i = 0; i < 3; ++i) sum = fma(P(static_cast<float>(tone.term[k][1 + i])), raw[p][i], sum);
              j[p] = keep(at.open[k], sum);
            }
            std::size_t place = 0;
            for (std::size_t p = 0; p < camera_parameters; ++p) {
              const P weighted_j = w * j[p];
              g[p] = fma(weighted_j, at.difference[k], g[p]);
              for (std::size_t q = 0; q <= p; ++q, ++place) h[place] = fma(weighted_j, j[q], h[place]);
            }
          }
        }
      }
      const auto total = [](P value) {
        double sum = 0;
        for (int lane = 0; lane < P::width; ++lane) sum += static_cast<double>(value.lane(lane));
        return sum;
      };
      sums.cost += total(cost);
      sums.weight += total(weight);
      sums.weighted_square += total(weighted);
      if constexpr (derivatives) {
        for (std::size_t k = 0; k < h.size(); ++k) sums.h[k] += total(h[k]);
        for (std::size_t k = 0; k < g.size(); ++k) sums.g[k] += total(g[k]);
      }
    }
  });
  FitSums all;
  for (const FitSums& one : part) {
    for (std::size_t k = 0; k < all.h.size(); ++k) all.h[k] += one.h[k];
    for (std::size_t k = 0; k < all.g.size(); ++k) all.g[k] += one.g[k];
    all.cost += one.cost;
    all.weight += one.weight;
    all.weighted_square += one.weighted_square;
  }
  return all;
}

}  // namespace detail

}  // namespace compmark
