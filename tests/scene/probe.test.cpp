// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>
#include <compmark/scene/probe.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "scene/cube_dialects.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

/// A capture that calls for nothing: twelve cameras around a cube of 64 points, grey photographs with a border of many
/// colours, a feature for every point in every view. What is planted is changed before it is written.
struct Plant {
  CubeCapture capture = cube_capture();
  ColmapModel model;
  std::vector<ImageBytes> images;

  Plant() {
    capture.points.clear();
    for (int i = 0; i < 64; ++i)
      capture.points.push_back({0.3 * (i % 4) - 0.45, 0.3 * (i / 4 % 4) - 0.45, 0.3 * (i / 16) - 0.45});
    for (std::size_t k = 0; k < capture.cameras.size(); ++k) images.push_back(photograph(120, 3, 255));
  }
  static ImageBytes photograph(int level, int channels, int alpha) {
    ImageBytes image{16, 12, channels, {}};
    for (int i = 0; i < 16 * 12; ++i) {
      const int x = i % 16, y = i / 16;
      const bool border = x == 0 || y == 0 || x == 15 || y == 11;
      for (int c = 0; c < channels; ++c)
        image.pixels.push_back(static_cast<std::uint8_t>(c == 3 ? alpha : border ? 8 * x + 9 * y : level));
    }
    return image;
  }
  /// Cameras and points may have been changed: the model is made from them.
  void make_model() {
    model = cube_colmap(capture);
    for (std::size_t k = 0; k < capture.cameras.size(); ++k) {
      ColmapImage& image = model.images[static_cast<std::uint32_t>(3 * k + 2)];
      const std::uint32_t id = static_cast<std::uint32_t>(k + 1);
      const Camera<double>& camera = capture.cameras[k];
      model.cameras[id] = {1, 16, 12, {camera.fx, camera.fy, camera.cx, camera.cy}};
      image.camera_id = id;
      for (std::size_t i = 0; i < capture.points.size(); ++i) {
        const std::array<double, 3> p = detail::to_camera(camera, capture.points[i]);
        const double x = camera.fx * p[0] / p[2] + camera.cx, y = camera.fy * p[1] / p[2] + camera.cy;
        if (p[2] > 0 && x > 1 && y > 1 && x < 15 && y < 11) image.observations.push_back({x, y, 10 + i});
      }
    }
  }
  [[nodiscard]] std::string write_and_probe(const std::filesystem::path& folder) const {
    put_colmap_binary(folder / "sparse/0", model);
    std::filesystem::create_directories(folder / "images");
    for (std::size_t k = 0; k < images.size(); ++k)
      REQUIRE(write_png(folder / "images" / cube_image(k), images[k]).ok());
    const Result<Dataset> dataset = open_dataset(folder, {});
    REQUIRE(dataset.ok());
    const Result<std::vector<ProbedEffect>> effects = probe_scene(*dataset);
    REQUIRE(effects.ok());
    std::string names;
    for (const ProbedEffect& e : *effects) {
      CHECK(!e.evidence.empty());
      CHECK((e.effect == SceneEffect::forward_facing        ? e.value < e.limit
             : e.effect == SceneEffect::constant_background ? e.value < e.limit
                                                            : e.value > e.limit));
      names += (names.empty() ? "" : " ") + std::string(effect_name(e.effect));
    }
    return names;
  }
};

std::string probe_with(const std::function<void(Plant&)>& cameras,
                       const std::function<void(Plant&, const TemporaryFolder&)>& rest = {}) {
  const TemporaryFolder folder;
  Plant plant;
  if (cameras) cameras(plant);
  plant.make_model();
  if (rest) rest(plant, folder);
  return plant.write_and_probe(folder.path());
}

/// Moves a camera along its own axis, towards the cube where positive.
void approach(Camera<double>& camera, double distance) {
  for (std::size_t c = 0; c < 3; ++c) camera.center_world[c] += distance * camera.rotation_camera_world[6 + c];
}

}  // namespace

TEST_CASE("scene/probe: a plain capture calls for nothing") { CHECK(probe_with({}) == ""); }

TEST_CASE("scene/probe: one camera and a few points anywhere call for nothing") {
  for (const double away : {1e3, 1e5, 1e12}) {
    CAPTURE(away);
    CHECK(probe_with([&](Plant& plant) {
            plant.capture.cameras[5].center_world = {away, 0, 1};
            for (int i = 0; i < 3; ++i) plant.capture.points.push_back({0, away * (i + 1), 0});
          }) == "");
  }
}

