// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the tests of the lens and of the mip filter share: rasterizers with effects, pictures on black, and the gradient
// law with settings.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/scene/lens.hpp"
#include "compmark/scene/lens_policy.hpp"
#include "compmark/splat/raster/effects.hpp"
#include "compmark/splat/raster/reference.hpp"
#include "compmark/splat/raster/tile.hpp"
#include "compmark/testing/raster_laws.hpp"
#include "support/raster.hpp"

namespace compmark::testing {

/// Every Gaussian at every pixel, nothing clamped: sums over pixels then have closed forms.
inline constexpr Accuracy uncut{.exp_degree = 0, .alpha_min = 0, .alpha_max = 1.0f, .transmittance_stop = 0};

template <class T, Accuracy accuracy, class Effects>
using TileWith = EffectTileRasterizer<T, Effects, accuracy>;

/// A phone's lens (OPENCV) and a fisheye; 20 and 40 % of the radius at the corner of a wide image.
inline const Lens phone_lens{LensModel::opencv, {-0.25, 0.08, 0.004, -0.003}};
inline const Lens wide_lens{LensModel::opencv_fisheye, {-0.03, 0.004, -0.001, 0.0002}};

template <class LensPolicy>
struct LensOf;
template <class T>
struct LensOf<RadialTangentialLens<T>> {
  static RadialTangentialLens<T> make() { return *radial_tangential_lens<T>(phone_lens); }
};
template <class T>
struct LensOf<FisheyeLens<T>> {
  static FisheyeLens<T> make() { return *fisheye_lens<T>(wide_lens); }
};
template <>
struct LensOf<PinholeLens> {
  static PinholeLens make() { return {}; }
};

/// R with the lens of its type.
template <class R>
R with_lens() {
  typename R::Settings settings;
  settings.lens = LensOf<typename R::EffectPolicy::Lens>::make();
  return R(settings);
}

/// Law R2 with effects: every entry of every column against central differences of two widths, whose truncation is
/// extrapolated away: the steps follow the entry, because scales are a hundredth of everything else. Relative to the
/// largest gradient of the column. For rasterizers without a hard cut.
template <class R>
void check_gradients(const R& rasterizer, RasterScene<double>& scene, double tolerance) {
  const std::size_t n = scene.gaussians.size();
  const int width = scene.camera.width, height = scene.camera.height;
  std::vector<double> image(static_cast<std::size_t>(3 * width * height)), d_image(image.size());
  const Random random(5, 0, random_stage("test/effects_law"));
  for (std::size_t i = 0; i < d_image.size(); ++i) d_image[i] = static_cast<double>(random.centered(i));
  typename R::Context context;
  SerialExecutor serial;
  const GaussianColumns<const double> gaussians = std::as_const(scene.gaussians).columns();
  const auto loss = [&] {
    rasterizer.forward(gaussians, scene.camera, scene.background, {image.data(), 3, height, width}, context, serial);
    double sum = 0;
    for (std::size_t i = 0; i < image.size(); ++i) sum += d_image[i] * image[i];
    return sum;
  };
  loss();
  GaussianBatch<double> gradient;
  gradient.resize(n);
  gradient.set_zero();
  rasterizer.backward(gaussians, scene.camera, scene.background, {d_image.data(), 3, height, width}, gradient.columns(),
                      context, serial);
  const auto variables = all_columns(scene.gaussians.columns()), gradients = all_columns(gradient.columns());
  for (std::size_t c = 0; c < 14; ++c) {
    double worst = 0, size = 0;
    for (std::size_t i = 0; i < n; ++i) {
      double& x = variables[c][i];
      const double kept = x, step = 2e-4 * std::max(std::abs(kept), 1e-3);
      const auto difference = [&](double h) {
        x = kept + h;
        const double above = loss();
        x = kept - h;
        const double below = loss();
        x = kept;
        return (above - below) / (2 * h);
      };
      const double narrow = difference(step / 2), expected = narrow + (narrow - difference(step)) / 3;
      worst = std::max(worst, std::abs(gradients[c][i] - expected));
      size = std::max(size, std::abs(expected));
    }
    INFO("column ", c, ": error ", worst / size);
    CHECK(size > 0);
    CHECK(worst <= tolerance * size);
  }
}

/// `rasterizer` against the reference with the same effects, both as made by with_lens().
template <class R, class Reference>
void check_agreement_with_effects(double image, double gradient) {
  const std::string broken = raster_agrees(with_lens<R>(), with_lens<Reference>(), {image, gradient}, 3);
  CHECK_MESSAGE(broken.empty(), broken);
}

}  // namespace compmark::testing
