// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Images to train and measure a message decoder on: photographs of a folder, decoded once, or dead leaves made on
// demand. One type serves both, so that the training has no branch. Photographs that belong together ("kitchen_0.jpg",
// "kitchen_1.jpg") stay on one side of a split.
#pragma once

#include <algorithm>
#include <array>
#include <compmark/app/files.hpp>
#include <compmark/core/random.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/views.hpp>
#include <compmark/io/image_file.hpp>
#include <compmark/io/sha256.hpp>
#include <compmark/math/separable_map.hpp>
#include <compmark/scene/image_folder.hpp>
#include <compmark/watermark/pretrain/dead_leaves.hpp>
#include <compmark/watermark/pretrain/photograph_split.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common.hpp"

namespace tool {

class PretrainImages {
 public:
  /// Dead leaves of a seed: more of them than any run reads.
  explicit PretrainImages(std::uint64_t seed = 1) : seed_(seed) {}
  struct Photograph {
    std::string name;            ///< of the file
    compmark::ImageBytes image;  ///< RGB
  };
  explicit PretrainImages(std::vector<Photograph> photographs) : photographs_(std::move(photographs)) {}

  [[nodiscard]] bool procedural() const { return photographs_.empty(); }
  [[nodiscard]] std::size_t size() const { return procedural() ? std::size_t{1} << 24 : photographs_.size(); }

  /// The sample for Pretrainer: a random square, mirrored half of the time.
  void read(std::size_t index, const compmark::Random& random, int side, compmark::ImageView<float> view) const {
    if (procedural()) return compmark::dead_leaves_image(seed_, index, view);
    const compmark::ImageBytes& image = photographs_[index].image;
    const auto place = [&](std::uint64_t draw, int free) {
      return static_cast<int>(random.below(draw, static_cast<std::uint64_t>(free) + 1));
    };
    copy(image, place(1, image.height - side), place(2, image.width - side), (random.bits(3) & 1u) != 0, view);
  }
  /// The central square of an image; mirrored for `again` = 1, and random squares after that.
  void read_square(std::size_t index, std::size_t again, compmark::ImageView<float> view) const {
    if (procedural()) return compmark::dead_leaves_image(seed_, index + again * (std::size_t{1} << 25), view);
    const compmark::ImageBytes& image = photographs_[index].image;
    const int side = view.height;
    if (again > 1)
      return read(index, {seed_, again, compmark::random_stage("tool/pretrain/square") + index}, side, view);
    copy(image, (image.height - side) / 2, (image.width - side) / 2, again == 1, view);
  }
  [[nodiscard]] int smallest_side() const {
    int side = 1 << 14;
    for (const Photograph& p : photographs_) side = std::min({side, p.image.height, p.image.width});
    return side;
  }
  /// A hash of names and decoded pixels, in order: the identity of the images of a run.
  [[nodiscard]] std::string digest() const {
    compmark::Sha256 hash;
    for (const Photograph& p : photographs_) {
      hash.update(std::as_bytes(std::span<const char>(p.name.data(), p.name.size())));
      hash.update(std::as_bytes(std::span<const std::uint8_t>(p.image.pixels)));
    }
    return hash.hex();
  }

  /// Takes a share of the photographs out (watermark/pretrain/photograph_split.hpp). Empty if that leaves nothing here.
  [[nodiscard]] PretrainImages take_share(double share) {
    std::vector<std::string> names;
    for (const Photograph& p : photographs_) names.push_back(p.name);
    const std::set<std::string> out = compmark::held_out_groups(names, share);
    std::vector<Photograph> taken, kept;
    for (Photograph& p : photographs_)
      (out.count(compmark::photograph_group(p.name)) != 0 ? taken : kept).push_back(std::move(p));
    photographs_ = std::move(kept);
    return PretrainImages(std::move(taken));
  }

