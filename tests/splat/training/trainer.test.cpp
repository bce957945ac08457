// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <vector>

#include "support/growing_run.hpp"
#include "support/small_scene.hpp"

#if defined(__SANITIZE_ADDRESS__)
#define COMPMARK_COUNTS_ALLOCATIONS 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define COMPMARK_COUNTS_ALLOCATIONS 0
#endif
#endif
#if !defined(COMPMARK_COUNTS_ALLOCATIONS)
#define COMPMARK_COUNTS_ALLOCATIONS 1
#endif

// Counts every allocation of this program: "nothing allocates after warm-up" is a test, not a hope.
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"  // malloc and free do match, in the two replaced operators
#endif
namespace {
std::atomic<std::size_t> allocations{0};
}
#if COMPMARK_COUNTS_ALLOCATIONS  // the address sanitizer has operators of its own
void* operator new(std::size_t size) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  if (void* p = std::malloc(size != 0 ? size : 1)) return p;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  const auto a = static_cast<std::size_t>(alignment);
  if (void* p = std::aligned_alloc(a, (size + a - 1) / a * a)) return p;
  throw std::bad_alloc();
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
#endif

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::cloud;

struct GrownRecipe : DefaultRecipe<float, compmark::testing::scene_shape> {};

TrainSettings short_run() { return compmark::testing::growing_run(300); }

template <class E>
struct Run {
  E executor;
  BlobViews views;
  TrainSettings settings = short_run();
  Trainer<GrownRecipe, E> trainer;

  template <class... Args>
  explicit Run(Args... args) : executor(args...),
                               trainer(settings, views.size(), 3.3, executor) {
    const auto points = cloud(300, 1);
    REQUIRE(trainer.initialise(points).ok());
  }
};

std::vector<float> values(const Model<GrownRecipe>& model) {
  return {model.arena.all_values().begin(), model.arena.all_values().end()};
}
bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](float x, float y) {
           return std::bit_cast<std::uint32_t>(x) == std::bit_cast<std::uint32_t>(y);
         });
}

}  // namespace

TEST_CASE("training/trainer: the loss falls, anchors grow and are pruned, and everything stays finite") {
  Run<ThreadExecutor> run(std::size_t{2});
  double first = 0, last = 0;
  std::size_t grown = 0, pruned = 0;
  while (!run.trainer.finished()) {
    const Result<IterationReport> report = run.trainer.step(run.views);
    REQUIRE(report.ok());
    if (report->iteration <= 20) first += report->loss.total;
    if (report->iteration > 280) last += report->loss.total;
    grown += report->grown;
    pruned += report->pruned;
    CHECK(report->skipped_blocks == 0);
  }
  MESSAGE("mean loss ", first / 20, " -> ", last / 20, ", anchors ", run.trainer.model().anchor_count(), ", grown ",
          grown, ", pruned ", pruned);
  CHECK(last < 0.5 * first);
  CHECK(grown > 0);
  CHECK(pruned > 0);
  for (const float value : values(run.trainer.model())) REQUIRE(std::isfinite(value));
}

TEST_CASE("training/trainer: same seed, same bits, for 1, 2 and 4 threads; another seed, other bits") {
  const auto train = [](std::size_t threads, std::uint64_t seed) {
    ThreadExecutor executor(threads);
    BlobViews views;
    TrainSettings settings = short_run();
    settings.iterations = 150;
    settings.seed = seed;
    Trainer<GrownRecipe, ThreadExecutor> trainer(settings, views.size(), 3.3, executor);
    REQUIRE(trainer.initialise(cloud(300, 1)).ok());
    REQUIRE(trainer.run(views).ok());
    return values(trainer.model());
  };
  const std::vector<float> reference = train(1, 5);
  CHECK(same_bits(reference, train(1, 5)));
  CHECK(same_bits(reference, train(2, 5)));
  CHECK(same_bits(reference, train(4, 5)));
  CHECK(!same_bits(reference, train(1, 6)));
}

