// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// COLMAP's text files cameras.txt, images.txt, points3D.txt. "#" starts a comment line; images take two lines each, of
// which the second may be empty, or left out altogether as some writers do; a name is the rest of its line and may
// contain spaces. Numbers are read independently of the locale; lines end as on any system.
#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/scene/colmap_model.hpp"
#include "compmark/scene/text_bytes.hpp"

namespace compmark {

namespace detail {

/// Words of one line, taken one by one; `good` tells whether all were there and could be read.
class LineCursor {
 public:
  explicit LineCursor(std::string_view line) : rest_(line) {}

  std::string_view word() {
    trim();
    std::size_t end = 0;
    while (end < rest_.size() && !blank(rest_[end])) ++end;
    const std::string_view result = rest_.substr(0, end);
    rest_.remove_prefix(end);
    good_ = good_ && !result.empty();
    return result;
  }
  template <class T>
  T number() {
    const std::string_view text = word();
    T value{};
    const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
    good_ = good_ && status == std::errc() && end == text.data() + text.size();
    return value;
  }
  std::string_view rest() {
    trim();
    std::string_view result = rest_;
    while (!result.empty() && blank(result.back())) result.remove_suffix(1);
    good_ = good_ && !result.empty();
    return result;
  }
  [[nodiscard]] bool at_end() {
    trim();
    return rest_.empty();
  }
  [[nodiscard]] bool good() const { return good_; }

 private:
  static bool blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
  void trim() {
    while (!rest_.empty() && blank(rest_.front())) rest_.remove_prefix(1);
  }
  std::string_view rest_;
  bool good_ = true;
};

/// Lines of a file, counted.
class LineReader {
 public:
  [[nodiscard]] static Result<LineReader> open(const std::filesystem::path& path) {
    Result<std::vector<std::byte>> bytes = read_text(path);
    if (!bytes) return bytes.error();
    LineReader reader;
    reader.name_ = path.string();
    reader.bytes_ = std::move(*bytes);
    if (reader.text().find('\n') == std::string_view::npos) reader.end_ = '\r';
    return reader;
  }
  std::optional<std::string_view> next() {
    if (position_ >= bytes_.size()) return std::nullopt;
    previous_ = position_;
    const std::size_t end = text().find(end_, position_);
    const std::string_view line = text().substr(position_, end == std::string_view::npos ? end : end - position_);
    position_ = end == std::string_view::npos ? bytes_.size() : end + 1;
    ++number_;
    return line;
  }
  /// Makes the next call of next() return the last line again.
  void back() {
    position_ = previous_;
    --number_;
  }
  /// The next line that is neither empty nor a comment.
  std::optional<std::string_view> next_record() {
    while (std::optional<std::string_view> line = next()) {
      const std::size_t first = line->find_first_not_of(" \t\r");
      if (first != std::string_view::npos && (*line)[first] != '#') return line;
    }
    return std::nullopt;
  }
  [[nodiscard]] Error error(ErrorKind kind, std::string problem) const {
    return {kind, name_, "line " + std::to_string(number_), std::move(problem),
            "correct the line or export the model again with colmap model_converter"};
  }
  /// The error of an id that appeared before: the file does not say which of the two lines is meant.
  [[nodiscard]] Error repeated_id(const char* what, std::uint64_t id) const {
    return error(ErrorKind::malformed, std::string(what) + " " + std::to_string(id) + " is there twice");
  }

