// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/raster/tile.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/splat/raster/reference.hpp"
#include "compmark/testing/raster_laws.hpp"
#include "compmark/testing/raster_scene.hpp"
#include "support/raster.hpp"

using namespace compmark;
using testing::gradient_of;
using testing::image_of;
using testing::nearly_opaque;
using testing::one_pixel_stack;
using testing::raster_scene;
using testing::RasterScene;
using testing::stack;

static_assert(Rasterizer<TileRasterizer<float>>);
static_assert(Rasterizer<TileRasterizer<double, accuracy::inria>>);

namespace {

constexpr RasterOutputs planes{.alpha = true, .depth = true};
constexpr RasterOutputs everything{.alpha = true, .depth = true, .screen_statistics = true};

template <class R, class Reference>
void check_agreement(double image, double gradient) {
  const std::string broken = testing::raster_agrees(R{}, Reference{}, {image, gradient}, 3);
  CHECK_MESSAGE(broken.empty(), broken);
}
template <Accuracy accuracy>
void check_double(double image, double gradient) {
  check_agreement<TileRasterizer<double, accuracy>, ReferenceRasterizer<double, accuracy>>(image, gradient);
}
template <Accuracy accuracy>
void check_float(double image, double gradient) {
  check_agreement<TileRasterizer<float, accuracy>, ReferenceRasterizer<double, accuracy>>(image, gradient);
}
template <class R>
void check_laws() {
  const std::string broken = testing::raster_laws(R{}, 9);
  CHECK_MESSAGE(broken.empty(), broken);
}

}  // namespace

TEST_CASE("raster/tile: equals the reference in double, every preset (R1)") {
  // With std::exp only the order of sums differs. A polynomial adds its error (9e-8, 3e-6, 1e-4 for degree 5, 4, 3; at most a few layers
  // count), and where it moves an alpha across the cut-off the splat's share, alpha_min.
  check_double<accuracy::exact>(1e-12, 1e-11);
  check_double<accuracy::spec>(1e-12, 1e-11);
  check_double<accuracy::inria>(1e-12, 1e-11);
  check_double<accuracy::quality>(1e-7, 1e-6);
  check_double<accuracy::standard>(1e-6, 1e-5);
  check_double<accuracy::fast>(1e-4, 1e-3);
  check_double<accuracy::draft>(1e-2, 1e-1);
}

TEST_CASE("raster/tile: one lane equals the reference in double (R1)") {
  check_agreement<TileRasterizer<double, accuracy::spec, RasterOutputs{}, 1>, ReferenceRasterizer<double>>(1e-12,
                                                                                                           1e-11);
}

TEST_CASE("raster/tile: float against the reference in double, every preset (R1)") {
  check_float<accuracy::exact>(1e-5, 1e-4);
  check_float<accuracy::spec>(1e-5, 1e-3);
  check_float<accuracy::inria>(1e-5, 1e-3);
  check_float<accuracy::quality>(1e-5, 1e-3);
  check_float<accuracy::standard>(1e-5, 1e-3);
  check_float<accuracy::fast>(1e-4, 1e-3);
  check_float<accuracy::draft>(1e-2, 1e-1);
}

TEST_CASE(
    "raster/tile: the laws of the concept, in float, double, under the published rules and with every output (R3-R6)") {
  check_laws<TileRasterizer<float>>();
  check_laws<TileRasterizer<double, accuracy::spec>>();
  check_laws<TileRasterizer<float, accuracy::inria>>();
  check_laws<TileRasterizer<float, accuracy::standard, everything>>();
}

TEST_CASE("raster/tile: every pack width gives the same picture to rounding") {
  const RasterScene<float> scene = raster_scene<float>(4, 500, 83, 61);
  const std::vector<float> expected = image_of(TileRasterizer<float, accuracy::quality, RasterOutputs{}, 1>{}, scene);
  const auto distance = [&](const std::vector<float>& image) {
    float worst = 0;
    for (std::size_t i = 0; i < image.size(); ++i) worst = std::max(worst, std::abs(image[i] - expected[i]));
    return worst;
  };
  // Fused or not, every operation rounds to 6e-8; the cut-off of 1/1024 may fall on either side.
  CHECK(distance(image_of(TileRasterizer<float, accuracy::quality, RasterOutputs{}, 2>{}, scene)) < 2e-3f);
  CHECK(distance(image_of(TileRasterizer<float, accuracy::quality, RasterOutputs{}, 4>{}, scene)) < 2e-3f);
  CHECK(distance(image_of(TileRasterizer<float, accuracy::quality, RasterOutputs{}, 8>{}, scene)) < 2e-3f);
  CHECK(distance(image_of(TileRasterizer<float, accuracy::quality, RasterOutputs{}, 16>{}, scene)) < 2e-3f);
}

