// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What one training of the ablations is given and what it fills in; the scenes, the short schedule and the message are
// those of every row.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "ablations/recipe.hpp"
#include "ablations/record.hpp"
#include "ablations/rows.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/image_store.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/settings.hpp"

namespace ablation {

/// Some views of a dataset, as the trainer wants them.
struct Views {
  const compmark::Dataset* dataset = nullptr;
  compmark::ImageStore* store = nullptr;
  std::vector<std::size_t> index;

  [[nodiscard]] std::size_t size() const { return index.size(); }
  [[nodiscard]] compmark::Camera<double> camera(std::size_t i) const { return dataset->views[index[i]].camera; }
  [[nodiscard]] compmark::Result<compmark::Done> load(std::size_t i, compmark::ImageView<float> image) const {
    return store->load(dataset->views[index[i]], image);
  }
};

struct Scene {
  std::string name;
  compmark::Dataset dataset;
  std::unique_ptr<compmark::ImageStore> store;
  Views train, test;
  double extent = 1;
};
/// The two scenes that need no data, rendered into `folder` when they are not there: the whole still life, and a closer
/// look with other veins.
compmark::Result<std::vector<std::unique_ptr<Scene>>> built_in_scenes(const std::filesystem::path& folder,
                                                                      compmark::ThreadExecutor& executor);
/// A dataset, scaled down by a whole number so that no side is longer than `longest_side`.
compmark::Result<std::unique_ptr<Scene>> open_scene(const std::filesystem::path& folder, std::string name);
inline constexpr int built_in_side = 96, longest_side = 128;

/// The numbers of every row at this length: the published ones of a mark in the loss of the photographs, scaled to the
/// run.
compmark::TrainSettings training_settings(std::int64_t iterations, std::uint64_t seed);
/// The same for one row: parts switched off.
compmark::TrainSettings row_settings(const Row& row, std::int64_t iterations, std::uint64_t seed);
/// What a record has to say to be the same run.
nlohmann::ordered_json settings_json(const Scene& scene, std::int64_t iterations);

/// Fourier features of colour as they are drawn, a bit a feature: nothing is trained, no file is read.
Decoder fourier_decoder(int bits, std::uint64_t seed);
std::vector<std::uint8_t> message_bits(int bits, std::uint64_t seed);

/// Trains one row and measures it, before compression and from the file that the codec wrote. The file is at `scratch`
/// while it runs.
compmark::Result<Record> train_row(const Row& row, Scene& scene, std::int64_t iterations, std::uint64_t seed,
                                   const std::filesystem::path& scratch, compmark::ThreadExecutor& executor);

/// The two halves of it that render, which are compiled apart: a training, its mark baked in; and what is read from a
/// model.
compmark::Result<compmark::Model<Base>> train_base(const Row& row, Scene& scene,
                                                   const compmark::TrainSettings& settings, const Decoder& decoder,
                                                   const std::vector<std::uint8_t>& bits,
                                                   compmark::ThreadExecutor& executor);
/// Over the test views, rounded to 8 bits. Without a decoder nothing is read.
compmark::Result<Measured> measure(const compmark::Model<Base>& model, const Scene& scene, const Decoder* decoder,
                                   const std::vector<std::uint8_t>& bits, compmark::ThreadExecutor& executor);

}  // namespace ablation
