// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// COLMAP's binary files cameras.bin, images.bin, points3D.bin: little-endian records after a 64-bit count. A count is
// compared with the bytes that are left before anything is allocated, so a damaged count is an Error and not a crash.
// Cost: one pass over the bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/scene/colmap_model.hpp"

namespace compmark {

namespace detail {

/// A cursor that never passes the end: after a short read `good` is false and every value is zero.
class BinaryCursor {
 public:
  explicit BinaryCursor(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <class T>
  T take() {
    T value{};
    if (bytes_.size() - position_ < sizeof(T)) {
      good_ = false;
      position_ = bytes_.size();
      return value;
    }
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }
  /// Characters up to a zero byte.
  std::string take_string() {
    const std::byte* begin = bytes_.data() + position_;
    const void* zero = left() > 0 ? std::memchr(begin, 0, left()) : nullptr;
    if (zero == nullptr) {
      good_ = false;
      position_ = bytes_.size();
      return {};
    }
    const std::size_t length = static_cast<std::size_t>(static_cast<const std::byte*>(zero) - begin);
    position_ += length + 1;
    return std::string(reinterpret_cast<const char*>(begin), length);
  }
  void skip(std::uint64_t count, std::size_t size) {
    if (!fits(count, size)) {
      good_ = false;
      position_ = bytes_.size();
    } else {
      position_ += static_cast<std::size_t>(count) * size;
    }
  }
  [[nodiscard]] bool fits(std::uint64_t count, std::size_t size) const { return count <= left() / size; }
  [[nodiscard]] std::size_t left() const { return bytes_.size() - position_; }
  [[nodiscard]] bool good() const { return good_; }
  [[nodiscard]] std::string place() const { return "byte " + std::to_string(position_); }

 private:
  std::span<const std::byte> bytes_;
  std::size_t position_ = 0;
  bool good_ = true;
};

/// Reads a file whose first value is a count of records of at least `least` bytes and calls record(cursor) for each;
/// record returns Result<Done>.
template <class Record>
[[nodiscard]] Result<Done> parse_colmap_records(std::span<const std::byte> bytes, const std::filesystem::path& path,
                                                std::size_t least, Record record) {
  BinaryCursor cursor(bytes);
  const std::uint64_t count = cursor.take<std::uint64_t>();
  const auto truncated = [&](const std::string& where) {
    return Error{ErrorKind::truncated, path.string(), where,
                 "the file ends before the " + std::to_string(count) + " records it promises",
                 "copy the file again or export the model again with colmap model_converter"};
  };
  if (!cursor.good())
    return Error{ErrorKind::truncated, path.string(), "byte 0", "the file is too short to hold a count",
                 "copy the file again"};
  if (!cursor.fits(count, least)) return truncated("count");
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string where = cursor.place();
    Result<Done> done = record(cursor);
    if (!cursor.good()) return truncated("record " + std::to_string(i) + " at " + where);
    if (!done) {
      Error error = done.error();
      error.file = path.string();
      error.field = "record " + std::to_string(i) + " at " + where + (error.field.empty() ? "" : ", " + error.field);
      return error;
    }
  }
  if (cursor.left() == 0) return Done{};
  return Error{
      ErrorKind::malformed, path.string(), "count",
      "is " + std::to_string(count) + ", but " + std::to_string(cursor.left()) + " more bytes follow the records",
      "copy the file again or export the model again with colmap model_converter"};
}

/// The error of an id that appeared before: the file does not say which of the two records is meant.
[[nodiscard]] inline Error repeated_id(const char* field, std::uint64_t id) {
  return {ErrorKind::malformed,
          {},
          field,
          "is " + std::to_string(id) + ", as in an earlier record",
          "export the model again with colmap model_converter"};
}

}  // namespace detail

/// The contents of the three files; `folder` is for the messages.
[[nodiscard]] inline Result<ColmapModel> parse_colmap_binary(std::span<const std::byte> cameras,
                                                             std::span<const std::byte> images,
                                                             std::span<const std::byte> points,
                                                             const std::filesystem::path& folder,
                                                             const ColmapReadSettings& settings = {}) {
  ColmapModel model;
  Result<Done> done = detail::parse_colmap_records(
      cameras, folder / "cameras.bin", 24, [&](detail::BinaryCursor& cursor) -> Result<Done> {
        const auto id = cursor.take<std::uint32_t>();
        ColmapCamera camera;
        camera.model = cursor.take<std::int32_t>();
        camera.width = cursor.take<std::uint64_t>();
        camera.height = cursor.take<std::uint64_t>();
        if (camera.model < 0 || static_cast<std::size_t>(camera.model) >= colmap_models.size()) {
          return Error{ErrorKind::unsupported,
                       {},
                       "camera model",
                       "unknown camera model id " + std::to_string(camera.model),
                       "undistort the images with colmap image_undistorter, which writes PINHOLE cameras"};
        }
        for (std::size_t i = 0; i < colmap_models[static_cast<std::size_t>(camera.model)].parameters; ++i)
          camera.parameters[i] = cursor.take<double>();
        if (!model.cameras.emplace(id, camera).second) return detail::repeated_id("camera id", id);
        return Done{};
      });
  if (!done) return done.error();
  done = detail::parse_colmap_records(images, folder / "images.bin", 73,
                                      [&](detail::BinaryCursor& cursor) -> Result<Done> {
                                        const auto id = cursor.take<std::uint32_t>();
                                        ColmapImage image;
                                        for (double& v : image.rotation_wxyz) v = cursor.take<double>();
                                        for (double& v : image.translation) v = cursor.take<double>();
                                        image.camera_id = cursor.take<std::uint32_t>();
                                        image.name = cursor.take_string();
                                        const auto features = cursor.take<std::uint64_t>();
                                        if (!settings.observations || !cursor.fits(features, 24)) {
                                          cursor.skip(features, 24);
                                        } else {
                                          image.observations.resize(static_cast<std::size_t>(features));
                                          for (ColmapObservation& observation : image.observations) {
                                            observation.x = cursor.take<double>();
                                            observation.y = cursor.take<double>();
                                            observation.point_id = cursor.take<std::uint64_t>();
                                          }
                                        }
                                        if (!model.images.emplace(id, std::move(image)).second)
                                          return detail::repeated_id("image id", id);
                                        return Done{};
                                      });
  if (!done) return done.error();
  done = detail::parse_colmap_records(
      points, folder / "points3D.bin", 51, [&](detail::BinaryCursor& cursor) -> Result<Done> {
        const auto id = cursor.take<std::uint64_t>();
        ColmapPoint point;
        for (double& v : point.position) v = cursor.take<double>();
        for (std::uint8_t& v : point.color) v = cursor.take<std::uint8_t>();
        static_cast<void>(
            cursor.take<double>());  // reprojection error, in pixels of the images the model was computed from
        cursor.skip(cursor.take<std::uint64_t>(), 8);
        if (!model.points.emplace(id, point).second) return detail::repeated_id("point id", id);
        return Done{};
      });
  if (!done) return done.error();
  return model;
}

/// Reads the files of a folder; without points3D.bin a model without points.
[[nodiscard]] inline Result<ColmapModel> read_colmap_binary(const std::filesystem::path& folder,
                                                            const ColmapReadSettings& settings = {}) {
  std::array<std::vector<std::byte>, 3> contents;
  constexpr std::array<const char*, 3> names{"cameras.bin", "images.bin", "points3D.bin"};
  for (std::size_t i = 0; i < 3; ++i) {
    std::error_code ignored;
    if (i == 2 && !std::filesystem::exists(folder / names[i], ignored)) {
      contents[i].resize(sizeof(std::uint64_t));  // a count of zero
      continue;
    }
    Result<std::vector<std::byte>> bytes = read_file(folder / names[i]);
    if (!bytes) return bytes.error();
    contents[i] = std::move(*bytes);
  }
  return parse_colmap_binary(contents[0], contents[1], contents[2], folder, settings);
}

}  // namespace compmark
