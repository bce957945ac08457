// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/export.hpp. Longer than 300 lines: an export is these steps, one after the other.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/capture.hpp"
#include "compmark/app/detail/export_warnings.hpp"
#include "compmark/app/detail/keep_evenly.hpp"
#include "compmark/app/export.hpp"
#include "compmark/app/recipe_model.hpp"
#include "compmark/core/config.hpp"
#include "compmark/io/anchor_ply.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/splat/read_splat.hpp"
#include "compmark/io/splat/viewer_page.hpp"
#include "compmark/io/splat/write_splat.hpp"
#include "compmark/scene/image_store.hpp"
#include "compmark/scene/open.hpp"
#include "compmark/scene/up_axes.hpp"
#include "compmark/splat/export/explicit_splats.hpp"

namespace compmark {
namespace detail {

/// A table with its lengths in the dataset's unit (ModelInfo::unit), as a file holds them.
inline SplatTable in_unit(SplatTable table, double unit) {
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
inline Result<Done> write_anchors(const std::filesystem::path& out, AnchorColumns<const float> columns, double unit,
                                  std::span<const std::string> comments) {
  std::vector<float> position(columns.position.data, columns.position.data + columns.position.size());
  std::vector<float> scaling(columns.scaling.data, columns.scaling.data + columns.scaling.size());
  if (unit != 1) {
    for (float& x : position) x = static_cast<float>(static_cast<double>(x) * unit);
    for (float& x : scaling) x += static_cast<float>(std::log(unit));
    columns.position.data = position.data();
    columns.scaling.data = scaling.data();
  }
  return write_anchor_ply(out, columns, comments);
}

/// The file that the model was read from, for errors.
struct Exported {
  const std::filesystem::path& file;
  const std::filesystem::path& out;
  const ExportSettings& settings;
  ExportObserver& observer;
};

/// The stored views that are fitted over and those that are measured.
struct ExportViews {
  std::vector<Camera<double>> train, measured;
  std::vector<std::string> names;      ///< of the measured ones
  bool held_out = false;               ///< the measured ones are not fitted over
  const StoredView* chosen = nullptr;  ///< ExportSettings::view
};
[[nodiscard]] inline ExportViews export_views(const ModelInfo& info, const std::string& wanted) {
  ExportViews views;
  const bool has_test = std::any_of(info.views.begin(), info.views.end(), [](const StoredView& v) { return v.test; });
  for (const StoredView& view : info.views) {
    if (view.name == wanted) views.chosen = &view;
    if (!view.test) views.train.push_back(view.camera);
    if (view.test == has_test) {
      views.measured.push_back(view.camera);
      views.names.push_back(view.name);
    }
  }
  views.held_out = has_test && !views.train.empty();
  // A compressed file keeps the test views alone unless it was told otherwise.
  if (views.train.empty()) views.train = views.measured;
  return views;
}

/// The views that are measured, and the photographs of them, if there are data.
struct Measured {
  std::vector<Camera<double>> cameras;
  std::vector<std::string> names;
  DatasetSettings settings;
  std::optional<Dataset> dataset;
  std::vector<const View*> photographs;  ///< of the dataset
};

/// Of ExportSettings::compare views, evenly spaced. What the data lack is found here, before minutes of fitting.
template <class R>
[[nodiscard]] Result<Measured> open_measured(const Exported& of, const Model<R>& model, const ModelInfo& info,
                                             const ExportViews& views, ThreadExecutor& executor) {
  Measured measured;
  if (of.settings.compare == 0) return measured;
  measured.cameras = views.measured;
  measured.names = views.names;
  keep_evenly(measured.cameras, of.settings.compare);
  keep_evenly(measured.names, of.settings.compare);
  const std::filesystem::path& data = of.settings.data;
  if (data.empty()) return measured;
  DatasetSettings& settings = measured.settings = settings_of(info);
  settings.downscale = of.settings.downscale;
  for (std::size_t c = 0; c < 3; ++c) settings.background[c] = static_cast<float>(model.render.background[c]);
  if (settings.lens == LensTreatment::keep) settings.lens = LensTreatment::undistort;  // the export has none
  Result<Dataset> dataset = open_for(info, data, settings, executor);
  if (!dataset) return dataset.error();
  measured.dataset = std::move(*dataset);
  for (std::size_t i = 0; i < measured.names.size(); ++i) {
    const Camera<double>& camera = measured.cameras[i];
    const auto found =
        std::find_if(measured.dataset->views.begin(), measured.dataset->views.end(), [&](const View& view) {
          return view.name == measured.names[i] && view.camera.width == camera.width &&
                 view.camera.height == camera.height;
        });
    if (found == measured.dataset->views.end()) {
      return Error{ErrorKind::not_found, data.string(), "view",
                   "no view \"" + measured.names[i] + "\" of the model's size, " + std::to_string(camera.width) +
                       " x " + std::to_string(camera.height) + " pixels",
                   "give the dataset the model was trained on, and the --downscale of the training"};
    }
    measured.photographs.push_back(&*found);
  }
  return measured;
}

/// The table against the model's own renders and, with data, the photographs.
template <class R>
[[nodiscard]] Result<BakeReport> compare_export(const Measured& measured, const Model<R>& model,
                                                const SplatTable& table, ThreadExecutor& executor) {
  const std::span<const Camera<double>> cameras(measured.cameras);
  if (!measured.dataset) return compare_bake(model, table, cameras, {}, unseen_view, executor);
  ImageStore store(*measured.dataset, measured.settings, {});
  const auto target = [&](std::size_t i, ImageView<float> image) -> Result<Done> {
    return store.load(*measured.photographs[i], image);
  };
  return compare_bake(model, table, cameras, target, unseen_view, executor);
}

/// The file, read back, against the model's own renders.
template <class R>
[[nodiscard]] Result<BakeReport> compare_file(const Exported& of, const Model<R>& model, double unit,
                                              std::span<const Camera<double>> cameras, ThreadExecutor& executor) {
  Result<SplatFile> file = read_splat(of.out);
  if (!file) return file.error();
  const SplatTable table = unit == 1 ? std::move(file->table) : in_unit(std::move(file->table), 1 / unit);
  return compare_bake(model, table, cameras, {}, unseen_view, executor);
}

/// Fits over all cameras of the training, and refines.
template <class R>
[[nodiscard]] Result<SplatTable> fitted_table(const Exported& of, const Model<R>& model, const ExportViews& views,
                                              ExportReport& report, ThreadExecutor& executor) {
  const ExportSettings& settings = of.settings;
  const std::span<const Camera<double>> train(views.train);
  ShFitSettings fit;
  fit.degree = settings.degree;
  report.cameras = train.size();
  Result<SplatTable> table = fit_splats(model, train, fit, report.fit.emplace(), executor);
  if (!table) return table.error();
  of.observer.on_fitted(report);
  if (settings.refine > 0) {
    SplatRefineSettings refine;
    refine.iterations = settings.refine;
    Result<SplatRefineReport> refined = refine_splats(model, *table, train, refine, executor);
    if (!refined) return refined.error();
    report.refined = std::move(*refined);
    of.observer.on_refined(report);
  }
  return table;
}

/// Bakes or fits; the report and the observer are told of a fit. Explicit Gaussians are written as they are, but for
/// harmonics above the degree that is asked for.
template <class R>
[[nodiscard]] Result<SplatTable> exported_table(const Exported& of, const Model<R>& model, const ExportViews& views,
                                                ExportReport& report, ThreadExecutor& executor) {
  const ExportSettings& settings = of.settings;
  if (!settings.view.empty()) return bake_at_camera(model, views.chosen->camera, unseen_view, executor);
  if constexpr (ExplicitModelRecipe<R>) {
    SplatTable table = explicit_splats(model);
    table.limit_degree(settings.degree);
    return table;
  } else {
    return fitted_table(of, model, views, report, executor);
  }
}

/// A page of the splats; up is where the model's cameras have it.
[[nodiscard]] inline Result<Done> write_page(const Exported& of, const SplatTable& table, const ModelInfo& info,
                                             double near_plane) {
  ViewerPage page;
  page.title = of.out.stem().string();
  page.near_plane = near_plane * info.unit;
  for (const StoredView& view : info.views) {
    Camera<double>& camera = page.cameras.emplace_back(view.camera);
    for (double& x : camera.center_world) x *= info.unit;
  }
  page.up = up_of_cameras(page.cameras).value_or(usual_up);
  return write_viewer_page(of.out, table, page);
}

/// What is up in the cameras of a model, for who reads the file. Nothing where nobody knows: where the cameras were
/// made up round splats, and their file did not say it.
[[nodiscard]] inline std::optional<std::array<double, 3>> known_up(const ModelInfo& info) {
  if (cameras_are_made_up(info)) return info.up;
  std::vector<Camera<double>> cameras;
  for (const StoredView& view : info.views) cameras.push_back(view.camera);
  return up_of_cameras(cameras);
}

template <class R>
[[nodiscard]] COMPMARK_ONCE Result<ExportReport> export_typed(const Exported& of, const Model<R>& model,
                                                              const ModelInfo& info, ThreadExecutor& executor) {
  const ExportSettings& settings = of.settings;
  if (settings.degree < 0 || settings.degree > max_sh_degree) {
    return Error{ErrorKind::invalid, of.out.string(), "--sh-degree",
                 "is " + std::to_string(settings.degree) + ", and an export has harmonics of degree 0 to " +
                     std::to_string(max_sh_degree),
                 "give one of those"};
  }
  const std::filesystem::path folder = of.out.has_parent_path() ? of.out.parent_path() : ".";
  if (!folder_exists(folder)) {  // said now, not after minutes of fitting
    return Error{ErrorKind::unwritable, of.out.string(), "--out", "its folder does not exist", "create it first"};
  }
  if (std::is_same_v<RecipeLens<R>, FisheyeLens<float>> && !settings.data.empty()) {
    return Error{ErrorKind::unsupported, of.file.string(), "--data",
                 "is through a fisheye lens, which an export does not have, so that the two cannot be compared",
                 "leave out --data"};
  }
  SplatWriteSettings file = settings.file;
  if (settings.kind == ExportKind::splats && !file.format) {
    const Result<SplatFormat> named = splat_format_of_name(of.out);
    if (!named) {
      Error error = named.error();
      error.field = "--out";
      return error;
    }
    file.format = *named;
  }
  file.antialiased = file.antialiased || draws_filtered<R>();
  ExportReport report;
  report.warnings = export_warnings(model, info, file.format && tells_filter(*file.format));
  report.anchors = model.anchor_count();
  if (settings.kind == ExportKind::anchors) {
    if (std::string masked = masked_offsets_warning(model); !masked.empty())
      report.warnings.push_back(std::move(masked));
  }
  of.observer.on_begin(report);
  if (settings.kind == ExportKind::anchors) {
    if (ExplicitModelRecipe<R>) {
      return Error{ErrorKind::unsupported, of.file.string(), "--format", "holds splats, which have no anchors",
                   "export it as splats"};
    }
    const std::vector<std::string> comments{"compmark anchors export"};
    if (Result<Done> written = write_anchors(of.out, model.columns(), info.unit, comments); !written)
      return written.error();
    of.observer.on_written(report);
    return report;
  }
  ExportViews views = export_views(info, settings.view);
  if (views.train.empty()) {
    return Error{ErrorKind::invalid, of.file.string(), "views", "the model stores no camera",
                 "train the model again with this version"};
  }
  if (!settings.view.empty()) {
    if (views.chosen == nullptr) {
      return Error{ErrorKind::invalid, of.file.string(), "--view", "the model has no view \"" + settings.view + "\"",
                   "see the names with compmark info --views"};
    }
    views.measured.assign(1, views.chosen->camera);
    views.names.assign(1, views.chosen->name);
  }
  const Result<Measured> measured = open_measured(of, model, info, views, executor);
  if (!measured) return measured.error();
  const Result<SplatTable> made = exported_table(of, model, views, report, executor);
  if (!made) {
    Error error = made.error();
    if (error.file.empty()) error.file = of.file.string();
    return error;
  }
  const SplatTable& table = *made;
  const SplatTable scaled = info.unit == 1 ? SplatTable() : in_unit(table, info.unit);
  const SplatTable& in_file = info.unit == 1 ? table : scaled;
  report.degree = table.degree;
  if (settings.kind == ExportKind::page) {
    if (const Result<Done> written = write_page(of, in_file, info, model.render.near_plane); !written)
      return written.error();
  } else {
    if (const std::optional<std::array<double, 3>> up = known_up(info)) file.comments.push_back(splat_up_comment(*up));
    Result<SplatWritten> written = write_splat(of.out, in_file, file, executor);
    if (!written) return written.error();
    report.written = std::move(*written);
    if (report.written->format == SplatFormat::splat) report.degree = 0;
  }
  report.gaussians = static_cast<std::size_t>(table.count);
  report.held_out = settings.view.empty() && (views.held_out || ExplicitModelRecipe<R>);
  of.observer.on_written(report);
  if (settings.compare == 0) return report;
  report.compared_views = measured->names;
  Result<BakeReport> compared = compare_export(*measured, model, table, executor);
  if (!compared) return compared.error();
  report.compared = std::move(*compared);
  if (!report.written || report.written->format == SplatFormat::ply || report.written->bytes == 0) return report;
  Result<BakeReport> from_file =
      compare_file(of, model, info.unit, std::span<const Camera<double>>(measured->cameras), executor);
  if (!from_file) return from_file.error();
  report.from_file = std::move(*from_file);
  return report;
}

}  // namespace detail

COMPMARK_APP_INLINE Result<ExportReport> export_model(AnyModel& model, const std::filesystem::path& out,
                                                      const ExportSettings& settings, ThreadExecutor& executor,
                                                      ExportObserver& observer) {
  const detail::Exported of{model.file(), out, settings, observer};
  return with_model(model, [&](const auto& typed) { return detail::export_typed(of, typed, model.info(), executor); });
}
COMPMARK_APP_INLINE Result<ExportReport> export_model(AnyModel& model, const std::filesystem::path& out,
                                                      const ExportSettings& settings, ThreadExecutor& executor) {
  ExportObserver silent;
  return export_model(model, out, settings, executor, silent);
}

}  // namespace compmark