  /// Every PNG and JPEG of a folder. One whose shorter side is above `most` is reduced to it, antialiased: a photograph
  /// of a modern camera is smooth at the scale of a few pixels, and a hundred of them would not fit. One that takes
  /// more than the budget while it is read is refused.
  [[nodiscard]] static compmark::Result<PretrainImages> folder(const std::filesystem::path& path, const char* option,
                                                               int least, int most, std::size_t budget_mb) {
    using compmark::Error;
    using compmark::ErrorKind;
    if (!std::filesystem::is_directory(path))
      return Error{ErrorKind::not_found, path.string(), option, "is not a folder", "give a folder of photographs"};
    std::vector<Photograph> photographs;
    for (const std::string& name : compmark::detail::image_names(path)) {
      const compmark::Result<compmark::ImageInfo> info = compmark::read_image_info(path / name);
      if (!info) return info.error();
      constexpr std::uint64_t bytes_a_pixel = 20;  // its pixels, and their floats while it is reduced
      if (auto fits = compmark::check_image_memory(*info, path / name, bytes_a_pixel, budget_mb); !fits)
        return fits.error();
      compmark::Result<compmark::ImageBytes> image = compmark::read_image(path / name);
      if (!image) return image.error();
      if (std::min(image->width, image->height) < least) {
        return Error{ErrorKind::invalid, (path / name).string(), "size",
                     "is " + std::to_string(image->width) + " x " + std::to_string(image->height) +
                         " pixels, less than the " + std::to_string(least) + " of a training crop",
                     "leave it out, or train on smaller crops with --crop"};
      }
      photographs.push_back({name, reduced(rgb(std::move(*image)), most)});
    }
    if (photographs.empty()) {
      return Error{ErrorKind::not_found, path.string(), option, "holds no PNG or JPEG image",
                   "give a folder of photographs, or leave the option out to train on procedural images"};
    }
    return PretrainImages(std::move(photographs));
  }

 private:
  static compmark::ImageBytes rgb(compmark::ImageBytes image) {
    if (image.channels == 3) return image;
    compmark::ImageBytes result{image.width, image.height, 3, {}};
    const auto channels = static_cast<std::size_t>(image.channels);
    for (std::size_t i = 0; i < image.pixels.size(); i += channels) {
      for (std::size_t c = 0; c < 3; ++c) result.pixels.push_back(image.pixels[i + (channels < 3 ? 0 : c)]);
    }
    return result;
  }
  static compmark::ImageBytes reduced(compmark::ImageBytes image, int most) {
    const int side = std::min(image.width, image.height);
    if (side <= most) return image;
    using Table = compmark::RunTable<float>;
    const auto scaled = [&](int n) { return static_cast<int>(static_cast<std::int64_t>(n) * most / side); };
    compmark::SeparableMap<float> map{Table::resize(image.height, scaled(image.height)),
                                      Table::resize(image.width, scaled(image.width))};
    const auto planes = [](int height, int width) {
      return std::vector<float>(3 * static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
    };
    std::vector<float> from = planes(image.height, image.width), to = planes(map.height(), map.width());
    const compmark::ImageView<float> source{from.data(), 3, image.height, image.width};
    copy(image, 0, 0, false, source);
    compmark::PerWorkerRows<float> scratch;
    compmark::SerialExecutor executor;
    const compmark::ImageView<float> target{to.data(), 3, map.height(), map.width()};
    map.apply(compmark::ImageView<const float>(source), target, scratch, executor);
    return compmark::to_bytes(compmark::ImageView<const float>(target));
  }
  static void copy(const compmark::ImageBytes& image, int top, int left, bool mirrored,
                   compmark::ImageView<float> view) {
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const int column = left + (mirrored ? view.width - 1 - x : x);
        const auto at = 3 * (static_cast<std::size_t>(top + y) * static_cast<std::size_t>(image.width) +
                             static_cast<std::size_t>(column));
        for (int c = 0; c < 3; ++c)
          view(c, y, x) = static_cast<float>(image.pixels[at + static_cast<std::size_t>(c)]) / 255.0f;
      }
    }
  }

  std::uint64_t seed_ = 1;
  std::vector<Photograph> photographs_;
};

}  // namespace tool
