// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark export: the anchors as the Scaffold family's PLY, or explicit Gaussians as the PLY every viewer opens -
// baked for one camera (exact from there) or fitted with spherical harmonics over the training cameras - with what the
// bake loses, in dB.
#include <algorithm>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/anchor_ply.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/splat_ply.hpp>
#include <compmark/pipeline/bake.hpp>
#include <compmark/pipeline/model_file.hpp>
#include <compmark/pipeline/sh_fit.hpp>
#include <compmark/pipeline/splat_refine.hpp>
#include <compmark/scene/open.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include <compmark/app/recipe_list.hpp>
#include "commands.hpp"
#include "common.hpp"
#include "effects.hpp"
#include "model_files.hpp"

namespace tool {
namespace {

using namespace compmark;

struct ExportOptions {
  std::filesystem::path model;
  std::filesystem::path out;
  std::string kind = "splat";
  std::string view;
  int degree = 3;
  int refine = 500;
  std::filesystem::path data;
  std::size_t compare = 10;
  std::size_t threads = 0;
  std::filesystem::path json;
};

/// Properties of the model that the file cannot hold, one sentence each: viewers will show something else.
template <class R>
std::vector<std::string> export_warnings(const Model<R>& model, const ModelInfo& info) {
  std::vector<std::string> warnings;
  const auto number = [](double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", x);
    return std::string(text);
  };
  bool filtered = false;
  if constexpr (requires { typename R::Rasterizer::EffectPolicy::Filter; })
    filtered = R::Rasterizer::EffectPolicy::Filter::active;
  if (filtered) {
    warnings.push_back("the model was trained with the mip filter (a blur of " + number(model.render.blur_variance) +
                       " pixels^2 that keeps the energy of a splat), but a PLY file cannot say so. Viewers "
                       "that blur every splat by 0.3 pixels^2 without keeping its energy draw small and "
                       "distant splats too large and too bright: SIBR and antimatter15/splat always do, "
                       "gsplat, SuperSplat and Brush do unless their antialiased or mip mode is on");
  } else if (model.render.blur_variance != 0.3) {
    warnings.push_back("the model was trained with a blur of " + number(model.render.blur_variance) +
                       " pixels^2, but viewers use 0.3");
  }
  if constexpr (!std::is_same_v<RecipeLens<R>, PinholeLens>) {
    warnings.push_back(
        "the model was trained through a lens, but viewers have none: the export is fitted "
        "and measured without distortion");
  }
  if (info.origin != std::array<double, 3>{0, 0, 0}) {
    warnings.push_back("positions are relative to (" + number(info.origin[0]) + ", " + number(info.origin[1]) + ", " +
                       number(info.origin[2]) + ") of the dataset's coordinates, which single precision cannot hold");
  }
  if (!info.views.empty() && std::all_of(info.views.begin(), info.views.end(), [](const auto& v) { return v.test; }))
    warnings.push_back("the file stores no training camera: colours are fitted over its test views");
  return warnings;
}

/// A table with its lengths in the dataset's unit (ModelInfo::unit), as a file holds them.
SplatTable in_unit(SplatTable table, double unit) {
  const float stretch = static_cast<float>(std::log(unit));
  for (std::vector<float>& column : table.mean) {
    for (float& x : column) x = static_cast<float>(static_cast<double>(x) * unit);
  }
  for (std::vector<float>& column : table.log_scale) {
    for (float& x : column) x += stretch;
  }
  return table;
}

/// Anchors with their lengths in the dataset's unit.
Result<Done> write_anchors(const ExportOptions& options, AnchorColumns<const float> columns, double unit,
                           std::span<const std::string> comments) {
  std::vector<float> position(columns.position.data, columns.position.data + columns.position.size());
  std::vector<float> scaling(columns.scaling.data, columns.scaling.data + columns.scaling.size());
  if (unit != 1) {
    for (float& x : position) x = static_cast<float>(static_cast<double>(x) * unit);
    for (float& x : scaling) x += static_cast<float>(std::log(unit));
    columns.position.data = position.data();
    columns.scaling.data = scaling.data();
  }
  return write_anchor_ply(options.out, columns, comments);
}

template <class R>
int run(const ExportOptions& options, const ModelSource& source) {
  Result<LoadedModel<R>> loaded = source.load<R>();
  if (!loaded) return fail(loaded.error());
  const Model<R>& model = loaded->model;
  const std::filesystem::path folder = options.out.has_parent_path() ? options.out.parent_path() : ".";
  if (!std::filesystem::is_directory(folder)) {  // said now, not after minutes of fitting
    return fail({ErrorKind::unwritable, options.out.string(), "--out", "its folder does not exist", "create it first"});
  }
  if (std::is_same_v<RecipeLens<R>, FisheyeLens<float>> && !options.data.empty()) {
    return fail({ErrorKind::unsupported, options.model.string(), "--data",
                 "is through a fisheye lens, which an export does not have, so that the two cannot be "
                 "compared",
                 "leave out --data"});
  }
  const std::vector<std::string> warnings = export_warnings(model, loaded->info);
  for (const std::string& warning : warnings) std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
  nlohmann::ordered_json json{{"schema", "compmark.export.1"},
                              {"format", options.kind},
                              {"recipe", loaded->info.recipe},
                              {"warnings", warnings},
                              {"anchors", model.anchor_count()}};
  const auto finish = [&]() -> int {
    if (options.json.empty()) return success;
    const Result<Done> written = write_file(options.json, json.dump(2) + "\n");
    return written ? static_cast<int>(success) : fail(written.error());
  };
  const std::vector<std::string> comments{"compmark " + options.kind + " export"};
  if (options.kind == "anchors") {
    if (Result<Done> written = write_anchors(options, model.columns(), loaded->info.unit, comments); !written)
      return fail(written.error());
    std::printf("%s: %zu anchors in the layout of the Scaffold family (the networks stay in %s)\n",
                options.out.string().c_str(), model.anchor_count(), options.model.string().c_str());
    return finish();
  }

  std::vector<Camera<double>> train;
  std::vector<Camera<double>> measured;
  std::vector<std::string> names;
  const StoredView* chosen = nullptr;
  const bool has_test =
      std::any_of(loaded->info.views.begin(), loaded->info.views.end(), [](const StoredView& v) { return v.test; });
  for (const StoredView& view : loaded->info.views) {
    if (view.name == options.view) chosen = &view;
    if (!view.test) train.push_back(view.camera);
    if (view.test == has_test) {
      measured.push_back(view.camera);
      names.push_back(view.name);
    }
  }
  if (train.empty()) train = measured;  // a compressed file keeps the test views alone unless it was told otherwise
  if (train.empty())
    return fail({ErrorKind::invalid, options.model.string(), "views", "the model stores no camera",
                 "train the model again with this version"});

  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);
  SplatTable table;
  if (!options.view.empty()) {
    if (chosen == nullptr) {
      return fail({ErrorKind::invalid, options.model.string(), "--view",
                   "the model has no view \"" + options.view + "\"", "see the names with compmark info --views"});
    }
    table = bake_at_camera(model, chosen->camera, unseen_view, executor);
    measured.assign(1, chosen->camera);
    names.assign(1, chosen->name);
  } else {
    ShFitSettings settings;
    settings.degree = options.degree;
    ShFitReport report;
    table = fit_splats(model, std::span<const Camera<double>>(train), settings, report, executor);
    std::printf("fitted %zu of %zu slots over %zu cameras (%zu faint, %zu unseen), colour residual %.4f\n", report.kept,
                report.slots, train.size(), report.faint, report.unseen, report.color_rms);
    if (options.refine > 0) {
      SplatRefineSettings refine;
      refine.iterations = options.refine;
      const SplatRefineReport refined =
          refine_splats(model, table, std::span<const Camera<double>>(train), refine, executor);
      std::printf("refined in %d iterations: mean square distance to the model's renders %.2e -> %.2e\n",
                  options.refine, refined.first_mse, refined.last_mse);
    }
  }
  const double unit = loaded->info.unit;
  const Result<Done> written =
      unit == 1 ? write_splat_ply(options.out, table) : write_splat_ply(options.out, in_unit(table, unit));
  if (!written) return fail(written.error());
  std::printf("%s: %zu Gaussians, SH degree %d\n", options.out.string().c_str(), static_cast<std::size_t>(table.count),
              options.view.empty() ? options.degree : 0);

