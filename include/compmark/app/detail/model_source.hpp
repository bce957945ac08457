// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/model_source.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <fstream>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "compmark/app/model_source.hpp"
#include "compmark/codec/container/cmk.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/core/absent.hpp"
#include "compmark/io/splat/read_splat.hpp"
#include "compmark/scene/views_around.hpp"
#include "compmark/splat/export/explicit_splats.hpp"

namespace compmark {

COMPMARK_APP_INLINE bool is_coded_file(const std::filesystem::path& path) {
  std::error_code status;
  if (!std::filesystem::is_regular_file(path, status)) return false;  // a pipe would wait for its writer
  std::array<char, 8> begin{};
  std::ifstream file(path, std::ios::binary);
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  if (file.gcount() < 4) return false;
  for (std::size_t i = 0; i < 4; ++i) {  // what follows tells damage from another format, and is the reader's to judge
    if (static_cast<std::byte>(begin[i]) != static_cast<std::byte>(ContainerFormat::magic[i])) return false;
  }
  return true;
}

COMPMARK_APP_INLINE Result<ModelSource> ModelSource::open(const std::filesystem::path& path, ThreadExecutor& executor,
                                                          std::string* sha256) {
  ModelSource source;
  source.path = path;
  if (is_coded_file(path)) {
    Result<CodecDecoded> decoded = read_cmk(path, CodecDecodeSettings{}, executor, sha256);
    if (!decoded) return decoded.error();
    Result<std::string> recipe = model_recipe(decoded->model);
    if (!recipe) {
      Error error = recipe.error();
      error.file = path.string();
      return error;
    }
    source.recipe = std::move(*recipe);
    source.coded = std::move(decoded->model);
    return source;
  }
  if (is_splat_file(path)) {
    Result<SplatFile> splats = read_splat(path, sha256);
    if (!splats) return splats.error();
    source.recipe = "explicit";
    source.splats = std::make_shared<const SplatFile>(std::move(*splats));
    return source;
  }
  Result<SafetensorsFile> file = read_safetensors(path, FileKind::model);
  if (!file) return file.error();
  Result<std::string> recipe = model_recipe(*file);
  if (!recipe) return recipe.error();
  source.recipe = std::move(*recipe);
  if (sha256 != nullptr) *sha256 = file->sha256();
  source.file = std::make_shared<const SafetensorsFile>(std::move(*file));
  return source;
}

namespace detail {

/// The model of a splat file, with cameras round it; what is nearer than a tenth of its size is still drawn.
template <class R>
[[nodiscard]] Result<LoadedModel<R>> splat_model(const SplatFile& file) {
  const SplatTable& table = file.table;
  const SplatBulk bulk = splat_bulk(table);
  RenderSettings render;
  render.near_plane = std::min(render.near_plane, bulk.radius / 10);
  Result<Model<R>> model = model_from_splats<R>(table, render);
  if (!model) return model.error();
  LoadedModel<R> loaded{std::move(*model), {}};
  loaded.info.recipe = "explicit";
  loaded.info.profile = splats_profile;
  loaded.info.up = file.up;
  ViewsAround around;
  around.up = file.up.value_or(usual_up);
  for (const Camera<double>& camera : cameras_around(bulk, around)) {
    const std::string number = std::to_string(loaded.info.views.size());
    loaded.info.views.push_back({"around_" + std::string(number.size() < 2 ? "0" : "") + number, true, camera, {}});
  }
  return loaded;
}

}  // namespace detail

template <class R>
Result<LoadedModel<R>> ModelSource::load() const {
  if (splats) {
    if constexpr (ExplicitModelRecipe<R>) {
      return detail::splat_model<R>(*splats);
    } else {
      return Error{ErrorKind::unsupported, path.string(), "recipe", "is that of splats, which are explicit Gaussians",
                   "give a model of compmark train"};
    }
  }
  if (!coded) return model_from<R>(*file);
  if constexpr (present<typename R::EntropyModel>) {
    Result<LoadedModel<R>> loaded = model_from<R>(*coded);
    if (loaded) return loaded;
    Error error = loaded.error();
    error.file = path.string();
    return error;
  } else {
    return Error{ErrorKind::malformed, path.string(), "META.recipe",
                 "is " + recipe + ", which no compressed model is trained with", "encode the model again"};
  }
}

}  // namespace compmark
