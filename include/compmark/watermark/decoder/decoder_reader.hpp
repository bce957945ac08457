// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Decoder weights from a safetensors file: the tensors of docs/spec/watermark.md, 1.2, and as metadata format "compmark
// decoder", format_version, kind (hidden, strided, carrier), bits, width, depth, stem, activation, layers (carrier:
// "kernel/stride/padding" each, m: max pool before, t: tap behind), norm_epsilon, logit_scale, and the input
// convention. Files without a format are the published HiDDeN decoders: sizes come from their tensors, the convention
// is the raw Haar LL (docs/spec/method.md, 5.3). No number is believed before its tensor has that shape. `TensorFile`
// is anything with path, metadata, tensors, has() and floats(): io is not included. Longer than 300 lines: the checks
// of one format, in its order.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"

namespace compmark {

namespace detail {

/// Reads one file; the first error is kept and everything after it is empty.
template <class TensorFile>
class DecoderReader {
 public:
  explicit DecoderReader(const TensorFile& file) : file_(file) {}

  [[nodiscard]] bool failed() const { return failed_; }
  [[nodiscard]] const Error& error() const { return error_; }
  void fail(ErrorKind kind, std::string field, std::string problem, std::string advice) {
    if (failed_) return;
    failed_ = true;
    error_ = {kind, file_.path, std::move(field), std::move(problem), std::move(advice)};
  }

  [[nodiscard]] std::string text(const std::string& key) {
    const auto found = file_.metadata.find(key);
    if (found != file_.metadata.end()) return found->second;
    fail(ErrorKind::invalid, "__metadata__." + key, "is missing", remedy);
    return {};
  }
  [[nodiscard]] int integer(const std::string& key, int low, int high) {
    const std::string value = text(key);
    int result = 0;
    const auto [end, status] = std::from_chars(value.data(), value.data() + value.size(), result);
    if (status == std::errc() && end == value.data() + value.size() && result >= low && result <= high) return result;
    fail(
        ErrorKind::invalid, "__metadata__." + key,
        "\"" + value.substr(0, 40) + "\" is not an integer from " + std::to_string(low) + " to " + std::to_string(high),
        remedy);
    return low;
  }
  /// `count` finite numbers, separated by spaces.
  [[nodiscard]] std::vector<double> numbers(const std::string& key, std::size_t count) {
    const std::string value = text(key);
    std::vector<double> result;
    const char* at = value.data();
    const char* const end = at + value.size();
    while (at != end) {
      double number = 0;
      const auto [next, status] = std::from_chars(at, end, number);
      if (status != std::errc() || !std::isfinite(number)) break;
      result.push_back(number);
      at = next;
      if (at != end && *at == ' ') ++at;
    }
    if (at == end && result.size() == count) return result;
    fail(ErrorKind::invalid, "__metadata__." + key,
         "\"" + value.substr(0, 40) + "\" is not " + std::to_string(count) + " finite number" + (count == 1 ? "" : "s"),
         remedy);
    return std::vector<double>(count, 1.0);
  }

  template <class... Extents>
  [[nodiscard]] std::vector<float> tensor(const std::string& name, Extents... extents) {
    if (failed_) return {};
    auto values = file_.floats(name, {static_cast<std::int64_t>(extents)...});
    if (!values) {
      failed_ = true;
      error_ = values.error();
      error_.remedy = remedy;
      return {};
    }
    for (const float value : *values) {
      if (!std::isfinite(value)) {
        fail(ErrorKind::invalid, name, std::isnan(value) ? "holds a NaN" : "holds an infinity",
             "the weights are damaged: copy or train them again");
        return {};
      }
    }
    return std::move(*values);
  }
  /// Extent `axis` of a tensor; `fallback` where it is not there.
  [[nodiscard]] std::int64_t extent(const std::string& name, std::size_t axis, std::int64_t fallback) const {
    const auto found = file_.tensors.find(name);
    return found == file_.tensors.end() || found->second.shape.size() <= axis ? fallback : found->second.shape[axis];
  }

  void layer(std::size_t n, DecoderLayer& layer) {
    const std::string block = "blocks." + std::to_string(n) + ".";
    const ConvShape& s = layer.shape;
    layer.weight = tensor(block + "conv.weight", s.out, s.in, s.kernel, s.kernel);
    layer.bias = tensor(block + "conv.bias", s.out);
    if (!file_.has(block + "bn.weight") && !file_.has(block + "bn.running_var")) return;
    layer.norm_weight = tensor(block + "bn.weight", s.out);
    layer.norm_bias = tensor(block + "bn.bias", s.out);
    layer.norm_mean = tensor(block + "bn.running_mean", s.out);
    layer.norm_variance = tensor(block + "bn.running_var", s.out);
    for (const float value : layer.norm_variance) {
      if (value < 0) fail(ErrorKind::invalid, block + "bn.running_var", "holds a variance below 0", remedy);
    }
  }

