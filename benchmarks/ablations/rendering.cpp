// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What of the ablations renders: trainings and their measurement, in one place because they share the rasterizer's code
// (half a minute of a compiler).
#include <algorithm>

#include "ablations/loop.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/metric/psnr.hpp"
#include "compmark/metric/rounding.hpp"
#include "compmark/metric/ssim.hpp"

namespace ablation {

using namespace compmark;

namespace {

template <AnchorAttribute target>
Result<Model<Base>> train_target(const Row& row, Scene& scene, const TrainSettings& settings, const Decoder& decoder,
                                 const std::vector<std::uint8_t>& bits, ThreadExecutor& executor) {
  auto trained = Loop<Ablated<target>>(row, scene, settings, decoder, bits, executor).run();
  if (!trained) return trained.error();
  return baked_model(*trained);
}

}  // namespace

Result<Model<Base>> train_base(const Row& row, Scene& scene, const TrainSettings& settings, const Decoder& decoder,
                               const std::vector<std::uint8_t>& bits, ThreadExecutor& executor) {
  switch (row.target) {
    case AnchorAttribute::position:
      return train_target<AnchorAttribute::position>(row, scene, settings, decoder, bits, executor);
    case AnchorAttribute::scaling:
      return train_target<AnchorAttribute::scaling>(row, scene, settings, decoder, bits, executor);
    case AnchorAttribute::offset:
      return train_target<AnchorAttribute::offset>(row, scene, settings, decoder, bits, executor);
    case AnchorAttribute::feature:
      break;
  }
  return train_target<AnchorAttribute::feature>(row, scene, settings, decoder, bits, executor);
}

Result<Measured> measure(const Model<Base>& model, const Scene& scene, const Decoder* decoder,
                         const std::vector<std::uint8_t>& bits, ThreadExecutor& executor) {
  Measured sum;
  sum.worst = decoder == nullptr ? 0 : 1;
  const Pipeline<Base> pipeline;
  Pipeline<Base>::Context context;
  Decoder::Context reading;
  std::vector<float> logits(bits.size());
  Buffer<float> storage;
  const double share = 1 / static_cast<double>(scene.test.size());
  for (std::size_t i = 0; i < scene.test.size(); ++i) {
    const Camera<double> camera = scene.test.camera(i);
    static_cast<void>(pipeline.forward(model, camera, i, context, executor));
    round_to_8bit<float>(context.image, context.image);
    storage.resize(context.image.size());
    const ImageView<float> truth{storage.data(), 3, camera.height, camera.width};
    if (const Result<Done> loaded = scene.test.load(i, truth); !loaded) return loaded.error();
    sum.psnr += share * psnr(context.image, truth);
    sum.ssim += share * ssim(context.image, truth);
    if (decoder == nullptr) continue;
    decoder->forward(context.image, std::span<float>(logits), reading, executor);
    std::size_t right = 0;
    for (std::size_t b = 0; b < bits.size(); ++b) right += (logits[b] > 0) == (bits[b] != 0) ? 1 : 0;
    const double accuracy = static_cast<double>(right) / static_cast<double>(bits.size());
    sum.accuracy += share * accuracy;
    sum.worst = std::min(sum.worst, accuracy);
  }
  return sum;
}

}  // namespace ablation
