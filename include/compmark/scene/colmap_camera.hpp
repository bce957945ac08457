// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// From a COLMAP camera to intrinsics and a lens: all models but the panorama, which has no pinhole. And the folder of a
// model: of several sub-models the one with the most images.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/colmap_model.hpp"
#include "compmark/scene/colmap_text.hpp"
#include "compmark/scene/lens_model.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {
namespace detail {

[[nodiscard]] inline bool has_binary(const std::filesystem::path& folder) {
  return file_exists(folder / "images.bin") || file_exists(folder / "cameras.bin");
}
[[nodiscard]] inline bool has_colmap_model(const std::filesystem::path& folder) {
  return has_binary(folder) || file_exists(folder / "images.txt") || file_exists(folder / "cameras.txt");
}

/// How many images a model has, from the first bytes of its file; 0 where that cannot be told.
[[nodiscard]] inline std::uint64_t registered_images(const std::filesystem::path& folder) {
  if (!has_binary(folder)) {
    Result<LineReader> lines = LineReader::open(folder / "images.txt");
    std::uint64_t count = 0;
    while (lines && lines->next_record()) {
      ++count;
      if (!feature_line(*lines)) return count;  // the reader will say what is wrong
    }
    return count;
  }
  struct Close {
    void operator()(std::FILE* stream) const { std::fclose(stream); }
  };
  const std::filesystem::path path = folder / "images.bin";
  const std::unique_ptr<std::FILE, Close> stream(std::fopen(path.c_str(), "rb"));
  std::uint64_t count = 0;
  std::error_code status;
  if (!stream || std::fread(&count, sizeof count, 1, stream.get()) != 1) return 0;
  const std::uintmax_t size = std::filesystem::file_size(path, status);
  return !status && count <= size / 73 ? count : 0;  // 73 bytes an image at least
}

/// The folder with the model (a sub-folder of sparse, sparse, or the root itself), or an empty path; and what else was
/// there.
struct ColmapFolder {
  std::filesystem::path path;
  std::uint64_t images = 0;
  std::vector<std::pair<std::string, std::uint64_t>> others;  ///< smaller sub-models
};
[[nodiscard]] inline ColmapFolder find_colmap_folder(const std::filesystem::path& root) {
  ColmapFolder result;
  std::vector<std::filesystem::path> parts;
  std::error_code status;
  for (std::filesystem::directory_iterator i(root / "sparse", status), end; !status && i != end; i.increment(status)) {
    if (folder_exists(i->path()) && has_colmap_model(i->path())) parts.push_back(i->path());
  }
  std::sort(parts.begin(), parts.end());
  for (const std::filesystem::path& part : parts) {
    const std::uint64_t images = parts.size() > 1 ? registered_images(part) : 0;
    if (result.path.empty() || images > result.images) {
      if (!result.path.empty()) result.others.emplace_back(result.path.filename().string(), result.images);
      result.path = part;
      result.images = images;
    } else {
      result.others.emplace_back(part.filename().string(), images);
    }
  }
  for (const std::filesystem::path& folder : {root / "sparse", root}) {
    if (!has_colmap_model(folder)) continue;
    if (result.path.empty()) {
      result.path = folder;
    } else {
      if (result.others.empty()) result.images = registered_images(result.path);
      result.others.emplace_back(folder == root ? "the one in the folder itself" : "that of sparse",
                                 registered_images(folder));
    }
  }
  return result;
}

/// Intrinsics of a camera at COLMAP's size, without pose, and its lens.
struct ColmapIntrinsics {
  Camera<double> camera;
  Lens lens;
};
[[nodiscard]] inline Result<ColmapIntrinsics> colmap_intrinsics(const ColmapCamera& camera, std::uint32_t id,
                                                                const std::string& file) {
  const std::string field = "camera " + std::to_string(id);
  const auto fail = [&](ErrorKind kind, std::string problem, std::string remedy) {
    return Error{kind, file, field, std::move(problem), std::move(remedy)};
  };
  if (camera.model < 0 || static_cast<std::size_t>(camera.model) >= lens_model_count) {
    const std::size_t model = static_cast<std::size_t>(camera.model);
    return fail(
        ErrorKind::unsupported,
        "uses the camera model " +
            (model < colmap_models.size() ? std::string(colmap_models[model].name) : std::to_string(camera.model)) +
            ", which has no pinhole",
        "cut the panoramas into perspective views and reconstruct from those");
  }
  if (!possible_side(static_cast<double>(camera.width)) || !possible_side(static_cast<double>(camera.height))) {
    return fail(ErrorKind::invalid,
                "has the impossible size " + std::to_string(camera.width) + " x " + std::to_string(camera.height),
                "export the model again");
  }
  for (const double v : camera.parameters) {
    if (!std::isfinite(v))
      return fail(ErrorKind::invalid, "has an intrinsic parameter that is not finite", "export the model again");
  }
  ColmapIntrinsics result;
  result.lens.model = static_cast<LensModel>(camera.model);
  const std::size_t intrinsics = lens_intrinsics(result.lens.model);
  Camera<double>& c = result.camera;
  c.width = static_cast<int>(camera.width);
  c.height = static_cast<int>(camera.height);
  c.fx = camera.parameters[0];
  c.fy = camera.parameters[intrinsics - 3];
  c.cx = camera.parameters[intrinsics - 2];
  c.cy = camera.parameters[intrinsics - 1];
  if (!(c.fx > 0) || !(c.fy > 0))
    return fail(ErrorKind::invalid, "has a focal length that is not positive", "export the model again");
  const std::size_t count = colmap_models[static_cast<std::size_t>(camera.model)].parameters;
  for (std::size_t i = intrinsics; i < count; ++i) result.lens.parameters[i - intrinsics] = camera.parameters[i];
  const double first = result.lens.parameters[0], second = result.lens.parameters[1];
  const bool impossible = (result.lens.model == LensModel::eucm && (!(first >= 0) || !(first <= 1) || !(second > 0))) ||
                          (result.lens.model == LensModel::fov && !(std::abs(first) < std::numbers::pi));
  if (impossible)
    return fail(ErrorKind::invalid, "has distortion parameters that no lens has", "export the model again");
  if (is_pinhole(result.lens)) result.lens = {};
  return result;
}

}  // namespace detail
}  // namespace compmark
