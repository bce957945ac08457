// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The part of the library that a viewer needs: opens a compressed scene and prints its contents. It includes one header
// of the codec, and with it neither a rasterizer nor anything that trains (tests/consumer/run.sh checks which headers
// the compiler read).
//   read_compressed scene.cmk
#include <compmark/codec/container/cmk.hpp>
#include <compmark/core/thread_executor.hpp>

#include <algorithm>
#include <array>
#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: read_compressed scene.cmk\n");
    return 2;
  }
  compmark::ThreadExecutor executor;
  const auto decoded = compmark::read_cmk(argv[1], compmark::CodecDecodeSettings{}, executor);
  if (!decoded) {
    std::fprintf(stderr, "%s\n", decoded.error().line().c_str());
    return 1;
  }
  const compmark::CodecModel& model = decoded->model;
  std::size_t unmasked = 0;
  std::array<double, 3> low{}, high{};
  for (std::size_t i = 0; i < model.anchors(); ++i) {
    for (std::uint32_t bits = model.mask[i]; bits != 0; bits &= bits - 1) ++unmasked;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = model.voxel_size * model.voxels[i][axis];
      low[axis] = i == 0 ? x : std::min(low[axis], x);
      high[axis] = i == 0 ? x : std::max(high[axis], x);
    }
  }
  std::printf("%s, %s\n", compmark::codec_name(model.profile()), decoded->verified ? "digest right" : "incomplete");
  std::printf("%zu anchors with %zu unmasked offsets and %d features\n", model.anchors(), unmasked, model.feature_dim);
  std::printf("within (%.3f %.3f %.3f) to (%.3f %.3f %.3f)\n", low[0], low[1], low[2], high[0], high[1], high[2]);
  return decoded->verified ? 0 : 1;
}