TEST_CASE("training/checkpoint: a run stopped anywhere and resumed ends in the bits of an uninterrupted run") {
  Run<SerialExecutor> uninterrupted;
  REQUIRE(uninterrupted.trainer.run(uninterrupted.views).ok());
  const std::vector<float> reference = values(uninterrupted.trainer.model());
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "compmark-checkpoint-test.safetensors";
  // before, at and after adjustments, first and last iteration
  for (const std::int64_t stop : {1, 29, 30, 31, 100, 147, 299}) {
    Run<SerialExecutor> first;
    while (first.trainer.state().iteration < stop) REQUIRE(first.trainer.step(first.views).ok());
    ModelInfo info;
    info.recipe = "small";
    REQUIRE(write_checkpoint(path, first.trainer.state(), first.settings, info, 12.5).ok());

    Run<SerialExecutor> second;
    Result<Checkpoint<Trainer<GrownRecipe, SerialExecutor>>> loaded =
        read_checkpoint<Trainer<GrownRecipe, SerialExecutor>>(path, second.settings, info);
    REQUIRE(loaded.ok());
    CHECK(loaded->seconds == 12.5);
    second.trainer.restore(std::move(loaded->state));
    CHECK(second.trainer.state().iteration == stop);
    REQUIRE(second.trainer.run(second.views).ok());
    CHECK(same_bits(reference, values(second.trainer.model())));
  }
  std::filesystem::remove(path);
}

TEST_CASE("training/checkpoint: other settings and broken files are refused with the field's name") {
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "compmark-checkpoint-refuse.safetensors";
  Run<SerialExecutor> run;
  for (int i = 0; i < 40; ++i) REQUIRE(run.trainer.step(run.views).ok());
  ModelInfo info;
  info.recipe = "small";
  REQUIRE(write_checkpoint(path, run.trainer.state(), run.settings, info, 0).ok());
  TrainSettings other = run.settings;
  other.lambda_dssim = 0.3;
  const auto refused = read_checkpoint<Trainer<GrownRecipe, SerialExecutor>>(path, other, info);
  REQUIRE(!refused.ok());
  CHECK(refused.error().problem.find("lambda_dssim") != std::string::npos);
  // Numbers that are the profile's own are not in the file, and those of a run with others must not become them.
  TrainSettings coded = run.settings;
  coded.rate.lambda *= 4;
  REQUIRE(write_checkpoint(path, run.trainer.state(), coded, info, 0).ok());
  const auto another_rate = read_checkpoint<Trainer<GrownRecipe, SerialExecutor>>(path, run.settings, info);
  REQUIRE(!another_rate.ok());
  CHECK(another_rate.error().problem.find("lambda") != std::string::npos);
  CHECK(read_checkpoint<Trainer<GrownRecipe, SerialExecutor>>(path, coded, info).ok());
  REQUIRE(write_checkpoint(path, run.trainer.state(), run.settings, info, 0).ok());
  const std::vector<std::byte> bytes = *read_file(path);
  for (std::size_t size = 0; size < bytes.size(); size += bytes.size() / 60) {
    REQUIRE(write_file(path, std::span<const std::byte>(bytes).first(size)).ok());
    CHECK(!read_checkpoint<Trainer<GrownRecipe, SerialExecutor>>(path, run.settings, info).ok());
  }
  std::filesystem::remove(path);
}

