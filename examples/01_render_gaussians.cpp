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
  const compmark::GaussianColumns<float> g = batch.columns();
  for (std::size_t i = 0; i < g.count; ++i) {
    const float t = 0.12f * static_cast<float>(i), radius = 0.08f * t;
    const float values[14] = {
        radius * std::cos(t),      radius * std::sin(t),      3.0f, 0.03f + 0.01f * t, 0.05f, 0.05f, 1, 0, 0, 0, 0.8f,
        0.5f + 0.5f * std::sin(t), 0.5f + 0.5f * std::cos(t), 0.9f};
    float* const columns[14] = {g.mean[0],  g.mean[1],     g.mean[2],     g.scale[0],    g.scale[1],
                                g.scale[2], g.rotation[0], g.rotation[1], g.rotation[2], g.rotation[3],
                                g.opacity,  g.color[0],    g.color[1],    g.color[2]};
    for (int c = 0; c < 14; ++c) columns[c][i] = values[c];
  }
  const compmark::Camera<float> camera{.width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 320, .cy = 240};
  std::vector<float> pixels(3 * 640 * 480);
  const compmark::ImageView<float> image{pixels.data(), 3, 480, 640};

  compmark::ThreadExecutor threads;
  compmark::TileRasterizer<float>::Context context;
  compmark::TileRasterizer<float>{}.forward(g, camera, {0.02f, 0.02f, 0.05f}, image, context, threads);
  return compmark::write_png("spiral.png", image).ok() ? 0 : 1;
}