  json["gaussians"] = static_cast<std::size_t>(table.count);
  if (options.compare == 0) return finish();
  const std::size_t stride = std::max<std::size_t>(1, measured.size() / options.compare);
  std::vector<Camera<double>> cameras;
  std::vector<std::string> compared;
  for (std::size_t i = 0; i < measured.size(); i += stride) {
    cameras.push_back(measured[i]);
    compared.push_back(names[i]);
  }
  Result<BakeReport> report = BakeReport{};
  if (options.data.empty()) {
    report = compare_bake(model, table, std::span<const Camera<double>>(cameras), NoTargets{}, unseen_view, executor);
  } else {
    DatasetSettings settings = settings_of(loaded->info);
    for (std::size_t c = 0; c < 3; ++c) settings.background[c] = static_cast<float>(model.render.background[c]);
    if (settings.lens == LensTreatment::keep) settings.lens = LensTreatment::undistort;  // the export has none
    Result<Dataset> dataset = open_for(loaded->info, options.data, settings);
    if (!dataset) return fail(dataset.error());
    ImageStore store(*dataset, settings, {});
    const auto target = [&](std::size_t i, ImageView<float> image) -> Result<Done> {
      for (const View& view : dataset->views) {
        if (view.name == compared[i] && view.camera.width == image.width && view.camera.height == image.height)
          return store.load(view, image);
      }
      return Error{ErrorKind::not_found, options.data.string(), "view",
                   "no view \"" + compared[i] + "\" of the model's size", "give the dataset the model was trained on"};
    };
    report = compare_bake(model, table, std::span<const Camera<double>>(cameras), target, unseen_view, executor);
  }
  if (!report) return fail(report.error());
  std::printf("against the model's own renders: PSNR %.2f dB mean, %.2f dB worst (%s), over %zu views\n",
              report->mean_bake_to_model, report->worst_bake_to_model, compared[report->worst_view].c_str(),
              cameras.size());
  json["views"] = cameras.size();
  json["psnr_to_model"] = {{"mean", report->mean_bake_to_model}, {"worst", report->worst_bake_to_model}};
  if (!options.data.empty()) {
    std::printf("against the photographs: model %.2f dB, export %.2f dB, loss of the bake %.2f dB\n",
                report->mean_model_to_target, report->mean_bake_to_target, report->loss());
    json["psnr_to_photographs"] = {{"model", report->mean_model_to_target}, {"export", report->mean_bake_to_target}};
  }
  return finish();
}

}  // namespace

