// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Writes SOG files of PlayCanvas, version 2, as one archive of stored entries (docs/splat_formats.md): meta.json and
// lossless images with a pixel a splat: WebP where the program has libwebp, else PNG (sog_image.hpp).
//   means_l, means_u   low and high byte of 16 bits of sign(x) log(1 + |x|) within means.mins and means.maxs
//   quats   3 bytes, 0 to 255 for -1/sqrt 2 to 1/sqrt 2; the fourth is 252 + which of w x y z is the largest
//   scales  indices of 256 logarithms       sh0  indices of 256 numbers for f_dc, and the opacity in a byte
//   shN_labels  low and high byte of the index of a set of harmonics
//   shN_centroids  64 sets a row, coefficient after coefficient, as indices of 256 numbers
// The numbers are those of the PLY in its own frame, as the format's own tool has it. Cost: k-means (sog_codebook.hpp).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/io/image_limit.hpp"
#include "compmark/io/splat/sog_codebook.hpp"
#include "compmark/io/splat/sog_image.hpp"
#include "compmark/io/splat/splat_rounding.hpp"
#include "compmark/io/zip_writer.hpp"

namespace compmark {

namespace detail {

template <class Json, Executor E>
class SogEncoder {
 public:
  SogEncoder(const SplatTable& table, const SplatWriteSettings& settings, std::string name, E& executor)
      : table_(table),
        settings_(settings),
        name_(std::move(name)),
        executor_(executor) {}

  [[nodiscard]] Result<EncodedSplats> encode() {
    if (table_.count > static_cast<std::size_t>(image_pixel_limit)) {
      return splat_error(ErrorKind::exhausted, name_, "count",
                         "is " + std::to_string(table_.count) + ", more than the " + std::to_string(image_pixel_limit) +
                             " pixels of an image",
                         "export a PLY, or several files");
    }
    if (settings_.sog_palette > most_sets)
      return splat_error(ErrorKind::invalid, name_, "palette", "has more than 65,536 sets", "ask for fewer");
    order_ = splat_order(table_, settings_.reorder);
    while (static_cast<std::size_t>(width_) * static_cast<std::size_t>(width_) < table_.count) width_ += 4;
    height_ =
        static_cast<int>((table_.count + static_cast<std::size_t>(width_) - 1) / static_cast<std::size_t>(width_));
    meta_ = Json{{"version", 2},
                 {"asset", {{"generator", "CompMark"}}},
                 {"count", table_.count},
                 {"antialias", settings_.antialiased}};
    means();
    scales();
    rotations();
    colors();
    if (table_.degree > 0) harmonics();

    const std::string text = meta_.dump();
    std::vector<ZipEntry> entries{{"meta.json", std::as_bytes(std::span<const char>(text))}};
    for (const NamedImage& image : images_) {
      if (image.file.empty())
        return splat_error(ErrorKind::exhausted, name_, image.name, "is not written: no memory for it",
                           "export a smaller model");
      entries.push_back({image.name, image.file});
    }
    Result<std::vector<std::byte>> bytes = zip_bytes(entries, "a SOG file");
    if (!bytes) {
      Error error = bytes.error();
      error.file = name_;
      return error;
    }
    EncodedSplats encoded;
    encoded.bytes = std::move(*bytes);
    encoded.version = 2;
    held_scales_.tell("log scales", "-20 to 20", encoded.notes);
    return encoded;
  }

 private:
  static constexpr std::size_t most_sets = 65536, sets_in_row = 64, codes = 256;
  struct NamedImage {
    std::string name;
    std::vector<std::byte> file;
  };

