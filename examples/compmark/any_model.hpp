// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model of any recipe behind one interface, so that commands that only render, edit or write models are compiled once and not for every
// recipe.
#pragma once

#include <compmark/codec/codec_model.hpp>
#include <compmark/core/parameters.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/core/views.hpp>
#include <compmark/pipeline/coded_model.hpp>
#include <compmark/pipeline/model_file.hpp>
#include <compmark/scene/camera.hpp>
#include <compmark/scene/lens_model.hpp>
#include <cstddef>
#include <filesystem>
#include <memory>

#include "model_source.hpp"

namespace tool {

struct RenderedView {
  compmark::ImageView<float> image;  ///< [3, height, width], valid until the next render
  std::size_t gaussians = 0;         ///< with positive opacity
};

class AnyModel {
 public:
  virtual ~AnyModel() = default;
  /// `lens` is that of the photograph to be rendered; a model that does not project through lenses has no use for one.
  virtual compmark::Result<RenderedView> render(const compmark::Camera<double>& camera, const compmark::Lens& lens,
                                                compmark::ThreadExecutor& executor) = 0;
  virtual compmark::ParameterArena<float>& arena() = 0;
  [[nodiscard]] virtual std::size_t anchor_count() const = 0;
  /// As model.safetensors.
  [[nodiscard]] virtual compmark::Result<compmark::Done> write(const std::filesystem::path& path) const = 0;
  /// What a .cmk holds of it; an Error if its recipe does not train for compression.
  [[nodiscard]] virtual compmark::Result<compmark::CodecModel> coded(
      const compmark::CodedModelSettings& settings) const = 0;

  compmark::ModelInfo info;
  compmark::RenderSettings render_settings;
};

/// Reads a model file; the recipe's name in it chooses the type.
compmark::Result<std::unique_ptr<AnyModel>> load_model(const std::filesystem::path& path, std::size_t threads = 0);
compmark::Result<std::unique_ptr<AnyModel>> load_model(const ModelSource& source);

}  // namespace tool
