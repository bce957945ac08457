// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <compmark/app/export.hpp>
#include <compmark/io/anchor_ply.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/splat/read_splat.hpp>
#include <compmark/io/splat/write_splat.hpp>
#include <compmark/io/splat_ply.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/scene/up_axes.hpp>
#include <compmark/splat/export/bake.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "small_models.hpp"
#include "small_scene_models.hpp"
#include "support/tool.hpp"

namespace {

using namespace compmark;
namespace fs = std::filesystem;

struct ExportFiles {
  testing::ScratchFolder folder{"compmark-app-export"};
  fs::path file = folder.path / "model.safetensors", out = folder.path / "out.ply", typed = folder.path / "typed.ply";
  ThreadExecutor executor{2};

  template <class R = recipes::Scaffold>
  AnyModel open(const ModelInfo& info = testing::small_info("scaffold")) {
    REQUIRE(write_model(file, testing::small_model<R>(), info).ok());
    Result<AnyModel> model = AnyModel::open(file, executor);
    REQUIRE(model.ok());
    return std::move(*model);
  }
};

/// In which order it was told of what.
struct Told final : ExportObserver {
  std::vector<std::string> events;
  fs::path out;
  void on_begin(const ExportReport& report) override {
    CHECK(report.anchors == testing::small_anchors);
    events.push_back("begin");
  }
  void on_fitted(const ExportReport& report) override {
    CHECK(report.fit.has_value());
    events.push_back("fitted");
  }
  void on_refined(const ExportReport& report) override {
    CHECK(report.refined.has_value());
    events.push_back("refined");
  }
  void on_written(const ExportReport& /*report*/) override {
    CHECK(fs::exists(out));
    events.push_back("written");
  }
};

}  // namespace

TEST_CASE("app/export: the splats of one view are those of the pipeline's bake, and are measured against its render") {
  ExportFiles files;
  AnyModel model = files.open();
  ExportSettings settings;
  settings.view = "view 1";
  const Result<ExportReport> report = export_model(model, files.out, settings, files.executor);
  if (!report) FAIL(report.error().line());
  const SplatTable table = bake_at_camera(testing::small_model<recipes::Scaffold>(), testing::ring_camera(1, 3, 40, 32),
                                          unseen_view, files.executor);
  // The file says which way is up in the cameras of the model.
  std::vector<Camera<double>> cameras;
  for (const StoredView& view : testing::small_info("scaffold").views) cameras.push_back(view.camera);
  const std::optional<std::array<double, 3>> up = up_of_cameras(cameras);
  REQUIRE(up.has_value());
  const std::vector<std::string> comments{splat_up_comment(*up)};
  REQUIRE(write_splat_ply(files.typed, table, comments).ok());
  CHECK(*read_file(files.out) == *read_file(files.typed));
  const Result<SplatFile> read = read_splat(files.out);
  REQUIRE(read.ok());
  REQUIRE(read->up.has_value());
  for (std::size_t axis = 0; axis < 3; ++axis) CHECK(std::abs((*read->up)[axis] - (*up)[axis]) < 1e-8);
  CHECK(report->gaussians == static_cast<std::size_t>(table.count));
  REQUIRE(report->compared.has_value());
  CHECK(report->compared_views == std::vector<std::string>{"view 1"});
  CHECK(report->compared->mean_bake_to_model > 40);  // exact from there, but for rounding
  CHECK_FALSE(report->fit.has_value());
}

TEST_CASE("app/export: a fit is told of as it goes, and refining brings it nearer to the model") {
  ExportFiles files;
  AnyModel model = files.open();
  ExportSettings settings;
  settings.refine = 0;
  const Result<ExportReport> fitted = export_model(model, files.out, settings, files.executor);
  REQUIRE(fitted.ok());
  CHECK(fitted->cameras == 2);  // of the training
  CHECK(fitted->compared_views == std::vector<std::string>{"view 2"});
  settings.refine = 40;
  Told told;
  told.out = files.out;
  const Result<ExportReport> refined = export_model(model, files.out, settings, files.executor, told);
  REQUIRE(refined.ok());
  CHECK(told.events == std::vector<std::string>{"begin", "fitted", "refined", "written"});
  CHECK(refined->refined->last_mse < refined->refined->first_mse);
  CHECK(refined->warnings.empty());
}

