// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The images of a dataset, decoded (or made, Dataset::pictures) when first asked for and kept in 8 bits within a memory
// budget; the least recently used go first. scene/decode.hpp describes the steps of decoding. A delivered image always has the size of the view's
// camera. A file whose size has changed since the dataset was opened is an Error, and so is one that would take more
// than the budget to decode. Cost of a hit: O(1); of a miss: decoding (~20 ns a pixel) and resizing. The result never
// depends on the budget or on the order of use.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/decode.hpp"
#include "compmark/scene/image.hpp"
#include "compmark/scene/picture_source.hpp"
#include "compmark/scene/resize.hpp"

namespace compmark {

struct ImageStoreSettings {
  std::size_t memory_budget_bytes = std::size_t{768} << 20;  ///< of decoded images; one image is always kept
  AlphaRounding alpha_rounding = AlphaRounding::truncate;    ///< published behaviour
  ResizeFilter filter = ResizeFilter::bicubic;               ///< published behaviour
  bool alpha_mask = false;  ///< transparent pixels get a mask, as well as the background
  bool keep_alpha = false;  ///< the alpha channel is kept: load can then composite over another background
};

/// Counters of the store.
struct ImageStoreStatistics {
  std::size_t hits = 0;
  std::size_t decoded = 0;
  std::size_t evicted = 0;
  std::size_t bytes = 0;  ///< held now
};

/// Not thread-safe: one store per consumer.
class ImageStore {
 public:
  ImageStore(const Dataset& dataset, const DatasetSettings& dataset_settings, const ImageStoreSettings& settings = {})
      : background_(dataset_settings.background),
        settings_(settings),
        pictures_(dataset.pictures) {
    entries_.reserve(dataset.views.size());
    for (const View& view : dataset.views) {
      index_.emplace(key(view), entries_.size());
      entries_.push_back({view, {}, 0});
    }
  }

  /// The image of view i of the dataset. The pointer is valid until the next call of get or load.
  [[nodiscard]] Result<const StoredImage*> get(std::size_t i) {
    COMPMARK_ASSERT(i < entries_.size(), "ImageStore::get: index");
    Entry& entry = entries_[i];
    entry.last_use = ++clock_;
    if (!entry.image.planes.empty()) {
      ++statistics_.hits;
      return &entry.image;
    }
    if (Result<Done> fits = check_budget(entry.view); !fits) return fits.error();
    const DecodeSettings decoding{background_, settings_.alpha_rounding, settings_.filter, settings_.alpha_mask,
                                  settings_.keep_alpha};
    Result<StoredImage> image =
        pictures_ ? pictures_->picture(entry.view, decoding) : decode_view(entry.view, decoding);
    if (!image) return image.error();
    make_room(image->bytes());
    entry.image = std::move(*image);
    statistics_.bytes += entry.image.bytes();
    ++statistics_.decoded;
    return &entry.image;
  }
  /// The same by a view of the dataset the store was made from.
  [[nodiscard]] Result<const StoredImage*> get(const View& view) {
    const auto found = index_.find(key(view));
    if (found == index_.end()) {
      return Error{ErrorKind::not_found, view.image_path.string(), view.name, "the view is not of this store's dataset",
                   "use a view of the dataset"};
    }
    return get(found->second);
  }
  /// How much each pixel of view i counts, 0 … 255, [height, width]; empty: all of them, whole. Valid as long as the
  /// pointer of get.
  [[nodiscard]] Result<std::span<const std::uint8_t>> mask(std::size_t i) {
    const Result<const StoredImage*> image = get(i);
    if (!image) return image.error();
    return std::span<const std::uint8_t>((*image)->mask);
  }
  /// Fills image [3, height, width] of the size of the view's camera with colours in [0, 1].
  [[nodiscard]] Result<Done> load(const View& view, ImageView<float> image) { return load(get(view), image); }
  [[nodiscard]] Result<Done> load(std::size_t i, ImageView<float> image) { return load(get(i), image); }

