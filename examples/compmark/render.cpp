// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark render: PNG images of a model, from the cameras it was trained with (stored in the model) or from those of a
// dataset.
#include <algorithm>
#include <chrono>
#include <compmark/app/capture.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/file_identity.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/scene/open.hpp>
#include <cstdio>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "common.hpp"
#include "model_files.hpp"
#include "run_folder.hpp"
#include "view_files.hpp"

namespace tool {
namespace {

using namespace compmark;

struct RenderOptions {
  std::filesystem::path model;
  std::filesystem::path out;
  std::filesystem::path data;
  std::string split = "test";
  std::vector<std::string> names;
  double downscale = 1;
  std::size_t threads = 0;
};

/// Checks that no render replaces an input, and that none lies among the photographs.
Result<Done> check_outputs(const RenderOptions& options, const std::vector<std::filesystem::path>& files,
                           const std::optional<Dataset>& dataset) {
  FileUse use;
  use.read(options.model, "--model", InputKind::model);
  use.read(options.data, "--data", InputKind::dataset);
  for (const std::filesystem::path& file : files) use.write(file, "--out");
  // Photographs must stay even if this command does not read them.
  std::error_code status;
  std::filesystem::path folder = std::filesystem::absolute(options.out, status);
  for (int up = 0; up < 3 && folder.has_relative_path(); ++up, folder = folder.parent_path()) {
    for (const char* sign : {"transforms.json", "transforms_train.json", "poses_bounds.npy", "sparse", "images"}) {
      if (!std::filesystem::exists(folder / sign, status)) continue;
      use.read(folder, "a training", InputKind::dataset);
      break;
    }
  }
  if (Result<Done> safe = check_file_use(use); !safe || !dataset || dataset->pictures) return safe;
  std::set<std::filesystem::path> folders;
  for (const View& view : dataset->views) {
    for (const std::filesystem::path& path : {view.image_path, view.mask_path}) {
      if (!path.empty()) folders.insert(path.parent_path());
    }
  }
  for (const std::filesystem::path& photographs : folders) {
    if (!same_file(photographs, options.out)) continue;
    return Error{ErrorKind::invalid, options.out.string(), "--out", "is the folder of photographs that --data reads",
                 "choose another folder, so that renders are not taken for photographs later"};
  }
  return Done{};
}

int run(const RenderOptions& options) {
  Result<AnyModel> model = load_model(options.model, options.threads);
  if (!model) return fail(model.error());
  ThreadExecutor executor(options.threads);
  std::vector<StoredView> views = model->info().views;
  std::optional<Dataset> opened;
  if (!options.data.empty()) {
    DatasetSettings settings = settings_of(model->info());
    settings.downscale = options.downscale;
    Result<Dataset> dataset = open_for(model->info(), options.data, settings, executor);
    if (!dataset) return fail(dataset.error());
    views.clear();
    for (const View& view : dataset->views) views.push_back(stored_view(view));
    opened = std::move(*dataset);
  } else if (options.downscale != 1) {
    for (StoredView& view : views) {
      view.camera = view.camera.resized(std::max(1, static_cast<int>(view.camera.width / options.downscale)),
                                        std::max(1, static_cast<int>(view.camera.height / options.downscale)));
    }
  }
  for (const std::string& name : options.names) {
    if (std::none_of(views.begin(), views.end(), [&](const StoredView& view) { return view.name == name; })) {
      return fail({ErrorKind::invalid, options.data.empty() ? options.model.string() : options.data.string(), "--view",
                   "no view is called \"" + name + "\"",
                   options.data.empty() ? "compmark info --views lists them" : "give a name of this dataset"});
    }
  }
  // Of all views, so that a view has one name whichever are rendered.
  std::vector<std::string> called;
  for (const StoredView& view : views) called.push_back(view.name);
  const std::vector<std::string> names = view_files(called);
  std::vector<std::pair<StoredView, std::filesystem::path>> wanted;
  for (std::size_t i = 0; i < views.size(); ++i) wanted.emplace_back(views[i], options.out / names[i]);
  std::erase_if(wanted, [&](const auto& entry) {
    const StoredView& view = entry.first;
    if (!options.names.empty())
      return std::find(options.names.begin(), options.names.end(), view.name) == options.names.end();
    return options.split == "test" ? !view.test : options.split == "train" ? view.test : false;
  });
  if (wanted.empty()) {
    return fail({ErrorKind::invalid, options.model.string(), "--split", "\"" + options.split + "\" selects no view",
                 "compmark info --views lists what there is, and --data takes the cameras of a dataset"});
  }
  std::vector<std::filesystem::path> files;
  for (const auto& [view, file] : wanted) files.push_back(file);
  if (Result<Done> safe = check_outputs(options, files, opened); !safe) return fail(safe.error());
  const Result<std::shared_ptr<const void>> held = hold_folder(options.out);
  if (!held) return fail(held.error());
  for (const auto& [view, file] : wanted) {
    if (file.stem().string() == view_stem(view.name)) continue;
    std::fprintf(stderr,
                 "compmark: note: view \"%s\" is written as %s, because another view has the same name"
                 " without its ending\n",
                 view.name.c_str(), file.filename().string().c_str());
  }

  tell_threads(executor, options.threads);
  std::vector<double> milliseconds;
  for (const auto& [view, path] : wanted) {
    const auto begin = std::chrono::steady_clock::now();
    const Result<RenderedView> render = model->render(view.camera, view.lens, executor);
    if (!render) return fail(render.error());
    const RenderedView& rendered = *render;
    milliseconds.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
    round_to_8bit<float>(rendered.image, rendered.image);
    if (Result<Done> written = write_png(path, rendered.image); !written) return fail(written.error());
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  std::printf("%zu views in %s, median %.1f ms a view\n", wanted.size(), options.out.string().c_str(),
              milliseconds[milliseconds.size() / 2]);
  return success;
}

}  // namespace

Command add_render(Options& app) {
  auto options = std::make_shared<RenderOptions>();
  app.reads("--model", options->model, InputKind::model,
            "model.safetensors of a run, a compressed .cmk, or a splat file")
      ->required();
  app.writes_into("--out", options->out, "folder for the PNG images")->required();
  app.reads("--data", options->data, InputKind::dataset,
            "take the cameras from this dataset instead of from the model");
  app.word("--split", options->split, "test, train or all")
      ->capture_default_str()
      ->check(CLI::IsMember({"test", "train", "all"}));
  app.words("--view", options->names, "names of the views to render (default: the whole split)");
  app.number("--downscale", options->downscale, downscale_range, "divide the images' size by this")
      ->capture_default_str();
  app.number("--threads", options->threads, thread_range, "0: all")->capture_default_str();
  app.also([](FileUse&) {});  // the names come with the views: check_outputs
  return [options]() -> int { return run(*options); };
}

}  // namespace tool
