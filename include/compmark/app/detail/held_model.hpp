// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What AnyModel asks of the model that it holds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/lens_model.hpp"
#include "compmark/splat/training/model_info.hpp"

namespace compmark {

struct RenderedView {
  ImageView<float> image;     ///< [3, height, width], in [0, 1] but for rounding; valid until the next render
  std::size_t gaussians = 0;  ///< with positive opacity
  /// What was drawn, as the rasterizer got it: opacities <= 0 are not drawn. Valid as long as the image.
  GaussianColumns<const float> drawn = {};
  bool mip_filtered = false;  ///< drawn with the mip filter (splat/raster/effects.hpp)
};

/// What each drawn Gaussian gives to a render; valid until the next one.
struct GaussianShares {
  std::span<const std::uint32_t> slot;  ///< [Gaussians] anchor * K + k, for K Gaussians an anchor
  std::span<const float> weight;        ///< [Gaussians] sum over pixels of alpha * transmittance, pixels
  GaussianColumns<const float> drawn = {};
};

namespace detail {

class HeldModel {
 public:
  HeldModel() = default;
  HeldModel(const HeldModel&) = delete;
  HeldModel& operator=(const HeldModel&) = delete;
  virtual ~HeldModel() = default;
  virtual Result<RenderedView> render(const Camera<double>& camera, const Lens& lens, ThreadExecutor& executor) = 0;
  virtual Result<MatrixView<const float>> feature_gradient(const Camera<double>& camera, const Lens& lens,
                                                           ImageView<const float> d_image,
                                                           ThreadExecutor& executor) = 0;
  virtual Result<GaussianShares> shares(const Camera<double>& camera, const Lens& lens, ThreadExecutor& executor) = 0;
  virtual ParameterArena<float>& arena() = 0;
  [[nodiscard]] virtual std::size_t anchor_count() const = 0;
  [[nodiscard]] virtual RenderSettings render_settings() const = 0;
  [[nodiscard]] virtual Result<Done> write(const std::filesystem::path& path) const = 0;
  [[nodiscard]] virtual Result<CodecModel> coded(const CodedModelSettings& settings) const = 0;

  ModelInfo info;
  double missing_share = 0;  ///< of the anchors, that renders make up for (AnyModel::make_up_for)
};

}  // namespace detail

}  // namespace compmark
