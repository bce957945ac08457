// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/compare.hpp>
#include <compmark/app/reading.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "small_decoder.hpp"
#include "small_scene_models.hpp"

namespace {

using namespace compmark;
namespace fs = std::filesystem;

/// Two models of one scene, the second with other features; a compressed one of a third.
struct CompareFiles {
  testing::SmallScene scene{"compmark-app-compare"};
  ThreadExecutor executor{2};
  fs::path marked = scene.write<recipes::Scaffold>("marked.safetensors", "scaffold", 5),
           plain = scene.write<recipes::Scaffold>("plain.safetensors", "scaffold", 6);
  CompareObserver silent;

  [[nodiscard]] CompareSettings settings() const {
    CompareSettings settings;
    settings.models = {marked};
    settings.data = scene.data;
    return settings;
  }
  Result<Comparison> compare(const CompareSettings& settings) { return compare_models(settings, executor, silent); }
};

/// Models and their views in the order in which they are told of.
struct Events final : CompareObserver {
  std::vector<std::string> seen;
  void on_model(const fs::path& path, std::size_t view_count) override {
    seen.push_back(path.filename().string() + " " + std::to_string(view_count));
  }
  bool on_view(const SeenView& view) override {
    seen.push_back(std::to_string(view.index));
    return seen.size() != stop_after;
  }
  std::size_t stop_after = 0;
};

}  // namespace

TEST_CASE("app/compare: a model is measured against the photographs and against its unmarked counterpart") {
  CompareFiles files;
  CompareSettings settings = files.settings();
  settings.unmarked = {files.plain};
  Events events;
  const Result<Comparison> comparison = compare_models(settings, files.executor, events);
  if (!comparison) FAIL(comparison.error().line());
  REQUIRE(comparison->models.size() == 2);
  const ComparedModel &marked = comparison->models[0], &plain = comparison->models[1];
  CHECK(events.seen == std::vector<std::string>{"marked.safetensors 2", "0", "1", "plain.safetensors 2", "0", "1"});
  CHECK(marked.name == "marked.safetensors");
  CHECK(marked.bytes == fs::file_size(files.marked));
  CHECK(marked.codec.empty());
  CHECK((!marked.is_unmarked && plain.is_unmarked));
  REQUIRE(marked.unmarked.has_value());
  CHECK(*marked.unmarked == 1);
  REQUIRE(marked.against_unmarked.size() == 2);
  CHECK(plain.against_unmarked.empty());
  CHECK(marked.against_unmarked[0].psnr > 0);
  CHECK(marked.against_unmarked[0].psnr < 60);

  Events impatient;
  impatient.stop_after = 3;
  CHECK(compare_models(settings, files.executor, impatient).error().kind == ErrorKind::cancelled);
  CHECK(impatient.seen.size() == 3);

  // The same model as its own counterpart: nothing was changed, and it is measured once.
  settings.unmarked = {files.marked};
  const Result<Comparison> itself = files.compare(settings);
  REQUIRE(itself.ok());
  CHECK(itself->models.size() == 1);
  CHECK(itself->models[0].is_unmarked);
  CHECK(itself->models[0].against_unmarked[0].psnr > 99);
}

TEST_CASE("app/compare: a compressed model tells its codec and its bytes, which add up to the file") {
  CompareFiles files;
  const fs::path trained = files.scene.write<recipes::HacFitted>("coded.safetensors", "hac+fitted", 5);
  const fs::path file = files.scene.folder.path / "coded.cmk";
  REQUIRE(compress_file(trained, file, CodedModelSettings{}, files.executor).ok());
  CompareSettings settings = files.settings();
  settings.models = {trained, file};
  const Result<Comparison> comparison = files.compare(settings);
  if (!comparison) FAIL(comparison.error().line());
  const ComparedModel& coded = comparison->models[1];
  CHECK(coded.codec == "hac");
  std::uint64_t bytes = 0;
  for (const auto& [name, size] : coded.sections) bytes += size;
  CHECK(bytes == fs::file_size(file));
  CHECK(coded.anchors == testing::small_anchors);
  CHECK(comparison->models[0].sections.empty());
}

TEST_CASE("app/compare: with a key and its decoder the message is read from every model, as verify reads it") {
  CompareFiles files;
  CompareSettings settings = files.settings();
  constexpr int bits = 16;
  const OwnerKey key = testing::small_key(1, bits);
  settings.key = files.scene.folder.path / "owner.key";
  settings.decoder = files.scene.folder.path / "decoder.safetensors";
  REQUIRE(write_key(settings.key, key).ok());
  testing::write_decoder(settings.decoder, bits);
  const Result<Comparison> comparison = files.compare(settings);
  if (!comparison) FAIL(comparison.error().line());
  ReadingSettings reading;
  reading.model = files.marked;
  reading.decoder = settings.decoder;
  const Result<Reading> read = read_messages(reading, key, files.executor);
  REQUIRE(read.ok());
  const Result<Verification> direct = verify_message(message_of(key), read->views, VerifySettings{});
  REQUIRE(direct.ok());
  REQUIRE(comparison->models[0].verification.has_value());
  CHECK(comparison->models[0].verification->fused == direct->fused);
  CHECK(comparison->message == message_of(key));
  settings.decoder.clear();
  CHECK(files.compare(settings).error().field == "--decoder");
}

TEST_CASE("app/compare: what cannot be compared is refused by name") {
  CompareFiles files;
  CompareSettings settings = files.settings();
  settings.unmarked = {files.plain, files.plain};
  CHECK(files.compare(settings).error().field == "--unmarked");
  settings.unmarked.clear();
  settings.models = {files.marked, files.plain};
  CHECK(files.compare(settings).ok());  // control
  settings.data = files.scene.folder.path / "none";
  CHECK_FALSE(files.compare(settings).ok());
  settings.data = files.scene.data;
  settings.models = {files.marked, files.scene.folder.path / "none"};
  CHECK(files.compare(settings).error().kind == ErrorKind::not_found);
}
