// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The cover interference of one scene, for a decoder that knows no scene: what the decoder reads from renders of the
// unmarked model. Most of it changes with the view, so that a mean over views says little (docs/notebook/
// watermark_experiments.md). A picture is therefore recognised: a sketch of it, 8 x 8 means of the luma of its subject
// (subject_box.hpp) without their mean and scale, is compared with those of sampled views of the unmarked model, and
// what those views say is subtracted,
//   outputs -= share (mean + sum_i exp(-|sketch - sketch_i|^2 / 2) coefficient_i).
// Light, scaling, frames and JPEG hardly change a sketch. A picture that is like no view loses the mean alone.
//
// No key and no message is in it: outputs are those of the decoder before a key, so that p-values stay exact, and one
// file serves every key of the scene. along() makes it one of the logits of a key.
// watermark/fit/cover_interference_fit.hpp makes it. Cost: two passes over the picture and views (64 + outputs)
// multiply-adds; 4 (64 + outputs) bytes a view.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/area_resize.hpp"
#include "compmark/watermark/decoder/decoder_reader.hpp"
#include "compmark/watermark/decoder/subject_box.hpp"

namespace compmark {

/// What a picture is recognised by.
template <class T>
class PictureSketch {
 public:
  static constexpr int side = 8;
  static constexpr std::size_t values = 64;
  /// The distance at which two pictures say little of one another, where 2 is that of two that have nothing in common.
  static constexpr double width = 0.45;

  /// The sketch of an RGB picture, in units of `width`; zero of a flat picture, and of one that is smaller than a
  /// sketch. Valid until the next call.
  template <Executor E>
  [[nodiscard]] std::span<const T> of(ImageView<const T> image, E& executor) {
    sketch_.assign(values, T(0));
    if (image.channels != 3 || std::min(image.height, image.width) < side) return sketch_;
    const ImageView<const T> subject = cut_.of(image, subject_box(image, side));
    small_.resize(3 * values);
    const ImageView<T> small{small_.data(), 3, side, side};
    resize_.forward(subject, small, executor);
    double mean = 0, square = 0;
    for (std::size_t i = 0; i < values; ++i) {
      sketch_[i] = T(0.299) * small_[i] + T(0.587) * small_[values + i] + T(0.114) * small_[2 * values + i];
      mean += static_cast<double>(sketch_[i]) / static_cast<double>(values);
    }
    for (T& value : sketch_) {
      value -= static_cast<T>(mean);
      square += static_cast<double>(value) * static_cast<double>(value);
    }
    const bool flat = !(square > 1e-6 * static_cast<double>(values));  // a thousandth of the range
    const T scale = flat ? T(0) : static_cast<T>(1 / (width * std::sqrt(square)));
    for (T& value : sketch_) value = flat ? T(0) : value * scale;
    return sketch_;
  }

 private:
  PictureCut<T> cut_;
  AreaResize<T> resize_;
  std::vector<T> small_, sketch_;
};

struct CoverInterference {
  /// What is subtracted of what was said. A mark that was learned on a model knows its interference already and makes
  /// up for a part of it.
  static constexpr double share = 0.5;

  std::vector<float> mean;         ///< [outputs]
  std::vector<float> sketch;       ///< [views, PictureSketch::values]
  std::vector<float> coefficient;  ///< [views, outputs]
  std::string decoder_sha256;      ///< of the decoder's file, 64 hexadecimal digits

  [[nodiscard]] std::size_t outputs() const { return mean.size(); }
  [[nodiscard]] std::size_t views() const { return sketch.size() / PictureSketch<float>::values; }

  /// Subtracts from outputs [outputs()] that `part` of what the unmarked scene says in a picture of this sketch.
  void subtract(std::span<const float> picture, std::span<double> outputs, double part = share) const {
    constexpr std::size_t values = PictureSketch<float>::values;
    COMPMARK_ASSERT(picture.size() == values && outputs.size() == mean.size(), "CoverInterference: sizes");
    std::vector<double> said(mean.begin(), mean.end());
    for (std::size_t i = 0; i < views(); ++i) {
      double square = 0;
      for (std::size_t k = 0; k < values; ++k) {
        const double difference = static_cast<double>(picture[k]) - static_cast<double>(sketch[i * values + k]);
        square += difference * difference;
      }
      const double weight = std::exp(-square / 2);
      for (std::size_t d = 0; d < said.size(); ++d)
        said[d] += weight * static_cast<double>(coefficient[i * said.size() + d]);
    }
    for (std::size_t d = 0; d < said.size(); ++d) outputs[d] -= part * said[d];
  }