  [[nodiscard]] ImageBytes blank(int width, int height, int channels) const {
    return {width, height, channels,
            std::vector<std::uint8_t>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
                                      static_cast<std::size_t>(channels))};
  }
  /// Keeps an image under `name` with the ending of its kind; gives the whole name.
  std::string keep(const std::string& name, const ImageBytes& image) {
    SogImage encoded = encode_sog_image(image, settings_.sog_png);
    images_.push_back({name + encoded.ending, std::move(encoded.bytes)});
    return images_.back().name;
  }
  /// An image of a pixel a splat: value(row, channel) in the order of the file.
  template <class Value>
  std::string image(const std::string& name, int channels, const Value& value) {
    ImageBytes pixels = blank(width_, height_, channels);
    const std::size_t n = static_cast<std::size_t>(channels);
    executor_.for_chunks(order_.size(), 4096, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        for (std::size_t c = 0; c < n; ++c) pixels.pixels[i * n + c] = value(order_[i], c);
      }
    });
    return keep(name, pixels);
  }

  void means() {
    std::array<double, 3> low{}, high{};
    const auto logarithm = [&](std::size_t axis, std::size_t row) {
      const double x = static_cast<double>(table_.mean[axis][row]);
      return std::copysign(std::log1p(std::abs(x)), x);
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = high[axis] = logarithm(axis, 0);
      for (std::size_t row = 0; row < table_.count; ++row) {
        low[axis] = std::min(low[axis], logarithm(axis, row));
        high[axis] = std::max(high[axis], logarithm(axis, row));
      }
    }
    const auto step = [&](std::size_t row, std::size_t axis) {
      return nearest_step(logarithm(axis, row), low[axis], high[axis], 16);
    };
    const std::string low_bytes = image("means_l", 3, [&](std::size_t row, std::size_t axis) {
      return static_cast<std::uint8_t>(step(row, axis) & 255u);
    });
    const std::string high_bytes = image("means_u", 3, [&](std::size_t row, std::size_t axis) {
      return static_cast<std::uint8_t>(step(row, axis) >> 8);
    });
    meta_["means"] = {{"mins", low}, {"maxs", high}, {"files", {low_bytes, high_bytes}}};
  }

  void scales() {
    std::vector<std::vector<float>> columns(3, std::vector<float>(table_.count));
    std::vector<float> all;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t row = 0; row < table_.count; ++row) {
        columns[axis][row] =
            static_cast<float>(held_scales_(static_cast<double>(table_.log_scale[axis][row]), -20, 20));
      }
      all.insert(all.end(), columns[axis].begin(), columns[axis].end());
    }
    const std::vector<float> codebook = number_codebook(std::move(all), codes);
    const std::string file = image(
        "scales", 3, [&](std::size_t row, std::size_t axis) { return nearest_code(codebook, columns[axis][row]); });
    meta_["scales"] = {{"codebook", whole(codebook)}, {"files", Json::array({file})}};
  }

  void rotations() {
    const std::string file = image("quats", 4, [&](std::size_t row, std::size_t c) {
      const ThreeOfRotation q = three_of_rotation(unit_rotation(table_, row));
      if (c == 3) return static_cast<std::uint8_t>(252 + q.largest);
      return static_cast<std::uint8_t>(nearest_step(q.others[c], -std::sqrt(0.5), std::sqrt(0.5), 8));
    });
    meta_["quats"] = {{"files", Json::array({file})}};
  }

  void colors() {
    std::vector<float> all;
    for (std::size_t c = 0; c < 3; ++c) all.insert(all.end(), table_.color(c, 0).begin(), table_.color(c, 0).end());
    const std::vector<float> codebook = number_codebook(std::move(all), codes);
    const std::string file = image("sh0", 4, [&](std::size_t row, std::size_t c) {
      return c == 3 ? nearest_byte(255 * opacity_of_logit(table_.opacity[row]))
                    : nearest_code(codebook, table_.color(c, 0)[row]);
    });
    meta_["sh0"] = {{"codebook", whole(codebook)}, {"files", Json::array({file})}};
  }

  void harmonics() {
    const std::size_t coefficients = table_.coefficients() - 1, width = 3 * coefficients;
    std::vector<float> rows(table_.count * width);
    executor_.for_chunks(table_.count, 1024, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        for (std::size_t k = 0; k < width; ++k) rows[i * width + k] = table_.color(k % 3, 1 + k / 3)[order_[i]];
      }
    });
    const std::size_t entries = settings_.sog_palette != 0 ? settings_.sog_palette : usual_palette(table_.count);
    const Palette palette = PaletteBuilder<E>(rows, width, executor_).build(entries);
    const std::vector<float> codebook = number_codebook(palette.sets, codes);
    const std::size_t lines = (palette.entries() + sets_in_row - 1) / sets_in_row;
    ImageBytes sets = blank(static_cast<int>(sets_in_row * coefficients), static_cast<int>(lines), 3);
    for (std::size_t i = 0; i < palette.sets.size(); ++i) sets.pixels[i] = nearest_code(codebook, palette.sets[i]);
    const std::string centroids_file = keep("shN_centroids", sets);
    ImageBytes labels = blank(width_, height_, 3);
    for (std::size_t i = 0; i < table_.count; ++i) {
      labels.pixels[3 * i] = static_cast<std::uint8_t>(palette.label[i] & 255u);
      labels.pixels[3 * i + 1] = static_cast<std::uint8_t>(palette.label[i] >> 8);
    }
    const std::string labels_file = keep("shN_labels", labels);
    meta_["shN"] = {{"count", palette.entries()},
                    {"bands", table_.degree},
                    {"codebook", whole(codebook)},
                    {"files", {centroids_file, labels_file}}};
  }

  /// Readers want 256 numbers; the last one is repeated.
  [[nodiscard]] static std::vector<float> whole(std::vector<float> codebook) {
    codebook.resize(codes, codebook.back());
    return codebook;
  }

  const SplatTable& table_;
  const SplatWriteSettings& settings_;
  std::string name_;
  E& executor_;
  std::vector<std::uint32_t> order_;
  int width_ = 4, height_ = 0;
  Json meta_;
  std::vector<NamedImage> images_;
  HeldNumbers held_scales_;
};

}  // namespace detail

/// A table whose numbers were checked (detail::check_splats), with one splat at least, as a file; `name` is for the
/// message. Error: more splats than an image has pixels, or more than 4 GiB.
template <class Json = nlohmann::ordered_json, Executor E>
[[nodiscard]] Result<EncodedSplats> sog_bytes_of(const SplatTable& table, const SplatWriteSettings& settings,
                                                 const std::string& name, E& executor) {
  return detail::SogEncoder<Json, E>(table, settings, name, executor).encode();
}

}  // namespace compmark
