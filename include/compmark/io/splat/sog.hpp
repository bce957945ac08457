// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Reads SOG files of PlayCanvas, version 2, as one archive (docs/splat_formats.md; layout in write_sog.hpp), with PNG
// images, and WebP images where the program has libwebp (sog_image.hpp). No count is believed: the splats are compared
// with the bytes of the file and the pixels of its images, and every index with the table that it points into. Cost:
// decoding the images and a pass over the values.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/io/image_file.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/json_shape.hpp"
#include "compmark/io/splat/sog_image.hpp"
#include "compmark/io/splat/splat_file.hpp"
#include "compmark/io/zip.hpp"

namespace compmark {

namespace detail {

template <class Json>
class SogParser {
 public:
  SogParser(std::span<const std::byte> bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  [[nodiscard]] Result<SplatFile> parse() {
    Result<std::vector<ZipEntry>> entries =
        parse_zip(bytes_, name_, {"a SOG file", "export it again", "export it again with stored entries"});
    if (!entries) return entries.error();
    entries_ = std::move(*entries);
    if (const Result<Done> read = meta(); !read) return read.error();
    SplatFile file;
    file.format = SplatFormat::sog;
    file.version = 2;
    SplatTable& table = file.table;
    const int bands = meta_.contains("shN") ? bands_ : 0;
    Result<ImageBytes> low = image("means", 0, 3);
    if (!low) return low.error();
    width_ = low->width;  // every image of a pixel a splat has the size of the first
    height_ = low->height;
    const std::uint64_t pixels = static_cast<std::uint64_t>(width_) * static_cast<std::uint64_t>(height_);
    if (count_ > pixels) {
      return error(ErrorKind::truncated, "count",
                   "is " + std::to_string(count_) + ", and the images have " + std::to_string(pixels) + " pixels");
    }
    table.resize(count_, bands);
    for (const auto& read : {&SogParser::means, &SogParser::rotations, &SogParser::scales, &SogParser::colors}) {
      if (const Result<Done> done = (this->*read)(table, *low); !done) return done.error();
    }
    if (bands > 0) {
      if (const Result<Done> done = harmonics(table); !done) return done.error();
    }
    if (const Result<Done> usable = finish_splats(table, name_); !usable) return usable.error();
    file.antialiased = meta_.contains("antialias") && meta_["antialias"] == Json(true);
    return file;
  }

 private:
  static constexpr std::size_t codes = 256, sets_in_row = 64, most_sets = 65536;
  /// Of a splat, places and colours alone take some bytes; no image packs this many into one.
  static constexpr std::uint64_t most_splats_of_byte = 16;

  [[nodiscard]] Error error(ErrorKind kind, std::string field, std::string problem,
                            std::string remedy = "copy or export it again") const {
    return splat_error(kind, name_, std::move(field), std::move(problem), std::move(remedy));
  }
  [[nodiscard]] std::optional<std::span<const std::byte>> entry(const std::string& name) const {
    for (const ZipEntry& found : entries_) {
      if (found.name == name) return found.content;
    }
    return std::nullopt;
  }

  [[nodiscard]] Result<Done> meta() {
    const std::optional<std::span<const std::byte>> text = entry("meta.json");
    if (!text) {
      return error(ErrorKind::malformed, "meta.json", "is not in the archive, which is none of splats",
                   "give a SOG file, or unpack the archive");
    }
    meta_ = json_from<Json>({reinterpret_cast<const char*>(text->data()), text->size()});
    if (!meta_.is_object()) return error(ErrorKind::malformed, "meta.json", "is not valid JSON");
    if (!meta_.contains("version")) {
      return error(ErrorKind::unsupported, "version", "is not told: the file is of version 1",
                   "export it again with a newer program, as version 2");
    }
    const Result<int> written = json_field<int>(meta_, "version", name_);
    if (!written) return written.error();
    if (*written != 2)
      return error(ErrorKind::unsupported, "version", "is " + std::to_string(*written) + ", not 2",
                   "export it again as version 2");
    const Result<std::uint64_t> count = json_field<std::uint64_t>(meta_, "count", name_);
    if (!count) return count.error();
    if (*count == 0) return error(ErrorKind::invalid, "count", "is 0: the file holds no splat");
    if (*count / most_splats_of_byte > bytes_.size()) {
      return error(ErrorKind::exhausted, "count",
                   "is " + std::to_string(*count) + ", more than " + std::to_string(bytes_.size()) + " bytes can hold");
    }
    count_ = static_cast<std::size_t>(*count);
    if (!meta_.contains("shN")) return Done{};
    const Result<int> bands = json_field<int>(meta_["shN"], "bands", name_, "shN");
    if (!bands) return bands.error();
    if (*bands < 1 || *bands > max_sh_degree)
      return error(ErrorKind::invalid, "shN.bands", "is " + std::to_string(*bands) + ", not 1, 2 or 3");
    bands_ = *bands;
    return Done{};
  }

  /// A list of numbers of meta.json: `least` to `most` of them.
  [[nodiscard]] Result<std::vector<double>> list(const std::string& quantity, const std::string& key, std::size_t least,
                                                 std::size_t most) const {
    const std::string field = quantity + "." + key;
    const auto of = meta_.find(quantity);
    if (of == meta_.end() || !of->is_object() || !of->contains(key) || !(*of)[key].is_array())
      return error(ErrorKind::malformed, field, "is missing, or no list");
    const Json& values = (*of)[key];
    if (values.size() < least || values.size() > most)
      return error(ErrorKind::malformed, field,
                   "has " + std::to_string(values.size()) + " numbers, expected " + std::to_string(most));
    std::vector<double> numbers;
    for (const Json& value : values) {
      if (!value.is_number() || !std::isfinite(value.template get<double>()))
        return error(ErrorKind::malformed, field, "holds what is no finite number");
      numbers.push_back(value.template get<double>());
    }
    return numbers;
  }

  /// Image `index` of a quantity, of the size of the others unless it is the palette.
  [[nodiscard]] Result<ImageBytes> image(const std::string& quantity, std::size_t index, int channels,
                                         bool of_splats = true) const {
    const std::string field = quantity + ".files";
    const auto of = meta_.find(quantity);
    if (of == meta_.end() || !of->is_object() || !of->contains("files") || !(*of)["files"].is_array() ||
        (*of)["files"].size() <= index || !(*of)["files"][index].is_string())
      return error(ErrorKind::malformed, field, "is missing, or names too few files");
    const std::string file = (*of)["files"][index].template get<std::string>();
    const std::optional<std::span<const std::byte>> packed = entry(file);
    if (!packed) return error(ErrorKind::malformed, field, "names a file that is not in the archive");
    const std::size_t most_pixels = std::max<std::size_t>(4 * count_, std::size_t{1} << 20);
    Result<ImageBytes> found = decode_sog_image(*packed, name_, field, most_pixels);
    if (!found) return found.error();
    if (found->channels < channels) {
      return error(ErrorKind::malformed, field,
                   "has " + std::to_string(found->channels) + " channels, expected " + std::to_string(channels));
    }
    if (of_splats && width_ != 0 && (found->width != width_ || found->height != height_))
      return error(ErrorKind::malformed, field, "has another size than the first image of the places");
    return found;
  }
  [[nodiscard]] static std::uint32_t byte(const ImageBytes& of, std::size_t pixel, std::size_t channel) {
    return of.pixels[pixel * static_cast<std::size_t>(of.channels) + channel];
  }

  [[nodiscard]] Result<Done> means(SplatTable& table, const ImageBytes& low) {
    const Result<std::vector<double>> least = list("means", "mins", 3, 3), most = list("means", "maxs", 3, 3);
    if (!least) return least.error();
    if (!most) return most.error();
    const Result<ImageBytes> high = image("means", 1, 3);
    if (!high) return high.error();
    for (std::size_t i = 0; i < table.count; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double place = static_cast<double>(byte(*high, i, axis) << 8 | byte(low, i, axis)) / 65535;
        const double logarithm = (*least)[axis] * (1 - place) + (*most)[axis] * place;
        table.mean[axis][i] = static_cast<float>(std::copysign(std::expm1(std::abs(logarithm)), logarithm));
      }
    }
    return Done{};
  }