TEST_CASE("raster/tile: the size of a tile changes no bit of the image (K5)") {
  constexpr Accuracy tile_32{.tile_size = 32}, tile_48{.tile_size = 48};
  const RasterScene<float> scene = raster_scene<float>(6, 700, 131, 77);
  const std::vector<float> expected = image_of(TileRasterizer<float>{}, scene);
  CHECK(image_of(TileRasterizer<float, tile_32>{}, scene) == expected);
  CHECK(image_of(TileRasterizer<float, tile_48>{}, scene) == expected);
  const std::string broken =
      testing::raster_agrees(TileRasterizer<float, tile_32>{}, TileRasterizer<float>{}, {0, 1e-6}, 6);
  CHECK_MESSAGE(broken.empty(), broken);
}

TEST_CASE("raster/tile: gradient law of the whole pass in double, alpha and depth planes included (R2, BF4)") {
  testing::check_gradient_law<TileRasterizer<double, testing::smooth, planes>>();
}

TEST_CASE("raster/tile: the table of blending gradients in float, six to 2300 layers (BB1)") {
  testing::check_blend_table<TileRasterizer<float, nearly_opaque>>();
}

TEST_CASE_TEMPLATE("raster/tile: one flat colour has no gradient of geometry or opacity, not even rounding (BB1)", T,
                   float, double) {
  testing::check_flat_color<TileRasterizer<T>>();
}

TEST_CASE("raster/tile: alpha of exactly one is finite and hides what is behind (BB2, BF7)") {
  RasterScene<float> opaque = one_pixel_stack<float>(30, 1.0f);
  const auto exact = gradient_of(TileRasterizer<float, accuracy::exact>{}, opaque);
  for (const float* column : testing::all_columns(exact.columns())) {
    CHECK(std::isfinite(column[0]));
    for (std::size_t i = 1; i < 30; ++i) CHECK(column[i] == 0);
  }
  opaque = one_pixel_stack<float>(30, 0.98f);  // stopped by the transmittance: 0.02^3 < 1e-4
  const auto stopped = gradient_of(TileRasterizer<float>{}, opaque);
  for (const float* column : testing::all_columns(stopped.columns())) {
    for (std::size_t i = 3; i < 30; ++i) CHECK(column[i] == 0);
  }
  CHECK(stopped.columns().color[0][2] > 0);
  // Negative control: what does not stop has gradients behind the third.
  CHECK(gradient_of(TileRasterizer<float, nearly_opaque>{}, opaque).columns().color[0][3] > 0);
}

TEST_CASE("raster/tile: fifty thousand Gaussians that nobody sees change no bit (BF8)") {
  constexpr std::size_t hidden = 50000, seen = 300;
  const RasterScene<float> scene = raster_scene<float>(9, seen, 83, 61);
  std::vector<std::size_t> order(hidden, 0);
  for (std::size_t i = 0; i < seen; ++i) order.push_back(i);
  RasterScene<float> more = testing::reordered(scene, order);
  const GaussianColumns<float> g = more.gaussians.columns();
  for (std::size_t i = 0; i < hidden; ++i) {
    if (i % 4 == 0) g.mean[2][i] = -1;
    if (i % 4 == 1) g.opacity[i] = -0.1f;
    if (i % 4 == 2) g.mean[0][i] = 1e4f;
    if (i % 4 == 3) g.mean[1][i] = std::nanf("");
  }
  CHECK(image_of(TileRasterizer<float>{}, more) == image_of(TileRasterizer<float>{}, scene));
  const auto with = gradient_of(TileRasterizer<float>{}, more), without = gradient_of(TileRasterizer<float>{}, scene);
  const auto a = testing::all_columns(with.columns()), b = testing::all_columns(without.columns());
  for (std::size_t c = 0; c < 14; ++c) {
    CHECK(std::all_of(a[c], a[c] + hidden, [](float d) { return d == 0; }));
    CHECK(std::equal(b[c], b[c] + seen, a[c] + hidden));
  }
  g.mean[2][0] = scene.gaussians.columns().mean[2][0];  // negative control: one of them in front of the camera
  CHECK(image_of(TileRasterizer<float>{}, more) != image_of(TileRasterizer<float>{}, scene));
}

