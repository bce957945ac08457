// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Lattice decoders in tensor files, in the format of decoder_reader.hpp with kind "lattice". Tensors: wave.frequency
// [features, dimensions], wave.phase [features], head.weight [bits, features], head.bias [bits]. Metadata: measure
// ("contrast", also where it is missing: 3 octaves dimensions; "colour": 3 (octaves + 1)), bits, features, octaves,
// sigma (octaves + 1 numbers), stride, epsilon, gate, floor, logit_scale, note. A decoder for one scene may have
// host.direction [coordinates, features], host.offset [coordinates], host.centre [centres, coordinates] and
// host.coefficient [centres, bits] (cover_prediction.hpp), with the metadata coordinates and centres: format_version 2.
// One whose regions have a limit has the metadata regions and region_limit: format_version 3, with or without a
// prediction. No number is believed before it is checked. Cost: one pass over the weights.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/watermark/decoder/decoder_reader.hpp"
#include "compmark/watermark/decoder/decoder_weights.hpp"
#include "compmark/watermark/decoder/decoder_writer.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"

namespace compmark {

/// Of files with a cover prediction, and of those with limited regions; all others are version 1, which older programs
/// read.
inline constexpr int lattice_cover_format_version = 2, lattice_limit_format_version = 3;

/// Whether a tensor file says that it holds a lattice decoder.
template <class TensorFile>
[[nodiscard]] bool is_lattice_file(const TensorFile& file) {
  const auto kind = file.metadata.find("kind");
  return kind != file.metadata.end() && kind->second == "lattice";
}

/// The decoder of a file, or one line why not.
template <class T = float, class TensorFile>
[[nodiscard]] Result<LatticeDecoder<T>> read_lattice(const TensorFile& file) {
  detail::DecoderReader<TensorFile> reader(file);
  if (reader.text("format") != decoder_format)
    reader.fail(ErrorKind::unsupported, "__metadata__.format", "is not \"" + std::string(decoder_format) + "\"",
                reader.remedy);
  const int version_number = reader.integer("format_version", 1, 1 << 30);
  if (version_number > lattice_limit_format_version)
    reader.fail(ErrorKind::unsupported, "__metadata__.format_version", "is newer than this program's",
                "use a newer program");
  if (reader.text("kind") != "lattice")
    reader.fail(ErrorKind::unsupported, "__metadata__.kind", "is not lattice", reader.remedy);
  LatticeSettings settings;
  if (file.metadata.contains("measure")) {
    const std::string measure = reader.text("measure");
    if (measure == "colour") {
      settings.measure = LatticeMeasure::colour;
    } else if (measure != "contrast") {
      reader.fail(ErrorKind::unsupported, "__metadata__.measure", "is neither contrast nor colour",
                  "use a newer program");
    }
  }
  const bool colour = settings.measure == LatticeMeasure::colour;
  settings.bits = reader.integer("bits", 1, 4096);
  settings.features = reader.integer("features", 1, 4096);
  const int octaves = reader.integer("octaves", colour ? 0 : 1, colour ? 7 : 8);
  settings.stride = reader.integer("stride", 1, 64);
  settings.sigma = reader.numbers("sigma", static_cast<std::size_t>(octaves) + 1);
  for (std::size_t b = 0; b < settings.sigma.size(); ++b) {
    const double low = b == 0 ? 0 : settings.sigma[b - 1];
    if (!(settings.sigma[b] > low && settings.sigma[b] <= 256))
      reader.fail(ErrorKind::invalid, "__metadata__.sigma", "does not grow from above 0 to at most 256", reader.remedy);
  }
  const auto positive = [&](const char* key, double& value) {
    value = reader.numbers(key, 1)[0];
    if (!(value > 0 && value <= 1e3))
      reader.fail(ErrorKind::invalid, std::string("__metadata__.") + key, "is not between 0 and 1000", reader.remedy);
  };
  positive("epsilon", settings.epsilon);
  positive("gate", settings.gate);
  positive("floor", settings.floor);
  positive("logit_scale", settings.logit_scale);
  // Without its limit, or its prediction, such a file would be read as another decoder.
  const bool limited = version_number >= lattice_limit_format_version;
  if (limited) {
    settings.regions = reader.integer("regions", 1, 4096);
    settings.region_limit = reader.numbers("region_limit", 1)[0];
    if (!(settings.region_limit > 0 && settings.region_limit <= std::numeric_limits<float>::max()))
      reader.fail(ErrorKind::invalid, "__metadata__.region_limit", "is not above 0 and finite", reader.remedy);
  } else if (file.metadata.contains("regions") || file.metadata.contains("region_limit")) {
    reader.fail(ErrorKind::invalid, "__metadata__.format_version", "is older than the limited regions of the file",
                reader.remedy);
  }
  if (reader.failed()) return reader.error();

  const std::vector<float> frequency =
      reader.tensor("wave.frequency", settings.features, static_cast<int>(settings.dimensions()));
  const std::vector<float> phase = reader.tensor("wave.phase", settings.features);
  const std::vector<float> head = reader.tensor("head.weight", settings.bits, settings.features);
  const std::vector<float> bias = reader.tensor("head.bias", settings.bits);
  LatticeWeights<T> weights;
  const bool predicts = limited ? file.metadata.contains("coordinates") || file.metadata.contains("centres") ||
                                      file.tensors.contains("host.direction")
                                : version_number >= lattice_cover_format_version;
  if (predicts) {
    const int coordinates = reader.integer("coordinates", 1, settings.features);
    const int centres = reader.integer("centres", 1, 1 << 20);
    const auto part = [&](const char* name, std::vector<T>& values, auto... extents) {
      const std::vector<float> read = reader.tensor(name, extents...);
      values.assign(read.begin(), read.end());
    };
    part("host.direction", weights.cover.direction, coordinates, settings.features);
    part("host.offset", weights.cover.offset, coordinates);
    part("host.centre", weights.cover.centre, centres, coordinates);
    part("host.coefficient", weights.cover.coefficient, centres, settings.bits);
  }
  if (reader.failed()) return reader.error();
  weights.frequency.assign(frequency.begin(), frequency.end());
  weights.phase.assign(phase.begin(), phase.end());
  weights.head.assign(head.begin(), head.end());
  weights.bias.assign(bias.begin(), bias.end());
  return LatticeDecoder<T>(std::move(settings), std::move(weights));
}

/// Hands tensors and metadata to a writer. Values are not copied: `decoder` must live until it has written.
template <class Writer>
void add_lattice(const LatticeDecoder<float>& decoder, const std::string& note, Writer& writer) {
  const LatticeSettings& s = decoder.settings();
  const LatticeWeights<float>& w = decoder.weights();
  auto& m = writer.metadata;
  m["format"] = std::string(decoder_format);
  m["format_version"] = std::to_string(s.limited()       ? lattice_limit_format_version
                                       : w.cover.empty() ? decoder_format_version
                                                         : lattice_cover_format_version);
  m["kind"] = "lattice";
  m["measure"] = s.measure == LatticeMeasure::colour ? "colour" : "contrast";
  m["bits"] = std::to_string(s.bits);
  m["features"] = std::to_string(s.features);
  m["octaves"] = std::to_string(s.sigma.size() - 1);
  m["stride"] = std::to_string(s.stride);
  std::string sigma;
  for (const double value : s.sigma) {
    if (!sigma.empty()) sigma += ' ';
    sigma += detail::exact_text(value);
  }
  m["sigma"] = sigma;
  m["epsilon"] = detail::exact_text(s.epsilon);
  m["gate"] = detail::exact_text(s.gate);
  m["floor"] = detail::exact_text(s.floor);
  m["logit_scale"] = detail::exact_text(s.logit_scale);
  if (s.limited()) {
    m["regions"] = std::to_string(s.regions);
    m["region_limit"] = detail::exact_text(s.region_limit);
  }
  if (!note.empty()) m["note"] = note;
  const auto features = static_cast<std::int64_t>(s.features);
  writer.add_values("wave.frequency", {features, static_cast<std::int64_t>(s.dimensions())},
                    std::span<const float>(w.frequency));
  writer.add_values("wave.phase", {features}, std::span<const float>(w.phase));
  writer.add_values("head.weight", {s.bits, features}, std::span<const float>(w.head));
  writer.add_values("head.bias", {s.bits}, std::span<const float>(w.bias));
  if (w.cover.empty()) return;
  const auto coordinates = static_cast<std::int64_t>(w.cover.coordinates());
  const auto centres = static_cast<std::int64_t>(w.cover.centres());
  m["coordinates"] = std::to_string(coordinates);
  m["centres"] = std::to_string(centres);
  writer.add_values("host.direction", {coordinates, features}, std::span<const float>(w.cover.direction));
  writer.add_values("host.offset", {coordinates}, std::span<const float>(w.cover.offset));
  writer.add_values("host.centre", {centres, coordinates}, std::span<const float>(w.cover.centre));
  writer.add_values("host.coefficient", {centres, s.bits}, std::span<const float>(w.cover.coefficient));
}

/// Writes a whole file: write_lattice<SafetensorsWriter>(decoder, note, path).
template <class Writer, class Path>
[[nodiscard]] Result<Done> write_lattice(const LatticeDecoder<float>& decoder, const std::string& note,
                                         const Path& path) {
  Writer writer;
  add_lattice(decoder, note, writer);
  return writer.write(path);
}

}  // namespace compmark
