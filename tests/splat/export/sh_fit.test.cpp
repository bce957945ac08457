// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/export/sh_fit.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "bake_scene.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/export/bake.hpp"

using namespace compmark;
using testing::BakeRecipe;

namespace {

/// Sums over 60 directions, on the sphere or in a cap about +z, of a colour with known coefficients.
detail::SlotSums sums_of(const std::array<double, 48>& truth, double cap) {
  const Random random(4, 0, random_stage("sh fit test"));
  detail::SlotSums sums;
  for (std::uint64_t i = 0; i < 60; ++i) {
    const double z = 1 - cap * random.uniform(3 * i), angle = 6.283185307179586 * random.uniform(3 * i + 1),
                 w = 1 + random.uniform(3 * i + 2);
    const double radius = std::sqrt(1 - z * z);
    const std::array<double, 16> basis = sh_basis<double>({radius * std::cos(angle), radius * std::sin(angle), z});
    sums.weight += w;
    for (std::size_t c = 0; c < 3; ++c) {
      double color = 0;
      for (std::size_t k = 0; k < 16; ++k) color += basis[k] * truth[3 * k + c];
      sums.color_energy += w * color * color;
      for (std::size_t k = 0; k < 16; ++k) sums.right[3 * k + c] += w * basis[k] * color;
    }
    for (std::size_t k = 0; k < 16; ++k) {
      for (std::size_t j = 0; j <= k; ++j) sums.normal[packed_index(k, j)] += w * basis[k] * basis[j];
    }
  }
  return sums;
}

double mean_psnr(const Model<BakeRecipe>& model, const SplatTable& table, const std::vector<Camera<double>>& cameras) {
  ThreadExecutor executor(2);
  const auto report = compare_bake(model, table, std::span<const Camera<double>>(cameras), {}, 0, executor);
  return report.ok() ? report->mean_bake_to_model : 0;
}

SplatTable fit(const Model<BakeRecipe>& model, const std::vector<Camera<double>>& cameras,
               const ShFitSettings& settings, ShFitReport& report, std::size_t threads = 2) {
  ThreadExecutor executor(threads);
  Result<SplatTable> table = fit_splats(model, std::span<const Camera<double>>(cameras), settings, report, executor);
  REQUIRE(table.ok());
  return std::move(*table);
}

/// Cameras between those of orbit_cameras(40): never used for fitting.
std::vector<Camera<double>> held_out() {
  std::vector<Camera<double>> cameras;
  for (std::size_t i = 3; i < 37; i += 6) cameras.push_back(testing::orbit_camera(i, 37));
  return cameras;
}

}  // namespace

TEST_CASE(
    "export/sh_fit: a colour that is spherical harmonics is recovered; a lower degree leaves what it cannot hold") {
  const Random random(5, 0, random_stage("sh fit test"));
  std::array<double, 48> truth{}, found{};
  for (std::size_t i = 0; i < 48; ++i) truth[i] = random.normal(i);
  ShFitSettings settings;
  settings.ridge = 0;
  const detail::SlotSums sums = sums_of(truth, 2);
  CHECK(detail::fit_color(sums, settings, found) / sums.color_energy < 1e-12);
  for (std::size_t i = 0; i < 48; ++i)
    CHECK(found[i] == doctest::Approx(truth[i]).epsilon(1e-5));  // 1e-9 of the diagonal is added always
  double last = 0;
  for (int degree = 2; degree >= 0; --degree) {
    settings.degree = degree;
    const double residual = detail::fit_color(sums, settings, found) / sums.color_energy;
    CHECK(residual > last + 0.05);  // negative control: less degree, more residual
    last = residual;
  }
}

TEST_CASE(
    "export/sh_fit: seen from one side only, the ridge keeps the far side near the mean colour; without it, it runs "
    "away") {
  // Noise-free degree-1 colour plus a little degree 3, seen within 30 degrees of +z.
  std::array<double, 48> truth{};
  for (std::size_t c = 0; c < 3; ++c) truth[c] = 1, truth[6 + c] = 0.2, truth[3 * 15 + c] = 0.3;
  detail::SlotSums sums = sums_of(truth, 0.13);
  for (double& value : sums.right)
    value *= 1 + 1e-3 * std::sin(1e4 * value);  // the decoder is not exactly of degree 3 either
  const std::array<double, 16> back = sh_basis<double>({0.3, 0.2, -std::sqrt(1 - 0.13)});
  const auto far_side = [&](double ridge) {
    ShFitSettings settings;
    settings.ridge = ridge;
    std::array<double, 48> found{};
    static_cast<void>(detail::fit_color(sums, settings, found));
    double color = 0;
    for (std::size_t k = 0; k < 16; ++k) color += back[k] * found[3 * k];
    return color;
  };
  CHECK(std::abs(far_side(ShFitSettings{}.ridge)) < 2);
  CHECK(std::abs(far_side(0)) > 10);  // negative control
}

