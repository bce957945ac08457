// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Reads binary glTF 2.0 with one primitive of KHR_gaussian_splatting (docs/splat_formats.md; layout in write_glb.hpp):
// attributes as floats or as normalised integers of the extension, in the chunk of the file itself, interleaved or not.
// Refused in words: compression extensions, several primitives, nodes that move the splats, other kernels, colours in
// linear light. COLOR_0 is passed over. Every offset and count is compared with the bytes before memory is taken. Cost:
// a pass over the values.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/io/bytes.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/json_shape.hpp"
#include "compmark/io/splat/splat_file.hpp"
#include "compmark/io/splat/write_glb.hpp"

namespace compmark {

namespace detail {

/// Numbers of an accessor within the file, checked to lie there.
struct GlbNumbers {
  std::span<const std::byte> bytes;  ///< from the first number on
  std::size_t stride = 0, components = 0;
  int type = gltf_float;
  bool normalised = false;

  [[nodiscard]] float at(std::size_t row, std::size_t component) const {
    const std::size_t width = type == gltf_float ? 4 : type < 5122 ? 1 : 2;
    ByteReader reader(bytes.subspan(row * stride + component * width, width));
    if (type == gltf_float) return reader.get<float>();
    const float value = type == 5120   ? static_cast<float>(reader.get<std::int8_t>())
                        : type == 5121 ? static_cast<float>(reader.get<std::uint8_t>())
                        : type == 5122 ? static_cast<float>(reader.get<std::int16_t>())
                                       : static_cast<float>(reader.get<std::uint16_t>());
    if (!normalised) return value;
    const float most = type == 5120 ? 127.0f : type == 5121 ? 255.0f : type == 5122 ? 32767.0f : 65535.0f;
    return std::fmax(value / most, -1.0f);
  }
};

template <class Json>
class GlbParser {
 public:
  GlbParser(std::span<const std::byte> bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  [[nodiscard]] Result<SplatFile> parse() {
    if (const Result<Done> read = chunks(); !read) return read.error();
    if (const Result<Done> found = find_primitive(); !found) return found.error();
    const Json& attributes = member(*primitive_, "attributes");
    const std::string prefix = std::string(glb_extension) + ":";
    const Result<GlbNumbers> mean = numbers(attributes, "POSITION", 3);
    if (!mean) return mean.error();
    const Result<GlbNumbers> rotation = numbers(attributes, prefix + "ROTATION", 4);
    if (!rotation) return rotation.error();
    const Result<GlbNumbers> scale = numbers(attributes, prefix + "SCALE", 3);
    if (!scale) return scale.error();
    const Result<GlbNumbers> opacity = numbers(attributes, prefix + "OPACITY", 1);
    if (!opacity) return opacity.error();
    int degree = 0;
    while (degree < max_sh_degree && attributes.contains(glb_harmonic(sh_count(degree)))) ++degree;
    std::vector<GlbNumbers> harmonics;
    for (std::size_t i = 0; i < sh_count(degree); ++i) {
      const Result<GlbNumbers> found = numbers(attributes, glb_harmonic(i), 3);
      if (!found) return found.error();
      harmonics.push_back(*found);
    }

    SplatFile file;
    file.format = SplatFormat::glb;
    file.version = 2;
    SplatTable& table = file.table;
    table.resize(*count_, degree);
    for (std::size_t row = 0; row < table.count; ++row) {
      for (std::size_t c = 0; c < 3; ++c) {
        table.mean[c][row] = mean->at(row, c);
        table.log_scale[c][row] = std::log(scale->at(row, c));  // NaN of a negative length is refused below
        for (std::size_t i = 0; i < harmonics.size(); ++i) table.color(c, i)[row] = harmonics[i].at(row, c);
      }
      for (std::size_t k = 0; k < 4; ++k) table.rotation[(k + 1) % 4][row] = rotation->at(row, k);
      table.opacity[row] = logit(static_cast<double>(opacity->at(row, 0)));
    }
    change_axes(table, glb_axes);
    if (const Result<Done> usable = finish_splats(table, name_); !usable) return usable.error();
    return file;
  }

 private:
  [[nodiscard]] Error error(ErrorKind kind, std::string field, std::string problem,
                            std::string remedy = "copy or export it again") const {
    return splat_error(kind, name_, std::move(field), std::move(problem), std::move(remedy));
  }
  /// Floats hold more opacities near 1 than bytes do; what is no opacity becomes NaN, and is refused.
  [[nodiscard]] static float logit(double opacity) {
    if (!(opacity >= 0 && opacity <= 1)) return std::numeric_limits<float>::quiet_NaN();
    return opacity == 0 || opacity == 1 ? logit_of_opacity(opacity)
                                        : static_cast<float>(std::log(opacity / (1 - opacity)));
  }
  [[nodiscard]] static const Json& member(const Json& object, std::string_view key) {
    static const Json none;
    if (!object.is_object()) return none;
    const auto found = object.find(std::string(key));
    return found == object.end() ? none : *found;
  }
  /// Item `index` of an array of the file; null where there is none.
  [[nodiscard]] const Json* item(std::string_view array, const Json& index) const {
    const Json& items = member(gltf_, array);
    if (!items.is_array() || !index.is_number_unsigned()) return nullptr;
    const std::uint64_t at = index.template get<std::uint64_t>();
    return at < items.size() ? &items[static_cast<std::size_t>(at)] : nullptr;
  }

  [[nodiscard]] Result<Done> chunks() {
    ByteReader reader(bytes_);
    const std::uint32_t magic = reader.get<std::uint32_t>(), version = reader.get<std::uint32_t>();
    const std::uint32_t length = reader.get<std::uint32_t>(), text = reader.get<std::uint32_t>();
    const std::uint32_t kind = reader.get<std::uint32_t>();
    if (reader.failed() || magic != glb_magic) return error(ErrorKind::malformed, "header", "is none of a .glb file");
    if (version != 2) return error(ErrorKind::unsupported, "version", "is " + std::to_string(version) + ", not 2");
    if (length != bytes_.size()) {
      return error(ErrorKind::truncated, "length",
                   "is " + std::to_string(length) + " and the file has " + std::to_string(bytes_.size()) + " bytes");
    }
    if (kind != glb_json_chunk) return error(ErrorKind::malformed, "first chunk", "is not JSON");
    const std::string json = reader.text(text);
    const std::uint32_t size = reader.get<std::uint32_t>(), second = reader.get<std::uint32_t>();
    data_ = reader.take(size);
    if (reader.failed()) return error(ErrorKind::truncated, "chunks", "do not end where the file does");
    if (second != glb_bin_chunk) return error(ErrorKind::malformed, "second chunk", "is not binary");
    gltf_ = json_from<Json>(json);
    if (!gltf_.is_object()) return error(ErrorKind::malformed, "first chunk", "is not valid JSON");
    return Done{};
  }

  [[nodiscard]] Result<Done> find_primitive() {
    const Json& meshes = member(gltf_, "meshes");
    for (std::size_t mesh = 0; meshes.is_array() && mesh < meshes.size(); ++mesh) {
      const Json& primitives = member(meshes[mesh], "primitives");
      for (std::size_t i = 0; primitives.is_array() && i < primitives.size(); ++i) {
        if (!member(member(primitives[i], "extensions"), glb_extension).is_object()) continue;
        if (primitive_ != nullptr)
          return error(ErrorKind::unsupported, "meshes", "have several primitives of splats", "export one alone");
        primitive_ = &primitives[i];
      }
    }
    if (primitive_ == nullptr) {
      return error(ErrorKind::unsupported, "meshes", "have no splats (no primitive with KHR_gaussian_splatting)",
                   "give a .glb file of splats");
    }
    const Json& extension = member(member(*primitive_, "extensions"), glb_extension);
    const Json& kernel = member(extension, "kernel");
    if (!kernel.is_string() || kernel.template get<std::string>() != "ellipse")
      return error(ErrorKind::unsupported, "kernel", "is not \"ellipse\"", "export Gaussians");
    // Linear colours are no linear function of those of training: no harmonics hold them exactly.
    const Json& space = member(extension, "colorSpace");
    if (!space.is_string() || space.template get<std::string>() != glb_color_space) {
      return error(ErrorKind::unsupported, "colorSpace", "is not \"" + std::string(glb_color_space) + "\"",
                   "export it with display-referred colours");
    }
    if (!member(extension, "extensions").is_null()) {
      return error(ErrorKind::unsupported, "extensions", "of KHR_gaussian_splatting change what the numbers mean",
                   "export it without compression");
    }
    const Json& nodes = member(gltf_, "nodes");
    for (std::size_t i = 0; nodes.is_array() && i < nodes.size(); ++i) {
      for (const char* move : {"matrix", "translation", "rotation", "scale"}) {
        if (member(nodes[i], move).is_null()) continue;
        return error(ErrorKind::unsupported, "nodes[" + std::to_string(i) + "]." + move, "moves what the file holds",
                     "export it with the move applied to the splats");
      }
    }
    return Done{};
  }

  [[nodiscard]] Result<GlbNumbers> numbers(const Json& attributes, const std::string& name, std::size_t components) {
    const Json* const accessor = item("accessors", member(attributes, name));
    if (accessor == nullptr) return error(ErrorKind::malformed, name, "is missing, or names no accessor");
    if (!member(*accessor, "sparse").is_null())
      return error(ErrorKind::unsupported, name, "is sparse", "export it with whole accessors");
    const Json* const view = item("bufferViews", member(*accessor, "bufferView"));
    if (view == nullptr) return error(ErrorKind::malformed, name, "names no buffer view");
    const Result<std::uint64_t> count = number(*accessor, "count", name),
                                type = number(*accessor, "componentType", name),
                                begin = number(*view, "byteOffset", name, 0), size = number(*view, "byteLength", name),
                                more = number(*accessor, "byteOffset", name, 0), buffer = number(*view, "buffer", name),
                                stride = number(*view, "byteStride", name, 0);
    for (const Result<std::uint64_t>* found : {&count, &type, &begin, &size, &more, &buffer, &stride}) {
      if (!*found) return found->error();
    }
    const Json& shape = member(*accessor, "type");
    const std::string expected = components == 1 ? "SCALAR" : components == 3 ? "VEC3" : "VEC4";
    if (!shape.is_string() || shape.template get<std::string>() != expected)
      return error(ErrorKind::malformed, name, "is not of type " + expected);
    GlbNumbers found;
    found.normalised = member(*accessor, "normalized") == Json(true);
    const bool is_float = *type == static_cast<std::uint64_t>(gltf_float);
    if (!is_float && (*type < 5120 || *type > 5123))
      return error(ErrorKind::unsupported, name, "has components of type " + std::to_string(*type));
    found.type = static_cast<int>(*type);
    found.components = components;
    const std::uint64_t element = components * (is_float ? 4u : *type < 5122 ? 1u : 2u);
    found.stride = static_cast<std::size_t>(*stride == 0 ? element : *stride);
    if (found.stride < element) return error(ErrorKind::malformed, name, "has a stride less than its numbers take");
    if (*buffer != 0 || *begin > data_.size() || *size > data_.size() - *begin || *more > *size)
      return error(ErrorKind::truncated, name, "lies outside of the file");
    found.bytes = data_.subspan(static_cast<std::size_t>(*begin + *more), static_cast<std::size_t>(*size - *more));
    if (*count == 0) return error(ErrorKind::invalid, name, "has no splats");
    if (found.bytes.size() < element || (*count - 1) > (found.bytes.size() - element) / found.stride)
      return error(ErrorKind::truncated, name,
                   "has " + std::to_string(*count) + " splats, which the file does not hold");
    if (count_ && *count_ != *count) return error(ErrorKind::malformed, name, "has another count than POSITION");
    count_ = static_cast<std::size_t>(*count);
    return found;
  }
  [[nodiscard]] Result<std::uint64_t> number(const Json& object, const std::string& key, const std::string& where,
                                             std::optional<std::uint64_t> otherwise = {}) const {
    if (otherwise && member(object, key).is_null()) return *otherwise;
    return json_field<std::uint64_t>(object, key, name_, where);
  }

  std::span<const std::byte> bytes_, data_;
  std::string name_;
  Json gltf_;
  const Json* primitive_ = nullptr;
  std::optional<std::size_t> count_;
};

}  // namespace detail

/// Reads a whole file; `name` is for the messages.
template <class Json = nlohmann::json>
[[nodiscard]] Result<SplatFile> parse_glb(std::span<const std::byte> bytes, const std::string& name) {
  return detail::GlbParser<Json>(bytes, name).parse();
}

}  // namespace compmark
