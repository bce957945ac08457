// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Splats as one HTML page that any browser with WebGL 2 shows: nothing else is needed, and nothing is asked of the
// network. It can be turned by hand; page.html#camera=3 is what a camera of the list sees, pixel by pixel, and
// #background=666666 puts a colour behind it. Places, sizes, rotations and opacities are floats, harmonics 16 bits of
// their range. Cost: 59 bytes of text a splat, and 8 more a coefficient of the harmonics (187 at degree 3).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/base64.hpp"
#include "compmark/io/splat/viewer_script.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/splat_table.hpp"
#include "compmark/scene/views_around.hpp"

namespace compmark {

struct ViewerPage {
  std::string title = "splats";
  std::vector<Camera<double>> cameras = {};  ///< of #camera; may be empty
  std::array<double, 3> up = usual_up;       ///< of length 1
  double near_plane = 0.2;                   ///< world units; nothing nearer is drawn
};

namespace detail {

/// What a page's splats are: [count] x (x y z, scales, rotation w x y z, opacity) as floats, then the harmonics
/// [count, coefficients, 3] as 16 bits between the least and the greatest of their coefficient.
struct ViewerSplats {
  std::vector<std::byte> bytes;
  std::vector<double> low, high;
};

[[nodiscard]] inline ViewerSplats viewer_splats(const SplatTable& table) {
  ViewerSplats splats;
  const std::size_t coefficients = table.coefficients();
  splats.bytes.reserve(table.count * (44 + 6 * coefficients));
  const auto put = [&](std::uint32_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) splats.bytes.push_back(static_cast<std::byte>(value >> (8 * i) & 0xFFu));
  };
  const auto number = [&](double value) { put(std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4); };
  for (std::size_t i = 0; i < table.count; ++i) {
    double square = 0;
    for (const std::vector<float>& column : table.mean) number(static_cast<double>(column[i]));
    for (const std::vector<float>& column : table.log_scale) number(std::exp(static_cast<double>(column[i])));
    for (const std::vector<float>& column : table.rotation)
      square += static_cast<double>(column[i]) * static_cast<double>(column[i]);
    for (std::size_t k = 0; k < 4; ++k) {
      number(square > 0 ? static_cast<double>(table.rotation[k][i]) / std::sqrt(square) : (k == 0 ? 1 : 0));
    }
    number(1 / (1 + std::exp(-static_cast<double>(table.opacity[i]))));
  }
  for (std::size_t k = 0; k < coefficients; ++k) {
    double low = 0, high = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      for (const float value : table.color(c, k)) {
        low = std::min(low, static_cast<double>(value));
        high = std::max(high, static_cast<double>(value));
      }
    }
    splats.low.push_back(low);
    splats.high.push_back(high);
  }
  for (std::size_t i = 0; i < table.count; ++i) {
    for (std::size_t k = 0; k < coefficients; ++k) {
      const double range = splats.high[k] - splats.low[k];
      for (std::size_t c = 0; c < 3; ++c) {
        const double part = range > 0 ? (static_cast<double>(table.color(c, k)[i]) - splats.low[k]) / range : 0;
        put(static_cast<std::uint32_t>(std::lround(65535 * part)), 2);
      }
    }
  }
  return splats;
}

}  // namespace detail

/// The most splats of a page whose harmonics have so many coefficients: what a texture of WebGL 2 holds everywhere.
[[nodiscard]] constexpr std::size_t viewer_limit(std::size_t coefficients) {
  return std::size_t{2048} * 8192 / (coefficients > 2 ? coefficients : 2);
}

/// Writes the page. Error: too many splats, or it cannot be written.
template <class Json = nlohmann::ordered_json>
[[nodiscard]] Result<Done> write_viewer_page(const std::filesystem::path& path, const SplatTable& table,
                                             const ViewerPage& page = {}) {
  const std::size_t coefficients = table.coefficients();
  if (table.count > viewer_limit(coefficients)) {
    return Error{ErrorKind::exhausted, path.string(), "splats",
                 "are " + std::to_string(table.count) + ", and a page of this degree shows at most " +
                     std::to_string(viewer_limit(coefficients)),
                 "give a lower --sh-degree, or write another format"};
  }
  const detail::ViewerSplats splats = detail::viewer_splats(table);
  const SplatBulk bulk = splat_bulk(table);
  Json scene{{"title", page.title},
             {"count", table.count},
             {"coefficients", coefficients},
             {"low", splats.low},
             {"high", splats.high},
             {"up", page.up},
             {"near", page.near_plane},
             {"center", bulk.center},
             {"distance", 1.1 * bulk.radius / std::sin(25 * std::numbers::pi / 180)},
             {"cameras", Json::array()}};
  for (const Camera<double>& camera : page.cameras) {
    scene["cameras"].push_back({{"turn", camera.rotation_camera_world},
                                {"eye", camera.center_world},
                                {"focal", {camera.fx, camera.fy}},
                                {"middle", {camera.cx, camera.cy}},
                                {"width", camera.width},
                                {"height", camera.height}});
  }
  std::string described = scene.dump(-1, ' ', true, Json::error_handler_t::replace);
  for (std::size_t at = 0; (at = described.find('<', at)) != std::string::npos;) described.replace(at, 1, "\\u003c");
  std::string text = "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>splats</title>\n";
  text += detail::viewer_style;
  text += detail::viewer_shaders;
  text += "<script id=\"scene\" type=\"application/json\">" + described + "</script>\n";
  text += "<script id=\"splats\" type=\"text/plain\">" + base64(splats.bytes) + "</script>\n";
  text += detail::viewer_script;
  text += "</html>\n";
  return write_file(path, text);
}

}  // namespace compmark