TEST_CASE("export/sh_fit: contributions add up to the alpha of the image") {
  const Model<BakeRecipe> model = testing::bake_model(150, 2, 1);
  const Camera<double> camera = testing::orbit_camera(4, 12);
  ThreadExecutor executor(2);
  ContributionMeter<BakeRecipe> meter;
  const Result<ViewContributions> view = meter.measure(model, camera, 0, executor);
  REQUIRE(view.ok());
  double contributions = 0;
  for (const auto& [slot, weight] : view->slots) contributions += static_cast<double>(weight);
  // White Gaussians on black: every pixel is its own alpha.
  SplatTable table = bake_at_camera(model, camera, 0, executor);
  for (std::size_t c = 0; c < 3; ++c) {
    for (float& value : table.color(c, 0)) value = static_cast<float>(0.5 / sh_constant);
  }
  SplatRenderer<BakeRecipe> renderer(model.render);
  const ImageView<const float> image = renderer.render(table, camera, executor);
  double alpha = 0;
  for (std::size_t i = 0; i < image.plane_size(); ++i) alpha += static_cast<double>(image.data[i]);
  CHECK(alpha > 300);
  CHECK(contributions == doctest::Approx(alpha).epsilon(1e-3));
}

TEST_CASE("export/sh_fit: a model that looks the same from everywhere is exported exactly") {
  const Model<BakeRecipe> model = testing::bake_model(150, 2, 0);
  ShFitReport report;
  for (const int degree : {0, 3}) {
    ShFitSettings settings;
    settings.degree = degree;
    const SplatTable table = fit(model, testing::orbit_cameras(40), settings, report);
    CHECK(report.slots == 1500);
    CHECK(report.kept == table.count);
    CHECK(report.kept + report.faint + report.unseen == report.slots);
    CHECK(report.color_rms < 1e-5);
    CHECK(mean_psnr(model, table, held_out()) >
          60);  // the 8-bit images are the same but for a few roundings and faint slots
  }
}

TEST_CASE("export/sh_fit: view-dependent colour needs the degrees; every degree is better at cameras it has not seen") {
  const Model<BakeRecipe> model = testing::bake_model(150, 1.5, 1.5);
  double last = 0;
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    ShFitSettings settings;
    settings.degree = degree;
    ShFitReport report;
    const SplatTable table = fit(model, testing::orbit_cameras(40), settings, report);
    const double quality = mean_psnr(model, table, held_out());
    MESSAGE("degree " << degree << ": " << quality << " dB, colour rms " << report.color_rms << ", kept "
                      << report.kept);
    CHECK(quality > last);
    last = quality;
  }
  CHECK(last > 25);
}

TEST_CASE("export/sh_fit: what no camera sees is left out, and the bits do not depend on the threads") {
  Model<BakeRecipe> model = testing::bake_model(60, 2, 1);
  const AnchorColumns<float> anchors = anchor_values(model.arena, model.anchors);
  anchors.position(7, 2) = 50;  // behind or far outside every camera
  ShFitSettings settings;
  settings.block_anchors = 16;
  ShFitReport report;
  SplatTable one = fit(model, testing::orbit_cameras(12), settings, report, 1);
  CHECK(report.unseen >= 10);
  for (const float z : one.mean[2]) CHECK(z < 10);
  settings.block_anchors = 1024;  // nor on the block
  SplatTable three = fit(model, testing::orbit_cameras(12), settings, report, 3);
  std::vector<std::vector<float>> a, b;
  one.for_each_column([&](std::vector<float>& column) { a.push_back(column); });
  three.for_each_column([&](std::vector<float>& column) { b.push_back(column); });
  CHECK(a == b);
}
