// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/image_store.hpp>
#include <compmark/scene/undistort.hpp>

#include <cmath>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;
using M = LensModel;

namespace {

Camera<double> camera_of(int width, int height, double focal) {
  Camera<double> camera;
  camera.width = width;
  camera.height = height;
  camera.fx = focal;
  camera.fy = 1.02 * focal;
  camera.cx = 0.52 * width;
  camera.cy = 0.47 * height;
  return camera;
}

/// What a ray sees: smooth, in [18, 238].
double world(double x, double y) { return 128 + 70 * std::sin(9 * x + 1) + 40 * std::cos(11 * y - 4 * x); }

/// The photograph of the world through a lens, and through none. Rays that the lens does not have see black.
std::vector<std::uint8_t> photograph(const Camera<double>& camera, const Lens& lens) {
  const LensLimit limit = lens_limit(lens);
  std::vector<std::uint8_t> pixels;
  for (int i = 0; i < camera.height; ++i) {
    for (int j = 0; j < camera.width; ++j) {
      const Undistorted ray =
          undistort(lens, limit, (j + 0.5 - camera.cx) / camera.fx, (i + 0.5 - camera.cy) / camera.fy);
      pixels.push_back(ray.converged ? static_cast<std::uint8_t>(std::lround(world(ray.x, ray.y))) : 0);
    }
  }
  return pixels;
}

}  // namespace

TEST_CASE("scene/undistort: the photograph without its lens is what a pinhole sees") {
  const Camera<double> camera = camera_of(200, 150, 160);
  const std::vector<std::uint8_t> expected = photograph(camera, {});
  for (const Lens& lens :
       {Lens{M::opencv, {0.0578421, -0.0805099, -0.000980296, 0.00015575}}, Lens{M::simple_radial, {0.15}},
        Lens{M::simple_radial, {-0.12}}, Lens{M::opencv_fisheye, {-0.03, 0.004, -0.001, 0.0002}}, Lens{M::fov, {0.8}},
        Lens{M::thin_prism_fisheye, {0.01, 0, 0.002, 0.001, 0, 0, 0.003, 0.002}}}) {
    CAPTURE(static_cast<int>(lens.model));
    const std::vector<std::uint8_t> taken = photograph(camera, lens);
    const UndistortedPlanes straight = undistort_planes(camera, lens, taken);
    double worst = 0, ignored_worst = 0;
    std::size_t valid = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      if (!straight.valid.empty() && straight.valid[i] == 0) continue;
      ++valid;
      worst = std::fmax(worst, std::abs(straight.planes[i] - expected[i]));
      ignored_worst = std::fmax(ignored_worst, std::abs(taken[i] - expected[i]));
    }
    // Bilinear: h^2 / 8 of a second derivative of 70 * 81 + 40 * 137 = 11,150 a unit^2, and h = 1/160 stretched by up
    // to 1.5 by the lens: 0.12; half a level of rounding twice; half a pixel of replicated border. Measured: 1 or 2.
    CHECK(worst <= 2);
    CHECK(ignored_worst > 5);  // the negative control, measured 7 (the weak lens) to 151
    CHECK(valid > expected.size() * 3 / 4);
  }
}

TEST_CASE("scene/undistort: a pixel is valid exactly where the photograph has its ray") {
  const Camera<double> camera = camera_of(80, 60, 70);
  // A lens that pulls the corners in shows rays beyond the pinhole's corners: everything is valid. One that pushes them
  // out does not.
  const std::vector<std::uint8_t> grey(80 * 60, 100);
  CHECK(undistort_planes(camera, {LensModel::simple_radial, {-0.1}}, grey).valid.empty());
  const UndistortedPlanes outward = undistort_planes(camera, {LensModel::simple_radial, {0.2}}, grey);
  REQUIRE(outward.valid.size() == grey.size());
  CHECK(outward.valid[0] == 0);
  CHECK(outward.valid[30 * 80 + 40] == 255);
  CHECK(outward.planes == grey);  // the border is repeated, not black
  // Beyond the fold of the lens nothing is valid, although the formula lands inside the image again: r = 1/sqrt(3 *
  // 0.9) = 0.609.
  const Camera<double> wide = camera_of(80, 60, 30);
  const UndistortedPlanes folded = undistort_planes(wide, {LensModel::simple_radial, {-0.9}}, grey);
  REQUIRE(folded.valid.size() == grey.size());
  for (int j = 0; j < 80; ++j) {
    const double x = (j + 0.5 - wide.cx) / wide.fx, y = (28 + 0.5 - wide.cy) / wide.fy;
    CHECK((folded.valid[static_cast<std::size_t>(28 * 80 + j)] == 255) == (std::hypot(x, y) <= 1 / std::sqrt(2.7)));
  }
}

