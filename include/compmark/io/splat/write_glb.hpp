// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Writes binary glTF 2.0 with KHR_gaussian_splatting, the extension of Khronos, as its release candidate of 2026 has
// it: not ratified when this was written. One primitive of points; every attribute is floats:
//   POSITION, KHR_gaussian_splatting:ROTATION (x y z w), :SCALE (lengths), :OPACITY (0 to 1), :SH_DEGREE_l_COEF_n
// and COLOR_0 in bytes for programs that draw points alone. The frame is glTF's: y up; the axes y and z of training are
// turned round. Colours are display-referred sRGB, as training has them; COLOR_0 alone is linear, as glTF has it. Cost:
// a pass over the values.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/io/bytes.hpp"
#include "compmark/io/splat/splat_rounding.hpp"

namespace compmark {

namespace detail {

/// Signs of glTF's axes against those of training.
inline constexpr AxisSigns glb_axes{1, -1, -1};
inline constexpr std::string_view glb_extension = "KHR_gaussian_splatting";
inline constexpr std::string_view glb_color_space = "srgb_rec709_display";
inline constexpr std::uint32_t glb_magic = 0x46546c67, glb_json_chunk = 0x4e4f534a, glb_bin_chunk = 0x004e4942;
inline constexpr int gltf_float = 5126, gltf_unsigned_byte = 5121;

/// The attribute of a harmonic: coefficient i of sh_basis is of degree l and has the n-th place in it.
[[nodiscard]] inline std::string glb_harmonic(std::size_t i) {
  std::size_t degree = 0;
  while ((degree + 1) * (degree + 1) <= i) ++degree;
  return std::string(glb_extension) + ":SH_DEGREE_" + std::to_string(degree) + "_COEF_" +
         std::to_string(i - degree * degree);
}

/// Linear light of an sRGB value (IEC 61966-2-1), held in [0, 1].
[[nodiscard]] inline double linear_of_srgb(double value) {
  const double v = std::clamp(value, 0.0, 1.0);
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

template <class Json>
class GlbEncoder {
 public:
  explicit GlbEncoder(const SplatTable& table) : table_(table) {}

  [[nodiscard]] Result<EncodedSplats> encode(const std::string& name) {
    const SplatSigns signs = splat_signs(glb_axes);
    const std::string prefix = std::string(glb_extension) + ":";
    attribute("POSITION", 3, [&](std::size_t row, std::size_t c) { return signs.mean[c] * table_.mean[c][row]; });
    bounds(signs);
    colors();
    attribute(prefix + "ROTATION", 4, [&](std::size_t row, std::size_t c) {
      const std::size_t k = (c + 1) % 4;
      return signs.rotation[k] * static_cast<float>(unit_rotation(table_, row)[k]);
    });
    HeldNumbers scales;
    attribute(prefix + "SCALE", 3,
              [&](std::size_t row, std::size_t c) { return held_length(table_.log_scale[c][row], scales); });
    attribute(prefix + "OPACITY", 1,
              [&](std::size_t row, std::size_t) { return static_cast<float>(opacity_of_logit(table_.opacity[row])); });
    for (std::size_t i = 0; i < table_.coefficients(); ++i) {
      attribute(glb_harmonic(i), 3,
                [&](std::size_t row, std::size_t c) { return signs.harmonics[i] * table_.color(c, i)[row]; });
    }
    Result<EncodedSplats> encoded = file(name);
    if (encoded) scales.tell("log scales", log_scale_range, encoded->notes);
    return encoded;
  }

 private:
  void accessor(const std::string& name, int component, const char* type, std::size_t begin) {
    views_.push_back({{"buffer", 0}, {"byteOffset", begin}, {"byteLength", data_.size() - begin}, {"target", 34962}});
    attributes_[name] = accessors_.size();
    accessors_.push_back(
        {{"bufferView", views_.size() - 1}, {"componentType", component}, {"count", table_.count}, {"type", type}});
  }
  template <class Value>
  void attribute(const std::string& name, std::size_t components, const Value& value) {
    const std::size_t begin = data_.size();
    for (std::size_t row = 0; row < table_.count; ++row) {
      for (std::size_t c = 0; c < components; ++c) data_.put(value(row, c));
    }
    accessor(name, gltf_float, components == 1 ? "SCALAR" : components == 3 ? "VEC3" : "VEC4", begin);
  }
  /// glTF wants the box of the places.
  void bounds(const SplatSigns& signs) {
    Json low = Json::array(), high = Json::array();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto ends = std::minmax_element(table_.mean[axis].begin(), table_.mean[axis].end());
      const float a = signs.mean[axis] * *ends.first, b = signs.mean[axis] * *ends.second;
      low.push_back(std::min(a, b));
      high.push_back(std::max(a, b));
    }
    accessors_.back()["min"] = low;
    accessors_.back()["max"] = high;
  }
  void colors() {
    const std::size_t begin = data_.size();
    for (std::size_t row = 0; row < table_.count; ++row) {
      for (std::size_t c = 0; c < 3; ++c)
        data_.put(nearest_byte(255 * linear_of_srgb(color_of_dc(table_.color(c, 0)[row]))));
      data_.put(nearest_byte(255 * opacity_of_logit(table_.opacity[row])));
    }
    accessor("COLOR_0", gltf_unsigned_byte, "VEC4", begin);
    accessors_.back()["normalized"] = true;
  }

  [[nodiscard]] Result<EncodedSplats> file(const std::string& name) {
    const Json gltf{{"asset", {{"version", "2.0"}, {"generator", "CompMark"}}},
                    {"extensionsUsed", Json::array({glb_extension})},
                    {"scene", 0},
                    {"scenes", Json::array({{{"nodes", Json::array({0})}}})},
                    {"nodes", Json::array({{{"mesh", 0}}})},
                    {"meshes", Json::array({{{"primitives", Json::array({{{"attributes", attributes_},
                                                                          {"mode", 0},
                                                                          {"extensions",
                                                                           {{glb_extension,
                                                                             {{"kernel", "ellipse"},
                                                                              {"colorSpace", glb_color_space},
                                                                              {"sortingMethod", "cameraDistance"},
                                                                              {"projection", "perspective"}}}}}}})}}})},
                    {"accessors", accessors_},
                    {"bufferViews", views_},
                    {"buffers", Json::array({{{"byteLength", data_.size()}}})}};
    std::string text = gltf.dump();
    text.append((4 - text.size() % 4) % 4, ' ');
    const std::uint64_t whole = 12 + 8 + std::uint64_t{text.size()} + 8 + data_.size();
    if (whole > std::numeric_limits<std::uint32_t>::max()) {
      return splat_error(ErrorKind::exhausted, name, "length",
                         "would be " + std::to_string(whole) + " bytes, and a .glb file has 4 GiB at most",
                         "export fewer harmonics, or a PLY");
    }
    ByteWriter out;
    for (const std::uint64_t value :
         {std::uint64_t{glb_magic}, std::uint64_t{2}, whole, std::uint64_t{text.size()}, std::uint64_t{glb_json_chunk}})
      out.put(static_cast<std::uint32_t>(value));
    out.put(std::string_view(text)).put(static_cast<std::uint32_t>(data_.size())).put(glb_bin_chunk);
    out.put(data_.bytes());  // of whole words: every attribute is
    EncodedSplats encoded;
    encoded.bytes = out.take();
    encoded.version = 2;
    return encoded;
  }

  const SplatTable& table_;
  ByteWriter data_;
  Json attributes_ = Json::object(), accessors_ = Json::array(), views_ = Json::array();
};

}  // namespace detail

/// A table whose numbers were checked (detail::check_splats) as a file; `name` is for the message. Error: more than
/// 4 GiB.
template <class Json = nlohmann::ordered_json>
[[nodiscard]] Result<EncodedSplats> glb_bytes_of(const SplatTable& table, const std::string& name) {
  return detail::GlbEncoder<Json>(table).encode(name);
}

}  // namespace compmark
