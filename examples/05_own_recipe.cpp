// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The whole way with a recipe of one's own: trains the built-in scene for compression while a message is hidden in it,
// writes the small file, decodes it, and proves that the message is there, and that another key's is not. The message
// decoder is this program's own: bit i is the sign of the image's sum over a chequered pattern that only the key gives.
#include <compmark/app/capture.hpp>
#include <compmark/app/dataset_views.hpp>
#include <compmark/app/model_source.hpp>
#include <compmark/compmark.hpp>
#include <cstdio>

namespace {

using namespace compmark;
constexpr int side = 64;
constexpr std::size_t bit_count = 32, pixels = side * side;

struct SecretPatterns {
  using Scalar = float;
  struct Context {};
  static constexpr float gain = 1600.0f / (3 * pixels);
  std::vector<float> sign;  // [pixels, bit_count], the same in every square of 4 x 4
  SecretPatterns() = default;
  explicit SecretPatterns(const OwnerKey& key) {
    const std::uint64_t seed = carrier_seed(key)[0];
    for (std::size_t i = 0, pixel = 0; i < bit_count * pixels; pixel = ++i / bit_count) {
      const Random random(seed, i % bit_count, random_stage("patterns"));
      sign.push_back(random.uniform(pixel % side / 4 + 16 * (pixel / side / 4)) < 0.5 ? -gain : gain);
    }
  }
  static constexpr int bits() { return bit_count; }
  static constexpr int minimum_size() { return side; }
  void forward(ImageView<const float> image, std::span<float> logits, Context& /*own*/, auto& /*executor*/) const {
    for (float& logit : logits) logit = 0;
    for (std::size_t i = 0; i < 3 * sign.size(); ++i)
      logits[i % bit_count] += sign[i % sign.size()] * image.data[i / bit_count];
  }
  void backward(std::span<const float> d, ImageView<float> d_image, Context& /*own*/, auto& /*executor*/) const {
    for (std::size_t i = 0; i < 3 * sign.size(); ++i)
      d_image.data[i / bit_count] += sign[i % sign.size()] * d[i % bit_count];
  }
};

// The recipe: anchors of another shape, the fast rasterizer, HAC with a small hash grid; and the same with the mark.
using Anchors = ScaffoldAnchors<float, DecoderShape{.feature_dim = 16, .offsets = 5}>;
constexpr HashGridShape grid{.volume_levels = 3, .volume_cap_log2 = 10, .plane_levels = 1, .plane_cap_log2 = 9};
struct Plain : recipes::Hac<Policies<Anchors, TrainingRasterizer<float, accuracy::fast>>, grid> {};
struct Mine : recipes::Marked<Plain, SecretPatterns> {};
template <class T>
T need(Result<T> result) {  // the program ends at the first error
  if (!result) std::exit((std::fprintf(stderr, "%s\n", result.error().line().c_str()), 1));
  return std::move(*result);
}

/// Reads a key's message from renders in 8 bits.
Verification verify(const Model<Plain>& model, const DatasetViews& at, const OwnerKey& key, ThreadExecutor& threads) {
  const SecretPatterns decoder(key);
  Pipeline<Plain>::Context context;
  SecretPatterns::Context own;
  std::vector<ViewLogits> read;
  for (std::size_t i = 0; i < at.size(); ++i) {
    (void)Pipeline<Plain>().forward(model, at.camera(i), unseen_view, context, threads);
    round_to_8bit<float>(context.image, context.image);
    read.push_back(need(read_logits(decoder, ImageView<const float>(context.image), "a view", own, threads)));
  }
  return need(verify_message(message_of(key), read));
}

}  // namespace

int main() {
  ProceduralSettings scene;
  scene.width = scene.height = side;
  need(write_procedural_scene("own_scene", scene));
  const Dataset dataset = need(open_dataset("own_scene", DatasetSettings{}));
  ImageStore store(dataset, DatasetSettings{});
  DatasetViews views{&dataset, &store, dataset.indices(Split::train)};
  OwnerKey key, other;  // real ones come from make_key_file
  key.secret[0] = std::byte{7}, key.bits = other.bits = bit_count;
  TrainSettings settings = *profile_settings("hac");
  settings.iterations = 1200;
  settings.voxel_size = 0.03;
  settings.mark.message.logit_scale = 1;
  settings.mark.message.lambda = 0.3, settings.mark.message.after = 3000;
  ThreadExecutor threads;
  Trainer<Mine, ThreadExecutor> trainer(settings, views.size(), scene_extent(dataset).radius, threads);
  std::vector<std::uint8_t> bits;
  for (std::size_t i = 0; i < bit_count; ++i) bits.push_back(message_of(key)[i] ? 1 : 0);
  set_watermark(trainer, SecretPatterns(key), bits);
  need(trainer.initialise(dataset.points.position));
  need(trainer.run(views));
  ModelInfo info{"mine", "hac", settings.iterations, settings.seed, {}, {}};
  info.base_step = {settings.rate.feature_step, settings.rate.scaling_step, settings.rate.offset_step};
  need(write_cmk("own.cmk", need(coded_model(baked_model(trainer.model()), info)), CodecEncodeSettings{}, threads));
  const auto decoded = need(need(ModelSource::open("own.cmk", threads)).load<Plain>()).model;
  const Verification mine = verify(decoded, views, key, threads), theirs = verify(decoded, views, other, threads);
  std::printf("own.cmk: p = %.2g, with another key %.2g\n", mine.evidence.p_value, theirs.evidence.p_value);
  return mine.verdict == Verdict::detected && theirs.verdict == Verdict::not_detected ? 0 : 1;
}