TEST_CASE("scene/probe: the sample of a long capture covers it, and sees what alternates") {
  for (std::size_t count = 1; count < 2000; ++count) {
    const std::vector<std::size_t> views = detail::sampled_views(count);
    REQUIRE(views.size() == std::min<std::size_t>(count, 128));
    REQUIRE(views.front() == 0);
    REQUIRE(views.back() == count - 1);
    std::size_t odd = 0;
    for (std::size_t i = 0; i < views.size(); ++i) {
      REQUIRE((i == 0 || views[i] > views[i - 1]));
      REQUIRE((i == 0 || views[i] - views[i - 1] <= 1 + count / 63));
      odd += views[i] % 2;
    }
    REQUIRE(odd == views.size() / 2);
  }
  // Control: a fixed stride over 48 photographs is one of 2.
  std::size_t odd = 0;
  for (std::size_t i = 0; i < 48; i += 1 + (48 - 1) / 32) odd += i % 2;
  CHECK(odd == 0);
}

TEST_CASE("scene/probe: exactly the effect that was planted is called for") {
  using Folder = const TemporaryFolder&;
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (ImageBytes& image : p.images) image = Plant::photograph(120, 4, 128);
        }) == "alpha");
  CHECK(probe_with({}, [](Plant& p, Folder) {  // an opaque alpha channel is none
          for (ImageBytes& image : p.images) image = Plant::photograph(120, 4, 255);
        }) == "");
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (ImageBytes& image : p.images) {
            for (int i = 0; i < 16 * 12; ++i) {
              const bool border = i % 16 == 0 || i % 16 == 15 || i < 16 || i >= 11 * 16;
              for (std::size_t c = 0; border && c < 3; ++c) image.pixels[3 * static_cast<std::size_t>(i) + c] = 250;
            }
          }
        }) == "constant_background");
  CHECK(probe_with([](Plant& p) {
          for (Camera<double>& camera : p.capture.cameras) camera.cx += 0.4;
        }) == "principal_point");
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (auto& [id, camera] : p.model.cameras) camera = {4, 16, 12, {20, 20, 8, 6, 0.2, 0, 0, 0}};
        }) == "lens_distortion");
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (auto& [id, camera] : p.model.cameras) camera = {5, 16, 12, {20, 20, 8, 6, 0, 0, 0, 0}};
        }) == "fisheye");
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (std::size_t k = 0; k < p.images.size(); ++k)
            p.images[k] = Plant::photograph(k % 2 == 0 ? 110 : 130, 3, 255);
        }) == "exposure");  // half the photographs brighter by 18 %: a deviation of 0.083
  for (const int copies :
       {3, 4, 21}) {  // 36, 48 and 252 photographs, of which 128 are looked at: no stride may hide every second one
    CHECK(probe_with(
              [copies](Plant& p) {
                for (int i = 12; i < 12 * copies; ++i) {
                  p.capture.cameras.push_back(p.capture.cameras[static_cast<std::size_t>(i % 12)]);
                  p.images.push_back(p.images[0]);
                }
              },
              [](Plant& p, Folder) {
                for (std::size_t k = 0; k < p.images.size(); ++k)
                  p.images[k] = Plant::photograph(k % 2 == 0 ? 110 : 130, 3, 255);
              }) == "exposure");
  }
  CHECK(probe_with({}, [](Plant& p, Folder) {
          for (std::size_t k = 0; k < p.images.size(); ++k)
            p.images[k] = Plant::photograph(k % 2 == 0 ? 118 : 122, 3, 255);
        }) == "");  // 3 %: below the limit
  // One camera at two fifths of the distance: the ratio of distances is 2.5, the quantiles of the scale do not move.
  CHECK(probe_with([](Plant& p) {
          for (int i = 0; i < 30; ++i) p.capture.cameras.push_back(p.capture.cameras[static_cast<std::size_t>(i % 12)]);
          approach(p.capture.cameras[5], 2.56);
          p.images.assign(p.capture.cameras.size(), Plant::photograph(120, 3, 255));
        }) == "distance_input");
  CHECK(probe_with([](Plant& p) {  // at five eighths: 1.6, below the limit
          for (int i = 0; i < 30; ++i) p.capture.cameras.push_back(p.capture.cameras[static_cast<std::size_t>(i % 12)]);
          approach(p.capture.cameras[5], 1.6);
          p.images.assign(p.capture.cameras.size(), Plant::photograph(120, 3, 255));
        }) == "");
  // Half the cameras with a lens three times as long, from the same distance.
  CHECK(probe_with([](Plant& p) {
          for (std::size_t k = 0; k < 12; k += 2) p.capture.cameras[k].fx = p.capture.cameras[k].fy = 60;
        }) == "anti_aliasing");
  CHECK(probe_with([](Plant& p) {  // a few points fifty times as far away, seen by all cameras that look that way
          for (std::size_t k = 0; k < 12; ++k) {
            const Camera<double>& c = p.capture.cameras[k];
            for (const double d : {100.0, 200.0}) {
              std::array<double, 3> point = c.center_world;
              for (std::size_t i = 0; i < 3; ++i) point[i] += d * c.rotation_camera_world[6 + i];
              p.capture.points.push_back(point);
            }
          }
          for (std::size_t k = 0; k < 12;
               ++k) {  // pairs of cameras at nearly one place, so that these points are seen twice
            Camera<double> twin = p.capture.cameras[k];
            twin.center_world[2] += 0.01;
            p.capture.cameras.push_back(twin);
          }
          p.images.assign(p.capture.cameras.size(), Plant::photograph(120, 3, 255));
        }) == "far_field");
  CHECK(probe_with([](Plant& p) {
          const Camera<double> first = p.capture.cameras[0];
          for (std::size_t k = 0; k < 12; ++k) {
            p.capture.cameras[k] = first;
            for (std::size_t c = 0; c < 3; ++c)
              p.capture.cameras[k].center_world[c] += 0.1 * static_cast<double>(k) * first.rotation_camera_world[c] / 2;
          }
        }) == "forward_facing");
  CHECK(probe_with({}, [](Plant&, Folder folder) { put_image(folder.path() / "masks/03.png", 16, 12, 1); }) == "masks");
}

