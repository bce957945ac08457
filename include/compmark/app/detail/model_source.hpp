// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/model_source.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <fstream>
#include <memory>
#include <system_error>
#include <utility>

#include "compmark/app/model_source.hpp"
#include "compmark/codec/container/cmk.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/core/absent.hpp"

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

COMPMARK_APP_INLINE Result<ModelSource> ModelSource::open(const std::filesystem::path& path, ThreadExecutor& executor) {
  ModelSource source;
  source.path = path;
  if (is_coded_file(path)) {
    Result<CodecDecoded> decoded = read_cmk(path, CodecDecodeSettings{}, executor);
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
  Result<SafetensorsFile> file = read_safetensors(path, FileKind::model);
  if (!file) return file.error();
  Result<std::string> recipe = model_recipe(*file);
  if (!recipe) return recipe.error();
  source.recipe = std::move(*recipe);
  source.file = std::make_shared<const SafetensorsFile>(std::move(*file));
  return source;
}

template <class R>
Result<LoadedModel<R>> ModelSource::load() const {
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