  static constexpr const char* remedy = "check that this is a decoder file, or train one with `compmark pretrain`";

 private:
  const TensorFile& file_;
  bool failed_ = false;
  Error error_;
};

/// "3/1/1 3/2/1m 3/1/1t": kernel, stride, padding and marks of each layer; channels come from the tensors.
template <class Reader>
[[nodiscard]] std::vector<DecoderLayer> parse_layers(Reader& reader, int stem) {
  const std::string text = reader.text("layers");
  const auto bad = [&] {
    reader.fail(ErrorKind::invalid, "__metadata__.layers",
                "\"" + text.substr(0, 40) + "\" is not a list of kernel/stride/padding that an image fits",
                Reader::remedy);
    return std::vector<DecoderLayer>();
  };
  std::vector<DecoderLayer> layers;
  int in = 3 * stem * stem;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at != end) {
    int numbers[3] = {0, 0, 0};
    for (int i = 0; i < 3; ++i) {
      if (i > 0 && (at == end || *at++ != '/')) return bad();
      const auto [next, status] = std::from_chars(at, end, numbers[i]);
      if (status != std::errc()) return bad();
      at = next;
    }
    DecoderLayer layer;
    for (; at != end && *at != ' '; ++at) {
      if (*at == 'm') {
        layer.pool = true;
      } else if (*at == 't') {
        layer.tap = true;
      } else {
        return bad();
      }
    }
    if (at != end) ++at;
    const auto [kernel, stride, padding] = numbers;
    if (kernel < 1 || kernel > 16 || stride < 1 || stride > kernel || padding < 0 || padding >= kernel ||
        layers.size() == 64)
      return bad();
    const std::string name = "blocks." + std::to_string(layers.size()) + ".conv.weight";
    const std::int64_t out = reader.extent(name, 0, 1);
    if (out < 1 || out > 4096) {
      reader.fail(ErrorKind::invalid, name, std::to_string(out) + " channels are not 1 to 4096", Reader::remedy);
      return {};
    }
    layer.shape = {in, static_cast<int>(out), kernel, stride, padding};
    in = static_cast<int>(out);
    layers.push_back(std::move(layer));
  }
  if (layers.empty() || !layers.back().tap || smallest_input(layers) == 0) return bad();
  return layers;
}

/// Sizes of a published file from its tensors; what does not fit shows when the tensors are read.
template <class TensorFile>
void import_sizes(const TensorFile& file, DecoderReader<TensorFile>& reader, DecoderWeights& weights) {
  if (!file.has("blocks.0.conv.weight")) {
    reader.fail(ErrorKind::invalid, "blocks.0.conv.weight", "no such tensor", reader.remedy);
    return;
  }
  int blocks = 0;
  while (blocks <= 64 && file.has("blocks." + std::to_string(blocks) + ".conv.weight")) ++blocks;
  const std::int64_t width = reader.extent("blocks.0.conv.weight", 0, 0);
  const std::int64_t bits = reader.extent("linear.weight", 0, 0);
  if (blocks < 2 || blocks > 64 || width < 1 || width > 1024 || bits < 1 || bits > 4096) {
    reader.fail(ErrorKind::invalid, "sizes",
                std::to_string(blocks) + " blocks, " + std::to_string(width) + " channels, " + std::to_string(bits) +
                    " bits are not those of a HiDDeN decoder",
                reader.remedy);
    return;
  }
  weights.width = static_cast<int>(width);
  weights.depth = blocks - 1;
  weights.bits = static_cast<int>(bits);
}

}  // namespace detail

