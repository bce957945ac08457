// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/metric/lpips.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <map>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;

/// A tensor file in memory with random weights of either network; what Lpips::load needs of a file.
struct RandomWeights {
  bool squeeze = false;
  std::string missing;
  [[nodiscard]] bool has(const std::string& name) const {
    return squeeze && name == "features.fire2.squeeze1x1.weight";
  }
  [[nodiscard]] Result<std::vector<float>> floats(const std::string& name,
                                                  std::initializer_list<std::int64_t> shape) const {
    if (name == missing) return Error{ErrorKind::invalid, "weights", name, "no such tensor", ""};
    std::size_t count = 1;
    for (const std::int64_t extent : shape) count *= static_cast<std::size_t>(extent);
    const bool linear = name.rfind("lin", 0) == 0;
    const double scale = shape.size() == 4
                             ? std::sqrt(6.0 / static_cast<double>(count / static_cast<std::size_t>(*shape.begin())))
                             : 0.1;
    const Random random(1, 0, random_stage(name));
    std::vector<float> values(count);
    for (std::size_t i = 0; i < count; ++i)
      values[i] = static_cast<float>(linear ? random.uniform(i) : 2 * scale * (random.uniform(i) - 0.5));
    return values;
  }
};

std::vector<float> image(int height, int width, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("image"));
  std::vector<float> values(3 * static_cast<std::size_t>(height * width));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(random.uniform(i));
  return values;
}

TEST_CASE(
    "metric/lpips: identical images are at distance 0, different ones are not, symmetric, same bits at any thread "
    "count") {
  for (const bool squeeze : {false, true}) {
    const auto net = Lpips::load(RandomWeights{squeeze, ""});
    REQUIRE(net.ok());
    CHECK(net->network() == (squeeze ? LpipsNetwork::squeeze : LpipsNetwork::alex));
    const int height = 40, width = 57;
    const auto a = image(height, width, 1), b = image(height, width, 2);
    const ImageView<const float> x{a.data(), 3, height, width}, y{b.data(), 3, height, width};
    Lpips::Context context;
    SerialExecutor executor;
    CHECK(net->distance(x, x, context, executor)->value == 0);
    const auto forward = net->distance(x, y, context, executor);
    CHECK(forward->value > 0);
    CHECK(forward->layers.size() == (squeeze ? 7 : 5));
    CHECK(net->distance(y, x, context, executor)->value == doctest::Approx(forward->value).epsilon(1e-6));
    ThreadExecutor threads(3);
    Lpips::Context fresh;
    CHECK(net->distance(x, y, fresh, threads)->value == forward->value);
    CHECK(net->distance(x, y, context, executor, LpipsRange::family_unit)->value != forward->value);
  }
}

TEST_CASE("metric/lpips: the smallest image that works, and a clear error below it") {
  for (const bool squeeze : {false, true}) {
    const auto net = Lpips::load(RandomWeights{squeeze, ""});
    const int size = net->smallest_image();
    const auto a = image(size, size, 1), b = image(size, size, 2);
    Lpips::Context context;
    SerialExecutor executor;
    CHECK(std::isfinite(net->distance({a.data(), 3, size, size}, {b.data(), 3, size, size}, context, executor)->value));
    const auto small = net->distance({a.data(), 3, size - 1, size}, {b.data(), 3, size - 1, size}, context, executor);
    REQUIRE(!small.ok());
    CHECK(small.error().kind == ErrorKind::invalid);
    CHECK(!small.error().remedy.empty());
  }
}

TEST_CASE("metric/lpips: a missing tensor is named") {
  CHECK(Lpips::load(RandomWeights{false, "features.conv3.bias"}).error().field == "features.conv3.bias");
  CHECK(Lpips::load(RandomWeights{true, "features.fire7.expand3x3.weight"}).error().field ==
        "features.fire7.expand3x3.weight");
  CHECK(Lpips::load(RandomWeights{false, "lin4.weight"}).error().field == "lin4.weight");
}

}  // namespace