TEST_CASE("raster/tile: a scene of colours next to nothing is blended as black, and they move (SY4)") {
  const RasterScene<float> normal = raster_scene<float>(16, 400, 128, 96);
  for (const float next_to_nothing : {1e-40f, 1e-36f}) {
    RasterScene<float> dark = normal;
    dark.background = {};
    for (std::size_t c = 0; c < 3; ++c) std::fill_n(dark.gaussians.columns().color[c], 400, next_to_nothing);
    for (const float pixel : image_of(TileRasterizer<float>{}, dark)) CHECK(pixel == 0);
    const auto gradient = gradient_of(TileRasterizer<float>{}, dark);
    CHECK(*std::max_element(gradient.columns().color[0], gradient.columns().color[0] + 400) > 1);
    // Negative control: blended, it would be denormal, or times a small weight it would be, and take 30 times as long.
    const float weight = 1e-4f;
    CHECK((std::fpclassify(next_to_nothing) == FP_SUBNORMAL ||
           std::fpclassify(next_to_nothing * weight) == FP_SUBNORMAL));
  }
}

TEST_CASE(
    "raster/tile: the gradient of a splat of a million pixels keeps the digits that one running sum loses (BB3)") {
  RasterScene<float> sky = stack<float>(1, 0.5f, 1025, 1025);
  for (std::size_t k = 0; k < 3; ++k) {
    sky.gaussians.columns().scale[k][0] = 8;  // 400 pixels
    sky.gaussians.columns().color[k][0] = 1;
    sky.background[k] = 0;
  }
  // White on black, the picture is the weights, and the colour's gradient for a gradient of ones is their sum.
  const std::vector<float> image = image_of(TileRasterizer<float>{}, sky);
  double exact = 0;
  float running = 0;
  for (std::size_t i = 0; i < image.size() / 3; ++i) {
    exact += static_cast<double>(image[i]);
    running += image[i];
  }
  const double got = static_cast<double>(gradient_of(TileRasterizer<float>{}, sky).columns().color[0][0]);
  MESSAGE("error of the sum: ", std::abs(got / exact - 1),
          ", of a running one: ", std::abs(static_cast<double>(running) / exact - 1));
  CHECK(std::abs(got / exact - 1) < 1e-6);
  CHECK(std::abs(static_cast<double>(running) / exact - 1) > 1e-5);  // negative control
}

TEST_CASE("raster/tile: an opaque wall leaves at most the threshold; the published stop leaks (BF1)") {
  RasterScene<float> wall = one_pixel_stack<float>(3, 0.99f);
  wall.background = {1, 1, 1};
  for (std::size_t c = 0; c < 3; ++c) std::fill_n(wall.gaussians.columns().color[c], 3, 0.0f);
  CHECK(image_of(TileRasterizer<float>{}, wall)[0] <= 1.0001e-4f);
  const float leak = image_of(TileRasterizer<float, accuracy::inria>{}, wall)[0];
  CHECK(leak > 0.9e-4f);  // stops before the second, or after it: 0.01^2 = 1e-4 is on the edge of the rule
  CHECK(leak <= 1.01e-2f);
}

TEST_CASE("raster/tile: a clamped alpha does not move with the opacity; the published backward lets it (BF3)") {
  RasterScene<double> scene = one_pixel_stack<double>(1, 0.995);
  CHECK(gradient_of(TileRasterizer<double>{}, scene).columns().opacity[0] == 0);
  CHECK(gradient_of(TileRasterizer<double, accuracy::inria>{}, scene).columns().opacity[0] != 0);
}

