// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Laws R1 and R3-R6 of splat/raster/concept.hpp, for any rasterizer:
//   const std::string broken = compmark::testing::raster_laws(MyRasterizer{});
//   const std::string apart = compmark::testing::raster_agrees(MyRasterizer{}, ReferenceRasterizer<double>{}, {.image =
//     2e-5});
// R2, the gradient law, needs double and CutoffRule::smooth: use testing/gradient.hpp on a rasterizer built with both.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/raster/concept.hpp"
#include "compmark/testing/raster_scene.hpp"
#include "compmark/testing/violations.hpp"

namespace compmark {
namespace testing {

/// Image [3, height, width] and gradients of one forward and one backward.
template <class T>
struct RasterRun {
  std::vector<T> image;
  GaussianBatch<T> gradient;
  RasterReport report;
};

/// Forward, then backward with a fixed random d_image, `backwards` times into the same gradients.
template <Rasterizer R, Executor E>
[[nodiscard]] RasterRun<typename R::Scalar> run_rasterizer(const R& rasterizer,
                                                           const RasterScene<typename R::Scalar>& scene, E& executor,
                                                           int backwards = 1) {
  using T = typename R::Scalar;
  RasterRun<T> run;
  const int width = scene.camera.width;
  const int height = scene.camera.height;
  run.image.assign(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), T(-7));
  std::vector<T> d_image(run.image.size());
  const Random random(11, 0, random_stage("testing/run_rasterizer"));
  for (std::size_t i = 0; i < d_image.size(); ++i) d_image[i] = static_cast<T>(random.centered(i));
  run.gradient.resize(scene.gaussians.size());
  run.gradient.set_zero();
  typename R::Context context;
  const ImageView<T> image{run.image.data(), 3, height, width};
  const ImageView<const T> d_view{d_image.data(), 3, height, width};
  const GaussianColumns<const T> gaussians = scene.gaussians.columns();
  run.report = rasterizer.forward(gaussians, scene.camera, scene.background, image, context, executor);
  for (int i = 0; i < backwards; ++i) {
    rasterizer.backward(gaussians, scene.camera, scene.background, d_view, run.gradient.columns(), context, executor);
  }
  return run;
}

namespace detail {

template <class T>
[[nodiscard]] bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

/// ||a - b|| / ||b|| over the rows of one column.
template <class T, class U>
[[nodiscard]] double relative_distance(const T* a, const U* b, std::size_t rows) {
  double difference = 0;
  double size = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    const double d = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    difference += d * d;
    size += static_cast<double>(b[i]) * static_cast<double>(b[i]);
  }
  return size > 0 ? std::sqrt(difference / size) : std::sqrt(difference);
}

template <class T>
[[nodiscard]] bool same_gradient_bits(const GaussianBatch<T>& a, const GaussianBatch<T>& b, std::size_t rows) {
  const auto x = all_columns(a.columns());
  const auto y = all_columns(b.columns());
  for (std::size_t c = 0; c < x.size(); ++c) {
    if (std::memcmp(x[c], y[c], rows * sizeof(T)) != 0) return false;
  }
  return true;
}

}  // namespace detail

