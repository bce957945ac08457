// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A splat file of another program as a model: what it draws, with the cameras it gets, and what is exported of it.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/app/any_model.hpp>
#include <compmark/app/export.hpp>
#include <compmark/io/read_file.hpp>
#include <compmark/io/splat/read_splat.hpp>
#include <compmark/io/splat_ply.hpp>
#include <compmark/scene/splat_table.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/splat_writers.hpp"
#include "support/damage.hpp"
#include "support/tool.hpp"

using namespace compmark;

namespace splat_model_test {

namespace fs = std::filesystem;
namespace splats = compmark::testing::splats;

std::vector<float> pixels(ImageView<const float> image) { return {image.data, image.data + image.size()}; }

double largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
  REQUIRE(a.size() == b.size());
  float most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return static_cast<double>(most);
}

TEST_CASE("app/splat_model: a splat file opens as a model of explicit Gaussians, with cameras round it") {
  const testing::ScratchFolder folder("compmark-app-splats");
  ThreadExecutor executor(2);
  const SplatTable table = splats::random_splats(300, 2);
  const fs::path ply = folder.path / "scene.ply", ksplat = folder.path / "scene.ksplat",
                 again = folder.path / "again.ply";
  testing::put_raw(ply, splats::permuted_ply_bytes(table, 1));
  testing::put_raw(ksplat, splats::ksplat_bytes(table, 0));
  Result<AnyModel> model = AnyModel::open(ply, executor);
  REQUIRE_MESSAGE(model.ok(), model.error().line());
  CHECK(model->info().recipe == "explicit");
  CHECK(model->anchor_count() == 300);
  REQUIRE(model->info().views.size() == 16);
  CHECK(model->info().views[3].name == "around_03");
  CHECK(model->info().views[3].test);

  // What is drawn is the file's Gaussians, colours seen from the camera: the table says the same.
  const StoredView& view = model->info().views[3];
  Result<RenderedView> render = model->render(view, executor);
  REQUIRE(render.ok());
  const std::vector<float> seen = pixels(render->image);
  CHECK(std::count_if(seen.begin(), seen.end(), [](float x) { return x > 0.05f; }) > 10000);
  GaussianBatch<float> batch;
  to_gaussians(table, view.camera.center_world, batch, executor);
  const GaussianColumns<const float> expected = std::as_const(batch).columns(), drawn = render->drawn;
  REQUIRE(drawn.count == 300);
  double most = 0;
  for (std::size_t i = 0; i < 300; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      most = std::max(most, static_cast<double>(std::abs(drawn.mean[axis][i] - expected.mean[axis][i])));
      most = std::max(most, static_cast<double>(std::abs(drawn.color[axis][i] - expected.color[axis][i])));
      most = std::max(most, static_cast<double>(std::abs(drawn.scale[axis][i] - expected.scale[axis][i])));
    }
    most = std::max(most, static_cast<double>(std::abs(drawn.opacity[i] - expected.opacity[i])));
  }
  CHECK(most < 1e-4);

  // Another format with the same numbers but for colours and opacities in bytes.
  Result<AnyModel> other = AnyModel::open(ksplat, executor);
  REQUIRE(other.ok());
  const double close = largest_difference(seen, pixels(other->render(view, executor)->image));
  CHECK(close < 0.03);
  CHECK(close > 0);

  // Its export is the file itself: nothing is fitted.
  ExportSettings settings;
  settings.compare = 2;
  const Result<ExportReport> report = export_model(*model, again, settings, executor);
  REQUIRE_MESSAGE(report.ok(), report.error().line());
  CHECK_FALSE(report->fit.has_value());
  CHECK(report->gaussians == 300);
  REQUIRE(report->compared.has_value());
  const Result<SplatFile> written = read_splat(again);
  REQUIRE(written.ok());
  double change = 0;
  for (std::size_t i = 0; i < 300; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      change = std::max(change, std::abs(static_cast<double>(written->table.mean[axis][i]) -
                                         static_cast<double>(table.mean[axis][i])));
      for (std::size_t k = 0; k < table.coefficients(); ++k)
        change = std::max(change, std::abs(static_cast<double>(written->table.color(axis, k)[i]) -
                                           static_cast<double>(table.color(axis, k)[i])));
    }
  }
  CHECK(change < 1e-5);
  // Nobody knows which way is up, so the file does not say it. Where its own file said it, it does.
  CHECK_FALSE(written->up.has_value());
  const std::vector<std::string> comments{splat_up_comment({0, 0, 1})};
  const fs::path told = folder.path / "told.ply", packed = folder.path / "told.compressed.ply";
  REQUIRE(write_splat_ply(told, table, comments).ok());
  Result<AnyModel> upright = AnyModel::open(told, executor);
  REQUIRE(upright.ok());
  ExportSettings plain;
  plain.compare = 0;
  for (const fs::path& out : {again, packed}) {
    REQUIRE(export_model(*upright, out, plain, executor).ok());
    const Result<SplatFile> said = read_splat(out);
    REQUIRE(said.ok());
    CHECK(said->up == std::array<double, 3>{0, 0, 1});
  }
  // A page of it is upright where its cameras are, and knows them.
  settings.kind = ExportKind::page;
  const fs::path page = folder.path / "page.html";
  const Result<ExportReport> shown = export_model(*model, page, settings, executor);
  REQUIRE_MESSAGE(shown.ok(), shown.error().line());
  CHECK(shown->gaussians == 300);
  CHECK_FALSE(shown->written.has_value());
  const Result<std::vector<std::byte>> text = read_file(page);
  REQUIRE(text.ok());
  const std::string html(reinterpret_cast<const char*>(text->data()), text->size());
  const std::size_t at = html.find('{', html.find("id=\"scene\""));
  const nlohmann::json scene = nlohmann::json::parse(html.substr(at, html.find("</script>", at) - at));
  CHECK(scene["cameras"].size() == 16);
  CHECK(scene["up"][1].get<double>() == doctest::Approx(-1));
  settings.kind = ExportKind::anchors;
  const Result<ExportReport> none = export_model(*model, folder.path / "anchors.ply", settings, executor);
  REQUIRE_FALSE(none.ok());
  CHECK(none.error().field == "--format");

  // As a model of ours it is written and read again.
  const fs::path file = folder.path / "model.safetensors";
  REQUIRE(model->write(file).ok());
  Result<AnyModel> kept = AnyModel::open(file, executor);
  REQUIRE_MESSAGE(kept.ok(), kept.error().line());
  CHECK(pixels(kept->render(view, executor)->image) == seen);
}

TEST_CASE("app/splat_model: what is no splat file is refused by what it is") {
  const testing::ScratchFolder folder("compmark-app-no-splats");
  ThreadExecutor executor(1);
  const fs::path path = folder.path / "points.ply";
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 "
      "3\n";
  testing::put_raw(path, std::as_bytes(std::span<const char>(text)));
  const Result<AnyModel> model = AnyModel::open(path, executor);
  REQUIRE_FALSE(model.ok());
  CHECK(model.error().file == path.string());
  CHECK(model.error().problem.find("point cloud") != std::string::npos);
  CHECK(model.error().remedy.find("train") != std::string::npos);
}

}  // namespace splat_model_test