TEST_CASE("app/export: lengths are those of the dataset, and what viewers cannot show is said") {
  ExportFiles files;
  ModelInfo info = testing::small_info("scaffold");
  info.unit = 2;
  info.origin = {100, 0, 0};
  AnyModel model = files.open(info);
  ExportSettings settings;
  settings.kind = ExportKind::anchors;
  const Result<ExportReport> report = export_model(model, files.out, settings, files.executor);
  REQUIRE(report.ok());
  REQUIRE(report->warnings.size() == 1);
  CHECK(report->warnings[0].find("(100, 0, 0)") != std::string::npos);
  CHECK(report->gaussians == 0);
  const auto made = testing::small_model<recipes::Scaffold>();
  std::vector<float> position(made.columns().position.data,
                              made.columns().position.data + made.columns().position.size()),
      scaling(made.columns().scaling.data, made.columns().scaling.data + made.columns().scaling.size());
  for (float& x : position) x *= 2;
  for (float& x : scaling) x += static_cast<float>(std::log(2.0));
  AnchorColumns<const float> columns = made.columns();
  columns.position.data = position.data();
  columns.scaling.data = scaling.data();
  const std::vector<std::string> comments{"compmark anchors export"};
  REQUIRE(write_anchor_ply(files.typed, columns, comments).ok());
  CHECK(*read_file(files.out) == *read_file(files.typed));

  AnyModel lens = files.open<recipes::ScaffoldLens>(testing::small_info("scaffold+lens"));
  CHECK(export_model(lens, files.out, settings, files.executor)->warnings.size() == 1);
  AnyModel filtered = files.open<recipes::ScaffoldAntiAliased>(testing::small_info("scaffold+antialiasing"));
  CHECK(export_model(filtered, files.out, settings, files.executor)->warnings[0].find("mip filter") !=
        std::string::npos);
}

TEST_CASE("app/export: the file is measured as it is read back, over views that nothing was fitted over") {
  ExportFiles files;
  ModelInfo info = testing::small_info("scaffold");
  info.unit = 2;  // lengths of the file are twice those of the model
  AnyModel model = files.open(info);
  ExportSettings settings;
  settings.refine = 0;
  double plain = 0;
  for (const SplatEnding& known : splat_endings) {
    const fs::path out = files.folder.path / ("scene" + std::string(known.ending));
    CAPTURE(out.string());
    const Result<ExportReport> report = export_model(model, out, settings, files.executor);
    if (!report) FAIL(report.error().line());
    REQUIRE(report->written.has_value());
    CHECK(report->written->format == known.format);
    CHECK(report->written->bytes == fs::file_size(out));
    CHECK(report->held_out);
    REQUIRE(report->compared.has_value());
    if (known.format == SplatFormat::ply) {
      CHECK_FALSE(report->from_file.has_value());
      plain = report->compared->mean_bake_to_model;
      continue;
    }
    REQUIRE(report->from_file.has_value());
    CHECK(report->from_file->views.size() == report->compared->views.size());
    MESSAGE(known.word << ": " << report->compared->mean_bake_to_model << " dB, of the file "
                       << report->from_file->mean_bake_to_model);
    CHECK(report->from_file->mean_bake_to_model > 15);
    if (known.format == SplatFormat::glb) {
      CHECK(report->from_file->mean_bake_to_model ==
            doctest::Approx(report->compared->mean_bake_to_model).epsilon(1e-3));
    }
  }
  CHECK(plain > 15);
  settings.file.format = SplatFormat::glb;
  const Result<ExportReport> named = export_model(model, files.folder.path / "scene.bin", settings, files.executor);
  REQUIRE(named.ok());
  CHECK(named->written->format == SplatFormat::glb);
  settings.file.format.reset();
  const Result<ExportReport> other = export_model(model, files.folder.path / "scene.sogs", settings, files.executor);
  REQUIRE_FALSE(other.ok());
  CHECK(other.error().field == "--out");
  settings.view = "view 1";
  CHECK_FALSE(export_model(model, files.folder.path / "one.spz", settings, files.executor)->held_out);
  AnyModel filtered = files.open<recipes::ScaffoldAntiAliased>(testing::small_info("scaffold+antialiasing"));
  const Result<ExportReport> mip = export_model(filtered, files.folder.path / "mip.sog", settings, files.executor);
  REQUIRE(mip.ok());
  CHECK(mip->warnings[0].find("which the file says") != std::string::npos);
  CHECK(read_splat(files.folder.path / "mip.sog")->antialiased);
}

