// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What an embedding program does with the installed package: includes the umbrella and renders one Gaussian.
#include <array>
#include <compmark/compmark.hpp>
#include <cstdio>
#include <utility>
#include <vector>

int main() {
  compmark::GaussianBatch<float> batch;
  batch.resize(1);
  batch.set_zero();
  const compmark::GaussianColumns<float> gaussian = batch.columns();
  gaussian.mean[2][0] = 2.0f;
  for (float* scale : gaussian.scale) scale[0] = 0.2f;
  gaussian.rotation[0][0] = 1.0f;
  gaussian.opacity[0] = 0.9f;
  gaussian.color[0][0] = 1.0f;

  compmark::Camera<float> camera;
  camera.width = camera.height = 33;
  camera.fx = camera.fy = 33.0f;
  camera.cx = camera.cy = 16.5f;
  std::vector<float> pixels(3 * 33 * 33);
  const compmark::ImageView<float> image{pixels.data(), 3, 33, 33};

  compmark::ThreadExecutor executor(2);
  const compmark::TileRasterizer<float> rasterizer;
  compmark::TileRasterizer<float>::Context context;
  rasterizer.forward(std::as_const(batch).columns(), camera, std::array<float, 3>{0, 0, 0}, image, context, executor);
  const float red = image(0, 16, 16);
  std::printf("compmark %s: red at the centre %.3f\n", compmark::version, static_cast<double>(red));
  return red > 0.85f && red < 0.91f && image(1, 16, 16) == 0.0f ? 0 : 1;
}
