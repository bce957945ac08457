// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Small datasets written by the tests themselves: a folder that cleans up after itself, a two-view Blender scene, a
// COLMAP model in both formats. Failures are asserted by the place they name: `names(error, file, field, remedy)`.
#pragma once

#include <unistd.h>
#include <cmath>
#include <compmark/core/result.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/scene/colmap_model.hpp>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

namespace compmark::testing {

/// A new empty folder, removed with its contents at the end of the test.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "compmark_test_XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// True if the error names this file and field and tells the user what to do.
inline bool names(const Error& error, const std::string& file, const std::string& field, const std::string& remedy) {
  return error.file.find(file) != std::string::npos && error.field.find(field) != std::string::npos &&
         error.remedy.find(remedy) != std::string::npos && error.line().find('\n') == std::string::npos &&
         !error.problem.empty();
}

inline void put(const std::filesystem::path& path, const std::string& text) {
  std::error_code ignored;
  std::filesystem::create_directories(path.parent_path(), ignored);
  static_cast<void>(write_file(path, std::string_view(text)));
}

/// A PNG whose pixel (x, y) is (8 x, 8 y, 40, alpha) of the channels asked for.
inline void put_image(const std::filesystem::path& path, int width, int height, int channels = 3, int alpha = 255) {
  ImageBytes image{width, height, channels, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int pixel[4] = {8 * x, 8 * y, 40, alpha};
      for (int c = 0; c < channels; ++c) image.pixels.push_back(static_cast<std::uint8_t>(pixel[c]));
    }
  }
  std::error_code ignored;
  std::filesystem::create_directories(path.parent_path(), ignored);
  static_cast<void>(write_png(path, image));
}

/// The identity pose four units above the origin along z, as a transform_matrix; `first` replaces its first entry.
inline std::string matrix_text(const std::string& first = "1") {
  return "[[" + first + ",0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]";
}
inline std::string frame_text(const std::string& file_path, const std::string& matrix = matrix_text()) {
  return R"({"file_path": ")" + file_path + R"(", "transform_matrix": )" + matrix + "}";
}
inline std::string transforms_text(const std::string& frames) {
  return R"({"camera_angle_x": 0.8, "frames": [)" + frames + "]}";
}

/// Two training views and one test view of 16 x 12 RGBA pixels.
inline void put_blender(const std::filesystem::path& folder) {
  for (const char* name : {"train/a.png", "train/b.png", "test/a.png"}) put_image(folder / name, 16, 12, 4, 128);
  put(folder / "transforms_train.json", transforms_text(frame_text("./train/a") + "," + frame_text("train/b.png")));
  put(folder / "transforms_test.json", transforms_text(frame_text("./test/a")));
}