  /// The same over `background` instead of the dataset's (needs keep_alpha), with the planes of effects: `alpha` and
  /// `weight` are [height, width] or null. An opaque image has alpha 1, one without a mask weight 1.
  [[nodiscard]] Result<Done> load_planes(std::size_t i, const std::array<float, 3>& background, ImageView<float> image,
                                         float* alpha, float* weight) {
    const Result<const StoredImage*> stored = get(i);
    if (Result<Done> loaded = load(stored, image); !loaded) return loaded.error();
    const View& view = entries_[i].view;
    if (view.has_alpha && !settings_.keep_alpha && (alpha != nullptr || background != background_)) {
      return Error{ErrorKind::unsupported, view.image_path.string(), "alpha",
                   "was asked for, but this store does not keep it", "set ImageStoreSettings::keep_alpha"};
    }
    const StoredImage& from = **stored;
    const std::size_t pixels = from.plane_size();
    if (!from.alpha.empty()) {
      for (std::size_t c = 0; c < 3; ++c) {
        const float change = background[c] - background_[c];
        for (std::size_t k = 0; change != 0 && k < pixels; ++k)
          image.data[c * pixels + k] += (1 - static_cast<float>(from.alpha[k]) / 255.0f) * change;
      }
    }
    for (std::size_t k = 0; alpha != nullptr && k < pixels; ++k)
      alpha[k] = from.alpha.empty() ? 1.0f : static_cast<float>(from.alpha[k]) / 255.0f;
    for (std::size_t k = 0; weight != nullptr && k < pixels; ++k)
      weight[k] = from.mask.empty() ? 1.0f : static_cast<float>(from.mask[k]) / 255.0f;
    return Done{};
  }
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  [[nodiscard]] const ImageStoreStatistics& statistics() const { return statistics_; }

 private:
  struct Entry {
    View view;
    StoredImage image;
    std::uint64_t last_use = 0;
  };

  /// Photographs of ordinary cameras are always decoded; larger ones must fit into the budget, whatever size they are
  /// delivered in, and so must what is delivered.
  [[nodiscard]] Result<Done> check_budget(const View& view) const {
    constexpr std::size_t ordinary = std::size_t{256} << 20;
    const auto bytes = [](int width, int height) {
      return 3 * static_cast<std::size_t>(std::max(0, width)) * static_cast<std::size_t>(std::max(0, height));
    };
    const std::size_t in_file = bytes(view.file_width, view.file_height),
                      delivered = bytes(view.camera.width, view.camera.height);
    if (std::max(in_file, delivered) <= std::max(ordinary, settings_.memory_budget_bytes)) return Done{};
    const bool enlarged = delivered > in_file;
    return Error{ErrorKind::exhausted, view.image_path.string(), enlarged ? "downscale" : "image size",
                 (enlarged ? "makes it " : "is ") + std::to_string(enlarged ? view.camera.width : view.file_width) +
                     " x " + std::to_string(enlarged ? view.camera.height : view.file_height) +
                     " pixels, which take more than the memory budget of " +
                     std::to_string(settings_.memory_budget_bytes >> 20) + " MB",
                 "raise --memory-budget, or scale the photographs down"};
  }

  static std::string key(const View& view) {
    return view.image_path.string() + '\n' + view.name + '\n' + std::to_string(view.camera.width) + 'x' +
           std::to_string(view.camera.height);
  }
  static Result<Done> load(const Result<const StoredImage*>& image, ImageView<float> out) {
    if (!image) return image.error();
    (*image)->to_float(out);
    return Done{};
  }

  /// Evicts least recently used images until `bytes` more fit.
  void make_room(std::size_t bytes) {
    while (statistics_.bytes > 0 && statistics_.bytes + bytes > settings_.memory_budget_bytes) {
      Entry* oldest = nullptr;
      for (Entry& entry : entries_) {
        if (!entry.image.planes.empty() && (oldest == nullptr || entry.last_use < oldest->last_use)) oldest = &entry;
      }
      statistics_.bytes -= oldest->image.bytes();
      ++statistics_.evicted;
      oldest->image = {};
    }
  }

  std::array<float, 3> background_;
  ImageStoreSettings settings_;
  std::shared_ptr<const PictureSource> pictures_;
  std::vector<Entry> entries_;
  std::unordered_map<std::string, std::size_t> index_;
  std::uint64_t clock_ = 0;
  ImageStoreStatistics statistics_;
};

}  // namespace compmark
