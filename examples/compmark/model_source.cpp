// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "model_source.hpp"

#include <array>
#include <compmark/codec/cmk.hpp>
#include <compmark/core/thread_executor.hpp>
#include <cstddef>
#include <fstream>
#include <utility>

namespace tool {

using namespace compmark;

bool is_coded_file(const std::filesystem::path& path) {
  std::array<char, 8> begin{};
  std::ifstream file(path, std::ios::binary);
  file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  if (file.gcount() < 4) return false;
  for (std::size_t i = 0; i < 4; ++i) {  // what follows tells damage from another format, and is the reader's to judge
    if (static_cast<std::byte>(begin[i]) != static_cast<std::byte>(ContainerFormat::magic[i])) return false;
  }
  return true;
}

Result<ModelSource> ModelSource::open(const std::filesystem::path& path) {
  ModelSource source;
  source.path = path;
  if (is_coded_file(path)) {
    ThreadExecutor executor(0);
    Result<CodecDecoded> decoded = read_cmk(path, {}, executor);
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
  const Result<SafetensorsFile> file = read_safetensors(path);
  if (!file) return file.error();
  Result<std::string> recipe = model_recipe(*file);
  if (!recipe) return recipe.error();
  source.recipe = std::move(*recipe);
  return source;
}

}  // namespace tool