TEST_CASE(
    "training/checkpoint: a run is resumed with the cameras, the lenses, the origin, the unit and the effects it had") {
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "compmark-checkpoint-views.safetensors";
  Run<SerialExecutor> run;
  REQUIRE(run.trainer.step(run.views).ok());
  const Lens phone{LensModel::opencv, {-0.25, 0.08, 0.004, -0.003}};
  ModelInfo info;
  info.recipe = "small";
  info.effects = {"lens_distortion"};
  info.origin = {5e5, 0.1, -2e5};
  info.unit = 0.25;
  for (std::size_t i = 0; i < 3; ++i)
    info.views.push_back({"v" + std::to_string(i), i == 2, run.views.camera(i), phone});
  info.views[1].lens = {LensModel::simple_pinhole, {}};  // beside lenses a pinhole keeps its name, alone it does not
  const auto field = [&](const ModelInfo& now, const std::string& piece) {
    const auto loaded = read_checkpoint<Trainer<GrownRecipe, SerialExecutor>>(path, run.settings, now);
    if (loaded.ok()) return std::string();
    CAPTURE(loaded.error().line());
    CHECK(loaded.error().line().find(piece) != std::string::npos);
    CHECK(loaded.error().remedy.find("resume with the options") != std::string::npos);
    return loaded.error().field;
  };
  REQUIRE(write_checkpoint(path, run.trainer.state(), run.settings, info, 0).ok());
  CHECK(field(info, "").empty());
  ModelInfo other = info;
  other.views[2].lens.parameters[3] = std::nextafter(-0.003, 0.0);
  CHECK(field(other, "view 2 (v2)") == "lens");
  other = info;
  other.views[0].lens = {LensModel::radial, phone.parameters};
  CHECK(field(other, "view 0 (v0)") == "lens");
  other = info;
  for (StoredView& view : other.views) view.lens = {};  // taken out of the images instead
  CHECK(field(other, "view 0 (v0)") == "lens");
  other = info;
  other.origin[2] = std::nextafter(other.origin[2], 0.0);
  CHECK(field(other, "500000.0") == "origin");
  other = info;
  other.unit = 0.5;
  CHECK(field(other, "is 0.25 in the checkpoint and 0.5 now") == "unit");
  other = info;
  other.views[2].test = false;
  CHECK(field(other, "view 2 (v2)") == "views");
  other = info;
  other.views[1].camera.cx += 1e-9;
  CHECK(field(other, "view 1 (v1)") == "views");
  other = info;
  other.effects = {"lens_ignored"};
  CHECK(field(other, "are lens_distortion in the checkpoint and lens_ignored now") == "effects");

  // Pinholes of either name, and a scene that was not moved, leave nothing in the file, and are what is read from it.
  for (StoredView& view : info.views) view.lens = {LensModel::simple_pinhole, {}};
  info.origin = {0, 0, 0};
  info.unit = 1;
  REQUIRE(write_checkpoint(path, run.trainer.state(), run.settings, info, 0).ok());
  CHECK(field(info, "").empty());
  info.views[0].lens = phone;
  CHECK(field(info, "view 0 (v0)") == "lens");
  std::filesystem::remove(path);
}

TEST_CASE("training/trainer: nothing allocates after warm-up, between adjustments") {
#if !COMPMARK_COUNTS_ALLOCATIONS
  MESSAGE("skipped: the address sanitizer replaces operator new, which this test counts");
  return;
#endif
  ThreadExecutor executor(2);
  BlobViews views;
  TrainSettings settings = short_run();
  settings.grow_after = 30000;  // no adjustments: the steady state
  settings.grow_until = 30000;
  Trainer<GrownRecipe, ThreadExecutor> trainer(settings, views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(cloud(300, 1)).ok());
  // Warm-up is over when the largest view has been seen with the model as large as it will get: footprints still vary from view to view.
  for (int i = 0; i < 120; ++i) REQUIRE(trainer.step(views).ok());
  const std::size_t before = allocations.load();
  std::size_t quiet = 0;
  for (int i = 0; i < 60; ++i) {
    const std::size_t start = allocations.load();
    REQUIRE(trainer.step(views).ok());
    quiet += allocations.load() == start ? 1 : 0;
  }
  const std::size_t during = allocations.load() - before;
  MESSAGE(during, " allocations in 60 iterations, ", quiet, " iterations without any");
  CHECK(quiet >= 55);  // a buffer may still grow by half when a view shows more pairs than any before
}

TEST_CASE("training/trainer: the anchor limit holds and is reported when the cloud alone exceeds it") {
  ThreadExecutor executor(1);
  BlobViews views;
  TrainSettings settings = short_run();
  settings.max_anchors = 320;
  Trainer<GrownRecipe, ThreadExecutor> trainer(settings, views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(cloud(300, 1)).ok());
  while (!trainer.finished()) {
    const Result<IterationReport> report = trainer.step(views);
    REQUIRE(report.ok());
    REQUIRE(report->anchors <= 320);
  }
  settings.max_anchors = 100;
  Trainer<GrownRecipe, ThreadExecutor> refused(settings, views.size(), 3.3, executor);
  const Result<Done> result = refused.initialise(cloud(300, 1));
  REQUIRE(!result.ok());
  CHECK(result.error().field == "max_anchors");
}
