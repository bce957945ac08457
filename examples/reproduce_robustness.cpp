// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The robustness tables of marked models: edits of pictures and of models with curves of strength, LightGaussian, int8,
// PGD and collusion, read blind and, with the unmarked model, informed; each beside the PSNR that the thief is left
// with (docs/robustness.md).
//
//   reproduce_robustness --run DIR ... --out OUT [--key KEY] [--decoder FILE] [--unmarked FILE] [--copy MODEL ...]
//     [--also NAME=MODEL ...] [--views N] [--informed-views N] [--picture A ...] [--model A ...] [--pgd A ...] [--pruned]
//     [--restored]
//
// A run is a folder of compmark train or embed, or one with such folders in it. What is finished is not measured again:
// every cell has a file in OUT/cells. OUT/robustness.csv, .json, .md and .html are written after each scene.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <compmark/app/robustness.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/watermark/attack/attack_list.hpp>
#include <compmark/watermark/attack/model_attacks.hpp>
#include <compmark/watermark/attack/picture_attacks.hpp>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/decoder_choice.hpp"
#include "compmark/numbers.hpp"
#include "compmark/options.hpp"
#include "compmark/process.hpp"
#include "fidelity/command_line.hpp"
#include "robustness/cells.hpp"
#include "robustness/pages.hpp"

namespace {

using namespace robustness;

constexpr const char* program = "reproduce_robustness";

struct Options {
  std::vector<fs::path> runs, copies;
  std::vector<std::string> also, pictures, models, pgd;
  fs::path out, key, decoder, unmarked;
  std::size_t views = 8, informed_views = 1, recipient = 0, threads = 0;
  std::uint64_t seed = 0;
  bool pruned = false, restored = false;
};

int fail(const Error& error) { return fidelity::fail(program, error); }

/// The model of a run, compressed before not.
std::optional<fs::path> model_in(const fs::path& folder) {
  for (const char* name : {"model.cmk", "model.safetensors"}) {
    if (fs::is_regular_file(folder / name)) return folder / name;
  }
  return std::nullopt;
}

Result<Scene> scene_of(const fs::path& folder, const fs::path& model, const Options& options) {
  Scene scene;
  const fs::path clean = fs::absolute(folder).lexically_normal();
  scene.name = (clean.has_filename() ? clean : clean.parent_path()).filename().string();
  scene.model = model;
  scene.key = options.key;
  for (const fs::path& beside : {folder / "owner.key", folder.parent_path() / "owner.key"}) {
    if (scene.key.empty() && fs::is_regular_file(beside)) scene.key = beside;
  }
  if (scene.key.empty())
    return Error{ErrorKind::invalid, folder.string(), "--key", "is missing", "name the key of the mark"};
  scene.decoder = options.decoder;
  if (Result<Done> chosen = tool::choose_decoder(scene.decoder, scene.model); !chosen) return chosen.error();
  scene.unmarked = options.unmarked;
  return scene;
}

Result<std::vector<Scene>> scenes_of(const Options& options) {
  std::vector<Scene> scenes;
  for (const fs::path& run : options.runs) {
    std::vector<fs::path> folders;
    if (model_in(run)) {
      folders.push_back(run);
    } else {
      std::error_code status;
      for (fs::directory_iterator entry(run, status), end; !status && entry != end; entry.increment(status)) {
        if (entry->is_directory() && model_in(entry->path())) folders.push_back(entry->path());
      }
      std::sort(folders.begin(), folders.end());
    }
    if (folders.empty())
      return Error{ErrorKind::invalid, run.string(), "--run", "holds no model", "name a folder of compmark train"};
    for (const fs::path& folder : folders) {
      Result<Scene> scene = scene_of(folder, *model_in(folder), options);
      if (!scene) return scene.error();
      if (std::any_of(scenes.begin(), scenes.end(), [&](const Scene& other) { return other.name == scene->name; }))
        return Error{ErrorKind::invalid, folder.string(), "--run", "has the name of another", "rename the folder"};
      scenes.push_back(std::move(*scene));
    }
  }
  if (options.restored && options.unmarked.empty()) {
    return Error{
        ErrorKind::invalid, {}, "--restored", "needs the unmarked model", "give --unmarked, or leave --restored out"};
  }
  if (scenes.size() > 1 && !(options.unmarked.empty() && options.copies.empty() && options.also.empty()))
    return Error{ErrorKind::invalid, {}, "--unmarked, --copy, --also", "are of one scene", "give one --run"};
  return scenes;
}

Result<std::vector<Row>> rows_of(const Options& options) {
  std::vector<Row> rows = all_rows();
  if (!(options.pictures.empty() && options.models.empty() && options.pgd.empty())) {
    rows.resize(1);  // the renders as they are, and what is named
    const auto named = [&](const std::vector<std::string>& texts, const char* table, RobustnessKind kind) {
      for (const std::string& text : texts) rows.push_back({table, {kind, text}});
    };
    named(options.pictures, "pictures", RobustnessKind::picture);
    named(options.models, "models", RobustnessKind::model);
    named(options.pgd, "removal", RobustnessKind::pgd);
  }
  if (!options.unmarked.empty())
    rows.push_back({"removal", {RobustnessKind::average, "average with the unmarked", {options.unmarked}}});
  for (std::size_t n = 1; n <= options.copies.size(); ++n) {
    rows.push_back({"removal",
                    {RobustnessKind::average,
                     "average of " + std::to_string(n + 1) + " copies",
                     {options.copies.begin(), options.copies.begin() + static_cast<std::ptrdiff_t>(n)}}});
  }
  for (const std::string& text : options.also) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      return Error{ErrorKind::invalid, text, "--also", "is no NAME=MODEL", "name it, as second_owner=m.safetensors"};
    rows.push_back({"removal", {RobustnessKind::other, text.substr(0, equals), {text.substr(equals + 1)}}});
  }
  return rows;
}

