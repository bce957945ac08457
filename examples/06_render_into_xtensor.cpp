// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A render in an xtensor array, without a copy: it is drawn there, worked on with xtensor's expressions, and written as
// a NumPy file and a PNG. Needs xtensor (target compmark::xtensor).
#include <cmath>
#include <compmark/compmark.hpp>
#include <compmark/io/xtensor_adaptor.hpp>
#include <cstdio>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#if __has_include(<xtensor/containers/xtensor.hpp>)
#include <xtensor/containers/xtensor.hpp>
#include <xtensor/core/xmath.hpp>
#else
#include <xtensor/xmath.hpp>
#include <xtensor/xtensor.hpp>
#endif
#pragma GCC diagnostic pop

int main() {
  compmark::GaussianBatch<float> batch;
  batch.resize(200);
  batch.set_zero();
  const auto g = batch.columns();
  for (std::size_t i = 0; i < g.count; ++i) {
    const float t = 0.1f * static_cast<float>(i);
    g.mean[0][i] = 0.06f * t * std::cos(t), g.mean[1][i] = 0.06f * t * std::sin(t), g.mean[2][i] = 3;
    for (float* scale : g.scale) scale[i] = 0.02f + 0.006f * t;
    g.rotation[0][i] = 1;
    g.opacity[i] = 0.8f;
    g.color[0][i] = 0.5f + 0.5f * std::sin(t), g.color[1][i] = 0.4f, g.color[2][i] = 0.5f + 0.5f * std::cos(t);
  }
  const compmark::Camera<float> camera{.width = 320, .height = 240, .fx = 300, .fy = 300, .cx = 160, .cy = 120};

  xt::xtensor<float, 3> render = xt::zeros<float>({3, 240, 320});
  compmark::ThreadExecutor threads;
  compmark::TileRasterizer<float>::Context context;
  compmark::TileRasterizer<float>{}.forward(g, camera, {0, 0, 0}, compmark::image_view(render), context, threads);

  const xt::xtensor<float, 1> mean = xt::mean(render, {1, 2});
  std::printf("mean red %.3f, green %.3f, blue %.3f\n", static_cast<double>(mean(0)), static_cast<double>(mean(1)),
              static_cast<double>(mean(2)));
  render = xt::clip(1.2f * xt::pow(render, 0.8f), 0.0f, 1.0f);
  const bool written =
      compmark::write_npy("render.npy", render).ok() &&
      compmark::write_png("render.png", compmark::ImageView<const float>(compmark::image_view(render))).ok();
  return written && mean(0) > 0.01f ? 0 : 1;
}
