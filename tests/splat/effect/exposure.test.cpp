// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/effect/exposure.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"

namespace {

using namespace compmark;
static_assert(Exposure<AffineExposure<float>> && Exposure<NoExposure> && !present<NoExposure>);

template <class T>
struct Scene {
  static constexpr int height = 37, width = 53;  // not a multiple of a pack or of a chunk
  ParameterArena<T> arena;
  typename AffineExposure<T>::Handles handles;
  typename AffineExposure<T>::Context context;
  std::vector<T> render, image, slope;
  explicit Scene(std::size_t views = 3) : handles(AffineExposure<T>::add_parameters(arena, views)) {
    AffineExposure<T>::initialise(arena, handles);
    const Random random(5, 0, random_stage("exposure test"));
    for (std::size_t i = 0; i < 3 * static_cast<std::size_t>(height * width); ++i) {
      render.push_back(static_cast<T>(random.uniform(i)));
      slope.push_back(static_cast<T>(random.normal(i + (1u << 20))));
    }
    const MatrixView<T> maps = arena.values(handles.affine);
    for (std::size_t v = 0; v < views; ++v) {
      for (std::size_t c = 0; c < 12; ++c) maps(v, c) += static_cast<T>(0.2 * random.normal(777 + 12 * v + c));
    }
  }
  ImageView<T> view(std::vector<T>& values) { return {values.data(), 3, height, width}; }
  /// sum(slope * photograph)
  template <Executor E>
  double loss(std::size_t view_index, E& executor) {
    image = render;
    AffineExposure<T>::forward(arena, handles, view_index, view(image), context, executor);
    double sum = 0;
    for (std::size_t i = 0; i < image.size(); ++i) sum += static_cast<double>(slope[i]) * static_cast<double>(image[i]);
    return sum;
  }
};

}  // namespace

TEST_CASE("effect/exposure: the photograph is M C + t of its own view") {
  Scene<double> scene;
  SerialExecutor serial;
  static_cast<void>(scene.loss(1, serial));
  const MatrixView<const double> maps = std::as_const(scene.arena).values(scene.handles.affine);
  const std::size_t pixels = Scene<double>::height * Scene<double>::width;
  double error = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      double expected = maps(1, 4 * c + 3);
      for (std::size_t k = 0; k < 3; ++k) expected += maps(1, 4 * c + k) * scene.render[k * pixels + i];
      error = std::max(error, std::abs(scene.image[c * pixels + i] - expected));
    }
  }
  CHECK(error < 1e-15);
}

TEST_CASE("effect/exposure: gradients of the render and of the map (central differences in double)") {
  Scene<double> scene;
  SerialExecutor serial;
  const auto loss = [&] { return scene.loss(2, serial); };
  static_cast<void>(loss());
  std::vector<double> d = scene.slope;
  AffineExposure<double>::backward(scene.arena, scene.handles, 2, scene.view(d), scene.context, serial);
  CHECK(testing::gradient_law(loss, scene.render, d) == "");
  const MatrixView<double> maps = scene.arena.values(scene.handles.affine);
  const MatrixView<double> d_maps = scene.arena.gradients(scene.handles.affine);
  CHECK(testing::gradient_law(loss, std::span<double>(maps.data, 36), std::span<const double>(d_maps.data, 36)) == "");
}

TEST_CASE("effect/exposure: the same bits at any thread count") {
  std::vector<float> expected;
  for (const std::size_t threads : {1u, 2u, 3u}) {
    Scene<float> scene;
    ThreadExecutor executor(threads);
    static_cast<void>(scene.loss(0, executor));
    std::vector<float> d = scene.slope;
    AffineExposure<float>::backward(scene.arena, scene.handles, 0, scene.view(d), scene.context, executor);
    std::vector<float> all = scene.image;
    all.insert(all.end(), d.begin(), d.end());
    const MatrixView<float> g = scene.arena.gradients(scene.handles.affine);
    all.insert(all.end(), g.data, g.data + 36);
    if (expected.empty()) expected = all;
    CHECK(all == expected);
  }
}

TEST_CASE("effect/exposure: an unseen view is rendered in the gauge, and the gauge is the mean of the maps") {
  Scene<double> scene(4);
  SerialExecutor serial;
  static_cast<void>(scene.loss(unseen_view, serial));
  CHECK(scene.image == scene.render);
  const MatrixView<double> maps = scene.arena.values(scene.handles.affine);
  const double gap_before = maps(0, 1) - maps(3, 1);
  AffineExposure<double>::fix_gauge(scene.arena, scene.handles);
  for (std::size_t c = 0; c < 12; ++c) {
    double mean = 0;
    for (std::size_t v = 0; v < 4; ++v) mean += maps(v, c) / 4;
    CHECK(std::abs(mean - (c % 5 == 0 ? 1 : 0)) < 1e-15);
  }
  CHECK(std::abs(maps(0, 1) - maps(3, 1) - gap_before) < 1e-15);  // views keep their differences
}
