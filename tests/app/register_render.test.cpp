// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/app/register_render.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <string>
#include <vector>

#include "small_models.hpp"
#include "support/tool.hpp"

namespace register_render_test {
namespace {

using namespace compmark;

template <class R>
void check_render(const std::string& recipe) {
  const testing::ScratchFolder folder{"compmark-app-register-render"};
  ThreadExecutor executor(2);
  REQUIRE(write_model(folder.path / "model.safetensors", testing::small_model<R>(5), testing::small_info(recipe)).ok());
  Result<AnyModel> model = AnyModel::open(folder.path / "model.safetensors", executor);
  REQUIRE(model.ok());
  const Camera<double> camera = model->info().views[0].camera;
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  std::vector<float> image(3 * pixels), tangents(27 * pixels);
  const ImageView<float> view{image.data(), 3, camera.height, camera.width},
      planes{tangents.data(), 27, camera.height, camera.width};
  detail::RegisterRender render(*model, camera.fx, executor);
  render.rendered_at_this_size(true);
  REQUIRE(render(camera, view, planes));
  const Result<RenderedView> direct = model->render(camera, executor);
  REQUIRE(direct.ok());
  const auto difference = [&](const ImageView<const float>& other) {
    double most = 0;
    for (std::size_t i = 0; i < image.size(); ++i)
      most = std::max(most, std::abs(static_cast<double>(image[i] - other.data[i])));
    return most;
  };
  CHECK(difference(direct->image) < 1e-6);  // compiled twice: not the same bits

  // Half the size: nearer to means of the whole picture than a render of that size is.
  const Camera<double> half = camera.resized(camera.width / 2, camera.height / 2);
  std::vector<float> small(3 * pixels / 4), small_tangents(27 * pixels / 4), mean(small.size()), plain;
  const ImageView<float> mean_view{mean.data(), 3, half.height, half.width};
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < half.height; ++y) {
      for (int x = 0; x < half.width; ++x)
        mean_view(c, y, x) = 0.25f * (view(c, 2 * y, 2 * x) + view(c, 2 * y + 1, 2 * x) + view(c, 2 * y, 2 * x + 1) +
                                      view(c, 2 * y + 1, 2 * x + 1));
    }
  }
  const Result<RenderedView> thick = model->render(half, executor);
  REQUIRE(thick.ok());
  plain.assign(thick->image.data, thick->image.data + thick->image.size());
  render.rendered_at_this_size(false);
  REQUIRE(render(half, ImageView<float>{small.data(), 3, half.height, half.width},
                 ImageView<float>{small_tangents.data(), 27, half.height, half.width}));
  double error = 0, plain_error = 0;
  for (std::size_t i = 0; i < small.size(); ++i) {
    error += std::pow(static_cast<double>(small[i] - mean[i]), 2);
    plain_error += std::pow(static_cast<double>(plain[i] - mean[i]), 2);
  }
  CHECK(plain_error > 0);
  CHECK(error < 0.1 * plain_error);

  // A principal point moves the image by whole pixels of the size that was asked for.
  Camera<double> shifted = half;
  const double h = 0.02;
  shifted.cx += h;
  std::vector<float> above(small.size()), spare(small_tangents.size());
  REQUIRE(render(shifted, ImageView<float>{above.data(), 3, half.height, half.width},
                 ImageView<float>{spare.data(), 27, half.height, half.width}));
  double product = 0, square = 0;
  for (std::size_t i = 0; i < small.size(); ++i) {
    const double slope = static_cast<double>(above[i] - small[i]) / h;
    const auto tangent = static_cast<double>(small_tangents[7 * small.size() + i]);
    product += slope * tangent;
    square += tangent * tangent;
  }
  CHECK(product == doctest::Approx(square).epsilon(0.05));
}

}  // namespace

TEST_CASE("registration draws what a model renders, at its own size and smaller, with its derivatives") {
  check_render<recipes::Scaffold>("scaffold");
  check_render<recipes::ScaffoldAntiAliased>("scaffold+antialiasing");
}

}  // namespace register_render_test
