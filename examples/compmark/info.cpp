// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark info: what a model file holds, and the digest that names it.
#include <compmark/io/safetensors.hpp>
#include <compmark/pipeline/model_file.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "common.hpp"

namespace tool {

Command add_info(CLI::App& app) {
  struct Options {
    std::filesystem::path model;
    bool views = false;
  };
  auto options = std::make_shared<Options>();
  app.add_option("model", options->model, "model.safetensors of a run")->required();
  app.add_flag("--views", options->views, "list the stored cameras");
  return [options]() -> int {
    using namespace compmark;
    Result<SafetensorsFile> file = read_safetensors(options->model);
    if (!file) return fail(file.error());
    Result<std::string> recipe = model_recipe(*file);
    if (!recipe) return fail(recipe.error());
    const nlohmann::json json = nlohmann::json::parse(*file->text_of("info"), nullptr, false);
    Result<ModelInfo> info = detail::read_info(*file, json);
    if (!info) return fail(info.error());
    Result<std::string> digest = file_sha256(options->model);
    if (!digest) return fail(digest.error());
    std::size_t bytes = 0;
    std::printf("%s\n  sha256      %s\n  recipe      %s (profile %s, %lld iterations, seed %llu)\n",
                options->model.string().c_str(), digest->c_str(), info->recipe.c_str(), info->profile.c_str(),
                static_cast<long long>(info->iterations), static_cast<unsigned long long>(info->seed));
    for (const auto& [name, tensor] : file->tensors) bytes += tensor.data.size();
    if (file->has("anchor.position"))
      std::printf("  anchors     %lld\n", static_cast<long long>(file->tensors.at("anchor.position").shape.at(0)));
    std::printf("  shape       %s\n  background  %s\n  views       %zu stored\n  tensors     %zu, %.2f MB\n",
                json.value("shape", nlohmann::json()).dump().c_str(),
                json.value("background", nlohmann::json()).dump().c_str(), info->views.size(), file->tensors.size(),
                static_cast<double>(bytes) * 1e-6);
    for (const auto& [name, tensor] : file->tensors) {
      std::string shape;
      for (const std::int64_t extent : tensor.shape) shape += (shape.empty() ? "" : " x ") + std::to_string(extent);
      std::printf("    %-28s %-4s %s\n", name.c_str(), tensor.dtype.c_str(), shape.c_str());
    }
    if (options->views) {
      for (const StoredView& view : info->views) {
        std::printf("    %-24s %-5s %d x %d, f = %.1f\n", view.name.c_str(), view.test ? "test" : "train",
                    view.camera.width, view.camera.height, view.camera.fx);
      }
    }
    return success;
  };
}

}  // namespace tool
