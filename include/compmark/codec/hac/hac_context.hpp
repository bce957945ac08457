// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Makes the integer context of a HAC file from the trained one, and evaluates it while a chunk is coded. Its only input
// is the voxel of an anchor.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/codec/container/chunk_coding.hpp"
#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/container/network_choice.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"

namespace compmark::detail {

/// Evaluates the context for the voxels of a chunk; coded values do not change it.
class HacPredictor : public ContextEvaluator {
 public:
  HacPredictor(const IntegerContext& context, const IntegerNetwork::Packed& packed, std::span<const Voxel> voxels)
      : ContextEvaluator(context, packed),
        voxels_(voxels) {}
  void look(std::size_t first, std::size_t count) { evaluate(voxels_.subspan(first, count)); }
  void tell(std::size_t /*anchor*/, std::size_t /*channel*/, std::int32_t /*symbol*/, int /*index*/) {}

 private:
  std::span<const Voxel> voxels_;
};

[[nodiscard]] inline Error no_context(std::string problem) {
  return {ErrorKind::invalid, "", "context", std::move(problem), "train it with a codec's recipe"};
}
[[nodiscard]] inline FloatContext float_context(const TrainedContext& trained) {
  return {static_cast<std::size_t>(trained.shape.channels()),
          trained.hidden,
          trained.weight1,
          trained.bias1,
          trained.weight2,
          trained.bias2,
          trained.statistics};
}
template <class Model>
[[nodiscard]] Result<Done> check_context(const IntegerContext& context, const Model& model) {
  if (context.heads.outputs() != model.heads().outputs() || context.heads.feature != model.feature_dim) {
    return no_context("it is that of other attributes");
  }
  return context.check();
}
/// The trained context in whole numbers, but for its network.
template <class Model>
[[nodiscard]] Result<IntegerContext> trained_grid(const Model& model) {
  if (!model.trained) return no_context("the model has none");
  const TrainedContext& trained = *model.trained;
  if (!trained.shape.valid()) return no_context("the hash grid's shape is not valid");
  if (trained.signs.size() != trained.shape.entries())
    return no_context("the hash grid does not have the entries of its shape");
  const VoxelBox box = make_voxel_box(trained.box, model.voxel_size);
  if (!box.valid()) return no_context("its box is not finite, inverted or too far away");
  IntegerContext context;
  context.heads = model.heads();
  context.grid = IntegerHashGrid(trained.shape, box);
  for (std::size_t i = 0; i < trained.signs.size(); ++i) context.grid.entries()[i] = trained.signs[i] & 15u;
  return context;
}

/// The integer context of a model: the one it has, or its trained one in integers of these bits.
template <class Model>
[[nodiscard]] Result<IntegerContext> context_of(const Model& model, const WeightBits& bits) {
  Result<IntegerContext> context = model.context ? Result<IntegerContext>(*model.context) : trained_grid(model);
  if (!context) return context;
  if (!model.context) {
    IntegerNetworkSettings settings;
    settings.bits = bits;
    settings.base_step = model.base_step;
    Result<IntegerNetwork> network = quantize_network(float_context(*model.trained), context->heads, settings);
    if (!network) return network.error();
    context->network = std::move(*network);
  }
  const Result<Done> checked = check_context(*context, model);
  if (!checked) return checked.error();
  return context;
}

/// The context for the coded anchors, with the bits asked for or with those that make the smallest file.
template <Executor E>
[[nodiscard]] Result<IntegerContext> choose_context(const CodecModel& model, const CodecModel& coded,
                                                    const GaussianTables& tables,
                                                    const std::optional<WeightBits>& asked, E& executor) {
  Result<IntegerContext> context = context_of(model, asked.value_or(WeightBits::all(10)));
  if (!context || model.context || asked || coded.anchors() == 0) return context;
  const IntegerNetwork::Packed packed = context->network.pack();
  HacPredictor predictor(*context, packed, coded.voxels);
  NetworkSample sample = sample_network(coded, 0, coded.anchors(), predictor);
  IntegerNetworkSettings settings;
  settings.base_step = model.base_step;
  const ChunkCoder coder{context->heads, tables, model.base_step, model.offset_count};
  Result<IntegerNetwork> network = choose_network(float_context(*model.trained), settings, coder, sample, 5, executor);
  if (!network) return network.error();
  context->network = std::move(*network);
  return context;
}

}  // namespace compmark::detail
