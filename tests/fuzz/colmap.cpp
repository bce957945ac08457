// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as the three binary files of a COLMAP model: two lengths of 16 bits, then the files. Cameras and poses of
// an accepted model are brought to ours.
#include <compmark/scene/colmap.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace compmark;
  if (size < 4) return 0;
  const auto all = std::as_bytes(std::span<const std::uint8_t>(data, size)).subspan(4);
  const std::size_t first = std::min(std::size_t{data[0]} + 256 * std::size_t{data[1]}, all.size());
  const std::size_t second = std::min(std::size_t{data[2]} + 256 * std::size_t{data[3]}, all.size() - first);
  const Result<ColmapModel> model =
      parse_colmap_binary(all.first(first), all.subspan(first, second), all.subspan(first + second), "fuzz", {true});
  if (!model) {
    if (model.error().problem.empty() || model.error().file.empty()) std::abort();
    return 0;
  }
  for (const auto& [id, camera] : model->cameras) {
    const Result<detail::ColmapIntrinsics> intrinsics = detail::colmap_intrinsics(camera, id, "fuzz");
    if (!intrinsics) continue;
    if (!(intrinsics->camera.fx > 0) || intrinsics->camera.width < 1) std::abort();
    static_cast<void>(undistort(intrinsics->lens, {1.5, 0.9}, 0.3, -0.2));
  }
  for (const auto& [id, image] : model->images) {
    const auto pose = pose_from_quaternion(image.rotation_wxyz, image.translation);
    if (pose && !std::isfinite(pose->rotation_camera_world[0])) std::abort();
  }
  return 0;
}