/// The weights of a file, or one line why not.
template <class TensorFile>
[[nodiscard]] Result<DecoderWeights> read_decoder(const TensorFile& file) {
  detail::DecoderReader<TensorFile> reader(file);
  DecoderWeights weights;
  if (file.metadata.count("format") == 0) {
    detail::import_sizes(file, reader, weights);
    const auto model = file.metadata.find("model");
    if (model != file.metadata.end()) weights.note = model->second;
  } else {
    const std::string format = reader.text("format");
    if (format != decoder_format)
      reader.fail(ErrorKind::unsupported, "__metadata__.format",
                  "\"" + format.substr(0, 40) + "\" is not \"" + std::string(decoder_format) + "\"", reader.remedy);
    const int written = reader.integer("format_version", 1, 1 << 30);
    if (written > decoder_format_version)
      reader.fail(ErrorKind::unsupported, "__metadata__.format_version",
                  std::to_string(written) + " is newer than this program's " + std::to_string(decoder_format_version),
                  "use a newer program");
    const std::string kind = reader.text("kind");
    if (kind == "strided") {
      weights.kind = DecoderKind::strided;
    } else if (kind == "carrier") {
      weights.kind = DecoderKind::carrier;
    } else if (kind != "hidden") {
      reader.fail(ErrorKind::unsupported, "__metadata__.kind",
                  "\"" + kind.substr(0, 40) + "\" is not hidden, strided or carrier", reader.remedy);
    }
    weights.bits = weights.kind == DecoderKind::carrier ? 0 : reader.integer("bits", 1, 4096);
    weights.width = reader.integer("width", 1, 1024);
    weights.depth = reader.integer("depth", 1, 63);
    weights.stem = reader.integer("stem", 1, 8);
    const std::string activation = reader.text("activation");
    if (activation == "relu") {
      weights.activation = DecoderActivation::relu;
    } else if (activation != "gelu") {
      reader.fail(ErrorKind::unsupported, "__metadata__.activation",
                  "\"" + activation.substr(0, 40) + "\" is not gelu or relu", reader.remedy);
    }
    weights.norm_epsilon = reader.numbers("norm_epsilon", 1)[0];
    if (!(weights.norm_epsilon > 0))
      reader.fail(ErrorKind::invalid, "__metadata__.norm_epsilon", "is not above 0", reader.remedy);
    weights.logit_scale = reader.numbers("logit_scale", 1)[0];
    if (!(weights.logit_scale > 0))
      reader.fail(ErrorKind::invalid, "__metadata__.logit_scale", "is not above 0", reader.remedy);
    weights.input.haar_levels = reader.integer("haar_levels", 0, 2);
    weights.input.largest_side = reader.integer("largest_side", 0, 1 << 20);
    if (file.metadata.contains("smallest_side")) {  // not in older files
      // Every picture is enlarged to it: a larger one would ask for more memory than machines have.
      const int largest = weights.input.largest_side, most = 1 << 13;
      weights.input.smallest_side = reader.integer("smallest_side", 0, largest != 0 ? std::min(largest, most) : most);
    }
    if (file.metadata.contains("reads")) {  // what of a picture; not in older files
      const std::string reads = reader.text("reads");
      weights.input.subject_alone = reads == "subject";
      if (reads != "subject" && reads != "picture")
        reader.fail(ErrorKind::unsupported, "__metadata__.reads",
                    "\"" + reads.substr(0, 40) + "\" is not picture or subject", reader.remedy);
    }
    if (file.metadata.contains("middle")) {  // not in older files
      weights.input.middle = reader.numbers("middle", 1)[0];
      if (!(weights.input.middle > 0 && weights.input.middle < 1))
        reader.fail(ErrorKind::invalid, "__metadata__.middle", "is not between 0 and 1", reader.remedy);
    }
    weights.input.gain = reader.numbers("input_gain", 1)[0];
    const std::vector<double> mean = reader.numbers("input_mean", 3), deviation = reader.numbers("input_deviation", 3);
    for (std::size_t c = 0; c < 3; ++c) {
      weights.input.mean[c] = mean[c];
      weights.input.deviation[c] = deviation[c];
      if (!(deviation[c] > 0))
        reader.fail(ErrorKind::invalid, "__metadata__.input_deviation", "is not above 0", reader.remedy);
    }
    if (file.metadata.contains("note")) weights.note = file.metadata.at("note");
    if (weights.kind == DecoderKind::hidden && weights.stem != 1)
      reader.fail(ErrorKind::invalid, "__metadata__.stem", "a hidden decoder has none (1)", reader.remedy);
  }
  if (reader.failed()) return reader.error();

  if (weights.kind == DecoderKind::carrier) {
    weights.layers = detail::parse_layers(reader, weights.stem);
  } else {
    const std::int64_t features = reader.extent("linear.weight", 1, weights.bits);
    if (features < 1 || features > 4096)
      reader.fail(ErrorKind::invalid, "linear.weight", std::to_string(features) + " features are not 1 to 4096",
                  reader.remedy);
    if (!reader.failed())
      weights.layers = hidden_layers(weights.width, weights.depth, static_cast<int>(features), weights.stem);
  }
  for (std::size_t n = 0; n < weights.layers.size() && !reader.failed(); ++n) reader.layer(n, weights.layers[n]);
  if (weights.kind == DecoderKind::carrier) {
    const std::int64_t rows = reader.extent("whiten.weight", 0, 1);
    if (rows < 1 || rows > weights.features())
      reader.fail(ErrorKind::invalid, "whiten.weight",
                  std::to_string(rows) + " rows for " + std::to_string(weights.features()) + " features",
                  reader.remedy);
    weights.whiten_weight = reader.tensor("whiten.weight", rows, weights.features());
    weights.whiten_bias = reader.tensor("whiten.bias", rows);
  } else {
    weights.linear_weight = reader.tensor("linear.weight", weights.bits, weights.features());
    weights.linear_bias = reader.tensor("linear.bias", weights.bits);
    if (file.has("whiten.weight") || file.has("whiten.bias")) {
      weights.whiten_weight = reader.tensor("whiten.weight", weights.bits, weights.bits);
      weights.whiten_bias = reader.tensor("whiten.bias", weights.bits);
    }
  }
  if (reader.failed()) return reader.error();
  return weights;
}

}  // namespace compmark
