// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model's file, whichever of the two it is: model.safetensors of a run, or a compressed .cmk. Opened first, because the recipe that stands
// in it chooses the type it is loaded as.
#pragma once

#include <compmark/codec/codec_model.hpp>
#include <compmark/core/absent.hpp>
#include <compmark/core/result.hpp>
#include <compmark/io/safetensors_reader.hpp>
#include <compmark/pipeline/coded_model.hpp>
#include <compmark/pipeline/model_file.hpp>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

namespace tool {

/// Whether a file begins as a .cmk does.
bool is_coded_file(const std::filesystem::path& path);

struct ModelSource {
  std::filesystem::path path;
  std::string recipe;
  std::optional<compmark::CodecModel> coded;                   ///< decoded, of a .cmk
  std::shared_ptr<const compmark::SafetensorsFile> file = {};  ///< else, as it was read

  static compmark::Result<ModelSource> open(const std::filesystem::path& path, std::size_t threads = 0);

  /// R is one of with_reading_recipe (recipe_list.hpp); compiled once, in model_source.cpp, for all commands.
  template <class R>
  [[nodiscard]] compmark::Result<compmark::LoadedModel<R>> load() const;
};

}  // namespace tool