  [[nodiscard]] Result<Done> rotations(SplatTable& table, const ImageBytes&) {
    const Result<ImageBytes> found = image("quats", 0, 4);
    if (!found) return found.error();
    for (std::size_t i = 0; i < table.count; ++i) {
      const std::uint32_t mode = byte(*found, i, 3);
      if (mode < 252)
        return error(ErrorKind::invalid, "quats", "say no largest component in splat " + std::to_string(i));
      std::array<double, 3> others{};
      for (std::size_t k = 0; k < 3; ++k)
        others[k] = (static_cast<double>(byte(*found, i, k)) / 255 - 0.5) * std::sqrt(2.0);
      const std::array<double, 4> q = with_largest(mode - 252, others);
      for (std::size_t k = 0; k < 4; ++k) table.rotation[k][i] = static_cast<float>(q[k]);
    }
    return Done{};
  }

  /// An image of indices: `to(row, channel, number)` gets what they stand for.
  template <class To>
  [[nodiscard]] Result<Done> indexed(const std::string& quantity, const ImageBytes& found, std::size_t pixels,
                                     const To& to) const {
    const Result<std::vector<double>> codebook = list(quantity, "codebook", 1, codes);
    if (!codebook) return codebook.error();
    for (std::size_t i = 0; i < pixels; ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t code = byte(found, i, c);
        if (code >= codebook->size())
          return error(ErrorKind::invalid, quantity + ".codebook", "has no number " + std::to_string(code));
        to(i, c, static_cast<float>((*codebook)[code]));
      }
    }
    return Done{};
  }
  [[nodiscard]] Result<Done> scales(SplatTable& table, const ImageBytes&) {
    const Result<ImageBytes> found = image("scales", 0, 3);
    if (!found) return found.error();
    return indexed("scales", *found, table.count,
                   [&](std::size_t i, std::size_t axis, float x) { table.log_scale[axis][i] = x; });
  }
  [[nodiscard]] Result<Done> colors(SplatTable& table, const ImageBytes&) {
    const Result<ImageBytes> found = image("sh0", 0, 4);
    if (!found) return found.error();
    const std::array<float, 256> logit = byte_logits();
    for (std::size_t i = 0; i < table.count; ++i) table.opacity[i] = logit[byte(*found, i, 3)];
    return indexed("sh0", *found, table.count,
                   [&](std::size_t i, std::size_t c, float x) { table.color(c, 0)[i] = x; });
  }