  /// That of the logits of a key with these carriers [bits, outputs()] (proof/carriers.hpp).
  [[nodiscard]] CoverInterference along(std::span<const double> carriers) const {
    COMPMARK_ASSERT(!mean.empty() && carriers.size() % mean.size() == 0, "CoverInterference: carriers");
    const auto projected = [&](const std::vector<float>& rows) {
      const std::size_t dimension = mean.size(), bits = carriers.size() / dimension;
      std::vector<float> out(rows.size() / dimension * bits);
      for (std::size_t i = 0; i < out.size(); ++i) {
        const double* const carrier = carriers.data() + i % bits * dimension;
        const float* const row = rows.data() + i / bits * dimension;
        double sum = 0;
        for (std::size_t d = 0; d < dimension; ++d) sum += carrier[d] * static_cast<double>(row[d]);
        out[i] = static_cast<float>(sum);
      }
      return out;
    };
    return {projected(mean), sketch, projected(coefficient), decoder_sha256};
  }
};

inline constexpr std::string_view cover_interference_format = "compmark cover interference";
inline constexpr int cover_interference_version = 1;

/// The interference of a tensor file, or one line why not. No number is believed before it is checked.
template <class TensorFile>
[[nodiscard]] Result<CoverInterference> read_cover_interference(const TensorFile& file) {
  constexpr const char* remedy = "measure it again with `compmark interference`";
  detail::DecoderReader<TensorFile> reader(file);
  if (reader.text("format") != cover_interference_format)
    reader.fail(ErrorKind::unsupported, "__metadata__.format",
                "is not \"" + std::string(cover_interference_format) + "\"", remedy);
  if (reader.integer("format_version", 1, 1 << 30) > cover_interference_version)
    reader.fail(ErrorKind::unsupported, "__metadata__.format_version", "is newer than this program's",
                "use a newer program");
  const int outputs = reader.integer("outputs", 1, 4096), views = reader.integer("views", 1, 1 << 20);
  CoverInterference interference;
  interference.decoder_sha256 = reader.text("decoder_sha256");
  if (interference.decoder_sha256.size() != 64)
    reader.fail(ErrorKind::invalid, "__metadata__.decoder_sha256", "is not 64 digits", remedy);
  interference.mean = reader.tensor("mean", outputs);
  interference.sketch = reader.tensor("sketch", views, static_cast<int>(PictureSketch<float>::values));
  interference.coefficient = reader.tensor("coefficient", views, outputs);
  if (!reader.failed()) return interference;
  Error error = reader.error();
  if (error.remedy != "use a newer program") error.remedy = remedy;
  return error;
}

/// Writes a whole file: write_cover_interference<SafetensorsWriter>(interference, note, path).
template <class Writer, class Path>
[[nodiscard]] Result<Done> write_cover_interference(const CoverInterference& interference, const std::string& note,
                                                    const Path& path) {
  const auto views = static_cast<std::int64_t>(interference.views()),
             outputs = static_cast<std::int64_t>(interference.outputs());
  Writer writer;
  writer.metadata["format"] = std::string(cover_interference_format);
  writer.metadata["format_version"] = std::to_string(cover_interference_version);
  writer.metadata["outputs"] = std::to_string(outputs);
  writer.metadata["views"] = std::to_string(views);
  writer.metadata["decoder_sha256"] = interference.decoder_sha256;
  if (!note.empty()) writer.metadata["note"] = note;
  writer.add_values("mean", {outputs}, std::span<const float>(interference.mean));
  writer.add_values("sketch", {views, static_cast<std::int64_t>(PictureSketch<float>::values)},
                    std::span<const float>(interference.sketch));
  writer.add_values("coefficient", {views, outputs}, std::span<const float>(interference.coefficient));
  return writer.write(path);
}

}  // namespace compmark
