// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Cells of the robustness tables, of models that nobody trained or marked: what is read is chance, but it is the same
// chance each time, and what it costs is known.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/app/model_attack.hpp>
#include <compmark/app/robustness.hpp>
#include <compmark/app/spread.hpp>
#include <compmark/app/verify.hpp>
#include <compmark/core/random.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <filesystem>
#include <string>

#include "small_decoder.hpp"
#include "small_models.hpp"
#include "support/tool.hpp"

namespace robustness_test {
namespace {

using namespace compmark;
using Kind = RobustnessKind;

struct BenchFiles {
  testing::ScratchFolder folder{"compmark-app-robustness"};
  ThreadExecutor executor{2};
  RobustnessSettings settings;
  BenchFiles() {
    settings.model = folder.path / "model.safetensors";
    settings.key = folder.path / "owner.key";
    settings.decoder = folder.path / "decoder.safetensors";
    Model<recipes::Scaffold> model = testing::small_model<recipes::Scaffold>(5, 200);
    model.render.background = {0, 0, 0};
    REQUIRE(write_model(settings.model, model, testing::larger_info("scaffold", 2)).ok());
    REQUIRE(write_key(settings.key, testing::small_key(1, 24)).ok());
    testing::write_decoder(settings.decoder, 24);
  }
  RobustnessBench open() {
    Result<RobustnessBench> bench = RobustnessBench::open(settings, executor);
    REQUIRE(bench.ok());
    return std::move(*bench);
  }
};

}  // namespace

TEST_CASE("app/robustness: a cell says what the thief is left with, and is the same whenever it is measured") {
  BenchFiles files;
  RobustnessBench bench = files.open();
  const auto measured = [&](RobustnessBench& by, const RobustnessAttack& attack) {
    const Result<RobustnessCell> cell = by.measure(attack, files.executor);
    REQUIRE(cell.ok());
    CHECK(cell->views == 1);  // that of the test
    CHECK(cell->bits == 24);
    CHECK(cell->worst <= cell->mean);
    CHECK(cell->informed == 0);
    return *cell;
  };
  const RobustnessCell plain = measured(bench, {});
  CHECK(*plain.psnr == doctest::Approx(99.99));
  const RobustnessCell same = measured(bench, {Kind::other, "itself", {files.settings.model}});
  CHECK(same.matches == plain.matches);
  CHECK(*same.psnr == *plain.psnr);
  CHECK(*measured(bench, {Kind::average, "with itself", {files.settings.model}}).psnr > 60);
  CHECK_FALSE(measured(bench, {Kind::picture, "crop:0.5"}).psnr.has_value());
  const RobustnessCell strong = measured(bench, {Kind::picture, "jpeg:10"}),
                       weak = measured(bench, {Kind::picture, "jpeg:90"});
  CHECK(*strong.psnr < *weak.psnr);
  const RobustnessCell pruned = measured(bench, {Kind::model, "prune:0.3"});
  CHECK(*pruned.psnr < 60);
  CHECK(*measured(bench, {Kind::model, "lightgaussian:0.3"}).psnr > *pruned.psnr);
  RobustnessBench again = files.open();
  const RobustnessCell twice = measured(again, {Kind::model, "prune:0.3"});
  CHECK(twice.matches == pruned.matches);
  CHECK(*twice.psnr == *pruned.psnr);
}

TEST_CASE("app/robustness: attacked models are also read as lacking anchors where that is asked for") {
  BenchFiles files;
  const RobustnessAttack pruned{Kind::model, "prune:0.5"};
  RobustnessBench plain = files.open();
  files.settings.pruned = true;
  RobustnessBench lacking = files.open();
  const Result<RobustnessCell> one = plain.measure(pruned, files.executor),
                               four = lacking.measure(pruned, files.executor),
                               picture = lacking.measure({Kind::picture, "jpeg:50"}, files.executor),
                               same = plain.measure({Kind::picture, "jpeg:50"}, files.executor);
  REQUIRE((one.ok() && four.ok() && picture.ok() && same.ok()));
  CHECK(four->matches >= one->matches);
  CHECK(*four->psnr == *one->psnr);  // what the thief has
  if (four->missing_share == 0) CHECK(four->p_value == std::min(1.0, 4 * one->p_value));
  CHECK(picture->p_value == same->p_value);
  CHECK(picture->missing_share == 0);
}

TEST_CASE("app/robustness: attacked models are also read put back together, as verify reads them") {
  BenchFiles files;
  files.settings.unmarked = files.folder.path / "unmarked.safetensors";
  files.settings.informed_views = 0;
  Model<recipes::Scaffold> model = testing::small_model<recipes::Scaffold>(5, 200);
  model.render.background = {0, 0, 0};
  REQUIRE(write_model(files.settings.unmarked, model, testing::larger_info("scaffold", 2)).ok());
  // A mark of sorts: that of the model differs in the features.
  const Random random(3, 0, random_stage("test/restored bench"));
  std::uint64_t n = 0;
  for (float& feature : model.arena.values(model.anchors.feature).flat())
    feature += static_cast<float>(0.3 * random.normal(n++));
  REQUIRE(write_model(files.settings.model, model, testing::larger_info("scaffold", 2)).ok());
  const RobustnessAttack pruned{Kind::model, "prune:0.5"}, picture{Kind::picture, "jpeg:50"};
  RobustnessBench plain = files.open();
  files.settings.restored = true;
  RobustnessBench bench = files.open();
  const Result<RobustnessCell> blind = plain.measure(pruned, files.executor),
                               cell = bench.measure(pruned, files.executor),
                               of_picture = bench.measure(picture, files.executor),
                               of_unmarked =
                                   bench.measure({Kind::other, "unmarked", {files.settings.unmarked}}, files.executor);
  REQUIRE((blind.ok() && cell.ok() && of_picture.ok() && of_unmarked.ok()));
  CHECK_FALSE(blind->restored.has_value());
  CHECK_FALSE(of_picture->restored.has_value());
  REQUIRE(cell->restored.has_value());
  CHECK(cell->matches == blind->matches);  // beside it, not in its place
  CHECK(cell->p_value == blind->p_value);
  CHECK(*cell->psnr == *blind->psnr);
  // The same as verify, of a file.
  Result<AnyModel> attacked = AnyModel::open(files.settings.model, files.executor);
  REQUIRE(attacked.ok());
  REQUIRE(attack_any_model(*attacked, pruned.text, files.settings.seed, files.executor).ok());
  ReadingSettings reading;
  reading.model = files.folder.path / "attacked.safetensors";
  REQUIRE(attacked->write(reading.model).ok());
  reading.unmarked = files.settings.unmarked;
  reading.decoder = files.settings.decoder;
  reading.restored = true;
  const Result<VerificationReport> report =
      verify_files(testing::small_key(1, 24), reading, VerifySettings{}, files.executor);
  REQUIRE(report.ok());
  CHECK(cell->restored->matches == report->verification.evidence.matches);
  CHECK(cell->restored->p_value == report->verification.evidence.p_value);
  CHECK(cell->restored->features == *report->restored);
  CHECK(cell->restored->features.found < cell->restored->features.anchors);
  CHECK(cell->restored->worst <= cell->restored->mean);
  // The control: the unmarked model itself leaves nothing to read, and what is read is another thing.
  REQUIRE(of_unmarked->restored.has_value());
  CHECK(of_unmarked->restored->features.found == of_unmarked->restored->features.anchors);
  CHECK(of_unmarked->restored->matches != cell->restored->matches);

  files.settings.unmarked.clear();
  CHECK(RobustnessBench::open(files.settings, files.executor).error().field == "--restored");
}

TEST_CASE("app/robustness: who knows the decoder turns the bits round, within epsilon") {
  BenchFiles files;
  RobustnessBench bench = files.open();
  const Result<RobustnessCell> plain = bench.measure({}, files.executor),
                               turned = bench.measure({Kind::pgd, "pgd:0.1"}, files.executor),
                               nothing = bench.measure({Kind::pgd, "pgd:0"}, files.executor);
  REQUIRE((plain.ok() && turned.ok() && nothing.ok()));
  CHECK(*turned->psnr >= 19.9);
  CHECK(*nothing->psnr == doctest::Approx(99.99));
  CHECK(nothing->matches == plain->matches);
  CHECK(turned->matches + plain->matches >= 20);  // most of the bits are the other way round
  CHECK(turned->matches + plain->matches <= 28);
  CHECK(turned->matches != plain->matches);
  for (const char* wrong : {"pgd:2", "pgd:x", "pgd:", "fgsm:0.1"}) {
    CAPTURE(wrong);
    CHECK_FALSE(bench.measure({Kind::pgd, wrong}, files.executor).ok());
  }
}

TEST_CASE("app/robustness: gradient steps through the decoder leave a spread mark, which one picture still proves") {
  BenchFiles files;
  files.settings.unmarked = files.folder.path / "unmarked.safetensors";
  files.settings.pictures = files.folder.path / "pictures";
  Model<recipes::Scaffold> model = testing::small_model<recipes::Scaffold>(5, 500);
  model.render.background = {0, 0, 0};
  REQUIRE(write_model(files.settings.unmarked, model, testing::larger_info("scaffold", 4)).ok());
  SpreadMarkSettings marking;
  marking.model = files.settings.unmarked;
  marking.out = files.settings.model;
  marking.psnr = 36;
  REQUIRE(mark_spread(testing::small_key(1, 24), marking, files.executor).ok());
  const auto measured = [&](const RobustnessAttack& attack) {
    RobustnessBench bench = files.open();
    const Result<RobustnessCell> cell = bench.measure(attack, files.executor);
    REQUIRE_MESSAGE(cell.ok(), cell.error().line());
    CHECK(cell->informed == 1);
    CHECK(cell->found == 1);
    MESSAGE("spread mark at ", cell->spread_deviations, " deviations, p ", cell->informed_p_value);
    return *cell;
  };
  CHECK(measured({}).informed_p_value < 1e-6);
  const RobustnessCell erased = measured({Kind::pgd, "pgd_no_key:0.03"});
  CHECK(*erased.psnr < 40);
  CHECK(erased.informed_p_value < 1e-6);
  files.settings.key = files.folder.path / "other.key";
  REQUIRE(write_key(files.settings.key, testing::small_key(2, 24)).ok());
  CHECK(measured({}).informed_p_value > 1e-3);  // another key's
}

TEST_CASE("app/robustness: a folder of pictures that was there keeps what was in it") {
  BenchFiles files;
  files.settings.unmarked = files.settings.model;
  files.settings.pictures = files.folder.path / "pictures";
  std::filesystem::create_directories(files.settings.pictures);
  REQUIRE(write_file(files.settings.pictures / "mine.txt", std::string_view("mine")).ok());
  RobustnessBench bench = files.open();
  REQUIRE(bench.measure({}, files.executor).ok());
  const Result<RobustnessCell> cell = bench.measure({Kind::picture, "jpeg:50"}, files.executor);
  REQUIRE(cell.ok());
  CHECK(cell->informed == 1);
  CHECK(std::filesystem::exists(files.settings.pictures / "mine.txt"));
  CHECK(std::filesystem::exists(files.settings.pictures / "view_0.png"));
}

TEST_CASE("app/robustness: what is missing is told before anything is measured") {
  BenchFiles files;
  files.settings.unmarked = files.settings.model;
  CHECK(RobustnessBench::open(files.settings, files.executor).error().line().find("pictures: is missing") !=
        std::string::npos);
  files.settings.unmarked.clear();
  files.settings.key = files.folder.path / "none.key";
  CHECK(RobustnessBench::open(files.settings, files.executor).error().line().find("none.key") != std::string::npos);
}

}  // namespace robustness_test