  [[nodiscard]] Result<Done> harmonics(SplatTable& table) {
    const Result<std::uint64_t> sets = json_field<std::uint64_t>(meta_["shN"], "count", name_, "shN");
    if (!sets) return sets.error();
    const Result<ImageBytes> palette = image("shN", 0, 3, false), labels = image("shN", 1, 2);
    if (!palette) return palette.error();
    if (!labels) return labels.error();
    const std::size_t coefficients = table.coefficients() - 1;
    const std::size_t lines = static_cast<std::size_t>(palette->height);
    if (*sets == 0 || *sets > most_sets || *sets > lines * sets_in_row ||
        static_cast<std::size_t>(palette->width) != sets_in_row * coefficients)
      return error(ErrorKind::malformed, "shN.count",
                   "is " + std::to_string(*sets) + ", and the palette has " + std::to_string(palette->width) + " x " +
                       std::to_string(palette->height) + " pixels");
    const std::size_t pixels = static_cast<std::size_t>(*sets) * coefficients;
    std::vector<float> numbers(3 * pixels);
    const Result<Done> done =
        indexed("shN", *palette, pixels, [&](std::size_t i, std::size_t c, float x) { numbers[3 * i + c] = x; });
    if (!done) return done.error();
    for (std::size_t i = 0; i < table.count; ++i) {
      const std::uint32_t label = byte(*labels, i, 0) | byte(*labels, i, 1) << 8;
      if (label >= *sets)
        return error(ErrorKind::invalid, "shN",
                     "has no set " + std::to_string(label) + ", which splat " + std::to_string(i) + " names");
      for (std::size_t k = 0; k < coefficients; ++k) {
        for (std::size_t c = 0; c < 3; ++c) table.color(c, 1 + k)[i] = numbers[3 * (label * coefficients + k) + c];
      }
    }
    return Done{};
  }

  std::span<const std::byte> bytes_;
  std::string name_;
  std::vector<ZipEntry> entries_;
  Json meta_;
  std::size_t count_ = 0;
  int bands_ = 0, width_ = 0, height_ = 0;
};

}  // namespace detail

/// Reads a whole file; `name` is for the messages.
template <class Json = nlohmann::json>
[[nodiscard]] Result<SplatFile> parse_sog(std::span<const std::byte> bytes, const std::string& name) {
  return detail::SogParser<Json>(bytes, name).parse();
}

}  // namespace compmark