TEST_CASE("scene/probe: what a dataset says too little of is named, by what it holds and not by its kind") {
  using Effects = std::vector<SceneEffect>;
  const auto unmeasured = [](const std::filesystem::path& folder) {
    const Result<Dataset> dataset = open_dataset(folder, {});
    REQUIRE(dataset.ok());
    return unmeasured_effects(*dataset);
  };
  Plant plant;
  plant.make_model();
  const TemporaryFolder tracks, untracked, blender;
  static_cast<void>(plant.write_and_probe(tracks.path()));
  CHECK(unmeasured(tracks.path()) == Effects{});
  for (auto& [id, image] : plant.model.images) image.observations.clear();
  static_cast<void>(plant.write_and_probe(untracked.path()));
  CHECK(unmeasured(untracked.path()) == Effects{SceneEffect::exposure});
  put_blender(blender.path());
  CHECK(unmeasured(blender.path()) == Effects{SceneEffect::exposure, SceneEffect::distance_input,
                                              SceneEffect::anti_aliasing, SceneEffect::far_field});
}

TEST_CASE("scene/probe: the unit of a capture and its place in the world change nothing") {
  for (const double scale : {1e-3, 1.0, 1e3}) {
    for (const double away : {0.0, 1e5}) {
      CAPTURE(scale);
      CAPTURE(away);
      CHECK(probe_with([&](Plant& p) {
              for (std::size_t k = 0; k < 12; k += 2) p.capture.cameras[k].fx = p.capture.cameras[k].fy = 60;
              for (Camera<double>& camera : p.capture.cameras) {
                for (double& x : camera.center_world) x = scale * (x + away);
              }
              for (auto& point : p.capture.points) {
                for (auto& x : point) x = scale * (x + away);
              }
            }) == "anti_aliasing");
    }
  }
}

TEST_CASE("scene/probe: a screen behind opaque photographs is a background, with its colour") {
  const auto screen = [](std::array<int, 3> color,
                         int noise) {  // the subject fills the middle, levels scatter like those of a JPEG
    ImageBytes image = Plant::photograph(120, 3, 255);
    for (int i = 0; i < 16 * 12; ++i) {
      if (i % 16 != 0 && i % 16 != 15 && i >= 16 && i < 11 * 16) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        image.pixels[3 * static_cast<std::size_t>(i) + c] = static_cast<std::uint8_t>(
            std::clamp(color[c] + (i * 7 + static_cast<int>(c)) % (2 * noise + 1) - noise, 0, 255));
      }
    }
    return image;
  };
  const auto probed = [&](const std::function<void(Plant&)>& photographs) {
    const TemporaryFolder folder;
    Plant plant;
    plant.make_model();
    photographs(plant);
    static_cast<void>(plant.write_and_probe(folder.path()));
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    return *probe_scene(*dataset);
  };
  for (const std::array<int, 3>& color : {std::array<int, 3>{255, 255, 255}, {0, 0, 0}, {10, 200, 30}}) {
    const std::vector<ProbedEffect> effects = probed([&](Plant& p) {
      for (ImageBytes& image : p.images) image = screen(color, 1);
    });
    REQUIRE(effects.size() == 1);
    CHECK(effects[0].effect == SceneEffect::constant_background);
    for (std::size_t c = 0; c < 3; ++c) CHECK(std::abs(effects[0].color[c] * 255 - color[c]) < 1);
  }
  // Not one colour: a screen of another colour in one photograph, a subject that touches the border of one, noise of a
  // wall.
  CHECK(probed([&](Plant& p) {
          for (ImageBytes& image : p.images) image = screen({255, 255, 255}, 1);
          p.images[7] = screen({230, 255, 255}, 1);
        }).empty());
  CHECK(probed([&](Plant& p) {
          for (ImageBytes& image : p.images) image = screen({255, 255, 255}, 1);
          for (std::size_t k = 0; k < 9; ++k) p.images[3].pixels[k] = 120;
        }).empty());
  CHECK(probed([&](Plant& p) {
          for (ImageBytes& image : p.images) image = screen({200, 190, 180}, 4);
        }).empty());
}