/// Little-endian bytes of a record, value by value.
class Bytes {
 public:
  template <class T>
  Bytes& add(T value) {
    const std::size_t begin = text_.size();
    text_.resize(begin + sizeof(T));
    std::memcpy(text_.data() + begin, &value, sizeof(T));
    return *this;
  }
  Bytes& add_string(const std::string& value) {
    text_ += value;
    text_ += '\0';
    return *this;
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

inline void put_colmap_binary(const std::filesystem::path& folder, const ColmapModel& model) {
  Bytes cameras;
  cameras.add(std::uint64_t{model.cameras.size()});
  for (const auto& [id, camera] : model.cameras) {
    cameras.add(id).add(std::int32_t{camera.model}).add(camera.width).add(camera.height);
    for (std::size_t i = 0; i < colmap_models[static_cast<std::size_t>(camera.model)].parameters; ++i)
      cameras.add(camera.parameters[i]);
  }
  put(folder / "cameras.bin", cameras.text());
  Bytes images;
  images.add(std::uint64_t{model.images.size()});
  for (const auto& [id, image] : model.images) {
    images.add(id);
    for (const double v : image.rotation_wxyz) images.add(v);
    for (const double v : image.translation) images.add(v);
    images.add(image.camera_id).add_string(image.name).add(std::uint64_t{image.observations.size()});
    for (const ColmapObservation& observation : image.observations)
      images.add(observation.x).add(observation.y).add(observation.point_id);
  }
  put(folder / "images.bin", images.text());
  Bytes points;
  points.add(std::uint64_t{model.points.size()});
  for (const auto& [id, point] : model.points) {
    points.add(id);
    for (const double v : point.position) points.add(v);
    for (const std::uint8_t v : point.color) points.add(v);
    points.add(0.5).add(std::uint64_t{1}).add(std::uint32_t{1}).add(std::uint32_t{0});
  }
  put(folder / "points3D.bin", points.text());
}

inline void put_colmap_text(const std::filesystem::path& folder, const ColmapModel& model) {
  const auto number = [](double v) {
    char text[40];
    std::snprintf(text, sizeof text, " %.17g", v);
    return std::string(text);
  };
  std::string cameras = "# Camera list\n";
  for (const auto& [id, camera] : model.cameras) {
    cameras += std::to_string(id) + " " + std::string(colmap_models[static_cast<std::size_t>(camera.model)].name) +
               " " + std::to_string(camera.width) + " " + std::to_string(camera.height);
    for (std::size_t i = 0; i < colmap_models[static_cast<std::size_t>(camera.model)].parameters; ++i)
      cameras += number(camera.parameters[i]);
    cameras += "\n";
  }
  put(folder / "cameras.txt", cameras);
  std::string images = "# Image list\n";
  for (const auto& [id, image] : model.images) {
    images += std::to_string(id);
    for (const double v : image.rotation_wxyz) images += number(v);
    for (const double v : image.translation) images += number(v);
    images += " " + std::to_string(image.camera_id) + " " + image.name + "\r\n";
    for (const ColmapObservation& observation : image.observations) {
      images += number(observation.x) + number(observation.y) +
                (observation.point_id == ~std::uint64_t{0} ? " -1" : " " + std::to_string(observation.point_id));
    }
    images += "\n";
  }
  put(folder / "images.txt", images);
  std::string points;
  for (const auto& [id, point] : model.points) {
    points += std::to_string(id);
    for (const double v : point.position) points += number(v);
    for (const std::uint8_t v : point.color) points += " " + std::to_string(v);
    points += " 0.5 1 0\n";
  }
  put(folder / "points3D.txt", points);
}

/// Nine 16 x 12 views of two cameras with their own focal lengths, ids with gaps, one name with a space, two points.
inline ColmapModel small_colmap_model() {
  ColmapModel model;
  model.cameras[3] = {1, 16, 12, {20, 21, 8.25, 6.5}};
  model.cameras[7] = {0, 16, 12, {18, 8, 6}};
  for (std::uint32_t i = 0; i < 9; ++i) {
    ColmapImage image;
    const double half = 0.05 * i;
    image.rotation_wxyz = {2 * std::cos(half), 0, 2 * std::sin(half), 0};  // not of unit length: readers must normalise
    image.translation = {0.1 * i, -0.2, 4};
    image.camera_id = i % 2 == 0 ? 3 : 7;
    image.name = i == 4 ? "with space.png" : "view" + std::to_string(i) + ".png";
    if (i == 2) image.observations = {{1.5, 2.5, 11}, {3.25, 4.75, ~std::uint64_t{0}}};
    model.images[10 + 3 * i] = image;
  }
  model.points[11] = {{0.5, -0.25, 1.0 / 3}, {10, 20, 255}};
  model.points[500] = {{-1, 2, 0}, {0, 128, 7}};
  return model;
}

inline void put_colmap_images(const std::filesystem::path& folder, const ColmapModel& model, int width = 16,
                              int height = 12) {
  for (const auto& [id, image] : model.images) put_image(folder / image.name, width, height);
}

/// Largest resident size of this process so far, bytes; 0 where the system does not tell.
inline std::size_t peak_memory() {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    if (word == "VmHWM:" && status >> word) return std::stoull(word) << 10;
  }
  return 0;
}

}  // namespace compmark::testing
