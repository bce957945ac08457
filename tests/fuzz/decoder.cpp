// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any change of a decoder file of each kind, its checksum made right: an answer, never a crash; an accepted one reads a
// small image.
#include <compmark/core/executor.hpp>
#include <compmark/watermark/decoder/decoder_file.hpp>
#include <compmark/watermark/decoder/lattice_file.hpp>
#include <compmark/watermark/decoder/stored_decoder.hpp>

#include "any_tensors.hpp"
#include "support/decoder.hpp"

namespace {

using namespace compmark;
using testing::LooseTensors;

/// What a writer was given, without a file.
class Collected {
 public:
  std::map<std::string, std::string> metadata;
  LooseTensors loose;
  template <class T>
  void add_values(const std::string& name, std::vector<std::int64_t> shape, std::span<const T> values) {
    const auto bytes = std::as_bytes(values);
    loose.tensors[name] = {std::string(safetensors_dtype<T>()), std::move(shape), {bytes.begin(), bytes.end()}};
  }
  [[nodiscard]] LooseTensors take() {
    loose.metadata = metadata;
    return std::move(loose);
  }
};

LooseTensors network(const DecoderWeights& weights) {
  Collected writer;
  add_decoder(weights, writer);
  return writer.take();
}

DecoderWeights carrier() {
  DecoderWeights weights = testing::small_decoder(4, 3, 2);
  weights.kind = DecoderKind::carrier;
  weights.bits = 0;
  weights.activation = DecoderActivation::relu;
  weights.linear_weight.clear();
  weights.linear_bias.clear();
  weights.layers[1].pool = weights.layers[1].tap = true;
  weights.whiten_weight.assign(4 * static_cast<std::size_t>(weights.features()), 0.5f);
  weights.whiten_bias.assign(4, -1.0f);
  return weights;
}

LooseTensors lattice(bool colour, bool cover, bool limited) {
  LatticeSettings settings;
  settings.measure = colour ? LatticeMeasure::colour : LatticeMeasure::contrast;
  settings.bits = 4;
  settings.features = 5;
  settings.sigma = {1.5, 3};
  settings.stride = 2;
  if (limited) {
    settings.regions = 4;
    settings.region_limit = 0.5;
  }
  LatticeWeights<float> weights(settings);
  const auto fill = [](std::vector<float>& values, std::size_t count) {
    values.resize(count);
    for (std::size_t i = 0; i < count; ++i) values[i] = 0.1f * static_cast<float>(i % 7) - 0.3f;
  };
  for (std::vector<float>* part : {&weights.frequency, &weights.phase, &weights.head, &weights.bias})
    fill(*part, part->size());
  if (cover) {
    fill(weights.cover.direction, 2 * 5);
    fill(weights.cover.offset, 2);
    fill(weights.cover.centre, 3 * 2);
    fill(weights.cover.coefficient, 3 * 4);
  }
  Collected writer;
  add_lattice(LatticeDecoder<float>(settings, weights), "", writer);
  return writer.take();
}

std::vector<LooseTensors> good_files() {
  std::vector<LooseTensors> files{network(testing::small_decoder(4, 3, 2)),
                                  network(testing::small_decoder(4, 3, 1, 2)),
                                  network(carrier()),
                                  lattice(false, false, false),
                                  lattice(true, true, false),
                                  lattice(true, true, true)};
  files.push_back(files[0]);  // as the published decoders are
  files.back().metadata.clear();
  return files;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<LooseTensors> good = good_files();
  testing::FuzzInput input(data, size);
  const std::vector<std::byte> bytes = testing::any_tensor_file(good, input);
  if (bytes.empty()) return 0;
  const Result<SafetensorsFile> file = parse_safetensors(bytes, "fuzz");
  if (!file) std::abort();
  static_cast<void>(expect_kind(*file, FileKind::decoder));
  const auto decoder = StoredDecoder<float>::read(*file, DecoderKey{{1, 2, 3, 4}, 3});
  if (!decoder) {
    testing::require_words(decoder.error());
    return 0;
  }
  const int side = decoder->minimum_size();
  if (side < 1 || decoder->bits() < 1) std::abort();
  if (side > 64) return 0;  // nothing new, but slow
  static const std::vector<float> pixels = testing::random_image<float>(64, 65);
  const std::size_t plane = static_cast<std::size_t>(side) * static_cast<std::size_t>(side + 1);
  const std::vector<float> image(pixels.begin(), pixels.begin() + static_cast<std::ptrdiff_t>(3 * plane));
  std::vector<float> logits(static_cast<std::size_t>(decoder->bits()));
  StoredDecoder<float>::Context context;
  SerialExecutor executor;
  decoder->forward({image.data(), 3, side, side + 1}, std::span<float>(logits), context, executor);
  return 0;
}
