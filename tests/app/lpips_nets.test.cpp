// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/app/lpips_nets.hpp>
#include <compmark/core/random.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "support/picture.hpp"
#include "support/tool.hpp"

namespace {

using namespace compmark;
namespace fs = std::filesystem;

/// Random weights of AlexNet as the network asks for them, kept for a file.
struct AskedWeights {
  SafetensorsWriter& file;
  [[nodiscard]] static bool has(const std::string& /*name*/) { return false; }
  [[nodiscard]] Result<std::vector<float>> floats(const std::string& name,
                                                  std::initializer_list<std::int64_t> shape) const {
    std::size_t count = 1;
    for (const std::int64_t extent : shape) count *= static_cast<std::size_t>(extent);
    const double inputs = shape.size() == 4 ? static_cast<double>(count) / static_cast<double>(*shape.begin()) : 100;
    const Random random(1, 0, random_stage(name));
    std::vector<float> values(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double x = random.uniform(i);
      values[i] = static_cast<float>(name.rfind("lin", 0) == 0 ? x : std::sqrt(6 / inputs) * (2 * x - 1));
    }
    file.add_copy<float>(name, shape, values);
    return values;
  }
};

}  // namespace

TEST_CASE("app/lpips_nets: the weights of a file give the network's distance, and the other network's are refused") {
  const testing::ScratchFolder folder("compmark-app-lpips");
  ThreadExecutor executor(2);
  const fs::path file = folder.path / "alex.safetensors";
  SafetensorsWriter writer;
  const Result<Lpips> net = Lpips::load(AskedWeights{writer});
  REQUIRE(net.ok());
  REQUIRE(writer.write(file).ok());
  constexpr int side = 48;
  const std::vector<float> a = testing::textured_picture(side, 1), b = testing::textured_picture(side, 2);
  const ImageView<const float> x{a.data(), 3, side, side}, y{b.data(), 3, side, side};

  Result<LpipsNets> nets = LpipsNets::open({file, {}, false});
  if (!nets) FAIL(nets.error().line());
  const Result<LpipsNets::Distances> found = nets->between(x, y, executor);
  REQUIRE(found.ok());
  Lpips::Context context;
  REQUIRE(found->alex.has_value());
  CHECK(*found->alex == net->distance(x, y, context, executor)->value);
  CHECK(*found->alex > 0);
  CHECK_FALSE(found->squeeze.has_value());
  Result<LpipsNets> family = LpipsNets::open({file, {}, true});
  CHECK(*family->between(x, y, executor)->alex != *found->alex);
  Result<LpipsNets> none = LpipsNets::open({});
  REQUIRE(none.ok());
  CHECK_FALSE(none->between(x, y, executor)->alex.has_value());

  const Result<LpipsNets> swapped = LpipsNets::open({{}, file, false});
  REQUIRE_FALSE(swapped.ok());
  CHECK(swapped.error().file == file.string());
  REQUIRE(write_file(file, std::string("no weights")).ok());
  CHECK_FALSE(LpipsNets::open({file, {}, false}).ok());
}