 private:
  [[nodiscard]] std::string_view text() const { return {reinterpret_cast<const char*>(bytes_.data()), bytes_.size()}; }
  std::string name_;
  std::vector<std::byte> bytes_;
  std::size_t position_ = 0;
  std::size_t previous_ = 0;
  std::size_t number_ = 0;
  char end_ = '\n';
};

/// IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, or nothing if the line is none.
[[nodiscard]] inline std::optional<std::pair<std::uint32_t, ColmapImage>> parse_image_line(std::string_view line) {
  LineCursor cursor(line);
  ColmapImage image;
  const auto id = cursor.number<std::uint32_t>();
  for (double& v : image.rotation_wxyz) v = cursor.number<double>();
  for (double& v : image.translation) v = cursor.number<double>();
  image.camera_id = cursor.number<std::uint32_t>();
  image.name = cursor.rest();
  if (!cursor.good()) return std::nullopt;
  return std::pair{id, std::move(image)};
}

/// Whether a line can be the second one of an image, by its first four triples X Y POINT3D_ID: the tenth word of a line
/// that describes an image is its name, which is no number, or a tenth number that begins no whole triple.
[[nodiscard]] inline bool may_be_features(std::string_view line) {
  LineCursor cursor(line);
  for (int i = 0; i < 12; ++i) {
    if (cursor.at_end()) return i % 3 == 0;
    if (i % 3 < 2) {
      static_cast<void>(cursor.number<double>());
    } else if (cursor.word().find_first_not_of("-0123456789") != std::string_view::npos) {
      return false;
    }
    if (!cursor.good()) return false;
  }
  return true;
}

/// The second line of an image; empty where its writer left it out, so that the next line describes the next image.
[[nodiscard]] inline Result<std::string_view> feature_line(LineReader& lines) {
  const std::optional<std::string_view> line = lines.next();
  if (!line || may_be_features(*line)) return line.value_or(std::string_view());
  if (line->find_first_not_of(" \t") != line->find('#') && !parse_image_line(*line)) {
    return lines.error(ErrorKind::malformed,
                       "the second line of an image needs triples X Y POINT3D_ID (it may be empty, or left out)");
  }
  lines.back();
  return std::string_view();
}

}  // namespace detail

/// Reads the files of a folder; without points3D.txt a model without points.
[[nodiscard]] inline Result<ColmapModel> read_colmap_text(const std::filesystem::path& folder,
                                                          const ColmapReadSettings& settings = {}) {
  ColmapModel model;
  Result<detail::LineReader> lines = detail::LineReader::open(folder / "cameras.txt");
  if (!lines) return lines.error();
  while (const std::optional<std::string_view> line = lines->next_record()) {
    detail::LineCursor cursor(*line);
    const auto id = cursor.number<std::uint32_t>();
    const std::string_view name = cursor.word();
    const std::optional<int> number = colmap_model_id(name);
    if (!number) {
      Error error = lines->error(ErrorKind::unsupported, "unknown camera model \"" + std::string(name) + "\"");
      error.remedy = "undistort the images with colmap image_undistorter, which writes PINHOLE cameras";
      return error;
    }
    ColmapCamera camera;
    camera.model = *number;
    camera.width = cursor.number<std::uint64_t>();
    camera.height = cursor.number<std::uint64_t>();
    for (std::size_t i = 0; i < colmap_models[static_cast<std::size_t>(camera.model)].parameters; ++i)
      camera.parameters[i] = cursor.number<double>();
    if (!cursor.good())
      return lines->error(ErrorKind::malformed, "a camera needs CAMERA_ID MODEL WIDTH HEIGHT PARAMS of its model");
    if (!cursor.at_end()) {
      return lines->error(ErrorKind::malformed,
                          "a camera " + std::string(name) + " has " +
                              std::to_string(colmap_models[static_cast<std::size_t>(camera.model)].parameters) +
                              " parameters, and the line has more");
    }
    if (!model.cameras.emplace(id, camera).second) return lines->repeated_id("camera", id);
  }

  lines = detail::LineReader::open(folder / "images.txt");
  if (!lines) return lines.error();
  while (const std::optional<std::string_view> line = lines->next_record()) {
    std::optional<std::pair<std::uint32_t, ColmapImage>> parsed = detail::parse_image_line(*line);
    if (!parsed)
      return lines->error(ErrorKind::malformed, "an image needs IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME");
    auto& [id, image] = *parsed;
    if (model.images.count(id) > 0) return lines->repeated_id("image", id);
    const Result<std::string_view> features = detail::feature_line(*lines);
    if (!features) return features.error();
    detail::LineCursor feature(*features);
    while (settings.observations && !feature.at_end()) {
      ColmapObservation observation;
      observation.x = feature.number<double>();
      observation.y = feature.number<double>();
      const auto point = feature.number<std::int64_t>();
      observation.point_id = point < 0 ? ~std::uint64_t{0} : static_cast<std::uint64_t>(point);
      if (!feature.good())
        return lines->error(ErrorKind::malformed, "the second line of an image needs triples X Y POINT3D_ID");
      image.observations.push_back(observation);
    }
    model.images.emplace(id, std::move(image));
  }

  if (std::error_code ignored; !std::filesystem::exists(folder / "points3D.txt", ignored)) return model;
  lines = detail::LineReader::open(folder / "points3D.txt");
  if (!lines) return lines.error();
  while (const std::optional<std::string_view> line = lines->next_record()) {
    detail::LineCursor cursor(*line);
    const auto id = cursor.number<std::uint64_t>();
    ColmapPoint point;
    for (double& v : point.position) v = cursor.number<double>();
    for (std::uint8_t& v : point.color) v = cursor.number<std::uint8_t>();
    if (!cursor.good()) return lines->error(ErrorKind::malformed, "a point needs POINT3D_ID X Y Z R G B");
    if (!model.points.emplace(id, point).second) return lines->repeated_id("point", id);
  }
  return model;
}

}  // namespace compmark
