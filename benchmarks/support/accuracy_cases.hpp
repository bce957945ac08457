// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The rows of accuracy_vs_time: every preset, every knob turned alone, and the ladder from `inria` to `standard`, each
// a rasterizer type behind a virtual call that renders one view, times it and hands out image and gradient in double.
#pragma once

#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/raster/reference.hpp"
#include "compmark/splat/raster/tile.hpp"

namespace accuracy_bench {

using namespace compmark;

/// One view: the Gaussians that the decoder gave for it, in both precisions.
struct BenchView {
  std::string name;
  Camera<double> camera;
  GaussianBatch<float> gaussians;
  GaussianBatch<double> gaussians_double;
  std::vector<double> d_image;  // gradient of an L1-like loss: +-1 / size, constant on 4 x 4 blocks
};

inline constexpr std::array<const char*, 5> group_names{"mean", "scale", "rotation", "opacity", "color"};
inline constexpr std::array<std::array<std::size_t, 2>, 5> group_columns{{{0, 3}, {3, 6}, {6, 10}, {10, 11}, {11, 14}}};

/// Image and gradient of one view, in double whatever computed it.
struct Rendered {
  std::vector<double> image;
  std::array<std::vector<double>, 14> gradient;
};

/// One row of the table: a rasterizer type behind a virtual call.
class Case {
 public:
  Case(std::string case_name, std::string case_group, std::string case_note)
      : name(std::move(case_name)),
        group(std::move(case_group)),
        note(std::move(case_note)) {}
  virtual ~Case() = default;
  virtual double forward(const BenchView& view) = 0;   // returns milliseconds
  virtual double backward(const BenchView& view) = 0;  // after forward of the same view
  virtual Rendered rendered(const BenchView& view) const = 0;
  virtual std::size_t pairs() const = 0;
  virtual void drop() = 0;  // frees the context

