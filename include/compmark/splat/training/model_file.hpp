// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model on disk: one safetensors file with every tensor and every number that a render needs, and the cameras it was
// trained with, so that nothing else is. The same model gives the same bytes; no path, date, machine or thread count is
// in it.
//
//   metadata  format = "compmark.model", version = "1", info = JSON (ModelInfo without the cameras, decoder shape,
//     render settings)
//   tensors   the blocks of the arena by name, [rows, columns] F32; camera.* F64, one row a view
// What a model does not have is not written: camera.lens (model, 16 parameters) where no view is rendered through a
// lens, origin where the scene was not moved. Files from before there was either are read as such.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/model_info.hpp"

namespace compmark {

template <Recipe R>
struct LoadedModel {
  Model<R> model;
  ModelInfo info;
};

namespace detail {

template <Recipe R>
[[nodiscard]] ModelNumbers numbers_of(const Model<R>& model) {
  return {R::AnchorModel::shape, model.voxel_size, model.train_views, model.render, present<typename R::EntropyModel>};
}

/// Adds a buffer that the writer keeps until write().
template <class T>
void add_block_tensors(SafetensorsWriter& writer, const ParameterArena<T>& arena, const std::string& prefix = {}) {
  const std::span<const T> values = arena.all_values();
  for (const ArenaLayout::Block& block : arena.layout().blocks()) {
    writer.template add_values<T>(prefix + block.name,
                                  {static_cast<std::int64_t>(block.rows), static_cast<std::int64_t>(block.columns)},
                                  values.subspan(block.offset, block.size()));
  }
}

/// Fills every block of the arena from the file's tensors (prefix + name), checking shapes and finiteness.
template <class T>
[[nodiscard]] Result<Done> read_blocks(const SafetensorsFile& file, ParameterArena<T>& arena,
                                       const std::string& prefix = {}) {
  for (const ArenaLayout::Block& block : arena.layout().blocks()) {
    const std::array<std::int64_t, 2> shape{static_cast<std::int64_t>(block.rows),
                                            static_cast<std::int64_t>(block.columns)};
    const Result<SafetensorsTensor> tensor = file.tensor(prefix + block.name, shape);
    if (!tensor) return tensor.error();
    const std::span<T> values = arena.all_values().subspan(block.offset, block.size());
    if (tensor->dtype != safetensors_dtype<T>()) {
      return model_error(file, prefix + block.name,
                         "has dtype " + tensor->dtype + ", expected " + std::string(safetensors_dtype<T>()));
    }
    if (!values.empty()) std::memcpy(values.data(), tensor->data.data(), tensor->data.size());
    if (!std::all_of(values.begin(), values.end(), [](T value) { return std::isfinite(value); }))
      return model_error(file, prefix + block.name, "holds a value that is not finite");
  }
  return Done{};
}

/// Creates the model's blocks from the file's shape and fills them.
template <Recipe R>
[[nodiscard]] COMPMARK_ONCE Result<LoadedModel<R>> model_from(const SafetensorsFile& file) {
  Result<ModelHead> head = read_head(file, R::AnchorModel::shape);
  if (!head) return head.error();
  for (const auto& [name, rows_a_view] : Model<R>::blocks_of_views()) {
    const Result<SafetensorsTensor> tensor = file.tensor(name);
    if (!tensor) return tensor.error();
    if (tensor->shape.empty() ||
        tensor->shape[0] != static_cast<std::int64_t>(rows_a_view * head->numbers.train_views)) {
      return model_error(file, name,
                         "has not the rows of " + std::to_string(head->numbers.train_views) + " views (train_views)");
    }
  }
  LoadedModel<R> loaded;
  loaded.info = std::move(head->info);
  loaded.model.create(head->rows, head->numbers.train_views);
  loaded.model.voxel_size = head->numbers.voxel_size;
  loaded.model.render = head->numbers.render;
  if (Result<Done> filled = read_blocks(file, loaded.model.arena); !filled) return filled.error();
  return loaded;
}

template <class T>
[[nodiscard]] Result<Done> write_model_file(const std::filesystem::path& path, const ParameterArena<T>& arena,
                                            const ModelNumbers& numbers, const ModelInfo& info) {
  SafetensorsWriter writer;
  writer.metadata = {{"format", model_format}, {"version", "1"}, {"info", info_text(numbers, info)}};
  add_block_tensors(writer, arena);
  add_camera_tensors(writer, info.views);
  return writer.write(path);
}

}  // namespace detail

/// Writes the model under a temporary name and renames.
template <Recipe R>
[[nodiscard]] Result<Done> write_model(const std::filesystem::path& path, const Model<R>& model,
                                       const ModelInfo& info) {
  return detail::write_model_file(path, model.arena, detail::numbers_of(model), info);
}

/// A model of recipe R from a file that was read: every count and shape is checked against the file before it is
/// believed.
template <Recipe R>
[[nodiscard]] COMPMARK_ONCE Result<LoadedModel<R>> model_from(const SafetensorsFile& file) {
  if (const Result<std::string> recipe = model_recipe(file); !recipe) return recipe.error();
  return detail::model_from<R>(file);
}

/// Reads a model of recipe R, as above.
template <Recipe R>
[[nodiscard]] Result<LoadedModel<R>> read_model(const std::filesystem::path& path) {
  const Result<SafetensorsFile> file = read_safetensors(path, FileKind::model);
  if (!file) return file.error();
  return model_from<R>(*file);
}

}  // namespace compmark