TEST_CASE("scene/undistort: no lens changes no byte") {
  const Camera<double> camera = camera_of(40, 30, 35);
  std::vector<std::uint8_t> noise;
  for (std::size_t i = 0; i < 3 * 40 * 30; ++i) noise.push_back(static_cast<std::uint8_t>(i * 7919 % 251));
  const UndistortedPlanes same = undistort_planes(camera, {LensModel::simple_radial, {1e-18}}, noise);
  CHECK(same.planes == noise);
  CHECK(same.valid.empty());
}

TEST_CASE("scene/decode: masks from a file, from alpha and from the lens, and none costs nothing") {
  const TemporaryFolder folder;
  put_image(folder.path() / "rgb.png", 16, 12);
  put_image(folder.path() / "rgba.png", 16, 12, 4, 64);
  ImageBytes stripes{16, 12, 1, {}};
  for (int i = 0; i < 16 * 12; ++i) stripes.pixels.push_back(i % 16 < 8 ? 0 : 255);
  REQUIRE(write_png(folder.path() / "mask.png", stripes).ok());
  put_image(folder.path() / "small.png", 8, 6, 1);
  Dataset dataset;
  View view;
  view.name = "a";
  view.image_path = folder.path() / "rgb.png";
  view.camera = camera_of(16, 12, 20);
  view.file_width = 16;
  view.file_height = 12;
  dataset.views.push_back(view);
  view.name = "b";
  view.mask_path = folder.path() / "mask.png";
  dataset.views.push_back(view);
  view.name = "c";
  view.camera = view.camera.resized(4, 3);  // 4 x 4 pixels each: the left half is ignored
  dataset.views.push_back(view);
  view.name = "d";
  view.camera = camera_of(16, 12, 20);
  view.lens = {LensModel::simple_radial, {0.5}};
  view.lens_treatment = LensTreatment::undistort;
  dataset.views.push_back(view);
  view = dataset.views[0];
  view.name = "e";
  view.image_path = folder.path() / "rgba.png";
  view.has_alpha = true;
  dataset.views.push_back(view);
  view.name = "f";
  view.mask_path = folder.path() / "small.png";
  dataset.views.push_back(view);

  ImageStore store(dataset, {});
  CHECK(store.mask(0)->empty());
  CHECK(store.statistics().bytes == 3 * 16 * 12);
  const std::vector<std::uint8_t> b(store.mask(1)->begin(), store.mask(1)->end());
  CHECK(b == stripes.pixels);
  CHECK(store.statistics().bytes == 7 * 16 * 12);
  const std::span<const std::uint8_t> c = *store.mask(2);
  REQUIRE(c.size() == 12);
  for (std::size_t i = 0; i < 12; ++i) CHECK(c[i] == (i % 4 < 2 ? 0 : 255));
  const std::span<const std::uint8_t> d = *store.mask(3);
  CHECK(d[15] == 0);              // outside the photograph
  CHECK(d[6 * 16 + 9] == 255);    // in the middle of the right half
  CHECK(d[6 * 16 + 4] == 0);      // of the mask's left half
  CHECK(store.mask(4)->empty());  // alpha is not a mask unless asked for
  const Result<std::span<const std::uint8_t>> f = store.mask(5);
  REQUIRE(!f.ok());
  CHECK(names(f.error(), "small.png", "image size", "as large as its image"));
  ImageStoreSettings alpha;
  alpha.alpha_mask = true;
  ImageStore with_alpha(dataset, {}, alpha);
  CHECK((*with_alpha.mask(4))[0] == 64);
  CHECK(with_alpha.mask(0)->empty());
}

TEST_CASE("scene/decode: a lens that is ignored or kept leaves the pixels alone") {
  const TemporaryFolder folder;
  put_image(folder.path() / "rgb.png", 16, 12);
  View view;
  view.image_path = folder.path() / "rgb.png";
  view.camera = camera_of(16, 12, 20);
  const StoredImage plain = *decode_view(view, {});
  view.lens = {LensModel::simple_radial, {0.5}};
  view.lens_treatment = LensTreatment::keep;
  CHECK(decode_view(view, {})->planes == plain.planes);
  view.lens_treatment = LensTreatment::undistort;
  CHECK(decode_view(view, {})->planes != plain.planes);
}
