// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// compmark info: prints the contents of a model file, and its digest.
#include <bit>
#include <compmark/app/compress.hpp>
#include <compmark/app/files.hpp>
#include <compmark/codec/container/cmk.hpp>
#include <compmark/codec/container/container.hpp>
#include <compmark/codec/container/inspect.hpp>
#include <compmark/codec/model/coded_model.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/io/safetensors.hpp>
#include <compmark/io/splat/read_splat.hpp>
#include <compmark/scene/views_around.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "commands.hpp"
#include "common.hpp"
#include "model_files.hpp"

namespace tool {
namespace {

using namespace compmark;

void print_views(const ModelInfo& info) {
  for (const StoredView& view : info.views) {
    std::printf("    %-24s %-5s %d x %d, f = %.1f\n", view.name.c_str(), view.test ? "test" : "train",
                view.camera.width, view.camera.height, view.camera.fx);
  }
}

/// Header, sections and what is stored beside the anchors; the file is decoded, so what is printed was checked.
int info_of_coded(const std::filesystem::path& path, bool views) {
  const Result<std::vector<std::byte>> bytes = read_file(path);
  if (!bytes) return fail(bytes.error());
  const Result<Container> container = parse_container(*bytes, path.string());
  if (!container) return fail(container.error());
  ThreadExecutor executor(0);
  const Result<CodecDecoded> decoded = decode_model(*bytes, path.string(), CodecDecodeSettings{}, executor);
  if (!decoded) return fail(decoded.error());
  const Result<std::string> digest = file_sha256(path);
  if (!digest) return fail(digest.error());
  const CodecModel& model = decoded->model;
  const Result<ModelInfo> info = model_info(model);
  if (!info) {
    Error error = info.error();
    error.file = path.string();
    return fail(error);
  }
  std::size_t unmasked = 0;
  for (const std::uint32_t mask : model.mask) unmasked += static_cast<std::size_t>(std::popcount(mask));
  std::printf(
      "%s\n  sha256      %s\n  codec       %s, %zu bytes, every section and the decoded "
      "model verified\n  recipe      %s (profile %s, %lld iterations, seed %llu)\n  anchors"
      "     %zu with %zu unmasked offsets\n  cell size   %g\n  views       %zu stored\n  "
      "sections\n",
      path.string().c_str(), digest->c_str(), codec_name(model.profile()), bytes->size(), info->recipe.c_str(),
      info->profile.c_str(), static_cast<long long>(info->iterations), static_cast<unsigned long long>(info->seed),
      model.anchors(), unmasked, model.voxel_size, info->views.size());
  std::map<std::string, std::pair<std::size_t, std::uint64_t>> sections;
  for (const SectionEntry& entry : container->sections) {
    auto& [count, size] = sections[section_name(entry.kind)];
    ++count;
    size += entry.size;
  }
  for (const auto& [name, found] : sections) {
    std::printf("    %s %6zu %10llu bytes\n", name.c_str(), found.first, static_cast<unsigned long long>(found.second));
  }
  const std::vector<CodecLevel> levels = codec_levels(*container);
  for (std::size_t i = 0; levels.size() > 1 && i < levels.size(); ++i) {
    std::printf("  level %zu     %llu anchors, there after %llu bytes\n", levels.size() - 1 - i,
                static_cast<unsigned long long>(levels[i].anchors), static_cast<unsigned long long>(levels[i].end));
  }
  if (views) print_views(*info);
  return success;
}

/// Splats of another program: what the file holds and how large the scene is.
int info_of_splats(const std::filesystem::path& path) {
  const Result<SplatFile> file = read_splat(path);
  if (!file) return fail(file.error());
  const Result<std::string> digest = file_sha256(path);
  if (!digest) return fail(digest.error());
  const SplatTable& table = file->table;
  const SplatBulk bulk = splat_bulk(table);
  std::error_code status;
  const std::uintmax_t bytes = std::filesystem::file_size(path, status);
  const std::string version = file->format == SplatFormat::ksplat ? ", level " + std::to_string(file->version)
                              : file->version != 0                ? ", version " + std::to_string(file->version)
                                                                  : "";
  std::printf(
      "%s\n  sha256      %s\n  format      %s%s, %ju bytes, read whole\n  splats      %zu, spherical harmonics of "
      "degree %d\n  middle      %g %g %g\n  size        %g (radius that holds four in five of the opaque splats)\n",
      path.string().c_str(), digest->c_str(), std::string(splat_format_name(file->format)).c_str(), version.c_str(),
      bytes, table.count, table.degree, bulk.center[0], bulk.center[1], bulk.center[2], bulk.radius);
  tell_notes(*file);
  return success;
}

}  // namespace

Command add_info(Options& app) {
  struct Told {
    std::filesystem::path model;
    bool views = false;
  };
  auto options = std::make_shared<Told>();
  app.reads("model", options->model, InputKind::model, "model.safetensors of a run, a compressed .cmk, or a splat file")
      ->required();
  app.flag("--views", options->views, "list the stored cameras");
  return [options]() -> int {
    if (is_coded_file(options->model)) return info_of_coded(options->model, options->views);
    if (is_splat_file(options->model)) return info_of_splats(options->model);
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
    if (info->unit != 1) std::printf("  unit        %.10g of the dataset's lengths\n", info->unit);
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
    if (options->views) print_views(*info);
    return success;
  };
}

}  // namespace tool