  std::string name, group, note;
  bool timed = true;
};

struct Scene {
  double near_plane = 0.2, blur_variance = 0.3;
  std::array<double, 3> background{0, 0, 0};
};

inline ThreadExecutor* executor = nullptr;
inline Scene scene;

/// Milliseconds of the wall clock; with one thread of that thread's processor time, which other programs do not
/// disturb.
inline double now_ms() {
  if (executor->concurrency() == 1) {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
  }
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

template <class Rasterizer>
class RasterCase final : public Case {
  using T = typename Rasterizer::Scalar;

 public:
  using Case::Case;
  double forward(const BenchView& view) override {
    if (!state_) state_ = std::make_unique<State>();
    const std::size_t size =
        3 * static_cast<std::size_t>(view.camera.width) * static_cast<std::size_t>(view.camera.height);
    state_->image.resize(size);
    state_->d_image.resize(size);
    for (std::size_t i = 0; i < size; ++i) state_->d_image[i] = static_cast<T>(view.d_image[i]);
    state_->gradient.resize(columns(view).count);
    state_->gradient.set_zero();
    const Camera<T> camera = view.camera.template cast<T>();
    const double start = now_ms();
    const RasterReport report = rasterizer().forward(columns(view), camera, background(),
                                                     image_view<T>(view, state_->image), state_->context, *executor);
    const double time = now_ms() - start;
    pairs_ = report.pairs;
    return time;
  }
  double backward(const BenchView& view) override {
    const Camera<T> camera = view.camera.template cast<T>();
    const double start = now_ms();
    rasterizer().backward(columns(view), camera, background(), image_view<const T>(view, state_->d_image),
                          state_->gradient.columns(), state_->context, *executor);
    return now_ms() - start;
  }
  Rendered rendered(const BenchView&) const override {
    Rendered result;
    result.image.assign(state_->image.begin(), state_->image.end());
    const GaussianColumns<const T> g = std::as_const(state_->gradient).columns();
    const std::array<const T*, 14> all{g.mean[0],  g.mean[1],     g.mean[2],     g.scale[0],    g.scale[1],
                                       g.scale[2], g.rotation[0], g.rotation[1], g.rotation[2], g.rotation[3],
                                       g.opacity,  g.color[0],    g.color[1],    g.color[2]};
    for (std::size_t c = 0; c < 14; ++c) result.gradient[c].assign(all[c], all[c] + g.count);
    return result;
  }
  std::size_t pairs() const override { return pairs_; }
  void drop() override { state_.reset(); }

 private:
  struct State {
    typename Rasterizer::Context context;
    Buffer<T> image, d_image;
    GaussianBatch<T> gradient;
  };
  static Rasterizer rasterizer() {
    typename Rasterizer::Settings settings;
    settings.near_plane = static_cast<T>(scene.near_plane);
    settings.blur_variance = static_cast<T>(scene.blur_variance);
    return Rasterizer(settings);
  }
  static std::array<T, 3> background() {
    return {static_cast<T>(scene.background[0]), static_cast<T>(scene.background[1]),
            static_cast<T>(scene.background[2])};
  }
  static GaussianColumns<const T> columns(const BenchView& view) {
    if constexpr (std::is_same_v<T, double>) {
      return view.gaussians_double.columns();
    } else {
      return view.gaussians.columns();
    }
  }
  template <class U>
  static ImageView<U> image_view(const BenchView& view, Buffer<T>& buffer) {
    return {buffer.data(), 3, view.camera.height, view.camera.width};
  }

  std::unique_ptr<State> state_;
  std::size_t pairs_ = 0;
};

using Cases = std::vector<std::unique_ptr<Case>>;

template <class T, Accuracy accuracy>
void add(Cases& cases, std::string name, std::string group, std::string note) {
  cases.push_back(
      std::make_unique<RasterCase<TileRasterizer<T, accuracy>>>(std::move(name), std::move(group), std::move(note)));
}

constexpr Accuracy with(void (*change)(Accuracy&), Accuracy accuracy = accuracy::standard) {
  change(accuracy);
  return accuracy;
}

inline Cases all_cases() {
  Cases cases;
  add<double, accuracy::exact>(cases, "exact", "reference", "double, alpha > 1e-7, no stop, alpha <= 1");
  add<double, accuracy::spec>(cases, "spec", "reference", "double, the published constants");
  add<float, accuracy::inria>(cases, "inria", "preset", "the published algorithm, literally");
  add<float, accuracy::quality>(cases, "quality", "preset", "");
  add<float, accuracy::standard>(cases, "standard", "preset", "default; all knobs below start here");
  add<float, accuracy::fast>(cases, "fast", "preset", "");
  add<float, accuracy::draft>(cases, "draft", "preset", "");

  add<double, accuracy::standard>(cases, "scalar double", "knob", "half the lanes");
  add<float, with([](Accuracy& a) { a.exp_degree = 0; })>(cases, "exp std::exp", "knob", "");
  add<float, with([](Accuracy& a) { a.exp_degree = 4; })>(cases, "exp degree 4", "knob", "");
  add<float, with([](Accuracy& a) { a.exp_degree = 3; })>(cases, "exp degree 3", "knob", "");
  add<float, with([](Accuracy& a) { a.exp_degree = 2; })>(cases, "exp degree 2", "knob", "");
  add<float, with([](Accuracy& a) { a.alpha_min = 1.0f / 1024; })>(cases, "alpha_min 1/1024", "knob", "");
  add<float, with([](Accuracy& a) { a.alpha_min = 1.0f / 512; })>(cases, "alpha_min 1/512", "knob", "");
  add<float, with([](Accuracy& a) { a.alpha_min = 1.0f / 128; })>(cases, "alpha_min 1/128", "knob", "");
  add<float, with([](Accuracy& a) { a.alpha_min = 1.0f / 64; })>(cases, "alpha_min 1/64", "knob", "");
  add<float, with([](Accuracy& a) { a.alpha_max = 0.9999f; })>(cases, "alpha_max 0.9999", "knob", "");
  add<float, with([](Accuracy& a) { a.transmittance_stop = 0; })>(cases, "stop never", "knob", "");
  add<float, with([](Accuracy& a) { a.transmittance_stop = 1e-3f; })>(cases, "stop 1e-3", "knob", "");
  add<float, with([](Accuracy& a) { a.transmittance_stop = 1e-2f; })>(cases, "stop 1e-2", "knob", "");
  add<float, with([](Accuracy& a) { a.stop = StopRule::exclusive; })>(cases, "stop exclusive", "knob",
                                                                      "the published rule");
  add<float, with([](Accuracy& a) { a.footprint = FootprintRule::opacity_box; })>(cases, "footprint box", "knob",
                                                                                  "no tile test");
  add<float, with([](Accuracy& a) { a.footprint = FootprintRule::square_three_sigma; })>(
      cases, "footprint square 3 sigma", "knob", "the published rule");
  add<float, with([](Accuracy& a) { a.tile_size = 32; })>(cases, "tile 32", "knob", "");
  add<float, with([](Accuracy& a) { a.published_backward = true; })>(cases, "published backward", "knob", "same image");

  constexpr auto exact_tiles = [](Accuracy& a) { a.footprint = FootprintRule::exact_tiles; };
  constexpr auto and_polynomial = [](Accuracy& a) { a.footprint = FootprintRule::exact_tiles, a.exp_degree = 5; };
  constexpr auto and_inclusive = [](Accuracy& a) {
    a.footprint = FootprintRule::exact_tiles, a.exp_degree = 5, a.stop = StopRule::inclusive;
  };
  add<float, with(exact_tiles, accuracy::inria)>(cases, "inria + exact tiles", "ladder",
                                                 "from inria to standard, step by step");
  add<float, with(and_polynomial, accuracy::inria)>(cases, "+ polynomial exp", "ladder", "");
  add<float, with(and_inclusive, accuracy::inria)>(cases, "+ inclusive stop", "ladder",
                                                   "standard adds the exact gradient");
  return cases;
}

}  // namespace accuracy_bench
