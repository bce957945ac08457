// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model's file of any kind: model.safetensors of a run, a compressed .cmk, or a splat file of another program
// (io/splat/read_splat.hpp), which is a model of explicit Gaussians. It is opened before its type is known, because the
// recipe in it chooses the type. A program that needs no type opens an AnyModel (any_model.hpp).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "compmark/app/compiled.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/safetensors_reader.hpp"
#include "compmark/io/splat/splat_file.hpp"
#include "compmark/splat/training/model_file.hpp"

namespace compmark {

/// Whether a file begins as a .cmk does. Not an error: false for a file that cannot be read.
[[nodiscard]] bool is_coded_file(const std::filesystem::path& path);

struct ModelSource {
  std::filesystem::path path;
  std::string recipe;
  std::optional<CodecModel> coded;                   ///< decoded, of a .cmk
  std::shared_ptr<const SafetensorsFile> file = {};  ///< of model.safetensors, as it was read
  std::shared_ptr<const SplatFile> splats = {};      ///< of a splat file

  /// Reads the file and decodes a .cmk. `sha256`, if any, is set to that of the bytes that were read, 64 digits:
  /// what is said of the model is then said of these, whatever becomes of the file meanwhile. Error: the kind of a file
  /// that is no model, or the damage. Cost: the file's bytes and, of a .cmk, its model.
  [[nodiscard]] static Result<ModelSource> open(const std::filesystem::path& path, ThreadExecutor& executor,
                                                std::string* sha256 = nullptr);

  /// R is one of with_reading_recipe (recipe_list.hpp). Error: a shape or a number that does not fit the recipe. Splats
  /// come without cameras: their model gets some round them (scene/views_around.hpp).
  template <class R>
  [[nodiscard]] Result<LoadedModel<R>> load() const;
};

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/model_source.hpp"
#endif
