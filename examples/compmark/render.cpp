// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark render: PNG images of a model, from the cameras it was trained with (stored in the model) or from those of a dataset.
#include <algorithm>
#include <chrono>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/metric/rounding.hpp>
#include <compmark/scene/open.hpp>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "any_model.hpp"
#include "commands.hpp"
#include "common.hpp"
#include "effects.hpp"

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

std::string file_name(std::string name) {
  for (char& c : name) {
    if (c == '/' || c == '\\' || c == ':') c = '_';
  }
  const std::size_t dot = name.find_last_of('.');
  if (dot != std::string::npos && dot + 5 >= name.size()) name.resize(dot);
  while (!name.empty() && (name.front() == '.' || name.front() == '_')) name.erase(name.begin());
  return name.empty() ? "view" : name;
}

int run(const RenderOptions& options) {
  Result<std::unique_ptr<AnyModel>> model = load_model(options.model, options.threads);
  if (!model) return fail(model.error());
  std::vector<StoredView> views = (*model)->info.views;
  if (!options.data.empty()) {
    DatasetSettings settings = settings_of((*model)->info);
    settings.downscale = options.downscale;
    Result<Dataset> dataset = open_for((*model)->info, options.data, settings);
    if (!dataset) return fail(dataset.error());
    views.clear();
    for (const View& view : dataset->views) views.push_back(stored_view(view));
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
  std::erase_if(views, [&](const StoredView& view) {
    if (!options.names.empty())
      return std::find(options.names.begin(), options.names.end(), view.name) == options.names.end();
    return options.split == "test" ? !view.test : options.split == "train" ? view.test : false;
  });
  if (views.empty()) {
    return fail({ErrorKind::invalid, options.model.string(), "--split", "\"" + options.split + "\" selects no view",
                 "compmark info --views lists what there is, and --data takes the cameras of a dataset"});
  }
  if (Result<Done> folder = make_folder(options.out); !folder) return fail(folder.error());

  ThreadExecutor executor(options.threads);
  std::vector<double> milliseconds;
  for (const StoredView& view : views) {
    const auto begin = std::chrono::steady_clock::now();
    const Result<RenderedView> render = (*model)->render(view.camera, view.lens, executor);
    if (!render) return fail(render.error());
    const RenderedView& rendered = *render;
    milliseconds.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
    round_to_8bit<float>(rendered.image, rendered.image);
    const std::filesystem::path path = options.out / (file_name(view.name) + ".png");
    if (Result<Done> written = write_png(path, rendered.image); !written) return fail(written.error());
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  std::printf("%zu views in %s, median %.1f ms a view\n", views.size(), options.out.string().c_str(),
              milliseconds[milliseconds.size() / 2]);
  return success;
}

}  // namespace

Command add_render(CLI::App& app) {
  auto options = std::make_shared<RenderOptions>();
  app.add_option("--model", options->model, "model.safetensors of a run, or a compressed .cmk")->required();
  app.add_option("--out", options->out, "folder for the PNG images")->required();
  app.add_option("--data", options->data, "take the cameras from this dataset instead of from the model");
  app.add_option("--split", options->split, "test, train or all")
      ->capture_default_str()
      ->check(CLI::IsMember({"test", "train", "all"}));
  app.add_option("--view", options->names, "names of the views to render (default: the whole split)");
  app.add_option("--downscale", options->downscale, "divide the images' size by this")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 64.0));
  app.add_option("--threads", options->threads, "0: all")->capture_default_str();
  return [options]() -> int { return run(*options); };
}

}  // namespace tool