TEST_CASE("raster/tile: weights and transmittance sum to one through 2300 layers, nine chunks of the list (BF2)") {
  for (const float opacity : {0.01f, 0.05f, 0.3f}) {
    RasterScene<float> white = stack<float>(2300, opacity);
    white.background = {1, 1, 1};
    for (std::size_t c = 0; c < 3; ++c) std::fill_n(white.gaussians.columns().color[c], 2300, 1.0f);
    for (const float value : image_of(TileRasterizer<float, nearly_opaque>{}, white)) {
      CHECK(std::abs(value - 1) <= 2e-5f);  // 4e-7 sqrt(2300)
    }
    const auto expected = image_of(ReferenceRasterizer<double, accuracy::spec>{},
                                   testing::cast_scene<double>(stack<float>(2300, opacity)));
    const auto got = image_of(TileRasterizer<float, accuracy::spec>{}, stack<float>(2300, opacity));
    for (std::size_t i = 0; i < got.size(); ++i)
      CHECK(static_cast<double>(got[i]) == doctest::Approx(expected[i]).epsilon(1e-3));
  }
}

TEST_CASE("raster/tile: backward sees the very splats that forward blended (BF6)") {
  // The image is linear in the colours: sum over pixels of image = sum over splats of colour * gradient + background * transmittance. One
  // splat skipped in one pass alone would be an error of 1/255 of a pixel; the sums agree to rounding.
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const RasterScene<float> scene = raster_scene<float>(seed, 400, 65, 49);
    using R = TileRasterizer<float, accuracy::standard, planes>;
    const R rasterizer;
    R::Context context;
    const std::vector<float> image = image_of(rasterizer, scene, context);
    const auto gradient = gradient_of(rasterizer, scene);
    double left = 0, right = 0;
    for (const float value : image) left += static_cast<double>(value);
    for (std::size_t c = 0; c < 3; ++c) {
      for (const float alpha : context.alpha.span())
        right += static_cast<double>(scene.background[c]) * (1 - static_cast<double>(alpha));
      for (std::size_t i = 0; i < 400; ++i) {
        right += static_cast<double>(scene.gaussians.columns().color[c][i]) *
                 static_cast<double>(gradient.columns().color[c][i]);
      }
    }
    CHECK(std::abs(left - right) <= 1e-6 * left);
  }
}

TEST_CASE("raster/tile: an image of any size is the corner of a larger one, bit for bit (TB7)") {
  const RasterScene<float> scene = raster_scene<float>(15, 600, 300, 290);
  const std::vector<float> whole = image_of(TileRasterizer<float>{}, scene);
  constexpr std::array<int, 6> sizes{1, 15, 16, 17, 100, 257};
  for (const int width : sizes) {
    for (const int height : sizes) {
      RasterScene<float> corner = scene;
      // The Jacobian's clamp follows the frame (docs/spec/numerics.md, PR4), so the crop happens after projection: same
      // camera, smaller lists.
      corner.camera = scene.camera.cropped(0, 0, width, height);
      TileRasterizer<float>::Context context;
      SerialExecutor serial;
      std::vector<float> part(static_cast<std::size_t>(3 * width * height));
      const ImageView<float> view{part.data(), 3, height, width};
      project<accuracy::standard>(std::as_const(scene.gaussians).columns(), scene.camera, ProjectionSettings<float>{},
                                  context.projected, context.project_workspace, serial);
      REQUIRE(bin<accuracy::standard>(context.projected, width, height, BinSettings{}, context.lists,
                                      context.bin_workspace, serial)
                  .ok());
      TileRasterizer<float>{}.blend_forward(width, height, scene.background, view, context, serial);
      bool same = true;
      for (int c = 0; c < 3; ++c) {
        for (int y = 0; y < height; ++y) {
          same = same && std::memcmp(view.row(c, y), whole.data() + (c * 290 + y) * 300,
                                     static_cast<std::size_t>(width) * sizeof(float)) == 0;
        }
      }
      CHECK_MESSAGE(same, width << " x " << height);
    }
  }
}

TEST_CASE("raster/tile: nothing to draw is the background, with zero gradients (TB10)") {
  RasterScene<float> scene = raster_scene<float>(1, 16, 20, 18);
  for (std::size_t i = 0; i < 16; ++i) scene.gaussians.columns().opacity[i] = -0.5f;
  RasterScene<float> empty = scene;
  empty.gaussians.resize(0);
  for (const RasterScene<float>* nothing : {&scene, &empty}) {
    using R = TileRasterizer<float, accuracy::standard, everything>;
    R::Context context;
    const std::vector<float> image = image_of(R{}, *nothing, context);
    for (std::size_t i = 0; i < image.size(); ++i) CHECK(image[i] == nothing->background[i / (20 * 18)]);
    for (const float alpha : context.alpha.span()) CHECK(alpha == 0);
    const auto gradient = gradient_of(R{}, *nothing);
    for (const float* column : testing::all_columns(gradient.columns())) {
      for (std::size_t i = 0; i < nothing->gaussians.size(); ++i) CHECK(column[i] == 0);
    }
  }
}

