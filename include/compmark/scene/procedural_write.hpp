// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Renders the built-in scene from cameras on a hemisphere and writes it as a Blender dataset: RGBA PNGs with straight
// alpha and transforms_{train,test}.json with the exact poses. Every pixel depends on its camera and the seed alone, so
// the files are the same for any number of threads. Cost: 16 rays a pixel; 125 views of 400 x 400 take ~20 s on two
// cores.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/lens.hpp"
#include "compmark/scene/procedural.hpp"

namespace compmark {

struct ProceduralSettings {
  int views_train = 100;
  int views_test = 25;
  int width = 400;   ///< pixels
  int height = 400;  ///< pixels
  std::uint64_t seed = 0;
  double camera_angle_x = 0.6911112070083618;  ///< horizontal field of view, radians: that of the NeRF-synthetic scenes
  double camera_distance = 3.8;                ///< from the point looked at
  Lens lens;                                   ///< of every camera
};

/// The i-th camera. Training cameras are spread evenly over the hemisphere with a seeded jitter; test cameras circle it
/// on a wave, so that they fall between the training cameras.
[[nodiscard]] inline Camera<double> procedural_camera(const ProceduralSettings& settings, Split split, int i) {
  using std::numbers::pi;
  const Random random(settings.seed, split == Split::train ? 0 : 1, random_stage("procedural cameras"));
  const std::size_t index = 2 * static_cast<std::size_t>(i);
  double azimuth = 0;
  double sine = 0;  // of the elevation
  if (split == Split::train) {
    const double place = (i + random.uniform(index)) / settings.views_train;
    sine = 0.04 + 0.92 * place;  // area on a sphere is proportional to height
    azimuth = i * 2.399963229728653 + 0.5 * (random.uniform(index + 1) - 0.5);
  } else {
    azimuth = 2 * pi * i / settings.views_test + 0.1;
    sine = std::sin(pi * (35 + 18 * std::sin(3 * azimuth)) / 180);
  }
  const double cosine = std::sqrt(1 - sine * sine);
  const Vector3 target{0, 0, -0.24};
  const Vector3 back{cosine * std::cos(azimuth), cosine * std::sin(azimuth), sine};  // from the target to the camera
  const Vector3 right = normalized(cross({0, 0, 1}, back));
  const Vector3 down = cross(right, back);
  Camera<double> camera;
  camera.width = settings.width;
  camera.height = settings.height;
  camera.fx = camera.fy = settings.width / (2 * std::tan(settings.camera_angle_x / 2));
  camera.cx = settings.width / 2.0;
  camera.cy = settings.height / 2.0;
  const Vector3 center = target + back * settings.camera_distance;
  camera.center_world = {center.x, center.y, center.z};
  camera.rotation_camera_world = {right.x, right.y, right.z, down.x, down.y, down.z, -back.x, -back.y, -back.z};
  return camera;
}

/// Unit direction in world axes of the ray through image place (u, v).
[[nodiscard]] inline Vector3 camera_ray(const Camera<double>& camera, double u, double v) {
  const std::array<double, 9>& r = camera.rotation_camera_world;
  const double x = (u - camera.cx) / camera.fx;
  const double y = (v - camera.cy) / camera.fy;
  return normalized({r[0] * x + r[3] * y + r[6], r[1] * x + r[4] * y + r[7], r[2] * x + r[5] * y + r[8]});
}

/// The same through a lens; nothing where no ray within the lens lands there.
[[nodiscard]] inline std::optional<Vector3> camera_ray(const Camera<double>& camera, const Lens& lens,
                                                       const LensLimit& limit, double u, double v) {
  if (is_pinhole(lens)) return camera_ray(camera, u, v);
  const Undistorted ray = undistort(lens, limit, (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy);
  if (!ray.converged) return std::nullopt;
  return camera_ray(camera, camera.fx * ray.x + camera.cx, camera.fy * ray.y + camera.cy);
}

namespace detail {
/// Linear light to an sRGB byte.
[[nodiscard]] inline std::uint8_t encode_srgb(double linear) {
  const double v = std::fmin(std::fmax(linear, 0.0), 1.0);
  const double encoded = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(encoded * 255 + 0.5);
}
}  // namespace detail

/// RGBA with straight alpha. 4 x 4 samples a pixel: the colour is the mean over the covered ones, alpha their share.
/// What a lens does not show is transparent.
template <Executor E>
[[nodiscard]] ImageBytes render_procedural(const ProceduralScene& scene, const Camera<double>& camera, E& executor,
                                           const Lens& lens = {}) {
  constexpr int side = 4;
  const std::size_t width = static_cast<std::size_t>(camera.width);
  ImageBytes image{camera.width, camera.height, 4,
                   std::vector<std::uint8_t>(4 * width * static_cast<std::size_t>(camera.height))};
  const LensLimit limit = lens_limit(lens);
  // More than half a pixel's diagonal, seen from the camera; a lens that compresses by four is as strong as they come.
  const double spread = (0.75 / camera.fx + 0.75 / camera.fy) * (is_pinhole(lens) ? 1 : 4);
  const Vector3 origin{camera.center_world[0], camera.center_world[1], camera.center_world[2]};
  executor.for_chunks(static_cast<std::size_t>(camera.height), 8, [&](std::size_t begin, std::size_t end, std::size_t) {
    ProceduralScene::NoiseMemory memory;
    for (std::size_t y = begin; y < end; ++y) {
      for (std::size_t x = 0; x < width; ++x) {
        const std::optional<Vector3> middle =
            camera_ray(camera, lens, limit, static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
        const std::uint32_t candidates = middle ? scene.candidates(origin, *middle, spread) : 0;
        if (candidates == 0) continue;
        Vector3 sum;
        int covered = 0;
        for (int sample = 0; sample < side * side; ++sample) {
          const double u = static_cast<double>(x) + (sample % side + 0.5) / side;
          const double v = static_cast<double>(y) + (sample / side + 0.5) / side;
          const std::optional<Vector3> direction = camera_ray(camera, lens, limit, u, v);
          const std::optional<SceneHit> hit = direction ? scene.trace(origin, *direction, candidates) : std::nullopt;
          if (!hit) continue;
          // 7 is prime to 16: neighbouring samples look at distant parts of the lamp.
          sum = sum + scene.shade(*hit, *direction,
                                  static_cast<std::size_t>(7 * sample) % ProceduralScene::light_samples, memory);
          ++covered;
        }
        if (covered == 0) continue;
        std::uint8_t* pixel = image.pixels.data() + 4 * (y * width + x);
        for (std::size_t c = 0; c < 3; ++c) pixel[c] = detail::encode_srgb(sum[c] / covered);
        pixel[3] = static_cast<std::uint8_t>((covered * 255 + side * side / 2) / (side * side));
      }
    }
  });
  return image;
}

namespace detail {

inline constexpr const char* procedural_generator = "compmark built-in scene";

/// Other people's files are not overwritten: the folder must be new, empty, or written by us.
template <class Json>
[[nodiscard]] Result<Done> check_scene_folder(const std::filesystem::path& folder) {
  std::error_code status;
  const auto fail = [&](std::string problem, std::string remedy) {
    return Error{ErrorKind::unwritable, folder.string(), "", std::move(problem), std::move(remedy)};
  };
  if (!std::filesystem::exists(folder, status)) return Done{};
  if (!std::filesystem::is_directory(folder, status))
    return fail("is a file, not a folder", "give the name of a new folder");
  bool empty = true;  // but for the lock of who writes there (io/folder_lock.hpp)
  for (const auto& entry : std::filesystem::directory_iterator(folder, status))
    empty = empty && entry.path().filename() == ".compmark-lock";
  if (empty && !status) return Done{};
  if (std::filesystem::exists(folder / "transforms_train.json", status)) {
    const Result<Json> json = read_json<Json>(folder / "transforms_train.json");
    if (json && json->is_object() && json->contains("generator") && (*json)["generator"] == Json(procedural_generator))
      return Done{};
  }
  return fail("the folder is not empty and does not hold the built-in scene", "give a new or empty folder");
}

/// OpenGL camera-to-world rows of a camera.
template <class Json>
[[nodiscard]] Json opengl_matrix(const Camera<double>& camera) {
  const std::array<double, 9>& r = camera.rotation_camera_world;
  Json rows = Json::array();
  for (std::size_t i = 0; i < 3; ++i) rows.push_back({r[i], -r[3 + i], -r[6 + i], camera.center_world[i]});
  rows.push_back({0.0, 0.0, 0.0, 1.0});
  return rows;
}

/// The lens as nerfstudio writes it; nothing for a pinhole.
template <class Json>
void put_lens(Json& json, const Lens& lens) {
  if (is_pinhole(lens)) return;
  const bool fisheye = lens.model == LensModel::opencv_fisheye;
  json["camera_model"] = fisheye ? "OPENCV_FISHEYE" : "OPENCV";
  const std::array<const char*, 4> names =
      fisheye ? std::array<const char*, 4>{"k1", "k2", "k3", "k4"} : std::array<const char*, 4>{"k1", "k2", "p1", "p2"};
  for (std::size_t i = 0; i < 4; ++i) json[names[i]] = lens.parameters[i];
}

}  // namespace detail

/// Writes the built-in scene into a folder, which is created. The JSON files come last: an interrupted call leaves no
/// dataset behind.
template <class Json = nlohmann::ordered_json, Executor E>
[[nodiscard]] Result<Done> write_procedural_scene(const std::filesystem::path& folder,
                                                  const ProceduralSettings& settings, E& executor) {
  if (settings.width < 1 || settings.height < 1 || settings.views_train < 1 || settings.views_test < 0) {
    return Error{ErrorKind::invalid, folder.string(), "settings",
                 "sizes and the number of training views must be positive", "use the defaults"};
  }
  if (!is_pinhole(settings.lens) && settings.lens.model != LensModel::opencv &&
      settings.lens.model != LensModel::opencv_fisheye) {
    return Error{ErrorKind::invalid, folder.string(), "lens", "is not one that the format has",
                 "use LensModel::opencv or opencv_fisheye"};
  }
  if (Result<Done> usable = detail::check_scene_folder<Json>(folder); !usable) return usable.error();
  const ProceduralScene scene(settings.seed);
  std::array<Json, 2> files;
  for (const Split split : {Split::train, Split::test}) {
    const std::string name = split == Split::train ? "train" : "test";
    const int count = split == Split::train ? settings.views_train : settings.views_test;
    std::error_code status;
    std::filesystem::create_directories(folder / name, status);
    if (status) {
      return Error{ErrorKind::unwritable, (folder / name).string(), "",
                   "the folder cannot be created: " + status.message(), "choose another place"};
    }
    Json& json = files[split == Split::train ? 0 : 1];
    json["generator"] = detail::procedural_generator;
    json["camera_angle_x"] = settings.camera_angle_x;
    detail::put_lens(json, settings.lens);
    json["frames"] = Json::array();
    for (int i = 0; i < count; ++i) {
      std::array<char, 32> text{};
      std::snprintf(text.data(), text.size(), "r_%03d", i);
      const Camera<double> camera = procedural_camera(settings, split, i);
      const ImageBytes image = render_procedural(scene, camera, executor, settings.lens);
      if (Result<Done> written = write_png(folder / name / (std::string(text.data()) + ".png"), image); !written)
        return written.error();
      Json frame;
      frame["file_path"] = "./" + name + "/" + text.data();
      frame["transform_matrix"] = detail::opengl_matrix<Json>(camera);
      json["frames"].push_back(std::move(frame));
    }
  }
  if (Result<Done> written = write_json(folder / "transforms_test.json", files[1]); !written) return written.error();
  return write_json(folder / "transforms_train.json", files[0]);
}

/// The same on all threads of the machine.
template <class Threads = ThreadExecutor>
[[nodiscard]] Result<Done> write_procedural_scene(const std::filesystem::path& folder,
                                                  const ProceduralSettings& settings = {}) {
  Threads executor(0);
  return write_procedural_scene(folder, settings, executor);
}

}  // namespace compmark
