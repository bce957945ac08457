// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any bytes as an octree of any number of anchors up to 65,535: an answer, never a crash, and never another number of
// anchors. What is accepted is in order and encodes again.
#include <compmark/codec/container/geometry.hpp>

#include <cstdint>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const std::size_t count = data[0] | static_cast<std::size_t>(data[1]) << 8;
  const auto voxels =
      compmark::decode_geometry(std::as_bytes(std::span<const std::uint8_t>(data + 2, size - 2)), count);
  if (!voxels) {
    if (voxels.error().problem.empty() || voxels.error().remedy.empty()) std::abort();
    return 0;
  }
  if (voxels->size() != count) std::abort();
  const auto again =
      compmark::decode_geometry(compmark::encode_geometry(*voxels, compmark::voxel_range(*voxels)), count);
  if (!again || *again != *voxels) std::abort();
  return 0;
}
