// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/app/evaluate.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/metric/ssim.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/scene/image_store.hpp>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "small_scene_models.hpp"

namespace {

using namespace compmark;

/// A model, and the test views of its dataset.
struct EvaluateFiles {
  testing::SmallScene scene{"compmark-app-evaluate"};
  ThreadExecutor executor{2};
  DatasetSettings settings;
  Result<Dataset> dataset = opened();
  ImageStore store{*dataset, settings};
  DatasetViews views{&*dataset, &store, dataset->indices(Split::test)};

  Result<Dataset> opened() {
    settings.background = {0, 0, 0};
    Result<Dataset> found = open_dataset(scene.data, settings);
    REQUIRE(found.ok());
    return found;
  }
  AnyModel model(const char* recipe = "scaffold") {
    Result<AnyModel> model = AnyModel::open(scene.write<recipes::Scaffold>("model", recipe, 5), executor);
    REQUIRE(model.ok());
    return std::move(*model);
  }
};

}  // namespace

TEST_CASE("app/evaluate: figures are those of 8-bit renders against the photographs, view by view") {
  EvaluateFiles files;
  AnyModel model = files.model();
  std::size_t seen = 0;
  const Result<Evaluation> evaluation =
      evaluate_views(model, files.views, EvaluateSettings{}, files.executor, [&](const SeenView& view) -> Result<Done> {
        CHECK(view.index == seen++);
        CHECK(std::equal(view.render.data, view.render.data + view.render.size(), view.measured.data));  // no mask
        return Done{};
      });
  if (!evaluation) FAIL(evaluation.error().line());
  REQUIRE(evaluation->views.size() == 2);
  CHECK(seen == 2);
  double sum = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    const Result<RenderedView> render = model.render(files.views.camera(i), files.executor);
    REQUIRE(render.ok());
    round_to_8bit<float>(render->image, render->image);
    std::vector<float> truth(render->image.size());
    const ImageView<float> photograph{truth.data(), 3, render->image.height, render->image.width};
    REQUIRE(files.views.load(i, photograph).ok());
    const ViewResult& view = evaluation->views[i];
    CHECK(view.psnr ==
          doctest::Approx(psnr(ImageView<const float>(render->image), ImageView<const float>(photograph))));
    CHECK(view.ssim ==
          doctest::Approx(ssim(ImageView<const float>(render->image), ImageView<const float>(photograph))));
    CHECK(view.name == files.dataset->views[files.views.index[i]].name);
    CHECK(view.milliseconds == 0);  // nobody gave a clock
    CHECK_FALSE(view.lpips_alex.has_value());
    CHECK_FALSE(view.psnr_colour_fitted.has_value());
    sum += view.psnr;
  }
  CHECK(evaluation->mean([](const ViewResult& v) { return v.psnr; }) == doctest::Approx(sum / 2));
  CHECK_FALSE(evaluation->colour_fitted().has_value());
}

TEST_CASE("app/evaluate: the clock that is given is read before and after a render, and an observer's error ends it") {
  EvaluateFiles files;
  AnyModel model = files.model();
  EvaluateSettings settings;
  double now = 0;
  settings.clock = [&] { return now += 3; };
  const Result<Evaluation> timed = evaluate_views(model, files.views, settings, files.executor);
  REQUIRE(timed.ok());
  for (const ViewResult& view : timed->views) CHECK(view.milliseconds == 3);
  const Result<Evaluation> stopped =
      evaluate_views(model, files.views, settings, files.executor, [](const SeenView&) -> Result<Done> {
        return Error{ErrorKind::cancelled, {}, {}, "enough", {}};
      });
  REQUIRE_FALSE(stopped.ok());
  CHECK(stopped.error().problem == "enough");
}

TEST_CASE("app/evaluate: only pixels that count are in a PSNR, by halves where none counts wholly") {
  std::vector<float> a(3 * 4, 0.5f), b = a, weight(4, 1.0f);
  b[1] = 0.6f;  // red of pixel 1
  const ImageView<const float> x{a.data(), 3, 2, 2}, y{b.data(), 3, 2, 2};
  const double all = -10 * std::log10(0.01 / 12);
  CHECK(counted_psnr(x, y, {}) == doctest::Approx(all));
  CHECK(counted_psnr(x, y, weight) == doctest::Approx(all));
  weight[3] = 0.4f;  // counts less than by half: as if it were not there
  CHECK(counted_psnr(x, y, weight) == doctest::Approx(-10 * std::log10(0.01 / 9)));
  weight = {0.25f, 0.25f, 0, 0};
  CHECK(counted_psnr(x, y, weight) == doctest::Approx(-10 * std::log10(0.25 * 0.01 / 1.5)));
  CHECK(counted_psnr(x, x, weight) == psnr_of_identical_images);  // finite, as metric/psnr.hpp has it
  weight = {1, 0, 1, 0};
  CHECK(counted_psnr(x, y, weight) == psnr_of_identical_images);  // the pixels that differ do not count
  weight = {0, 0, 0, 0};
  CHECK(std::isnan(counted_psnr(x, y, weight)));
}
