// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Cameras in the metadata of a compressed file: names and splits as JSON, numbers as the bits of doubles, 144 bytes a
// view (280 with lenses), so that who receives it renders the owner's views to the bit. Every number is checked before
// it is believed.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/codec/container/codec_model.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/scene/lens_model.hpp"
#include "compmark/splat/training/model_info.hpp"
#include "compmark/splat/training/view_row.hpp"

namespace compmark {

/// Which of the model's cameras a file keeps.
enum class StoredCameras : std::uint8_t { none, test, all };

namespace detail {

[[nodiscard]] inline Error coded_error(std::string field, std::string problem, std::string remedy) {
  return {ErrorKind::invalid, {}, std::move(field), std::move(problem), std::move(remedy)};
}

/// Little-endian bits of doubles as text that metadata may hold.
[[nodiscard]] inline std::string packed_doubles(std::span<const double> values) {
  std::string text;
  for (const double value : values) {
    std::uint64_t bits = std::bit_cast<std::uint64_t>(value);
    for (int byte = 0; byte < 8; ++byte, bits >>= 8) text.push_back(static_cast<char>(bits & 0xFF));
  }
  return text;
}
[[nodiscard]] inline std::vector<double> unpacked_doubles(std::string_view text) {
  std::vector<double> values;
  for (std::size_t i = 0; i + 8 <= text.size(); i += 8) {
    std::uint64_t bits = 0;
    for (std::size_t byte = 8; byte-- > 0;) bits = bits << 8 | static_cast<unsigned char>(text[i + byte]);
    values.push_back(std::bit_cast<double>(bits));
  }
  return values;
}

/// A list of names as a text.
template <class Json = nlohmann::json>
[[nodiscard]] std::string names_text(const std::vector<std::string>& names) {
  return Json(names).dump(-1, ' ', false, Json::error_handler_t::replace);
}

template <class Json = nlohmann::json>
void store_views(const ModelInfo& info, StoredCameras which, CodecModel& coded) {
  if (which == StoredCameras::none) return;
  Json names = Json::array();
  std::vector<double> numbers;
  bool lenses = false;
  for (const StoredView& view : info.views) lenses = lenses || !is_pinhole(view.lens);
  for (const StoredView& view : info.views) {
    if (which == StoredCameras::test && !view.test) continue;
    names.push_back({view.name, view.test ? 1 : 0});
    append_camera_row(view.camera, numbers);
    if (lenses) append_lens_row(view.lens, numbers);
  }
  if (names.empty()) return;
  coded.metadata["views"] = names.dump(-1, ' ', false, Json::error_handler_t::replace);
  coded.metadata[lenses ? "cameras.lens" : "cameras"] = packed_doubles(numbers);
}

template <class Json = nlohmann::json>
[[nodiscard]] Result<std::vector<StoredView>> read_views(const CodecModel& coded) {
  const auto text = [&](const char* key) -> const std::string* {
    const auto found = coded.metadata.find(key);
    return found == coded.metadata.end() ? nullptr : std::get_if<std::string>(&found->second);
  };
  std::vector<StoredView> views;
  const std::string* const names = text("views");
  if (names == nullptr) return views;
  const std::string* const with_lens = text("cameras.lens");
  const std::string* const plain = with_lens != nullptr ? with_lens : text("cameras");
  const auto fail = [](std::string problem) {
    return coded_error("META.views", std::move(problem),
                       "the file was not written by this tool; encode the model again");
  };
  const Json json = json_from<Json>(*names);
  if (!json.is_array() || plain == nullptr) return fail("names and cameras do not belong together");
  const std::vector<double> numbers = unpacked_doubles(*plain);
  const std::size_t width = camera_numbers + (with_lens != nullptr ? lens_numbers : 0);
  if (numbers.size() != json.size() * width) return fail("has another number of cameras than of names");
  for (std::size_t i = 0; i < json.size(); ++i) {
    if (!json[i].is_array() || json[i].size() != 2 || !json[i][0].is_string() || !json[i][1].is_number_integer()) {
      return fail("holds an entry that is not a name and a split");
    }
    StoredView view;
    view.name = json[i][0].template get<std::string>();
    view.test = json[i][1].template get<int>() != 0;
    const std::span<const double> row = std::span(numbers).subspan(i * width, width);
    if (!read_camera_row(row.first<camera_numbers>(), view.camera))
      return fail("view " + view.name + " has an impossible camera");
    if (with_lens != nullptr && !read_lens_row(row.last<lens_numbers>(), view.lens))
      return fail("view " + view.name + " has an impossible lens");
    views.push_back(std::move(view));
  }
  return views;
}

}  // namespace detail

}  // namespace compmark
