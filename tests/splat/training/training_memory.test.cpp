// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The estimate of a training's memory against the peak of a process that trains, and the refusal before anything is taken.
#include "compmark/splat/training/training_memory.hpp"

#include <doctest/doctest.h>

#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <cstdlib>
#include <fstream>
#include <string>

#include "support/short_training.hpp"
#include "support/small_scene.hpp"

#if defined(__linux__)
#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>
#endif

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::cloud;
using compmark::testing::SmallRecipe;

struct FullRecipe : DefaultRecipe<float> {};
struct FullHac : recipes::Hac<DefaultRecipe<float>> {};

TrainSettings fine_cells() {
  TrainSettings settings;
  settings.iterations = 30000;
  settings.voxel_size = 0.0005;
  return settings;
}

#if defined(__linux__)
double resident(const std::string& field) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(field, 0) == 0) return 1024 * std::stod(line.substr(field.size()));
  }
  return 0;
}
/// Most bytes that the first iterations of a training add to a process, which is a new one.
template <class R>
double measured_peak(std::size_t anchors, int side) {
  int ends[2];
  REQUIRE(pipe(ends) == 0);
  const pid_t child = fork();
  if (child == 0) {
    malloc_trim(0);
    const double before = resident("VmRSS:");
    ThreadExecutor executor(1);
    const BlobViews views{2, side, side};
    Trainer<R, ThreadExecutor> trainer(fine_cells(), views.size(), 3.3, executor);
    bool good = trainer.initialise(cloud(anchors, 1)).ok();
    for (int i = 0; i < 2; ++i) good = trainer.step(views).ok() && good;
    const double peak = good ? resident("VmHWM:") - before : 0;
    const bool told = write(ends[1], &peak, sizeof peak) == sizeof peak;
    _exit(told ? 0 : 1);
  }
  close(ends[1]);
  double peak = 0;
  CHECK(read(ends[0], &peak, sizeof peak) == sizeof peak);
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return peak;
}
#endif

}  // namespace

#if defined(__linux__)
TEST_CASE(
    "training/training_memory: the estimate is within a third of the measured peak, of few and many anchors, small and "
    "large images, with a codec and without") {
  if (compmark::testing::short_trainings) return;  // a sanitizer keeps what is freed
  const auto compare = [](const std::string& name, double estimate, double measured) {
    MESSAGE(name, ": ", estimate / 1e6, " MB estimated, ", measured / 1e6, " MB measured");
    CHECK(estimate > 0.75 * measured);
    CHECK(estimate < 1.35 * measured);
  };
  for (const std::size_t anchors : {std::size_t{15000}, std::size_t{60000}, std::size_t{150000}}) {
    MemoryBudget budget;
    budget.pixels = 64 * 64;
    compare("plain", training_memory<FullRecipe>(anchors, budget).total(), measured_peak<FullRecipe>(anchors, 64));
  }
  MemoryBudget large;
  large.pixels = 1024 * 1024;
  compare("large images", training_memory<FullRecipe>(3000, large).total(), measured_peak<FullRecipe>(3000, 1024));
  MemoryBudget small;
  small.pixels = 64 * 64;
  compare("hac", training_memory<FullHac>(60000, small).total(), measured_peak<FullHac>(60000, 64));
}
#endif

TEST_CASE("training/training_memory: what does not fit is refused before it is taken, with what would fit") {
  SerialExecutor executor;
  const BlobViews views;
  Trainer<SmallRecipe, SerialExecutor> trainer(fine_cells(), views.size(), 3.3, executor);
  MemoryBudget budget;
  budget.pixels = 64 * 64;
  budget.bytes = training_memory<SmallRecipe>(1000, budget).total();
  CHECK(trainer.initialise(cloud(900, 1), budget).ok());
  const Result<Done> refused = trainer.initialise(cloud(2000, 1), budget);
  REQUIRE(!refused.ok());
  CHECK(refused.error().kind == ErrorKind::exhausted);
  CHECK(refused.error().problem.find("2000 anchors") != std::string::npos);
  for (const char* offered : {"--voxel-size", "--max-anchors", "--downscale"})
    CHECK(refused.error().remedy.find(offered) != std::string::npos);
  const std::string most = "at most ";
  const std::size_t at = refused.error().remedy.find(most);
  REQUIRE(at != std::string::npos);
  CHECK(std::stod(refused.error().remedy.substr(at + most.size())) == doctest::Approx(1000).epsilon(0.01));
  CHECK(trainer.initialise(cloud(2000, 1)).ok());  // without a budget nothing is asked
  // Images alone can be too much, and so can the cloud before its cells are counted.
  budget.images = 1e12;
  const Result<Done> images = check_training_memory<SmallRecipe>(1, budget);
  REQUIRE(!images.ok());
  CHECK(images.error().remedy.find("--memory-budget") != std::string::npos);
  budget.images = 0;
  budget.bytes = 1e6;
  CHECK(check_cloud_memory(1000, budget).ok());
  CHECK(!check_cloud_memory(3'000'000, budget).ok());
}

TEST_CASE(
    "training/training_memory: a growth for which there is no memory left is refused, with the limit that would have "
    "stopped it") {
  MemoryBudget budget;
  CHECK(check_growth_memory<SmallRecipe>(100'000, 50'000, budget).ok());  // the system does not say
  budget.bytes = 1e12;
  CHECK(check_growth_memory<SmallRecipe>(100'000, 50'000, budget).ok());
  const double more =
      training_memory<SmallRecipe>(150'000, budget).total() - training_memory<SmallRecipe>(100'000, budget).total();
  budget.bytes = more;  // without room for the copies of a row edit
  const Result<Done> refused = check_growth_memory<SmallRecipe>(100'000, 50'000, budget);
  REQUIRE(!refused.ok());
  CHECK(refused.error().kind == ErrorKind::exhausted);
  CHECK(refused.error().problem.find("50000 to 100000 anchors") != std::string::npos);
  CHECK(refused.error().remedy.find("--resume") != std::string::npos);
  CHECK(refused.error().remedy.find("--max-anchors 100000") != std::string::npos);
  budget.bytes = more + training_memory<SmallRecipe>(150'000, budget).parameters;
  CHECK(check_growth_memory<SmallRecipe>(100'000, 50'000, budget).ok());
}
