// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// LPIPS against the published networks' own figures on the three images of the original authors' example (64 x 64).
#include "compmark/metric/lpips.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "support/data.hpp"

namespace {

using namespace compmark;

std::vector<float> planar(const std::filesystem::path& path) {
  const auto image = read_image(path);
  REQUIRE(image.ok());
  REQUIRE(image->channels == 3);
  REQUIRE(image->width == 64);
  REQUIRE(image->height == 64);
  std::vector<float> values(3 * 64 * 64);
  for (std::size_t i = 0; i < 64 * 64; ++i) {
    for (std::size_t c = 0; c < 3; ++c) values[c * 64 * 64 + i] = static_cast<float>(image->pixels[3 * i + c]) / 255;
  }
  return values;
}

TEST_CASE("metric/lpips: AlexNet and SqueezeNet give the published distances to 1e-4, layer by layer") {
  const auto data = testing::data_dir();
  if (!data || !std::filesystem::exists(*data / "weights/lpips_alex.safetensors")) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  const auto check = *data / "weights" / "lpips_check";
  const auto reference = planar(check / "ex_ref.png"), first = planar(check / "ex_p0.png"),
             second = planar(check / "ex_p1.png");
  const auto view = [](const std::vector<float>& v) { return ImageView<const float>{v.data(), 3, 64, 64}; };
  struct Expected {
    const char* file;
    double first, second, family_first,
        family_second;           // the last two: images passed in [0, 1], as the splatting family did
    std::vector<double> layers;  // of the first pair
  };
  for (const Expected& e :
       {Expected{"lpips_alex.safetensors", 0.72188, 0.13757, 0.7253, 0.1354, {0.0181, 0.2870, 0.1599, 0.1190, 0.1379}},
        Expected{"lpips_squeeze.safetensors", 0.71105, 0.14790, 0, 0, {}}}) {
    const auto file = read_safetensors(*data / "weights" / e.file);
    REQUIRE(file.ok());
    const auto net = Lpips::load(*file);
    REQUIRE(net.ok());
    Lpips::Context context;
    ThreadExecutor executor(2);
    const auto far = net->distance(view(first), view(reference), context, executor);
    const auto near = net->distance(view(second), view(reference), context, executor);
    CHECK(std::abs(far->value - e.first) < 1e-4);
    CHECK(std::abs(near->value - e.second) < 1e-4);
    for (std::size_t layer = 0; layer < e.layers.size(); ++layer)
      CHECK(std::abs(far->layers[layer] - e.layers[layer]) < 1e-4);
    if (e.family_first == 0) continue;
    CHECK(std::abs(net->distance(view(first), view(reference), context, executor, LpipsRange::family_unit)->value -
                   e.family_first) < 1e-4);
    CHECK(std::abs(net->distance(view(second), view(reference), context, executor, LpipsRange::family_unit)->value -
                   e.family_second) < 1e-4);
  }
}

TEST_CASE("metric/lpips: a file of another network is refused with its missing tensor") {
  const auto data = testing::data_dir();
  if (!data || !std::filesystem::exists(*data / "weights/hidden_48.safetensors")) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  const auto file = read_safetensors(*data / "weights/hidden_48.safetensors");
  REQUIRE(file.ok());
  const auto net = Lpips::load(*file);
  REQUIRE(!net.ok());
  CHECK(net.error().field == "features.conv1.weight");
  CHECK(!net.error().remedy.empty());
}

}  // namespace
