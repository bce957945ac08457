// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What registration compares a picture with: the render of a model at any size, with the derivatives of every pixel by
// the camera. A model is trained at one pixel size; drawn at a larger one, its blur of a third of a pixel makes it
// thicker than a picture that was made smaller. So it is drawn with up to four times the pixels, with the blur that it
// had on those, and averaged.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/raster/camera_tangent.hpp"

namespace compmark {

namespace detail {

/// The callable of fit_camera for a model. Holds ~120 bytes a pixel of what it draws, and 256 a visible Gaussian.
class RegisterRender {
 public:
  /// `native_focal`: of the cameras the model was trained with, pixels.
  RegisterRender(AnyModel& model, double native_focal, ThreadExecutor& executor)
      : model_(&model),
        native_(native_focal),
        executor_(&executor) {}

  /// From now on the picture is taken for a render that was made at the very size it has.
  void rendered_at_this_size(bool so) { at_this_size_ = so; }
  /// What went wrong when a call returned false.
  [[nodiscard]] const Error& error() const { return *error_; }
  /// What the last call drew; nothing where it failed.
  [[nodiscard]] GaussianColumns<const float> drawn() const { return drawn_; }
  /// Draws what the camera sees, without derivatives. The image of this render is of no use, so it is small.
  Result<RenderedView> look(const Camera<double>& camera) {
    drawn_ = {};  // columns of the render before, which go with it
    Result<RenderedView> view =
        model_->render(camera.resized(std::max(1, camera.width / 16), std::max(1, camera.height / 16)), *executor_);
    if (view) drawn_ = view->drawn;
    return view;
  }

  bool operator()(const Camera<double>& camera, ImageView<float> image, ImageView<float> tangents) {
    const Result<RenderedView> view = look(camera);
    if (!view) return failed(view.error());
    const int times = at_this_size_ ? 1 : static_cast<int>(std::clamp(std::floor(native_ / camera.fx + 0.8), 1.0, 4.0));
    const Camera<double> fine = camera.resized(times * camera.width, times * camera.height);
    const double shrunk = native_ / fine.fx, blur = model_->render_settings().blur_variance;
    // Variances, in pixels of the fine render: the blur of training, and that of averaging boxes of `shrunk` pixels.
    const double variance =
        at_this_size_ ? blur : blur / (shrunk * shrunk) + std::max(0.0, (1 - 1 / (shrunk * shrunk)) / 12);
    if (times == 1) return draw(*view, fine, variance, image, tangents);
    const std::size_t pixels = static_cast<std::size_t>(fine.width) * static_cast<std::size_t>(fine.height);
    fine_.resize(30 * pixels);
    const ImageView<float> fine_image{fine_.data(), 3, fine.height, fine.width},
        fine_tangents{fine_.data() + 3 * pixels, 27, fine.height, fine.width};
    if (!draw(*view, fine, variance, fine_image, fine_tangents)) return false;
    average(fine_image, times, image);
    average(fine_tangents, times, tangents);
    return true;
  }

 private:
  bool draw(const RenderedView& view, const Camera<double>& camera, double variance, ImageView<float> image,
            ImageView<float> tangents) {
    const RenderSettings settings = model_->render_settings();
    const auto with = [&]<class Filter>(CameraTangent<float, accuracy::standard, Filter>,
                                        typename CameraTangent<float, accuracy::standard, Filter>::Context& context) {
      std::array<float, 3> background{};
      for (std::size_t c = 0; c < 3; ++c) background[c] = static_cast<float>(settings.background[c]);
      const CameraTangent<float, accuracy::standard, Filter> tangent(static_cast<float>(settings.near_plane),
                                                                     static_cast<float>(variance));
      const Result<Done> done =
          tangent.render(view.drawn, camera.cast<float>(), background, image, tangents, context, *executor_);
      return done ? true : failed(done.error());
    };
    return view.mip_filtered ? with(CameraTangent<float, accuracy::standard, MipFilter>{}, filtered_)
                             : with(CameraTangent<float>{}, plain_);
  }
  /// Means of boxes of times x times pixels. A principal point moves by one pixel where the fine one moves by `times`.
  void average(ImageView<const float> fine, int times, ImageView<float> to) {
    const std::size_t rows = static_cast<std::size_t>(to.channels) * static_cast<std::size_t>(to.height);
    executor_->for_chunks(rows, 16, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t r = begin; r < end; ++r) {
        const int plane = static_cast<int>(r) / to.height, y = static_cast<int>(r) % to.height;
        const bool shifts = to.channels == 27 && plane >= 21;
        const float scale = (shifts ? static_cast<float>(times) : 1.0f) / static_cast<float>(times * times);
        float* const out = to.row(plane, y);
        for (int x = 0; x < to.width; ++x) {
          float sum = 0;
          for (int j = 0; j < times; ++j) {
            const float* const in = fine.row(plane, times * y + j) + times * x;
            for (int i = 0; i < times; ++i) sum += in[i];
          }
          out[x] = scale * sum;
        }
      }
    });
  }
  bool failed(const Error& error) {
    error_ = error;
    return false;
  }

  AnyModel* model_;
  double native_;
  ThreadExecutor* executor_;
  bool at_this_size_ = false;
  std::optional<Error> error_;
  GaussianColumns<const float> drawn_;
  std::vector<float> fine_;
  CameraTangent<float>::Context plain_;
  CameraTangent<float, accuracy::standard, MipFilter>::Context filtered_;
};

}  // namespace detail
}  // namespace compmark