/// R3-R6, and that backward adds, on random scenes of `count` Gaussians. `tolerance` bounds |image - 1| in R6 and the
/// relative error of the doubled gradient; 0 takes 1e-5 for float and 1e-13 for double (300 layers x 1 unit in the last
/// place, rounded up).
template <Rasterizer R>
[[nodiscard]] std::string raster_laws(const R& rasterizer, std::uint64_t seed = 1, std::size_t count = 300,
                                      double tolerance = 0) {
  using T = typename R::Scalar;
  if (tolerance == 0) tolerance = sizeof(T) == 4 ? 1e-5 : 1e-13;
  Violations violations;
  SerialExecutor serial;
  const RasterScene<T> scene = raster_scene<T>(seed, count, 83, 61);
  const RasterRun<T> expected = run_rasterizer(rasterizer, scene, serial);

  {  // R3: the order of the input does not matter when depths differ …
    std::vector<std::size_t> order(count);
    for (std::size_t i = 0; i < count; ++i) order[i] = (i + 17) * 31 % count;
    if (count % 31 == 0) {
      for (std::size_t i = 0; i < count; ++i) order[i] = count - 1 - i;
    }
    const RasterRun<T> shuffled = run_rasterizer(rasterizer, reordered(scene, order), serial);
    violations.expect(detail::same_bits(shuffled.image, expected.image), "R3",
                      "the image depends on the order of the input");
  }
  {  // … and ties go by index: equal depth blends like "the first is nearer", not like "the second is nearer".
    RasterScene<T> pair = raster_scene<T>(seed, 2, 32, 32);
    const GaussianColumns<T> g = pair.gaussians.columns();
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        g.mean[axis][i] = axis == 2 ? T(4) : T(0);
        g.scale[axis][i] = T(0.5);
      }
      g.opacity[i] = T(0.8);
      for (std::size_t c = 0; c < 3; ++c) g.color[c][i] = static_cast<T>(i);
    }
    const RasterRun<T> tie = run_rasterizer(rasterizer, pair, serial);
    const T center = tie.image[16 * 32 + 16];
    violations.expect(center < T(0.5), "R3", "of two Gaussians at one depth the second was blended first");
  }
  {  // R4: Gaussians that are culled change no bit of the image or of the others' gradients, and get none themselves.
    RasterScene<T> more;
    std::vector<std::size_t> order(count + 4, 0);
    for (std::size_t i = 0; i < count; ++i) order[i] = i;
    more = reordered(scene, order);
    const GaussianColumns<T> g = more.gaussians.columns();
    g.mean[2][count] = T(-4);         // behind the camera
    g.opacity[count + 1] = T(0);      // nothing to see
    g.opacity[count + 2] = T(-1);     // the decoder's way to say "not there"
    g.mean[0][count + 3] = T(10000);  // far outside the image
    const RasterRun<T> run = run_rasterizer(rasterizer, more, serial);
    violations.expect(detail::same_bits(run.image, expected.image), "R4", "a culled Gaussian changed the image");
    violations.expect(detail::same_gradient_bits(run.gradient, expected.gradient, count), "R4",
                      "a culled Gaussian changed the gradient of another one");
    bool zero = true;
    for (const T* column : all_columns(run.gradient.columns())) {
      for (std::size_t i = count; i < count + 4; ++i) zero = zero && column[i] == T(0);
    }
    violations.expect(zero, "R4", "a culled Gaussian has a gradient");
  }
  for (const std::size_t threads : {std::size_t{1}, std::size_t{2}, std::size_t{3}, std::size_t{8}}) {  // R5
    ThreadExecutor executor(threads);
    const RasterRun<T> run = run_rasterizer(rasterizer, scene, executor);
    violations.expect(detail::same_bits(run.image, expected.image) &&
                          detail::same_gradient_bits(run.gradient, expected.gradient, count),
                      "R5", std::to_string(threads) + " threads give other bits than the serial executor");
  }
  {  // R6: white Gaussians before white are white: the weights and the transmittance that is left sum to one.
    RasterScene<T> white = raster_scene<T>(seed + 1, count, 83, 61);
    white.background = {T(1), T(1), T(1)};
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t i = 0; i < count; ++i) white.gaussians.columns().color[c][i] = T(1);
    }
    double worst = 0;
    for (const T value : run_rasterizer(rasterizer, white, serial).image) {
      const double error = std::abs(static_cast<double>(value) - 1);
      if (!(error <= worst)) worst = error;
    }
    violations.expect(worst <= tolerance, "R6",
                      "weights and transmittance sum to 1 with error " + std::to_string(worst));
  }
  {  // backward adds
    const RasterRun<T> twice = run_rasterizer(rasterizer, scene, serial, 2);
    GaussianBatch<T> doubled;
    doubled.resize(count);
    const auto from = all_columns(expected.gradient.columns());
    const auto to = all_columns(doubled.columns());
    const auto got = all_columns(twice.gradient.columns());
    double worst = 0;
    for (std::size_t c = 0; c < to.size(); ++c) {
      for (std::size_t i = 0; i < count; ++i) to[c][i] = 2 * from[c][i];
      const double distance = detail::relative_distance(got[c], to[c], count);
      if (!(distance <= worst)) worst = distance;
    }
    violations.expect(worst <= tolerance, "backward",
                      "a second backward does not add the same again (relative error " + std::to_string(worst) + ")");
  }
  return violations.text();
}

/// What R1 allows: the largest absolute error of a pixel, and of the gradients ||difference|| / ||reference|| per
/// column.
struct RasterTolerance {
  double image = 2e-5;
  double gradient = 1e-3;
};

/// R1: `rasterizer` against `reference`, which may have another scalar, on the same scene.
template <Rasterizer R, Rasterizer Reference>
[[nodiscard]] std::string raster_agrees(const R& rasterizer, const Reference& reference,
                                        const RasterTolerance& tolerance, std::uint64_t seed = 1,
                                        std::size_t count = 300) {
  using T = typename R::Scalar;
  using U = typename Reference::Scalar;
  Violations violations;
  SerialExecutor serial;
  const RasterScene<T> scene = raster_scene<T>(seed, count, 83, 61);
  const RasterRun<T> actual = run_rasterizer(rasterizer, scene, serial);
  const RasterRun<U> expected = run_rasterizer(reference, cast_scene<U>(scene), serial);
  double worst = 0;
  for (std::size_t i = 0; i < actual.image.size(); ++i) {
    const double error = std::abs(static_cast<double>(actual.image[i]) - static_cast<double>(expected.image[i]));
    if (!(error <= worst)) worst = error;
  }
  violations.expect(worst <= tolerance.image, "R1",
                    "largest pixel error " + std::to_string(worst) + " > " + std::to_string(tolerance.image));
  const auto a = all_columns(actual.gradient.columns());
  const auto b = all_columns(expected.gradient.columns());
  for (std::size_t c = 0; c < a.size(); ++c) {
    const double distance = detail::relative_distance(a[c], b[c], count);
    violations.expect(distance <= tolerance.gradient, "R1",
                      "gradient column " + std::to_string(c) + ": relative error " + std::to_string(distance) + " > " +
                          std::to_string(tolerance.gradient));
  }
  return violations.text();
}

}  // namespace testing
}  // namespace compmark