/// Whether every attack is one of its list, told before anything is measured.
Result<Done> check_rows(const std::vector<Row>& rows) {
  for (const Row& row : rows) {
    Result<Done> known = Done{};
    if (row.attack.kind == RobustnessKind::picture)
      known = compmark::check_attack<compmark::PictureAttacks>(row.attack.text);
    if (row.attack.kind == RobustnessKind::model)
      known = compmark::check_attack<compmark::ModelAttacks>(row.attack.text);
    if (!known) return known;
  }
  return Done{};
}

/// Measures what is missing of a scene.
Result<Done> measure(const Scene& scene, const std::vector<Row>& rows, const Options& options,
                     compmark::ThreadExecutor& executor, std::vector<Measured>& measured) {
  compmark::RobustnessSettings settings;
  settings.model = scene.model;
  settings.key = scene.key;
  settings.decoder = scene.decoder;
  settings.unmarked = scene.unmarked;
  settings.pictures = options.out / "pictures" / scene.name;
  settings.views = options.views;
  settings.informed_views = options.informed_views;
  settings.seed = options.seed;
  settings.recipient = options.recipient;
  settings.pruned = options.pruned;
  settings.restored = options.restored;
  const Result<Json> identity = identity_of(scene, settings);
  if (!identity) return identity.error();
  std::optional<compmark::RobustnessBench> bench;
  for (const Row& row : rows) {
    const fs::path file = cell_file(options.out, scene, row.attack);
    Json of = *identity;
    of["attack"] = row.attack.text;
    for (const fs::path& other : row.attack.files) {
      const Result<std::string> digest = compmark::file_sha256(other);
      if (!digest) return digest.error();
      of["files"].push_back(*digest);
    }
    std::optional<RobustnessCell> cell = finished_cell(file, of);
    if (!cell) {
      if (!bench) {
        Result<compmark::RobustnessBench> opened = compmark::RobustnessBench::open(settings, executor);
        if (!opened) return opened.error();
        bench = std::move(*opened);
      }
      const Result<RobustnessCell> now = bench->measure(row.attack, executor);
      if (!now) return now.error();
      if (Result<Done> written = write_cell(file, of, *now); !written) return written;
      cell = *now;
      std::fprintf(stderr, "%s: %s, %s: %.1f %% of the bits, p %.1e\n", program, scene.name.c_str(),
                   row.attack.text.c_str(), 100 * cell->mean, cell->p_value);
    }
    measured.push_back({scene.name, row, *cell});
  }
  return Done{};
}

int run(int argc, char** argv) {
  CLI::App app{"what attacks on pictures and models cost a mark, and what they cost the thief"};
  Options options;
  app.add_option("--run", options.runs, "folders of marked models, or folders of such folders")->required();
  app.add_option("--out", options.out, "folder of the tables")->required();
  app.add_option("--key", options.key, "the owner's key (default: owner.key in the run's folder or above it)");
  app.add_option("--recipient", options.recipient, "whose copies the models are, where the key has recipients");
  app.add_option("--decoder", options.decoder, tool::reading_decoder_text);
  app.add_option("--unmarked", options.unmarked,
                 "the unmarked model, for informed reading, for averaging and for --restored");
  app.add_option("--copy", options.copies, "copies with other marks, for collusion");
  app.add_option("--also", options.also, "NAME=MODEL: a model that a thief made of it: marked again, trained on");
  app.add_option("--picture", options.pictures, "attacks on pictures, as jpeg:50, in place of all rows");
  app.add_option("--model", options.models, "attacks on models, as prune:0.2, in place of all rows");
  app.add_option("--pgd", options.pgd, "pgd, pgd_random or pgd_no_key with epsilon, in place of all rows");
  app.add_option("--views", options.views, "cameras of the test that are read, evenly spaced; 0: all")
      ->capture_default_str();
  app.add_option("--informed-views", options.informed_views, "pictures of each cell that are read informed")
      ->capture_default_str();
  app.add_option("--seed", options.seed, "of attacks that draw random numbers")->capture_default_str();
  app.add_flag("--pruned", options.pruned,
               "read attacked models as verify --pruned does, in four ways; p-values are corrected for them");
  app.add_flag("--restored", options.restored,
               "read attacked models also as verify --restored does, put back together in the --unmarked one");
  app.add_option("--threads", options.threads, "0: all; the result is the same for any number")
      ->capture_default_str()
      ->check(tool::in_range(tool::thread_range));
  if (const std::optional<int> over = fidelity::parse(app, argc, argv)) return *over;
  const Result<std::vector<Scene>> scenes = scenes_of(options);
  if (!scenes) return fail(scenes.error());
  const Result<std::vector<Row>> rows = rows_of(options);
  if (!rows) return fail(rows.error());
  if (const Result<Done> known = check_rows(*rows); !known) return fail(known.error());
  compmark::ThreadExecutor executor(options.threads);
  std::vector<Measured> measured;
  for (const Scene& scene : *scenes) {
    if (Result<Done> done = measure(scene, *rows, options, executor, measured); !done) return fail(done.error());
    if (Result<Done> written = write_tables(options.out, measured); !written) return fail(written.error());
  }
  std::printf("%zu cells in %s\n", measured.size(), (options.out / "robustness.html").string().c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  tool::prepare_process();
  return tool::finish_output(run(argc, argv));
}
