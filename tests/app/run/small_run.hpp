// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A small scene to train in seconds, an observer that keeps what it is told, and files read back.
#pragma once

#include <doctest/doctest.h>

#include <compmark/app/run/owner_keys.hpp>
#include <compmark/app/run/train.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/io/read_file.hpp>
#include <compmark/scene/procedural_write.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "support/tool.hpp"

namespace compmark::testing {

/// Eight photographs to train on and two to measure, 48 x 48.
struct SmallCapture {
  ScratchFolder folder;
  std::filesystem::path data = folder.path / "scene", key = folder.path / "owner.key";

  explicit SmallCapture(const std::string& name) : folder(name) {
    ProceduralSettings scene;
    scene.width = scene.height = 48;
    scene.views_train = 8;
    scene.views_test = 2;
    REQUIRE(write_procedural_scene(data, scene).ok());
  }
  /// 30 iterations into a folder of this name, by a recipe that no probe chooses.
  [[nodiscard]] TrainSceneSettings training(const std::string& out) const {
    TrainSceneSettings settings;
    settings.data = data;
    settings.out = folder.path / out;
    settings.recipe = "scaffold";
    settings.iterations = 30;
    settings.voxel_size = 0.05;
    return settings;
  }
  /// The same in every run: whether a brief mark is read whole depends on the message.
  [[nodiscard]] OwnerKey make_key(std::size_t bits = 8) const {
    Digest256 secret{};
    secret[5] = std::byte{9};
    const Result<OwnerKey> made = compmark::make_key(secret, "2026-01-31T23:59:59Z", bits);
    REQUIRE(made.ok());
    REQUIRE(write_key(key, *made).ok());
    return *made;
  }
};

/// Stops after an iteration, if it is told to.
struct KeepingObserver : RunObserver {
  std::vector<std::string> warnings, notes;
  std::vector<RunBeginning> beginnings;
  std::vector<RunProgress> progress;
  std::size_t ends = 0, measured = 0, seen = 0, findings = 0, finished = 0, fits = 0;
  std::int64_t stop_after = 0;
  bool refuse_page = false, stop_fit = false;
  double now = 0;

  void on_warning(const std::string& sentence) override { warnings.push_back(sentence); }
  void on_note(const std::string& sentence) override { notes.push_back(sentence); }
  Result<Done> on_begin(const RunBeginning& beginning) override {
    beginnings.push_back(beginning);
    return Done{};
  }
  bool on_iteration(const RunProgress& line) override {
    progress.push_back(line);
    now += 1;
    return line.iteration != stop_after;
  }
  void on_iterations_end() override { ++ends; }
  bool on_fit(std::size_t /*done*/, std::size_t /*total*/) override {
    ++fits;
    return !stop_fit;
  }
  void on_measure(const DatasetViews& views) override { measured = views.size(); }
  void on_view(const SeenView& /*view*/) override { ++seen; }
  Result<Done> on_findings(const RunFindings& found, ThreadExecutor& /*executor*/) override {
    ++findings;
    CHECK(found.evaluation.views.size() == found.measured.size());
    if (refuse_page) return Error{ErrorKind::unwritable, "page", {}, "cannot be written", "make room"};
    return Done{};
  }
  void on_finished(const RunOutcome& /*outcome*/) override { ++finished; }
  [[nodiscard]] double seconds() const override { return now; }
};

inline bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  const auto first = read_file(a), second = read_file(b);
  REQUIRE(first.ok());
  REQUIRE(second.ok());
  return *first == *second;
}

}  // namespace compmark::testing