namespace {

/// Depth ratio of the probe for points as twelve cameras on a circle of radius 1 see them, looking at the centre; or
/// from `centers`.
struct Surroundings {
  std::vector<std::array<double, 3>> centers, targets;
  std::vector<std::array<float, 3>> points;

  Surroundings() {
    for (int i = 0; i < 24; ++i) {
      const double phi = 2 * 3.14159265358979323846 * i / 24;
      centers.push_back({std::cos(phi), std::sin(phi), 0.2});
      targets.push_back({0, 0, 0});
    }
  }
  static double uniform(std::size_t i) { return Random(1, 0, random_stage("test surroundings")).uniform(i); }
  static std::array<double, 3> direction(std::size_t i) {
    const double z = 2 * uniform(2 * i) - 1, phi = 6.283185307179586 * uniform(2 * i + 1);
    return {std::sqrt(1 - z * z) * std::cos(phi), std::sqrt(1 - z * z) * std::sin(phi), z};
  }
  void add(double x, double y, double z) {
    points.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
  }
  /// A ball of points, as the surface of a subject.
  Surroundings& subject(double radius, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      const std::array<double, 3> d = direction(i);
      add(radius * d[0], radius * d[1], radius * d[2]);
    }
    return *this;
  }
  /// The walls of a box.
  Surroundings& box(double x, double y, double z, std::size_t count) {
    const std::array<double, 3> half{x, y, z}, area{y * z, x * z, x * y};
    for (std::size_t i = 0; i < count; ++i) {
      std::array<double, 3> p{};
      for (std::size_t c = 0; c < 3; ++c) p[c] = half[c] * (2 * uniform(5 * i + c + 900000) - 1);
      const double u = uniform(5 * i + 900003) * (area[0] + area[1] + area[2]);
      const std::size_t wall = u < area[0] ? 0 : u < area[0] + area[1] ? 1 : 2;
      p[wall] = uniform(5 * i + 900004) < 0.5 ? -half[wall] : half[wall];
      add(p[0], p[1], p[2]);
    }
    return *this;
  }
  /// Points in all horizontal directions, `radii` from the centre.
  Surroundings& around(double radii, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      const double phi = 6.283185307179586 * uniform(i + 500000);
      add(radii * std::cos(phi), radii * std::sin(phi), radii * 0.2 * uniform(i + 600000));
    }
    return *this;
  }
  /// The ground, to `radii` from the centre: as many points in each solid angle of a camera at height 0.5.
  Surroundings& ground(double radii, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      const double phi = 6.283185307179586 * uniform(i + 500000), down = 0.5 / radii + uniform(i + 600000);
      add(0.5 / down * std::cos(phi), 0.5 / down * std::sin(phi), -0.3);
    }
    return *this;
  }
  [[nodiscard]] double ratio() const {
    Dataset dataset;
    dataset.kind = "transforms";
    for (std::size_t k = 0; k < centers.size(); ++k) {
      std::array<double, 3> f{};
      for (std::size_t c = 0; c < 3; ++c) f[c] = targets[k][c] - centers[k][c];
      const double n = std::hypot(f[0], f[1], f[2]), flat = std::hypot(f[0], f[1]);
      for (double& x : f) x /= n;
      View view;
      Camera<double>& camera = view.camera;
      camera.width = 160;
      camera.height = 120;
      camera.fx = camera.fy = 130;  // 63 degrees wide
      camera.cx = 80;
      camera.cy = 60;
      camera.center_world = centers[k];
      const double rx = f[1] * n / flat, ry = -f[0] * n / flat;
      camera.rotation_camera_world = {rx, ry, 0, -f[2] * ry, f[2] * rx, f[0] * ry - f[1] * rx, f[0], f[1], f[2]};
      dataset.views.push_back(view);
    }
    dataset.points.position = points;
    return detail::look_at_geometry(dataset, detail::find_sightings(dataset)).far_ratio;
  }
};

}  // namespace

