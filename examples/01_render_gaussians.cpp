// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A hundred Gaussians on a spiral, rendered into a PNG: the shortest program that shows something.
#include <cmath>
#include <compmark/compmark.hpp>
#include <vector>

int main() {
  compmark::GaussianBatch<float> batch;
  batch.resize(100);
  batch.set_zero();
  const auto g = batch.columns();
  for (std::size_t i = 0; i < g.count; ++i) {
    const float t = 0.12f * static_cast<float>(i);
    g.mean[0][i] = 0.08f * t * std::cos(t), g.mean[1][i] = 0.08f * t * std::sin(t), g.mean[2][i] = 3;
    for (float* scale : g.scale) scale[i] = 0.03f + 0.01f * t;
    g.rotation[0][i] = 1;
    g.opacity[i] = 0.8f;
    g.color[0][i] = 0.5f + 0.5f * std::sin(t), g.color[1][i] = 0.5f + 0.5f * std::cos(t), g.color[2][i] = 0.9f;
  }
  const compmark::Camera<float> camera{.width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 320, .cy = 240};
  std::vector<float> pixels(3 * 640 * 480);
  const compmark::ImageView<float> image{pixels.data(), 3, 480, 640};

  compmark::ThreadExecutor threads;
  compmark::TileRasterizer<float>::Context context;
  compmark::TileRasterizer<float>{}.forward(g, camera, {0.02f, 0.02f, 0.05f}, image, context, threads);
  return compmark::write_png("spiral.png", image).ok() ? 0 : 1;
}
