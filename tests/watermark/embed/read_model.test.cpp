// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/embed/read_model.hpp"

#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/archetypes.hpp"
#include "support/directional.hpp"
#include "support/small_scene.hpp"

namespace read_model_test {

using namespace compmark;
using R = testing::SmoothRecipe;

/// As large as no image of the scene.
struct Demanding : testing::MessageDecoderArchetype<double> {
  [[nodiscard]] static constexpr int minimum_size() { return 41; }
};

TEST_CASE("embed/read_model: what is read is the 8-bit image of every view, whatever the number of threads") {
  const Model<R> model = testing::random_model<R>(40);
  const testing::BlobViews views{.count = 3, .width = 48, .height = 40};
  const testing::MessageDecoderArchetype<double> mean;
  SerialExecutor serial;
  const auto readings = read_model(model, views, mean, serial);
  REQUIRE(readings.ok());
  REQUIRE(readings->size() == 3);
  Pipeline<R>::Context context;
  for (std::size_t i = 0; i < 3; ++i) {
    static_cast<void>(Pipeline<R>{}.forward(model, views.camera(i), unseen_view, context, serial));
    double exact = 0, rounded = 0;
    const double count = static_cast<double>(context.image.size());
    for (const double value : context.image.flat()) {
      exact += value / count;
      rounded += to_8bit(value) / 255.0 / count;
    }
    const double read = (*readings)[i].logits.at(0) + 0.5;
    CHECK((*readings)[i].name == "view " + std::to_string(i));
    CHECK(read == doctest::Approx(rounded).epsilon(1e-12));
    CHECK(read != doctest::Approx(exact).epsilon(1e-9));  // the control: not the image before it was rounded
  }
  ThreadExecutor threads(3);
  const auto again = read_model(model, views, mean, threads);
  for (std::size_t i = 0; i < 3; ++i) CHECK((*again)[i].logits == (*readings)[i].logits);
}

TEST_CASE("embed/read_model: a view that is too small for the decoder is an error that names it") {
  const Model<R> model = testing::random_model<R>(4);
  SerialExecutor serial;
  const auto refused = read_model(model, testing::BlobViews{}, Demanding{}, serial);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().line().find("view 0") != std::string::npos);
  CHECK(refused.error().line().find("at least 41 pixels") != std::string::npos);
}

}  // namespace read_model_test