TEST_CASE("scene/probe: the limit of the far field parts a family of bounded scenes from one of unbounded scenes") {
  const double limit = ProbeSettings{}.far_ratio;
  double highest = 0, lowest = HUGE_VAL;
  const auto bounded = [&](const char* what, const Surroundings& s) {
    INFO(what);
    const double ratio = s.ratio();
    CHECK(ratio > 1);
    CHECK(ratio < limit);
    highest = std::max(highest, ratio);
  };
  const auto unbounded = [&](const char* what, const Surroundings& s) {
    INFO(what);
    const double ratio = s.ratio();
    CHECK(ratio > limit);
    lowest = std::min(lowest, ratio);
  };
  using S = Surroundings;
  for (const double r : {0.1, 0.3, 0.6, 0.9}) bounded("a subject", S{}.subject(r, 2000));
  for (const double r : {1.05, 1.3, 1.7}) bounded("a subject in a round room", S{}.subject(0.3, 1500).around(r, 500));
  bounded("a subject on its ground, in a room", S{}.subject(0.3, 1500).box(1.2, 1.2, 0.8, 1500));
  bounded("a room, seen across", S{}.box(1.2, 1.2, 0.6, 3000));
  bounded("a hall twice as long as wide", S{}.box(2, 1.1, 0.6, 3000));
  S inside = S{}.subject(2, 3000), street = S{}.box(6, 1.1, 0.8, 4000);
  for (std::size_t k = 0; k < inside.centers.size(); ++k) {
    const std::array<double, 3> d = inside.centers[k];
    inside.centers[k] = {0.2 * d[0], 0.2 * d[1], 0.1};
    inside.targets[k] = d;
    street.centers[k] = {0.5 * static_cast<double>(k) - 6, 0.1 * d[1], 0};  // looking at either wall
    street.targets[k] = {0.5 * static_cast<double>(k) - 6, k % 2 == 0 ? 5.0 : -5.0, 0};
  }
  bounded("a sphere from inside", inside);
  bounded("a street, seen across", street);
  // One wrong match in two hundred, far away: no far field. Largest distance over radius (the evidence that is not
  // used) would say 12.
  bounded("a subject and wrong matches", S{}.subject(0.3, 3000).around(12, 15));

  for (const double r : {2.5, 4.0, 10.0, 100.0, 1e4}) {
    for (const double share : {0.05, 0.2, 0.5}) {
      // A third of the directions around is seen by a camera, all of the subject.
      unbounded("surroundings", S{}.subject(0.3, 2000).around(r, static_cast<std::size_t>(3 * 2000 * share)));
    }
  }
  for (const double r : {6.0, 20.0, 100.0}) unbounded("open ground", S{}.subject(0.3, 1000).ground(r, 3000));
  MESSAGE("bounded up to ", highest, ", unbounded from ", lowest);
}

TEST_CASE("scene/probe: gains of photographs are found through points that disagree") {
  // Eight views with known gains; a fifth of the points change their brightness at random (highlights). Medians do not
  // care.
  std::vector<detail::PointBrightness> brightness;
  double mean = 0, square = 0;
  for (std::size_t v = 0; v < 8; ++v) {
    const double gain = 0.02 * static_cast<double>(v * v % 7);
    mean += gain / 8;
    square += gain * gain / 8;
  }
  for (std::size_t p = 0; p < 200; ++p) {
    for (std::size_t v = 0; v < 8; ++v) {
      const double outlier = p % 5 == 0 ? std::sin(static_cast<double>(p * 31 + v * 17)) : 0;
      brightness.push_back(
          {v, p, 4 + 0.01 * static_cast<double>(p % 13) + 0.02 * static_cast<double>(v * v % 7) + outlier});
    }
  }
  CHECK(detail::gain_deviation(brightness, 8) == doctest::Approx(std::sqrt(square - mean * mean)).epsilon(0.05));
  for (detail::PointBrightness& b : brightness) b.log_value -= 0.02 * static_cast<double>(b.view * b.view % 7);
  CHECK(detail::gain_deviation(brightness, 8) < 0.005);
}