TEST_CASE("app/export: nothing is written where the model has no such view, or the output no folder") {
  ExportFiles files;
  AnyModel model = files.open();
  ExportSettings settings;
  settings.view = "view 9";
  const Result<ExportReport> nowhere = export_model(model, files.out, settings, files.executor);
  REQUIRE_FALSE(nowhere.ok());
  CHECK(nowhere.error().file == files.file.string());
  CHECK(nowhere.error().problem.find("\"view 9\"") != std::string::npos);
  settings.view.clear();
  for (const int degree : {-1, 4, 100}) {  // 4 wrote beyond an array once
    settings.degree = degree;
    CHECK(export_model(model, files.out, settings, files.executor).error().field == "--sh-degree");
  }
  settings.degree = 1;
  CHECK(export_model(model, files.folder.path / "none" / "a.ply", settings, files.executor).error().field == "--out");
  CHECK(export_model(model, files.folder.path / std::string(300, 'a') / "a.ply", settings, files.executor)
            .error()
            .field == "--out");
  // The data are opened before minutes of fitting.
  settings.data = files.folder.path / "no data";
  settings.compare = 1;
  Told untold;
  const Result<ExportReport> no_data = export_model(model, files.out, settings, files.executor, untold);
  REQUIRE_FALSE(no_data.ok());
  CHECK(no_data.error().file == settings.data.string());
  CHECK(untold.events == std::vector<std::string>{"begin"});
  settings.data.clear();
  ModelInfo blind = testing::small_info("scaffold");
  blind.views.clear();
  AnyModel without = files.open(blind);
  CHECK(export_model(without, files.out, settings, files.executor).error().field == "views");
  AnyModel fisheye = files.open<recipes::ScaffoldFisheye>(testing::small_info("scaffold+fisheye"));
  settings.data = files.folder.path;
  CHECK(export_model(fisheye, files.out, settings, files.executor).error().field == "--data");
  CHECK_FALSE(fs::exists(files.out));
}

TEST_CASE(
    "app/export: photographs are those of the size of the training, and as many views are measured as are wanted") {
  const testing::SmallScene scene("compmark-app-export-data");
  ThreadExecutor executor(2);
  const fs::path file = scene.write<recipes::Scaffold>("whole", "scaffold", 5), half = scene.folder.path / "half",
                 out = scene.folder.path / "out.ply";
  Result<AnyModel> whole = AnyModel::open(file, executor);
  REQUIRE(whole.ok());
  ModelInfo info = whole->info();
  for (StoredView& view : info.views) {
    view.camera = view.camera.resized(24, 24);
    view.test = true;
  }
  REQUIRE(write_model(half, testing::small_model<recipes::Scaffold>(), info).ok());
  Result<AnyModel> model = AnyModel::open(half, executor);
  REQUIRE(model.ok());
  ExportSettings settings;
  settings.degree = 0;
  settings.refine = 0;
  settings.data = scene.data;
  settings.compare = 3;  // of five: no number of them is every second one
  const Result<ExportReport> other_size = export_model(*model, out, settings, executor);
  REQUIRE_FALSE(other_size.ok());
  CHECK(other_size.error().field == "view");
  CHECK(other_size.error().problem.find("of the model's size, 24 x 24 pixels") != std::string::npos);
  CHECK(other_size.error().remedy.find("--downscale") != std::string::npos);
  CHECK_FALSE(fs::exists(out));
  settings.downscale = 2;
  const Result<ExportReport> report = export_model(*model, out, settings, executor);
  if (!report) FAIL(report.error().line());
  REQUIRE(report->compared.has_value());
  CHECK(report->compared->mean_model_to_target > 0);
  CHECK(report->compared_views == std::vector<std::string>{info.views[0].name, info.views[1].name, info.views[3].name});
  CHECK(report->compared->views.size() == 3);
}