TEST_CASE("raster/tile: a view beyond the pair budget says so and shows the background (TB6)") {
  const RasterScene<float> scene = raster_scene<float>(1, 300, 83, 61);
  using R = TileRasterizer<float>;
  R::Settings settings;
  settings.bin.pair_budget = 10;
  R::Context context;
  SerialExecutor executor;
  std::vector<float> image(3 * 83 * 61);
  const auto forward = [&](const R& rasterizer) {
    return rasterizer.forward(scene.gaussians.columns(), scene.camera, scene.background,
                              ImageView<float>{image.data(), 3, 61, 83}, context, executor);
  };
  const RasterReport report = forward(R{settings});
  REQUIRE(report.error.has_value());
  CHECK(report.error->kind == ErrorKind::exhausted);
  for (std::size_t i = 0; i < image.size(); ++i) CHECK(image[i] == scene.background[i / (83 * 61)]);
  CHECK(!forward(R{}).error.has_value());
  CHECK(std::any_of(image.begin(), image.end(), [&](float x) { return x != scene.background[0]; }));
}

TEST_CASE("raster/tile: a poisoned Gaussian leaves the picture and all gradients finite (BF9, TB1)") {
  for (std::size_t slot = 0; slot < 14; ++slot) {
    for (const float value : {std::nanf(""), INFINITY, -INFINITY, 1e38f, -1e38f, 1e-40f, 0.0f}) {
      RasterScene<float> scene = raster_scene<float>(8, 40, 40, 33);
      testing::all_columns(scene.gaussians.columns())[slot][3] = value;
      SerialExecutor serial;
      const auto run = testing::run_rasterizer(TileRasterizer<float>{}, scene, serial);
      for (const float pixel : run.image) CHECK(std::isfinite(pixel));
      for (const float* column : testing::all_columns(run.gradient.columns())) {
        for (std::size_t i = 0; i < 40; ++i) CHECK(std::isfinite(column[i]));
      }
    }
  }
}

TEST_CASE("raster/tile: an output that is not asked for takes no byte") {
  using Plain = TileRasterizer<float>::Context;
  using Full = TileRasterizer<float, accuracy::standard, everything>::Context;
  CHECK(sizeof(Full) == sizeof(Plain) + 3 * sizeof(Buffer<float>));
  const auto has_alpha = []<class C>(const C&) {
    return requires(C & c) { c.alpha; };
  };
  CHECK(!has_alpha(Plain{}));
  CHECK(has_alpha(Full{}));
  const RasterScene<float> scene = raster_scene<float>(1, 50, 33, 33);
  SerialExecutor serial;
  CHECK(TileRasterizer<float>{}.screen(Plain{}).gradient_norm.empty());
  using R = TileRasterizer<float, accuracy::standard, everything>;
  CHECK(testing::run_rasterizer(R{}, scene, serial).image ==
        testing::run_rasterizer(TileRasterizer<float>{}, scene, serial).image);
}

TEST_CASE("raster/tile: the second view of the same scene allocates nothing") {
  const RasterScene<float> scene = raster_scene<float>(1, 500, 83, 61);
  using R = TileRasterizer<float>;
  R::Context context;
  const std::vector<float> d_image(3 * 83 * 61, 1.0f);
  std::vector<float> image(d_image.size());
  GaussianBatch<float> gradient;
  gradient.resize(500);
  gradient.set_zero();
  SerialExecutor serial;
  const auto once = [&] {
    R{}.forward(scene.gaussians.columns(), scene.camera, scene.background, {image.data(), 3, 61, 83}, context, serial);
    R{}.backward(scene.gaussians.columns(), scene.camera, scene.background, {d_image.data(), 3, 61, 83},
                 gradient.columns(), context, serial);
    return std::array<const void*, 10>{context.white.data(),          context.first_chunk.data(),
                                       context.chunks.data(),         context.opened.data(),
                                       &context.forward_scratch[0],   &context.backward_scratch[0],
                                       context.pair_gradients.data(), context.splat_gradients.data(),
                                       context.lists.splat.data(),    context.projected.splats.data()};
  };
  const auto first = once();
  CHECK(once() == first);
}