Command add_export(Options& app) {
  auto options = std::make_shared<ExportOptions>();
  app.reads("--model", options->model, InputKind::model, "model.safetensors of a run, or a compressed .cmk")
      ->required();
  app.writes("--out", options->out, OutputKind::splats, "PLY file to write")->required();
  app.word("--format", options->kind, "splat (standard 3DGS PLY) or anchors (Scaffold layout)")
      ->capture_default_str()
      ->check(CLI::IsMember({"splat", "anchors"}));
  app.word("--view", options->view, "bake exactly for this stored view instead of fitting over all training views");
  app.number("--sh-degree", options->degree, WholeRange{0, 3}, "degree of the fitted colour")->capture_default_str();
  app.number("--refine", options->refine, WholeRange{0, 1000000},
             "iterations that refine the fitted splats to match renders of the model; 0: none")
      ->capture_default_str();
  app.reads("--data", options->data, InputKind::dataset, "dataset; reports the loss against its photographs too");
  app.number("--compare", options->compare, any_count, "number of views to measure the loss on; 0: none")
      ->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all")->capture_default_str();
  app.writes("--json", options->json, OutputKind::words, "write counts, figures and warnings to this file");
  return [options]() -> int {
    const Result<ModelSource> source = open_source(options->model, options->threads);
    if (!source) return fail(source.error());
    return with_reading_recipe(
        source->recipe, ExitCode([&](auto tag) { return run<typename decltype(tag)::Recipe>(*options, *source); }));
  };
}

}  // namespace tool
