// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/app/model_attack.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "small_models.hpp"
#include "support/tool.hpp"

namespace model_attack_test {
namespace {

using namespace compmark;
namespace fs = std::filesystem;

struct AttackFiles {
  testing::ScratchFolder folder{"compmark-app-model-attack"};
  ThreadExecutor executor{2};

  /// The model of seed 5, its features moved by `change`.
  fs::path write(const std::string& name, float change, std::uint64_t seed = 5, std::size_t anchors = 60) const {
    Model<recipes::Scaffold> model = testing::small_model<recipes::Scaffold>(seed, anchors);
    model.render.background = {0, 0, 0};
    const AnchorColumns<float> columns = anchor_values(model.arena, model.anchors);
    for (std::size_t i = 0; i < columns.feature.size(); ++i) columns.feature.data[i] += change;
    const fs::path path = folder.path / name;
    REQUIRE(write_model(path, model, testing::small_info("scaffold")).ok());
    return path;
  }
  AnyModel open(const fs::path& path) {
    Result<AnyModel> model = AnyModel::open(path, executor);
    REQUIRE(model.ok());
    return std::move(*model);
  }
};

double sum_of(const Result<RenderedView>& render) {
  REQUIRE(render.ok());
  double sum = 0;
  for (std::size_t i = 0; i < render->image.size(); ++i) sum += static_cast<double>(render->image.data[i]);
  return sum;
}
std::vector<float> numbers(AnyModel& model, const char* block) {
  const auto values = model.arena().values(model.arena().layout().find(block)).flat();
  return {values.begin(), values.end()};
}

}  // namespace

TEST_CASE("app/model_attack: what Gaussians give to a render adds up to it") {
  AttackFiles files;
  AnyModel model = files.open(files.write("model.safetensors", 0));
  const StoredView view = model.info().views[0];
  const double light = sum_of(model.render(view, files.executor));
  const Result<GaussianShares> shares = model.shares(view, files.executor);
  REQUIRE(shares.ok());
  REQUIRE(shares->slot.size() > 20);
  double given = 0;
  for (std::size_t p = 0; p < shares->slot.size(); ++p) {
    CHECK(shares->slot[p] < 60 * 10);
    CHECK(shares->weight[p] >= -1e-4f);
    for (std::size_t c = 0; c < 3; ++c)
      given += static_cast<double>(shares->weight[p]) * static_cast<double>(shares->drawn.color[c][p]);
  }
  CHECK(given == doctest::Approx(light).epsilon(1e-3));  // black is behind
}

TEST_CASE("app/model_attack: LightGaussian throws away what renders miss least") {
  AttackFiles files;
  const fs::path path = files.write("model.safetensors", 0, 5, 300);
  AnyModel model = files.open(path);
  const Result<AnchorEvidence> evidence = anchor_evidence(model, files.executor);
  REQUIRE(evidence.ok());
  REQUIRE(evidence->significance.size() == 300);
  for (std::size_t a = 0; a < 300; ++a) {
    CHECK(evidence->significance[a] >= -1e-3);
    CHECK((evidence->opacity[a] >= 0 && evidence->opacity[a] <= 1));
  }
  ThreadExecutor one(1);
  CHECK(anchor_evidence(model, one)->significance == evidence->significance);

  const auto lost = [&](const std::string& attack) {
    AnyModel attacked = files.open(path);
    REQUIRE(attack_any_model(attacked, attack, 1, files.executor).ok());
    CHECK(attacked.anchor_count() == (attack == "none" ? 300 : 150));
    double squares = 0;
    for (const StoredView& view : model.info().views) {
      const Result<RenderedView> before = model.render(view, files.executor);
      REQUIRE(before.ok());
      const std::vector<float> pixels(before->image.data, before->image.data + before->image.size());
      const Result<RenderedView> after = attacked.render(view, files.executor);
      REQUIRE(after.ok());
      for (std::size_t i = 0; i < pixels.size(); ++i)
        squares += static_cast<double>(pixels[i] - after->image.data[i]) * (pixels[i] - after->image.data[i]);
    }
    return squares;
  };
  const double significance = lost("lightgaussian:0.5"), place = lost("cutout:0.5");
  MESSAGE("squares lost: by significance ", significance, ", by a cut ", place);
  CHECK(significance < 0.5 * place);  // the control: half of the anchors, whatever they show
  CHECK(lost("prune_opacity:0.5") < place);
  AnyModel named = files.open(path);
  CHECK(attack_any_model(named, "poster", 1, files.executor).error().line().find("none of int8") != std::string::npos);
}

TEST_CASE("app/model_attack: where no camera of a training is stored, all cameras that are say what renders miss") {
  AttackFiles files;
  const fs::path path = files.folder.path / "model.safetensors";
  const Model<recipes::Scaffold> small = testing::small_model<recipes::Scaffold>(5, 60);
  ModelInfo info = testing::small_info("scaffold");
  const auto evidence = [&](bool test, std::size_t count) {
    info.views.resize(count);
    for (StoredView& view : info.views) view.test = test;
    REQUIRE(write_model(path, small, info).ok());
    AnyModel model = files.open(path);
    return anchor_evidence(model, files.executor);
  };
  const Result<AnchorEvidence> of_training = evidence(false, info.views.size()),
                               of_test = evidence(true, info.views.size());
  REQUIRE(of_training.ok());
  REQUIRE(of_test.ok());
  CHECK(of_test->significance == of_training->significance);
  CHECK(of_test->opacity == of_training->opacity);
  AnyModel model = files.open(path);
  REQUIRE(attack_any_model(model, "lightgaussian:0.5", 1, files.executor).ok());
  CHECK(model.anchor_count() == 30);
  const Result<AnchorEvidence> of_none = evidence(true, 0);
  REQUIRE_FALSE(of_none.ok());
  CHECK(of_none.error().field == "views");
  // Negative control: where there are cameras of the training, one of the test is not looked at.
  info = testing::small_info("scaffold");
  REQUIRE(write_model(path, small, info).ok());
  AnyModel mixed = files.open(path);
  const Result<AnchorEvidence> of_mixed = anchor_evidence(mixed, files.executor);
  REQUIRE(of_mixed.ok());
  CHECK(of_mixed->significance != of_test->significance);
}

TEST_CASE("app/model_attack: averages of copies are means, and what has other anchors is refused") {
  AttackFiles files;
  const fs::path one = files.write("one.safetensors", 0), two = files.write("two.safetensors", 0.5f),
                 three = files.write("three.safetensors", 1), other = files.write("other.safetensors", 0, 6),
                 larger = files.write("larger.safetensors", 0, 5, 61);
  AnyModel model = files.open(one);
  const std::vector<float> before = numbers(model, "anchor.feature");
  REQUIRE(average_models(model, {}, files.executor).ok());
  CHECK(numbers(model, "anchor.feature") == before);  // nobody else: nothing
  REQUIRE(average_models(model, {two, three}, files.executor).ok());
  const std::vector<float> after = numbers(model, "anchor.feature");
  for (std::size_t i = 0; i < before.size(); ++i) CHECK(after[i] == doctest::Approx(before[i] + 0.5f).epsilon(1e-5));
  AnyModel kept = files.open(one);
  CHECK(average_models(kept, {two, other}, files.executor).error().line().find("at another place") !=
        std::string::npos);
  CHECK(average_models(kept, {larger}, files.executor).error().line().find("has another shape") != std::string::npos);
  CHECK(numbers(kept, "anchor.feature") == before);
}

TEST_CASE("app/model_attack: a part goes into a scene of the same networks, and into no other") {
  AttackFiles files;
  AnyModel scene = files.open(files.write("scene.safetensors", 0)),
           part = files.open(files.write("part.safetensors", 0.5f)),
           other = files.open(files.write("other.safetensors", 0, 6));
  REQUIRE(attack_any_model(part, "cutout:0.25", 3, files.executor).ok());
  CHECK(part.anchor_count() == 15);
  const std::vector<float> before = numbers(scene, "anchor.position"), added = numbers(part, "anchor.position");
  REQUIRE(insert_model(scene, part).ok());
  CHECK(scene.anchor_count() == 75);
  std::vector<float> both = before;
  both.insert(both.end(), added.begin(), added.end());
  CHECK(numbers(scene, "anchor.position") == both);
  CHECK(sum_of(scene.render(scene.info().views[0], files.executor)) > 0);
  CHECK(insert_model(scene, other).error().line().find("is a network of other weights") != std::string::npos);
  CHECK(scene.anchor_count() == 75);
  const Result<Done> into_itself = insert_model(scene, scene);
  REQUIRE_FALSE(into_itself.ok());
  CHECK(into_itself.error().file == scene.file().string());
  CHECK(scene.anchor_count() == 75);
  CHECK(numbers(scene, "anchor.position") == both);
}

}  // namespace model_attack_test
