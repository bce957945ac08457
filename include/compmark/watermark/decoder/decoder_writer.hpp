// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Decoder weights into a tensor file, as decoder_reader.hpp reads them. Numbers of the metadata are written with as
// many digits as bring the same double back. `Writer` is SafetensorsWriter or anything with metadata, add_values() and
// write(). Cost: no copy of a weight.
#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/number_text.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"

namespace compmark {

/// Hands tensors and metadata to a writer. Values are not copied: `weights` must live until it has written.
template <class Writer>
void add_decoder(const DecoderWeights& weights, Writer& writer) {
  const auto three = [](const std::array<double, 3>& v) {
    return detail::exact_text(v[0]) + " " + detail::exact_text(v[1]) + " " + detail::exact_text(v[2]);
  };
  const auto add = [&](const std::string& name, std::vector<std::int64_t> shape, const std::vector<float>& values) {
    writer.add_values(name, std::move(shape), std::span<const float>(values));
  };
  auto& m = writer.metadata;
  m["format"] = std::string(decoder_format);
  m["format_version"] = std::to_string(decoder_format_version);
  m["kind"] = weights.kind == DecoderKind::hidden    ? "hidden"
              : weights.kind == DecoderKind::strided ? "strided"
                                                     : "carrier";
  m["bits"] = std::to_string(weights.bits);
  m["width"] = std::to_string(weights.width);
  m["depth"] = std::to_string(weights.depth);
  m["stem"] = std::to_string(weights.stem);
  m["activation"] = weights.activation == DecoderActivation::gelu ? "gelu" : "relu";
  m["norm_epsilon"] = detail::exact_text(weights.norm_epsilon);
  m["logit_scale"] = detail::exact_text(weights.logit_scale);
  m["haar_levels"] = std::to_string(weights.input.haar_levels);
  m["largest_side"] = std::to_string(weights.input.largest_side);
  if (weights.input.smallest_side != 0) m["smallest_side"] = std::to_string(weights.input.smallest_side);
  if (weights.input.subject_alone) m["reads"] = "subject";
  if (weights.input.middle != 0) m["middle"] = detail::exact_text(weights.input.middle);
  m["input_gain"] = detail::exact_text(weights.input.gain);
  m["input_mean"] = three(weights.input.mean);
  m["input_deviation"] = three(weights.input.deviation);
  if (!weights.note.empty()) m["note"] = weights.note;
  std::string layers;
  for (std::size_t n = 0; n < weights.layers.size(); ++n) {
    const DecoderLayer& layer = weights.layers[n];
    const ConvShape& s = layer.shape;
    if (n != 0) layers += ' ';
    layers += std::to_string(s.kernel) + "/" + std::to_string(s.stride) + "/" + std::to_string(s.padding) +
              (layer.pool ? "m" : "") + (layer.tap ? "t" : "");
    const std::string block = "blocks." + std::to_string(n) + ".";
    add(block + "conv.weight", {s.out, s.in, s.kernel, s.kernel}, layer.weight);
    add(block + "conv.bias", {s.out}, layer.bias);
    if (layer.norm_weight.empty()) continue;
    add(block + "bn.weight", {s.out}, layer.norm_weight);
    add(block + "bn.bias", {s.out}, layer.norm_bias);
    add(block + "bn.running_mean", {s.out}, layer.norm_mean);
    add(block + "bn.running_var", {s.out}, layer.norm_variance);
  }
  m["layers"] = layers;
  const std::int64_t features = weights.features();
  if (!weights.linear_bias.empty()) {
    const std::int64_t rows = static_cast<std::int64_t>(weights.linear_bias.size());
    add("linear.weight", {rows, features}, weights.linear_weight);
    add("linear.bias", {rows}, weights.linear_bias);
  }
  if (!weights.whiten_bias.empty()) {
    const std::int64_t rows = weights.dimension();
    add("whiten.weight", {rows, weights.kind == DecoderKind::carrier ? features : rows}, weights.whiten_weight);
    add("whiten.bias", {rows}, weights.whiten_bias);
  }
}

/// Writes a whole file: write_decoder<SafetensorsWriter>(weights, path).
template <class Writer, class Path>
[[nodiscard]] Result<Done> write_decoder(const DecoderWeights& weights, const Path& path) {
  Writer writer;
  add_decoder(weights, writer);
  return writer.write(path);
}

}  // namespace compmark
