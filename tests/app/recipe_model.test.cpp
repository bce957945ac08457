// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/recipe_model.hpp>
#include <filesystem>
#include <string>
#include <type_traits>

#include "small_models.hpp"
#include "support/tool.hpp"

TEST_CASE("app/recipe_model: the model that is held is handed over by its own type, not a copy of it") {
  using namespace compmark;
  const testing::ScratchFolder folder("compmark-app-typed");
  ThreadExecutor executor(1);
  const std::filesystem::path path = folder.path / "model.safetensors";
  REQUIRE(write_model(path, testing::small_model<recipes::HacScaffold>(), testing::small_info("hac+mask")).ok());
  Result<AnyModel> model = AnyModel::open(path, executor);
  REQUIRE(model.ok());
  const Result<int> features = with_model(*model, [](auto& typed) -> Result<int> {
    typed.arena.all_values()[0] = 7;
    return static_cast<int>(typed.columns().feature.columns);
  });
  REQUIRE(features.ok());
  CHECK(*features == 50);
  CHECK(model->arena().all_values()[0] == 7);
  const Result<Done> refused = with_model(*model, [](auto&) -> Result<Done> {
    return Error{ErrorKind::invalid, {}, {}, "not this one", {}};
  });
  CHECK(refused.error().problem == "not this one");
}
