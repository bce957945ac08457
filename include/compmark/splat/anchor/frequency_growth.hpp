// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Frequency-aware growing (docs/spec/method.md, 5.5, step 7): a DensityControl around another one. In a window of the
// run only the Gaussians that FrequencySelector picks add to the gradient statistics, and an adjustment uses the
// window's thresholds; opacities and visits are gathered as ever. Outside the window it is the other policy. Counts
// gathered before the window stay, as published (docs/spec/method.md, 7.15). Cost: that of the selection.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/density_control.hpp"
#include "compmark/splat/anchor/frequency_selector.hpp"
#include "compmark/splat/anchor/growth.hpp"

namespace compmark {

template <class T, class Base = GradientGrowth<T>>
class FrequencyGrowth {
 public:
  using Scalar = T;

  /// Thresholds of the window, as released. 0.15 is thirty times the opacity that the rest of the run asks for
  /// (docs/spec/method.md, 7.16).
  struct WindowSettings {
    double gradient_threshold = 0.00015;
    double success_threshold = 0.6;
    double min_opacity = 0.15;
  };
  struct Settings : Base::Settings {
    WindowSettings window;
    FrequencyBandSettings band;
    /// Whether the iteration lies in the window, which is 10000 <= t < 15000 of 30000: closed_window(10000, 15000,
    /// iterations).
    bool in_window = false;
  };
  /// What the base keeps; `last` and the selection's scratch have no meaning between two iterations and go to no
  /// checkpoint.
  struct State : Base::State {
    typename FrequencySelector<T>::Context selection;
    FrequencySelection last;  ///< of the last observed view
  };

  FrequencyGrowth() = default;
  explicit FrequencyGrowth(const Settings& settings) : settings_(settings) {}
  [[nodiscard]] const Settings& settings() const { return settings_; }

  void prepare(std::size_t anchors, State& state) const { base().prepare(anchors, state); }

  /// A view without an error map: as the base does.
  template <Executor E>
  void observe(const DecodedStatistics<T>& decoded, std::span<const std::uint8_t> gaussian_visible,
               std::span<const T> gradient_norm, State& state, E& executor) const {
    base().observe(decoded, gaussian_visible, gradient_norm, state, executor);
  }
  /// A view of image_height x image_width with its error map; mean(i) is the {u, v} of a visible Gaussian i (see
  /// FrequencySelector). Outside the window the map is not looked at.
  template <class Mean, Executor E>
  void observe(const DecodedStatistics<T>& decoded, std::span<const std::uint8_t> gaussian_visible,
               std::span<const T> gradient_norm, ImageView<const T> error, int image_height, int image_width,
               const Mean& mean, State& state, E& executor) const {
    if (!settings_.in_window) return observe(decoded, gaussian_visible, gradient_norm, state, executor);
    state.last = FrequencySelector<T>(settings_.band)
                     .select(error, image_height, image_width, gaussian_visible, mean, state.selection, executor);
    base().observe(decoded, std::as_const(state.selection.selected).span(), gradient_norm, state, executor);
  }

  template <class OnEdit, class Inputs = AdjustmentInputs>
  GrowthReport adapt(ParameterArena<T>& arena, const AnchorHandles& handles, State& state, const Inputs& inputs,
                     OnEdit&& on_edit) const {
    return base().adapt(arena, handles, static_cast<typename Base::State&>(state), inputs,
                        std::forward<OnEdit>(on_edit));
  }

 private:
  [[nodiscard]] Base base() const {
    typename Base::Settings settings = settings_;
    if (settings_.in_window) {
      settings.gradient_threshold = settings_.window.gradient_threshold;
      settings.success_threshold = settings_.window.success_threshold;
      settings.min_opacity = settings_.window.min_opacity;
    }
    return Base(settings);
  }

  Settings settings_;
};

static_assert(DensityControl<FrequencyGrowth<float>>);

}  // namespace compmark
