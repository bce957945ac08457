// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An outsider's five policies, written from docs/adding_a_policy.md and docs/concepts alone: they make one recipe, which
// trains, is compressed, decoded and verified, and each of them is asked on the way.
#include <doctest/doctest.h>

#include <atomic>
#include <compmark/compmark.hpp>
#include <vector>

#include "support/small_scene.hpp"

namespace own_policies_test {
using namespace compmark;
using Rows = std::span<const std::uint32_t>;
using Rgb = std::array<float, 3>;
using Table = MatrixView<float>;
using Seen = ImageView<const float>;
using Splats = GaussianColumns<const float>;
struct Calls {
  inline static std::atomic<std::size_t> anchors, rasters, distortions, roundings, readings;
};

/// Decodes every anchor, in every view.
struct Everywhere : ScaffoldAnchors<float, testing::small_shape> {
  static void find_visible(const AnchorColumns<const float>& anchors, const auto&, const auto&, const auto&,
                           Buffer<std::uint32_t>& visible, VisibilityWorkspace&, Executor auto&) {
    ++Calls::anchors;
    visible.resize(anchors.position.rows);
    std::size_t count = 0;
    for (std::uint32_t row = 0; row < anchors.position.rows; ++row)
      if (const float* x = anchors.position.row(row); std::isfinite(x[0] + x[1] + x[2])) visible[count++] = row;
    visible.resize(count);
  }
};

/// Another rasterizer, behind grey glass.
struct GreyGlass : TrainingRasterizer<float> {
  using TrainingRasterizer<float>::TileRasterizer;
  RasterReport forward(Splats in, const Camera<float>& camera, Rgb behind, ImageView<float> image, Context& context,
                       Executor auto& executor) const {
    ++Calls::rasters;
    const RasterReport report = TileRasterizer::forward(in, camera, behind, image, context, executor);
    for (float& value : image.flat()) value *= 0.9f;
    return report;
  }
  void backward(Splats in, const Camera<float>& camera, Rgb behind, Seen d_image, GaussianColumns<float> d_in,
                Context& context, Executor auto& executor) const {
    std::vector<float> inner(d_image.data, d_image.data + d_image.size());
    for (float& value : inner) value *= 0.9f;
    const Seen d_inner{inner.data(), 3, d_image.height, d_image.width};
    TileRasterizer::backward(in, camera, behind, d_inner, d_in, context, executor);
  }
};

/// Steps of half the base step, whatever a network says.
struct HalfSteps {
  using Scalar = float;
  static float step(float, float q0, float least) { return std::max(q0 / 2, least); }
  static float step_slope(float, float, float) { return 0; }
  static float step_log_slope(float) { return 0; }
  static float symbol(float x, float q) { return std::nearbyint(x / q); }
  static float value(float x, float q) { return q * symbol(x, q); }
  static float error(float x, float q) { return ++Calls::roundings, symbol(x, q) - x / q; }
};

/// Rounds the features by the steps of a quantizer, and hands gradients straight through.
template <class Q>
struct Rounding {
  using Scalar = float;
  struct Handles {};
  struct Context {};
  template <class Other>
  using WithQuantizer = Rounding<Other>;
  static Handles add_parameters(ParameterArena<float>&) { return {}; }
  static void initialise(ParameterArena<float>&, const Handles&, std::uint64_t) {}
  DistortionReport forward(const ParameterArena<float>&, const Handles&, Rows rows, const DistortionPhase&,
                           Table feature, Table, Table, Context&, Executor auto&) const {
    ++Calls::distortions;
    const float q = Q::step(0, 0.1f, 0);
    for (const std::uint32_t row : rows)
      for (std::size_t c = 0; c < feature.columns; ++c) feature(row, c) += q * Q::error(feature(row, c), q);
    return {.mean_step = q};
  }
  void backward(auto&, const Handles&, Rows, Table, Table, Context&, Executor auto&) const {}
};

/// Bit i is the sign of the image's correlation with pattern i of a key, which is 1 or -1 in cells of 4 x 4 pixels.
struct CellSigns {
  using Scalar = float;
  struct Context {};
  std::uint64_t key = 0;
  static int bits() { return 32; }
  static int minimum_size() { return 8; }
  void each(Seen image, const auto& use) const {
    for (std::uint64_t bit = 0; bit < 32; ++bit)
      for (std::size_t i = 0; i < image.size(); ++i) {
        const std::size_t width = static_cast<std::size_t>(image.width), row = i / width, x = i % width;
        const float centered = Random(key, bit, 0).centered(row / 4 * 1000 + x / 4);
        use(bit, i, (centered < 0 ? -400 : 400) / static_cast<float>(image.size()));
      }
  }
  void forward(Seen image, std::span<float> logits, Context&, Executor auto&) const {
    ++Calls::readings;
    std::fill(logits.begin(), logits.end(), 0.0f);
    each(image, [&](std::size_t bit, std::size_t i, float w) { logits[bit] += w * image.data[i]; });
  }
  void backward(std::span<const float> d_logits, ImageView<float> d_image, Context&, Executor auto&) const {
    each(d_image, [&](std::size_t bit, std::size_t i, float w) { d_image.data[i] += w * d_logits[bit]; });
  }
};

struct Mine : Policies<Everywhere, GreyGlass, Rounding<HalfSteps>, HalfSteps, CellSigns> {
  using Base = Policies<Everywhere, GreyGlass>;
  using Embedder = ResidualFeature<float>;
};
struct Coded : recipes::Hac<Mine::Base> {};

TEST_CASE("training/own_policies: five policies of one's own train, are compressed, decoded and verified") {
  testing::BlobViews views;
  ThreadExecutor executor(2);
  TrainSettings settings;
  settings.iterations = 400;
  settings.voxel_size = 0.05;
  settings.mark.message = {.lambda = 0.5, .after = 0, .logit_scale = 1};
  settings.mark.residual.learning_rate = 0.02;
  const Message message = Message::from_words(0x9e3779b9, 0, 32);
  Trainer<Mine, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
  set_watermark(trainer, CellSigns{21}, message);
  REQUIRE((trainer.initialise(testing::cloud(300, 7)).ok() && trainer.run(views).ok()));
  for (const auto* calls : {&Calls::anchors, &Calls::rasters, &Calls::distortions, &Calls::readings})
    CHECK(*calls >= 399);
  CHECK(Calls::roundings > 10000);
  Trainer<Coded, ThreadExecutor> fitted(codec_fit_settings(settings), views.size(), 1.0, executor);
  fitted.start_from(with_room_for_stages<Coded>(baked_model(trainer.model()), 1));
  REQUIRE(fitted.run(views).ok());
  const auto file = encode_cmk(*coded_model(fitted.model(), ModelInfo{}), CodecEncodeSettings{}, executor);
  const auto decoded = decode_cmk(file->bytes, "mine.cmk", CodecDecodeSettings{}, executor);
  const auto model = model_from<Coded>(decoded->model);
  REQUIRE(model.ok());
  Calls::anchors = Calls::rasters = Calls::readings = 0;
  CHECK(verify_message(message, *read_model(model->model, views, CellSigns{21}, executor))->verdict ==
        Verdict::detected);
  CHECK((Calls::anchors == 6 && Calls::rasters == 6 && Calls::readings == 6));
  CHECK(verify_message(message, *read_model(model->model, views, CellSigns{22}, executor))->verdict !=
        Verdict::detected);
}

}  // namespace own_policies_test
