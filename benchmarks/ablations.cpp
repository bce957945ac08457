// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The paper's ablation tables at a short schedule: target attribute (T4), components (T5), f' (T6) and capacity (T3),
// on two small scenes that need no data, or on those that are given. Every training is marked in the loss of the
// photographs as published, all phases scaled to the run; what is read "after compression" is read from a file that the
// HAC codec wrote.
//
//   ablations --out DIR [--data SCENE ...] [--iterations N] [--seeds S] [--threads T] [--only ROW[,ROW...]]
//
// Each training leaves a file in DIR/runs as soon as it is finished; the same command goes on with those that are
// missing. DIR/ablations.json, .md and .html are written after each. The same bits for any number of threads. Cost:
// docs/notebook/ablations.md.
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "ablations/record.hpp"
#include "ablations/report.hpp"
#include "ablations/rows.hpp"
#include "ablations/tables.hpp"
#include "ablations/training.hpp"
#include "compmark/core/thread_executor.hpp"

namespace {

using namespace compmark;

struct Options {
  std::filesystem::path out;
  std::vector<std::filesystem::path> data;
  std::int64_t iterations = 1000;
  std::size_t seeds = 3, threads = 0;
  std::vector<std::string> only;
};

constexpr const char* usage =
    "usage: ablations --out DIR [--data SCENE ...] [--iterations N] [--seeds S] [--threads T] [--only ROW[,ROW...]]\n";

std::string row_names() {
  std::string names;
  for (const ablation::Row& row : ablation::all_rows()) names += (names.empty() ? "" : ", ") + row.name;
  return names;
}

std::optional<Error> parse(int argc, char** argv, Options& options) {
  const auto wrong = [](std::string_view option, std::string problem, std::string remedy) {
    return Error{ErrorKind::invalid, {}, std::string(option), std::move(problem), std::move(remedy)};
  };
  for (int i = 1; i < argc; ++i) {
    const std::string_view name = argv[i];
    if (i + 1 >= argc) return wrong(name, "has no value, or is no option", usage);
    const std::string_view value = argv[++i];
    const auto number = [&](auto& target, std::int64_t least) -> std::optional<Error> {
      std::int64_t read = 0;
      const auto [end, problem] = std::from_chars(value.data(), value.data() + value.size(), read);
      if (problem != std::errc{} || end != value.data() + value.size() || read < least || read > 10000000)
        return wrong(name, "is " + std::string(value), "give a whole number from " + std::to_string(least));
      target = static_cast<std::remove_reference_t<decltype(target)>>(read);
      return std::nullopt;
    };
    std::optional<Error> problem;
    if (name == "--out") {
      options.out = value;
    } else if (name == "--data") {
      options.data.emplace_back(value);
      while (i + 1 < argc && std::string_view(argv[i + 1]).substr(0, 2) != "--") options.data.emplace_back(argv[++i]);
    } else if (name == "--iterations") {
      problem = number(options.iterations, 30);
    } else if (name == "--seeds") {
      problem = number(options.seeds, 1);
    } else if (name == "--threads") {
      problem = number(options.threads, 0);
    } else if (name == "--only") {
      std::string_view rest = value;
      while (!rest.empty()) {
        const std::string_view one = rest.substr(0, rest.find(','));
        rest.remove_prefix(std::min(rest.size(), one.size() + 1));
        bool known = false;
        for (const ablation::Row& row : ablation::all_rows()) known = known || row.name == one;
        if (!known) return wrong(name, "names " + std::string(one), "choose of " + row_names());
        options.only.emplace_back(one);
      }
    } else {
      return wrong(name, "is no option", usage);
    }
    if (problem) return problem;
  }
  if (options.out.empty()) return wrong("--out", "is missing", usage);
  return std::nullopt;
}

Result<std::vector<std::unique_ptr<ablation::Scene>>> open_scenes(const Options& options, ThreadExecutor& executor) {
  if (options.data.empty()) return ablation::built_in_scenes(options.out / "scenes", executor);
  std::vector<std::unique_ptr<ablation::Scene>> scenes;
  for (const std::filesystem::path& folder : options.data) {
    const std::filesystem::path name = folder.has_filename() ? folder.filename() : folder.parent_path().filename();
    for (const auto& other : scenes) {
      if (other->name == name.string()) {
        return Error{ErrorKind::invalid, folder.string(), "--data", "has the name of a scene before it",
                     "give folders of different names: their records are told apart by it"};
      }
    }
    Result<std::unique_ptr<ablation::Scene>> scene = ablation::open_scene(folder, name.string());
    if (!scene) return scene.error();
    scenes.push_back(std::move(*scene));
  }
  return scenes;
}

int fail(const Error& error) {
  std::fprintf(stderr, "ablations: %s\n", error.line().c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  if (const std::optional<Error> problem = parse(argc, argv, options)) {
    fail(*problem);
    return 2;
  }
  ThreadExecutor executor(options.threads);
  std::error_code status;
  std::filesystem::create_directories(options.out / "runs", status);
  if (status) {
    return fail({ErrorKind::unwritable, (options.out / "runs").string(), "",
                 "the folder cannot be created: " + status.message(), "choose another --out"});
  }
  Result<std::vector<std::unique_ptr<ablation::Scene>>> scenes = open_scenes(options, executor);
  if (!scenes) return fail(scenes.error());

  struct Job {
    ablation::Row row;
    ablation::Scene* scene;
    std::uint64_t seed;
  };
  std::vector<Job> jobs;  // whole tables of the first seed before the second
  for (std::uint64_t seed = 0; seed < options.seeds; ++seed) {
    for (const auto& scene : *scenes) {
      for (const ablation::Row& row : ablation::all_rows()) {
        if (!options.only.empty() &&
            std::find(options.only.begin(), options.only.end(), row.name) == options.only.end())
          continue;
        jobs.push_back({row, scene.get(), seed});
      }
    }
  }
  ablation::ReportHead head{options.iterations, options.seeds, {}};
  for (const auto& scene : *scenes) {
    const Camera<double> camera = scene->train.camera(0);
    head.scenes.push_back({scene->name, camera.width, camera.height, scene->train.size(), scene->test.size()});
  }
  std::vector<ablation::Record> records;
  for (std::size_t j = 0; j < jobs.size(); ++j) {
    const Job& job = jobs[j];
    const auto note = [&](const std::string& text) {
      std::fprintf(stderr, "ablations: %zu of %zu: %s, %s, seed %llu: %s\n", j + 1, jobs.size(),
                   job.scene->name.c_str(), job.row.name.c_str(), static_cast<unsigned long long>(job.seed),
                   text.c_str());
    };
    ablation::Record record;
    const ablation::Found found =
        ablation::find_record(options.out, job.scene->name, job.row.name, job.seed,
                              ablation::settings_json(*job.scene, options.iterations), record);
    if (found == ablation::Found::finished) {
      note("is there, not run again");
      records.push_back(std::move(record));
      continue;
    }
    if (found == ablation::Found::other_settings) note("is there with other settings: run again");
    if (found == ablation::Found::unreadable) note("what is there is no record: run again");
    Result<ablation::Record> trained = ablation::train_row(job.row, *job.scene, options.iterations, job.seed,
                                                           options.out / "runs" / "last.cmk", executor);
    if (!trained) return fail(trained.error());
    if (const Result<Done> written = ablation::write_record(options.out, *trained); !written)
      return fail(written.error());
    note(ablation::record_text(*trained));
    records.push_back(std::move(*trained));
    if (const Result<Done> written = ablation::write_report(options.out, head, records); !written)
      return fail(written.error());
  }
  if (const Result<Done> written = ablation::write_report(options.out, head, records); !written)
    return fail(written.error());
  std::filesystem::remove(options.out / "runs" / "last.cmk", status);
  std::printf("%s", ablation::report_markdown(head, records).c_str());
  return 0;
}
